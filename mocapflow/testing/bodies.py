"""Bodies to test with: one of tubes with a tube of cloth, made by formula, and a whole person."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.assets import Body, GarmentMesh
from mocapflow.geometry import twists
from mocapflow.geometry.sewing import grid_faces
from mocapflow.records import F64, I32
from mocapflow.registry import load_registry

JOINTS = ("pelvis", "hip_l", "knee_l", "ankle_l", "hip_r", "knee_r", "ankle_r")
PARENTS = (-1, 0, 1, 2, 0, 4, 5)
POSITIONS = ((0, 0, 0.95), *((side * 0.1, 0, z) for side in (1, -1) for z in (0.86, 0.48, 0.09)))
HIP = (("flexion", (-1, 0, 0), -50, 145), ("abduction", (0, -1, 0), -50, 80), ("rotation", (0, 0, -1), -80, 80))
FREEDOMS = {"hip": HIP, "knee": (("flexion", (1, 0, 0), -8, 160),), "ankle": (("dorsiflexion", (-1, 0, 0), -75, 75),)}


def tiny_body() -> Body:
    """Return a trunk and two legs, about 600 vertices, three closed surfaces; faces -y, its left is +x."""
    trunk = _tube(0.0, np.linspace(0.80, 1.25, 12), 0.13 + 0.03 * np.cos(np.linspace(-1.6, 4.7, 12)), 16)
    legs = [_tube(x, np.linspace(0.02, 0.88, 16), np.linspace(0.045, 0.085, 16), 12) for x in (0.1, -0.1)]
    vertices = np.concatenate([trunk[0], *(leg[0] for leg in legs)])
    starts = np.cumsum([0, len(trunk[0]), len(legs[0][0])])
    faces = np.concatenate([part[1] + start for part, start in zip([trunk, *legs], starts, strict=True)])
    skin = [_hang(trunk[0], 0), *(_hang(leg[0], hip) for leg, hip in zip(legs, (1, 4), strict=True))]
    names, axes, owners, limits = _freedoms()
    positions = np.array(POSITIONS, np.float64)
    return Body(
        vertices=vertices,
        faces=faces.astype(np.int32),
        joint_names=JOINTS,
        parents=np.array(PARENTS, np.int32),
        positions=positions,
        screw_names=names,
        twists=twists.screw(axes, positions[owners]),
        screw_joint=owners,
        limits=limits,
        rest_spread=np.full(len(names), np.inf),
        skin_joint=np.concatenate([joint for joint, _ in skin]),
        skin_weight=np.concatenate([weight for _, weight in skin]),
        cut=np.zeros(len(vertices), bool),
    )


def template_body() -> Body:
    """Return the whole person of the body `template`, about 13,000 vertices: for what needs arms or a head."""
    template: Body = load_registry().get("body", "template")().load(Path())  # type: ignore[attr-defined]
    return template


def tiny_garment(body: Body) -> GarmentMesh:
    """Return a tube of cloth that hangs from the waist of the tiny body to the knees."""
    strands, rows = 16, 8
    turn = 2 * np.pi * np.arange(strands) / strands
    radius, height = np.linspace(0.17, 0.24, rows), np.linspace(1.05, 0.55, rows)
    flat = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    vertices = _rings(flat, radius, height)
    index = np.arange(rows * strands, dtype=np.int32).reshape(rows, strands)
    rings = np.stack([index, np.roll(index, -1, axis=1)], axis=-1).reshape(-1, 2)
    waist = np.linalg.norm(body.vertices[None] - vertices[:strands, None], axis=2).argmin(axis=1)
    return GarmentMesh(
        name="tube",
        vertices=vertices,
        faces=grid_faces(index.T),
        strands=np.ascontiguousarray(index.T),
        rings=rings,
        ring_length=np.linalg.norm(vertices[rings[:, 0]] - vertices[rings[:, 1]], axis=1),
        carried_by=np.zeros(rows * strands, np.int32),
        pinned=index[0].copy(),
        pinned_to=waist.astype(np.int32),
        parameter_names=("thickness_m", "wind_cos_rad", "wind_sin_rad"),
        parameter_bounds=np.array([[0.0, 0.01], [-0.7, 0.7], [-0.7, 0.7]]),
    )


def _rings(flat: F64, radius: F64, height: F64) -> F64:
    around = radius[:, None, None] * flat
    level = np.broadcast_to(height[:, None, None], (*around.shape[:2], 1))
    return np.concatenate([around, level], axis=2).reshape(-1, 3)


def _tube(x: float, height: F64, radius: F64, around: int) -> tuple[F64, I32]:
    """Return a closed upright tube about (x, 0): rings from below, then the two caps."""
    turn = 2 * np.pi * np.arange(around) / around
    rings = _rings(np.stack([np.cos(turn), np.sin(turn)], axis=1), radius, height) + [x, 0, 0]
    ends = np.array([[x, 0, height[0]], [x, 0, height[-1]]])
    low, high = len(rings), len(rings) + 1
    here = np.arange(around)
    ahead, top = np.roll(here, -1), low - around
    sides = grid_faces(np.arange(low, dtype=np.int32).reshape(-1, around).T)[:, ::-1]
    bottom = np.stack([np.full(around, low), ahead, here], axis=1)
    lid = np.stack([np.full(around, high), top + here, top + ahead], axis=1)
    return np.concatenate([rings, ends]), np.concatenate([sides, bottom, lid]).astype(np.int32)


def _hang(vertices: F64, hip: int) -> tuple[I32, F64]:
    """Return skin joints and weights (V, 5): the trunk on the pelvis, a leg blended at knee and ankle."""
    joints, weights = np.zeros((len(vertices), 5), np.int32), np.zeros((len(vertices), 5))
    weights[:, 0] = 1.0
    if hip:
        thigh, foot = (np.clip(0.5 + (vertices[:, 2] - z) / 0.1, 0, 1) for z in (0.48, 0.09))
        joints[:, :3] = [hip, hip + 1, hip + 2]
        weights[:, :3] = np.stack([thigh, (1 - thigh) * foot, (1 - thigh) * (1 - foot)], axis=1)
    return joints, weights


def _freedoms() -> tuple[tuple[str, ...], F64, I32, F64]:
    rows = [(f"{joint}.{row[0]}", index, *row[1:]) for index, joint in enumerate(JOINTS)
            for row in FREEDOMS.get(joint[:-2], ())]  # fmt: skip
    names = tuple(row[0] for row in rows)
    owners = np.array([row[1] for row in rows], np.int32)
    return names, np.array([row[2] for row in rows], np.float64), owners, np.radians([row[3:] for row in rows])
