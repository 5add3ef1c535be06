"""What a draper may do to a garment; how grids are sewn is tested with garments."""

import numpy as np
import pytest

from mocapflow.geometry.sewing import force_parameters, sheet, widened, with_take_up
from mocapflow.testing.bodies import tiny_body


def test_cloth_tilts_to_both_sides_and_is_no_thinner_than_nothing():
    names, bounds = with_take_up(force_parameters((0, 1)))
    assert names == ("thickness_m", "flare_rad", "wind_cos_rad", "wind_sin_rad", "take_up")
    tilt = np.radians(40)
    np.testing.assert_allclose(bounds, [[0, 0.01], *[[-tilt, tilt]] * 3, [0, 0.15]])


def test_what_is_widened_is_told_with_both_measures():
    said = widened(waist_m=(0.7, 0.75), hip_m=(0.9, 0.9005), hem_m=(2.0, 1.9))
    assert said == ("waist_m 0.700 is tighter than the body; widened to 0.750",)


@pytest.mark.parametrize(("closed", "gaps"), [(True, 4), (False, 3)])
def test_rows_get_the_length_that_is_wanted_of_them_from_end_to_end(closed, gaps):
    """Four strands of two points: a tube has a link more than a sheet in each row."""
    rows = np.random.default_rng(0).uniform(size=(4, 2, 3))
    garment = sheet("g", tiny_body(), rows, closed=closed, around=np.array([1.2, 0.6]))
    assert len(garment.rings) == 2 * gaps
    np.testing.assert_allclose(garment.ring_length, np.repeat([1.2 / gaps, 0.6 / gaps], gaps))
    row = garment.rings % 2  # strands are numbered one after another
    np.testing.assert_array_equal(row, np.repeat([[0, 0], [1, 1]], gaps, axis=0))
