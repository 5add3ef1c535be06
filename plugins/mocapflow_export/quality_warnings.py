"""Warnings about a whole track: what should make its user look twice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.records import F64
from mocapflow.results import Track

APART, BEHIND = 0.6, 0.2  # overlap of a view below which, and below the others by which, it shows something else
POOR = 0.7  # median overlap of all views below which the model is not where the person is
# overlap in a first frame: all good fits had 0.83 in the worst view or 0.85 in the median one; turned round, somebody
# has 0.76 and 0.85 at most
WORST, USUAL = 0.8, 0.86


def quality_warnings(track: Track, cameras: Sequence[str]) -> list[str]:
    """Return in words what to look at: frames that are guesses, views that show something else than the model."""
    count, lost = len(track.frame), int(track.lost.sum())
    said = [f"{lost} of {count} frames are lost: their pose is a guess"] if lost else []
    if track.doubted.any():
        said.append(f"{track.doubted.sum()} of {count} frames are doubted: images or keypoints contradict them")
    median = overlap_medians(track)
    for index, (camera, own) in enumerate(zip(cameras, median, strict=True)):
        others = middle(np.delete(median, index))
        if own < APART and own < others - BEHIND:  # not where there are no others
            said.append(
                f"{camera} shows something else than the other views: overlap {own:.2f} there, {others:.2f} in them; "
                "is its calibration right, and its video its own?"
            )
    if middle(median) < POOR:
        said.append("model and person hardly overlap in most views: look at overlay/, at the calibration and the start")
    elif begins_badly(track.overlap[0]):
        least, most = np.nanmin(track.overlap[0]), np.nanmax(track.overlap[0])
        said.append(
            f"the first frame fits badly, overlap {least:.2f} to {most:.2f}: is the first pose right, and is "
            "the scan this person's? look at overlay/; does it look the other way, or are left and right exchanged?"
        )
    return said


def begins_badly(overlap: F64) -> bool:
    """Return whether the overlaps (C,) of a first frame, NaN where unseen, are unlike those of a good start."""
    known = overlap[np.isfinite(overlap)]
    return len(known) > 0 and bool(known.min() < WORST and np.median(known) < USUAL)


def overlap_medians(track: Track) -> F64:
    """Return the median overlap (C,) of model and image in each view; NaN where a view was never used."""
    return np.array([middle(view) for view in track.overlap.T])


def middle(values: F64) -> float:
    """Return the median of the values that are finite, NaN where none is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else np.nan
