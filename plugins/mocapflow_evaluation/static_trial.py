"""Inner markers that only a standing trial has, carried along by the segment that they are on.

Laboratories take the inner markers of knees, ankles and elbows off before somebody moves. Standing with all of them
has shown where they lie on the segment: Cappozzo, Catani, Della Croce, Leardini, Clin. Biomech. 10 (1995), 171.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.geometry.registration import rigid_motion
from mocapflow.records import F64
from mocapflow_evaluation.marker_joints import SIDES, joint_centres

STEM = "static"  # name of its file, beside the reference
ABOVE = {"knee": "hip", "ankle": "knee", "elbow": "shoulder", "wrist": "elbow"}  # a centre that is found helps the next
STILL_M = 0.05  # that a marker may move while somebody stands
ASIDE_M = 0.2  # of a marker, on a wand too, from the line between the ends of its segment
SLIDES_M, MOSTLY = 0.03, 0.9  # by which a marker's distance to an end may change as skin slides; share of the frames
LEAST, FLAT = 3, 0.05  # points that tell how a segment is turned; spread across the line on which they may not lie
Ends = tuple[F64, F64]  # centre of the joint at the upper end of a segment, outer marker at the lower one


class Trial(NamedTuple):
    """Markers of one trial, over T frames."""

    landmarks: Mapping[str, F64]  # (T, 3) m
    others: Mapping[str, F64]  # (T, 3) m by marker: those on no landmark


def file_beside(reference: Path, suffixes: tuple[str, ...]) -> Path | None:
    """Return the file of the standing trial beside a reference, None where there is none."""
    files = sorted(path for path in reference.parent.glob(f"{STEM}.*") if path.suffix.lower() in suffixes)
    return files[0] if files and files[0] != reference else None


def standing(trial: Trial, path: Path) -> Trial:
    """Return a standing trial as one frame: the median of each marker.

    Raises:
        RecordingError: a marker moves.
    """
    for name, places in {**trial.landmarks, **trial.others}.items():
        reach = float(np.nanmax(np.linalg.norm(places - _middle(places), axis=1), initial=0.0))
        if reach > STILL_M:
            hint = "it shows somebody who stands still; cut it to where they do, or name the file otherwise"
            raise RecordingError(f"{name} moves by {reach:.2f} m in this standing trial", where=str(path), hint=hint)
    return Trial(*({name: _middle(places) for name, places in each.items()} for each in trial))


def carried(moving: Trial, still: Trial) -> tuple[dict[str, F64], list[str]]:
    """Return the inner landmarks (T, 3) m that the motion lacks, and the names of those that it can't tell of.

    Each is carried by the segment above its joint: by the joint's centre at the upper end, the outer marker at the
    lower one, and the markers between, of which one at least has to be in both trials.

    Args:
        moving: the motion.
        still: one frame of the standing trial.
    """
    known, found, lacking = dict(moving.landmarks), dict[str, F64](), list[str]()
    for inner, outer, upper in _wanted(moving, still):
        then, now = joint_centres(still.landmarks), joint_centres(known)
        if upper not in then or upper not in now:
            lacking.append(inner)
            continue
        ends = (then[upper], still.landmarks[outer]), (now[upper], known[outer])
        points = _segment(*ends, still.others, moving.others)
        if not _tells_turn(points[0]):
            lacking.append(inner)
            continue
        known[inner] = found[inner] = _moved(still.landmarks[inner][0], *points)
    return found, lacking


def _wanted(moving: Trial, still: Trial) -> Iterator[tuple[str, str, str]]:
    """Yield inner and outer landmark, and the joint above, where the standing trial alone has the inner one."""
    for joint, above in ABOVE.items():
        for side in SIDES:
            inner, outer = f"{joint}_medial_{side}", f"{joint}_lateral_{side}"
            if inner not in moving.landmarks and outer in moving.landmarks and {inner, outer} <= set(still.landmarks):
                yield inner, outer, f"{above}_{side}"


def _segment(then: Ends, now: Ends, still: Mapping[str, F64], moving: Mapping[str, F64]) -> tuple[F64, F64]:
    """Return the points on a segment standing (K, 3) m and moving (T, K, 3) m: its ends, and markers between them."""
    on_it = [
        name
        for name in sorted(still.keys() & moving.keys())
        if _beside(still[name], then)
        and all(_change(still[name], moving[name], *ends) < SLIDES_M for ends in zip(then, now, strict=True))
    ]
    return (
        np.concatenate([*then, *(still[name] for name in on_it)]),
        np.stack([*now, *(moving[name] for name in on_it)], axis=1),
    )


def _beside(place: F64, ends: Ends) -> bool:
    """Return whether a marker (1, 3) lies between the ends of a segment, and near it."""
    axis, way = ends[1] - ends[0], place - ends[0]
    along = float(np.sum(way * axis) / np.sum(axis**2))
    return 0 < along < 1 and float(np.linalg.norm(way - along * axis)) < ASIDE_M


def _change(still: F64, moving: F64, end_then: F64, end_now: F64) -> float:
    """Return by how much (m) a marker's distance to an end differs between standing and moving; inf: never seen.

    A hand that hangs beside a thigh does not stay there.
    """
    apart = np.linalg.norm(moving - end_now, axis=1) - np.linalg.norm(still - end_then)
    seen = apart[np.isfinite(apart)]
    return float(np.quantile(np.abs(seen), MOSTLY)) if len(seen) else np.inf


def _tells_turn(points: F64) -> bool:
    """Return whether points (K, 3) tell how what they are on is turned: these are enough, and not on one line."""
    if len(points) < LEAST:
        return False
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] > FLAT * spread[0])


def _moved(point: F64, then: F64, now: F64) -> F64:
    """Return where (T, 3) m a point (3,) of the standing segment is while it moves; NaN where too little is seen."""
    places = np.full((len(now), 3), np.nan)
    for frame, points in enumerate(now):
        seen = np.isfinite(points).all(axis=1)
        if _tells_turn(then[seen]):
            rotation, translation = rigid_motion(then[seen], points[seen])
            places[frame] = rotation @ point + translation
    return places


def _middle(places: F64) -> F64:
    """Return the median (1, 3) of the frames (T, 3) in which a marker was seen; NaN if in none."""
    seen = places[np.isfinite(places).all(axis=1)]
    return np.median(seen, axis=0)[None] if len(seen) else np.full((1, 3), np.nan)
