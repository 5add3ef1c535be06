"""Which limbs are hard to see: they look like the room (camouflage), or something stands before them (occluders)."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Surface
from mocapflow.geometry.kinematics import descendants
from mocapflow.records import F64, Bool
from mocapflow_recovery.disagreement import pixels_of
from mocapflow_recovery.trimaps import Trimap

LOG = logging.getLogger("mocapflow")
BEGIN = ("knee", "elbow")  # joints that limbs begin at, on either side
FOOT = ("ankle", "toe")  # joints that move a foot, on either side
LEAST = 0.1  # share of a limb that has to be visible; of shanks and feet 0.37 to 0.81 are in well lit pictures
CARRIES = 0.25  # share of its motion from which on a point of a shank tells of the foot, too
NEAR_M = 0.06  # from what may be the person: a first pose is about as far off
UNSHOWN, UNSURE = 0.4, 0.7  # shares of a leg: of less the room is shown, more than the other is shown
LEAST_OF_FEET = 0.35  # of both; 0.20 to 0.28 are visible on white floors, 0.1 in grey pictures, else 0.42 to 0.81

CAMOUFLAGED = "from %s on only %.0f%% differ from the room: this limb may be lost unnoticed"
OCCLUDED = (
    "%s shows the empty room where the first pose and the other views have the leg from %s on:"
    " if something stands before it, paint that white in occluders/%s.png; else mend the first pose"
)


def warn_of_camouflage(surface: Surface, trimaps: Sequence[Trimap], body: Body) -> None:
    """Warn of limbs that look like the room; see `camouflaged_limbs`."""
    for joint, share in camouflaged_limbs(surface, trimaps, body).items():
        LOG.warning(CAMOUFLAGED, joint, 100 * share)


def warn_of_occluders(surface: Surface, trimaps: Sequence[Trimap], body: Body) -> None:
    """Warn of cameras that show the room where the others show a leg; see `occluded_legs`."""
    for camera, joints in occluded_legs(surface, trimaps, body).items():
        LOG.warning(OCCLUDED, camera, " and ".join(joints), camera)


def camouflaged_limbs(surface: Surface, trimaps: Sequence[Trimap], body: Body) -> dict[str, float]:
    """Return the joints from which on a limb looks like the room, each with the share that differs, in all views.

    Args:
        surface: the person as fitted.
        trimaps: of the views.
        body: whose vertices come first in the surface.
    """
    person = _share_of_views(surface, trimaps, body)
    below = descendants(body.parents)
    begin = {name: joint for joint, name in enumerate(body.joint_names) if name.rpartition("_")[0] in BEGIN}
    limbs = {name: below[joint][body.main_joint] for name, joint in begin.items()}
    shares = {name: float(person[limb].mean()) for name, limb in limbs.items() if limb.any()}
    return {name: share for name, share in shares.items() if share < LEAST}


def camouflaged_feet(surface: Surface, trimaps: Sequence[Trimap], body: Body) -> Bool:
    """Return the vertices (V,) that move with the feet of a body if both look like the room in all views, or none."""
    of_feet = np.array([name.rpartition("_")[0] in FOOT for name in body.joint_names])
    feet, moved = of_feet[body.main_joint], (of_feet[body.skin_joint] * body.skin_weight).sum(axis=1) > CARRIES
    alike = feet.any() and _share_of_views(surface, trimaps, body)[feet].mean() < LEAST_OF_FEET
    return moved if alike else np.zeros_like(moved)


def occluded_legs(surface: Surface, trimaps: Sequence[Trimap], body: Body) -> dict[str, list[str]]:
    """Return the cameras that show the room where the others show a leg, each with the joints from which on.

    Args:
        surface: the person as given.
        trimaps: of the views.
        body: whose vertices come first in the surface.
    """
    near = np.array([_seen_by(each, each.distance * each.pixel_m < NEAR_M, surface, True) for each in trimaps], bool)
    near = near.reshape(len(trimaps), len(surface.vertices))  # where no view shows anything surely, too
    below, found = descendants(body.parents), dict[str, list[str]]()
    for joint in (number for number, name in enumerate(body.joint_names) if name.rpartition("_")[0] == BEGIN[0]):
        shares = near[:, : len(body.vertices)][:, below[joint][body.main_joint]].mean(axis=1)
        lost = np.flatnonzero(shares < UNSHOWN)
        if len(lost) <= len(trimaps) / 2 and np.delete(shares, lost).min(initial=1) > UNSURE:
            for view in lost.tolist():
                found.setdefault(trimaps[view].camera.name, []).append(body.joint_names[joint])
    return found


def _share_of_views(surface: Surface, trimaps: Sequence[Trimap], body: Body) -> F64:
    """Return the share (V,) of the views that surely show the person where a vertex of the body is."""
    on_person = [_seen_by(trimap, trimap.person, surface, False) for trimap in trimaps]
    return np.asarray(np.mean(on_person, axis=0)[: len(body.vertices)])


def _seen_by(trimap: Trimap, shown: Bool, surface: Surface, beyond: bool) -> Bool:
    """Return what a trimap shows (h, w) where vertices lie: (N,), or else what holds beyond its edges."""
    found = np.full(len(surface.vertices), beyond)
    rows, column, row = pixels_of(surface.vertices, trimap)
    found[rows] = shown[row, column]
    return found
