"""The body as a union of rigid parts, each a voxel distance field at rest that moves with its joints.

A skinned mesh bends where the weights change from one joint to the next; a part half-way between a joint and its
parent, moved by the mean of their transforms, covers most of that bend.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import ConvexHull, QhullError

from mocapflow.assets import Body, GarmentMesh
from mocapflow.geometry.kinematics import descendants
from mocapflow.records import F32, F64, I32, Bool, array, record

SLACK = 0.01  # m around the ball of a part's skin: parts overlap, so it is mostly 6 mm larger (demo bodies: 14 at most)
MARGIN = 0.06  # m around a part in which its field is stored; farther out the distance to its box is used
OVERLAP = 1.5  # voxels by which neighbouring parts overlap
BLOCK = 512  # points measured against all planes of a hull at once: what stays in cache


@record
class BodyFields:
    """P parts of a body: where each field lies in the rest body, and which joints move it."""

    joints: I32 = array("P", 2, unit="joint index: a part moves with the mean of its two joints")
    origin: F32 = array("P", 3, unit="m, centre of the first voxel, at rest")
    shape: I32 = array("P", 3, unit="voxels")
    offset: I32 = array("P", unit="index of the first voxel in values")
    centre: F64 = array("P", 3, unit="m, of a ball around the part, at rest")
    radius: F64 = array("P", unit="m, of that ball")
    values: F32 = array("X", unit="m, signed distance, negative inside")
    voxel: float  # m


def build_fields(body: Body, joints: I32, voxel: float) -> BodyFields:
    """Return the fields of the parts that move with `joints`.

    Args:
        body: the body at rest.
        joints: indices of the joints whose parts are wanted.
        voxel: edge of a voxel in m.
    """
    from mocapflow_draping.voxels import signed_distance

    pairs = _pairs(body, joints)
    label = _labels(body, pairs)
    kept = np.unique(label)
    kept = kept[kept >= 0]
    inside = body.vertices[label >= 0]
    low = inside.min(axis=0) - MARGIN - 4 * voxel
    shape = tuple(int(n) for n in np.ceil((np.ptp(inside, axis=0) + 2 * MARGIN + 8 * voxel) / voxel))
    distance, nearest = signed_distance(body.vertices, body.faces, low, (shape[0], shape[1], shape[2]), voxel)
    voxel_label = label[body.faces[nearest, 0]]
    parts = [_part(distance, voxel_label == part, body.vertices[label == part], low, voxel) for part in kept]
    sizes = [values.size for _, values in parts]
    balls = [_ball(body.vertices[label == part]) for part in kept]
    return BodyFields(
        joints=pairs[kept],
        origin=np.array([origin for origin, _ in parts], np.float32),
        shape=np.array([values.shape for _, values in parts], np.int32),
        offset=np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int32),
        centre=np.array([centre for centre, _ in balls]),
        radius=np.array([radius + SLACK for _, radius in balls]),
        values=np.concatenate([values.ravel() for _, values in parts]).astype(np.float32),
        voxel=voxel,
    )


def touchable_joints(body: Body, garment: GarmentMesh) -> I32:
    """Return the joints whose skin a garment can touch: those with skin within its hull, and their children.

    The hull takes in the joints that carry the garment, up to the root: a flat one, as a cape, has no inside.
    """
    carrying = descendants(body.parents)[:, garment.carried_by].any(axis=1)
    hull = ConvexHull(np.concatenate([garment.vertices, body.positions[carrying]]))
    within = np.all(body.vertices @ hull.equations[:, :3].T + hull.equations[:, 3] < 0.02, axis=1)
    seen = np.zeros(len(body.parents), bool)
    seen[body.main_joint[within]] = True
    child = np.isin(body.parents, np.flatnonzero(seen))
    reach = seen | (child & descendants(body.parents)[garment.carried_by].any(axis=0))
    return np.flatnonzero(reach).astype(np.int32)


def _pairs(body: Body, joints: I32) -> I32:
    """Return (K, 2) joints: each wanted joint with itself and with its parent."""
    own = [(j, j) for j in joints]
    shared = [(body.parents[j], j) for j in joints if body.parents[j] in joints]
    return np.array(own + shared, np.int32)


def _labels(body: Body, pairs: I32) -> I32:
    """Return the part (V,) whose motion is nearest to each vertex's, -1 where it belongs to another joint."""
    count = len(body.parents)
    weights = np.zeros((len(body.vertices), count))
    np.add.at(weights, (np.arange(len(weights))[:, None], body.skin_joint), body.skin_weight)
    wanted = np.zeros((len(pairs), count))
    np.add.at(wanted, (np.arange(len(pairs))[:, None], pairs), 0.5)
    everything = np.concatenate([wanted, np.eye(count)[np.setdiff1d(np.arange(count), pairs)]])
    nearest = ((weights[:, None] - everything) ** 2).sum(axis=2).argmin(axis=1)
    return np.where(nearest < len(pairs), nearest, -1).astype(np.int32)


def _part(distance: F64, mine: Bool, skin: F64, low: F64, voxel: float) -> tuple[F64, F64]:
    """Return origin and field of one part: the body cut to the voxels that are nearest to the part's skin (N, 3).

    It does not reach beyond the hull of that skin: what lies deeper belongs to the neighbours, and would come out
    of the body on the other side where the part turns.
    """
    solid = mine & (distance < 0)
    where = np.argwhere(solid if solid.any() else mine)
    pad = int(np.ceil(MARGIN / voxel + OVERLAP)) + 1
    first = np.maximum(where.min(axis=0) - pad, 0)
    last = np.minimum(where.max(axis=0) + pad + 1, distance.shape)
    crop = tuple(slice(a, b) for a, b in zip(first, last, strict=True))
    own = mine[crop]
    if own.all():
        return low + voxel * first, distance[crop]
    edge = voxel * (distance_transform_edt(~own) - distance_transform_edt(own) - OVERLAP)
    origin = low + voxel * first
    grid = np.stack(np.meshgrid(*[np.arange(n) for n in own.shape], indexing="ij"), axis=-1).reshape(-1, 3)
    beyond = _beyond_hull(skin, origin + voxel * grid) - OVERLAP * voxel
    return origin, np.maximum(np.maximum(distance[crop], edge), beyond.reshape(own.shape))


def _beyond_hull(skin: F64, points: F64) -> F64:
    """Return how far points (M, 3) lie outside the hull of `skin` at least, negative within; -inf for flat skin."""
    try:
        planes = np.unique(ConvexHull(skin).equations.round(6), axis=0)
    except QhullError:
        return np.full(len(points), -np.inf)
    beyond = np.empty(len(points))
    for start in range(0, len(points), BLOCK):
        part = slice(start, start + BLOCK)
        beyond[part] = (points[part] @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    return beyond


def _ball(points: F64) -> tuple[F64, float]:
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre, float(np.linalg.norm(points - centre, axis=1).max())
