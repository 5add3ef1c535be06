"""What differs from the empty room; how it tells of cameras that are late is tested with their synchrony."""

import numpy as np
import pytest

from mocapflow.geometry.epipolar import pencil_axes
from mocapflow.recordings.paired_views import _touching, foreground
from tests.fixtures.recordings import look_at


@pytest.mark.parametrize("change", [[26, 0, 0], [0, -26, 0], [0, 0, 26]])
def test_who_differs_in_one_colour_alone_is_seen(change):
    room = np.full((40, 60, 3), 100, np.float32)
    image = room.astype(np.uint8)
    image[10:30, 20:40] = 100 + np.array(change)
    image[5, 50] = 255  # noise of a pixel
    seen = foreground(image, room)
    assert seen[12:28, 22:38].all() and not seen[:9].any() and not seen[31:].any() and not seen[:, 41:].any()
    image[10:30, 20:40] = 100 + np.sign(change) * 25  # no more than may be noise
    assert not foreground(image, room).any()


FRONT, ABOVE, BESIDE = (look_at("a", np.array(place)) for place in ([4, 0, 1.5], [1, 0, 5.0], [0, 4, 1.5]))


@pytest.mark.parametrize(
    ("other", "box", "known"),
    [
        (ABOVE, (20, 10, 40, 30), 2),
        (ABOVE, (0, 10, 40, 30), 1),
        (ABOVE, (20, 10, 63, 30), 1),
        (BESIDE, (20, 10, 40, 30), 2),
        (BESIDE, (20, 0, 40, 30), 1),
        (BESIDE, (20, 10, 40, 47), 1),
    ],
)
def test_an_outline_that_the_picture_cuts_does_not_tell_where_the_person_ends(other, box, known):
    left, top, right, bottom = box
    outline = np.array([[left, top], [left, bottom], [right, top], [right, bottom]], float)
    (angles,) = _touching([outline], FRONT, pencil_axes(FRONT, other))
    assert np.isfinite(angles).sum() == known
