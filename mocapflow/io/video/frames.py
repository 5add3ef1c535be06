"""From videos to frames: the pictures of all cameras at one moment, as their views have them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mocapflow.data import Frame
from mocapflow.io.cameras.views import View
from mocapflow.io.video.reading import Video, read_frames
from mocapflow.records import Bool


def decoded(views: Sequence[View], videos: Sequence[Video], indices: range, frame_rate: float) -> Iterator[Frame]:
    """Yield what videos show in frames of these numbers, as their cameras' views have it."""
    pictures, hidden = zip(*(read_frames(video, indices) for video in videos), strict=True), _hidden(views)
    for index, row in zip(indices, pictures, strict=True):
        usable = np.array([image is not None for image, _ in row])
        yield Frame(
            index=index,
            time=index / frame_rate,
            images=tuple(view.image(image) for view, (image, _) in zip(views, row, strict=True)),
            usable=usable,
            reasons=() if usable.all() else tuple(reason for _, reason in row),
            hidden=hidden,
        )


def _hidden(views: Sequence[View]) -> tuple[Bool, ...]:
    """Return where (H, W) occluders stand in each view; () where none is known in any."""
    if all(view.hidden is None for view in views):
        return ()
    nowhere = (np.zeros(view.camera.size[::-1], bool) for view in views)
    return tuple(none if view.hidden is None else view.hidden for view, none in zip(views, nowhere, strict=True))
