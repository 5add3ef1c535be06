"""Least squares over a sequence: corrections of every frame against accelerations, as one banded system.

The system of a long recording would not fit in memory. But only neighbours are coupled: all that the frames on one side
of a block have to say of it is an update of the equations of the two frames at that end. These messages are passed
forwards, then backwards; with both, each block is solved on its own, and exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mocapflow.records import F64, Bool
from mocapflow.series import BLOCK, Wide, picked

FLOOR = 1e-9  # rad^2 or m^2; keeps directions that a solver holds fixed from being infinitely certain


class Message(NamedTuple):
    """What eliminating all frames before takes away from the equations of the next two."""

    matrix: F64  # (2 R, 2 R)
    pull: F64  # (2 R,)

    def reversed(self) -> Message:
        """Return the same with the two frames in the other order."""
        half = len(self.pull) // 2
        return Message(np.roll(self.matrix, (half, half), (0, 1)), np.roll(self.pull, half))


@dataclass(frozen=True)
class System:
    """The normal equations of a sequence of frames.

    Accelerations weigh all unknowns of a frame alike, up to a factor: they couple the unknown k of the frames s and
    t by coupling[t - s][s] * precision[k].
    """

    covariance: Wide  # (T, R, R) of each frame
    coupling: tuple[F64, F64, F64]  # (T,), (T - 1,), (T - 2,)
    precision: F64  # (R,)
    pull: F64  # (T, R), the right side

    def backwards(self) -> System:
        """Return the same with the last frame first."""
        last_first = np.arange(len(self.pull))[::-1]
        none, one, two = (band[::-1] for band in self.coupling)
        return System(picked(self.covariance, last_first), (none, one, two), self.precision, self.pull[::-1])

    def block(self, part: slice, before: Message | None, behind: Message | None) -> tuple[F64, F64]:
        """Return bands (2 R + 1, N R) in upper form and the right side (N R,) of some frames.

        Args:
            part: which frames.
            before: from the frames before, if there are any.
            behind: from the frames behind, in the order of the frames.
        """
        size, count = len(self.precision), part.stop - part.start
        bands = np.zeros((2 * size + 1, count, size))
        row, column = np.triu_indices(size)
        bands[2 * size + row - column, :, column] = information(self.covariance[part])[:, row, column].T
        for away, band in enumerate(self.coupling):
            inner = band[part.start : part.stop - away, None]
            bands[(2 - away) * size, away:] += inner * self.precision
        bands, pull = bands.reshape(2 * size + 1, -1), self.pull[part].flatten()
        for message, first in ((before, 0), (behind, (count - 2) * size)):
            if message is not None:
                row, column = np.triu_indices(2 * size)
                bands[2 * size + row - column, first + column] -= message.matrix[row, column]
                pull[first : first + 2 * size] -= message.pull
        return bands, pull

    def across(self, frame: int) -> F64:
        """Return the coupling of the two frames before a frame with it and the next: (2 R, 2 R)."""
        _, one, two = self.coupling
        return np.kron([[two[frame - 2], 0], [one[frame - 1], two[frame - 1]]], np.diag(self.precision))


def difference_weights(time: F64) -> F64:
    """Return the weights (T - 2, 3) of three neighbouring samples in the acceleration at the middle one, 1/s^2."""
    before, after = np.diff(time)[:-1], np.diff(time)[1:]
    middle = (before + after) / 2
    first, last = 1 / (before * middle), 1 / (after * middle)
    return np.column_stack([first, -(first + last), last])


def minimise(covariance: Wide, acceleration: F64, limits: F64, time: F64, wanted: Bool) -> tuple[F64, F64]:
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
    system = normal_equations(covariance, acceleration, limits, time)
    parts = [slice(first, first + BLOCK) for first in range(0, count - 1, BLOCK)]  # the last has two frames or more
    parts[-1] = slice(parts[-1].start, count)
    mirrored = [slice(count - part.stop, count - part.start) for part in reversed(parts)]
    before, behind = messages(system, parts), messages(system.backwards(), mirrored)[::-1]
    corrections, smoothed = np.empty((count, size)), np.empty((np.count_nonzero(wanted), size, size))
    place = np.cumsum(wanted) - 1
    for part, earlier, later in zip(parts, before, behind, strict=True):
        bands, pull = system.block(part, earlier, later and later.reversed())
        factor = cholesky_banded(bands, overwrite_ab=True), False
        corrections[part] = cho_solve_banded(factor, pull).reshape(-1, size)
        for frame in np.flatnonzero(wanted[part]).tolist():
            own = slice(frame * size, (frame + 1) * size)
            unit = np.eye(len(pull), size, -frame * size)
            smoothed[place[part][frame]] = cho_solve_banded(factor, unit)[own]
    return corrections, smoothed


def normal_equations(covariance: Wide, acceleration: F64, limits: F64, time: F64) -> System:
    """Return the equations of the minimum, see `minimise`."""
    count = len(time)
    weights, precision = difference_weights(time), 1 / limits**2
    coupling = np.zeros(count), np.zeros(count - 1), np.zeros(count - 2)
    pull = np.zeros((count, len(limits)))
    for i in range(3):
        pull[i : count - 2 + i] -= weights[:, i, None] * precision * acceleration
        for j in range(i, 3):
            coupling[j - i][i : count - 2 + i] += weights[:, i] * weights[:, j]
    return System(covariance, coupling, precision, pull)


def messages(system: System, parts: Sequence[slice]) -> list[Message | None]:
    """Return what each part of a sequence hears of the frames before it."""
    from scipy.linalg import cho_solve_banded, cholesky_banded, solve_triangular

    heard: list[Message | None] = [None]
    twice = 2 * len(system.precision)
    row, column = np.triu_indices(twice)
    for part in parts[:-1]:
        bands, pull = system.block(part, heard[-1], None)
        factor = cholesky_banded(bands, overwrite_ab=True)
        last = np.zeros((twice, twice))  # of the factor U with U^T U the matrix: its part inverts the matrix' part
        last[row, column] = factor[:, -twice:][twice + row - column, column]
        across = system.across(part.stop)
        half = solve_triangular(last, across, trans=1)
        heard.append(Message(half.T @ half, across.T @ cho_solve_banded((factor, False), pull)[-twice:]))
    return heard


def information(covariance: F64) -> F64:
    """Return the inverses of covariances (T, R, R); rounding may have left a variance just below zero."""
    variance, axes = np.linalg.eigh(covariance)
    inverse: F64 = (axes / (np.maximum(variance, 0) + FLOOR)[:, None]) @ np.swapaxes(axes, 1, 2)
    return inverse
