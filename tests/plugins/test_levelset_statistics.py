"""Local Gaussian statistics against brute force (T-LS2), and the feature channels."""

import numpy as np
from levelset_scenes import ellipse, from_features, ramp_scene
from mocapflow_levelset import front_kernels as kernels
from mocapflow_levelset.channels import features
from mocapflow_levelset.energy import heaviside
from mocapflow_levelset.evolve import Weights, log_ratio, near
from mocapflow_levelset.statistics import Window, local_gaussians, totals

SIGMA = 1.5
ONES = np.ones((160, 160), np.float32)
FAINT = 1e-3  # share of the window at which local and global statistics count the same


def brute_force(planes, share, row, column, rho, floor):
    """Return mean and variance (C,) of a region at a pixel, blended to the global ones as specified."""
    rows, columns = np.mgrid[: share.shape[0], : share.shape[1]]
    reach = int(np.ceil(3 * rho))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / rho) ** 2)
    total = kernel.sum() ** 2
    near_pixels = (abs(rows - row) <= reach) & (abs(columns - column) <= reach)
    weight = share * near_pixels * np.exp(-0.5 * ((rows - row) ** 2 + (columns - column) ** 2) / rho**2) / total
    trust = weight.sum() / (weight.sum() + FAINT)
    means, variances = [], []
    for plane in planes.astype(float):
        local = (weight * plane).sum() / weight.sum()
        spread = (weight * plane**2).sum() / weight.sum() - local**2
        everywhere = (share * plane).sum() / share.sum()
        wide = (share * plane**2).sum() / share.sum() - everywhere**2
        means.append(trust * local + (1 - trust) * everywhere)
        variances.append(max(trust * spread + (1 - trust) * wide, floor**2))
    return np.array(means), np.array(variances)


def test_windowed_statistics_equal_brute_force():
    planes, _ = ramp_scene()
    level, window = ellipse(), Window(6.0, 1, 0.02)
    found = local_gaussians(planes, ONES, level, totals(planes, ONES, 1), window, SIGMA)
    inside = heaviside(level, SIGMA)
    for row, column in ((80, 43), (30, 80), (100, 110)):
        for region, share in enumerate((inside, 1 - inside)):
            mean, variance = brute_force(planes, share, row, column, 6.0, 0.02)
            got = found[row, column, region]
            np.testing.assert_allclose(got[1:4], mean, atol=2e-4)
            np.testing.assert_allclose(0.5 / got[4:], variance, rtol=0.02)
            np.testing.assert_allclose(got[0], -0.5 * np.log(2 * np.pi * variance).sum(), atol=0.05)


def test_coarse_cells_give_nearly_the_same():
    planes, _ = ramp_scene()
    level = ellipse()
    weights = Weights(SIGMA, 0.5, 0.0, 50.0, 1.0, 7.0)
    ratios = []
    for cell in (1, 8):
        window = Window(12.0, cell, 0.02)
        gaussians = local_gaussians(planes, ONES, level, totals(planes, ONES, cell), window, SIGMA)
        ratio = np.zeros_like(level)
        runs = near(level, weights, (cell - 1) // 2)
        log_ratio(runs, from_features(planes, ONES), gaussians, cell, weights, ratio)
        ratios.append(ratio[np.abs(level) < 4])
    assert np.sqrt(np.mean((ratios[0] - ratios[1]) ** 2)) < 0.06 * ratios[0].std()


def test_known_gaussians_give_the_known_ratio():
    """Two channels, one Gaussian per region: the log ratio is that of the textbook."""
    rng = np.random.default_rng(2)
    level = ellipse()
    inside = level > 0
    planes = np.empty((2, *level.shape), np.float32)
    known = np.zeros_like(level)
    for region, means, spreads in ((inside, (0.4, 0.5), (0.05, 0.08)), (~inside, (0.55, 0.45), (0.07, 0.04))):
        for c in (0, 1):
            drawn = rng.standard_normal(region.sum())
            drawn = (drawn - drawn.mean()) / drawn.std()  # so that the sample has exactly these moments
            planes[c][region] = means[c] + spreads[c] * drawn
    for sign, means, spreads in ((1, (0.4, 0.5), (0.05, 0.08)), (-1, (0.55, 0.45), (0.07, 0.04))):
        for c in (0, 1):
            known += sign * (-0.5 * ((planes[c] - means[c]) / spreads[c]) ** 2 - np.log(spreads[c]))
    window = Window(np.inf, 1, 0.02)
    hard = np.where(inside, np.float32(12), np.float32(-12))  # so that the smooth step is 0 or 1
    gaussians = local_gaussians(planes, ONES, hard, totals(planes, ONES, 1), window, SIGMA)
    ratio = np.zeros_like(level)
    weights = Weights(SIGMA, 0.5, 0.0, 100.0, 1.0, 7.0)
    runs = near(level, weights)
    log_ratio(runs, from_features(planes, ONES), gaussians, 1, weights, ratio)
    at = np.abs(level) < 4
    np.testing.assert_allclose(ratio[at], known[at], rtol=1e-3, atol=5e-3)


def test_a_region_that_a_window_hardly_holds_has_its_global_statistics():
    """Far inside, the window has 0.2 % of the room in it: that is trusted to two thirds."""
    planes, _ = ramp_scene()
    level, window = ellipse(), Window(12.0, 1, 0.02)
    found = local_gaussians(planes, ONES, level, totals(planes, ONES, 1), window, SIGMA)
    outside = 1 - heaviside(level, SIGMA)
    mean, variance = brute_force(planes, outside, 80, 76, 12.0, 0.02)
    np.testing.assert_allclose(found[80, 76, 1, 1:4], mean, atol=2e-4)
    np.testing.assert_allclose(0.5 / found[80, 76, 1, 4:], variance, rtol=0.02)


def test_beside_a_known_room_the_persons_density_has_a_least_value():
    """A colour that nobody has yet worn is no proof of the room: there its density is at least `any_colour`."""
    gaussians = np.zeros((1, 1, 2, 3), np.float32)
    gaussians[0, 0, 0] = 0.0, 0.5, 400.0  # of the person: mean 0.5, and 400 (F - 0.5)^2 below zero
    values, runs = np.array([[0.5, 0.6, 0.8, 1.0]], np.float32), np.array([[0, 0, 4]], np.int32)
    outside = np.array([-2.0, -2.0, -2.0, -9.0], np.float32)
    weight, found = np.ones((1, 4), np.float32), np.zeros((1, 4), np.float32)
    zero, bounds = np.float32(0), (np.float32(6), np.float32(-4))
    kernels.log_ratio(runs, values, weight, outside, True, gaussians, 1, zero, *bounds, found)
    np.testing.assert_allclose(found[0], [2.0, -2.0, -2.0, 5.0], atol=1e-4)
    gaussians[0, 0, 1] = -2.0, 0.0, 0.0  # of a room that is not known: there is no least value
    kernels.log_ratio(runs, values, weight, outside[:0], False, gaussians, 1, zero, *bounds, found)
    np.testing.assert_allclose(found[0], [2.0, -2.0, -6.0, -6.0], atol=1e-4)
    outside[2:] = np.nan  # nor where nobody knows it, beside where it is known
    kernels.log_ratio(runs, values, weight, outside, True, gaussians, 1, zero, *bounds, found)
    np.testing.assert_allclose(found[0], [2.0, -2.0, -6.0, -6.0], atol=1e-4)


def test_masked_pixels_do_not_count():
    planes, _ = ramp_scene()
    level, weight = ellipse(), np.ones((160, 160), np.float32)
    weight[:, 100:] = 0
    spoilt = planes.copy()
    spoilt[:, :, 100:] = 1
    window = Window(12.0, 4, 0.02)
    clean = local_gaussians(planes, weight, level, totals(planes, weight, 4), window, SIGMA)
    same = local_gaussians(spoilt, weight, level, totals(spoilt, weight, 4), window, SIGMA)
    np.testing.assert_array_equal(clean, same)


def test_channels_are_in_range():
    image = np.random.default_rng(0).integers(0, 256, (40, 50, 3), dtype=np.uint8)
    planes = features(image, ("grey", "lab", "texture"))
    assert planes.shape == (7, 40, 50) and planes.dtype == np.float32
    assert planes.min() >= 0 and planes.max() <= 1


def test_texture_tells_stripes_from_their_mean():
    rows, columns = np.mgrid[:60, :60]
    grey = np.where(columns < 30, 128, 128 + 60 * (rows % 4 < 2) - 30).astype(np.uint8)
    texture = features(np.repeat(grey[..., None], 3, axis=2), ("texture",))
    assert texture[1, 20:40, 40:55].mean() > 4 * texture[1, 20:40, 5:20].mean() + 0.05
