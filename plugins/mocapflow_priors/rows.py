"""Whitened residuals from rows on the angles, and a soft one-sided penalty."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mocapflow.data import Residual
from mocapflow.records import F64


def whitened(error: F64, jacobian: F64) -> Residual:
    """Return a least-squares residual: errors (K,) in standard deviations, with their Jacobian (K, 6 + D)."""
    return Residual(error=error, jacobian=jacobian, energy=0.5 * float(error @ error))


def angle_rows(error: F64, slope: F64, chosen: npt.NDArray[np.intp]) -> Residual:
    """Return one row for each chosen angle.

    Args:
        error: (D,) in standard deviations.
        slope: (D,) derivative of each error by its angle.
        chosen: indices of the angles that have a row.
    """
    jacobian = np.zeros((len(chosen), 6 + len(error)))
    jacobian[np.arange(len(chosen)), 6 + chosen] = slope[chosen]
    return whitened(error[chosen], jacobian)


def soft_excess(excess: F64, slack: float) -> tuple[F64, F64]:
    """Return a penalty of excesses (K,) that is zero up to zero, then bends smoothly into a line, and its derivative.

    An excess of `slack` costs half of it; far out the penalty is excess - slack. Its slope is continuous.
    """
    x = np.maximum(excess, 0.0)
    return x**2 / (x + slack), x * (x + 2 * slack) / (x + slack) ** 2
