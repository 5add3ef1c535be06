"""Jacobians against differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mocapflow.records import F64


def differences(function: Callable[[F64], F64], at: F64, step: float = 1e-5) -> F64:
    """Return the Jacobian (K, S) of a function (S,) → (K,) at a point by central differences of fourth order."""
    columns = []
    for unit in np.eye(len(at)):
        near = function(at + step * unit) - function(at - step * unit)
        far = function(at + 2 * step * unit) - function(at - 2 * step * unit)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def check_jacobian(
    residual: Callable[[F64], tuple[F64, F64]], at: F64, *, step: float = 1e-5, tolerance: float = 1e-6
) -> None:
    """Assert that a residual's Jacobian is its derivative.

    Args:
        residual: from an increment (S,) to error (K,) and Jacobian (K, S).
        at: the increment (S,) to check at.
        step: of the differences.
        tolerance: largest error allowed, as a share of the largest entry of the Jacobian (at least of 1).
    """
    _, jacobian = residual(at)
    expected = differences(lambda x: residual(x)[0], at, step)
    assert jacobian.shape == expected.shape, f"the Jacobian has shape {jacobian.shape}, expected {expected.shape}"
    if not expected.size:
        return
    wrong = np.abs(jacobian - expected)
    row, column = np.unravel_index(wrong.argmax(), wrong.shape)
    allowed = tolerance * max(1.0, float(np.abs(expected).max()))
    assert wrong.max() <= allowed, (
        f"Jacobian [{row}, {column}] is {jacobian[row, column]:.9g}, differences say {expected[row, column]:.9g}"
    )
