"""Markers on the bony landmarks of a posed body, placed so that its joint centres are known exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import PoseBatch
from mocapflow.geometry import kinematics
from mocapflow.results import Track

NAMES = {  # Plug-in Gait and CGM2
    "asis": "ASI", "psis": "PSI", "knee_lateral": "KNE", "knee_medial": "KNM", "ankle_lateral": "ANK",
    "ankle_medial": "MED", "toe": "TOE", "acromion": "SHO", "elbow_lateral": "ELB", "elbow_medial": "ELBM",
    "wrist_lateral": "WRA", "wrist_medial": "WRB",
}  # fmt: skip
DEPTH = 0.15  # m, of the pelvis
ACROSS = {"knee": 0.05, "ankle": 0.035, "elbow": 0.035, "wrist": 0.025}  # m, from the centre to either side


def on_landmarks(body: Body) -> dict[str, tuple[str, np.ndarray]]:
    """Return the joint that carries each landmark, and where it is at rest; the body looks along -y, its left is +x."""
    at = {name: body.positions[body.joint(name)] for name in body.joint_names}
    hips = (at["hip_l"] + at["hip_r"]) / 2
    width = (np.linalg.norm(at["hip_l"] - at["hip_r"]) / 2 - 0.0073) / 0.33  # Harrington's regression, solved for it
    front = hips + [0, -(0.24 * DEPTH + 0.0099), 0.30 * width + 0.0109]
    found = {}
    for side, sign in (("l", 1), ("r", -1)):
        aside = np.array([sign, 0.0, 0.0])
        found[f"asis_{side}"] = ("pelvis", front + width / 2 * aside)
        found[f"psis_{side}"] = ("pelvis", front + [0, DEPTH, 0] + 0.04 * aside)
        found[f"toe_{side}"] = (f"ankle_{side}", at[f"toe_{side}"])
        for joint, above in (("knee", "hip"), ("ankle", "knee"), ("elbow", "shoulder"), ("wrist", "elbow")):
            for name, way in (("lateral", 1), ("medial", -1)):
                found[f"{joint}_{name}_{side}"] = (
                    f"{above}_{side}",
                    at[f"{joint}_{side}"] + way * ACROSS[joint] * aside,
                )
    return found


def markers_of(body: Body, track: Track) -> tuple[list[str], np.ndarray]:
    """Return the labels of the markers, and where they are: (T, K, 3) m."""
    joints = kinematics.chain_batch(body, PoseBatch(root=track.root, angles=track.angles))
    labels, places = [], []
    for landmark, (joint, rest) in on_landmarks(body).items():
        name, side = landmark[:-2], landmark[-1]
        carried = joints[:, body.joint(joint)]
        labels.append(f"Anna:{side.upper()}{NAMES[name]}")
        places.append(carried[:, :3, :3] @ rest + carried[:, :3, 3])
    return labels, np.stack(places, axis=1)


def write_c3d(path: Path, labels: list[str], places: np.ndarray, rate: float, first: int = 0) -> Path:
    """Write markers (T, K, 3) m as a motion capture program does: mm, with the number of the first frame."""
    import ezc3d

    file = ezc3d.c3d()
    points = np.ones((4, places.shape[1], len(places)))
    points[:3] = 1000 * places.transpose(2, 1, 0)
    point = file["parameters"]["POINT"]
    point["LABELS"]["value"], point["UNITS"]["value"], point["RATE"]["value"] = labels, ["mm"], [rate]
    file["header"]["points"]["first_frame"] = first
    file["data"]["points"] = points
    file.write(str(path))
    return path
