"""Joint angles from BVH motions, whose rest poses and axes differ: from the places of the joints alone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.geometry.angles import between_centres, hip_flexion
from mocapflow.records import F64

ALIASES: Mapping[str, tuple[str, ...]] = {  # ours: also those of CMU and HDM05 conversions, Mixamo, MotionBuilder
    "hip_l": ("leftupleg", "lefthip", "lhipjoint", "lefthipjoint", "lfemur"),
    "knee_l": ("leftleg", "leftknee", "leftlowleg", "ltibia"),
    "ankle_l": ("leftfoot", "leftankle", "lfoot"),
    "toe_l": ("lefttoebase", "lefttoe", "ltoes"),
    "shoulder_l": ("leftarm", "leftshoulder", "leftuparm", "lhumerus"),
    "elbow_l": ("leftforearm", "leftelbow", "leftlowarm", "lradius"),
    "wrist_l": ("lefthand", "leftwrist", "lwrist"),
    "spine": ("spine", "lowerback", "torso", "chest"),
}


def columns(path: Path) -> dict[str, F64]:
    """Return the angles (T,) in degrees that the joints of a BVH file allow, named as in angles.csv.

    Raises:
        RecordingError: the reader of BVH files is not installed, or the file is not whole.
    """
    rest, places = joint_places(path)
    found = between_centres(places)
    if {"hip_l", "hip_r", "spine", "knee_l", "knee_r"} <= set(places):
        pelvis = pelvis_axes(places, rest)
        for side in ("l", "r"):
            thigh = places[f"knee_{side}"] - places[f"hip_{side}"]
            found[f"hip_flexion_{side}"] = hip_flexion(thigh, pelvis)
    return found


def joint_places(path: Path) -> tuple[dict[str, F64], dict[str, F64]]:
    """Return where each joint we have a name for is at rest (3,) and in every frame (T, 3), in the unit of the file."""
    try:
        import bvhio
    except ImportError as error:
        hint = "pip install 'mocapflow[bvh]'"
        raise RecordingError("BVH files need the package bvhio", where=str(path), hint=hint) from error
    _check_whole(path)
    root = bvhio.readAsHierarchy(str(path))
    joints = [joint for joint, _, _ in root.layout()]
    ours = our_names([joint.Name for joint in joints])
    first, last = root.getKeyframeRange()
    root.loadRestPose(recursive=True)
    rest = {name: np.array(tuple(joints[index].PositionWorld)) for name, index in ours.items()}
    places: dict[str, list[tuple[float, float, float]]] = {name: [] for name in ours}
    for frame in range(first, last + 1):
        root.loadPose(frame)
        for name, index in ours.items():
            places[name].append(tuple(joints[index].PositionWorld))
    return rest, {name: np.array(way) for name, way in places.items()}


def _check_whole(path: Path) -> None:
    """Check that a file goes on to its last frame: bvhio reads for ever where the joints are cut off.

    Raises:
        RecordingError: it does not.
    """
    joints, _, motion = path.read_text(encoding="utf-8", errors="replace").partition("MOTION")
    count = re.search(r"Frames:\s*(\d+)", motion)
    if joints.count("{") != joints.count("}") or count is None:
        raise RecordingError("no whole BVH file: its joints or its motion are cut off", where=str(path))
    rows = [line for line in motion.splitlines() if line.strip()][2:]  # below `Frames:` and `Frame Time:`
    if len(rows) < int(count[1]):
        said = f"no whole BVH file: {len(rows)} of {count[1]} frames are there"
        raise RecordingError(said, where=str(path), hint="copy it again")


def our_names(names: Sequence[str]) -> dict[str, int]:
    """Return which of the joints of a file are joints of ours."""
    plain = [name.rpartition(":")[2].lower().replace("_", "").replace(" ", "") for name in names]
    right = {f"{ours[:-1]}r": tuple(map(mirrored, others)) for ours, others in ALIASES.items() if ours.endswith("_l")}
    found = {}
    for ours, others in {**ALIASES, **right}.items():
        there = [name for name in (ours.replace("_", ""), *others) if name in plain]
        if there:
            found[ours] = plain.index(there[0])
    return found


def mirrored(name: str) -> str:
    """Return the name of the same joint on the right."""
    return name.replace("left", "right") if name.startswith("left") else "r" + name[1:]


def pelvis_axes(places: Mapping[str, F64], rest: Mapping[str, F64]) -> F64:
    """Return the axes of the pelvis as rows: forward and up (T, 2, 3).

    Where a skeleton has the first joint of its spine says little of what is up: it is the axis of the file that runs
    along the thighs at rest, as people stand there, and turns with the pelvis.
    """
    middle = 0.5 * (rest["hip_l"] + rest["hip_r"])
    along = middle - 0.5 * (rest["knee_l"] + rest["knee_r"])
    up = np.where(np.arange(3) == np.abs(along).argmax(), np.sign(along), 0.0)
    forward = np.cross(rest["hip_l"] - rest["hip_r"], up)
    axes = np.stack([forward / np.linalg.norm(forward), up])
    return axes @ pelvis_frame(rest).T @ pelvis_frame(places)


def pelvis_frame(places: Mapping[str, F64]) -> F64:
    """Return a frame (..., 3, 3) that is fixed to hips and spine, its axes as rows."""
    left = places["hip_l"] - places["hip_r"]
    ahead = np.cross(left, places["spine"] - 0.5 * (places["hip_l"] + places["hip_r"]))
    frame: F64 = np.stack([left, ahead, np.cross(ahead, left)], axis=-2)
    frame /= np.linalg.norm(frame, axis=-1, keepdims=True)
    return frame
