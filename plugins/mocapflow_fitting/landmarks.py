"""Where the keypoints of a pose estimator lie on a body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.geometry.skeleton import body_directions, skeleton_of, unsided
from mocapflow.records import F64, I32

# Estimators mark what they see, not joint centres. Fixed offsets, from silhouettes and skin markers of real footage:
# shoulders above their centres, as a share of the way from the hips to the neck; hips outside theirs, as a share of
# the distance between them; heel and toes inside the outline, as a share of the foot.
SHOULDER_RAISED, HIP_OUTSIDE = 0.055, 0.12
HEEL_INSIDE, TOE_INSIDE = 0.07, 0.13
# Expected error of a keypoint against its place on the body, m; joints under clothes or muscle are marked less well.
SPREAD_M = {"hip": 0.03, "shoulder": 0.03, "neck": 0.03, "head_top": 0.03, "nose": 0.03, "ear": 0.03}
SPREAD_ELSEWHERE_M = 0.02


class Landmarks(NamedTuple):
    """Named points fixed to a body: `body` has them for vertices, each carried by one joint."""

    names: tuple[str, ...]
    body: Body
    spread: F64  # (L,) m


def landmarks(body: Body) -> Landmarks:
    """Return the keypoints that a body has a place for: joints by name, and points of feet and head off the mesh."""
    skeleton = skeleton_of(body)
    directions = body_directions(skeleton)
    points: dict[str, tuple[int, F64]] = {}
    for joint, name in enumerate(body.joint_names):
        base = unsided(name)
        if base in {"shoulder", "elbow", "wrist", "hip", "knee", "ankle", "neck"}:
            beside = _beside(body, name)
            carrier = max(int(body.parents[joint]), 0) if beside.any() else joint
            points[name] = (carrier, body.positions[joint] + beside)
    for side in "lr":
        points |= _foot(body, directions, side)
    points |= _head(body, directions)
    names = tuple(points)
    spread = [SPREAD_M.get(unsided(name), SPREAD_ELSEWHERE_M) for name in names]
    carriers = np.array([points[name][0] for name in names], np.int32).reshape(-1)
    vertices = np.array([points[name][1] for name in names]).reshape(-1, 3)
    return Landmarks(names, _carrying(body, vertices, carriers), np.array(spread))


def _carrying(body: Body, vertices: F64, carriers: I32) -> Body:
    weight = np.zeros((len(vertices), body.skin_weight.shape[1]))
    weight[:, 0] = 1.0
    return replace(
        body, vertices=vertices, faces=np.empty((0, 3), np.int32),
        morph_offset=None, shape_modes=None, joint_modes=None,
        skin_joint=np.repeat(carriers[:, None], weight.shape[1], axis=1), skin_weight=weight,
        cut=np.zeros(len(vertices), bool),
    )  # fmt: skip


def _beside(body: Body, name: str) -> F64:
    """Return how far (3,) m from its centre a joint is marked; zero where a partial body lacks what tells it."""
    base, _, side = name.rpartition("_")
    if base not in {"hip", "shoulder"} or not {"hip_l", "hip_r"} <= set(body.joint_names):
        return np.zeros(3)
    left, right = (body.positions[body.joint(f"hip_{s}")] for s in "lr")
    if base == "hip":
        return np.asarray(HIP_OUTSIDE * (left - right if side == "l" else right - left))
    if "neck" not in body.joint_names:
        return np.zeros(3)
    return np.asarray(SHOULDER_RAISED * (body.positions[body.joint("neck")] - (left + right) / 2))


def _foot(body: Body, directions: F64, side: str) -> Mapping[str, tuple[int, F64]]:
    """Return heel and toes: the ends of the sole along the foot."""
    forward, left, up = directions
    own = [body.joint(n) for n in (f"ankle_{side}", f"toe_{side}") if n in body.joint_names]
    skin = body.vertices[np.isin(body.main_joint, own)]
    if not own or len(skin) < 10:
        return {}
    foot = skin[skin @ up < body.positions[own[0]] @ up]
    outward = left if side == "l" else -left
    along = foot @ forward
    front = foot[along > np.quantile(along, 0.7)]
    middle = np.median(front @ outward)
    inner, outer = front[front @ outward < middle], front[front @ outward >= middle]
    tip, small = inner[np.argmax(inner @ forward)], outer[np.argmax(outer @ (forward + outward))]
    heel = foot[along <= np.quantile(along, 0.03)].mean(axis=0)
    length = np.ptp(along) * forward
    tip, small, heel = tip - TOE_INSIDE * length, small - TOE_INSIDE * length, heel + HEEL_INSIDE * length
    return {f"big_toe_{side}": (own[-1], tip), f"small_toe_{side}": (own[-1], small), f"heel_{side}": (own[0], heel)}


def _head(body: Body, directions: F64) -> Mapping[str, tuple[int, F64]]:
    """Return nose, ears and top: the ends of the head forwards, to both sides and upwards."""
    forward, left, up = directions
    if "head" not in body.joint_names:
        return {}
    joint = body.joint("head")
    skin = body.vertices[body.main_joint == joint]
    skin = skin[skin @ up > body.positions[joint] @ up] if len(skin) else skin
    if len(skin) < 10:
        return {}
    ends = {"nose": forward, "ear_l": left, "ear_r": -left, "head_top": up}
    return {name: (joint, skin[np.argmax(skin @ towards)]) for name, towards in ends.items()}
