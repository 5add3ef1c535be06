"""Stage `check_keypoints`: doubts frames that have a hand or a foot elsewhere than 2D keypoints have it."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import ClassVar

import numpy as np
from mocapflow_fitting.detections import has_keypoints, names_of, persons
from mocapflow_fitting.keypoint_layouts import rows_of
from mocapflow_fitting.person import Person
from pydantic import PositiveFloat

from mocapflow.components import Stage
from mocapflow.errors import RecordingError
from mocapflow.geometry.kinematics import joint_centres
from mocapflow.geometry.skeleton import unsided
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, I32
from mocapflow.results import Track, ViewChecks, in_order
from mocapflow.scene import Scene

LOG = logging.getLogger("mocapflow")
ENDS = ("wrist", "ankle")  # of limbs, on either side: pose estimators mark them within a few centimetres
AGREES = 0.1  # a view supports a keypoint if more of its confidence counts: within three times `halving_px`
VIEWS = 3  # that have to support it, where so many have keypoints
APART = (
    "keypoints have %s elsewhere in %d of %d frames, up to %.0f cm away: these frames are doubted. Either the limb is"
    " lost or the keypoints are wrong: look at the overlay"
)


class CheckKeypoints(Stage):
    """Doubts frames that have a hand or a foot elsewhere than the recording's 2D keypoints have it.

    A limb that looks like the room can be lost without a contradiction from the silhouettes, above all where the room
    is learnt from the recording. A pose estimator knows what hands and feet look like. Its keypoints, triangulated, are
    too coarse to improve a fit, but not to tell that a limb is lost.

    Wrists and ankles are compared, where no garment ends near them. Lost frames are left as they are, for their pose is
    a guess anyway; so is a recording without keypoints.
    """

    name: ClassVar[str] = "check_keypoints"
    apart_m: PositiveFloat = 0.15  # more is another place: on tracks that are right, up to 0.12 were found

    def run(self, track: Track, recording: Recording, scene: Scene, checks: ViewChecks | None = None) -> Track:
        """Return the track with such frames doubted, each with a note."""
        ends = _ends(scene)
        if not len(ends) or not has_keypoints(recording):
            return track
        try:
            people = persons(recording, track.frame.tolist(), scene.cameras, checks)
            names = names_of(recording, list(people), None)
        except RecordingError as error:
            LOG.warning("the track is not compared with the keypoints: %s", error)
            return track
        joints = [scene.body.joint_names[joint] for joint in ends]
        marked, places = np.full((len(track.frame), len(ends), 3), np.nan), rows_of(names, joints)
        for row in np.flatnonzero(~track.lost).tolist():
            if (index := int(track.frame[row])) in people:
                marked[row] = np.where(places[:, None] >= 0, _supported(people[index])[places], np.nan)
        off = np.linalg.norm(joint_centres(scene.body, track.root, track.angles)[:, ends] - marked, axis=2)
        return self._doubted(track, joints, off)

    def _doubted(self, track: Track, joints: list[str], off: F64) -> Track:
        """Return the track with frames doubted in which a joint is too far off (T, E) m its keypoint; NaN: unknown."""
        apart, count = off > self.apart_m, len(track.frame)
        for joint in np.flatnonzero(apart.any(axis=0)).tolist():
            LOG.warning(APART, joints[joint], apart[:, joint].sum(), count, 100 * np.nanmax(off[:, joint]))
        notes = [  # in the same words, so that the report says each once, with its frames
            f"frame {track.frame[row]}: keypoints have {joints[joint]} elsewhere"
            for row, joint in np.argwhere(apart).tolist()
        ]
        return replace(track, doubted=track.doubted | apart.any(axis=1), notes=in_order([*track.notes, *notes]))


def _ends(scene: Scene) -> I32:
    """Return the joints at the ends of limbs that no garment is near."""
    away = np.linalg.norm(scene.body.positions[:, None] - scene.body.vertices, axis=2)
    near_garment = scene.near_garment[away.argmin(axis=1)]
    ends = [unsided(name) in ENDS for name in scene.body.joint_names]
    return np.flatnonzero(ends & ~near_garment).astype(np.int32)


def _supported(person: Person) -> F64:
    """Return a person's keypoints (K, 3) m, NaN where too few cameras support one."""
    views = (person.points.weight > AGREES * person.confidence).sum(axis=0)
    enough = views >= min(VIEWS, (person.confidence > 0).any(axis=1).sum())
    return np.where(enough[:, None], person.points.position, np.nan)
