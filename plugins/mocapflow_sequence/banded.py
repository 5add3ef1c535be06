"""Least squares over a sequence: corrections of every frame against accelerations, as one banded system."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64, Bool

FLOOR = 1e-9  # rad^2 or m^2; keeps directions that a solver holds fixed from being infinitely certain


def difference_weights(time: F64) -> F64:
    """Return the weights (T - 2, 3) of three neighbouring samples in the acceleration at the middle one, 1/s^2."""
    before, after = np.diff(time)[:-1], np.diff(time)[1:]
    middle = (before + after) / 2
    first, last = 1 / (before * middle), 1 / (after * middle)
    return np.column_stack([first, -(first + last), last])


def minimise(covariance: F64, acceleration: F64, limits: F64, time: F64, wanted: Bool) -> tuple[F64, F64]:
    """Return the corrections x that minimise sum |x_t|^2 / covariance_t + sum |acceleration + D x|^2 / limits^2.

    Args:
        covariance: (T, R, R) of each frame.
        acceleration: (T - 2, R) of the uncorrected sequence at its inner frames, per s^2.
        limits: (R,) standard deviation of the acceleration, per s^2.
        time: (T,) s.
        wanted: (T,) frames whose covariance after smoothing is wanted.

    Returns:
        The corrections (T, R) and the smoothed covariances (K, R, R) of the wanted frames.
    """
    from scipy.linalg import cho_solve_banded, cholesky_banded

    count, size = covariance.shape[:2]
    weights, precision = difference_weights(time), 1 / limits**2
    bands = np.zeros((2 * size + 1, count, size))  # upper form, unknowns frame by frame
    row, column = np.triu_indices(size)
    variance, axes = np.linalg.eigh(covariance)  # rounding may leave a variance just below zero
    information = (axes / (np.maximum(variance, 0) + FLOOR)[:, None]) @ np.swapaxes(axes, 1, 2)
    bands[2 * size + row - column, :, column] = information[:, row, column].T
    pull = np.zeros((count, size))
    for i in range(3):
        pull[i : count - 2 + i] -= weights[:, i, None] * precision * acceleration
        for j in range(i, 3):
            bands[(2 - (j - i)) * size, j : count - 2 + j] += (weights[:, i] * weights[:, j])[:, None] * precision
    factor = cholesky_banded(bands.reshape(2 * size + 1, -1))
    corrections: F64 = cho_solve_banded((factor, False), pull.ravel()).reshape(count, size)
    columns = np.flatnonzero(wanted)
    smoothed = np.empty((len(columns), size, size))
    for place, frame in enumerate(columns):
        unit = np.zeros((count * size, size))
        unit[frame * size : (frame + 1) * size] = np.eye(size)
        smoothed[place] = cho_solve_banded((factor, False), unit)[frame * size : (frame + 1) * size]
    return corrections, smoothed
