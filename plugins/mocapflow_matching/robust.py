"""Robust weights of residuals: which pairs to believe."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mocapflow.records import F64, Bool

Loss = Literal["none", "huber", "geman_mcclure", "zhang"]


def robust_weights(distance: F64, loss: Loss, scale: float) -> F64:
    """Return a factor (M,) in [0, 1] for the weight of each squared residual.

    Args:
        distance: (M,) absolute residuals, in standard deviations or any other unit.
        loss: the loss function.
        scale: in the same unit, where the loss begins to give way (Zhang: the distance D that counts as a good fit).
    """
    if loss == "huber":
        return scale / np.maximum(distance, scale)
    if loss == "geman_mcclure":
        return (scale**2 / (scale**2 + distance**2)) ** 2
    if loss == "zhang":
        return zhang_keeps(distance, scale).astype(np.float64)
    return np.ones_like(distance)


def robust_precision(distance: F64, sigma: F64 | float, loss: Loss, scale: float) -> F64:
    """Return the weights (M,) px^-2 of pairs so many px apart, of standard deviation `sigma` px each or all.

    One over the variance, times the robust factor; `scale` is in standard deviations, see `robust_weights`.
    """
    return robust_weights(distance / sigma, loss, scale) / sigma**2


def zhang_keeps(distance: F64, good: float) -> Bool:
    """Return which pairs the statistics of their distances let pass.

    Args:
        distance: (M,) of the pairs.
        good: in the same unit, the distance D that counts as a good fit.

    Source: Zhang 1994, section 3.4 (the adaptive threshold of iterative point matching)
    """
    if not len(distance):
        return np.ones(0, bool)
    mean, spread = float(distance.mean()), float(distance.std())
    if mean < good:
        limit = mean + 3 * spread
    elif mean < 3 * good:
        limit = mean + 2 * spread
    elif mean < 6 * good:
        limit = mean + spread
    else:
        limit = _valley(distance)
    return distance <= limit


def _valley(distance: F64) -> float:
    """Return the first minimum of the histogram of distances after its main peak."""
    counts, borders = np.histogram(distance, bins=30)
    peak = int(np.argmax(counts))
    rising = np.flatnonzero(np.diff(counts[peak:]) > 0)
    return float(borders[peak + rising[0] + 1] if len(rising) else borders[-1])
