"""Which limbs views do not tell from the room: they look like it, or something of it stands before them."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Surface
from mocapflow.geometry.cameras import project
from mocapflow.geometry.kinematics import descendants
from mocapflow.records import F64, Bool
from mocapflow_recovery.certain import View

LOG = logging.getLogger("mocapflow")
BEGIN = ("knee", "elbow")  # joints that limbs begin at, on either side
FOOT = ("ankle", "toe")  # joints that move a foot, on either side
LEAST = 0.1  # share of a limb that has to be told; of shanks and feet well lit pictures tell 0.37 to 0.81
CARRIES = 0.25  # share of its motion from which on a point of a shank tells of the foot, too
NEAR_M = 0.06  # from what may be the person: a first pose is about as far off
UNSHOWN, UNSURE = 0.4, 0.7  # shares of a leg: of less the room is shown, more than the other is shown
LEAST_OF_FEET = 0.35  # of both; 0.20 to 0.28 are told on white floors, 0.1 in grey pictures, else 0.42 to 0.81

UNTOLD = "from %s on only %.0f%% differ from the room: this limb may be lost unnoticed"
HIDDEN = (
    "%s shows the empty room where the first pose and the other views have the leg from %s on:"
    " if something stands before it, paint that white in occluders/%s.png; else mend the first pose"
)


def warn_of_untold(surface: Surface, seen: Sequence[View], body: Body) -> None:
    """Warn of limbs that look like the room; see `untold`."""
    for joint, share in untold(surface, seen, body).items():
        LOG.warning(UNTOLD, joint, 100 * share)


def warn_of_furniture(surface: Surface, seen: Sequence[View], body: Body) -> None:
    """Warn of cameras that show the room where the others show a leg; see `hidden_legs`."""
    for camera, joints in hidden_legs(surface, seen, body).items():
        LOG.warning(HIDDEN, camera, " and ".join(joints), camera)


def untold(surface: Surface, seen: Sequence[View], body: Body) -> dict[str, float]:
    """Return the joints from which on a limb looks like the room, each with the share that differs, in all views.

    Args:
        surface: the person as fitted.
        seen: what the views surely show.
        body: whose vertices come first in the surface.
    """
    person = _told(surface, seen, body)
    below = descendants(body.parents)
    begin = {name: joint for joint, name in enumerate(body.joint_names) if name.rpartition("_")[0] in BEGIN}
    limbs = {name: below[joint][body.main_joint] for name, joint in begin.items()}
    shares = {name: float(person[limb].mean()) for name, limb in limbs.items() if limb.any()}
    return {name: share for name, share in shares.items() if share < LEAST}


def like_the_floor(surface: Surface, seen: Sequence[View], body: Body) -> Bool:
    """Return the vertices (V,) that move with the feet of a body if both look like the room in all views, or none."""
    of_feet = np.array([name.rpartition("_")[0] in FOOT for name in body.joint_names])
    feet, moved = of_feet[body.main_joint], (of_feet[body.skin_joint] * body.skin_weight).sum(axis=1) > CARRIES
    return moved if feet.any() and _told(surface, seen, body)[feet].mean() < LEAST_OF_FEET else np.zeros_like(moved)


def hidden_legs(surface: Surface, seen: Sequence[View], body: Body) -> dict[str, list[str]]:
    """Return the cameras that show the room where the others show a leg, each with the joints from which on.

    Args:
        surface: the person as given.
        seen: what the views surely show.
        body: whose vertices come first in the surface.
    """
    near = np.array([_seen_by(view, view.away * view.pixel_m < NEAR_M, surface, True) for view in seen], bool)
    near = near.reshape(len(seen), len(surface.vertices))  # where no view shows anything surely, too
    below, found = descendants(body.parents), dict[str, list[str]]()
    for joint in (number for number, name in enumerate(body.joint_names) if name.rpartition("_")[0] == BEGIN[0]):
        shares = near[:, : len(body.vertices)][:, below[joint][body.main_joint]].mean(axis=1)
        lost = np.flatnonzero(shares < UNSHOWN)
        if len(lost) <= len(seen) / 2 and np.delete(shares, lost).min(initial=1) > UNSURE:
            for view in lost.tolist():
                found.setdefault(seen[view].camera.name, []).append(body.joint_names[joint])
    return found


def _told(surface: Surface, seen: Sequence[View], body: Body) -> F64:
    """Return the share (V,) of the views that surely show the person where a vertex of the body is."""
    on_person = [_seen_by(view, view.person, surface, False) for view in seen]
    return np.asarray(np.mean(on_person, axis=0)[: len(body.vertices)])


def _seen_by(view: View, shown: Bool, surface: Surface, beyond: bool) -> Bool:
    """Return what a view shows (h, w) where vertices lie: (N,), or else what holds beyond its edges."""
    pixels, found = project(surface.vertices, view.camera), np.full(len(surface.vertices), beyond)
    size = np.array(shown.shape[::-1])
    inside = ((pixels > -0.5) & (pixels < size - 0.5)).all(axis=1)  # NaN is not
    column, row = np.rint(pixels[inside]).astype(int).T
    found[inside] = shown[row, column]
    return found
