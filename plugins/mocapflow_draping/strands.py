"""What the kinematic draper needs to know of a garment on a body: computed once, from the rest pose."""

from __future__ import annotations

import numpy as np

from mocapflow.data import Body, GarmentMesh
from mocapflow.errors import PluginError
from mocapflow.records import F64, I32, array, record


@record
class Strands:
    """N strands of up to L particles, padded; what carries their upper ends, and the links around them."""

    vertex: I32 = array("N", "L", unit="cloth vertex, the last one repeated as padding")
    counts: I32 = array("N", unit="particles")
    links: F64 = array("N", "K", unit="m, lengths of the K = L - 1 bars")
    root: F64 = array("N", 3, unit="m, the pinned end at rest")
    root_joint: I32 = array("N", 5, unit="joint index")
    root_weight: F64 = array("N", 5, unit="1")
    facing: F64 = array("N", 3, unit="1, horizontal unit direction in which the strand stands out, at rest")
    azimuth: F64 = array("N", unit="rad, of facing")
    carrier: I32 = array("N", unit="joint that turns the strand before it falls")
    beside: I32 = array("N", "L", unit="strand linked on its left-hand side in this row, or -1")
    ring_length: F64 = array("N", "L", unit="m, of that link")


def strands_of(garment: GarmentMesh, body: Body) -> Strands:
    """Return the strands of a garment.

    Raises:
        PluginError: a strand does not begin at a pinned vertex or has a link without length.
    """
    used = garment.strands >= 0
    counts = used.sum(axis=1).astype(np.int32)
    vertex = np.where(used, garment.strands, np.take_along_axis(garment.strands, counts[:, None] - 1, axis=1))
    rows = garment.vertices[vertex]
    links = np.linalg.norm(np.diff(rows, axis=1), axis=2)
    if (links[used[:, 1:]] <= 0).any():
        strand = int(np.argwhere((links <= 0) & used[:, 1:])[0, 0])
        raise PluginError(
            f"garment {garment.name}: strand {strand} has a link of zero length",
            hint="each vertex of a strand must lie below the one before it",
        )
    pin = {int(v): int(skin) for v, skin in zip(garment.pinned, garment.pinned_to, strict=True)}
    loose = [int(v) for v in vertex[:, 0] if int(v) not in pin]
    if loose:
        raise PluginError(
            f"garment {garment.name}: the strand of vertex {loose[0]} hangs from nothing",
            hint="the first vertex of every strand must be in `pinned`",
        )
    skin = np.array([pin[int(v)] for v in vertex[:, 0]])
    facing = _facing(rows, counts)
    beside, ring_length = _beside(garment, vertex, used)
    return Strands(
        vertex=vertex.astype(np.int32),
        counts=counts,
        links=links,
        root=rows[:, 0].copy(),
        root_joint=body.skin_joint[skin],
        root_weight=body.skin_weight[skin],
        facing=facing,
        azimuth=np.arctan2(facing[:, 1], facing[:, 0]),
        carrier=garment.carried_by[vertex[:, -1]],
        beside=beside,
        ring_length=ring_length,
    )


def roots_and_facing(strands: Strands, chain: F64) -> tuple[F64, F64]:
    """Return where strands are pinned (B, N, 3) m and where they face (B, N, 2), at posed joints (B, J, 4, 4)."""
    held = np.einsum("nk,bnkij->bnij", strands.root_weight, chain[:, strands.root_joint])
    roots = np.einsum("bnij,nj->bni", held[..., :3, :3], strands.root) + held[..., :3, 3]
    facing = np.einsum("bnij,nj->bni", chain[:, strands.carrier, :3, :3], strands.facing)[..., :2]
    length = np.linalg.norm(facing, axis=-1, keepdims=True)
    return roots, facing / np.maximum(length, 1e-9)


def _facing(rows: F64, counts: I32) -> F64:
    """Return the horizontal directions (N, 3) in which strands stand out: along the cloth, or from its middle."""
    ends = rows[np.arange(len(rows)), counts - 1]
    out = (ends - rows[:, 0]) * [1.0, 1.0, 0.0]
    straight = np.linalg.norm(out, axis=1) < 1e-6 * np.ptp(rows[..., 2])
    middle = (rows[:, 0] - rows[:, 0].mean(axis=0)) * [1.0, 1.0, 0.0]
    out = np.where(straight[:, None], middle, out)
    facing: F64 = out / np.linalg.norm(out, axis=1, keepdims=True)
    return facing


def _beside(garment: GarmentMesh, vertex: I32, used: np.ndarray) -> tuple[I32, F64]:
    """Return for each particle the strand it is linked to within its row, and the length of that link."""
    strand, row = np.full((2, len(garment.vertices)), -1)
    strand[vertex[used]], row[vertex[used]] = np.nonzero(used)
    a, b = garment.rings.T
    if (row[a] != row[b]).any():
        bad = int(np.flatnonzero(row[a] != row[b])[0])
        raise PluginError(
            f"garment {garment.name}: ring link {bad} joins rows {row[a[bad]]} and {row[b[bad]]}",
            hint="a ring link joins two strands at the same row",
        )
    beside, length = np.full(vertex.shape, -1, np.int32), np.zeros(vertex.shape)
    beside[strand[a], row[a]] = strand[b]
    length[strand[a], row[a]] = garment.ring_length
    return beside, length
