"""Poses (and proportions) that explain keypoints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from mocapflow.assets import Body, Camera
from mocapflow.data import Pose
from mocapflow.geometry.cameras import projections
from mocapflow.geometry.registration import rigid_motion
from mocapflow.records import F64, array, record
from mocapflow_fitting.landmarks import Landmarks, landmarks
from mocapflow_fitting.pose_fit import Observations, Residuals, Solution, Spreads, descend, projected

DETECTOR_PX = 3.0  # px, of a keypoint against the place the estimator means


@record
class Seen:
    """What is known of the landmarks of one frame, in the order of the landmarks."""

    position: F64 = array("L", 3, unit="m, NaN where not triangulated")
    pixels: F64 = array("C", "L", 2, unit="px")
    confidence: F64 = array("C", "L", unit="1, zero where unseen")


def fit(
    body: Body, frames: Sequence[Seen], cameras: Sequence[Camera], spreads: Spreads | None = None
) -> tuple[Mapping[str, float], tuple[Pose, ...]]:
    """Return factors by proportion and the pose of each frame, of the body scaled by them.

    Args:
        body: the body before scaling.
        frames: the keypoints, in the order of `landmarks(body)`.
        cameras: pinhole cameras.
        spreads: the proportions to fit, with the standard deviation of their logarithm about zero.

    The triangulated points come first, for they can be reached from far away; then the pixels, which say how well
    each point is known.
    """
    marks, spreads = landmarks(body), dict(spreads or {})
    poses = tuple(Pose(root=_first_root(marks, seen), angles=np.zeros(len(body.twists))) for seen in frames)
    solution = Solution(spreads, np.zeros(len(spreads)), poses)
    for compare in (in_space, partial(in_images, cameras=cameras)):
        moments = [Observations(marks.body, partial(compare, seen=seen, spread=marks.spread)) for seen in frames]
        solution = descend(moments, solution)
    return solution.factors, solution.poses


def in_space(points: F64, seen: Seen, spread: F64) -> Residuals:
    """Compare landmarks (L, 3) with the triangulated points; `spread` (L,) m is their standard deviation."""
    known = np.flatnonzero(np.isfinite(seen.position).all(axis=1)).astype(np.int32)
    slope = np.broadcast_to(np.eye(3), (len(known), 3, 3))
    return Residuals(points[known] - seen.position[known], slope, known, 1 / spread[known])


def in_images(points: F64, seen: Seen, spread: F64, cameras: Sequence[Camera]) -> Residuals:
    """Compare projected landmarks (L, 3) with the detections; `spread` (L,) m adds to the detector's error."""
    camera, point = np.nonzero(seen.confidence > 0)
    matrices = projections(cameras)[camera]
    focal = np.array([c.intrinsics[0, 0] for c in cameras])[camera]
    pixel, slope, depth = projected(points[point], matrices)
    precision = np.sqrt(np.clip(seen.confidence[camera, point], 0.0, 1.0)) / np.hypot(
        DETECTOR_PX, spread[point] * focal / depth
    )
    return Residuals(pixel - seen.pixels[camera, point], slope, point.astype(np.int32), precision)


def _first_root(marks: Landmarks, seen: Seen) -> F64:
    """Return the rigid motion (4, 4) of the trunk at rest on to its triangulated landmarks."""
    known = np.isfinite(seen.position).all(axis=1)
    hips, top = (known & np.array([n.startswith(part) for n in marks.names]) for part in ("hip", ("shoulder", "neck")))
    use = hips | top if hips.any() and top.sum() >= 2 else known  # three points in a line say nothing of the tilt
    root = np.eye(4)
    root[:3, :3], root[:3, 3] = rigid_motion(marks.body.vertices[use], seen.position[use])
    return root
