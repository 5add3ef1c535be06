"""Islands: parts of a silhouette that hang together with nothing and lie where the empty scene shows."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F32, I32, Bool
from mocapflow_levelset.evidence import Evidence


def without_islands(level: F32, evidence: Evidence) -> F32:
    """Return a level set (H, W) without islands that the empty scene explains better than a uniform density.

    An arm of the model that has left the person encloses nothing but room; both sides of its contour then have the
    statistics of the room, and what no statistics tell apart, the shape prior keeps.

    Where the level set is but a crop around what moved, a limb cut off by its rim counts as an island too, and goes if
    it shows nothing but room. Spared, legs that run stay beside the person; see docs/notebook/robustness.md.
    """
    import cv2

    if evidence.outside is None:
        return level
    count, label = cv2.connectedComponents((level > 0).view(np.uint8), connectivity=8)
    if count <= 2:
        return level
    area = np.bincount(label.ravel(), minlength=count)
    islands = (label > 0) & (label != 1 + area[1:].argmax())
    runs = runs_of(islands)
    density = np.nan_to_num(evidence.outside(runs, evidence.along(runs)))  # nobody knows the room: for neither
    explained = np.bincount(label[islands], density, minlength=count) > 0
    return np.where(explained[label], -np.abs(level), level)


def runs_of(mask: Bool) -> I32:
    """Return the runs of a mask (H, W), rows of (y, first x, last x + 1)."""
    steps = np.diff(np.pad(mask, ((0, 0), (1, 1))).view(np.int8), axis=1)
    (row, first), (_, last) = np.nonzero(steps > 0), np.nonzero(steps < 0)
    return np.stack([row, first, last], axis=1).astype(np.int32)
