"""BGR colours of pixels in coarse bins, for histograms of what a layer or a room has shown."""

from __future__ import annotations

import numba
import numpy as np

from mocapflow.records import I32, U8

SIDE = 16  # bins of a channel
BINS = SIDE**3
WIDTH = 256 // SIDE  # grey levels in a bin


def bins_of(pixels: U8) -> I32:
    """Return the bin (...,) of BGR pixels (..., 3)."""
    level = (pixels // WIDTH).astype(np.int32)
    return np.asarray((level[..., 0] * SIDE + level[..., 1]) * SIDE + level[..., 2], np.int32)


@numba.njit(cache=True)
def bin_at(image, row, column):  # type: ignore[no-untyped-def]
    """Return the bin of one pixel of a BGR image (H, W, 3)."""
    blue, green, red = image[row, column, 0] // WIDTH, image[row, column, 1] // WIDTH, image[row, column, 2] // WIDTH
    return (np.int64(blue) * SIDE + green) * SIDE + red
