"""Analytic bodies to drape on, and strands to drape: plane, edge, cylinder, legs of capsules."""

from __future__ import annotations

from functools import cache
from weakref import WeakKeyDictionary

import numpy as np
from mocapflow_draping.directions import wind_turns
from mocapflow_draping.distance import body_distance
from mocapflow_draping.fields import build_fields
from mocapflow_draping.kinematic import Kinematic
from mocapflow_draping.parts import posed_parts
from mocapflow_draping.strands import strands_of
from mocapflow_draping.swing import fall_batch
from mocapflow_draping.winds import wind_batch
from mocapflow_garments.skirt import Skirt

from mocapflow.assets import Body
from mocapflow.data import PoseBatch
from mocapflow.geometry import kinematics, twists
from mocapflow.scene import Scene

SKIN = 0.004
VOXEL = 0.005
FIELDS: WeakKeyDictionary = WeakKeyDictionary()  # bodies do not change
EYE = np.eye(4)[None, None]
SKIRT = dict(waist_height_m=1.08, waist_circumference_m=0.92, hem_circumference_m=1.7, length_m=0.6)
DRAPER = Kinematic(skin_m=SKIN, voxel_m=VOXEL)


def rigid(vertices, faces):
    """Return a body of one joint."""
    count = len(vertices)
    weight = np.zeros((count, 5))
    weight[:, 0] = 1
    return Body(
        vertices=vertices, faces=faces.astype(np.int32), joint_names=("root",), parents=np.array([-1], np.int32),
        positions=np.zeros((1, 3)), screw_names=(), twists=np.empty((0, 6)), screw_joint=np.empty(0, np.int32),
        limits=np.empty((0, 2)), rest_spread=np.empty(0), skin_joint=np.zeros((count, 5), np.int32),
        skin_weight=weight, cut=np.zeros(count, bool),
    )  # fmt: skip


def box(low, high):
    """Return a box."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([[f[0], f[k], f[k + 1]] for f in faces for k in (1, 2)])
    return rigid(np.asarray(low) + corners * (np.asarray(high) - np.asarray(low)), triangles)


def together(*bodies):
    """Return several bodies of one joint as one."""
    starts = np.cumsum([0, *(len(body.vertices) for body in bodies)])[:-1]
    faces = [body.faces + start for body, start in zip(bodies, starts, strict=True)]
    return rigid(np.concatenate([body.vertices for body in bodies]), np.concatenate(faces))


def tube(points, radii, around=48):
    """Return vertices and faces of a closed tube along z with hemispheres as rings; `points` are heights."""
    turn = 2 * np.pi * np.arange(around) / around
    rings = np.stack([np.outer(radii, np.cos(turn)), np.outer(radii, np.sin(turn))], -1)
    height = np.broadcast_to(np.asarray(points)[:, None, None], (*rings.shape[:2], 1))
    vertices = np.concatenate([rings, height], -1).reshape(-1, 3)
    grid = np.arange(len(vertices)).reshape(len(points), around)
    a, b = grid[:-1], np.roll(grid[:-1], -1, 1)
    c, d = np.roll(grid[1:], -1, 1), grid[1:]
    sides = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    low, high = len(vertices), len(vertices) + 1
    caps = [np.stack([np.full(around, low), np.roll(grid[0], -1), grid[0]], -1),
            np.stack([np.full(around, high), grid[-1], np.roll(grid[-1], -1)], -1)]  # fmt: skip
    ends = np.array([[0, 0, points[0]], [0, 0, points[-1]]], float)
    return np.concatenate([vertices, ends]), np.concatenate([sides, *caps])


@cache
def lying_cylinder(radius, half_length=0.15):
    """Return a cylinder along y through the origin."""
    vertices, faces = tube(np.linspace(-half_length, half_length, 13), np.full(13, radius), 180)
    return rigid(vertices @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float).T, faces)


@cache
def ball(radius, rings=90):
    """Return a ball about the origin."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)[1:-1]
    vertices, faces = tube(radius * np.sin(angle), radius * np.cos(angle), 2 * rings)
    vertices[-2:] = [[0, 0, -radius], [0, 0, radius]]
    return rigid(vertices, faces)


def capsule(top, bottom, radius):
    """Return a capsule between two heights."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 9)[1:-1]
    low, high = bottom + radius * np.sin(angle[angle <= 0]), top + radius * np.sin(angle[angle >= 0])
    middle = np.linspace(bottom, top, 12)[1:-1]
    height = np.concatenate([low, middle, high])
    radii = np.concatenate(
        [radius * np.cos(angle[angle <= 0]), np.full(10, radius), radius * np.cos(angle[angle >= 0])]
    )
    return tube(height, radii, 32)


@cache
def legs():
    """Return a pelvis with two legs of two capsules each; hips and knees flex. Faces -y, left is +x."""
    joints = ("pelvis", "hip_l", "knee_l", "hip_r", "knee_r")
    places = np.array([[0, 0, 1.0], [0.1, 0, 0.9], [0.1, 0, 0.48], [-0.1, 0, 0.9], [-0.1, 0, 0.48]])
    pelvis = capsule(1.1, 0.95, 0.16)
    pelvis[0][:, 1] *= 0.75
    parts = [(pelvis, 0)]
    for joint, bottom, radius in ((1, 0.48, 0.08), (2, 0.08, 0.055), (3, 0.48, 0.08), (4, 0.08, 0.055)):
        vertices, faces = capsule(places[joint, 2], bottom, radius)
        parts.append(((vertices + [places[joint, 0], 0, 0], faces), joint))
    starts = np.cumsum([0, *(len(part[0][0]) for part in parts)])
    owner = np.concatenate([np.full(len(part[0]), joint) for part, joint in parts])
    axes = np.array([[-1.0, 0, 0], [1.0, 0, 0], [-1.0, 0, 0], [1.0, 0, 0]])
    one = rigid(np.concatenate([p[0][0] for p in parts]),
                np.concatenate([p[0][1] + start for p, start in zip(parts, starts, strict=False)]))  # fmt: skip
    return Body(
        vertices=one.vertices, faces=one.faces, joint_names=joints, parents=np.array([-1, 0, 1, 0, 3], np.int32),
        positions=places, screw_names=tuple(f"{name}.flexion" for name in joints[1:]),
        twists=twists.screw(axes, places[1:]), screw_joint=np.arange(1, 5, dtype=np.int32),
        limits=np.tile([-0.9, 2.8], (4, 1)), rest_spread=np.full(4, np.inf),
        skin_joint=np.tile(owner[:, None], (1, 5)).astype(np.int32), skin_weight=one.skin_weight, cut=one.cut,
    )  # fmt: skip


@cache
def skirted():
    """Return a skirt on legs of capsules."""
    return Scene(cameras=(), body=legs(), garment=Skirt(**SKIRT).sew(legs()))


def draper(**settings):
    """Return a kinematic draper; all of them share what they have measured of a garment."""
    return DRAPER.model_copy(update=settings)


def leg_poses():
    """Return standing, a knee raised, a knee bend and a stride."""
    angles = np.radians([[0, 0, 0, 0], [57, 60, 0, 0], [40, 70, 40, 70], [30, 40, -10, 20]])
    return PoseBatch(root=np.tile(np.eye(4), (4, 1, 1)), angles=angles)


def deep_poses():
    """Return one knee pulled up, one far up, and two squats."""
    angles = np.radians([[75, 60, 0, 0], [90, 90, 0, 0], [110, 110, 0, 0], [75, 90, 75, 90], [95, 110, 95, 110]])
    return PoseBatch(root=np.tile(np.eye(4), (len(angles), 1, 1)), angles=angles)


def prepared(body, chain=EYE, voxel=VOXEL):
    """Return the voxels of a body and its parts."""
    known = FIELDS.setdefault(body, {})
    if voxel not in known:
        known[voxel] = build_fields(body, np.arange(len(body.parents), dtype=np.int32), voxel)
    fields = known[voxel]
    return fields.values, posed_parts(fields, np.broadcast_to(chain, (len(chain), len(body.parents), 4, 4)).copy())


def swing(body, roots, facing, count, link, start=90.0, tilts=(0.0,), voxel=VOXEL):
    """Drape strands (N) on a resting body, tilted outwards; return (B, N, L, 3) m and the last supported rows (B, N).

    Tilts (B,) are in degrees.
    """
    values, parts = prepared(body, voxel=voxel)
    shape, many = (1, len(roots), count), len(tilts)
    fallen, lying = np.empty((*shape, 3)), np.empty(shape, np.int32)
    links, last = np.full((1, len(roots), count - 1), link), np.full(len(roots), count - 1, np.int32)
    facing = np.broadcast_to(np.asarray(facing, float), (1, len(roots), 3)).copy()
    fall_batch(np.asarray(roots, float)[None], facing, np.radians(start), np.array([SKIN]), links, 0 * last, last,
               parts, values, fallen, lying)  # fmt: skip
    grid, held = np.empty((many, *shape[1:], 3)), np.empty((many, *shape[1:]), np.int32)
    out = np.tile(np.radians(tilts)[:, None], (1, len(roots)))
    wind_batch(np.zeros(many, np.int32), *wind_turns(facing[[0] * many], out, 0 * out), np.array([SKIN]), links,
               supported(lying), last, parts, values, fallen, lying, grid, held)  # fmt: skip
    return grid, supported(held)


def supported(held):
    """Return the last row that is held, the first where none is."""
    return np.where(held > 0, np.arange(held.shape[-1], dtype=np.int32), np.int32(0)).max(axis=-1)


def distances(body, points, poses=None, voxel=VOXEL):
    """Return the distance of points (B, N, 3) to the body at poses."""
    chain = EYE if poses is None else kinematics.chain_batch(body, poses)
    values, parts = prepared(body, chain, voxel)
    out = np.empty(points.shape[:2])
    for row, cloud in enumerate(points):
        out[row] = [body_distance(*point, 0, parts[row], values)[0] for point in cloud]
    return out


def check_whole_and_outside(scene, draped, poses, take_up=0.0):
    """Strands keep the length left to them, and no free particle (B, N, 3) is nearer to the body than the skin."""
    strands = strands_of(scene.garment, scene.body)
    lengths = np.linalg.norm(np.diff(draped[:, strands.vertex], axis=2), axis=-1)
    assert np.abs(lengths / ((1 - take_up) * strands.links) - 1).max() < 1e-9
    free = np.setdiff1d(np.arange(draped.shape[1]), scene.garment.pinned)
    assert distances(scene.body, draped[:, free], poses).min() > SKIN - 1e-4
