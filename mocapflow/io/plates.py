"""Clean plates: pictures of the empty scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocapflow.assets import Background
from mocapflow.errors import RecordingError
from mocapflow.io.folders import plates
from mocapflow.io.lenses import View
from mocapflow.io.video import Video, read_frames
from mocapflow.records import F32, U8

LEAST_SPREAD = 1.0  # grey levels; the rounding of 8-bit pictures alone makes 0.3
USUAL_SPREAD = 4.0  # grey levels; where no frame can be compared with the plate


def background(folder: Path, views: Sequence[View], videos: Sequence[Video]) -> Background | None:
    """Return the empty scene from background/<camera>.png or background/<camera>/*.png, None without plates.

    With one plate per camera the spread is one number per channel: the robust spread (1.4826 times the median
    absolute difference) of the first frame against the plate, which people in the picture hardly change. With
    several it is the larger of that of each pixel and its median over the picture.

    Raises:
        RecordingError: a camera has no plate though others do, or a plate has another size than the video.
    """
    found = [plates(folder, view.lens.name) for view in views]
    if not any(found):
        return None
    missing = [view.lens.name for view, files in zip(views, found, strict=True) if not files]
    if missing:
        raise RecordingError(
            f"no clean plate of {', '.join(missing)}",
            where=str(folder / "background"),
            hint="give every camera its plate, or remove the folder",
        )
    rows = [_one(files, view, video) for files, view, video in zip(found, views, videos, strict=True)]
    return Background(mean=tuple(mean for mean, _ in rows), spread=tuple(spread for _, spread in rows))


def _one(files: Sequence[Path], view: View, video: Video) -> tuple[F32, F32]:
    pictures = np.stack([view.image(_read(path, view)) for path in files]).astype(np.float32)
    mean = pictures.mean(axis=0)
    if len(files) > 1:
        each = pictures.std(axis=0, ddof=1)
        spread = np.maximum(each, np.median(each, axis=(0, 1)))
    else:
        first, _ = next(read_frames(video, range(1)))
        difference = np.full((1, 1, 3), USUAL_SPREAD / 1.4826) if first is None else np.abs(view.image(first) - mean)
        spread = np.broadcast_to(1.4826 * np.median(difference, axis=(0, 1)), mean.shape)
    return mean, np.maximum(spread, LEAST_SPREAD).astype(np.float32)


def _read(path: Path, view: View) -> U8:
    import cv2

    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        hint = "copy it again; without the folder the empty room is found from the videos"
        raise RecordingError("this clean plate can't be read", where=str(path), hint=hint)
    width, height = (int(n) for n in view.lens.size)
    if image.shape[:2] != (height, width):
        raise RecordingError(
            f"this clean plate is {image.shape[1]} x {image.shape[0]} px, the video {width} x {height}",
            where=str(path),
            hint="take it from the same camera at the same setting",
        )
    return np.asarray(image, np.uint8)
