"""2D keypoints as a reference: triangulated with the cameras of a run, filtered, and written as a .trc."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from mocapflow_export import layout
from mocapflow_fitting.detections import names_of, persons

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.motion.opensim_axes import opensim_from_world
from mocapflow.io.motion.trc import write_trc
from mocapflow.io.recording.layout import keypoint_folders
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.results import ViewChecks

LOG = logging.getLogger("mocapflow")
CUT_OFF_HZ = 6.0
ORDER = 4  # of both passes together
MARGIN_S = 1.0  # s, looked at on both sides of the wanted frames: there the filter runs in


def with_keypoints(recording: Recording, place: Path) -> Recording:
    """Return a recording with the keypoints of a folder like its own keypoints/.

    Raises:
        RecordingError: there are none of two cameras.
    """
    found = keypoint_folders(place, recording.cameras)
    if len(found) - found.count(None) < 2:
        hint = f"expected {place.name}/{recording.cameras[0].name}_json/*.json as OpenPose writes them"
        raise RecordingError("there are no 2D keypoints of two cameras or more", where=str(place), hint=hint)
    return replace(recording, keypoint_folders=found)


def write_triangulated(
    recording: Recording, place: Path, cameras: Sequence[Camera], run_folder: Path, checks: ViewChecks | None
) -> Path:
    """Write the person's keypoints in space into a run folder; return the .trc.

    Args:
        recording: its frames, those between them, and the margin are looked at.
        place: folder of keypoints, like keypoints/ of a recording.
        cameras: pinhole cameras of the run, which may have been corrected since they were calibrated.
        run_folder: of the run.
        checks: of the pictures: keypoints of knocked cameras are moved back, those of wrong views left out.

    Raises:
        RecordingError: there are no keypoints of two cameras, or in no frame two cameras see the same person.
    """
    recording = with_keypoints(recording, place)
    margin = round(MARGIN_S * recording.frame_rate)
    first, after = max(0, recording.indices[0] - margin), min(recording.length, recording.indices[-1] + 1 + margin)
    people = persons(recording, range(first, after), cameras, checks)
    names = names_of(recording, list(people), None)
    places = np.full((after, len(names), 3), np.nan)  # from the first frame of the recording on, as times are counted
    for index, person in people.items():
        places[index] = person.points.position
    off = np.concatenate([person.points.error for person in people.values()], axis=1)
    LOG.info("keypoints of %d frames reproject within %.1f px (median)", len(people), np.nanmedian(off))
    path = layout.place(run_folder, layout.KEYPOINTS)
    ours = [name.replace("big_toe", "toe") for name in names]
    smooth = low_pass(places, recording.frame_rate)
    write_trc(path, ours, opensim_from_world(smooth), recording.frame_rate)
    return path


def low_pass(values: F64, rate: float, filtered_alone: bool = False) -> F64:
    """Return values (T, ...) without what is faster than 6 Hz: a zero-lag Butterworth filter, as Pose2Sim has it.

    Each stretch without a gap is filtered on its own; one shorter than the filter's reach stays as it is, and so does
    everything at too low a rate. With `filtered_alone` these are NaN.
    """
    from scipy.signal import butter, filtfilt

    if rate <= 2 * CUT_OFF_HZ:
        return np.full_like(values, np.nan) if filtered_alone else values
    b, a = butter(ORDER // 2, CUT_OFF_HZ, fs=rate)
    columns = values.reshape(len(values), -1).copy()
    for column in columns.T:
        known = np.flatnonzero(np.isfinite(column))
        for stretch in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
            if len(stretch) > 3 * len(b):
                column[stretch] = filtfilt(b, a, column[stretch])
            elif filtered_alone:
                column[stretch] = np.nan
    return columns.reshape(values.shape)
