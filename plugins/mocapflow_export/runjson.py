"""run.json: how a run was made and how it went, frame by frame."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import unseen
from mocapflow.geometry.angles import AngleSeries
from mocapflow.geometry.skeleton import segment_lengths
from mocapflow.io.atomic import atomic_write
from mocapflow.results import RunFolder, Track
from mocapflow_export.quality_warnings import overlap_medians

FRAME = re.compile(r"^frame (\d+): ?(.*)$")


def summary(
    track: Track, body: Body, series: AngleSeries, run_folder: RunFolder, warnings: tuple[str, ...]
) -> dict[str, Any]:
    """Return what run.json says: versions, settings, recipe, seconds per step, and what happened frame by frame."""
    seconds = track.seconds
    lost, said = track.lost, by_frame(track.notes)
    made = {name: run_folder.recipe.get(name, {}) for name in ("versions", "settings")}
    return {
        **made,
        "recipe": {name: value for name, value in run_folder.recipe.items() if name not in made},
        "warnings": [*warnings, *said_by_stages(run_folder.recipe)],
        "body_m": measures(body),
        "frames": {
            "count": len(track.frame),
            "first": int(track.frame[0]),
            "last": int(track.frame[-1]),
            "not_at_rest": track.frame[~track.steady],
            "oscillating": track.frame[track.oscillating],
            "lost": track.frame[lost],
            "doubted": track.frame[track.doubted],
            "bridged_by": "the neighbouring frames, in `smooth`" if lost.any() and track.raw_root is not None else None,
            "held_by_priors": held_by_priors(series),
        },
        "cpu_seconds": {
            "total": float(seconds.sum()),
            "per_frame_median": float(np.median(seconds.sum(axis=1))),
            "per_step": dict(zip(track.step_names, seconds.sum(axis=0), strict=True)),
        },
        "overlap_median": overlap_medians(track),
        "notes": list(track.notes),
        "per_frame": [_frame(track, row, bool(lost[row]), said) for row in range(len(track.frame))],
    }


def measures(body: Body) -> Mapping[str, float]:
    """Return the height (m) of a whole body at rest, and the lengths of limbs: what a stage has fitted shows here."""
    height = {} if body.cut.any() else {"height": float(np.ptp(body.vertices[:, 2]))}
    return {name: round(length, 4) for name, length in {**height, **segment_lengths(body)}.items()}


def said_by_stages(recipe: Mapping[str, Any]) -> list[str]:
    """Return what the stages of a run warned of, each with the label of its stage."""
    stages = recipe.get("stages", {}).items()
    return [f"{label}: {warning}" for label, entry in stages for warning in entry.get("warnings", ())]


def by_frame(notes: Sequence[str]) -> Mapping[int, list[str]]:
    """Return what the notes of a track say of each frame."""
    said: dict[int, list[str]] = {}
    for found in filter(None, map(FRAME.match, notes)):
        said.setdefault(int(found[1]), []).append(found[2])
    return said


def held_by_priors(series: AngleSeries) -> dict[str, int]:
    """Return in how many frames the priors decided an angle, for the angles where they did."""
    counts = dict(zip(series.names, unseen(series.observed).sum(axis=0).tolist(), strict=True))
    return {name: count for name, count in counts.items() if count}


def write(path: Path, content: Mapping[str, Any]) -> Path:
    """Write a summary as JSON; numbers that are not finite become null."""
    text = json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with atomic_write(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


def _frame(track: Track, row: int, lost: bool, said: Mapping[int, list[str]]) -> dict[str, Any]:
    index = int(track.frame[row])
    return {
        "frame": index,
        "time": round(float(track.time[row]), 6),
        "iterations": int(track.iterations[row]),
        "steady": bool(track.steady[row]),
        "overlap": [round(float(v), 4) for v in track.overlap[row]],
        "cpu_seconds": round(float(track.seconds[row].sum()), 4),
        **({"lost": True} if lost else {}),
        **({"doubted": True} if track.doubted[row] else {}),
        **({"unusable_views": np.flatnonzero(~track.usable[row])} if not track.usable[row].all() else {}),
        **({"notes": said[index]} if index in said else {}),
    }


def plain(value: Any) -> Any:
    """Return a value made of what JSON knows."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray | list | tuple | set | frozenset):
        return [plain(v) for v in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool | None) else str(value)
