"""Poses as OpenSim names and signs them, as Rajagopal 2016 does.

gait2392 has the same names without arms, and counts knees the other way.

Ground: x = world y, y = world z (up), z = world x (`opensim_axes`); pelvis_tilt and pelvis_list are turns
about the ground's own z and x, so they read as such for a person who faces the ground's x. Segments: x forward,
y up, z right. At rest the segment of a limb has y along the limb and z across the body (at an arm that is bent at
rest, along its hinge), so 0 is a straight, hanging limb. Every joint is the sequence z, x, y; signs are mirrored
between the sides:

- pelvis_tilt forward bend negative, pelvis_list, pelvis_rotation; pelvis_tx, ty, tz of the pelvis joint in m (of the
  root's rest place where a body has no pelvis)
- hip_flexion, hip_adduction, hip_rotation (inward positive); knee_angle positive in flexion; ankle_angle positive in
  dorsiflexion
- lumbar_extension, lumbar_bending, lumbar_rotation of the chest against the pelvis
- arm_flex, arm_add, arm_rot of the upper arm against the chest; elbow_flex is the three-point angle

Knee and ankle are the turns about the segment's z axis: signed, so a hyperextended knee is negative.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import PoseBatch
from mocapflow.geometry import angles, kinematics
from mocapflow.io.motion.opensim_axes import opensim_from_world
from mocapflow.records import F64

OPENSIM_FROM_WORLD = opensim_from_world(np.eye(3)).T
LEG, ARM = ("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")
BENT = np.radians(5.0)  # rad; an arm bent at least this much at rest shows the axis of its hinge


def coordinates(body: Body, root: F64, poses: F64) -> dict[str, F64]:
    """Return the coordinates (T,) that a body has, in degrees and m, by OpenSim's names.

    Args:
        body: the body.
        root: (T, 4, 4) m, world_from_body.
        poses: (T, D) rad, its angles.
    """
    joints = kinematics.chain_batch(body, PoseBatch(root=root, angles=poses))
    places = opensim_from_world(kinematics.joint_positions(body, joints))
    frames = {
        name: OPENSIM_FROM_WORLD @ joints[:, body.joint(name), :3, :3] @ rest
        for name, rest in rest_frames(body).items()
    }
    pelvis = "pelvis" if "pelvis" in body.joint_names else body.joint_names[0]
    found: dict[str, F64] = {}
    _add_turns(found, ("pelvis_tilt", "pelvis_list", "pelvis_rotation"), np.eye(3), frames[pelvis])
    found |= {f"pelvis_t{axis}": places[:, body.joint(pelvis), k] for k, axis in enumerate("xyz")}
    for side in ("r", "l"):
        _add_leg(found, frames, pelvis, side)
    if "chest" in frames and pelvis != "chest":
        _add_turns(found, ("lumbar_extension", "lumbar_bending", "lumbar_rotation"), frames[pelvis], frames["chest"])
    for side in ("r", "l"):
        _add_arm(found, frames, body, places, side)
    return found


def rest_frames(body: Body) -> Mapping[str, F64]:
    """Return the segment axes x, y, z of each joint at rest, as columns (3, 3)."""
    upright = angles.anatomical_axes(body).T
    frames = dict.fromkeys(body.joint_names, upright)
    for side in ("l", "r"):
        for start, end in pairwise(f"{joint}_{side}" for joint in LEG):
            if {start, end} <= set(body.joint_names):
                frames[start] = _axes_along(_vector(body, end, start), upright[:, 2])
        arm = [f"{joint}_{side}" for joint in ARM]
        if set(arm) <= set(body.joint_names):
            frames[arm[0]] = _axes_along(_vector(body, arm[1], arm[0]), _hinge(body, arm, upright))
    return frames


def turns_about_z_x_y(rotation: F64) -> F64:
    """Return the angles (..., 3) rad of R = Rz(a) Rx(b) Ry(c)."""
    flexion = np.arctan2(-rotation[..., 0, 1], rotation[..., 1, 1])
    tilt = np.arcsin(np.clip(rotation[..., 2, 1], -1, 1))
    return np.stack([flexion, tilt, np.arctan2(-rotation[..., 2, 0], rotation[..., 2, 2])], axis=-1)


def _add_turns(found: dict[str, F64], names: tuple[str, ...], parent: F64, child: F64, mirror: float = 1.0) -> None:
    turns = np.degrees(np.unwrap(turns_about_z_x_y(np.swapaxes(parent, -1, -2) @ child), axis=0))
    for name, sign, turn in zip(names, (1.0, mirror, mirror), turns.T, strict=True):
        found[name] = sign * turn


def _add_leg(found: dict[str, F64], frames: Mapping[str, F64], pelvis: str, side: str) -> None:
    mirror = 1.0 if side == "r" else -1.0
    hip, knee, ankle = (f"{joint}_{side}" for joint in LEG)
    if not {hip, knee} <= set(frames):
        return
    names = (f"hip_flexion_{side}", f"hip_adduction_{side}", f"hip_rotation_{side}")
    _add_turns(found, names, frames[pelvis], frames[hip], mirror)
    if ankle in frames:
        flexion = turns_about_z_x_y(np.swapaxes(frames[hip], -1, -2) @ frames[knee])[:, 0]
        found[f"knee_angle_{side}"] = -np.degrees(np.unwrap(flexion))
        dorsiflexion = turns_about_z_x_y(np.swapaxes(frames[knee], -1, -2) @ frames[ankle])[:, 0]
        found[f"ankle_angle_{side}"] = np.degrees(np.unwrap(dorsiflexion))


def _add_arm(found: dict[str, F64], frames: Mapping[str, F64], body: Body, places: F64, side: str) -> None:
    arm = [f"{joint}_{side}" for joint in ARM]
    if not set(arm) <= set(frames):
        return
    # a clavicle is none of OpenSim's, and its turn is the arm's; an arm alone hangs on nothing
    chest = "chest" if "chest" in frames else body.joint_names[max(int(body.parents[body.joint(arm[0])]), 0)]
    names = (f"arm_flex_{side}", f"arm_add_{side}", f"arm_rot_{side}")
    _add_turns(found, names, frames[chest], frames[arm[0]], 1.0 if side == "r" else -1.0)
    found[f"elbow_flex_{side}"] = angles.three_point(places[:, [body.joint(name) for name in arm]])


def _vector(body: Body, start: str, end: str) -> F64:
    way: F64 = body.positions[body.joint(end)] - body.positions[body.joint(start)]
    return way


def _hinge(body: Body, arm: list[str], upright: F64) -> F64:
    """Return the axis about which an elbow bends, pointing right where the arm hangs."""
    upper, lower = _vector(body, arm[0], arm[1]), _vector(body, arm[1], arm[2])
    hinge = np.cross(upper, lower)
    if np.linalg.norm(hinge) > np.sin(BENT) * np.linalg.norm(upper) * np.linalg.norm(lower):
        return hinge
    return np.cross(upright[:, 0], -upper)


def _axes_along(up: F64, right: F64) -> F64:
    """Return axes (3, 3) as columns with y along `up` and z as near to `right` as that allows."""
    y = up / np.linalg.norm(up)
    z = right - (right @ y) * y
    z /= np.linalg.norm(z)
    return np.column_stack([np.cross(y, z), y, z])
