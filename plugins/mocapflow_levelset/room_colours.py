"""The person's colours and those of the room beside them, as earlier frames have shown them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.data import Frame, Past, Silhouette
from mocapflow.memo import memoised
from mocapflow.records import F32, F64
from mocapflow_levelset import crops
from mocapflow_levelset.colours import BINS, bins_of
from mocapflow_levelset.layers import CLIP, COLOURS, LEAST, SURELY, UNSEEN, densities

ROOM = "room"  # of Segmentation.appearance: (C, BINS) pixels beside the person in each view by colour, older ones less


def room_histograms(
    frame: Frame, silhouettes: Sequence[Silhouette], past: Past, keep: float, grid: int, reach_px: int
) -> F64:
    """Return the colours (C, BINS) of the room near the silhouettes: `keep` of what is known, and those of this frame.

    What colours surely say is the person does not count: a limb that was lost must not pass for the room.
    """
    known = past.appearance.get(ROOM)
    counts = np.zeros((len(frame.images), BINS)) if known is None else keep * known
    for silhouette in silhouettes:
        crop = crops.around(silhouette.distance, reach_px, grid)
        if crop is None:
            continue
        number, hidden = silhouette.camera, frame.hidden_in(silhouette.camera)
        outside = crop.of(silhouette.distance)[::grid, ::grid] < -grid
        if hidden is not None:
            outside &= ~hidden[crop.top : crop.bottom : grid, crop.left : crop.right : grid]
        colour = bins_of(crop.of(frame.images[number])[::grid, ::grid][outside])
        if known is not None:
            colour = colour[person_log_ratio(past, number)[colour] < -SURELY]
        counts[number] += np.bincount(colour, minlength=BINS)
    return counts


@memoised
def person_log_ratio(past: Past, camera: int) -> F32:
    """Return the log density (BINS,) of colours on the person over that in a view of the room, bounded; 0: unknown."""
    counts = np.stack([past.appearance[COLOURS].sum(axis=0), past.appearance[ROOM][camera]])
    if (counts.sum(axis=1) < LEAST).any():
        return np.zeros(BINS, np.float32)
    person, room = np.log((1 - UNSEEN) * densities(counts) + UNSEEN / BINS)
    ratio: F32 = np.clip(person - room, -CLIP, CLIP).astype(np.float32)
    return ratio
