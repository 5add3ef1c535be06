"""Lines on images, and videos frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.errors import StoreError
from mocapflow.io.atomic import atomic_write
from mocapflow.io.paths import for_opencv
from mocapflow.records import F64, U8

Colour = tuple[int, int, int]  # BGR

BODY: Colour = (90, 230, 60)
CLOTH: Colour = (235, 90, 235)
BONE: Colour = (60, 200, 255)
JOINT: Colour = (255, 255, 255)
SUBPIXEL = 4  # bits
FARTHEST = 1e4  # px off the image that OpenCV can be asked to draw at; what is not known (NaN) is no nearer


def segments(image: U8, ends: F64, colour: Colour, thickness: int = 1) -> None:
    """Draw line segments (B, 2, 2) px into an image; those that are not finite are left out."""
    import cv2

    kept = ends[(np.abs(ends) < FARTHEST).all((1, 2))]
    lines = np.round(kept * 2**SUBPIXEL).astype(np.int32)
    cv2.polylines(image, list(lines[:, :, None]), False, colour, thickness, cv2.LINE_AA, SUBPIXEL)


def dots(image: U8, places: F64, colour: Colour, radius: float) -> None:
    """Draw filled circles at pixels (K, 2); those that are not finite are left out."""
    import cv2

    for x, y in places[(np.abs(places) < FARTHEST).all(1)]:
        at = (round(x * 2**SUBPIXEL), round(y * 2**SUBPIXEL))
        cv2.circle(image, at, round(radius * 2**SUBPIXEL), colour, -1, cv2.LINE_AA, SUBPIXEL)


def label(image: U8, text: str, line: int = 0) -> None:
    """Write text into the upper left corner, readable on any ground."""
    size = _text_size(image)
    note(image, text, (18 * size, (44 + 44 * line) * size))


def note(image: U8, text: str, place: tuple[float, float]) -> None:
    """Write text whose lower left corner is at a place in px, readable on any ground."""
    import cv2

    size = _text_size(image)
    width = max(1, round(1.6 * size))
    for colour, shift in (((0, 0, 0), width), ((255, 255, 255), 0)):
        at = (round(place[0]) + shift, round(place[1]) + shift)
        cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, colour, width, cv2.LINE_AA)


def _text_size(image: U8) -> float:
    return float(0.45 * max(1.0, image.shape[0] / 800))


def bones(parents: Any, places: F64) -> F64:
    """Return the segments (B, 2, K) from each joint's parent to the joint, of joint places (J, K)."""
    children = np.flatnonzero(np.asarray(parents) >= 0)
    return np.stack([places[np.asarray(parents)[children]], places[children]], axis=1)


class Video:
    """A video file being written; every image must have the same size."""

    def __init__(self, path: Path, frame_rate: float, codec: str) -> None:
        self._path, self._frame_rate, self._codec = path, frame_rate, codec
        self._writer: Any = None

    def write(self, image: U8) -> None:
        """Append an image (H, W, 3) BGR.

        Raises:
            StoreError: the file can't be written with this codec.
        """
        import cv2

        if self._writer is None:
            size = (image.shape[1], image.shape[0])
            self._writer = cv2.VideoWriter(
                for_opencv(self._path), cv2.VideoWriter.fourcc(*self._codec), self._frame_rate, size
            )
            if not self._writer.isOpened():
                hint = "is the folder writable? this build of OpenCV may lack the codec: mp4v is always there"
                folder = str(self._path.parent)  # people do not know the file by the name that it has yet
                raise StoreError(f"can't write a video with codec {self._codec}", where=folder, hint=hint)
        self._writer.write(image)

    def close(self) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._writer.release()

    def finish(self) -> None:
        """Finish the file and see that it can be read: OpenCV does not tell of a full drive.

        Raises:
            StoreError: it can't.
        """
        import cv2

        self.close()
        if self._writer is None:
            return
        if not cv2.VideoCapture(for_opencv(self._path)).isOpened():
            where = str(self._path.parent)
            raise StoreError("a video is not whole after it was written", where=where, hint="is the drive full?")


@contextmanager
def videos(paths: list[Path], frame_rate: float, codec: str) -> Iterator[list[Video]]:
    """Open videos for writing; they come in their places when all frames are written, or not at all."""
    with ExitStack() as open_files:
        parts = [open_files.enter_context(atomic_write(path)) for path in paths]
        files = [open_files.enter_context(closing(Video(part, frame_rate, codec))) for part in parts]
        yield files
        for file in files:
            file.finish()
