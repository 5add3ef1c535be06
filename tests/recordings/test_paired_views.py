"""What differs from the empty room; how it tells of cameras that are late is tested with their synchrony."""

import numpy as np
import pytest

from mocapflow.recordings.paired_views import foreground


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
