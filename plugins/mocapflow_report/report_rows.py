"""What the report says in words and rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mocapflow_evaluation.compare import NINETY
from mocapflow_evaluation.panels import title
from mocapflow_export import runjson, tables
from mocapflow_export.quality_warnings import quality_warnings

from mocapflow.data import unseen
from mocapflow.records import F64, Bool
from mocapflow.results import Evaluation, Track
from mocapflow.scene import Scene
from mocapflow_report import plots

DEVIATIONS = {  # column of evaluation.csv: its heading
    "rms_deg": "RMS", "rms_low_deg": "95 % from", "rms_high_deg": "to", "rms_without_offset_deg": "RMS without offset",
    "rms_aligned_deg": "RMS aligned", "mae_deg": "mean size", "offset_deg": "offset", "max_deg": "largest",
    "worst_frame": "in frame", "cmc": "CMC", "lag_frames": "lag, frames", "coverage_90": "in our 90 % interval",
}  # fmt: skip


def glance(track: Track, cameras: Sequence[str], evaluation: Evaluation | None) -> list[str]:
    """Return what matters most."""
    warnings, overlap = quality_warnings(track, cameras), track.overlap[np.isfinite(track.overlap)]
    rows = {str(row["angle"]): row for row in (evaluation.rows if evaluation else ())}
    knees = [
        f"{title(name)} {rows[name]['rms_deg']:.1f}° ({rows[name]['rms_aligned_deg']:.1f}° without lag and offset)"
        for name in ("knee_flexion_l", "knee_flexion_r")
        if name in rows
    ]
    said = [f"RMS deviation from the reference: {'; '.join(knees)}"] if knees else []
    if len(overlap):
        said.append(f"overlap of model and image: {np.median(overlap):.3f} in the median of all frames and views")
    said.extend(warnings or ["no frame lost"])
    return [*said, f"{np.median(track.seconds.sum(axis=1)):.2f} s of CPU a frame"]


def ranges(columns: Mapping[str, F64]) -> list[dict[str, Any]]:
    """Return a row per angle: how far it moves, how sure it is, and where it is a guess."""
    rows = []
    for name in tables.angle_names(columns):
        curve, half = columns[name], NINETY * columns[f"{name}_sd"]
        rows.append({
            "degrees": title(name), "least": float(np.min(curve)), "greatest": float(np.max(curve)),
            "range": float(np.ptp(curve)), "± of the 90 % interval, median": float(np.median(half)),
            "frames held by the priors": int(np.sum(unseen(columns[f"{name}_observed"]))),
        })  # fmt: skip
    return rows


def deviations(evaluation: Evaluation) -> list[dict[str, Any]]:
    """Return a row per angle: how far it is from the reference."""
    return [
        {"degrees": title(str(row["angle"])), **{said: row[name] for name, said in DEVIATIONS.items()}}
        for row in evaluation.rows
    ]


def against(evaluation: Evaluation) -> list[str]:
    """Return what the deviations are from."""
    return [f"compared with {Path(evaluation.reference).name}; all frames count, failures too", *evaluation.notes]


def body(scene: Scene) -> str:
    """Return the height and the lengths of the limbs of the body that was tracked."""
    return "; ".join(f"{title(name)} {100 * value:.1f} cm" for name, value in runjson.measures(scene.body).items())


def mishaps(track: Track, held: Mapping[str, int]) -> list[str]:
    """Return which frames were lost, doubted or not at rest, and which angles the priors held in how many frames."""
    lost, restless = track.lost, ~track.steady
    said = [f"frames lost and bridged: {_spans(track, lost)}"] if lost.any() else []
    if track.doubted.any():
        said.append(f"frames that images or keypoints contradict: {_spans(track, track.doubted)}")
    if restless.any():
        said.append(f"{restless.sum()} of {len(restless)} frames did not come to rest: {_spans(track, restless)}")
    if track.oscillating.any():
        said.append(f"frames that swing between two states: {_spans(track, track.oscillating)}")
    return said + [f"{title(name)}: held by the priors in {n} frames" for name, n in held.items()]


def notes(track: Track) -> list[str]:
    """Return the notes of a track, each once, with the frames that it is of."""
    said: dict[str, list[int]] = {}
    for frame, lines in runjson.by_frame(track.notes).items():
        for line in lines:
            said.setdefault(line, []).append(frame)
    spans = {line: _spans(track, np.isin(track.frame, frames)) for line, frames in said.items()}
    return [f"{'frame' if where.isdecimal() else 'frames'} {where}: {line}" for line, where in spans.items()]


def times(track: Track) -> list[dict[str, Any]]:
    """Return a row per step of the loop: the CPU time it took."""
    seconds = track.seconds
    share = 100 * seconds.sum(axis=0) / max(float(seconds.sum()), 1e-9)
    return [
        {
            "step": name,
            "s in total": float(spent.sum()),
            "%": round(part),
            "ms a frame, median": 1e3 * float(np.median(spent)),
        }
        for name, spent, part in zip(track.step_names, seconds.T, share.tolist(), strict=True)
    ]


def _spans(track: Track, where: Bool) -> str:
    """Return frame numbers as spans: 3–7, 12."""
    ends = ((track.frame[first], track.frame[last]) for first, last in plots.runs(where))
    return ", ".join(f"{a}" if a == b else f"{a}–{b}" for a, b in ends)
