"""What the kinematic draper needs to know of a garment on a body: computed once, from the rest pose."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mocapflow.assets import Body, GarmentMesh
from mocapflow.errors import PluginError
from mocapflow.records import F64, I32, Bool, array, record

DOUBLINGS = 3  # of the way between particles that are kept from parting


@record
class Strands:
    """N strands over L rows; what carries their upper ends, and the links around them.

    Ring links join particles of one row, so a strand that begins at a seam has its first particle in the row of
    that seam; rows without a particle repeat the nearest one of the strand.
    """

    vertex: I32 = array("N", "L", unit="cloth vertex")
    first: I32 = array("N", unit="row of the pinned particle")
    last: I32 = array("N", unit="row of the last particle")
    links: F64 = array("N", "K", unit="m, lengths of the K = L - 1 bars")
    rest: F64 = array("N", "L", 3, unit="m, particles at rest")
    root_joint: I32 = array("N", 5, unit="joint index")
    root_weight: F64 = array("N", 5, unit="1")
    facing: F64 = array("N", 3, unit="1, horizontal unit direction in which the strand stands out, at rest")
    azimuth: F64 = array("N", unit="rad, of facing")
    carrier: I32 = array("N", unit="joint that turns the strand before it falls")
    limb: I32 = array("N", unit="joint that moves the skin under the strand, a third of the way down")
    tail: Bool = array("N", "L", unit="True for particles that move with `carrier`")
    skin_joint: I32 = array("N", "L", 5, unit="joint index, of the skin nearest at rest")
    skin_weight: F64 = array("N", "L", 5, unit="1")
    left: I32 = array("N", "L", unit="strand linked on its left-hand side in this row, or -1")
    ring_length: F64 = array("N", "L", unit="m, of that link")
    skinned: bool  # most strands move with the skin under them, as trouser legs do; else they hang free, as skirts do

    @cached_property
    def valid(self) -> Bool:
        """(N, L), True where a strand has a particle of its own."""
        return _valid(self.first, self.last, self.vertex.shape[1])

    @cached_property
    def direction(self) -> F64:
        """(N, 3), the unit direction from each strand's root to its end, at rest."""
        return unit(self.rest[:, -1] - self.rest[:, 0])

    @cached_property
    def particle(self) -> I32:
        """(W,), where each cloth vertex stands among the N x L particles."""
        particle = np.zeros(self.vertex.max() + 1, np.int32)
        particle[self.vertex[self.valid]] = np.flatnonzero(self.valid)
        return particle

    @cached_property
    def spans(self) -> tuple[I32, F64]:
        """Strands (K, N, L) that lie 1, 2, 4, ... links to the left within a row, or -1, and the cloth between in m."""
        across, length = [self.left], [self.ring_length]
        row = np.arange(self.left.shape[1])
        for _ in range(DOUBLINGS):
            next_one = np.maximum(across[-1], 0)
            across.append(np.where(across[-1] >= 0, across[-1][next_one, row], np.int32(-1)))
            length.append(length[-1] + length[-1][next_one, row])
        return np.stack(across), np.stack(length)


def strands_of(garment: GarmentMesh, body: Body) -> Strands:
    """Return the strands of a garment.

    Raises:
        PluginError: a vertex lies on no strand or on two, a strand begins at no pin or stands out nowhere, a ring
            leaves its row.
    """
    vertex, first, last = _rows(garment)
    rows = garment.vertices[vertex]
    links = np.linalg.norm(np.diff(rows, axis=1), axis=2)
    valid = _valid(first, last, vertex.shape[1])
    skin = _pinned_skin(garment, vertex[:, 0])
    left, ring_length = _left(garment, vertex, valid)
    carrier = garment.carried_by[vertex[:, -1]]
    under = np.asarray(cKDTree(body.vertices).query(rows)[1], np.int32)
    skinned = bool(np.mean(_limbs(body.parents)[carrier, body.main_joint[under[:, -1]]]) > 0.5)
    facing = _from_middle(rows, left) if skinned else _along(garment.name, rows)
    return Strands(
        vertex=vertex,
        first=first,
        last=last,
        links=links,
        rest=rows,
        root_joint=body.skin_joint[skin],
        root_weight=body.skin_weight[skin],
        facing=facing,
        azimuth=np.arctan2(facing[:, 1], facing[:, 0]),
        carrier=carrier,
        limb=body.main_joint[under[:, vertex.shape[1] // 3]],
        skinned=skinned,
        tail=garment.carried_by[vertex] == carrier[:, None],
        skin_joint=body.skin_joint[under],
        skin_weight=body.skin_weight[under],
        left=left,
        ring_length=ring_length,
    )


def _rows(garment: GarmentMesh) -> tuple[I32, I32, I32]:
    """Return vertices by strand and row (N, L), and each strand's first and last row (N,)."""
    used = garment.strands >= 0
    counts = used.sum(axis=1)
    often = np.bincount(garment.strands[used], minlength=len(garment.vertices))
    if (often != 1).any():
        odd = int((often != 1).argmax())
        raise PluginError(
            f"garment {garment.name}: vertex {odd} lies on {often[odd]} strands",
            hint="every vertex lies on one strand: strands alone are draped",
        )
    strand, place = np.full((2, len(garment.vertices)), -1)
    strand[garment.strands[used]], place[garment.strands[used]] = np.nonzero(used)
    a, b = garment.rings.T
    first = _levels(strand[a], strand[b], place[a] - place[b], len(counts))
    bad = np.flatnonzero(first[strand[a]] + place[a] != first[strand[b]] + place[b])
    if len(bad):
        raise PluginError(
            f"garment {garment.name}: ring link {bad[0]} joins vertices {a[bad[0]]} and {b[bad[0]]} of two rows",
            hint="a ring link joins two strands at the same row",
        )
    last = first + counts - 1
    at = np.clip(np.arange(last.max() + 1) - first[:, None], 0, counts[:, None] - 1)
    vertex = np.take_along_axis(garment.strands, at, axis=1)
    return vertex.astype(np.int32), first.astype(np.int32), last.astype(np.int32)


def _levels(a: I32, b: I32, step: I32, count: int) -> I32:
    """Return first[...] of `count` strands such that first[b] - first[a] = step for linked strands."""
    level, known = np.zeros(count, np.int32), np.zeros(count, bool)
    for root in range(count):
        before = known.copy()
        known[root] = True
        while True:
            ahead, behind = known[a] & ~known[b], known[b] & ~known[a]
            if not ahead.any() and not behind.any():
                break
            level[b[ahead]], known[b[ahead]] = (level[a] + step)[ahead], True
            level[a[behind]], known[a[behind]] = (level[b] - step)[behind], True
        new = known & ~before
        level[new] -= level[new].min(initial=0)
    return level


def _valid(first: I32, last: I32, rows: int) -> Bool:
    row = np.arange(rows)
    return (row >= first[:, None]) & (row <= last[:, None])


def _pinned_skin(garment: GarmentMesh, roots: I32) -> I32:
    pin = {int(v): int(skin) for v, skin in zip(garment.pinned, garment.pinned_to, strict=True)}
    loose = [int(v) for v in roots if int(v) not in pin]
    if loose:
        raise PluginError(
            f"garment {garment.name}: the strand of vertex {loose[0]} hangs from nothing",
            hint="the first vertex of every strand must be in `pinned`",
        )
    return np.array([pin[int(v)] for v in roots], np.int32)


def unit(vectors: F64) -> F64:
    """Return vectors (..., 3) at length one; those without length stay as they are."""
    scaled: F64 = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    return scaled


def carried(strands: Strands, chain: F64) -> F64:
    """Return all particles (B, N, L, 3) m moved with the skin nearest to them, at posed joints (B, J, 4, 4)."""
    moved = np.einsum("nlk,bnlkij->bnlij", strands.skin_weight, chain[:, strands.skin_joint, :3])
    rest: F64 = np.einsum("bnlij,nlj->bnli", moved[..., :3], strands.rest) + moved[..., 3]
    return rest


def roots(strands: Strands, chain: F64) -> F64:
    """Return where strands are pinned (B, N, 3) m, at posed joints (B, J, 4, 4)."""
    held = np.einsum("nk,bnkij->bnij", strands.root_weight, chain[:, strands.root_joint, :3])
    pinned: F64 = np.einsum("bnij,nj->bni", held[..., :3], strands.rest[:, 0]) + held[..., 3]
    return pinned


def _limbs(parents: I32) -> Bool:
    """Return (J, J), True where the second joint is the first or follows it and no branch lies between."""
    limb = np.eye(len(parents), dtype=bool)
    for joint in range(1, len(parents)):  # parents come first
        if np.count_nonzero(parents == parents[joint]) == 1:
            limb[:, joint] |= limb[:, parents[joint]]
    return limb


def _along(garment: str, rows: F64) -> F64:
    """Return the horizontal directions (N, 3) in which strands stand out, or of their roots where they do not."""
    out = (rows[:, -1] - rows[:, 0]) * [1.0, 1.0, 0.0]
    straight = np.linalg.norm(out, axis=1) < 1e-6 * np.ptp(rows[..., 2])
    out = np.where(straight[:, None], (rows[:, 0] - rows[:, 0].mean(axis=0)) * [1.0, 1.0, 0.0], out)
    far = np.linalg.norm(out, axis=1, keepdims=True)
    if (far < 1e-9).any():
        raise PluginError(
            f"garment {garment}: strand {far.argmin()} hangs straight down, from the middle of all",
            hint="let it stand off the body at rest: the way in which it does is the way from which it falls",
        )
    along: F64 = out / far
    return along


def _from_middle(rows: F64, left: I32) -> F64:
    """Return the horizontal directions (N, 3) from the middle of each strand's last ring."""
    count = len(rows)
    linked = left[:, -1] >= 0
    graph = coo_matrix((np.ones(linked.sum()), (np.flatnonzero(linked), left[linked, -1])), shape=(count, count))
    _, ring = connected_components(graph, directed=False)
    middle = np.stack([np.bincount(ring, rows[:, -1, a]) / np.bincount(ring) for a in range(3)], axis=1)
    return unit((rows[:, -1] - middle[ring]) * [1.0, 1.0, 0.0])


def _left(garment: GarmentMesh, vertex: I32, valid: Bool) -> tuple[I32, F64]:
    """Return for each particle the strand it is linked to within its row, and the length of that link."""
    strand, row = np.full((2, len(garment.vertices)), -1)
    strand[vertex[valid]], row[vertex[valid]] = np.nonzero(valid)
    a, b = garment.rings.T
    left, length = np.full(vertex.shape, -1, np.int32), np.zeros(vertex.shape)
    left[strand[a], row[a]] = strand[b]
    length[strand[a], row[a]] = garment.ring_length
    return left, length
