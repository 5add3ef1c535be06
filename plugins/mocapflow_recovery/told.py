"""Which limbs and feet hardly differ from the room behind them: lost, they are not missed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Surface
from mocapflow.geometry.cameras import project
from mocapflow.geometry.kinematics import descendants
from mocapflow.records import F64, Bool
from mocapflow_recovery.certain import View

BEGIN = ("knee", "elbow")  # joints that limbs begin at, on either side
FOOT = ("ankle", "toe")  # joints that move a foot, on either side
LEAST = 0.1  # share of a limb that has to be told; of shanks and feet well lit pictures tell 0.37 to 0.81
CARRIES = 0.1  # share of its motion from which on a point of a shank tells of the foot, too
LEAST_OF_FEET = 0.35  # of both; 0.20 to 0.28 are told on white floors, 0.1 in grey pictures, else 0.42 to 0.81


def untold(surface: Surface, seen: Sequence[View], body: Body) -> dict[str, float]:
    """Return the joints from which on a limb looks like the room, each with the share that differs, in all views.

    Args:
        surface: the person as fitted.
        seen: what the views surely show.
        body: whose vertices come first in the surface.
    """
    person = _told(surface, seen, body)
    below = descendants(body.parents)
    limbs = {name: below[joint][body.main_joint] for joint, name in enumerate(body.joint_names) if _begins(name)}
    shares = {name: float(person[limb].mean()) for name, limb in limbs.items() if limb.any()}
    return {name: share for name, share in shares.items() if share < LEAST}


def like_the_floor(surface: Surface, seen: Sequence[View], body: Body) -> Bool:
    """Return which vertices (V,) of the body move with feet that look like the room in all views: of both, or none."""
    of_feet = np.array([name.rpartition("_")[0] in FOOT for name in body.joint_names])
    feet, moved = of_feet[body.main_joint], (of_feet[body.skin_joint] * body.skin_weight).sum(axis=1) > CARRIES
    return moved if feet.any() and _told(surface, seen, body)[feet].mean() < LEAST_OF_FEET else np.zeros_like(moved)


def _begins(name: str) -> bool:
    return name.rpartition("_")[0] in BEGIN


def _told(surface: Surface, seen: Sequence[View], body: Body) -> F64:
    """Return the share (V,) of the views that surely show the person where a vertex of the body is."""
    return np.asarray(np.mean([_on_person(surface, view)[: len(body.vertices)] for view in seen], axis=0))


def _on_person(surface: Surface, view: View) -> Bool:
    """Return which vertices (V,) lie where a view surely shows the person; none does beyond its edges."""
    pixels, on_it = project(surface.vertices, view.camera), np.zeros(len(surface.vertices), bool)
    size = np.array(view.person.shape[::-1])
    inside = np.isfinite(pixels).all(axis=1) & (pixels > -0.5).all(axis=1) & (pixels < size - 0.5).all(axis=1)
    column, row = np.rint(pixels[inside]).astype(int).T
    on_it[inside] = view.person[row, column]
    return on_it
