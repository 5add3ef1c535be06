"""What a user is told of a whole track: lost and doubted frames, views that show something else."""

from dataclasses import replace

import numpy as np
from mocapflow_export.quality_warnings import overlap_medians, quality_warnings
from results_scene import demo_scene, stepping

NAMES = ["cam01", "cam02", "cam03", "cam04"]
TRACK = stepping(demo_scene().body, 8)


def seen(*overlaps, **changes):
    return replace(TRACK, overlap=np.tile(overlaps, (8, 1)), **changes)


def test_a_good_track_gives_none():
    assert quality_warnings(seen(0.93, 0.9, 0.85, 0.61), NAMES) == []
    assert quality_warnings(seen(0.93, np.nan, 0.85, np.nan), NAMES) == []  # dropped cameras
    assert not any("other views" in said for said in quality_warnings(seen(0.55, *[np.nan] * 3), NAMES))
    assert np.isnan(overlap_medians(seen(0.93, np.nan, 0.85, 0.9))[1])


def test_a_view_of_something_else_is_named():
    (said,) = quality_warnings(seen(0.93, 0.33, 0.87, 0.9), NAMES)
    assert said.startswith("cam02 shows something else than the other views: overlap 0.33 there, 0.90 in them; is its")


def test_a_model_that_is_not_there():
    (said,) = quality_warnings(seen(0.6, 0.5, 0.6, 0.55), NAMES)
    assert said.startswith("model and person hardly overlap")


def test_a_first_frame_that_fits_badly():
    """Somebody who stands turned round overlaps so: knees, feet and elbows lie on the wrong side."""
    later = np.tile([0.93, 0.9, 0.95, 0.92], (7, 1))
    begun = replace(TRACK, overlap=np.vstack([[0.76, 0.88, np.nan, 0.82], later]))
    (said,) = quality_warnings(begun, NAMES)
    assert said.startswith(
        "the first frame fits badly, overlap 0.76 to 0.88: is the first pose right, and is the scan this person's?"
    )
    hidden = np.vstack([[0.61, 0.9, 0.86, 0.93], later])  # something stands before the person in one view
    assert quality_warnings(replace(TRACK, overlap=hidden), NAMES) == []
    unseen = np.vstack([np.full(4, np.nan), later])
    assert quality_warnings(replace(TRACK, overlap=unseen), NAMES) == []


def test_lost_and_doubted_frames_are_counted():
    known = TRACK.iterations.copy()
    known[2] = 0
    doubted = np.arange(8) >= 5
    said = quality_warnings(seen(0.9, 0.9, 0.9, 0.9, iterations=known, doubted=doubted), NAMES)
    assert said == [
        "1 of 8 frames are lost: their pose is a guess",
        "3 of 8 frames are doubted: images or keypoints contradict them",
    ]
