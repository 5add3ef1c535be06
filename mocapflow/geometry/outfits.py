"""Several garments worn at once, as one garment: a skirt with two sleeves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mocapflow.assets import Body, GarmentMesh
from mocapflow.geometry.sewing import nearest_skin
from mocapflow.records import I32


def together(name: str, pieces: Sequence[GarmentMesh]) -> GarmentMesh:
    """Return several garments as one whose parameters are named after them: `skirt.take_up`.

    Vertices, faces, strands, links, pins and parameters are those of the pieces, one piece after the other.
    """
    pieces = [garment for piece in pieces for garment in piece.pieces or (piece,)]
    first = np.cumsum([0, *(len(piece.vertices) for piece in pieces)], dtype=np.int32)[:-1]

    def joined(index: str) -> I32:
        return np.concatenate([getattr(piece, index) + start for piece, start in zip(pieces, first, strict=True)])

    rows = max(piece.strands.shape[1] for piece in pieces)
    strands = [_numbered_from(start, piece.strands, rows) for piece, start in zip(pieces, first, strict=True)]
    names = _told_apart([piece.name for piece in pieces])
    return GarmentMesh(
        name=name,
        vertices=np.concatenate([piece.vertices for piece in pieces]),
        faces=joined("faces"),
        strands=np.concatenate(strands),
        rings=joined("rings"),
        ring_length=np.concatenate([piece.ring_length for piece in pieces]),
        carried_by=np.concatenate([piece.carried_by for piece in pieces]),
        pinned=joined("pinned"),
        pinned_to=np.concatenate([piece.pinned_to for piece in pieces]),
        parameter_names=tuple(f"{own}.{p}" for own, piece in zip(names, pieces, strict=True)
                              for p in piece.parameter_names),
        parameter_bounds=np.concatenate([piece.parameter_bounds for piece in pieces]),
        repairs=tuple(f"{own}: {said}" for own, piece in zip(names, pieces, strict=True) for said in piece.repairs),
        pieces=tuple(pieces),
    )  # fmt: skip


def pinned_anew(garment: GarmentMesh, body: Body, other: Body) -> GarmentMesh:
    """Return the garment of a body pinned to the same places of another one that is shaped alike."""
    return replace(
        garment,
        pinned_to=nearest_skin(other, body.vertices[garment.pinned_to]),
        pieces=tuple(pinned_anew(piece, body, other) for piece in garment.pieces),
    )


def _numbered_from(first: int, strands: I32, rows: int) -> I32:
    """Return strands (N, rows) whose vertices count from `first`, padded with -1."""
    padded = np.pad(strands, ((0, 0), (0, rows - strands.shape[1])), constant_values=-1)
    return np.where(padded >= 0, padded + first, padded).astype(np.int32)


def _told_apart(names: Sequence[str]) -> list[str]:
    """Return names with a number behind those that are there more than once."""
    count, seen = Counter(names), Counter[str]()
    told = []
    for name in names:
        seen[name] += 1
        told.append(f"{name}_{seen[name]}" if count[name] > 1 else name)
    return told
