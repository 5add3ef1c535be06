"""Stage `check_views`: finds pictures that can't be what a camera saw at that moment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.recordings.freezing import frozen_from, repeated
from mocapflow.recordings.recording import Recording
from mocapflow.records import F32, Bool
from mocapflow.results import ViewChecks
from mocapflow_robustness.knock_detection import KnockDetector
from mocapflow_robustness.picture_checks import blank, bursts, interpolated, lookalike, shows_person
from mocapflow_robustness.thumbnails import Thumbnails, thumbnail, thumbnails

LONGEST_S = 0.17  # of a burst of wrong pictures
JUMP = 2.0  # how much larger than the motion around it a jump is, in the view that shows it best
JOINT_JUMP = 1.3  # how much larger than the motion around it a jump is in a view that jumps with another one


class CheckViews(Stage):
    """Looks through the whole recording for pictures that are black, repeated, of another camera or of another moment.

    It needs no pose, so a track that is lost can't make it distrust the images, and it looks ahead: what jumps away
    and comes back within a few frames is no motion. The track goes without these pictures and says so. What stays
    unnoticed: another moment that differs little from the true one or lasts long, and a repeated picture in all views.

    If a camera is knocked during the recording, the track sees its pictures moved back. How it stands is compared with
    the empty scene every two seconds, and frame by frame between two such frames that differ: a camera that is put back
    at once stays unnoticed.
    """

    name: ClassVar[str] = "check_views"
    extent: ClassVar[Literal["all"]] = "all"  # so that a longer run finds the same

    def run(self, recording: Recording, background: Background | None = None) -> ViewChecks:
        """Return the pictures to do without, each with a reason, and when cameras were knocked."""
        known = () if background is None else zip(background.pictures, background.known, strict=True)
        detector = KnockDetector(recording, room=dict(enumerate(known)))
        seen = thumbnails(recording, detector.look)
        names = [camera.name for camera in recording.cameras]
        said = faults(seen, rooms(seen, background), recording.frame_rate, names)
        rows, cameras = np.nonzero(said != "")
        return ViewChecks(
            frame=rows.astype(np.int32),
            camera=cameras.astype(np.int16),
            reasons=tuple(said[rows, cameras].tolist()),
            knocks=detector.knocks(),
        )


def longest(frame_rate: float) -> int:
    """Return of how many frames a burst may be."""
    return max(round(LONGEST_S * frame_rate), 1)


def faults(seen: Thumbnails, room: F32, frame_rate: float, names: Sequence[str]) -> npt.NDArray[np.object_]:
    """Return (T, C) why a picture is not to be trusted, "" where it is.

    Args:
        seen: all pictures.
        room: (C, S, S) thumbnails of the empty scene.
        frame_rate: per second.
        names: of the cameras.
    """
    empty = blank(seen.grey, room)
    foreign, like = lookalike(seen.grey, room)
    good = seen.usable & ~(empty | foreign)
    old = repeated(np.where(empty | foreign, np.nan, seen.change)) | frozen(seen)
    old &= shows_person(seen.grey, room, good) | (frozen_from(seen.change) == 0)  # then it is its own empty room
    settled = interpolated(seen.grey, good & ~old)
    torn = bursts(settled, longest(frame_rate), JUMP, JOINT_JUMP)
    said = np.full(empty.shape, "", object)
    said[torn] = "the picture does not fit the ones before and after"
    said[old] = "the picture repeats the one before"
    said[foreign] = [f"the picture looks like one of {names[camera]}" for camera in like[foreign]]
    said[empty] = "the picture shows nothing"
    said[~seen.usable] = ""  # already known to be missing
    return said


def rooms(seen: Thumbnails, background: Background | None) -> F32:
    """Return (C, S, S) thumbnails of the empty scene; without one known, the median over the recording."""
    if background is None:
        shown = seen.usable & ~frozen(seen)
        return np.stack([median(seen.grey[shown[:, c], c]) for c in range(seen.grey.shape[1])])
    return np.stack([thumbnail(room) for room in background.pictures])


def frozen(seen: Thumbnails) -> Bool:
    """Return (T, C) which pictures repeat one that a camera shows to the end."""
    late: Bool = np.arange(len(seen.change))[:, None] >= frozen_from(seen.change)
    return late & np.isfinite(seen.change)


def median(grey: F32) -> F32:
    """Return the median (S, S) over thumbnails (N, S, S); a black one of none."""
    return np.asarray(np.median(grey, axis=0) if len(grey) else np.zeros(grey.shape[1:]), np.float32)
