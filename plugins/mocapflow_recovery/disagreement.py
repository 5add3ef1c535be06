"""How far a surface and what the images surely show are apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.data import Surface
from mocapflow.geometry.silhouettes import mask, outline
from mocapflow.records import F32, Bool
from mocapflow_recovery.certain import View


def distance(surface: Surface, views: Sequence[View], cap_m: float) -> float:
    """Return the mean over the views of what stands apart, in m per unit of the person's area.

    Both ways: the person's pixels by their distance from the model, the model's by theirs from where the person may
    be, each at most `cap_m`. Unlike the area in which they differ it tells a limb that is near from one that is far.
    """
    total = 0.0
    for view in views:
        covered, off = _of(surface, view)
        cap = cap_m / view.pixel_m
        apart = np.minimum(off[view.person], cap).sum() + np.minimum(view.away[covered], cap).sum()
        total += float(apart) * view.pixel_m / max(int(np.count_nonzero(view.person)), 1)
    return total / max(len(views), 1)


def stray_area(surface: Surface, views: Sequence[View], reach_m: float) -> float:
    """Return the area (m²), all views together, where person or model is further than `reach_m` from the other."""
    total = 0.0
    for view in views:
        covered, off = _of(surface, view)
        reach = reach_m / view.pixel_m
        stray = np.count_nonzero(off[view.person] > reach) + np.count_nonzero(view.away[covered] > reach)
        total += stray * view.pixel_m**2
    return total


def _of(surface: Surface, view: View) -> tuple[Bool, F32]:
    """Return the silhouette (h, w) of a surface and the distance (h, w) px of every pixel from it."""
    import cv2

    covered = mask(outline(surface, view.camera), view.camera)
    off = cv2.distanceTransform((~covered).view(np.uint8), cv2.DIST_L2, 3)
    return covered, np.asarray(off, np.float32)
