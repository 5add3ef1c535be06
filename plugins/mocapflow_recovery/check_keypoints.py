"""Stage `check_keypoints`: doubts frames that have a hand or a foot otherwise than 2D keypoints have it."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from mocapflow_fitting.detections import has_keypoints, names_of, persons
from mocapflow_fitting.keypoint_layouts import rows_of
from mocapflow_fitting.person import Person
from pydantic import Field, PositiveFloat

from mocapflow.components import Stage
from mocapflow.errors import RecordingError
from mocapflow.geometry.kinematics import joint_centres
from mocapflow.geometry.skeleton import unsided
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.results import Track, ViewChecks, in_order
from mocapflow.scene import Scene

LOG = logging.getLogger("mocapflow")
ENDS = ("wrist", "ankle")  # of limbs, on either side: pose estimators mark them within a few centimetres
TOE = "big_toe"  # the keypoint that tells, with the ankle's, where a foot points; not all layouts have it
AGREES = 0.1  # a view supports a keypoint if more of its confidence counts: within three times `halving_px`
VIEWS = 3  # that have to support it, where so many have keypoints
APART = (
    "keypoints have %s in %d of %d frames, by up to %.0f %s: these frames are doubted. Look at the overlay: either the"
    " keypoints are wrong or the limb is lost; a start by them may find it: --set stages.start=start_from_keypoints"
)


class Difference(NamedTuple):
    """By how much a joint is otherwise than keypoints have it."""

    what: str  # in words
    by: F64  # (T,), NaN where nothing tells
    most: float  # that is no other place, nor another direction
    unit: str


class CheckKeypoints(Stage):
    """Doubts frames that have a hand or a foot otherwise than the recording's 2D keypoints have it.

    A limb that looks like the room can be lost without a contradiction from the silhouettes, above all where the room
    is learnt from the recording. A pose estimator knows what hands and feet look like. Its keypoints, triangulated, are
    too coarse to improve a fit, but not to tell that a limb is lost.

    The places of wrists and ankles are compared, and the directions from ankles to toes, where no garment ends near
    them. Lost frames are left as they are, for their pose is a guess anyway; so is a recording without keypoints.
    """

    name: ClassVar[str] = "check_keypoints"
    apart_m: PositiveFloat = 0.15  # more is another place: on tracks that are right, up to 0.12 were found
    turned_deg: Annotated[float, Field(gt=0, le=180)] = 45.0  # more is another foot's direction: right ones reach 29

    def run(self, track: Track, recording: Recording, scene: Scene, checks: ViewChecks | None = None) -> Track:
        """Return the track with such frames doubted, each with a note."""
        joints = _bare_ends(scene)
        if not joints or not has_keypoints(recording):
            return track
        try:
            people = persons(recording, track.frame.tolist(), scene.cameras, checks)
            names = names_of(recording, list(people), None)
        except RecordingError as error:
            LOG.warning("the track is not compared with the keypoints: %s", error)
            return track
        marked = np.full((len(track.frame), len(joints), 3), np.nan)
        places = rows_of(names, [joint.replace("toe", TOE) for joint in joints])
        for row in np.flatnonzero(~track.lost).tolist():
            if (index := int(track.frame[row])) in people:
                marked[row] = np.where(places[:, None] >= 0, _supported(people[index])[places], np.nan)
        centres = joint_centres(scene.body, track.root, track.angles)[:, [scene.body.joint(name) for name in joints]]
        return _doubted(track, self._differences(joints, centres, marked))

    def _differences(self, joints: list[str], tracked: F64, marked: F64) -> list[Difference]:
        """Compare joints (T, E, 3) m with their keypoints, NaN where unknown."""
        found = []
        for row, joint in enumerate(joints):
            if unsided(joint) in ENDS:
                off = np.linalg.norm(tracked[:, row] - marked[:, row], axis=1)
                found.append(Difference(f"{joint} elsewhere", 100 * off, 100 * self.apart_m, "cm"))
            elif (ankle := joint.replace("toe", "ankle")) in joints:
                feet = [each[:, row] - each[:, joints.index(ankle)] for each in (tracked, marked)]
                turned = _degrees_between(*feet)
                found.append(Difference(f"{ankle} turned otherwise", turned, self.turned_deg, "degrees"))
        return found


def _bare_ends(scene: Scene) -> list[str]:
    """Return the names of wrists, ankles and toes that no garment is near."""
    away = np.linalg.norm(scene.body.positions[:, None] - scene.body.vertices, axis=2)
    bare = ~scene.near_garment[away.argmin(axis=1)]
    named = zip(scene.body.joint_names, bare, strict=True)
    return [name for name, is_bare in named if is_bare and unsided(name) in (*ENDS, "toe")]


def _supported(person: Person) -> F64:
    """Return a person's keypoints (K, 3) m, NaN where too few cameras support one."""
    views = (person.points.weight > AGREES * person.confidence).sum(axis=0)
    enough = views >= min(VIEWS, (person.confidence > 0).any(axis=1).sum())
    return np.where(enough[:, None], person.points.position, np.nan)


def _degrees_between(one: F64, other: F64) -> F64:
    """Return the angles (T,) degrees between vectors (T, 3) and others, NaN where one is unknown."""
    across, along = np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1)
    return np.asarray(np.degrees(np.arctan2(across, along)))


def _doubted(track: Track, found: list[Difference]) -> Track:
    """Return the track with frames doubted that differ too much from the keypoints, a note each, and warn."""
    notes, doubted = list(track.notes), track.doubted.copy()
    for what, by, most, unit in found:
        if (apart := by > most).any():
            LOG.warning(APART, what, apart.sum(), len(apart), by[apart].max(), unit)
            # in the same words, so that the report says each once, with its frames
            notes += [f"frame {index}: keypoints have {what}" for index in track.frame[apart]]
            doubted |= apart
    return replace(track, doubted=doubted, notes=in_order(notes))
