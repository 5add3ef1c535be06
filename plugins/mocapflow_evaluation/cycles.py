"""Gait cycles, found in the joint centres, and how far two systems differ in each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.records import F64
from mocapflow_evaluation import compare

LONGEST, SHORTEST = 2.5, 0.5  # s, of a stride
REACH = 0.2  # of the leg's length: a foot swings forward by at least this
LOW = 0.15  # of the leg's length above its lowest: there the ankle is when the heel strikes, not when a knee is raised
PERCENT = np.linspace(0, 100, 101)  # of a cycle


class Cycle(NamedTuple):
    """From one heel strike to the next of the same foot."""

    side: str
    first: int  # row
    last: int


def gait_cycles(names: Sequence[str], places: F64, frame_rate: float) -> list[Cycle]:
    """Return the strides of both feet; none where nobody walks.

    A heel strikes when its ankle is farthest before the pelvis in the direction the pelvis faces, which works on a
    treadmill and over ground alike: Zeni, Richards, Higginson, Gait & Posture 27 (2008), 710. An ankle that is raised
    at that moment belongs to a step on the spot.

    Args:
        names: of the joints.
        places: (T, J, 3) m, z up.
        frame_rate: per second.
    """
    needed = [f"{joint}_{side}" for joint in ("hip", "knee", "ankle") for side in ("l", "r")]
    if not set(needed) <= set(names):
        return []
    at = {name: places[:, names.index(name)] for name in needed}
    found = []
    for side in ("l", "r"):
        strikes = heel_strikes(at, side, frame_rate)
        strides = zip(strikes[:-1], strikes[1:], strict=True)
        found += [Cycle(side, int(a), int(b)) for a, b in strides if (b - a) / frame_rate <= LONGEST]
    return found


def heel_strikes(at: Mapping[str, F64], side: str, frame_rate: float) -> list[int]:
    """Return the rows at which the heel of one side strikes."""
    from scipy.signal import find_peaks

    left = at["hip_l"] - at["hip_r"]
    forward = np.cross(left, [0.0, 0.0, 1.0])
    forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
    ankle = at[f"ankle_{side}"]
    ahead = np.sum((ankle - (at["hip_l"] + at["hip_r"]) / 2) * forward, axis=1)
    leg = np.median(np.linalg.norm(at[f"knee_{side}"] - at[f"hip_{side}"], axis=1))
    leg += np.median(np.linalg.norm(ankle - at[f"knee_{side}"], axis=1))
    peaks, _ = find_peaks(ahead, prominence=REACH * leg, distance=max(1, round(SHORTEST * frame_rate)))
    low = ankle[:, 2] <= ankle[:, 2].min() + LOW * leg
    return [int(row) for row in peaks if low[row]]


def rows(
    cycles: Sequence[Cycle], ours: Mapping[str, F64], reference: Mapping[str, F64]
) -> list[dict[str, float | str]]:
    """Return the rows of cycles.csv: for every angle and every stride of its side how far the two differ (deg)."""
    found: list[dict[str, float | str]] = []
    for name in reference:
        for number, cycle in enumerate(own(cycles, name), 1):
            part = slice(cycle.first, cycle.last + 1)
            a, b = ours[name][part], reference[name][part]
            both = np.isfinite(a) & np.isfinite(b)
            if both.sum() < 2:
                continue
            error = (a - b)[both]
            found.append({
                "angle": name, "cycle": number, "frames": int(both.sum()),
                "first_frame": int(ours["frame"][cycle.first]), "last_frame": int(ours["frame"][cycle.last]),
                "rms_deg": compare.rms(error), "offset_deg": float(np.mean(error)),
                "rom_deg": float(np.ptp(a[both])), "rom_reference_deg": float(np.ptp(b[both])),
                "peak_deg": float(np.max(a[both])), "peak_reference_deg": float(np.max(b[both])),
                "cmc": compare.cmc(np.stack([a[both], b[both]])[None]),
            })  # fmt: skip
    return found


def normalised(cycles: Sequence[Cycle], values: F64, name: str) -> F64:
    """Return a curve (T,) stride by stride at 0 to 100 % of the cycle: (G, 101)."""
    own_cycles = own(cycles, name)
    times = [c.first + PERCENT / 100 * (c.last - c.first) for c in own_cycles]
    return np.array([np.interp(t, np.arange(len(values)), values) for t in times]).reshape(-1, len(PERCENT))


def across(cycles: Sequence[Cycle], ours: F64, reference: F64, name: str) -> float:
    """Return the coefficient of multiple correlation over all strides that both have, NaN where there is none."""
    both = common(cycles, ours, reference, name)
    return compare.cmc(both) if len(both) else np.nan


def common(cycles: Sequence[Cycle], ours: F64, reference: F64, name: str) -> F64:
    """Return two curves (T,) stride by stride, see `normalised`, of the strides that both have: (G, 2, 101)."""
    both = np.stack([normalised(cycles, values, name) for values in (ours, reference)], axis=1)
    known: F64 = both[np.isfinite(both).all(axis=(1, 2))]
    return known


def own(cycles: Sequence[Cycle], name: str) -> list[Cycle]:
    """Return the strides of the side that an angle belongs to."""
    return [cycle for cycle in cycles if name.endswith(f"_{cycle.side}")]


def shared(ours: Mapping[str, F64], reference: Mapping[str, F64]) -> dict[str, F64]:
    """Return the curves of the reference for the angles that both have somewhere, in our order."""
    both = (name for name in ours if name in reference)
    return {name: reference[name] for name in both if np.isfinite(ours[name] - reference[name]).any()}
