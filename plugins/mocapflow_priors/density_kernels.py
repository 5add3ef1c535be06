"""Compiled sum over the training poses of a Parzen density."""

from __future__ import annotations

import math

import numba
import numpy as np

TURN = 2 * math.pi
FAR = -40.0  # an exponent so much below the largest adds nothing that a float could hold


@numba.njit(cache=True)
def log_mean(columns, angles, bandwidth, mean):  # type: ignore[no-untyped-def]
    """Return the log of the mean of exp(-d^2 / 2 bandwidth^2) over training poses (K, N), d the way to each of them.

    Writes where (K,) the poses lie on average, so weighted. Differences of angles are taken in [-pi, pi).
    """
    exponent = np.zeros(columns.shape[1])
    scale = -0.5 / bandwidth**2
    for k in range(len(columns)):
        column, angle = columns[k], angles[k]
        for n in range(exponent.size):
            away = column[n] - angle
            away -= TURN * np.floor((away + math.pi) / TURN)
            exponent[n] += scale * away * away
    largest, total = exponent.max(), 0.0
    mean[:] = 0.0
    for n in range(exponent.size):
        if exponent[n] - largest > FAR:
            weight = math.exp(exponent[n] - largest)
            total += weight
            for k in range(len(columns)):
                away = columns[k, n] - angles[k]
                mean[k] += weight * (away - TURN * np.floor((away + math.pi) / TURN))
    for k in range(len(columns)):
        mean[k] = angles[k] + mean[k] / total
    return largest + math.log(total / exponent.size)
