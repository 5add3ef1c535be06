"""Feet that look like the floor: an outline that ends above them tells nothing of where they are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mocapflow.data import Matches, Past
from mocapflow.records import F64, Bool, picked_rows

FEET = "feet that look like the floor"  # of Segmentation.appearance: (V,) 1 for vertices of the body that do, else 0


def with_feet(appearance: Mapping[str, F64], vertices: Bool) -> dict[str, F64]:
    """Return what is known of appearances, and which vertices (V,) of the body look like the floor."""
    return {**appearance, FEET: vertices.astype(np.float64)}


def without_camouflaged(matches: Matches, past: Past) -> Matches:
    """Return matches without those of parts that look like the room: the outline of the person ends elsewhere."""
    if FEET not in past.appearance:
        return matches
    like_the_floor = np.flatnonzero(past.appearance[FEET])
    return picked_rows(matches, ~np.isin(matches.vertex, like_the_floor))
