"""Curves over time: angles, with the reference where there is one, and the overlap of model and image."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mocapflow_evaluation.compare import NINETY
from mocapflow_evaluation.panels import HELD, LOST, OURS, RAW, TRUTH, legend, panels, save, title
from mocapflow_export import tables

from mocapflow.data import unseen
from mocapflow.records import F64, Bool
from mocapflow.results import Evaluation, Track


def plot_angles(
    path: Path, ours: Mapping[str, F64], raw: Mapping[str, F64], evaluation: Evaluation | None, lost: Bool
) -> Path:
    """Write one panel per angle: ours with its 90 % band, unsmoothed thin, the reference black, the RMS in the title.

    Frames in which the priors hold the angle are shaded grey, frames that were lost red.

    Args:
        path: the png.
        ours: columns of angles.csv.
        raw: columns of angles_raw.csv.
        evaluation: where the reference's curves and the RMS come from.
        lost: (T,), True where a frame was bridged.
    """
    names = tables.angle_names(ours)
    figure, every = panels(len(names), 2, 2.3, sharex=True)
    reference = evaluation.curves if evaluation else {}
    deviations = {str(row["angle"]): float(row["rms_deg"]) for row in (evaluation.rows if evaluation else ())}
    for panel, name in zip(every, names, strict=True):
        _curves(panel, name, ours, raw, reference)
        shade(panel, ours["frame"], unseen(ours[f"{name}_observed"]) & ~lost, HELD, "held by the priors")
        shade(panel, ours["frame"], lost, LOST, "lost, bridged")
        deviation = f"   RMS {deviations[name]:.2f}°" if name in deviations else ""
        panel.set_title(title(name) + deviation, fontsize=10, loc="left")
    for panel in every[-2:]:
        panel.set_xlabel("frame")
    legend(figure, every)
    return save(figure, path)


def plot_overlap(path: Path, track: Track, views: Sequence[str], lost: Bool) -> Path:
    """Write how much of each view's silhouette the model covers, frame by frame.

    Frames lost are shaded; a cross at the foot says that a view could not be used.

    Args:
        path: the png.
        track: the track.
        views: names of the cameras.
        lost: (T,), True where a frame was bridged.
    """
    figure, (panel,) = panels(1, 1, 2.2)
    for number, (view, overlap, usable) in enumerate(zip(views, track.overlap.T, track.usable.T, strict=True)):
        (line,) = panel.plot(track.frame, overlap, linewidth=1.2, label=view)
        foot = np.full((~usable).sum(), 0.03 + 0.05 * number)
        panel.plot(
            track.frame[~usable], foot, "x", color=line.get_color(), markersize=4, transform=panel.get_xaxis_transform()
        )
    shade(panel, track.frame.astype(np.float64), lost, LOST, "lost, bridged")
    panel.set_xlabel("frame")
    panel.set_ylabel("intersection over union")
    legend(figure, [panel])
    return save(figure, path)


def shade(panel: Any, frame: F64, where: Bool, colour: str, label: str) -> None:
    """Shade the runs of frames (T,) where something is True (T,)."""
    for number, (first, last) in enumerate(runs(where)):
        panel.axvspan(
            frame[first] - 0.5, frame[last] + 0.5, color=colour, alpha=0.25, linewidth=0, label="" if number else label
        )


def runs(where: Bool) -> Iterator[tuple[int, int]]:
    """Yield first and last row of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    yield from ((int(first), int(after) - 1) for first, after in edges.reshape(-1, 2))


def _curves(
    panel: Any, name: str, ours: Mapping[str, F64], raw: Mapping[str, F64], reference: Mapping[str, F64]
) -> None:
    frame, value, half = ours["frame"], ours[name], NINETY * ours[f"{name}_sd"]
    shown = np.where(np.isfinite(half), half, 0.0)
    panel.fill_between(frame, value - shown, value + shown, color=OURS, alpha=0.18, linewidth=0, label="90 % interval")
    panel.plot(frame, raw[name], color=RAW, linewidth=0.8, label="unsmoothed")
    if name in reference:
        panel.plot(frame, reference[name], color=TRUTH, linewidth=1.3, label="reference")
    panel.plot(frame, value, color=OURS, linewidth=1.5, label="mocapflow")
    curves = [value, raw[name], reference.get(name, value)]
    low, high = min(np.nanmin(c) for c in curves), max(np.nanmax(c) for c in curves)
    margin = max(2.0, 0.12 * (high - low))  # the band of a lost frame must not flatten the curves
    panel.set_ylim(low - margin, high + margin)
    panel.set_ylabel("deg")
