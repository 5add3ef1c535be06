import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocapflow.errors import MocapflowError
from mocapflow.geometry.registration import register


def rig(seed: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return Rotation.random(random_state=seed).as_matrix(), random.normal(size=3)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [3, 20])
def test_a_rigid_motion_is_recovered(seed: int, count: int) -> None:
    """T-CAL."""
    rotation, shift = rig(seed)
    points = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
    found = register(points, points @ rotation.T + shift)
    np.testing.assert_allclose(found.rotation, rotation, atol=1e-6)
    np.testing.assert_allclose(found.translation, shift, atol=1e-6)
    assert found.scale == pytest.approx(1)
    assert found.residual.max() < 1e-6
    np.testing.assert_allclose(found.apply(np.eye(3)), np.eye(3) @ rotation.T + shift, atol=1e-6)
    assert np.isnan(found.left_out).all() if count == 3 else found.left_out.max() < 1e-6


def test_error_with_noise_is_what_theory_predicts() -> None:
    """T-CAL: of 3 N coordinates, six are spent on the motion: mean square residual = (1 - 2/N) 3 sd² (Sibson 1979)."""
    count, sd, squares, outside = 20, 0.001, [], []
    for seed in range(200):
        rotation, shift = rig(seed)
        random = np.random.default_rng(seed)
        points = random.uniform(-1, 1, (count, 3))
        found = register(points, points @ rotation.T + shift + random.normal(scale=sd, size=points.shape))
        squares.append(np.mean(found.residual**2))
        outside.append(np.mean(found.left_out**2))
    expected = np.sqrt(3 * (1 - 2 / count)) * sd
    assert np.sqrt(np.mean(squares)) == pytest.approx(expected, rel=0.03)
    assert max(abs(np.sqrt(squares) / expected - 1)) < 0.4  # each single one: 54 degrees of freedom
    assert np.sqrt(np.mean(outside)) > np.sqrt(3) * sd  # a point that was left out shows its own noise and the fit's


@pytest.mark.long
def test_how_far_a_noisy_motion_carries_points_astray_is_what_theory_predicts() -> None:
    """T-CAL: at the points' middle sd² 3/N, elsewhere more: target registration error (Fitzpatrick et al. 1998)."""
    count, sd, draws = 20, 0.001, 400
    random = np.random.default_rng(7)
    points = random.uniform(-1, 1, (count, 3))
    targets = np.concatenate([points.mean(axis=0)[None], random.uniform(-3, 3, (8, 3))])
    squares = []
    for seed in range(draws):
        rotation, shift = rig(seed)
        found = register(points, points @ rotation.T + shift + random.normal(scale=sd, size=points.shape))
        squares.append(np.sum((found.apply(targets) - (targets @ rotation.T + shift)) ** 2, axis=1))
    spread, axes = np.linalg.eigh(np.cov(points.T, bias=True))
    along = (targets - points.mean(axis=0)) @ axes  # off the middle, along the principal axes of the points
    others = [[1, 2], [2, 0], [0, 1]]
    off_axis = sum((along[:, axis] ** 2).sum(axis=1) / spread[axis].sum() for axis in others)
    assert np.sqrt(np.mean(squares, axis=0)) == pytest.approx(sd * np.sqrt((3 + off_axis) / count), rel=0.1)


def test_scale_is_reported_and_not_applied() -> None:
    points = np.random.default_rng(1).uniform(-1, 1, (10, 3))
    found = register(points, 1.02 * points)
    assert found.scale == pytest.approx(1.02)
    np.testing.assert_allclose(found.rotation, np.eye(3), atol=1e-9)
    assert found.residual.max() > 0.01


def test_mirrored_points_get_no_mirror() -> None:
    points = np.random.default_rng(2).uniform(-1, 1, (10, 3))
    assert np.linalg.det(register(points, points * [1, 1, -1]).rotation) == pytest.approx(1)


def test_groups_are_left_out_together() -> None:
    points = np.random.default_rng(3).uniform(-1, 1, (12, 3))
    moved = points.copy()
    moved[:3] += [0, 0, 0.3]  # one group is wrong, which the fit to all of it hides
    found = register(points, moved, np.repeat(np.arange(4), 3))
    np.testing.assert_allclose(found.left_out[:3], 0.3, atol=1e-9)
    assert found.residual[:3].max() < 0.3


@pytest.mark.parametrize("points", [np.eye(3)[:2], np.arange(5.0)[:, None] * [1, 2, 3], np.ones((4, 3))])
def test_what_does_not_tell_is_refused(points: np.ndarray) -> None:
    with pytest.raises(MocapflowError, match="line"):
        register(points, points)
