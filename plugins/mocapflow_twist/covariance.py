"""How sure the pose is: correlated residuals, their scale, and the covariance of the increment."""

from __future__ import annotations

import numpy as np

from mocapflow.data import Matches
from mocapflow.records import F64
from mocapflow_twist import kernels

CELLS = 128  # cells along an image axis before their numbers repeat: two far parts of a contour may share one
PRIOR_FREEDOM = 10.0  # residuals' worth of trust in the stated weights: keeps the scale sane when few are left


def effective_share(matches: Matches, correlation_px: float) -> F64:
    """Return, for every match, the share of an independent measurement that it is worth: (M,), at most 1.

    Errors along a contour are correlated over `correlation_px`. With matches of weight w in square cells of that
    size, a view holds (sum w)^2 / sum over cells (sum of w in the cell)^2 independent measurements: all of them
    where they lie apart, the contour's length over the cell's where they lie dense (to 20 %; up to twice as much along
    the rows of pixels on a border of cells). The mean of two grids, half a cell apart to the right, makes it
    independent of where upright contours lie. Summed over matches it counts those, too, that a
    robust loss has all but dropped.
    """
    used = matches.weight > 0
    if correlation_px <= 0 or not used.any():
        return np.ones(len(used))
    weight = np.where(used, matches.weight, 0.0)
    alone, clustered = kernels.clustering(matches.camera, matches.pixel, weight, correlation_px, CELLS)
    share: F64 = alone / np.where(clustered > 0, clustered, 1.0)
    return share.take(matches.camera)


def view_balance(matches: Matches, share: F64) -> F64:
    """Return factors (M,) that give every view the same total weight, and all views together what they had."""
    weight = matches.weight * share
    total = np.bincount(matches.camera, weight)
    mean = total[total > 0].mean() if total.any() else 0.0
    return np.where(total > 0, mean / np.where(total > 0, total, 1.0), 0.0)[matches.camera]


def residual_scale(energy: float, measurements: float, spent: float) -> float:
    """Return s^2, the variance of the residuals in units of what their weights promise.

    Args:
        energy: half the weighted squared error of the data.
        measurements: number of independent measurements.
        spent: degrees of freedom that the data fixed.
    """
    free = max(measurements - spent, 0.0)
    return (PRIOR_FREEDOM + 2 * energy) / (PRIOR_FREEDOM + free)


def covariance(data: F64, prior: F64, energy: float, measurements: float) -> F64:
    """Return (J^T W J / s^2 + prior precision)^-1 with s^2 from the residuals.

    Args:
        data: (S, S) normal matrix of the data.
        prior: (S, S) precision of the priors, positive definite.
        energy: half the weighted squared error of the data.
        measurements: number of independent measurements.
    """
    scale = np.sqrt(np.diag(data) + np.diag(prior))
    both = (data + prior) / scale / scale[:, None]
    spent = float(np.trace(np.linalg.solve(both, data / scale / scale[:, None])))
    s2 = residual_scale(energy, measurements, spent)
    return _inverse(data / s2 + prior)


def observed(spread: F64, prior: F64) -> F64:
    """Return which share of the variance that the priors leave to each unknown the data took away: (S,), 0 to 1.

    Where the priors don't link unknowns this is the diagonal of the model resolution matrix, covariance times
    information of the data: what a unit change of the truth moves the estimate by, and nothing where a limb is unseen.

    Args:
        spread: (S, S) covariance given data and priors.
        prior: (S, S) precision of the priors, positive definite.
    """
    return np.clip(1.0 - np.diag(spread) / np.diag(_inverse(prior)), 0.0, 1.0)


def _inverse(precision: F64) -> F64:
    """Return the inverse of a positive definite matrix, scaled to a unit diagonal first: units differ widely."""
    scale = np.sqrt(np.diag(precision))
    inverse = np.linalg.inv(precision / scale / scale[:, None])
    return 0.5 * (inverse + inverse.T) / scale / scale[:, None]
