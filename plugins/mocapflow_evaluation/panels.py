"""Figures of equal panels, in one look."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mocapflow.io.atomic import atomic_write

OURS, RAW, TRUTH = "#1f5fbf", "#8fb4e8", "black"
HELD, LOST = "#888888", "#d62728"
DOTS_PER_INCH = 110
SIDES = {"l": "left", "r": "right"}


def panels(count: int, columns: int, height: float, width: float = 12.0, **shared: Any) -> tuple[Any, list[Any]]:
    """Return a figure and its panels, row by row; the height is of one panel, in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = max(1, -(-count // columns))
    figure = Figure(figsize=(width, 0.6 + height * rows), layout="constrained")
    FigureCanvasAgg(figure)
    every = list(figure.subplots(rows, columns, squeeze=False, **shared).ravel())
    for panel in every[count:]:
        panel.set_axis_off()
    for panel in every[:count]:
        panel.grid(color="0.9", linewidth=0.6)
        panel.spines[["top", "right"]].set_visible(False)
    for panel in every[:count][-columns:]:
        panel.tick_params(labelbottom=True)  # the last of its column, where those below are left out
    return figure, every[:count]


def legend(figure: Any, every: Sequence[Any]) -> None:
    """Explain what is drawn in any panel, once, above all."""
    pairs = (zip(*panel.get_legend_handles_labels(), strict=True) for panel in every)
    known = {label: handle for pair in pairs for handle, label in pair}
    if known:
        figure.legend(known.values(), known, loc="outside upper right", ncols=len(known), frameon=False, fontsize=9)


def save(figure: Any, path: Path) -> Path:
    """Write a figure and return its path."""
    with atomic_write(path) as part:
        figure.savefig(part, dpi=DOTS_PER_INCH)
    return path


def title(angle: str) -> str:
    """Return the name of an angle in words: knee_flexion_l is knee flexion, left."""
    name, _, side = angle.rpartition("_")
    words = name.replace("_", " ")
    return f"{words}, {SIDES[side]}" if side in SIDES else angle.replace("_", " ")
