"""What a draper may do to a garment; how grids are sewn is tested with garments."""

import numpy as np

from mocapflow.geometry.sewing import force_parameters, widened, with_take_up


def test_cloth_tilts_to_both_sides_and_is_no_thinner_than_nothing():
    names, bounds = with_take_up(force_parameters((0, 1)))
    assert names == ("thickness_m", "flare_rad", "wind_cos_rad", "wind_sin_rad", "take_up")
    tilt = np.radians(40)
    np.testing.assert_allclose(bounds, [[0, 0.01], *[[-tilt, tilt]] * 3, [0, 0.15]])


def test_what_is_widened_is_told_with_both_measures():
    said = widened(waist_m=(0.7, 0.75), hip_m=(0.9, 0.9005), hem_m=(2.0, 1.9))
    assert said == ("waist_m 0.700 is tighter than the body; widened to 0.750",)
