"""The direction in which each strand comes to hang, and the one in which it stands before it falls."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64
from mocapflow_draping.strands import Strands, carried, roots

DOWN = np.array([0.0, 0.0, -1.0])


def hanging(strands: Strands, chain: F64, out: F64, aside: F64) -> tuple[F64, F64]:
    """Return `facing` and `down` (B, N, 3), perpendicular unit directions, of strands that hang by gravity.

    Args:
        strands: the garment's strands.
        chain: (B, J, 4, 4) posed joints.
        out: (B, N) rad, tilt of the tail outwards.
        aside: (B, N) rad, tilt to the left seen from inside the garment.
    """
    facing = np.einsum("bnij,nj->bni", chain[:, strands.carrier, :3, :3], strands.facing)
    facing[..., 2] = 0.0
    facing /= np.maximum(np.linalg.norm(facing, axis=-1, keepdims=True), 1e-9)
    return perpendicular(facing, tilted(np.broadcast_to(DOWN, facing.shape), facing, out, aside))


def tilted(down: F64, facing: F64, out: F64, aside: F64) -> F64:
    """Return unit directions (..., 3): `down` turned towards `facing` by `out` and to its left by `aside` rad.

    Both together are one turn, towards one direction: a wind turns every strand by the same angle.
    """
    left = np.cross(facing, down)
    amount = np.hypot(out, aside)[..., None]
    sideways = out[..., None] * facing + aside[..., None] * left
    turned: F64 = np.cos(amount) * down + np.sinc(amount / np.pi) * sideways
    return turned


def perpendicular(facing: F64, down: F64) -> tuple[F64, F64]:
    """Return `facing` made perpendicular to `down`, and `down`."""
    across = facing - (facing * down).sum(axis=-1, keepdims=True) * down
    return across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9), down


def riding(strands: Strands, chain: F64, out: F64, aside: F64) -> F64:
    """Return strands (B, N, L, 3) m carried along by the skin under them, their tails tilted, lengths kept.

    Args:
        strands: the garment's strands.
        chain: (B, J, 4, 4) posed joints.
        out: (B, N) rad, tilt of the tail away from the middle of its ring.
        aside: (B, N) rad, tilt to the left seen from there.
    """
    moved = carried(strands, chain)
    bars = np.diff(moved, axis=2)
    bars /= np.maximum(np.linalg.norm(bars, axis=-1, keepdims=True), 1e-9)
    facing = np.einsum("bnij,nj->bni", chain[:, strands.carrier, :3, :3], strands.facing)[:, :, None]
    tail = strands.tail[:, 1:]
    bars = tilted(bars, facing, out[:, :, None] * tail, aside[:, :, None] * tail)
    moved[:, :, 1:] = moved[:, :, :1] + np.cumsum(bars * strands.links[..., None], axis=2)
    return moved


def standing(strands: Strands, chain: F64) -> F64:
    """Return strands (B, N, L, 3) m before they fall: level, or where a limb has carried them."""
    still = np.zeros((len(chain), len(strands.facing)))
    if strands.rides:
        return riding(strands, chain, still, still)
    facing, _ = hanging(strands, chain, still, still)
    reach = np.concatenate([np.zeros((len(strands.links), 1)), np.cumsum(strands.links, axis=1)], axis=1)
    grid: F64 = roots(strands, chain)[:, :, None] + reach[..., None] * facing[:, :, None]
    return grid
