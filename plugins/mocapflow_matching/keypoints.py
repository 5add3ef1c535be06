"""Matcher `keypoints`: joints and other marks of a pose estimator, paired with the body's own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from mocapflow_fitting.detections import keypoint_error
from mocapflow_fitting.keypoint_layouts import LAYOUTS, Layout, layout_of, rows_of
from mocapflow_fitting.landmarks import landmarks
from mocapflow_fitting.person import halving_px
from mocapflow_fitting.triangulate import USUAL_PX, triangulate
from pydantic import PositiveFloat

from mocapflow.assets import Body, Camera
from mocapflow.components import Matcher
from mocapflow.data import Frame, Matches, Past, Segmentation, Surface, Turn, empty_matches
from mocapflow.geometry.cameras import centre, project, project_each
from mocapflow.memo import memoised
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, I32
from mocapflow.scene import Scene
from mocapflow_matching.robust import robust_weights

NEIGHBOURS = 60  # vertices that a landmark may be a mean of
MEDIAN_RADIUS = 1.177  # median length of a normal 2D error, in standard deviations of its components
OUTLYING = 4.0  # standard deviations from which on an error is none of the noise
SAME_PERSON = 3.0  # times the error that halves a keypoint's weight: the median of a person's errors, at most


class Keypoints(Matcher):
    """Pairs the 2D keypoints of a frame with the body's landmarks, one person per view: the one nearest the surface.

    A landmark inside the body is a mean of skin vertices around it, each of which is asked to move as the landmark
    should. How far to trust the estimator is learned in each frame: from how well its keypoints, triangulated
    over the views, reproject. Where the body's landmark may not be what the estimator marks, its spread adds to that.
    """

    name = "keypoints"
    layout: Layout | None = None  # order of the keypoints; null: told by their number
    sigma_px: PositiveFloat = 5.0  # standard deviation of a keypoint where fewer than three views tell it
    least_sigma_px: PositiveFloat = 1.0  # least standard deviation of a keypoint, however well the views agree
    scale: PositiveFloat = 2.0  # standard deviations beyond which a keypoint pulls no harder (Huber)

    def need(self, recording: Recording) -> None:
        """Raise if no camera has keypoints."""
        if not any(recording.keypoint_folders):
            hint = "expected keypoints/cam01_json/*.json as OpenPose writes them; or name another matcher"
            raise keypoint_error(recording, "there are no 2D keypoints", hint)

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return the pairs of every view; see the class."""
        if frame.keypoints is None:
            return empty_matches()
        marks = marks_on(scene.body)
        places = np.einsum("lk,lka->la", marks.share, surface.vertices[marks.vertex])
        image = np.stack([project(places, camera) for camera in scene.cameras])
        seen = self._seen(frame, image, marks.names)
        sigma = np.hypot(self._estimator_px(seen, scene.cameras), spread_px(places, marks.spread, scene.cameras))
        off = seen[..., :2] - image
        distance = np.linalg.norm(off, axis=2)
        weight = seen[..., 2] * robust_weights(distance / sigma, "huber", self.scale) / sigma**2
        camera, mark = (index.astype(np.int32) for index in np.nonzero(weight > 0))
        return _pairs(camera, mark, off[camera, mark], weight[camera, mark], marks, surface, scene)

    def _seen(self, frame: Frame, image: F64, names: tuple[str, ...]) -> F64:
        """Return the person's keypoints (C, L, 3) px, px, confidence in the order of the landmarks.

        Raises:
            RecordingError: the keypoints are not as many as a layout has, or as the one that is set.
        """
        assert frame.keypoints is not None
        people = [points for view in frame.keypoints for points in view]
        seen = np.zeros((len(image), len(names), 3))
        layout = layout_of(people, self.layout) if people else None
        if layout is None:
            return seen
        row = rows_of(LAYOUTS[layout], names)
        for index, (view, projected) in enumerate(zip(frame.keypoints, image, strict=True)):
            ordered = [np.where(row[:, None] >= 0, points[row], 0.0) for points in view]
            if frame.usable[index] and ordered:
                off = [_median_error(points, projected) for points in ordered]
                best = int(np.argmin(off))
                if off[best] < SAME_PERSON * halving_px(view[best]):
                    seen[index] = np.clip(ordered[best], [-np.inf, -np.inf, 0], [np.inf, np.inf, 1])
        return seen

    def _estimator_px(self, seen: F64, cameras: tuple[Camera, ...]) -> float:
        """Return the standard deviation of the keypoints, from their triangulation.

        That takes what is far off for outliers, so where all are, it has to be done again with more patience.
        """
        spread = self._spread_px(seen, cameras, USUAL_PX)
        return self._spread_px(seen, cameras, OUTLYING * spread) if OUTLYING * spread > USUAL_PX else spread

    def _spread_px(self, seen: F64, cameras: tuple[Camera, ...], scale_px: float) -> float:
        error = triangulate(seen[..., :2], seen[..., 2], cameras, scale_px, rounds=5).error
        views = np.isfinite(error).sum(axis=0)
        told = error[:, views >= 3]
        if not np.isfinite(told).any():
            return self.sigma_px
        count = float(views[views >= 3].mean())  # each point spends three of its two measurements a view
        spread = float(np.nanmedian(told)) / MEDIAN_RADIUS * np.sqrt(2 * count / (2 * count - 3))
        return float(max(spread, self.least_sigma_px))


class Marks(NamedTuple):
    """Landmarks as means of skin vertices: vertex (L, k), share (L, k), and their spread (L,) m."""

    names: tuple[str, ...]
    vertex: I32
    share: F64
    spread: F64


@memoised
def marks_on(body: Body) -> Marks:
    """Return the landmarks of a body, each as the mean of vertices around it that comes nearest to it."""
    from scipy.optimize import nnls

    places = landmarks(body)
    vertex = np.empty((len(places.names), NEIGHBOURS), np.int32)
    share = np.zeros(vertex.shape)
    for k, point in enumerate(places.body.vertices):
        carried = np.where(body.skin_joint == places.body.skin_joint[k, 0], body.skin_weight, 0.0).sum(axis=1)
        away = np.linalg.norm(body.vertices - point, axis=1) + np.where(carried > 0.5, 0.0, 1.0)
        near = np.argsort(away, kind="stable")[:NEIGHBOURS]
        corners = np.vstack([body.vertices[near].T - point[:, None], np.ones(len(near))])
        mean, _ = nnls(corners, np.array([0.0, 0.0, 0.0, 1.0]))
        vertex[k, : len(near)], share[k, : len(near)] = near, mean / mean.sum()
    used = int((share > 0).sum(axis=1).max())
    order = np.argsort(-share, axis=1, kind="stable")[:, :used]
    rows = np.arange(len(order))[:, None]
    return Marks(places.names, vertex[rows, order], share[rows, order], places.spread)


def spread_px(places: F64, spread: F64, cameras: tuple[Camera, ...]) -> F64:
    """Return what a spread (L,) m about places (L, 3) looks like in each view: (C, L) px."""
    away = np.stack([np.linalg.norm(places - centre(camera), axis=1) for camera in cameras])
    focal = np.array([camera.intrinsics[0, 0] for camera in cameras])
    return np.asarray(focal[:, None] * spread / np.maximum(away, 0.1))


def _median_error(points: F64, projected: F64) -> float:
    seen = (points[:, 2] > 0) & np.isfinite(projected).all(axis=1)  # what lies behind the camera is nowhere
    return float(np.median(np.linalg.norm(points[seen, :2] - projected[seen], axis=1))) if seen.any() else np.inf


def _pairs(camera: I32, mark: I32, off: F64, weight: F64, marks: Marks, surface: Surface, scene: Scene) -> Matches:
    """Return a pair for every vertex that a landmark is a mean of, with its share of the landmark's weight."""
    vertex, share = marks.vertex[mark], marks.share[mark]
    used = share > 0
    view, vertex = np.broadcast_to(camera[:, None], used.shape)[used].astype(np.int16), vertex[used]
    image = project_each(surface.vertices[vertex], view, scene.cameras)
    return Matches(
        camera=view,
        pixel=image + np.repeat(off, used.sum(axis=1), axis=0),
        direction=np.zeros_like(image),
        vertex=vertex,
        weight=(weight[:, None] * share)[used],
    )
