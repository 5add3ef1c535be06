"""Components that would have nothing to do in a recording."""

import pytest
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.keypoints import Keypoints

from mocapflow.errors import RecordingError
from mocapflow.guards.matcher_inputs import check_matcher_inputs
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording


def test_a_matcher_without_keypoints_is_told_and_is_an_error_where_it_is_alone():
    recording = open_recording(shipped("examples", "data", "skirt_steps"))
    assert check_matcher_inputs([ContourIcp()], recording) == []
    (said,) = check_matcher_inputs([ContourIcp(), Keypoints()], recording)
    assert said.startswith("matcher keypoints has nothing to match: there are no 2D keypoints")
    with pytest.raises(RecordingError, match="there are no 2D keypoints"):
        check_matcher_inputs([Keypoints()], recording)
