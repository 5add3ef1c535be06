"""A garment as a simulator takes it: links that hold it together, particles that are pinned, forces on the others."""

from __future__ import annotations

import numpy as np
from mocapflow_draping.directions import standing_out, wind_turns
from mocapflow_draping.forces import tilts
from mocapflow_draping.strands import Strands, roots

from mocapflow.assets import GarmentMesh
from mocapflow.records import F64, I32, Bool

GRAVITY = 9.81  # m/s^2
SHEAR = 0.0125  # stiffness of a link across the threads, of theirs


def links_of(garment: GarmentMesh) -> tuple[I32, F64, F64]:
    """Return pairs of vertices (K, 2), their rest lengths (K,) m and how stiff they are (K,), 1 for a thread.

    Strands have their length at rest, rings that of the pattern. The other edges of the mesh lie across the threads
    and give way: cloth shears far more easily than it stretches.
    """
    above, below = garment.strands[:, :-1], garment.strands[:, 1:]
    along = np.stack([above, below], axis=-1)[below >= 0]
    edges = garment.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    across = _without(np.unique(np.sort(edges, axis=1), axis=0), np.concatenate([along, garment.rings]))
    pairs = np.concatenate([along, garment.rings, across]).astype(np.int32)
    length = np.linalg.norm(garment.vertices[pairs[:, 0]] - garment.vertices[pairs[:, 1]], axis=1)
    threads = len(pairs) - len(across)
    length[len(along) : threads] = garment.ring_length
    return pairs, length, np.repeat([1.0, SHEAR], [threads, len(across)])


def drawn_in(garment: GarmentMesh, remaining: F64) -> F64:
    """Return the rest lengths (B, K) m of links of which strands keep a share (B,), in the order of `links_of`.

    Folds and gathers take up the rest; rings and what lies across keep theirs.
    """
    threads = int((garment.strands[:, 1:] >= 0).sum())
    lengths: F64 = np.tile(links_of(garment)[1], (len(remaining), 1))
    lengths[:, :threads] *= remaining[:, None]
    return lengths


def _without(edges: I32, known: I32) -> I32:
    """Return the sorted edges that are not among the known ones."""
    size = int(edges.max()) + 1
    low, high = np.sort(known, axis=1).T
    return edges[~np.isin(edges[:, 0].astype(np.int64) * size + edges[:, 1], low.astype(np.int64) * size + high)]


def pull_of(strands: Strands, garment: GarmentMesh, parameters: F64, chain: F64) -> F64:
    """Return the acceleration (B, W, 3) m/s^2 that tilts gravity as the parameters say."""
    _, down, _ = wind_turns(standing_out(strands, chain), *tilts(garment, parameters, strands.azimuth))
    pull = np.zeros((len(chain), len(garment.vertices), 3))
    strand, row = np.nonzero(strands.valid)
    pull[:, strands.vertex[strand, row]] = GRAVITY * (down + [0.0, 0.0, 1.0])[:, strand]
    return pull


def pins_at(strands: Strands, chain: F64) -> F64:
    """Return where the pinned particles are (B, P, 3) m, in the order of the garment's vertices."""
    return roots(strands, chain)[:, np.argsort(strands.vertex[:, 0])]


def pinned_of(strands: Strands, garment: GarmentMesh) -> Bool:
    """Return which particles (W,) hold a strand."""
    pinned = np.zeros(len(garment.vertices), bool)
    pinned[strands.vertex[:, 0]] = True
    return pinned
