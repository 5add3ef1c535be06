"""Coarser copies of images and level sets."""

import numpy as np
from mocapflow_levelset.crops import around, coarser, finer, pyramid, shrink, shrink_mask


def test_a_pixel_of_a_shrunken_array_is_the_mean_of_its_square():
    values = np.random.default_rng(0).uniform(size=(23, 14)).astype(np.float32)
    for factor in (2, 3, 4):
        height, width = 23 // factor, 14 // factor
        squares = values[: height * factor, : width * factor].reshape(height, factor, width, factor)
        np.testing.assert_allclose(shrink(values, factor), squares.mean(axis=(1, 3)), atol=1e-6)
        middles = squares[:, factor // 2, :, factor // 2] > 0.5  # a mask has the pixel in the middle
        np.testing.assert_array_equal(shrink_mask(values > 0.5, factor), middles)


def test_an_image_is_rounded_by_no_more_than_a_level():
    image = np.random.default_rng(1).integers(0, 256, (20, 16, 3)).astype(np.uint8)
    exact = image.reshape(5, 4, 4, 4, 3).mean(axis=(1, 3))
    assert np.abs(shrink(image, 4) - exact).max() <= 1.0
    assert np.abs((shrink(image, 4) - exact).mean()) < 0.3


def test_a_pyramid_holds_what_shrinking_gives():
    image = np.random.default_rng(2).integers(0, 256, (24, 16, 3)).astype(np.uint8)
    images = pyramid(image, (4, 2, 1))
    assert sorted(images) == [1, 2, 4]
    for factor, small in images.items():
        np.testing.assert_array_equal(small, shrink(image, factor))


def test_a_straight_edge_stays_where_it_is():
    row, column = np.mgrid[:32, :32].astype(np.float32)
    level = 0.6 * (column - 15.5) + 0.8 * (row - 15.5)
    small = coarser(level, 4)
    assert small.shape == (8, 8)
    np.testing.assert_allclose(finer(small, 4)[4:-4, 4:-4], level[4:-4, 4:-4], atol=1e-4)


def test_a_crop_ends_at_multiples_within_the_image():
    level = np.full((23, 14), -1, np.float32)
    assert around(level, 2, 4) is None
    level[19, 12] = 1
    assert around(level, 0, 1) == (19, 20, 12, 13)
    assert around(level, 2, 4) == (16, 20, 8, 12)
