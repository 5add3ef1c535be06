"""What a recording folder holds, and whether its parts agree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.cameras import find_calibration, metadata, read_cameras
from mocapflow.io.keypoints import odd_keypoints
from mocapflow.io.timing import late_frames
from mocapflow.io.video import IMAGES, VIDEOS, Video, name_frames, open_video
from mocapflow.records import record

CUT = 0.02  # share of the width or height that a video may lack against its calibration
USUAL_RATE = 30.0  # frames per second, where nothing says it
KEYPOINT_ENDINGS = ("_json", "")


@record
class Parts:
    """The parts of a recording folder, in the order of the calibration."""

    lenses: tuple[Camera, ...]  # of the videos' real size
    videos: tuple[Video, ...]
    keypoint_folders: tuple[Path | None, ...]
    calibration: Path
    frame_rate: float  # per second
    length: int  # frames
    warnings: tuple[str, ...]


def gather(folder: Path, calibration: Path | None = None) -> Parts:
    """Read what a recording folder holds and check that it agrees.

    Raises:
        RecordingError: a part is missing, can't be read, or contradicts another.
    """
    if not folder.is_dir():
        raise RecordingError("no such recording folder", where=str(folder))
    if calibration is None or (folder / "cameras.toml").exists():
        calibration = find_calibration(folder)
    cameras = read_cameras(calibration)
    paths = match_videos(folder, [camera.name for camera in cameras], calibration)
    late = late_frames(folder, [camera.name for camera in cameras])
    videos = tuple(replace(open_video(path), late=frames) for path, frames in zip(paths, late, strict=True))
    lenses, cut = fit_sizes(cameras, videos, calibration)
    length, broken = agree_on_length(cameras, videos, folder)
    gaps = gap_warnings(cameras, videos)
    rate, assumed = common_rate(cameras, videos, calibration)
    keypoints = tuple(keypoint_folder(folder, camera.name) for camera in cameras)
    odd = keypoint_warnings(cameras, keypoints, length)
    return Parts(
        lenses=lenses,
        videos=videos,
        keypoint_folders=keypoints,
        calibration=calibration,
        frame_rate=rate,
        length=length,
        warnings=(*cut, *broken, *gaps, *assumed, *odd),
    )


def video_paths(folder: Path) -> dict[str, Path]:
    """Return the video files and image folders of a recording by camera name."""
    if not (folder / "videos").is_dir():
        return {}
    entries = sorted((folder / "videos").iterdir())
    return {p.name if p.is_dir() else p.stem: p for p in entries if p.is_dir() or p.suffix.lower() in VIDEOS}


def plates(folder: Path, camera: str) -> tuple[Path, ...]:
    """Return the clean plates of a camera: background/<camera>.png, or every image in background/<camera>/."""
    place = folder / "background"
    single = [p for ending in IMAGES if (p := place / f"{camera}{ending}").exists()]
    several = sorted((place / camera).iterdir()) if (place / camera).is_dir() else []
    return tuple(single[:1] or [p for p in several if p.suffix.lower() in IMAGES])


def match_videos(folder: Path, names: Sequence[str], calibration: Path) -> tuple[Path, ...]:
    """Return the video of each camera.

    Raises:
        RecordingError: a camera has no video, or a video no camera.
    """
    paths = video_paths(folder)
    lost, extra = [n for n in names if n not in paths], [n for n in paths if n not in names]
    if lost or extra:
        what = f"no video of {', '.join(lost)}" if lost else f"no calibration of {', '.join(extra)}"
        raise RecordingError(
            f"missing camera: {what}",
            where=str(folder),
            hint=f"{calibration.name} has: {', '.join(names)}\nvideos/ has: {', '.join(paths) or 'nothing'}\n"
            "name each video after its camera, or remove the camera or the video that is too many",
        )
    return tuple(paths[name] for name in names)


def fit_sizes(
    cameras: Sequence[Camera], videos: Sequence[Video], calibration: Path
) -> tuple[tuple[Camera, ...], list[str]]:
    """Return the cameras with the size of their videos; a slightly smaller video was cut at the right and bottom."""
    lenses, warnings = [], []
    for camera, video in zip(cameras, videos, strict=True):
        size = np.array([video.width, video.height], np.int32)
        if camera.size.any() and (size != camera.size).any():
            wanted = f"{camera.size[0]} x {camera.size[1]}"
            if (size > camera.size).any() or (size < (1 - CUT) * camera.size).any():
                raise RecordingError(
                    f"camera '{camera.name}': the video is {video.width} x {video.height} px, the calibration {wanted}",
                    where=str(calibration),
                    hint="calibrate at the size of the video, or scale size and matrix of the calibration to it",
                )
            warnings.append(
                f"{camera.name}: the video is {video.width} x {video.height} px, the calibration {wanted}: "
                "taken as cut at the right and bottom"
            )
        lenses.append(replace(camera, size=size))
    return tuple(lenses), warnings


def agree_on_length(cameras: Sequence[Camera], videos: Sequence[Video], folder: Path) -> tuple[int, list[str]]:
    """Return the common number of frames; a video that breaks off counts with what it declares."""
    lengths = {video.frames for video in videos}
    if len(lengths) == 1:
        return lengths.pop(), []
    broken = [video.frames < video.declared for video in videos]
    lengths = {v.declared if b else v.frames for v, b in zip(videos, broken, strict=True)}
    if len(lengths) > 1:
        raise RecordingError(
            "the videos differ in length",
            where=str(folder / "videos"),
            hint=", ".join(f"{c.name}: {v.frames} frames" for c, v in zip(cameras, videos, strict=True))
            + "\ncut them to the same moments: frame i must be the same instant in every video",
        )
    length = lengths.pop()
    return length, [
        f"{camera.name}: the video breaks off after frame {video.frames - 1} of {length}; it is not used from there on"
        for camera, video, cut in zip(cameras, videos, broken, strict=True)
        if cut
    ]


def gap_warnings(cameras: Sequence[Camera], videos: Sequence[Video]) -> list[str]:
    """Say which frames within each video are not there."""
    return [
        f"{camera.name}: {name_frames(lost)} missing in the video; the view is not used there"
        for camera, video in zip(cameras, videos, strict=True)
        if (lost := sorted(set(range(video.frames)) - set(video.numbers.tolist())))
    ]


def common_rate(cameras: Sequence[Camera], videos: Sequence[Video], calibration: Path) -> tuple[float, list[str]]:
    """Return the frames per second: as [metadata] says, or as the videos do.

    Raises:
        RecordingError: the videos differ by more than 1 %.
    """
    rates = {c.name: v.frame_rate for c, v in zip(cameras, videos, strict=True) if v.frame_rate}
    stated = metadata(calibration).get("frame_rate")
    if stated is not None:
        return float(stated), []
    if not rates:
        return USUAL_RATE, [
            f"nothing says the frame rate: {USUAL_RATE:g} frames per second assumed; "
            f"write frame_rate under [metadata] in {calibration.name}"
        ]
    if max(rates.values()) > 1.01 * min(rates.values()):
        raise RecordingError(
            "the videos differ in frame rate",
            where=str(calibration.parent / "videos"),
            hint=", ".join(f"{name}: {rate:g} per second" for name, rate in rates.items())
            + "\nrecord all cameras at one rate, or write the true frame_rate under [metadata] in cameras.toml",
        )
    return Counter(rates.values()).most_common(1)[0][0], []


def keypoint_folder(folder: Path, camera: str) -> Path | None:
    """Return keypoints/<camera>_json (or keypoints/<camera>) of a recording folder, None where it is missing."""
    places = (folder / "keypoints" / f"{camera}{ending}" for ending in KEYPOINT_ENDINGS)
    return next((place for place in places if place.is_dir()), None)


def keypoint_warnings(cameras: Sequence[Camera], places: Sequence[Path | None], length: int) -> list[str]:
    """Say what is odd about the keypoints of all cameras; nothing where none has any."""
    if not any(places):
        return []
    rows = [
        odd_keypoints(camera.name, place, length)
        if place
        else [f"{camera.name}: no keypoints, though others have them"]
        for camera, place in zip(cameras, places, strict=True)
    ]
    return [text for row in rows for text in row]
