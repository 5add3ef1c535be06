"""Pictures of two systems side by side: agreement, strides, stick models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mocapflow_export import layout

from mocapflow.records import F64
from mocapflow_evaluation import compare, cycles
from mocapflow_evaluation.cycles import PERCENT, Cycle
from mocapflow_evaluation.panels import OURS, TRUTH, legend, panels, save, title
from mocapflow_evaluation.stick import Stick

MOMENTS = 6  # in which the stick models are drawn


def draw(ours: Mapping[str, F64], reference: Mapping[str, F64], strides: Sequence[Cycle], folder: Path) -> list[Path]:
    """Draw agreement with each curve of the reference, and strides where there are some; return the files."""
    both = {name: cycles.common(strides, ours[name], curve, name) for name, curve in reference.items()}
    walked = {name: {"reference": pair[:, 1], "mocapflow": pair[:, 0]} for name, pair in both.items() if len(pair)}
    agreement, cycle = (layout.place(folder, part) for part in (layout.AGREEMENT_PLOT, layout.CYCLES_PLOT))
    drawn = [draw_agreement(agreement, {name: (ours[name], curve) for name, curve in reference.items()})]
    return [*drawn, draw_cycles(cycle, walked)] if walked else drawn


def draw_agreement(path: Path, pairs: Mapping[str, tuple[F64, F64]]) -> Path:
    """Draw differences over means, with their mean and the limits of 95 %: Bland & Altman, Lancet 327 (1986), 307."""
    figure, every = panels(len(pairs), 4, 2.4)
    for panel, (name, (ours, reference)) in zip(every, pairs.items(), strict=True):
        error = (ours - reference)[np.isfinite(ours - reference)]
        low, high = compare.agreement(error).values()
        panel.plot((ours + reference) / 2, ours - reference, ".", color=OURS, markersize=3, alpha=0.6)
        for value, style in ((float(np.mean(error)), "-"), (low, "--"), (high, "--")):
            panel.axhline(value, color=TRUTH, linewidth=0.9, linestyle=style)
            panel.annotate(
                f"{value:+.1f}", (1, value), xycoords=("axes fraction", "data"), fontsize=8, va="bottom", ha="right"
            )
        panel.set_title(title(name), fontsize=10, loc="left")
        panel.margins(y=0.15)
    figure.supxlabel("mean of both, deg", fontsize=10)
    figure.supylabel("mocapflow − reference, deg", fontsize=10)
    return save(figure, path)


def draw_cycles(path: Path, strides: Mapping[str, Mapping[str, F64]]) -> Path:
    """Draw every angle over the cycle, of each system (G, 101): strides thin, their mean thick."""
    figure, every = panels(len(strides), 4, 2.2, sharex=True)
    for panel, (name, systems) in zip(every, strides.items(), strict=True):
        for label, curves in systems.items():
            colour = TRUTH if label == "reference" else OURS
            panel.plot(PERCENT, curves.T, color=colour, linewidth=0.5, alpha=0.4)
            panel.plot(PERCENT, curves.mean(axis=0), color=colour, linewidth=1.8, label=label)
            panel.set_title(f"{title(name)}   {len(curves)} strides", fontsize=10, loc="left")
    legend(figure, every)
    figure.supxlabel("% of the gait cycle, from heel strike to heel strike", fontsize=10)
    figure.supylabel("deg", fontsize=10)
    return save(figure, path)


def draw_sticks(path: Path, ours: Stick, theirs: Stick, frame: F64) -> Path:
    """Draw both stick models in a few of the frames (T,), seen from the front and from the side."""
    drawn = sorted({joint for bone in theirs.bones() for joint in bone})
    seen = np.isfinite(theirs.places[:, drawn]).all(axis=2).sum(axis=1)
    known = np.flatnonzero(seen == seen.max(initial=1))  # some points may never be seen
    rows = known[np.linspace(0, len(known) - 1, MOMENTS).round().astype(int)] if len(known) else np.array([], int)
    figure, every = panels(2 * MOMENTS, MOMENTS, 3.0, subplot_kw={"aspect": "equal"})
    for panel in every:
        panel.set_axis_off()
    for column, row in enumerate(rows):
        across = _across(theirs, row)
        ahead = np.cross(across, [0.0, 0.0, 1.0])
        for view, axis in enumerate((across, ahead)):
            panel = every[view * MOMENTS + column]
            for stick, colour, label in ((theirs, TRUTH, "reference"), (ours, OURS, "mocapflow")):
                _draw_bones(panel, stick, stick.places[row] @ np.stack([axis, [0.0, 0.0, 1.0]], axis=1), colour, label)
        every[column].set_title(f"frame {frame[row]:.0f}", fontsize=9)
    if len(rows):
        legend(figure, every)
    return save(figure, path)


def _draw_bones(panel: Any, stick: Stick, flat: F64, colour: str, label: str) -> None:
    for number, bone in enumerate(stick.bones()):
        panel.plot(
            *flat[list(bone)].T, "o-", color=colour, markersize=2.5, linewidth=1.6, label=label if not number else None
        )


def _across(stick: Stick, row: int) -> F64:
    """Return the level direction from the right to the left hip; the world's x where they are not known."""
    at = dict(zip(stick.names, stick.places[row], strict=True))
    left: F64 = at.get("hip_l", np.full(3, np.nan)) - at.get("hip_r", np.full(3, np.nan))
    return left * [1.0, 1.0, 0.0] / np.linalg.norm(left[:2]) if np.isfinite(left).all() else np.array([1.0, 0.0, 0.0])
