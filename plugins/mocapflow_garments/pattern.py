"""What garments sewn from tape measures share: what a length can be, and where a band lies on the body."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from mocapflow.assets import Body
from mocapflow.errors import GarmentError
from mocapflow.geometry.skeleton import skeleton_of, unsided
from mocapflow.records import F64
from mocapflow_garments import sections

Length = Annotated[float, Field(gt=0, lt=4)]  # m; a longer one is in cm or mm

EASE = 0.002  # m, the least room between waistband and skin
MEANT = 1.3  # a measure that is further below the body's own is a mistake
LARGEST_ROOM = 0.08  # m between waistband and skin: more can't hold a garment up
WHOSE = "is the body this person's? a template is set by body.height_m and body.shape"
PART = "only a part of the body is used: body.part: full wears what reaches beyond it"


def even_links(rows: F64, link: float) -> F64:
    """Return rows (strands, rows, 3) moved so that each particle lies one link from the one above it."""
    even = rows.copy()
    for row in range(1, rows.shape[1]):
        bar = rows[:, row] - even[:, row - 1]
        even[:, row] = even[:, row - 1] + link * bar / np.linalg.norm(bar, axis=1, keepdims=True)
    return even


def room(garment: str, measure: str, around: float, tape: float, place: str = "the place") -> float:
    """Return how far a band lies outside a body that measures `tape` m there; a band inside is pushed out.

    Raises:
        GarmentError: the band is so much too tight that it can't be meant for that place.
    """
    if around * MEANT < tape:
        raise GarmentError(
            f"{garment}: {measure} is {around:.2f} m, but the body measures {tape:.2f} m there",
            hint=f"check {place} and the measure; {WHOSE}",
        )
    return max((around - tape) / (2 * math.pi), EASE)


def waistband(garment: str, body: Body, height: float, around: float) -> tuple[F64, float]:
    """Return the torso's outline (N, 2) m at a height and how far outside it a band of a given length lies.

    Raises:
        GarmentError: no body is at that height, or only legs or shoulders, or the band is far too wide to stay up.
    """
    torso = _torso(garment, body, height)
    tape = sections.perimeter(torso)
    if (around - tape) / (2 * math.pi) > LARGEST_ROOM:
        raise GarmentError(
            f"{garment}: a waist of {around:.2f} m can't stay up on a body of {tape:.2f} m there",
            hint=f"check waist_circumference_m and waist_height_m; {WHOSE}",
        )
    return torso, room(garment, "waist_circumference_m", around, tape)


def _torso(garment: str, body: Body, height: float) -> F64:
    """Return the torso's outline (N, 2) m at a height; see `waistband`."""
    outlines = sections.outlines(body, sections.level(height))
    if not outlines:
        raise GarmentError(
            f"{garment}: there is no body at waist_height_m = {height:.2f}",
            hint=f"the height is metres above the floor; the rest body ends at {body.vertices[:, 2].max():.2f} m\n"
            f"{PART if body.cut.any() else WHOSE}",
        )
    torso = max(outlines, key=sections.perimeter)
    if not _holds(torso, middle(body)):
        raise GarmentError(
            f"{garment}: at waist_height_m = {height:.2f} the legs have parted already",
            hint=f"the height is metres above the floor, of the upper edge: above the body's crotch\n{WHOSE}",
        )
    skeleton = skeleton_of(body)
    arms = [at[2] for name, at in zip(skeleton.names, skeleton.positions, strict=True) if unsided(name) == "shoulder"]
    if arms and height > min(arms):
        raise GarmentError(
            f"{garment}: at waist_height_m = {height:.2f} it would hang from the shoulders",
            hint=f"the height is metres above the floor, of the upper edge; shoulders are {min(arms):.2f} m high\n"
            f"{WHOSE}",
        )
    return torso


def hip_rings(body: Body, height: float, rows: F64, around: F64, away: float) -> F64:
    """Return lengths around (rows,) m that are nowhere tighter than the hips, down to where the legs part.

    Args:
        body: the body at rest.
        height: m, of the waist.
        rows: m, how far below the waist each row lies.
        around: m, wanted length of each row.
        away: m, room between band and skin.
    """
    around = around.copy()
    for row, below in enumerate(rows):
        outlines = sections.outlines(body, sections.level(height - below))
        torso = [closed for closed in outlines if _holds(closed, middle(body))]
        if not torso:  # the legs have parted
            break
        around[row] = max(around[row], sections.perimeter(torso[0]) + 2 * math.pi * away)
    return np.maximum.accumulate(around)


def middle(body: Body) -> F64:
    """Return the place (2,) m between the hips, seen from above: in the torso, and between the legs."""
    hips = [joint for joint, name in enumerate(body.joint_names) if unsided(name) == "hip"]
    return np.asarray(body.positions[hips or [0], :2].mean(axis=0))


def _holds(closed: F64, point: F64) -> bool:
    """Return True if a point (2,) lies in a convex outline (N, 2)."""
    edge = np.roll(closed, -1, axis=0) - closed
    to = point - closed
    return bool(np.all(edge[:, 0] * to[:, 1] - edge[:, 1] * to[:, 0] >= 0))
