"""Which poses are searched: unlike each other, and one for each direction that may be right."""

import numpy as np
import pytest
from mocapflow_recovery.candidates import farthest_points, likely_headings, separate_minima
from mocapflow_recovery.placing import heading_between

from mocapflow.data import Pose
from mocapflow.geometry import twists


def test_the_poses_that_are_tried_are_unlike_each_other():
    poses = np.array([[0.1, 0.0], [1.0, 0.0], [1.1, 0.0], [0.0, 0.9]])
    np.testing.assert_array_equal(farthest_points(poses, 3), [[0, 0], [1.1, 0], [0, 0.9]])
    assert len({tuple(pose) for pose in farthest_points(poses, 9)}) == len(farthest_points(poses, 9)) == 5


def test_directions_that_are_searched_lie_apart():
    off = np.array([3.0, 1.0, 2.0, 9.0, 9.0, 4.0, 9.0, 1.5])
    assert separate_minima(off, 3) == [1, 7, 5]  # 2 and 0 lie beside better ones
    assert separate_minima(off, 9) == [1, 7, 5, 3]
    assert separate_minima(np.array([1.0, 9.0, 3.0, 9.0, 2.0]), 2) == [0, 2]  # 4 lies beside 0


def test_one_pose_for_each_way_that_a_person_may_look():
    """Of those that hardly cost more than the best; the cheapest of each."""
    poses = [heading(degrees) for degrees in (170, 10, -20, 90, 180)]
    assert likely_headings(poses, np.array([1.3, 1.0, 1.2, 1.6, 1.4])) == [1, 0]
    assert likely_headings(poses, np.array([1.3, 1.0, 1.2, 1.4, 1.1])) == [1, 4, 3]
    assert likely_headings(poses[:1], np.array([2.0])) == [0]
    assert likely_headings(poses, np.arange(5.0)) == [0]  # nothing is left to lessen


def test_the_angle_between_headings_is_right_for_those_who_lean_and_for_the_same_and_opposite_ones():
    for lean in (0, 60):
        for degrees in range(0, 360, 10):
            between = [heading_between(heading(degrees), heading(degrees + by, lean)) for by in (0, 50, 180)]
            assert np.degrees(between) == pytest.approx([0, 50, 180], abs=1e-5)


def heading(degrees, lean=0):
    """Return a pose that leans forward, then turned about the vertical."""
    leaning, turn = twists.exp(np.radians([lean, 0, 0, 0, 0, 0])), np.radians([0, 0, degrees, 0, 0, 0])
    return Pose(root=twists.exp(turn) @ leaning, angles=np.zeros(0))
