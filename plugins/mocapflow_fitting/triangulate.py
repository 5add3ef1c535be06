"""Robust triangulation of named points seen by several cameras."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry.cameras import projections
from mocapflow.records import F64, array, record

USUAL_PX = 8.0  # error of a detection that is usual at most


@record
class Points:
    """Triangulated points with what speaks for them."""

    position: F64 = array("K", 3, unit="m, NaN where fewer than two cameras agree")
    error: F64 = array("C", "K", unit="px, distance of the projection to the detection, NaN where unseen")
    weight: F64 = array("C", "K", unit="1, confidence times the robust weight")


def triangulate(
    pixels: F64, confidence: F64, cameras: Sequence[Camera], scale_px: float = USUAL_PX, rounds: int = 20
) -> Points:
    """Return the points (K, 3) m that reproject best, by least squares reweighted with Cauchy's rule.

    Args:
        pixels: (C, K, 2) px, undistorted.
        confidence: (C, K), zero where a point is not seen.
        cameras: pinhole cameras.
        scale_px: an error of this size halves the weight of an observation.
        rounds: reweightings.

    A point needs two cameras; it starts at the pair of cameras whose point the other cameras support most.
    """
    matrices = projections(cameras)
    weight = np.where(np.isfinite(pixels).all(axis=-1), confidence, 0.0)
    pixels = np.where(weight[..., None] > 0, pixels, 0.0)
    position = _best_pair(pixels, weight, matrices, scale_px)
    robust = weight
    for _ in range(rounds):
        error = _errors(position, pixels, matrices)
        robust = weight / (1 + (np.nan_to_num(error, nan=1e6) / scale_px) ** 2)
        position = _solve(pixels, robust, matrices, position)
    error = np.where(weight > 0, _errors(position, pixels, matrices), np.nan)
    agreeing = ((error < 3 * scale_px) & (weight > 0)).sum(axis=0)
    position = np.where((agreeing >= 2)[:, None], position, np.nan)
    return Points(position=position, error=error, weight=robust)


def _best_pair(pixels: F64, weight: F64, matrices: F64, scale_px: float) -> F64:
    """Return the points (K, 3) m of the two cameras whose point all cameras support most; NaN where no two see one."""
    count, points = weight.shape
    best, support = np.full((points, 3), np.nan), np.zeros(points)
    for a, b in combinations(range(count), 2):
        pair = np.zeros_like(weight)
        pair[[a, b]] = ((weight[a] > 0) & (weight[b] > 0)).astype(float)
        position = _solve(pixels, pair, matrices, None)
        error = _errors(position, pixels, matrices)
        score = np.nansum(weight / (1 + (error / scale_px) ** 2), axis=0)
        better = (score > support) & np.isfinite(position).all(axis=1)
        best[better], support[better] = position[better], score[better]
    return best


def _solve(pixels: F64, weight: F64, matrices: F64, near: F64 | None) -> F64:
    """Minimise the weighted squared pixel errors, linear in the point once the depths are those at `near`."""
    rows = matrices[:, None, 2:] * pixels[..., None] - matrices[:, None, :2]  # (C, K, 2, 4)
    depth = np.ones(weight.shape)
    if near is not None:
        depth = np.einsum("ca,ka->ck", matrices[:, 2, :3], near) + matrices[:, 2, 3:]
    rows = rows * (np.sqrt(weight) / np.where(np.abs(depth) > 1e-6, depth, 1.0))[..., None, None]
    normal = np.einsum("ckri,ckrj->kij", rows[..., :3], rows[..., :3])
    right = -np.einsum("ckri,ckr->ki", rows[..., :3], rows[..., 3])
    solvable = (weight > 0).sum(axis=0) >= 2
    solvable &= np.isfinite(normal).all(axis=(1, 2))
    solvable &= np.linalg.cond(np.where(solvable[:, None, None], normal, np.eye(3))) < 1e12
    position = np.full((len(normal), 3), np.nan)
    position[solvable] = np.linalg.solve(normal[solvable], right[solvable][..., None])[..., 0]
    return position


def _errors(position: F64, pixels: F64, matrices: F64) -> F64:
    homogeneous = np.einsum("cia,ka->cki", matrices[..., :3], position) + matrices[:, None, :, 3]
    depth = np.where(homogeneous[..., 2:] > 0, homogeneous[..., 2:], np.nan)
    return np.asarray(np.linalg.norm(homogeneous[..., :2] / depth - pixels, axis=-1))
