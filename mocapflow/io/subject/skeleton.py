"""The skeleton of a scan beside its mesh, `skeleton.json`, and whether it belongs to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.errors import RecordingError, alternatives
from mocapflow.geometry.skeleton import SEGMENTS, Skeleton, body_directions, to_segment
from mocapflow.io.json_toml import place, read_json
from mocapflow.records import F64

FORM = 'expected {"joints": [{"name": "pelvis", "parent": null, "position": [x, y, z] in m}, …]}, parents first'
UNSCANNED = "without a scan: pipelines/unscanned.yaml fits a template to silhouettes, fit_subject one to keypoints"
METRES = "expected metres, z up"
TALLEST, SMALLEST = 3.0, 0.3  # m, extents of a plausible body
SHORTEST = 0.01  # m, a bone between joints whose angle is measured, and the way from one hip to the other
LIMBS = ("knee", "ankle", "elbow", "wrist")  # joints that end such a bone
PAIRS = (("hip_l", "hip_r"), ("shoulder_l", "shoulder_r"))  # that tell left from right
MARGIN = 0.1  # m that a joint may lie outside the box about the mesh
LIFTED = 0.03  # m between the soles and z = 0
ASIDE = 0.4  # m sideways from the nearest bone; fingers reach 0.2, as seen from above
UNEVEN = 1.15  # a limb by that of the other side; people differ by some hundredths


def read_skeleton(path: Path) -> Skeleton:
    """Read a skeleton.

    Raises:
        RecordingError: the file is missing, malformed, not parents first, has two roots or numbers that are not finite,
            two joints of a limb are in one place, or left and right are exchanged.
    """
    if not path.is_file():
        raise RecordingError("there is no skeleton for the mesh", where=str(path), hint=f"{FORM}\n{UNSCANNED}")
    content = read_json(path, FORM)
    try:
        skeleton = _skeleton(content, path)
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise RecordingError(f"this is not a skeleton: {error!r}", where=str(path), hint=FORM) from error
    _check_limbs(skeleton, path)
    return skeleton


def need_scan(path: Path) -> None:
    """Check that there is a scan.

    Raises:
        RecordingError: there is none.
    """
    if not path.is_file():
        raise RecordingError("no such mesh", where=str(path), hint=UNSCANNED)


def check_size(vertices: F64, skeleton: Skeleton, where: str) -> None:
    """Check that a mesh (V, 3) and a skeleton are in metres, upright along z and in the same place.

    Raises:
        RecordingError: they are not.
    """
    extents = np.ptp(vertices, axis=0)
    size = ", ".join(f"{extent:.4g}" for extent in extents)
    if extents.max() > TALLEST:
        guess = "in millimetres: divide by 1000" if extents.max() > 300 else "not in metres"
        raise RecordingError(f"the mesh measures {size}: it seems to be {guess}", where=where, hint=METRES)
    if extents.max() < SMALLEST:
        raise RecordingError(f"the mesh measures {size} m: too small for a person", where=where, hint=METRES)
    if extents.argmax() == 1 and extents[1] > 1.3 * extents[2]:
        hint = "expected z up: swap (x, y, z) to (x, -z, y)"
        raise RecordingError(f"the mesh measures {size} m: it seems to stand along y", where=where, hint=hint)
    low, high = vertices.min(axis=0) - MARGIN, vertices.max(axis=0) + MARGIN
    outside = ((skeleton.positions < low) | (skeleton.positions > high)).any(axis=1)
    if outside.any():
        hint = "both are expected in metres and in the same rest pose, z up"
        what = f"{outside.sum()} of {len(outside)} joints lie more than 10 cm outside the mesh"
        raise RecordingError(f"{what}, first '{skeleton.names[int(outside.argmax())]}'", where=where, hint=hint)


def odd_scan(vertices: F64, skeleton: Skeleton) -> Iterator[str]:
    """Say if a mesh (V, 3) m does not stand on the floor or holds more than the person, or joints are out of place."""
    yield from _uneven(skeleton)
    lowest = float(vertices[:, 2].min())
    if abs(lowest) > LIFTED and any(name.startswith("ankle") for name in skeleton.names):
        yield f"the scan begins at z = {lowest:.2f} m: heights of garments are measured from z = 0, on which it stands"
    seen_from_above = skeleton._replace(positions=skeleton.positions * (1, 1, 0))
    aside = np.full(len(vertices), np.inf)
    for joint in range(len(skeleton.names)):
        begin, bone = seen_from_above.positions[joint], seen_from_above.bone_before(joint)
        aside = np.minimum(aside, to_segment(vertices * (1, 1, 0), begin - bone, begin))
    if (farthest := float(aside.max())) > ASIDE:
        yield f"the scan reaches {farthest:.1f} m beside all bones: cut away what is not the person, such as the floor"


def _uneven(skeleton: Skeleton) -> Iterator[str]:
    """Say which limbs have another length on the left than on the right."""
    at = dict(zip(skeleton.names, skeleton.positions, strict=True))
    for limb, ends in SEGMENTS.items():
        pairs = [[f"{end}_{side}" for end in ends] for side in "lr"]
        if at.keys() >= {name for pair in pairs for name in pair}:
            left, right = (float(np.linalg.norm(at[a] - at[b])) for a, b in pairs)
            if not 1 / UNEVEN < left / right < UNEVEN:
                what = f"the {limb.replace('_', ' ')} is {left:.2f} m long on the left, {right:.2f} m on the right"
                yield f"{what}: are {' and '.join(ends)} of both sides at their places?"


def _check_limbs(skeleton: Skeleton, path: Path) -> None:
    """Check that limbs have a length, that left is apart from right, and that toes point the way the body looks."""
    at = dict(zip(skeleton.names, skeleton.positions, strict=True))
    bones = [(name, skeleton.names[parent]) for name, parent in zip(skeleton.names, skeleton.parents, strict=True)
             if parent >= 0 and name.startswith(LIMBS)]  # fmt: skip
    for name, other in [*bones, *(pair for pair in PAIRS if set(pair) <= at.keys())]:
        apart = (at[name] - at[other])[: 2 if (name, other) in PAIRS else 3]  # left and right: as seen from above
        if np.linalg.norm(apart) < SHORTEST:
            what, hint = f"joints '{name}' and '{other}' are in one place", "no angle can be measured there"
            raise RecordingError(what, where=place(path, name), hint=hint)
    feet = [at[f"toe_{side}"] - at[f"ankle_{side}"] for side in "lr" if {f"toe_{side}", f"ankle_{side}"} <= at.keys()]
    if feet and np.mean(feet, axis=0) @ body_directions(skeleton)[0] < 0:
        hint = "hip_l is the person's own left hip: exchange _l and _r in all names; mind weights.npz and init.json"
        raise RecordingError("the toes point backwards: left and right are exchanged", where=str(path), hint=hint)


def _skeleton(content: Mapping[str, Any], path: Path) -> Skeleton:
    joints = content["joints"]
    names = [str(joint["name"]) for joint in joints]
    parents = []
    for row, joint in enumerate(joints):
        parent, earlier = joint["parent"], names[:row]
        if names[row] in earlier:
            raise RecordingError(f"joint '{names[row]}' is listed twice", where=place(path, names[row]), hint=FORM)
        if parent is not None and parent not in earlier:
            hint = f"a parent stands before its children; {alternatives(str(parent), earlier)}"
            what = f"parent '{parent}' of joint '{names[row]}' is not listed before it"
            raise RecordingError(what, where=place(path, names[row]), hint=hint)
        parents.append(-1 if parent is None else names.index(parent))
    positions = np.array([joint["position"] for joint in joints], np.float64).reshape(len(names), 3)
    if parents.count(-1) != 1 or not np.isfinite(positions).all():
        what = "positions are not all numbers" if not np.isfinite(positions).all() else "one joint must have no parent"
        raise RecordingError(what, where=str(path), hint=FORM)
    return Skeleton(tuple(names), np.array(parents, np.int32), positions)
