"""Occluders: furniture between a camera and the person, painted white on black by whoever has filmed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.recording.layout import occluders
from mocapflow.io.video.images import read_sized
from mocapflow.records import Bool

WHITE = 128  # grey level from which on a pixel is painted: editors soften edges
MOST = 0.95  # share of a picture that may be hidden: of a camera that shows less nothing can be told


def occluder(folder: Path, lens: Camera) -> Bool | None:
    """Return where (H, W) something stands before what a camera looks at; None: nowhere, for nobody has said.

    Args:
        folder: the recording; occluders/<camera>.png is white where something stands.
        lens: the camera, of its video's real size.

    Raises:
        RecordingError: the picture can't be read, has another size than the video, or hides nearly everything.
    """
    found = occluders(folder, [lens])
    if not found:
        return None
    path = found[0]
    resized = "paint on a frame of the video, in its full size"
    image = read_sized(path, "picture of occluders", lens, unread="save it again, as PNG", resized=resized)
    hidden: Bool = image.max(axis=2) >= WHITE
    if hidden.mean() > MOST:
        hint = "white is what stands before the person, black is what the camera sees: is it the other way round?"
        raise RecordingError(f"{hidden.mean():.0%} of this picture of occluders are white", where=str(path), hint=hint)
    return np.asarray(hidden)
