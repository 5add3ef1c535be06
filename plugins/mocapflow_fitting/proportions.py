"""Bodies of other shapes and proportions: as people differ, segments stretched, and joints that turn elsewhere."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from mocapflow.assets import Body
from mocapflow.geometry import twists
from mocapflow.geometry.skeleton import SEGMENTS, body_directions, skeleton_of, unsided
from mocapflow.records import F64

LOG = logging.getLogger("mocapflow")
# What can be stretched; `stature` multiplies all, `girth` what lies across the limbs and the depth of the trunk.
Proportion = Literal[
    "stature", "girth", "trunk", "shoulder_width", "hip_width", "head",
    "thigh", "shank", "foot", "upper_arm", "forearm",
]  # fmt: skip
PROPORTIONS: tuple[str, ...] = get_args(Proportion)
LIMBS = {start: segment for segment, (start, _) in SEGMENTS.items()}
CENTRES = ("hip_forward_m", "knee_up_m")  # m, how far joints turn from where the body has them
SHAPE = "shape_"  # begins the name of what a body is changed by along one of its modes
WHOLE = {"neck": "head", "head": "head", "ankle": "foot", "toe": "foot", "wrist": "forearm"}


def scaled(body: Body, factors: Mapping[str, float]) -> Body:
    """Return a body of another shape and other proportions.

    Args:
        body: at rest.
        factors: by the names in PROPORTIONS, 1 where left out, left and right alike; by those in CENTRES, 0 where left
            out; and shape_0 and so on, how many standard deviations to go along each of the body's modes.

    The shape changes first, then where joints turn in it. Then joint j stretches what it carries by A_j about itself,
    so child joints move by A_parent, and a vertex moves to sum_j w_j (p'_j + A_j (v - p_j)): smooth where the weights
    are. Axes keep their directions.
    """
    body = _recentred(_shaped(body, factors), *(factors.get(name, 0.0) for name in CENTRES))
    stretch = _stretches(body, factors)
    positions = body.positions.copy()
    for joint in range(len(positions)):
        parent = int(body.parents[joint])
        if parent >= 0:
            positions[joint] = positions[parent] + stretch[parent] @ (body.positions[joint] - body.positions[parent])
    vertices = np.zeros_like(body.vertices)
    for k in range(body.skin_joint.shape[1]):
        own = body.skin_joint[:, k]
        moved = positions[own] + np.einsum("vab,vb->va", stretch[own], body.vertices - body.positions[own])
        vertices += body.skin_weight[:, k, None] * moved
    offset = body.morph_offset
    if offset is not None:
        offset = np.einsum("vk,vkab,vb->va", body.skin_weight, stretch[body.skin_joint], offset)
    return replace(_moved(body, vertices, positions), morph_offset=offset)


def of_stature(body: Body, times: float) -> Body:
    """Return a body so many times as tall, all of it to one scale; its soles are where they were."""
    low = np.array([0.0, 0.0, body.vertices[:, 2].min()])
    offset, shapes, joints = (
        None if part is None else times * part for part in (body.morph_offset, body.shape_modes, body.joint_modes)
    )
    wide = replace(body, morph_offset=offset, shape_modes=shapes, joint_modes=joints)
    return _moved(wide, low + times * (body.vertices - low), low + times * (body.positions - low))


def fitted(body: Body, factors: Mapping[str, float]) -> Body:
    """Return a body of the proportions that were fitted to it, and tell them; its soles are where they were.

    `scaled` holds the root joint, so that longer legs reach below the floor; but the heights of garments count from it.
    """
    LOG.info("proportions: %s", ", ".join(f"{name} {factor:.3f}" for name, factor in factors.items()))
    other = scaled(body, factors)
    up = np.array([0.0, 0.0, body.vertices[:, 2].min() - other.vertices[:, 2].min()])
    return _moved(other, other.vertices + up, other.positions + up)


def modes_of(body: Body) -> tuple[str, ...]:
    """Return the names of the modes in which a body can change its shape."""
    return () if body.shape_modes is None else tuple(f"{SHAPE}{m}" for m in range(len(body.shape_modes)))


def _shaped(body: Body, factors: Mapping[str, float]) -> Body:
    """Return a body moved along its modes; it has none any more."""
    plain, by = replace(body, shape_modes=None, joint_modes=None), [factors.get(name, 0.0) for name in modes_of(body)]
    if body.shape_modes is None or body.joint_modes is None or not any(by):
        return plain
    vertices, positions = (np.tensordot(by, modes, 1) for modes in (body.shape_modes, body.joint_modes))
    return _moved(plain, body.vertices + vertices, body.positions + positions)


def _recentred(body: Body, hip_forward_m: float, knee_up_m: float) -> Body:
    """Return a body whose hips and knees turn elsewhere in it; its skin stays."""
    forward, _, up = body_directions(skeleton_of(body))
    away = {"hip": hip_forward_m * forward, "knee": knee_up_m * up}
    shifts = [away.get(unsided(name), np.zeros(3)) for name in body.joint_names]
    return _moved(body, body.vertices, body.positions + np.array(shifts))


def _moved(body: Body, vertices: F64, positions: F64) -> Body:
    """Return a body with its vertices and joints elsewhere; the axes of the joints keep their directions."""
    screws = twists.screw(body.twists[:, :3], positions[body.screw_joint])
    return replace(body, vertices=vertices, positions=positions, twists=screws)


def _stretches(body: Body, factors: Mapping[str, float]) -> F64:
    """Return the stretch (J, 3, 3) of what each joint carries."""
    unknown = [name for name in factors if name not in (*PROPORTIONS, *CENTRES) and not name.startswith(SHAPE)]
    if unknown:
        raise ValueError(f"unknown proportions {sorted(unknown)}; there are {PROPORTIONS}")
    by = {name: factors.get(name, 1.0) for name in PROPORTIONS}
    skeleton = skeleton_of(body)
    directions = body_directions(skeleton)
    stretch = np.empty((len(body.parents), 3, 3))
    for joint, name in enumerate(body.joint_names):
        base = unsided(name)
        if base in LIMBS:
            bone = skeleton.bone(joint)
            along = np.outer(bone, bone) / (bone @ bone)
            stretch[joint] = by[LIMBS[base]] * along + by["girth"] * (np.eye(3) - along)
        elif base in WHOLE:
            stretch[joint] = by[WHOLE[base]] * np.eye(3)
        else:
            hips, shoulders = by["hip_width"], by["shoulder_width"]
            width = {"pelvis": hips, "chest": shoulders, "clavicle": shoulders}.get(base, (hips + shoulders) / 2)
            stretch[joint] = directions.T @ np.diag([by["girth"], width, by["trunk"]]) @ directions
    return by["stature"] * stretch
