"""A recording folder: cameras, videos, keypoints, clean plates and occluders, read one frame at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

from mocapflow.assets import Background, Camera
from mocapflow.data import Frame
from mocapflow.errors import RecordingError
from mocapflow.io.cameras.calibration import calibration_files, find_calibration, read_cameras
from mocapflow.io.cameras.rigs import examine_rig
from mocapflow.io.cameras.views import View
from mocapflow.io.recording import layout
from mocapflow.io.recording.keypoints import first_numbers, keypoint_files, people_at
from mocapflow.io.recording.occluders import occluder
from mocapflow.io.recording.plates import background
from mocapflow.io.video import consistency
from mocapflow.io.video.frame_rate import common_rate
from mocapflow.io.video.frames import decoded
from mocapflow.io.video.lateness import TIMING, late_frames
from mocapflow.io.video.reading import Video, count_from_first, open_video
from mocapflow.records import F64, Watch, record, silent

LEAST_PX = 8  # from side to side; nobody is seen in fewer


class FrameChange(Protocol):
    """Changes frames as they are read: what a stage that returns a `Recording` puts between it and later stages.

    Which frames are asked for, and in what order, must not matter for what any of them becomes.
    """

    def frames(self, source: Recording) -> Iterator[Frame]:
        """Yield the frames of `source`, which gives them as they were, changed."""


@record
class Recording:
    """The frames of a recording folder that a run looks at; nothing is written there."""

    folder: Path
    views: tuple[View, ...]
    videos: tuple[Video, ...]
    keypoint_folders: tuple[Path | None, ...]
    calibration: Path
    frame_rate: float  # per second
    indices: range  # frame numbers in the videos
    length: int  # frames in the videos
    warnings: tuple[str, ...] = ()  # what a user should know; also in run.json
    changes: tuple[FrameChange, ...] = ()  # to the frames as they are read, one after another
    watch: Watch = silent  # told as `frames` goes on

    @cached_property
    def cameras(self) -> tuple[Camera, ...]:
        """The pinhole cameras of the frames: undistorted, scaled."""
        return tuple(view.camera for view in self.views)

    @property
    def lenses(self) -> tuple[Camera, ...]:
        """The cameras as calibrated, of the videos' real size."""
        return tuple(view.lens for view in self.views)

    @property
    def run_rate(self) -> float:
        """Frames per second among those of `indices`."""
        return self.frame_rate / self.indices.step

    def frames(self, since: int | None = None) -> Iterator[Frame]:
        """Yield the frames in order, from the first one whose number is at least `since`."""
        done = 0 if since is None else len(range(self.indices.start, since, self.indices.step))
        return self._read(self.indices[done:])

    def until(self, last: int) -> Recording:
        """Return the recording up to a frame, given by its number in the videos."""
        count = len(range(self.indices.start, last + 1, self.indices.step))
        return replace(self, indices=self.indices[:count])

    def frame(self, index: int) -> Frame:
        """Return one frame by its number in the videos; it decodes all before it.

        Raises:
            RecordingError: the videos have no such frame.
        """
        if not 0 <= index < self.length:
            message = f"no frame {index}: the videos have frames 0 to {self.length - 1}"
            raise RecordingError(message, where=str(self.folder))
        return next(self._read(range(index, index + 1)))

    def seen_by(self, camera: int) -> Recording:
        """Return the recording as one camera has it, without keypoints."""
        one = slice(camera, camera + 1)
        return replace(self, views=self.views[one], videos=self.videos[one], keypoint_folders=(None,))

    def background(self) -> Background | None:
        """Return the empty scene from clean plates, in the tone of the first frame, or None where there are none."""
        return background(self.folder, self.views, lambda: self.frame(0))

    def static(self) -> Recording | None:
        """Return the standing trial, seen by the same cameras, or None where there is none.

        It is no part of `content`: a stage that looks at it names its folder among its `inputs`.
        """
        if not (self.folder / "static" / "videos").is_dir():
            return None
        return open_recording(self.folder / "static", scale=self.views[0].scale, calibration=self.calibration)

    def people(self, index: int) -> tuple[F64, ...]:
        """Return who is detected in a frame, per camera (N, K, 3) px, px, confidence, undistorted; decodes no image."""
        return tuple(
            view.points(people_at(files, index + video.late))
            for view, files, video in zip(self.views, self._keypoint_files, self.videos, strict=True)
        )

    @cached_property
    def _keypoint_files(self) -> tuple[dict[int, Path] | None, ...]:
        numbers = first_numbers(self.keypoint_folders, self.videos[0].first, self.length)
        places = zip(self.keypoint_folders, numbers, strict=True)
        return tuple(None if place is None else keypoint_files(place, first) for place, first in places)

    @cached_property
    def content(self) -> Mapping[str, Path]:
        """Every file and folder that `frames` and `background` read, by its name within the recording."""
        paths = [*calibration_files(self.calibration), *(video.path for video in self.videos)]
        paths += [path for path in (self.folder / TIMING,) if path.exists()]
        paths += [folder for folder in self.keypoint_folders if folder is not None]
        paths += [plate for view in self.views for plate in layout.plates(self.folder, view.lens.name)]
        paths += layout.occluders(self.folder, self.lenses)
        return {
            path.relative_to(self.folder).as_posix() if path.is_relative_to(self.folder) else path.name: path
            for path in paths
        }

    def _read(self, indices: range) -> Iterator[Frame]:
        source = replace(self, changes=self.changes[:-1], indices=indices, watch=silent)
        frames = self.changes[-1].frames(source) if self.changes else self._decode(indices)
        for done, frame in enumerate(frames, 1):
            yield frame
            self.watch(done, len(indices))

    def _decode(self, indices: range) -> Iterator[Frame]:
        for frame in decoded(self.views, self.videos, indices, self.frame_rate):
            yield replace(frame, keypoints=self.people(frame.index)) if any(self.keypoint_folders) else frame


def open_recording(
    folder: Path,
    *,
    start: int = 0,
    stop: int | None = None,
    step: int = 1,
    scale: float = 1.0,
    calibration: Path | None = None,
) -> Recording:
    """Open a recording folder; nothing is decoded but the ends of the videos.

    Args:
        folder: cameras.toml (or another calibration), videos/; keypoints/, background/, occluders/, static/ if there.
        start: first frame.
        stop: frame after the last; None: to the end.
        step: take every so many frames.
        scale: size of the images against the videos, e.g. 0.5.
        calibration: a calibration file outside the folder.

    Raises:
        RecordingError: a part is missing, can't be read, or contradicts another.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise RecordingError("no such recording folder", where=str(folder))
    if calibration is None or (folder / "cameras.toml").exists():
        calibration = find_calibration(folder)
    cameras = read_cameras(calibration)
    videos = _videos(folder, cameras, calibration)
    lenses, cut = consistency.fit_sizes(cameras, videos, calibration)
    length, broken = consistency.agree_on_length(cameras, videos, folder)
    consistency.check_lateness(cameras, videos, length, folder)
    rate, assumed = common_rate(cameras, videos, calibration)
    gaps = [*consistency.first_warnings(videos), *consistency.gap_warnings(cameras, videos)]
    rig = [f"{found.message}: {found.hint}" for found in examine_rig(lenses) if found.severity != "note"]
    odd = layout.keypoint_warnings(folder, cameras, length, videos[0].first)
    _check_scale(scale, lenses)
    return Recording(
        folder=folder,
        views=tuple(View(lens=lens, scale=scale, occluder=occluder(folder, lens)) for lens in lenses),
        videos=videos,
        keypoint_folders=layout.keypoint_folders(folder / layout.KEYPOINTS, cameras),
        calibration=calibration,
        frame_rate=rate,
        indices=_indices(start, stop, step, length, folder),
        length=length,
        warnings=(*cut, *rig, *broken, *gaps, *assumed, *odd, *layout.unused_pictures(folder, cameras)),
    )


def _videos(folder: Path, cameras: Sequence[Camera], calibration: Path) -> tuple[Video, ...]:
    """Return the video of each camera, with how late it is."""
    names = [camera.name for camera in cameras]
    paths, late = layout.match_videos(folder, names, calibration), late_frames(folder, names)
    opened = count_from_first([open_video(path) for path in paths])
    return tuple(replace(video, late=frames) for video, frames in zip(opened, late, strict=True))


def _check_scale(scale: float, lenses: Sequence[Camera]) -> None:
    if not 0 < scale <= 1:
        raise RecordingError(f"the scale is {scale:g}; expected more than 0 and at most 1")
    side = min(int(lens.size.min()) for lens in lenses)
    if scale < 1 and scale * side < LEAST_PX:
        hint = f"the smallest images have {side} pixels from side to side"
        raise RecordingError(f"the scale {scale:g} leaves images of less than {LEAST_PX} pixels", hint=hint)


def _indices(start: int, stop: int | None, step: int, length: int, folder: Path) -> range:
    """Return the frames from start to stop; all of them have to be in the recording."""
    indices = range(start, length if stop is None else stop, step)
    if not indices or start < 0 or indices[-1] >= length:
        message = f"frames {start}:{'' if stop is None else stop} are not in this recording"
        raise RecordingError(message, where=str(folder), hint=f"it has {length} frames: 0:{length}")
    return indices
