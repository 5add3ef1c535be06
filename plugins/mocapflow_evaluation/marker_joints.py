"""Joint centres and knee axes from markers on bony landmarks.

Axes of the pelvis: Wu et al., J. Biomech. 35 (2002), 543. Ankle, elbow and wrist centres lie midway between the two
markers of the joint (ibid.; 38 (2005), 981). So does the knee's, and it bends about the line through its epicondyles:
Cappozzo, Catani, Della Croce, Leardini, Clin. Biomech. 10 (1995), 171.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mocapflow.records import F64

SIDES = ("l", "r")
MIDWAY = ("knee", "ankle", "elbow", "wrist")
BELOW_ACROMION = 0.17  # of the distance between the acromia: Rab, Petuskey, Bagley, Gait & Posture 15 (2002), 113


def joint_centres(marks: Mapping[str, F64]) -> dict[str, F64]:
    """Return the joint centres (T, 3) m that the landmarks (T, 3) m tell, by the names of the body's joints."""
    centres = {
        f"{joint}_{side}": (marks[f"{joint}_lateral_{side}"] + marks[f"{joint}_medial_{side}"]) / 2
        for joint in MIDWAY
        for side in SIDES
        if {f"{joint}_lateral_{side}", f"{joint}_medial_{side}"} <= set(marks)
    }
    centres |= {
        f"{name}_{side}": marks[f"{name}_{side}"]
        for name in ("toe", "heel")
        for side in SIDES
        if f"{name}_{side}" in marks
    }
    if all(f"{corner}_{side}" in marks for corner in ("asis", "psis") for side in SIDES):
        centres |= hip_centres(marks)
        if all(f"acromion_{side}" in marks for side in SIDES):
            centres |= _shoulder_centres(marks, centres)
    return centres


def hip_centres(marks: Mapping[str, F64]) -> dict[str, F64]:
    """Return the hip centres (T, 3) m by regression on the pelvis' depth and width.

    Harrington, Zavatsky, Lawson, Yuan, Theologis, J. Biomech. 40 (2007), 595: from midway between the front spines
    0.24 depth + 9.9 mm back, 0.30 width + 10.9 mm down and 0.33 width + 7.3 mm aside. The medians over the recording
    are used: the pelvis keeps its size.
    """
    front, back = _midway(marks, "asis"), _midway(marks, "psis")
    width = float(np.nanmedian(np.linalg.norm(marks["asis_r"] - marks["asis_l"], axis=-1)))
    depth = float(np.nanmedian(np.linalg.norm(front - back, axis=-1)))
    axes = pelvis_axes(marks)
    back_down_aside = np.array([-0.24 * depth - 0.0099, -0.30 * width - 0.0109, 0.33 * width + 0.0073])
    return {
        f"hip_{s}": front + np.einsum("a,tac->tc", back_down_aside * [1, 1, sign], axes)
        for s, sign in (("l", -1), ("r", 1))
    }


def pelvis_axes(marks: Mapping[str, F64]) -> F64:
    """Return the axes of the pelvis as rows: forward, up, right (T, 3, 3)."""
    right = _unit(marks["asis_r"] - marks["asis_l"])
    forward = _midway(marks, "asis") - _midway(marks, "psis")
    up = _unit(np.cross(right, forward))
    return np.stack([np.cross(up, right), up, right], axis=1)


def knee_axis(marks: Mapping[str, F64], side: str) -> F64:
    """Return the axis (T, 3) about which a knee bends: through both epicondyles, to the person's left."""
    inward = marks[f"knee_medial_{side}"] - marks[f"knee_lateral_{side}"]
    return _unit(inward if side == "r" else -inward)


def signed_flexion(hip: F64, knee: F64, ankle: F64, axis: F64) -> F64:
    """Return the angle (T,) in degrees by which the shank is turned against the thigh about an axis to the left."""
    thigh, shank = _unit(knee - hip), _unit(ankle - knee)
    about = np.sum(axis * np.cross(thigh, shank), axis=-1)
    angle: F64 = np.degrees(np.arctan2(about, np.sum(thigh * shank, axis=-1)))
    return angle


def _shoulder_centres(marks: Mapping[str, F64], centres: Mapping[str, F64]) -> dict[str, F64]:
    """Return the shoulder centres, below the acromia along the trunk."""
    between = float(np.nanmedian(np.linalg.norm(marks["acromion_r"] - marks["acromion_l"], axis=-1)))
    down = _unit((centres["hip_l"] + centres["hip_r"]) / 2 - _midway(marks, "acromion"))
    return {f"shoulder_{side}": marks[f"acromion_{side}"] + BELOW_ACROMION * between * down for side in SIDES}


def _midway(marks: Mapping[str, F64], name: str) -> F64:
    return (marks[f"{name}_l"] + marks[f"{name}_r"]) / 2


def _unit(vectors: F64) -> F64:
    unit: F64 = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit
