"""What a recording folder holds, and where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io import agreement
from mocapflow.io.cameras import find_calibration, read_cameras
from mocapflow.io.keypoints import odd_keypoints
from mocapflow.io.lateness import late_frames
from mocapflow.io.video import IMAGES, VIDEOS, Video, open_video
from mocapflow.records import record

KEYPOINTS = "keypoints"
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
    lenses, cut = agreement.fit_sizes(cameras, videos, calibration)
    length, broken = agreement.agree_on_length(cameras, videos, folder)
    gaps = agreement.gap_warnings(cameras, videos)
    rate, assumed = agreement.common_rate(cameras, videos, calibration)
    keypoints = tuple(keypoint_folder(folder / KEYPOINTS, camera.name) for camera in cameras)
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


def keypoint_folder(place: Path, camera: str) -> Path | None:
    """Return <camera>_json (or <camera>) of a folder of keypoints, None where it is missing."""
    places = (place / f"{camera}{ending}" for ending in KEYPOINT_ENDINGS)
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
