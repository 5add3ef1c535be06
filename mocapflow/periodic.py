"""What is done every so often in a sequence: by times alone, so that a resumed run does it in the same frames."""

from __future__ import annotations

import math

EARLY = 1e-6  # share of a period by which a frame may come too early: rounding


def falls_due(last_s: float, now_s: float, every_s: float) -> bool:
    """Return whether a multiple of `every_s` has been reached since the frame before, which was at `last_s`."""
    return math.floor(now_s / every_s + EARLY) > math.floor(last_s / every_s + EARLY)
