"""The energy and its descent: finite differences, length, curvature (T-LS1, T-LS3)."""

import numpy as np
from levelset_scenes import ellipse
from mocapflow_levelset.energy import curvature, delta, descent, energy, heaviside, length
from mocapflow_levelset.evolve import Settled, Weights, advance, costs, near
from mocapflow_levelset.redistance import redistance

SIGMA = 1.5


def circle(radius, size=160, x=80.2, y=79.6):
    rows, columns = np.mgrid[:size, :size]
    return radius - np.hypot(columns - x, rows - y)


def differences(value, level, step=1e-4):
    slope = np.empty_like(level)
    for index in np.ndindex(level.shape):
        moved = level.copy()
        moved[index] += step
        up = value(moved)
        moved[index] -= 2 * step
        slope[index] = (up - value(moved)) / (2 * step)
    return slope


def correlation(a, b):
    return np.corrcoef(a.ravel(), b.ravel())[0, 1]


def test_the_step_is_the_integral_of_its_slope():
    s = np.linspace(-8, 8, 4001)
    np.testing.assert_allclose(np.gradient(heaviside(s, SIGMA), s)[1:-1], delta(s, SIGMA)[1:-1], atol=1e-6)
    assert heaviside(np.zeros(1), SIGMA) == 0.5
    assert abs(delta(np.zeros(1), SIGMA)[0] - 0.266) < 1e-3


def test_descent_of_data_and_shape_is_the_negative_gradient():
    rng = np.random.default_rng(0)
    level, prior = circle(7.0, 22, 11, 10), circle(8.0, 22, 12, 10)
    inside, outside = rng.normal(size=(2, 22, 22))
    for shape_weight in (0.0, 0.05):

        def total(moved, shape_weight=shape_weight):
            return sum(energy(moved, inside, outside, prior, SIGMA, 0.0, shape_weight))

        flow = descent(level, inside - outside, prior, SIGMA, 0.0, shape_weight)
        gradient = differences(total, level)
        assert correlation(flow, -gradient) > 0.9999
        np.testing.assert_allclose(flow, -gradient, atol=1e-6)


def test_length_of_a_circle():
    assert abs(length(circle(60.3), SIGMA) / (2 * np.pi * 60.3) - 1) < 0.01


def test_curvature_of_a_circle():
    level = circle(40.0)
    at_contour = np.abs(level) < 1
    np.testing.assert_allclose(curvature(level)[at_contour], -1 / 40.0, rtol=0.05)


def test_curve_shortening():
    """With the slope of the step left out, r(t)^2 = r0^2 - 2 nu t."""
    nu, level = 0.2, circle(30.0, 90, 45, 45)
    for step in range(800):
        if step % 20 == 0:  # a step moves the contour by less than 0.01 px
            level = redistance(level.astype(np.float32), 12.0).astype(float)
        level = level + nu * np.clip(curvature(level), -1, 1)
    radius = np.sqrt((np.clip(redistance(level.astype(np.float32), 12.0), -0.5, 0.5) + 0.5).sum() / np.pi)
    assert abs(radius / np.sqrt(30.0**2 - 2 * nu * 800) - 1) < 0.01


def test_the_kernel_takes_the_step_of_the_equation():
    rng = np.random.default_rng(1)
    level, prior = ellipse(size=64, x=32, y=30, a=16, b=20), ellipse(size=64, x=34, y=30, a=16, b=20)
    level, prior = np.clip(level, -7, 7), np.clip(prior, -7, 7)
    ratio = rng.uniform(-6, 6, level.shape).astype(np.float32)
    weights = Weights(SIGMA, 0.5, 0.05, 6.0, 1.0, 7.0)
    runs = near(level, weights)
    moved = level.copy()
    advance(moved, ratio, prior, runs, np.empty_like(level), weights)
    push = delta(level, SIGMA) * (ratio + 0.5 * np.clip(curvature(level), -1, 1))
    wanted = (level + push + 2 * 0.05 * prior) / (1 + 2 * 0.05)  # the shape term is taken at the new time
    touched = np.abs(level) < 5
    np.testing.assert_allclose(moved[touched], wanted[touched], atol=2e-4)


def test_a_prior_beyond_the_band_pulls_no_harder_than_at_its_edge():
    level, weights = np.clip(circle(14.0, 48, 24, 23), -7, 7).astype(np.float32), Weights(SIGMA, 0.5, 0.05, 6, 1, 7.0)
    prior = np.where(np.arange(48) < 24, np.float32(30), np.float32(-30)) + np.zeros_like(level)
    still, runs, moved = np.zeros_like(level), near(level, weights), []
    for band in (np.inf, 7.0):
        moved.append(level.copy())
        advance(moved[-1], still, np.clip(prior, -band, band), runs, np.empty_like(level), weights)
    np.testing.assert_array_equal(*moved)
    assert np.abs(moved[0] - level).max() > 0.5
    everywhere = np.array([[y, 0, 48] for y in range(48)], np.int32)
    far, near_by = (costs(Settled(level, still, everywhere, np.clip(prior, -b, b)), weights) for b in (np.inf, 7.0))
    assert far.shape == near_by.shape > 0


def test_the_logged_costs_are_those_of_the_equation_but_for_what_is_outside_alone():
    """With an even p2: another one adds the same to the equation's data whatever the contour, and nothing here."""
    random = np.random.default_rng(3)
    level, prior = (np.clip(circle(r, 48, x, 23), -7, 7).astype(np.float32) for r, x in ((14, 24), (15, 26)))
    ratio = random.uniform(-2, 6, level.shape).astype(np.float32)
    everywhere = np.array([[y, 0, 48] for y in range(48)], np.int32)
    found = costs(Settled(level, ratio, everywhere, prior), Weights(SIGMA, 0.5, 0.05, 6.0, 1.0, 7.0))
    wanted = energy(level, ratio, np.zeros_like(ratio), prior, SIGMA, 0.5, 0.05)
    np.testing.assert_allclose(found, wanted, rtol=2e-3)
