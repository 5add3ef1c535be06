"""Folders of images that are numbered by frame."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.paths import for_opencv
from mocapflow.records import U8

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
DARK = 8192  # of 65535: a picture of 16 bits a pixel that reaches no more holds the 10 or 12 bits of a camera
NAMED = 5  # frames that a message lists
SPARSE = 1000  # frames for each image of a folder, above which the numbers are no frames


def numbered(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    """Return the files of a folder by frame number: the last run of digits in the name; hidden files are left out.

    Raises:
        RecordingError: two files have one number.
    """
    found: dict[int, Path] = {}
    for path in sorted(folder.iterdir()):
        digits = re.findall(r"\d+", path.stem)
        if not digits or path.suffix.lower() not in suffixes or path.name.startswith("."):
            continue
        if (other := found.setdefault(int(digits[-1]), path)) != path:
            hint = (
                "the last digits of a name are its frame, as in cam01_000012.png: rename the files, "
                "or remove those that are too many"
            )
            message = f"two files for frame {int(digits[-1])}: {other.name}, {path.name}"
            raise RecordingError(message, where=str(folder), hint=hint)
    return found


def read_image(path: Path) -> U8 | None:
    """Return an image (H, W, 3) BGR, or None where it can't be read; a JPEG that is cut off would end in grey."""
    import cv2

    try:
        data = path.read_bytes()
    except OSError:
        return None
    cut = data.startswith(b"\xff\xd8") and data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda")  # no end after the scan
    image = None if cut or not data else cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return None if image is None else np.asarray(image, np.uint8)


def read_sized(path: Path, what: str, camera: Camera, *, unread: str, resized: str) -> U8:
    """Return a picture (H, W, 3) BGR of the size of a camera's video; `what` it is called, and hints for people.

    Raises:
        RecordingError: it can't be read, or has another size.
    """
    image = read_image(path)
    if image is None:
        raise RecordingError(f"this {what} can't be read", where=str(path), hint=unread)
    (height, width), size = image.shape[:2], camera.size.tolist()
    if [width, height] != size:
        message = f"this {what} is {width} x {height} px, the video {size[0]} x {size[1]}"
        raise RecordingError(message, where=str(path), hint=resized)
    return image


def check_numbers(files: Mapping[int, Path], folder: Path) -> None:
    """Check that the images of a folder are numbered by frame and not by time.

    Raises:
        RecordingError: they are.
    """
    last = max(files)
    if last > SPARSE * (len(files) + NAMED):  # else every missing frame would be named
        hint = "the last digits of a name are its frame, not its time or date: rename to 000000.png, 000001.png"
        message = f"{len(files)} images, and {files[last].name} would be frame {last}"
        raise RecordingError(message, where=str(folder), hint=hint)


def check_depth(path: Path) -> None:
    """Check that a picture of 16 bits a pixel uses them: of the higher 8, which are taken, nearly all would be 0.

    Raises:
        RecordingError: it does not.
    """
    import cv2

    image = cv2.imread(for_opencv(path), cv2.IMREAD_UNCHANGED)
    if image is not None and image.dtype == np.uint16 and 0 < image.max() < DARK:
        hint = "save it as 8 bits, or multiply its values so that they use all 16: 12 bits by 16, 10 bits by 64"
        message = f"a picture of 16 bits a pixel that reaches {image.max()} of 65535: as 8 bits it is nearly black"
        raise RecordingError(message, where=str(path), hint=hint)


def name_frames(indices: Sequence[int]) -> str:
    """Return e.g. `frames 3, 4, 9 and 20 more`."""
    first = ", ".join(str(index) for index in indices[:NAMED])
    more = f" and {len(indices) - NAMED} more" if len(indices) > NAMED else ""
    return f"{'frame' if len(indices) == 1 else 'frames'} {first}{more}"
