"""The directions in which strands stand before they fall and to which winds turn them, and skinned strands."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64
from mocapflow_draping.strands import Strands, carried, roots, unit

DOWN = np.array([0.0, 0.0, -1.0])


def standing_out(strands: Strands, chain: F64) -> F64:
    """Return the horizontal unit directions (B, N, 3) in which strands stand out, at posed joints (B, J, 4, 4).

    Where the trunk leans so far over that a strand would face up, it lies along the trunk instead, towards the legs.
    """
    turned = chain[:, strands.carrier, :3, :3]
    facing = np.einsum("bnij,nj->bni", turned, strands.facing)
    facing -= np.maximum(facing[..., 2:], 0.0) * turned[..., 2]
    facing[..., 2] = 0.0
    return unit(facing)


def along_limbs(strands: Strands, chain: F64) -> F64:
    """Return the unit directions (B, N, 3) of strands that move with the limb under them, at joints (B, J, 4, 4)."""
    # in the order that one alone has: kernels are compiled anew for every layout
    along: F64 = np.einsum("bnij,nj->bni", chain[:, strands.limb, :3, :3], strands.direction, order="C")
    return along


def wind_turns(facing: F64, out: F64, aside: F64) -> tuple[F64, F64, F64]:
    """Return how hanging tails are turned: the plane of each turn, two unit directions (B, N, 3), and its angle.

    Args:
        facing: (B, N, 3) horizontal unit directions in which strands stand out.
        out: (B, N) rad, tilt of the tail outwards.
        aside: (B, N) rad, tilt to the left seen from inside the garment.

    Returns:
        back, towards, amount: a tail that hangs straight down stands `amount` (B, N) rad from `towards`, on the side of
        `back`, which is perpendicular to it.
    """
    left = np.stack([-facing[..., 1], facing[..., 0], np.zeros_like(out)], axis=-1)
    amount = np.hypot(out, aside)
    still = amount == 0.0
    whole = np.where(still, 1.0, amount)
    level = (np.where(still, 1.0, out) / whole)[..., None] * facing + (aside / whole)[..., None] * left
    sine, cosine = np.sin(amount)[..., None], np.cos(amount)[..., None]
    return sine * DOWN - cosine * level, cosine * DOWN + sine * level, amount


def tilted(down: F64, facing: F64, out: F64, aside: F64) -> F64:
    """Return unit directions (..., 3): `down` turned towards `facing` by `out` and to its left by `aside` rad.

    Both together are one turn, towards one direction: a wind turns every strand by the same angle.
    """
    left = np.cross(facing, down)
    amount = np.hypot(out, aside)[..., None]
    sideways = out[..., None] * facing + aside[..., None] * left
    return np.cos(amount) * down + np.sinc(amount / np.pi) * sideways


def skinned_strands(strands: Strands, chain: F64, links: F64, out: F64, aside: F64) -> F64:
    """Return strands (B, N, L, 3) m carried along by the skin under them, their tails tilted, lengths kept.

    Args:
        strands: the garment's strands.
        chain: (B, J, 4, 4) posed joints.
        links: (B, N, L - 1) m, lengths of the bars.
        out: (B, N) rad, tilt of the tail away from the middle of its ring.
        aside: (B, N) rad, tilt to the left seen from there.
    """
    moved = carried(strands, chain)
    bars = unit(np.diff(moved, axis=2))
    facing = np.einsum("bnij,nj->bni", chain[:, strands.carrier, :3, :3], strands.facing)[:, :, None]
    tail = strands.tail[:, 1:]
    bars = tilted(bars, facing, out[:, :, None] * tail, aside[:, :, None] * tail)
    moved[:, :, 1:] = moved[:, :, :1] + np.cumsum(bars * links[..., None], axis=2)
    return moved


def standing(strands: Strands, chain: F64, links: F64) -> F64:
    """Return strands (B, N, L, 3) m before they fall: level, or where a limb has carried them."""
    if strands.skinned:
        still = np.zeros((len(chain), len(strands.facing)))
        return skinned_strands(strands, chain, links, still, still)
    reach = np.concatenate([np.zeros((*links.shape[:2], 1)), np.cumsum(links, axis=2)], axis=2)
    return roots(strands, chain)[:, :, None] + reach[..., None] * standing_out(strands, chain)[:, :, None]
