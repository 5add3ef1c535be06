"""Stage `align_cameras`: turns cameras that were knocked since their calibration back, from keypoints."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import PositiveFloat, PositiveInt

from mocapflow.assets import Camera, Rig
from mocapflow.components import Stage
from mocapflow.geometry import twists
from mocapflow.geometry.camera_rotation import homography, shift_px
from mocapflow.geometry.cameras import project
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow_fitting.detections import need_keypoints, persons, spaced_evenly
from mocapflow_fitting.triangulate import triangulate

LOG = logging.getLogger("mocapflow")
CONFIDENT = 0.3  # of a keypoint


class AlignCameras(Stage):
    """Turns each camera about its centre so that all cameras agree on the person's keypoints, over many frames.

    Wherever keypoints lie, they must lie on one point in space: views that disagree by a constant shift show that a
    camera has turned. Corrections too small to tell from the habits of a pose estimator are not made. It stands before
    `check_views`, so a camera that was knocked while it filmed is turned by something in between.
    """

    name: ClassVar[str] = "align_cameras"
    frames: PositiveInt = 30  # spread over the recording; 1: the first alone
    spread_deg: PositiveFloat = 0.5  # standard deviation of what a camera may have turned
    sigma_px: PositiveFloat = 6.0  # of a keypoint
    least_px: PositiveFloat = 6.0  # a rig whose views move by less is left as it is

    def need(self, recording: Recording) -> None:
        """Raise if there are no keypoints."""
        need_keypoints(recording)

    def run(self, recording: Recording) -> Rig:
        """Return the cameras, corrected where they need it.

        Raises:
            RecordingError: there are no keypoints, or nobody is found in any frame.
        """
        cameras = recording.cameras
        people = persons(recording, spaced_evenly(recording.indices, self.frames), cameras).values()
        pixels = np.concatenate([person.pixels for person in people], axis=1)
        confidence = np.concatenate([person.confidence for person in people], axis=1)
        shared = (confidence > CONFIDENT).sum(axis=0) >= min(3, len(cameras))  # two views nearly always agree
        if not shared.any():
            LOG.warning("no keypoint is seen by three cameras: nothing tells whether they have turned")
            return Rig(cameras=cameras)
        turned = self._turned(cameras, pixels[:, shared], np.where(confidence > CONFIDENT, confidence, 0.0)[:, shared])
        shifts = [moved_px(old, new) for old, new in zip(cameras, turned, strict=True)]
        said = ", ".join(f"{camera.name} {shift:.1f} px" for camera, shift in zip(cameras, shifts, strict=True))
        if max(shifts) < self.least_px:
            LOG.info("cameras agree: %s", said)
            return Rig(cameras=cameras)
        LOG.warning("cameras have turned since their calibration, or it is not theirs; corrected by %s", said)
        return Rig(cameras=turned)

    def _turned(self, cameras: Sequence[Camera], pixels: F64, confidence: F64) -> tuple[Camera, ...]:
        from scipy.optimize import least_squares

        def residual(turns: F64) -> F64:
            rig = turn(cameras, turns.reshape(-1, 3))
            points = triangulate(pixels, confidence, rig, scale_px=1e3, rounds=2).position
            error = np.stack([project(points, camera) for camera in rig]) - pixels
            error = np.nan_to_num(error) * (np.sqrt(confidence) / self.sigma_px)[..., None]
            length = np.linalg.norm(error, axis=-1, keepdims=True)  # Huber: long errors count by their length only
            softened = error * np.sqrt(np.minimum(1.0, 2.0 / np.maximum(length, 1e-9)))
            # keypoints of one frame and of neighbouring frames err alike: the prior must not drown in their number
            return np.append(softened.ravel() / np.sqrt(len(pixels[0]) / 25), turns / np.radians(self.spread_deg))

        solution = least_squares(residual, np.zeros(3 * len(cameras)), diff_step=[1e-5], max_nfev=12, x_scale=0.01)
        return turn(cameras, solution.x.reshape(-1, 3))


def turn(cameras: Sequence[Camera], turns: F64) -> tuple[Camera, ...]:
    """Return cameras turned about their centres by rotation vectors (C, 3) rad in their own axes."""
    motions = twists.exp(np.hstack([turns, np.zeros_like(turns)]))
    return tuple(
        replace(camera, camera_from_world=motion @ camera.camera_from_world)
        for camera, motion in zip(cameras, motions, strict=True)
    )


def moved_px(old: Camera, new: Camera) -> float:
    """Return how far the middle of a side of the picture moves (px) at most, if a camera turns into another one."""
    rotation = new.camera_from_world[:3, :3] @ old.camera_from_world[:3, :3].T
    return shift_px(homography(rotation, old), old)
