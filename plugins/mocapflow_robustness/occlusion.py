"""What stands before the scene: where pictures show nothing of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.records import U8, Bool
from mocapflow_robustness.events import Event


def occlusion_masks(events: Sequence[Event | None], images: Sequence[U8]) -> tuple[Bool, ...]:
    """Return where pictures (H, W, 3) are covered, (H, W) each; nothing where none is."""
    if not any(event is not None and event.what == "covered" for event in events):
        return ()
    hidden = [np.zeros(image.shape[:2], bool) for image in images]
    for event, mask in zip(events, hidden, strict=True):
        if event is not None and event.what == "covered":
            mask[event.first_covered(len(mask)) :] = True
    return tuple(hidden)


def union(before: Sequence[Bool], now: Sequence[Bool]) -> tuple[Bool, ...]:
    """Return where the scene is hidden in each view (H, W): where it was before, or is now; () for nowhere."""
    if not before or not now:
        return tuple(before or now)
    return tuple(one | other for one, other in zip(before, now, strict=True))
