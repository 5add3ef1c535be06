"""Stage `fit_subject`: a body scaled to the person, from keypoints."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import PositiveInt

from mocapflow.assets import Body, Camera
from mocapflow.components import Stage
from mocapflow.errors import RecordingError
from mocapflow.geometry.skeleton import SEGMENTS
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_fitting.detections import frames_seen, has_keypoints, need_keypoints, spaced_evenly
from mocapflow_fitting.keypoint_fit import Seen, fit
from mocapflow_fitting.keypoint_layouts import Layout
from mocapflow_fitting.landmarks import landmarks
from mocapflow_fitting.proportions import fitted

LOG = logging.getLogger("mocapflow")
# Standard deviations of log proportions among adults, the widths as far as keypoints show them.
SPREADS: Mapping[str, float] = {
    "stature": 0.2, "trunk": 0.04, "shoulder_width": 0.06, "hip_width": 0.03, "head": 0.05,
    "thigh": 0.04, "shank": 0.04, "foot": 0.08, "upper_arm": 0.04, "forearm": 0.04,
}  # fmt: skip
LIMBS = tuple((f"{a}_{s}", f"{b}_{s}") for s in "lr" for a, b in (*SEGMENTS.values(), ("hip", "shoulder")))
DIFFERENT = 0.04  # median difference of limb lengths beyond which the standing trial shows another person


class FitSubject(Stage):
    """Scales limbs, trunk, head and feet of the scene's body so that it explains the keypoints of many frames.

    With a standing trial its frames are used too, unless limbs measured in it differ from those in the recording:
    some tools put a model's keypoints there.
    """

    name: ClassVar[str] = "fit_subject"
    frames: PositiveInt = 16  # spread over the recording
    trial: Literal["auto", "static", "recording"] = "auto"  # auto: both, if the standing trial shows the same person
    layout: Layout | None = None  # order of the keypoints; null: told by their number

    def inputs(self, folder: Path) -> Sequence[Path]:
        """Return the folder of the standing trial, where it counts."""
        return () if self.trial == "recording" else (folder / "static",)

    def need(self, recording: Recording) -> None:
        """Raise if there are no keypoints, or no standing trial where that is wanted."""
        if self.trial != "static":
            need_keypoints(recording)
        elif (static := recording.static()) is None:
            hint = "use trial: auto"
            raise RecordingError("there is no standing trial", where=str(recording.folder / "static"), hint=hint)
        else:
            need_keypoints(static)

    def run(self, recording: Recording, scene: Scene) -> Body:
        """Return the scaled body.

        Raises:
            RecordingError: there are no keypoints, or no frame in which two cameras see enough of the same person.
        """
        names = landmarks(scene.body).names
        self.need(recording)
        static = None if self.trial == "recording" else recording.static()
        moving = [] if self.trial == "static" else self._seen(recording, names, self.frames, scene.cameras)
        standing = self._seen(static, names, 4, scene.cameras) if static is not None and has_keypoints(static) else []
        if moving and standing and (difference := unlike(moving, standing, names)) > DIFFERENT:
            LOG.warning(
                "static/ is left out: its limbs differ by %.0f %% from those in the recording", 100 * difference
            )
            standing = []
        factors, _ = fit(scene.body, [*moving, *standing], scene.cameras, SPREADS)
        return fitted(scene.body, factors)

    def _seen(self, recording: Recording, names: Sequence[str], count: int, cameras: Sequence[Camera]) -> list[Seen]:
        indices = spaced_evenly(recording.indices, count)
        return list(frames_seen(recording, indices, cameras, names, self.layout).values())


def unlike(first: Sequence[Seen], second: Sequence[Seen], names: Sequence[str]) -> float:
    """Return the median relative difference of the lengths of limbs in two sets of frames."""
    lengths = np.stack([limb_lengths(frames, names) for frames in (first, second)])
    difference = np.abs(np.log(lengths[0] / lengths[1]))
    return float(np.nanmedian(difference)) if np.isfinite(difference).any() else 0.0


def limb_lengths(frames: Sequence[Seen], names: Sequence[str]) -> F64:
    """Return the median distance (L,) m between the ends of each limb; NaN where a limb is never seen."""
    ends = np.array([(names.index(a), names.index(b)) for a, b in LIMBS if a in names and b in names]).reshape(-1, 2)
    position = np.stack([frame.position for frame in frames])
    length = np.linalg.norm(position[:, ends[:, 0]] - position[:, ends[:, 1]], axis=2)
    never = ~np.isfinite(length).any(axis=0)
    return np.where(never, np.nan, np.nanmedian(np.where(never, 0.0, length), axis=0))
