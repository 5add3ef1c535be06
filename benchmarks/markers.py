"""What a comparison with a marker system would say of a run, beside what the truth says.

python benchmarks/markers.py RECORDING RUN: markers are put on the true joints of a rendered recording, with 1 mm of
noise and 5 to 10 mm that skin and flesh slide with the bend of the nearest joint, low-passed at 6 Hz, 100 per second,
in a rig of their own that lies elsewhere and starts 50 ms late. They are written as a C3D file and a table of common
points into RUN/markers, and compared with the run as any such file is. Once more without the inner markers, and with a
standing trial that has them, into RUN/markers_without_inner.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from mocapflow_evaluation.evaluate import evaluate, evaluate_run
from mocapflow_evaluation.rigs import COMMON_POINTS
from mocapflow_evaluation.stick import Stick
from mocapflow_evaluation.tracked_motion import TrackedMotion
from mocapflow_export import layout
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt
from scipy.spatial.transform import Rotation

from mocapflow.geometry import angles
from mocapflow.geometry.registration import register
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.records import F64

NOISE, SKIN, DELAY = 0.001, (0.005, 0.010), 0.05  # m, m, s
RATE, LOWPASS = 100.0, 6.0  # per second, Hz
DEPTH = 0.15  # m, of the pelvis
ACROSS = {"knee": 0.05, "ankle": 0.035, "elbow": 0.035, "wrist": 0.025}  # m, from the centre to either marker
BESIDE = {"knee": ("hip", "knee", "ankle"), "elbow": ("shoulder", "elbow", "wrist")}
CGM2 = {
    "asis": "ASI", "psis": "PSI", "knee_lateral": "KNE", "knee_medial": "KNM", "ankle_lateral": "ANK",
    "ankle_medial": "MED", "toe": "TOE", "acromion": "SHO", "elbow_lateral": "ELB", "elbow_medial": "ELBM",
    "wrist_lateral": "WRA", "wrist_medial": "WRB", "thigh": "THI", "shank": "TIB", "upper_arm": "UPA", "forearm": "FRM",
}  # fmt: skip
ON_SEGMENT = {"knee": "thigh", "ankle": "shank", "elbow": "upper_arm", "wrist": "forearm"}  # by the joint at its end
ASIDE = 0.07  # m, of the marker on a segment


def main() -> None:
    recording, run = Path(sys.argv[1]), Path(sys.argv[2])
    truth = read_columns(recording / "truth/angles.csv")
    archive = np.load(recording / "truth/joints.npz")
    at = {str(name): archive["positions"][:, k].astype(float) for k, name in enumerate(archive["names"])}
    time = np.arange(len(truth["frame"])) / 30.0
    seen = measured(landmarks(at, pelvis(recording, at)), at, time)
    path = write(run / "markers", seen)
    outer = {name: places for name, places in seen.items() if "medial" not in name}
    without_inner = write(run / "markers_without_inner", outer)
    write_c3d(without_inner.with_name("static.c3d"), standing(recording))
    known = {**truth, "time": time}
    true_motion = TrackedMotion(columns=known, raw=known, stick=Stick(names=(), places=np.empty((len(time), 0, 3))))
    columns = {
        "markers, truth": evaluate(true_motion, path, path.parent / "truth").rows,
        "without inner": evaluate(true_motion, without_inner, without_inner.parent / "truth").rows,
        "ours, markers": evaluate_run(run, path).rows,
        "ours, truth": evaluate_run(run, recording / "truth/angles.csv").rows,
    }
    print(f"{'RMS °  (without offset and lag)':36}" + "".join(f"{name:>18}" for name in columns))
    for name in (row["angle"] for row in columns["ours, truth"]):
        rows = [next((row for row in each if row["angle"] == name), None) for each in columns.values()]
        cells = [f"{row['rms_deg']:.1f} ({row['rms_aligned_deg']:.1f})" if row else "" for row in rows]
        print(f"{name:36}" + "".join(f"{cell:>18}" for cell in cells))
    evaluate_run(run, path)  # what stays in the run folder
    print((run / layout.FINDINGS).read_text())


def at_rest(recording: Path) -> dict[str, F64]:
    """Return where the joints are at rest, (1, 3) m."""
    joints = json.loads((recording / "subject/skeleton.json").read_text())["joints"]
    return {entry["name"]: np.array([entry["position"]], float) for entry in joints}


def standing(recording: Path) -> dict[str, F64]:
    """Return the markers of a standing trial of ten frames, with the noise of the system."""
    still, random = landmarks(at_rest(recording), np.eye(3)[None]), np.random.default_rng(3)
    return {name: place + random.normal(scale=NOISE, size=(10, 3)) for name, place in still.items()}


def pelvis(recording: Path, at: dict[str, F64]) -> F64:
    """Return how the pelvis is turned from its rest in every frame (T, 3, 3); at rest it looks along -y."""
    rest = at_rest(recording)
    corners = ("hip_l", "hip_r", "spine")
    still, moving = np.concatenate([rest[name] for name in corners]), np.stack([at[name] for name in corners], axis=1)
    return np.stack([register(still, places).rotation for places in moving])


def landmarks(at: dict[str, F64], turned: F64) -> dict[str, F64]:
    """Return where the landmarks (T, 3) m of joints are that lie where the regressions expect them."""
    right, forward, up = (turned @ axis for axis in ([-1.0, 0, 0], [0, -1.0, 0], [0, 0, 1.0]))
    hips = (at["hip_l"] + at["hip_r"]) / 2
    width = (np.median(np.linalg.norm(at["hip_r"] - at["hip_l"], axis=1)) / 2 - 0.0073) / 0.33
    front = hips + (0.24 * DEPTH + 0.0099) * forward + (0.30 * width + 0.0109) * up
    raised = at["shoulder_l"] + at["shoulder_r"] - at["hip_l"] - at["hip_r"]
    shoulders = np.linalg.norm(at["shoulder_r"] - at["shoulder_l"], axis=1, keepdims=True)
    found = {}
    for side, sign in (("l", -1), ("r", 1)):
        found[f"asis_{side}"] = front + sign * width / 2 * right
        found[f"psis_{side}"] = front - DEPTH * forward + sign * 0.04 * right
        found[f"toe_{side}"] = at[f"toe_{side}"]
        found[f"acromion_{side}"] = at[f"shoulder_{side}"] + 0.17 * shoulders * unit(raised)
        for joint, above in (("knee", "hip"), ("ankle", "knee"), ("elbow", "shoulder"), ("wrist", "elbow")):
            along = unit(at[f"{joint}_{side}"] - at[f"{above}_{side}"])
            aside = sign * unit(right - np.sum(right * along, axis=1, keepdims=True) * along)
            found[f"{joint}_lateral_{side}"] = at[f"{joint}_{side}"] + ACROSS[joint] * aside
            found[f"{joint}_medial_{side}"] = at[f"{joint}_{side}"] - ACROSS[joint] * aside
            middle = (at[f"{joint}_{side}"] + at[f"{above}_{side}"]) / 2
            found[f"{ON_SEGMENT[joint]}_{side}"] = middle + ASIDE * aside
    return found


def measured(marks: dict[str, F64], at: dict[str, F64], time: F64) -> dict[str, F64]:
    """Return markers as a system measures them: they slide with the bend of the limb they are on, and are filtered."""
    random, seen = np.random.default_rng(0), {}
    b, a = butter(2, LOWPASS / (RATE / 2))
    fine = np.arange(0, time[-1], 1 / RATE)
    for name, places in marks.items():
        side = name[-1]
        limb = BESIDE["elbow" if name.startswith(("elbow", "wrist", "acromion")) else "knee"]
        bend = angles.three_point(np.stack([at[f"{joint}_{side}"] for joint in limb], axis=1))
        slide = (bend - bend.mean()) / max(float(bend.std()), 1e-9)
        way = unit(random.normal(size=3)) * random.uniform(*SKIN)
        at_rate = CubicSpline(time, places + slide[:, None] * way)(fine) + random.normal(
            scale=NOISE, size=(len(fine), 3)
        )
        seen[name] = filtfilt(b, a, at_rate, axis=0)
    return seen


def write(folder: Path, marks: dict[str, F64]) -> Path:
    """Write markers.c3d, which starts late, and the points that both rigs have measured."""
    turn, shift = Rotation.from_euler("zyx", [130, 3, -2], degrees=True), np.array([2.0, -0.5, 0.1])
    folder.mkdir(exist_ok=True)
    late = round(DELAY * RATE)
    write_c3d(folder / "markers.c3d", {name: turn.apply(places[late:]) + shift for name, places in marks.items()})
    wand = np.random.default_rng(1).uniform([-1, -1, 0], [1, 1, 2], (12, 3))
    other = turn.apply(wand) + shift + np.random.default_rng(2).normal(scale=NOISE, size=wand.shape)
    header = "x,y,z,marker_x,marker_y,marker_z"
    np.savetxt(folder / COMMON_POINTS, np.hstack([wand, other]), delimiter=",", header=header, comments="")
    return folder / "markers.c3d"


def write_c3d(path: Path, marks: dict[str, F64]) -> None:
    """Write markers (T, 3) m as a C3D file, by the names of CGM2."""
    import ezc3d

    file = ezc3d.c3d()
    points = np.ones((4, len(marks), len(next(iter(marks.values())))))
    points[:3] = 1000 * np.stack(list(marks.values())).transpose(2, 0, 1)
    point = file["parameters"]["POINT"]
    point["LABELS"]["value"] = [f"{name[-1].upper()}{CGM2[name[:-2]]}" for name in marks]
    point["RATE"]["value"], point["UNITS"]["value"] = [RATE], ["mm"]
    file["data"]["points"] = points
    file.write(str(path))


def unit(vectors: F64) -> F64:
    """Return vectors (..., 3) of length one."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


if __name__ == "__main__":
    main()
