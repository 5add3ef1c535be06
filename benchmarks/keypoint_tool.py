"""What a keypoint tool measures on a recording whose motion is known, beside our run of it.

python benchmarks/keypoint_tool.py RECORDING KEYPOINTS [RUN [PNG]]: KEYPOINTS is a folder like keypoints/ of a
recording, as examples/mediapipe_keypoints.py writes it. Its points are triangulated robustly with all cameras and
low-passed at 6 Hz by the filter of Pose2Sim; angles between them are the first column. Those of the scanned body,
fitted to the keypoints frame by frame (inverse kinematics) and low-passed alike, are the second. PNG gets
the curves of the knees.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from mocapflow_bodies.scanned import Scanned
from mocapflow_evaluation.keypoint_reference import low_pass, with_keypoints, write_triangulated
from mocapflow_evaluation.panels import OURS, TRUTH, legend, panels, save, title
from mocapflow_evaluation.references import read_reference
from mocapflow_export import layout
from mocapflow_fitting.detections import names_of, persons, seen
from mocapflow_fitting.keypoint_fit import fit
from mocapflow_fitting.landmarks import landmarks

from mocapflow.geometry.angles import measure
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.recordings.recording import Recording, open_recording
from mocapflow.records import F64

DRAWN = {
    "triangulated": ("tab:orange", "keypoints, triangulated"),
    "fitted body": ("tab:brown", "the scan fitted to the keypoints"),
    "mocapflow": (OURS, "mocapflow"),
}
Curves = Mapping[str, F64]  # (T,) deg, a row for each frame of the recording


def main() -> None:
    """Print a row for each angle, and draw those of the knees if asked."""
    folder, keypoints = Path(sys.argv[1]), Path(sys.argv[2])
    recording = open_recording(folder)
    systems = {"triangulated": triangulated(recording, keypoints), "fitted body": fitted_body(recording, keypoints)}
    if len(sys.argv) > 3:
        systems["mocapflow"] = tracked(recording, Path(sys.argv[3]))
    truth = read_columns(folder / "truth/angles.csv")
    print(f"{'RMS °, without the mean difference':36}" + "".join(f"{name:>26}" for name in systems))
    for name in (name for name in truth if name != "frame"):
        print(f"{name:36}" + "".join(f"{errors(truth, curves, name):>26}" for curves in systems.values()))
    if len(sys.argv) > 4:
        plot_knees(Path(sys.argv[4]), truth, systems)


def triangulated(recording: Recording, keypoints: Path) -> Curves:
    """Return the angles between triangulated keypoints."""
    with tempfile.TemporaryDirectory() as place:
        return read_reference(write_triangulated(recording, keypoints, recording.cameras, Path(place), None)).curves


def fitted_body(recording: Recording, keypoints: Path) -> Curves:
    """Return the angles of the recording's scan, fitted to the keypoints of each frame."""
    recording, body = with_keypoints(recording, keypoints), Scanned().load(recording.folder)
    people = persons(recording, recording.indices, recording.cameras)
    names, wanted = names_of(recording, list(people), None), landmarks(body).names
    poses = [fit(body, [seen(person, names, wanted)], recording.cameras)[1][0] for person in people.values()]
    series = measure(body, np.stack([pose.root for pose in poses]), np.stack([pose.angles for pose in poses]))
    values = low_pass(in_all_frames(series.value, list(people), recording), recording.frame_rate)
    return dict(zip(series.names, values.T, strict=True))


def tracked(recording: Recording, run: Path) -> Curves:
    """Return the angles of a run of the recording, or of a part of it."""
    columns = read_columns(run / layout.ANGLES)
    frames = columns["frame"].astype(int).tolist()
    return {name: in_all_frames(values, frames, recording) for name, values in columns.items()}


def in_all_frames(values: F64, frames: Sequence[int], recording: Recording) -> F64:
    """Return values (F, ...) of some frames as those of all (T, ...): NaN in the others."""
    found = np.full((recording.length, *values.shape[1:]), np.nan)
    found[frames] = values
    return found


def errors(truth: Curves, curves: Curves, name: str) -> str:
    """Return the RMS error of an angle, the same without its mean, and how many frames have no value."""
    if name not in curves:
        return "-"
    frames = truth["frame"].astype(int)
    off = curves[name][frames] - truth[name]
    known = off[np.isfinite(off)]
    missing = f" ({len(off) - len(known)} missing)" if len(known) < len(off) else ""
    return f"{np.sqrt(np.mean(known**2)):.1f}, {np.std(known):.1f}{missing}"


def plot_knees(path: Path, truth: Curves, systems: Mapping[str, Curves]) -> None:
    """Write the curves of both knees by all systems, the truth in black."""
    names = ("knee_flexion_l", "knee_flexion_r")
    figure, both = panels(len(names), 2, 3.2)
    for panel, name in zip(both, names, strict=True):
        panel.plot(truth["frame"], truth[name], color=TRUTH, linewidth=1.8, label="truth")
        for system, (colour, label) in DRAWN.items():
            if system in systems:
                curve = systems[system][name]
                panel.plot(np.arange(len(curve)), curve, color=colour, linewidth=1.3, label=label)
        panel.set_title(title(name), fontsize=10, loc="left")
        panel.set_xlabel("frame")
        panel.set_ylabel("deg")
    legend(figure, both)
    save(figure, path)


if __name__ == "__main__":
    main()
