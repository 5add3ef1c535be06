"""Garments for `known_motion.py`: cones about the trunk and the arms of a rest body, and shorts that end in two tubes.

What is sewn has the measured circumferences and lengths wherever the body leaves room; it lies outside of the body.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from known_poses import Body
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

BAND = 0.03  # m, height of a waistband
OFF_SKIN, TIGHT = 0.010, 0.004  # m, between skin and sewn cloth, and under the waistband
TRUNK, THIGH = ("pelvis", "spine", "chest", "hip", "knee"), ("hip", "knee", "pelvis")
ARM = ("shoulder", "elbow", "wrist")
SKIRT_COLUMNS, SKIRT_ROWS = 72, 50
SHORTS_COLUMNS, SHORTS_ROWS, UNDER, LEG_COLUMNS, LEG_ROWS = 76, 17, 11, 50, 24
SLEEVE_COLUMNS, SLEEVE_ROWS = 40, 26


@dataclass(frozen=True)
class Garment:
    """Cloth at rest: vertices (C,3), quads (Q,4), pinned vertices (P), which quads (Q) are of the first stripe."""

    vertices: np.ndarray
    quads: np.ndarray
    pinned: np.ndarray
    stripe: np.ndarray


def measures_for(body: Body, own: dict[str, Any], owner: Body) -> dict[str, Any]:
    """Return tape measures of a garment scaled from its owner to this body; waist and hip keep their ease."""
    scale = body.vertices[:, 2].max() / owner.vertices[:, 2].max()
    result = {k: v if k == "type" else round(float(v * scale), 3) for k, v in own.items()}
    for what, height in (("waist_circumference", own["waist_height"]), ("hip_circumference", owner.joints[1, 2])):
        if what in own:
            ease = own[what] - _length(_outline(owner, height, TRUNK[:4]))
            result[what] = round(_length(_outline(body, height * scale, TRUNK[:4])) + ease, 3)
    return result


def sew(body: Body, measures: dict[str, Any]) -> Garment:
    """Sew a skirt, shorts or a sleeve by their measures; the band at the upper edge is pinned."""
    if measures["type"] == "cylinder":
        return _sleeve(body, measures)
    if measures["type"] == "skirt":
        columns, rows, wide, length = SKIRT_COLUMNS, SKIRT_ROWS, measures["hem_circumference"], measures["length"]
    else:
        columns, rows, wide = SHORTS_COLUMNS, SHORTS_ROWS, measures["hip_circumference"]
        length = measures["length"] - measures["inseam"]
    points = _cone(body, measures, wide, length, columns, rows)
    trunk, quads = len(points), _tube(np.arange(len(points)).reshape(rows, columns))
    if measures["type"] == "shorts":
        points, quads = _with_legs(body, points, quads, measures)
    first = quads.min(1)
    column = np.where(first < trunk, first % columns, (first - trunk - UNDER) % LEG_COLUMNS)
    return Garment(points, quads, np.arange(2 * columns), column % 4 < 2)


def together(pieces: list[Garment]) -> Garment:
    """Return pieces as one cloth, whose vertices and quads are theirs in turn."""
    first = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    return Garment(
        np.concatenate([piece.vertices for piece in pieces]),
        np.concatenate([piece.quads + k for piece, k in zip(pieces, first, strict=False)]),
        np.concatenate([piece.pinned + k for piece, k in zip(pieces, first, strict=False)]),
        np.concatenate([piece.stripe for piece in pieces]),
    )


def _sleeve(body: Body, measures: dict[str, Any]) -> Garment:
    """Sew a straight tube around the upper arm's axis, as if the arm hung down, all of one colour."""
    shoulder, elbow = (body.joint(name + measures["joint"][-2:]) for name in ARM[:2])
    hang, bone = Rotation.align_vectors([[0, 0, -1]], [elbow - shoulder])[0], np.linalg.norm(elbow - shoulder)
    own = (body.vertices[:, 0] * shoulder[0] > 0)[body.faces].all(1)
    hung = replace(body, vertices=hang.apply(body.vertices - shoulder), faces=body.faces[own])
    reach = goal = measures["length"] - BAND
    for _ in range(3):
        rings = _sleeve_rings(hung, measures, -measures["start"] * bone, reach)
        reach *= goal / np.linalg.norm(np.diff(rings[1:], axis=0), axis=2).sum(0).mean()
    quads = _tube(np.arange(SLEEVE_ROWS * SLEEVE_COLUMNS).reshape(SLEEVE_ROWS, SLEEVE_COLUMNS))
    points = hang.inv().apply(np.concatenate(rings)) + shoulder
    return Garment(points, quads, np.arange(2 * SLEEVE_COLUMNS), np.ones(len(quads), bool))


def _sleeve_rings(hung: Body, measures: dict[str, Any], top: float, reach: float) -> list[np.ndarray]:
    """Return rings (N,3) about a hanging arm's axis: a band, then evenly down as far as asked."""
    rings: list[np.ndarray] = []
    ends = [measures["upper_circumference"], measures["lower_circumference"]]
    for down in (0.0, *np.linspace(BAND, BAND + reach, SLEEVE_ROWS - 1)):
        z, shape = top - down, rings[0][:, :2] if len(rings) > 1 else None
        girth = float(np.interp(down, [0, BAND + reach], ends))
        rings.append(_ring(_outline(hung, z, ARM), z, girth, SLEEVE_COLUMNS, shape, np.zeros(2)))
    return rings


def _cone(body: Body, measures: dict[str, Any], wide: float, length: float, columns: int, rows: int) -> np.ndarray:
    """Return points of a cone from the waist down whose columns are as long as asked."""
    step = goal = (length - BAND) / (rows - 2)
    for _ in range(4):
        rings = _rings(body, measures["waist_height"], measures["waist_circumference"], wide, columns, rows, step)
        step *= goal / np.linalg.norm(np.diff(rings[1:], axis=0), axis=2).mean()
    return np.concatenate(rings)


def _rings(body: Body, top: float, waist: float, wide: float, columns: int, rows: int, step: float) -> list[np.ndarray]:
    """Return rings (N,3): a waistband, then rings about a step apart along the cloth."""
    rings = [_ring(_outline(body, z, TRUNK), z, waist, columns) for z in (top, top - BAND)]
    down, shape = step, rings[0][:, :2] - rings[0][:, :2].mean(0)
    for share in np.arange(1, rows - 1) / (rows - 2):
        z = rings[-1][0, 2] - down
        rings.append(_ring(_outline(body, z, TRUNK), z, waist + share * (wide - waist), columns, shape))
        aside = np.linalg.norm(rings[-1][:, :2] - rings[-2][:, :2], axis=1).mean()
        down = np.sqrt(max(0.2 * step**2, step**2 - aside**2))
    return rings


def _ring(
    hull: np.ndarray,
    z: float,
    girth: float,
    count: int,
    shape: np.ndarray | None = None,
    middle: np.ndarray | None = None,
) -> np.ndarray:
    """Return points (N,3) from the front to the left, of a shape (M,2) as long as asked, but outside of the body's."""
    least = _widened(hull, TIGHT if shape is None else OFF_SKIN)
    middle = (hull.max(0) + hull.min(0)) / 2 if middle is None else middle
    shape = least - least.mean(0) if shape is None else shape
    scale = girth / _length(shape)
    for _ in range(8):
        both = np.vstack([middle + scale * shape, least])
        both = both[ConvexHull(both).vertices]
        scale *= girth / _length(both)
    return np.column_stack([_from(both, np.array([0.0, -1.0]), count), np.full(count, z)])


def _with_legs(
    body: Body, points: np.ndarray, quads: np.ndarray, measures: dict[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Add points under the crotch from front to back, and two tubes that hang from them and the lowest ring."""
    ring, half = np.arange(len(points) - SHORTS_COLUMNS, len(points)), SHORTS_COLUMNS // 2
    inner, along = len(points) + np.arange(UNDER), np.linspace(0, 1, UNDER + 2)[1:-1, None]
    front, back = points[ring[0]], points[ring[half]]
    crotch = front + along * (back - front) - [0, 0, 0.02] * np.sin(np.pi * along)
    points = np.vstack([points, crotch])
    for side, upper in ((1, [*ring[: half + 1], *inner[::-1]]), (-1, [*ring[half:], ring[0], *inner])):
        rows = _leg(body, points[upper], side, crotch[:, 2].min(), measures)
        ids = len(points) + np.arange(LEG_ROWS * LEG_COLUMNS).reshape(LEG_ROWS, LEG_COLUMNS)
        points, quads = np.vstack([points, *rows]), np.vstack([quads, _tube(np.vstack([upper, ids]))])
    return points, quads


def _leg(body: Body, start: np.ndarray, side: int, top: float, measures: dict[str, Any]) -> list[np.ndarray]:
    """Return rings (N,3) that go over from the first ring, about half the hips, to rings about the thigh."""
    rows = []
    for k, share in enumerate(np.arange(1, LEG_ROWS + 1) / LEG_ROWS):
        mix, z = min(1.0, (k + 1) / 7), top - share * measures["inseam"]
        thigh = _thigh_ring(body, z, side, measures["leg_opening_circumference"] * (1.2 - 0.2 * share))
        bump = (1 - share) * (1 - mix) * (start[:, 2] - start[:, 2].min())
        rows.append(np.column_stack([(1 - mix) * start[:, :2] + mix * thigh, z + bump]))
    return rows


def _thigh_ring(body: Body, z: float, side: int, girth: float) -> np.ndarray:
    """Return points (N,2) about a thigh, wider outwards only; the middle one under the crotch is the inmost."""
    hull = _widened(_outline(body, z, THIGH, side), OFF_SKIN)
    inmost = hull[np.argmin(side * hull[:, 0])]
    hull = inmost + (hull - inmost) * max(1.0, girth / _length(hull))
    hull[:, 0] = side * np.maximum(side * hull[:, 0], 0.002)
    return np.roll(_from(hull, np.array([-side, 0.0]), LEG_COLUMNS), LEG_COLUMNS - UNDER // 2 - 1, axis=0)


def _outline(body: Body, z: float, parts: tuple[str, ...], side: int = 0) -> np.ndarray:
    """Return the convex outline (200,2), counter-clockwise, of these parts, of one side if asked, at a height."""
    chosen = body.faces[body.main(*parts)[body.faces].all(1)]
    one, other = body.vertices[chosen].reshape(-1, 3), body.vertices[np.roll(chosen, -1, axis=1)].reshape(-1, 3)
    cut = (one[:, 2] > z) != (other[:, 2] > z)
    share = (z - one[cut, 2]) / (other[cut, 2] - one[cut, 2])
    flat = (one[cut] + share[:, None] * (other[cut] - one[cut]))[:, :2]
    flat = flat[side * flat[:, 0] >= 0]
    return _resample(flat[ConvexHull(flat).vertices], 200)


def _from(outline: np.ndarray, way: np.ndarray, count: int) -> np.ndarray:
    """Return points (N,2) evenly along an outline, counter-clockwise from where it lies this way of its middle."""
    fine = _resample(outline, 50 * count)
    off = fine - (fine.max(0) + fine.min(0)) / 2
    return _resample(np.roll(fine, -np.argmax(off @ way / np.linalg.norm(off, axis=1)), axis=0), count)


def _resample(outline: np.ndarray, count: int) -> np.ndarray:
    closed = np.vstack([outline, outline[:1]])
    reached = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    return np.column_stack([np.interp(np.arange(count) / count * reached[-1], reached, x) for x in closed.T])


def _widened(outline: np.ndarray, by: float) -> np.ndarray:
    along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    return outline + by * np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)


def _length(outline: np.ndarray) -> float:
    return float(np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1).sum())


def _tube(ids: np.ndarray) -> np.ndarray:
    """Return quads (Q,4) of rings (R,N) one below the other, facing outwards if rings run counter-clockwise."""
    right = np.roll(ids, -1, axis=1)
    return np.stack([ids[:-1], ids[1:], right[1:], right[:-1]], axis=-1).reshape(-1, 4)
