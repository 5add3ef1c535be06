"""The empty scene as a density, lit or along the ray to black, and what of an image is compared with it."""

import numpy as np
import pytest
from mocapflow_levelset.channels import PLANES, features
from mocapflow_levelset.colours import bin_at, bins_of
from mocapflow_levelset.evidence import Room, from_image, in_room, smoothed
from mocapflow_levelset.masks import counted
from mocapflow_levelset.plates import (
    BENDING,
    BLACK,
    TINT,
    USUAL,
    Plate,
    Shadow,
    density_image,
    density_of,
    plate_of,
    squared_deviations,
)
from scipy.stats import norm

SHADOW = Shadow(least_sd=0.012, share=0.2, darkest=0.5, chroma=0.005)
RAY = np.array([0.8, 0.03, -0.04])  # from black to the plate's colour, in lab channels
COLOUR = RAY + BLACK
ACROSS = np.hypot(SHADOW.chroma, BENDING * 0.05)  # standard deviation off the ray: its chroma is 0.05
ASIDE = np.array([0.0, 0.8, 0.6])  # perpendicular to it
RUNS = np.array([[2, 1, 9], [7, 0, 5]], np.int32)


def density(colour, floor=True, spread=0.02, shadow=SHADOW, grey=None):
    """Return the log density of one pixel; with a grey channel before its colour, so far from the plate's."""
    channels = ("lab",) if grey is None else ("grey", "lab")
    values, plate = (np.array([*([] if grey is None else [extra]), *c]) for c, extra in ((colour, grey), (COLOUR, 0.0)))
    columns = (each[:, None].astype(np.float32) for each in (values, plate))
    return density_of(*columns, np.array([spread], np.float32), np.array([floor]), channels, shadow)[0]


@pytest.mark.parametrize(("spread", "sd"), [(0.02, 0.02), (0.001, 0.012)])
def test_a_lit_pixel_is_as_likely_as_noise_makes_it(spread, sd):
    """Tints scatter less than lightness, those of strong colours more; one that fits is no likelier for it."""
    tint = np.hypot(TINT * sd, BENDING * 0.05)
    off = np.array([0.6, -1.0, 0.5])
    expected = norm.logpdf([off[0] * sd, *(off[1:] * sd * sd / tint)], scale=sd).sum()
    off *= sd
    assert density(COLOUR + off, floor=False, spread=spread) == pytest.approx(expected, rel=1e-4)
    both = density(COLOUR + off, floor=False, spread=spread, grey=0.7 * sd)
    assert both == pytest.approx(expected + norm.logpdf(0.7 * sd, scale=sd), rel=1e-4)


def test_a_sock_as_light_as_the_floor_is_told_by_its_tint():
    """Ten of 255 levels: three standard deviations of lightness, five of a tint."""
    yellow, light = np.array([0, 0, 10 / 255]), np.array([10 / 255, 0, 0])
    assert density(COLOUR - yellow, floor=False, spread=0.012) < 0 < density(COLOUR - light, floor=False, spread=0.012)


@pytest.mark.parametrize("channels", [("lab",), ("grey", "lab"), ("grey",)], ids=str)
def test_squared_deviations_are_what_the_density_falls_by(channels):
    rng = np.random.default_rng(4)
    planes = rng.uniform(0.3, 0.7, (sum(PLANES[name] for name in channels), 5, 6)).astype(np.float32)
    plate = Plate(planes, np.full((5, 6), 0.03, np.float32))
    values = (planes + rng.normal(0, 0.02, planes.shape)).astype(np.float32)
    dark = np.zeros((5, 6), bool)
    fall = density_image(planes, plate, dark, channels, USUAL) - density_image(values, plate, dark, channels, USUAL)
    np.testing.assert_allclose(squared_deviations(values, plate, channels) / 2, fall, atol=1e-4)


@pytest.mark.parametrize("aside", [0.0, 0.004])
def test_a_shadow_lies_anywhere_on_the_ray_and_hardly_beside_it(aside):
    """Uniform from its darkest to the plate's own colour, as likely as its share, and Gaussian across."""
    along = np.log(SHADOW.share / (0.5 * np.linalg.norm(RAY)))
    expected = along + norm.logpdf(aside, scale=ACROSS) + norm.logpdf(0, scale=ACROSS)
    for k in (0.55, 0.7, 0.9):
        assert density(BLACK + k * RAY + aside * ASIDE) == pytest.approx(expected, rel=1e-3)
    other = density(BLACK + 0.7 * RAY + aside * ASIDE, grey=0.03)  # in the dark a grey level is what it is when lit
    assert other == pytest.approx(expected + norm.logpdf(0.03, scale=0.02), rel=1e-3)


@pytest.mark.parametrize(("k", "off"), [(0.47, 0.03), (1.04, 0.04)])
def test_what_is_darker_than_a_shadow_or_brighter_than_the_plate_is_less_likely(k, off):
    on_it = density(BLACK + 0.7 * RAY)
    beyond = norm.logpdf(off * np.linalg.norm(RAY), scale=0.05) - norm.logpdf(0, scale=0.05)
    assert density(BLACK + k * RAY, spread=0.05) == pytest.approx(on_it + beyond, rel=1e-3)


def test_where_no_shadow_may_fall_or_none_is_looked_for_the_dark_is_a_stranger():
    dark = BLACK + 0.7 * RAY
    assert [density(dark, floor=False), density(dark, shadow=SHADOW._replace(share=0.0))] == [-6, -6]
    assert np.isnan(density(COLOUR, spread=np.inf))  # nobody knows the room there


def test_a_plate_s_spread_is_the_root_mean_square_over_its_colours():
    mean = np.broadcast_to(np.float32([40, 80, 300]), (4, 4, 3)).astype(np.float32)
    spread = np.broadcast_to(np.float32([3, 4, 0]), (4, 4, 3)).astype(np.float32)
    for factor in (1, 2):
        plate = plate_of(mean, spread, ("lab",), factor)
        np.testing.assert_allclose(plate.spread, np.full((4 // factor,) * 2, np.sqrt(25 / 3) / 255), rtol=1e-6)
    np.testing.assert_array_equal(plate.planes, features(np.full((2, 2, 3), (40, 80, 255), np.uint8), ("lab",)))


def along_runs(image):
    return np.concatenate([image[..., y, first:last] for y, first, last in RUNS], axis=-1)


def picture():
    return np.random.default_rng(3).integers(60, 200, (10, 12, 3)).astype(np.uint8)


@pytest.mark.parametrize("channels", [("lab",), ("grey", "chromaticity"), ("lab", "texture")], ids=str)
def test_features_along_runs_are_those_of_the_whole_image(channels):
    image = picture()
    found, planes = from_image(image, np.ones(image.shape[:2], np.float32), channels, 3), features(image, channels)
    np.testing.assert_allclose(found.along(RUNS), along_runs(planes), atol=1e-6)
    np.testing.assert_allclose(found.sparse, planes[:, ::3, ::3], atol=1e-6)


def test_decorrelated_features_along_runs_are_those_of_the_grid():
    image, weight = picture(), np.ones((10, 12), np.float32)
    found, plain = (from_image(image, weight, ("lab",), 1, turned) for turned in (True, False))
    assert found.weight is weight and not np.allclose(found.sparse, plain.sparse, atol=0.01)
    np.testing.assert_allclose(found.along(RUNS), along_runs(found.sparse), atol=1e-6)


def test_a_colour_has_one_bin_for_pictures_and_for_pixels():
    image = picture()
    found = bins_of(image)
    assert bins_of(np.array([20, 35, 255], np.uint8)) == (1 * 16 + 2) * 16 + 15
    np.testing.assert_array_equal(found, [[bin_at(image, row, column) for column in range(12)] for row in range(10)])


def test_what_is_hidden_and_the_border_do_not_count():
    hidden = np.zeros((5, 7), bool)
    hidden[2, 3] = True
    assert np.argwhere(~counted((5, 7), 2, hidden)[2:-2, 2:-2]).tolist() == [[0, 1]]
    assert counted((5, 7), 2).sum() == 3 and counted((5, 7), 0).all()


@pytest.mark.parametrize("smooth_px", [0.0, 1.5])
def test_a_room_is_compared_with_the_smoothed_image(smooth_px):
    room, floor = picture(), np.arange(12) % 2 == 0
    assert (smoothed(room, 0.0) == room).all() and (smoothed(room, 1.0) != room).any()
    plate = plate_of(room.astype(np.float32), np.full(room.shape, 5, np.float32), ("lab",))
    image = (0.8 * smoothed(room, 1.0)).astype(np.uint8)
    floor = np.broadcast_to(floor, image.shape[:2]).copy()
    seen = from_image(image, np.ones(image.shape[:2], np.float32), ("lab",), 1)
    found = in_room(seen, image, ("lab",), Room(plate, floor, SHADOW, smooth_px)).outside
    values = features(smoothed(image, smooth_px), ("lab",))
    parts = (along_runs(each) for each in (values, plate.planes, plate.spread, floor))
    np.testing.assert_allclose(found(RUNS, seen.along(RUNS)), density_of(*parts, ("lab",), SHADOW), rtol=1e-5)
