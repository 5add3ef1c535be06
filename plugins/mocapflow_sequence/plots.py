"""Angle curves over time, with the reference where there is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.records import F64, Bool
from mocapflow.results import Evaluation, Track
from mocapflow_sequence import tables
from mocapflow_sequence.compare import NINETY
from mocapflow_sequence.lost import unseen

OURS, RAW, TRUTH, HELD = "#1f5fbf", "#8fb4e8", "black", "#888888"


def plot_angles(
    path: Path,
    ours: Mapping[str, F64],
    raw: Mapping[str, F64],
    reference: Mapping[str, F64],
    evaluation: Evaluation | None,
) -> Path:
    """Write one panel per angle: ours with its 90 % band, unsmoothed thin, the reference black, the RMS in the title.

    Frames in which no image shows the angle are shaded grey.

    Args:
        path: the png.
        ours: columns of angles.csv.
        raw: columns of angles_raw.csv.
        reference: curves (T,) in degrees at our frames, by the same names; may be empty.
        evaluation: where the RMS comes from.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = tables.angle_names(ours)
    rows = max(1, -(-len(names) // 2))
    figure = Figure(figsize=(12, 0.6 + 2.3 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, 2, squeeze=False, sharex=True).ravel()
    deviations = {str(row["angle"]): float(row["rms_deg"]) for row in (evaluation.rows if evaluation else ())}
    for panel, name in zip(panels, names, strict=False):
        _panel(panel, name, ours, raw, reference)
        panel.set_title(
            f"{name}   RMS {deviations[name]:.2f}°" if name in deviations else name, fontsize=10, loc="left"
        )
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    for panel in panels[max(0, len(names) - 2) : len(names)]:
        panel.set_xlabel("frame")
        panel.tick_params(labelbottom=True)
    if names:
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=4, frameon=False, fontsize=9)
    figure.savefig(path, dpi=110)
    return path


def plot_overlap(path: Path, track: Track, views: Sequence[str], lost: Bool) -> Path:
    """Write how much of each view's silhouette the model covers, frame by frame; frames lost are shaded.

    Args:
        path: the png.
        track: the track.
        views: names of the cameras.
        lost: (T,), True where a frame was bridged.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 2.6), layout="constrained")
    FigureCanvasAgg(figure)
    panel = figure.subplots()
    for view, overlap in zip(views, track.overlap.T, strict=True):
        panel.plot(track.frame, overlap, linewidth=1.2, label=view)
    for frame in track.frame[lost]:
        panel.axvspan(frame - 0.5, frame + 0.5, color="#d62728", alpha=0.25, linewidth=0)
    panel.set_xlabel("frame")
    panel.set_ylabel("intersection over union")
    panel.grid(color="0.9", linewidth=0.6)
    panel.legend(loc="lower left", ncols=len(views), frameon=False, fontsize=9)
    figure.savefig(path, dpi=110)
    return path


def _panel(
    panel: Any, name: str, ours: Mapping[str, F64], raw: Mapping[str, F64], reference: Mapping[str, F64]
) -> None:
    frame, value, half = ours["frame"], ours[name], NINETY * ours[f"{name}_sd"]
    shown = np.where(np.isfinite(half), half, 0.0)
    panel.fill_between(frame, value - shown, value + shown, color=OURS, alpha=0.18, linewidth=0, label="90 % interval")
    for row in np.flatnonzero(unseen(ours[f"{name}_observed"])):
        panel.axvspan(frame[row] - 0.5, frame[row] + 0.5, color=HELD, alpha=0.25, linewidth=0)
    panel.plot(frame, raw[name], color=RAW, linewidth=0.8, label="unsmoothed")
    if name in reference:
        panel.plot(frame, reference[name], color=TRUTH, linewidth=1.3, label="reference")
    panel.plot(frame, value, color=OURS, linewidth=1.5, label="mocapflow")
    curves = [value, raw[name], reference.get(name, value)]
    low, high = min(np.nanmin(c) for c in curves), max(np.nanmax(c) for c in curves)
    margin = max(2.0, 0.12 * (high - low))  # the band of a lost frame must not flatten the curves
    panel.set_ylim(low - margin, high + margin)
    panel.set_ylabel("deg")
    panel.grid(color="0.9", linewidth=0.6)
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
