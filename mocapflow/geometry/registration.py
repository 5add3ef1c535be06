"""Two rigs brought together by points that both have measured: a rigid motion, how well it fits, and the scale."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mocapflow.errors import MocapflowError
from mocapflow.records import F64, array, record

FLAT = 1e-3  # points on a line, as far as that can be told: spread across it over spread along it


@record
class Registration:
    """A rigid motion that takes points of one rig to another's; the scale is found apart and not applied."""

    rotation: F64 = array(3, 3, unit="1")
    translation: F64 = array(3, unit="m")
    scale: float  # of a similarity between the same points: 1 where both rigs have the same metre
    residual: F64 = array("N", unit="m, distance that is left at every point")
    left_out: F64 = array("N", unit="m, the same by a fit to the other points alone; NaN where these are too few")

    def apply(self, points: F64) -> F64:
        """Return points (..., 3) of the first rig in the second."""
        return points @ self.rotation.T + self.translation


def register(source: F64, target: F64, groups: npt.ArrayLike | None = None) -> Registration:
    """Return the rigid motion that takes source to target with the least sum of squares.

    The scale is Umeyama's (IEEE PAMI 13, 1991).

    Args:
        source: (N, 3) m, points in the rig that is moved.
        target: (N, 3) m, the same points in the other rig.
        groups: (N,), points of one group are left out together; each alone if not given.

    Raises:
        MocapflowError: fewer than three points, or all on one line.
    """
    rotation, translation, scale = _fit(source, target)
    group = np.arange(len(source)) if groups is None else np.asarray(groups)
    left_out = np.full(len(source), np.nan)
    for each in np.unique(group):
        out = group == each
        try:
            turned, shift, _ = _fit(source[~out], target[~out])
        except MocapflowError:
            continue
        left_out[out] = np.linalg.norm(source[out] @ turned.T + shift - target[out], axis=1)
    return Registration(
        rotation=rotation,
        translation=translation,
        scale=scale,
        residual=np.linalg.norm(source @ rotation.T + translation - target, axis=1),
        left_out=left_out,
    )


def rigid_motion(source: F64, target: F64) -> tuple[F64, F64]:
    """Return rotation (3, 3) and translation (3,) m that take points (N, 3) m to others with the least sum of squares.

    The solution by singular values is Kabsch's (Acta Cryst. A32, 1976); how points on one line turn about it is chance.
    """
    middle, centre = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - centre).T @ (source - middle))
    rotation: F64 = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    return rotation, centre - rotation @ middle


def _fit(source: F64, target: F64) -> tuple[F64, F64, float]:
    if len(source) < 3:
        raise MocapflowError(f"{len(source)} common points; a registration needs three that are not on one line")
    a, b = source - source.mean(0), target - target.mean(0)
    spread = np.linalg.svd(a, compute_uv=False)
    if spread[1] <= FLAT * spread[0]:
        raise MocapflowError("the common points lie on one line: they do not tell how one rig is turned about it")
    rotation, translation = rigid_motion(source, target)
    return rotation, translation, float(np.sum(b * (a @ rotation.T)) / np.sum(a**2))
