"""The person's keypoints of a frame, found among all detections and triangulated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.recordings.recording import Recording
from mocapflow.results import ViewChecks
from mocapflow_fitting.keypoint_fit import Seen
from mocapflow_fitting.keypoint_layouts import LAYOUTS, Layout, layout_of, rows_of
from mocapflow_fitting.person import Person, find_person

LEAST_POINTS = 8  # triangulated keypoints that make a usable frame
LEAST_LANDMARKS = 3  # of the body's among them: fewer do not say how it is turned


def has_keypoints(recording: Recording) -> bool:
    """True where at least two cameras have keypoints: fewer place nothing in space."""
    return sum(folder is not None for folder in recording.keypoint_folders) >= 2


def need_keypoints(recording: Recording) -> None:
    """Check that at least two cameras have keypoints.

    Raises:
        RecordingError: they have not.
    """
    if has_keypoints(recording):
        return
    there = ", ".join(sorted(path.name for path in recording.folder.iterdir()))
    hint = (
        f"expected keypoints/cam01_json/*.json as OpenPose writes them; the recording has: {there}\n"
        "docs/tutorial.md finds some with mediapipe; "
        "with a pose of the first frame in init.json, use the stage start_from_file"
    )
    raise keypoint_error(recording, "there are no 2D keypoints of two cameras or more", hint)


def keypoint_error(recording: Recording, message: str, hint: str) -> RecordingError:
    """Return the error of a recording's keypoints, with the folder they are in."""
    return RecordingError(message, where=str(recording.folder / "keypoints"), hint=hint)


def person_at(
    recording: Recording, index: int, cameras: Sequence[Camera], checks: ViewChecks | None = None
) -> Person | None:
    """Return the person in a frame, by keypoints as checks pass them; None where too few can be triangulated."""
    people = recording.people(index)
    person = find_person(people if checks is None else checks.people(index, people), cameras)
    found = 0 if person is None else np.isfinite(person.points.position).all(axis=1).sum()
    return person if found >= LEAST_POINTS else None


def spaced_evenly(indices: Sequence[int], count: int) -> list[int]:
    """Return `count` frames spread evenly, or all of them if there are fewer."""
    rows = np.unique(np.linspace(0, len(indices) - 1, count).round().astype(int))
    return [indices[row] for row in rows]


def persons(
    recording: Recording, indices: Sequence[int], cameras: Sequence[Camera], checks: ViewChecks | None = None
) -> dict[int, Person]:
    """Return the person in each frame where there is one, by keypoints as checks pass them.

    Raises:
        RecordingError: there are no keypoints, or nobody is found in any frame.
    """
    need_keypoints(recording)
    seen = {index: person_at(recording, index, cameras, checks) for index in indices}
    found = {index: person for index, person in seen.items() if person is not None}
    if not found:
        hint = "check that keypoints and cameras belong together (`mocapflow doctor`)"
        raise keypoint_error(recording, "in no frame two cameras see the same person", hint)
    return found


def names_of(recording: Recording, indices: Sequence[int], wanted: Layout | None) -> tuple[str, ...]:
    """Return the names of the keypoints, in the order of the files.

    Raises:
        RecordingError: no layout has so many, or not the wanted one, or these frames do not tell which of two it is.
    """
    detections = [points for index in indices for view in recording.people(index) for points in view]
    told = layout_of(detections, wanted)
    if told is None:
        message = "25 keypoints may be BODY_25 or BODY_25B: neither hips nor shoulders are seen that would tell"
        hint = (
            "begin where one of them is seen; fit_subject, start_from_keypoints and keypoints have a setting `layout`"
        )
        raise keypoint_error(recording, message, hint)
    return LAYOUTS[told]


def frames_seen(
    recording: Recording,
    indices: Sequence[int],
    cameras: Sequence[Camera],
    landmarks: Sequence[str],
    wanted: Layout | None = None,
    checks: ViewChecks | None = None,
) -> dict[int, Seen]:
    """Return the person's landmarks in each frame that tells a pose, by keypoints as checks pass them.

    Raises:
        RecordingError: there are no keypoints, or they tell no pose in any frame; see `persons` and `names_of`.
    """
    found = persons(recording, indices, cameras, checks)
    names = names_of(recording, list(found), wanted)
    frames = {index: seen(person, names, landmarks) for index, person in found.items()}
    telling = {index: frame for index, frame in frames.items() if tells_pose(frame)}
    if not telling:
        hint = f"the body has {', '.join(landmarks)}; choose one with the parts that are seen"
        raise keypoint_error(recording, "the keypoints show too little of the body", hint)
    return telling


def tells_pose(frame: Seen) -> bool:
    """True where enough of the body's landmarks are triangulated."""
    return int(np.isfinite(frame.position).all(axis=1).sum()) >= LEAST_LANDMARKS


def seen(person: Person, names: Sequence[str], wanted: Sequence[str]) -> Seen:
    """Return a person's keypoints (named `names`) in the order of the landmarks `wanted`."""
    row = rows_of(names, wanted)
    known = row >= 0
    return Seen(
        position=np.where(known[:, None], person.points.position[row], np.nan),
        pixels=person.pixels[:, row],
        confidence=np.where(known, person.confidence[:, row], 0.0),
    )
