"""Clean plates: pictures of the empty scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mocapflow.assets import Background, Camera
from mocapflow.data import Frame
from mocapflow.errors import RecordingError
from mocapflow.geometry.camera_rotation import Picture, shift_px, turn_between, warped
from mocapflow.io.cameras.views import View
from mocapflow.io.recording.layout import plates
from mocapflow.io.video.images import check_depth, read_sized
from mocapflow.records import F32, U8, Bool

LEAST_SPREAD = 1.0  # grey levels; the rounding of 8-bit pictures alone makes 0.3
USUAL_SPREAD = 4.0  # grey levels; where no frame can be compared with the plate
NORMAL = 1.4826  # standard deviation of a normal variable over its median absolute deviation
THIN = 4  # every so many-th pixel tells the tone of a frame
FITS = 8  # of a line to the pixels that agree with the last one
FARTHEST = 2.5  # standard deviations within which a pixel agrees
MOST_GAIN = 1.5  # between a plate and a frame of one recording
BLOCK = 8  # px, a side of the squares whose mean colours are looked at: noise has colours too
GREY, COLOURED = 6.0, 20.0  # grey levels between channels or blocks: no colour or contrast, codecs make 3; surely some
SAME_ROOM = 10.0  # grey levels, median difference of a frame and its toned plate: above, it shows something else


def background(folder: Path, views: Sequence[View], first: Callable[[], Frame]) -> Background | None:
    """Return the empty scene from background/<camera>.png or background/<camera>/*.png, None without plates.

    Plates take the brightness and contrast of the first frame: cameras drift, and a person dims a room. A plate of a
    camera that was nudged since is laid over the first frame; where it reaches beyond, the spread is inf. With one
    plate per camera the spread is one number per channel: the robust spread (1.4826 times the median absolute
    difference) of the first frame against it, which people in the picture hardly change. With several it is the larger
    of that of each pixel and its median over the picture.

    Args:
        folder: the recording.
        views: its cameras.
        first: reads the first frame, where there are plates; what is hidden in it does not tell.

    Raises:
        RecordingError: a camera has no plate though others do, or a plate has another size than the video,
            is far too dark, or in colour beside a grey video.
    """
    found = plate_files(folder, views)
    if not found:
        return None
    frame = first()
    pairs = enumerate(zip(found, views, strict=True))
    rows = [_statistics(files, view, frame, camera) for camera, (files, view) in pairs]
    mean, spread, turned = zip(*rows, strict=True)
    return Background(mean=mean, spread=spread, turned_px=turned)


def plate_files(folder: Path, views: Sequence[View]) -> list[tuple[Path, ...]]:
    """Return the clean plates of each camera, [] where none has any.

    Raises:
        RecordingError: a camera has none though others do, or two where one is expected.
    """
    found = [plates(folder, view.lens.name) for view in views]
    missing = [view.lens.name for view, files in zip(views, found, strict=True) if not files]
    if any(found) and missing:
        hint = "give every camera its plate, or remove the folder"
        raise RecordingError(f"no clean plate of {', '.join(missing)}", where=str(folder / "background"), hint=hint)
    return found if any(found) else []


def _statistics(files: Sequence[Path], view: View, first: Frame, camera: int) -> tuple[F32, F32, float]:
    """Return mean and spread (H, W, 3) of a camera's plates, and how far (px) it has turned since they were taken."""
    pictures = np.stack([view.image(_read(path, view)) for path in files]).astype(np.float32)
    frame, shown = first.images[camera].astype(np.float32), _shown(first, camera)
    pictures, known, turned_px = _laid_over(pictures, frame, shown, view.camera)
    mean, off = _compared(pictures.mean(axis=0), frame, shown & known, files[0])
    if len(files) > 1:
        each = pictures.std(axis=0, ddof=1)
        spread = np.maximum(each, np.median(each, axis=(0, 1)))
    else:
        spread = np.broadcast_to(NORMAL * np.median(off, axis=0), mean.shape)
    return mean, np.where(known[..., None], np.maximum(spread, LEAST_SPREAD), np.inf).astype(np.float32), turned_px


def _laid_over(plates: F32, frame: F32, shown: Bool, camera: Camera) -> tuple[F32, Bool, float]:
    """Return plates (N, H, W, 3) as the camera of a frame (H, W, 3) sees the room, where it is known, and px."""
    turn, mean = None, plates.mean(axis=0)
    if shown[::THIN, ::THIN].any():
        turn = turn_between(_levels(toned(mean, frame, shown)), _levels(frame), shown, camera)
    if turn is None or np.array_equal(turn, np.eye(3)):
        return plates, np.ones(shown.shape, bool), 0.0
    moved = [warped(plate, turn) for plate in plates]
    return np.stack([plate for plate, _ in moved]), moved[0][1], shift_px(turn, camera)


def _levels(picture: F32) -> U8:
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _shown(frame: Frame, camera: int) -> Bool:
    """Return which pixels (H, W) of a picture show the room, or somebody in it."""
    hidden, size = frame.hidden_in(camera), frame.images[camera].shape[:2]
    return np.full(size, frame.usable[camera]) if hidden is None else ~hidden & frame.usable[camera]


def _compared(plate: F32, frame: F32, shown: Bool, path: Path) -> tuple[F32, F32]:
    """Return a plate (H, W, 3) in the tone of the first frame, and how far pixels of that (N, 3) are off it."""
    usual = np.full((1, 3), USUAL_SPREAD / NORMAL, np.float32)
    if not shown[::THIN, ::THIN].any():
        return plate, usual
    matched, room, seen = toned(plate, frame, shown), blocks(plate), blocks(frame)
    if _is_blank(room, seen):
        return matched, usual
    _check_colours(room, seen, path)
    return matched, np.abs(frame - matched)[shown]


def toned(plate: F32, frame: F32, shown: Bool) -> F32:
    """Return a plate (H, W, 3) with each channel as bright and as rich in contrast as in a frame (H, W, 3).

    It goes by the pixels shown (H, W). A frame that is another picture altogether leaves the plate as it is.
    """
    thin = shown[::THIN, ::THIN]
    colours = (picture[::THIN, ::THIN][thin].T for picture in (plate, frame))
    lines = [_gain_and_offset(here, there) for here, there in zip(*colours, strict=True)]
    if any(line is None for line in lines):
        return plate
    gain, offset = np.array(lines, np.float32).T
    matched: F32 = plate * gain + offset
    return matched


def _gain_and_offset(here: F32, there: F32) -> tuple[float, float] | None:
    """Return gain and offset that take the room's grey levels from one picture to another, None: it is not the room.

    They are fitted to the pixels that agree with them, again and again; what stands before the room does not.
    """
    gain, offset = 1.0, float(np.median(there - here))
    for _ in range(FITS):
        off = np.abs(there - gain * here - offset)
        agrees = off <= max(FARTHEST * NORMAL * float(np.median(off)), LEAST_SPREAD)
        x, y = here[agrees], there[agrees]
        # a room of one grey level has no contrast to compare
        gain = float(np.mean((x - x.mean()) * (y - y.mean())) / x.var()) if x.var() > LEAST_SPREAD else 1.0
        offset = float(y.mean() - gain * x.mean())
    return (gain, offset) if 1 / MOST_GAIN < gain < MOST_GAIN and np.median(off) < SAME_ROOM else None


def _is_blank(room: F32, seen: F32) -> bool:
    """Return whether a frame is of one grey though the room, both in blocks, is not: many a camera begins so."""
    return bool(np.ptp(seen.mean(axis=2)) < GREY and np.ptp(room.mean(axis=2)) > COLOURED)


def _check_colours(room: F32, seen: F32, path: Path) -> None:
    """Refuse a plate in colour beside a grey video, both in blocks: nothing in it would look like the room."""
    coloured, grey = (float(np.percentile(np.ptp(blocks, axis=2), 99)) for blocks in (room, seen))
    if grey < GREY and coloured > COLOURED:
        hint = "film with the camera that took the plate, in colour; or give it a grey plate"
        raise RecordingError("this clean plate is in colour, the video is grey", where=str(path), hint=hint)


def blocks(picture: Picture, side_px: int = BLOCK) -> Picture:
    """Return the mean colours (h, w, 3) of the square blocks of a picture (H, W, 3)."""
    import cv2

    size = (max(picture.shape[1] // side_px, 1), max(picture.shape[0] // side_px, 1))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))


def _read(path: Path, view: View) -> U8:
    unread = "copy it again; without the folder the empty room is found from the videos"
    resized = "take it from the same camera at the same setting"
    image = read_sized(path, "clean plate", view.lens, unread=unread, resized=resized)
    check_depth(path)
    return image
