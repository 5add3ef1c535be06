"""How far a turn has moved the solution, in metres, radians and standard deviations; and what counts as rest."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.data import Change
from mocapflow.model import moved
from mocapflow.prediction import initial_state
from mocapflow.steady import Steady, measure_change
from mocapflow.testing import tiny_cloth, tiny_pose, tiny_scene

SCENE = tiny_scene(clothed=True)
POSE = tiny_pose(SCENE, 1)
BODY, UNKNOWNS = len(SCENE.body.vertices), 6 + len(POSE.angles)


def shown(increment=None, cloth=0.0, covariance=None):
    """A state after an increment; the cloth stays where it was but for its own shift (W, 3) m."""
    hanging = tiny_cloth(SCENE, POSE)
    hanging = replace(hanging, vertices=hanging.vertices + cloth)
    state = initial_state(POSE if increment is None else moved(POSE, increment), hanging.parameters, hanging)
    return replace(
        state,
        estimate=replace(state.estimate, covariance=np.array(np.eye(UNKNOWNS) if covariance is None else covariance)),
    )


def unit(column, size):
    return size * np.eye(UNKNOWNS)[column]


def test_the_body_counts_by_its_largest_move_and_cloth_by_the_root_mean_square():
    cloth = np.zeros((len(SCENE.garment.vertices), 3))
    cloth[0] = [0.003, 0, 0.004]
    change = measure_change(shown(), shown(unit(4, -0.002), cloth), SCENE)
    assert change.body == pytest.approx(0.002)
    assert change.cloth == pytest.approx(0.005 / np.sqrt(len(cloth)))
    assert change.angles == 0
    np.testing.assert_allclose(change.shift[:BODY], np.tile([0, -0.002, 0], (BODY, 1)), atol=1e-12)
    np.testing.assert_allclose(change.shift[BODY:], cloth, atol=1e-12)


def test_angles_count_by_the_largest_either_way():
    change = measure_change(shown(), shown(unit(6, 0.01) + unit(7, -0.03)), SCENE)
    assert change.angles == pytest.approx(0.03)
    assert change.body == pytest.approx(np.linalg.norm(change.shift[:BODY], axis=1).max()) and change.cloth == 0


def test_the_way_in_standard_deviations_is_the_root_mean_square_over_independent_directions():
    wide = np.eye(UNKNOWNS + 2)  # unknowns of the cloth follow, which are no part of the pose
    wide[3, 3] = 0.001**2
    change = measure_change(shown(), shown(unit(3, 0.003), covariance=wide), SCENE)
    assert change.sigmas == pytest.approx(3 / np.sqrt(UNKNOWNS))
    wide[4, 4], wide[3, 4], wide[4, 3] = 0.01**2, 0.8e-5, 0.8e-5  # x and y are known together: correlation 0.8
    across = measure_change(shown(), shown(unit(3, 0.003), covariance=wide), SCENE)
    assert across.sigmas == pytest.approx(3 / 0.6 / np.sqrt(UNKNOWNS))
    along = measure_change(shown(), shown(unit(3, 0.003) + unit(4, 0.024), covariance=wide), SCENE)
    assert along.sigmas == pytest.approx(3 / np.sqrt(UNKNOWNS))


@pytest.mark.parametrize(
    ("body", "cloth", "angle_deg", "sigmas", "rest"),
    [
        (0.0005, 0.0005, 0.1, 9, True),
        (0.00051, 0, 0, 9, False),
        (0, 0.00051, 0, 9, False),
        (0, 0, 0.11, 9, False),
        (1, 1, 90, 0.1, True),
        (1, 1, 90, 0.2, False),
    ],
)
def test_rest_is_within_both_tolerances_or_less_than_the_pose_is_known_to(body, cloth, angle_deg, sigmas, rest):
    change = Change(body=body, cloth=cloth, angles=float(np.radians(angle_deg)), sigmas=sigmas)
    assert Steady(sigmas=(0.2,)).holds(change, 1) is rest
