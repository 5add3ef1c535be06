"""The stated uncertainty is the real one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_twist.covariance import covariance, effective_share, observed, view_balance
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton
from test_twist_solver import FREE, solve
from twist_fixtures import exact_matches, make_pose, make_scene

from mocapflow.data import Matches
from mocapflow.geometry import twists


def contour(start: tuple[float, float], end: tuple[float, float], spacing: float) -> Matches:
    """Matches along a straight contour in view 0."""
    length = np.hypot(*np.subtract(end, start))
    along = np.arange(0, length, spacing) / length
    count = len(along)
    return Matches(
        camera=np.zeros(count, np.int16),
        pixel=np.array(start) + along[:, None] * np.subtract(end, start),
        direction=np.tile([1.0, 0.0], (count, 1)),
        vertex=np.zeros(count, np.int32),
        weight=np.ones(count),
    )


@pytest.mark.parametrize("angle_deg", [0, 20, 45, 90])
@pytest.mark.parametrize("spacing", [0.5, 2.0])
def test_a_dense_contour_holds_its_length_over_the_correlation(angle_deg: float, spacing: float) -> None:
    along = 600 * np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    for start in np.random.default_rng(0).uniform(0, 15, (40, 2)):
        line = contour(tuple(start), tuple(start + along), spacing)
        assert effective_share(line, 15.0).sum() == pytest.approx(40, rel=0.2)


def test_matches_far_apart_count_whole() -> None:
    assert effective_share(contour((3.0, 3.0), (900.0, 3.0), 31.0), 15.0) == pytest.approx(1.0)


def test_matches_in_one_place_are_worth_less_the_more_alike_their_weights() -> None:
    """Of their sum squared, what their squares sum up to: a strong one beside a weak one is nearly alone."""
    both = replace(contour((3.0, 3.0), (4.0, 3.0), 0.5), weight=np.array([1.0, 3.0]))
    assert effective_share(both, 15.0) == pytest.approx((1 + 9) / (1 + 3) ** 2)


def test_each_view_is_counted_for_itself_and_rejected_matches_do_not_count() -> None:
    one = contour((3.0, 3.0), (600.0, 3.0), 1.0)
    far = replace(contour((3.0, 3.0), (900.0, 3.0), 31.0), camera=np.full(29, 2, np.int16))
    fields = ("camera", "pixel", "direction", "vertex", "weight")
    both = Matches(**{name: np.concatenate([getattr(one, name), getattr(far, name)]) for name in fields})
    share = effective_share(both, 15.0)
    assert share[:597] == pytest.approx(effective_share(one, 15.0)) and share[597:] == pytest.approx(1.0)
    half = replace(one, weight=np.where(np.arange(597) % 2, 1.0, 0.0))
    used = half.weight > 0
    assert effective_share(half, 15.0)[used].sum() == pytest.approx(effective_share(one, 15.0).sum(), rel=0.02)


def test_balanced_views_weigh_the_same() -> None:
    one = contour((3.0, 3.0), (600.0, 3.0), 1.0)
    matches = replace(one, camera=np.where(np.arange(597) < 100, 0, 3).astype(np.int16))
    share = effective_share(matches, 15.0)
    balanced = matches.weight * share * view_balance(matches, share)
    assert balanced[:100].sum() == pytest.approx(balanced[100:].sum())
    assert balanced.sum() == pytest.approx((matches.weight * share).sum())


@pytest.mark.parametrize("promised", [1.0, 0.5])
def test_the_covariance_is_that_of_repeated_noise(promised: float) -> None:
    """With the true noise twice what the weights promise, the residuals tell so."""
    scene, truth = make_scene(), make_pose(3)
    exact = exact_matches(scene, truth, np.arange(0, 300, 3), directed=True)
    exact = replace(exact, weight=np.full(len(exact.weight), promised**-2))
    solver = TwistGaussNewton(correlation_px=0.0, **FREE)
    rng, errors, covariances = np.random.default_rng(0), [], []
    for _ in range(150):
        noisy = replace(exact, pixel=exact.pixel + rng.normal(size=exact.pixel.shape))
        estimate = solve(solver, scene, truth, noisy)
        twist = twists.log(estimate.pose.root @ twists.inverse(truth.root))
        errors.append(np.concatenate([twist, estimate.pose.angles - truth.angles]))
        covariances.append(estimate.covariance)
    spread, stated = np.array(errors), np.mean(covariances, axis=0)
    assert np.sqrt(np.mean(spread**2, axis=0) / np.diag(stated)) == pytest.approx(1.0, abs=0.15)  # 2.5 of its sd
    squared = [e @ np.linalg.solve(c, e) for e, c in zip(spread, covariances, strict=True)]
    assert np.mean(squared) == pytest.approx(18.0, rel=0.1)


def test_a_distance_to_a_ray_counts_as_two_measurements() -> None:
    """It has three components, of which two are independent: else the noise would seem less than it is in pixels."""
    scene, ratios = make_scene(), []
    for seed in range(12):
        truth, rng = make_pose(seed), np.random.default_rng(seed)
        exact = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False)
        noisy = replace(exact, pixel=exact.pixel + 2 * rng.normal(size=exact.pixel.shape))
        solvers = (TwistGaussNewton(residual=kind, correlation_px=0.0, **FREE) for kind in ("image", "line"))
        image, line = (solve(solver, scene, truth, noisy).covariance for solver in solvers)
        ratios.append(np.sqrt(np.diag(line) / np.diag(image)))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.08)


def test_the_observed_share_is_the_resolution_where_priors_do_not_link_the_unknowns() -> None:
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(5, 8)) * np.logspace(-3, 3, 8)  # five measurements of eight unknowns
    data, prior = rows.T @ rows, np.diag(np.logspace(-4, 4, 8))
    spread = covariance(data, prior, 2.5, 5.0)
    resolution = np.eye(8) - spread @ prior
    assert observed(spread, prior) == pytest.approx(np.diag(resolution), abs=1e-9)


def test_what_only_a_prior_links_to_the_images_counts_as_far_as_the_link_holds() -> None:
    loose, tight = (np.array([[1.0, 0.0], [0.0, 1.0]]) + k * np.array([[1.0, -1.0], [-1.0, 1.0]]) for k in (0, 1e4))
    data = np.diag([1e6, 0.0])  # only the first is seen
    for prior, share in ((loose, 0.0), (tight, 1.0)):
        assert observed(np.linalg.inv(data + prior), prior) == pytest.approx([1.0, share], abs=1e-3)


def test_what_the_data_fix_is_not_free_to_tell_the_noise() -> None:
    """Unknowns that nothing couples: each spends the share of one measurement that the data have in it."""
    data, prior, energy, measurements = np.array([4.0, 1.0, 0.0]), np.array([1.0, 1.0, 2.0]), 30.0, 8.0
    spent = (data / (data + prior)).sum()
    s2 = (10.0 + 2 * energy) / (10.0 + measurements - spent)
    found = covariance(np.diag(data), np.diag(prior), energy, measurements)
    assert found == pytest.approx(np.diag(1 / (data / s2 + prior)))
