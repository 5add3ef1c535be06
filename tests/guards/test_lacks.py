"""Components that would have nothing to do in a recording."""

import pytest
from mocapflow_levelset.background import BackgroundDifference
from mocapflow_levelset.levelset import LevelSet
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.keypoints import Keypoints
from mocapflow_recovery.limb_search import LimbSearch

from mocapflow.errors import RecordingError
from mocapflow.guards.lacks import idle_matchers, idle_without_scene
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording


def test_a_matcher_without_keypoints_is_told_and_is_an_error_where_it_is_alone():
    recording = open_recording(shipped("examples", "data", "skirt_steps"))
    assert idle_matchers([ContourIcp()], recording) == []
    (said,) = idle_matchers([ContourIcp(), Keypoints()], recording)
    assert said.startswith("matcher keypoints has nothing to match: there are no 2D keypoints")
    with pytest.raises(RecordingError, match="there are no 2D keypoints"):
        idle_matchers([Keypoints()], recording)


def test_a_first_segmenter_and_a_recovery_that_lack_the_empty_scene_are_told():
    needing, search = BackgroundDifference(), LimbSearch()
    said = idle_without_scene(needing, search, background_known=False)
    assert [line.partition(" needs the empty scene")[0] for line in said] == [
        "first_segmenter background",
        "recovery limb_search",
    ]
    for first, recovery, known in ((needing, search, True), (LevelSet(), None, False), (None, None, False)):
        assert idle_without_scene(first, recovery, known) == []
