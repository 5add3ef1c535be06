"""OpenSim's axes: up is y, and nothing is mirrored."""

import numpy as np
import pytest

from mocapflow.io.motion.opensim_axes import opensim_from_world, world_from_opensim
from tests.io.motion.test_trc import positions


def test_axes():
    points = positions()
    assert opensim_from_world(np.array([0, 0, 1.0])).tolist() == [0, 1, 0]  # up
    np.testing.assert_array_equal(world_from_opensim(opensim_from_world(points)), points)
    turn = opensim_from_world(np.eye(3))
    assert np.linalg.det(turn) == pytest.approx(1)  # no mirror
