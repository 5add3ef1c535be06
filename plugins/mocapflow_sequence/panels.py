"""Figures of equal panels, in one look."""

from __future__ import annotations

from pathlib import Path
from typing import Any

OURS, RAW, TRUTH = "#1f5fbf", "#8fb4e8", "black"
DOTS_PER_INCH = 110


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
    return figure, every[:count]


def legend(figure: Any, panel: Any) -> None:
    """Explain the lines of a panel once, above all."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels), frameon=False, fontsize=9)


def save(figure: Any, path: Path) -> Path:
    """Write a figure and return its path."""
    figure.savefig(path, dpi=DOTS_PER_INCH)
    return path
