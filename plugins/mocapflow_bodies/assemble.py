"""Putting a body together from mesh, skeleton and weights; cutting parts out of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.errors import PipelineError, RecordingError, alternatives
from mocapflow.geometry.meshes import edges
from mocapflow.geometry.skeleton import Skeleton, unsided
from mocapflow.records import F64, I32, Bool
from mocapflow_bodies.joints import screws
from mocapflow_bodies.weights import strongest

Part = Literal["full", "legs", "arms"]
KEPT_JOINTS = {
    "legs": ("pelvis", "spine", "hip", "knee", "ankle", "toe"),  # up to the waist: they may wear something
    "arms": ("pelvis", "spine", "chest", "neck", "head", "clavicle", "shoulder", "elbow", "wrist"),
}
KNOWN, TRUNK = set().union(*KEPT_JOINTS.values()), ("pelvis", "spine", "chest")


class Cut(NamedTuple):
    """A part of a body."""

    used: I32  # (V,) indices of the vertices that stay
    faces: I32  # (F, 3)
    skeleton: Skeleton
    weights: F64  # (V, J)
    rim: Bool  # (V,)


class SecondShape(NamedTuple):
    """Another shape of a mesh, which an angle drives."""

    offset: F64  # (V, 3) m, from the first one
    angle: str
    between: tuple[float, float]  # rad, where it is the first shape alone, and the second


def assemble(
    vertices: F64, faces: I32, skeleton: Skeleton, weights: F64, part: Part, second: SecondShape | None = None
) -> Body:
    """Return the body of a mesh (V, 3) m, (F, 3), a skeleton and weights (V, J), or a part of it.

    Raises:
        PipelineError: the second shape names an angle the body lacks.
    """
    rim, used = np.zeros(len(vertices), bool), np.arange(len(vertices), dtype=np.int32)
    if part != "full":
        used, faces, skeleton, weights, rim = cut_out(faces, skeleton, weights, KEPT_JOINTS[part])
    skin_joint, skin_weight = strongest(weights)
    chain = screws(skeleton)
    body = Body(
        vertices=np.array(vertices[used], np.float64), faces=np.array(faces, np.int32),
        joint_names=skeleton.names, parents=skeleton.parents, positions=skeleton.positions,
        screw_names=chain.names, twists=chain.twists, screw_joint=chain.joint, limits=chain.limits,
        rest_spread=chain.rest_spread, skin_joint=skin_joint, skin_weight=skin_weight, cut=rim,
    )  # fmt: skip
    if second is None:
        return body
    if second.angle not in chain.names:
        hint = alternatives(second.angle, chain.names)
        raise PipelineError(f"the body has no angle '{second.angle}'", where="body.morph.angle", hint=hint)
    driving = chain.names.index(second.angle)
    return replace(body, morph_offset=second.offset[used], morph_screw=driving, morph_range=second.between)


def cut_out(faces: I32, skeleton: Skeleton, weights: F64, kept: tuple[str, ...]) -> Cut:
    """Return the part of a body that the joints named in `kept` move, and which vertices lie on the new rim.

    A joint of another name, such as a finger's, stays with the limb that it hangs on. A vertex stays if most of its
    weight does; what weight it loses goes to the nearest kept joint above.

    Raises:
        RecordingError: a kept joint hangs below one that goes, or nothing is left.
    """
    stays = _staying(skeleton, kept)
    inside = weights[:, stays].sum(axis=1) > 0.5 * weights.sum(axis=1)
    whole = inside[faces].all(axis=1)
    lost = [j for j in np.flatnonzero(stays & (skeleton.parents >= 0)) if not stays[skeleton.parents[j]]]
    if lost or not whole.any():
        what = (
            f"joint '{skeleton.names[lost[0]]}' would lose its parent" if lost else "no face of the mesh would be left"
        )
        raise RecordingError(f"this part can't be cut from the body: {what}", hint=f"joints kept: {', '.join(kept)}")
    used = np.unique(faces[whole])
    number = np.full(len(weights), -1)
    number[used] = np.arange(len(used))
    rim = np.zeros(len(weights), bool)
    rim[_boundary(faces[whole])] = True
    rim[_boundary(faces)] = False  # an opening the mesh had before is no cut
    joints = np.flatnonzero(stays)
    renumber = np.full(len(stays) + 1, -1)  # the last entry: the root's parent
    renumber[joints] = np.arange(len(joints))
    part = Skeleton(
        tuple(skeleton.names[j] for j in joints),
        renumber[skeleton.parents[joints]].astype(np.int32),
        skeleton.positions[joints],
    )
    moved = _handed_up(weights, skeleton, stays)[used][:, joints]
    return Cut(used.astype(np.int32), number[faces[whole]].astype(np.int32), part, moved, rim[used])


def _staying(skeleton: Skeleton, kept: tuple[str, ...]) -> Bool:
    stays = np.zeros(len(skeleton.names), bool)
    for joint, (name, above) in enumerate(zip(map(unsided, skeleton.names), skeleton.parents, strict=True)):
        on_limb = above > 0 and stays[above] and unsided(skeleton.names[above]) not in TRUNK
        stays[joint] = name in kept or (name not in KNOWN and (above < 0 or on_limb))  # a root of any name
    return stays


def _boundary(faces: I32) -> I32:
    pairs = edges(faces)
    return np.asarray(pairs[pairs[:, 3] < 0, :2].ravel())


def _handed_up(weights: F64, skeleton: Skeleton, stays: Bool) -> F64:
    moved = weights.copy()
    for joint in reversed(range(len(stays))):
        if not stays[joint] and skeleton.parents[joint] >= 0:
            moved[:, skeleton.parents[joint]] += moved[:, joint]
    return moved
