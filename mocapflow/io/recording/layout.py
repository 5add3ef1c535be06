"""Where the parts of a recording lie in its folder, and what of it nobody uses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.paths import composed
from mocapflow.io.recording.keypoints import first_numbers, odd_keypoints
from mocapflow.io.video.images import IMAGES
from mocapflow.io.video.reading import VIDEOS

KEYPOINTS, OCCLUDERS = "keypoints", "occluders"
KEYPOINT_ENDINGS = ("_json", "")


def video_paths(folder: Path) -> dict[str, Path]:
    """Return the video files and image folders of a recording by camera name.

    Raises:
        RecordingError: two of them have the name of one camera.
    """
    paths: dict[str, Path] = {}
    for path in _entries(folder / "videos"):
        if not path.is_dir() and path.suffix.lower() not in VIDEOS:
            continue
        name = composed(path.name if path.is_dir() else path.stem)
        if (other := paths.setdefault(name, path)) != path:
            hint = "which one is meant? move the other one out of videos/"
            what = f"two videos of {name}: {other.name}, {path.name}"
            raise RecordingError(what, where=str(folder / "videos"), hint=hint)
    return paths


def plates(folder: Path, camera: str) -> tuple[Path, ...]:
    """Return the clean plates of a camera: background/<camera>.png, or every image in background/<camera>/.

    Raises:
        RecordingError: two images have the name of the camera.
    """
    place = folder / "background"
    single = picture_of(place, camera, "clean plates", f", or put all plates of this camera into background/{camera}/")
    own = _folder(place, camera)
    return (single,) if single else tuple(_images(own)) if own else ()


def picture_of(place: Path, camera: str, what: str, or_else: str = "") -> Path | None:
    """Return the image in a folder that is named after a camera; None where there is none.

    Raises:
        RecordingError: two images have the name of the camera.
    """
    found = [path for path in _images(place) if composed(path.stem) == camera]
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        hint = f"keep one of them{or_else}"
        raise RecordingError(f"{len(found)} {what} of {camera}: {names}", where=str(place), hint=hint)
    return found[0] if found else None


def occluders(folder: Path, cameras: Sequence[Camera]) -> list[Path]:
    """Return the pictures of what stands before cameras: occluders/<camera>.png, of those that have one.

    Raises:
        RecordingError: two images have the name of a camera.
    """
    found = (picture_of(folder / OCCLUDERS, camera.name, "pictures of occluders") for camera in cameras)
    return [path for path in found if path]


def unused_pictures(folder: Path, cameras: Sequence[Camera]) -> list[str]:
    """Say what in background/ and occluders/ is of no camera."""
    taken = {path for camera in cameras for path in plates(folder, camera.name)}
    used = {"background": taken | {path.parent for path in taken}, OCCLUDERS: set(occluders(folder, cameras))}
    names = f"pictures are named after their cameras: {cameras[0].name}.png"
    unused = {place: [p.name for p in _entries(folder / place) if p not in known] for place, known in used.items()}
    return [f"not used from {place}/: {', '.join(these)}; {names}" for place, these in unused.items() if these]


def match_videos(folder: Path, names: Sequence[str], calibration: Path) -> tuple[Path, ...]:
    """Return the video of each camera.

    Raises:
        RecordingError: a camera has no video or two, or a video no camera.
    """
    paths = video_paths(folder)
    lost, extra = [n for n in names if n not in paths], [n for n in paths if n not in names]
    if lost or extra:
        what = f"no video of {', '.join(lost)}" if lost else f"no calibration of {', '.join(extra)}"
        raise RecordingError(
            f"missing camera: {what}",
            where=str(folder),
            hint=f"{calibration.name} has: {', '.join(names)}\nvideos/ has: {', '.join(paths) or 'nothing'}\n"
            "name each video after its camera, or remove the camera or the video that is too many;\n"
            f"a video is a folder of images, or ends in {', '.join(VIDEOS)}",
        )
    return tuple(paths[name] for name in names)


def keypoint_folders(place: Path, cameras: Sequence[Camera]) -> tuple[Path | None, ...]:
    """Return <camera>_json (or <camera>) of each camera in a folder of keypoints, None where it is missing."""
    named = ([_folder(place, f"{camera.name}{ending}") for ending in KEYPOINT_ENDINGS] for camera in cameras)
    return tuple(next(filter(None, paths), None) for paths in named)


def keypoint_numbers(folder: Path, cameras: Sequence[Camera], length: int, image: int) -> list[str]:
    """Say which files are taken for the keypoints of frame 0, where its image has another number than 0."""
    places = keypoint_folders(folder / KEYPOINTS, cameras)
    numbers = zip(cameras, places, first_numbers(places, image, length), strict=True)
    found = [f"{number} of {camera.name}" for camera, place, number in numbers if image and place]
    return [f"the keypoints of frame 0 are numbered {', '.join(found)}"] if found else []


def keypoint_warnings(folder: Path, cameras: Sequence[Camera], length: int, image: int) -> list[str]:
    """Say what is odd about the keypoints of all cameras, for images from a number on; nothing where there are none."""
    places = keypoint_folders(folder / KEYPOINTS, cameras)
    unused = [path.name for path in _entries(folder / KEYPOINTS) if path.is_dir() and path not in places]
    names = f"folders are named after their cameras: {cameras[0].name}{KEYPOINT_ENDINGS[0]}"
    said = [f"not used from {KEYPOINTS}/: {', '.join(unused)}; {names}"] if unused else []
    numbers = first_numbers(places, image, length)
    for camera, place, first in zip(cameras, places, numbers, strict=True) if any(places) else ():
        missing = [f"{camera.name}: no keypoints, though others have them"]
        said += odd_keypoints(camera, place, length, first) if place else missing
    return said


def _entries(place: Path) -> list[Path]:
    """Return what a folder holds but hidden files, in order; nothing where there is no such folder."""
    return sorted(path for path in place.iterdir() if not path.name.startswith(".")) if place.is_dir() else []


def _folder(place: Path, name: str) -> Path | None:
    """Return the folder of this name in a folder."""
    return next((path for path in _entries(place) if path.is_dir() and composed(path.name) == name), None)


def _images(place: Path) -> list[Path]:
    return [path for path in _entries(place) if path.suffix.lower() in IMAGES]
