"""Pictures of single frames: the model on every view where it fits best, as usual, and worst."""

from __future__ import annotations

import numpy as np

from mocapflow.recordings.recording import Recording
from mocapflow.records import U8
from mocapflow.results import Track, ViewChecks, rows_with_frames
from mocapflow.scene import Scene
from mocapflow_report.overlay import Painter

WIDTH = 1500  # px


def stills(
    track: Track, scene: Scene, recording: Recording, checks: ViewChecks | None = None
) -> list[tuple[str, bytes]]:
    """Return captions and jpegs of the best, median and worst frame by overlap, all views side by side."""
    import cv2

    chosen = chosen_rows(track)
    painter, found = Painter(scene), {}
    last = max(int(track.frame[row]) for row in chosen.values())
    for row, frame in rows_with_frames(track, recording.until(last).frames(), checks):
        for what, wanted in chosen.items():
            if wanted == row:
                wall = _side_by_side(painter.paint(frame, track, row))
                caption = f"{what}: frame {frame.index}, {_overlaps(track, row)}"
                found[what] = (caption, cv2.imencode(".jpg", wall)[1].tobytes())
    return [found[what] for what in chosen if what in found]


def chosen_rows(track: Track) -> dict[str, int]:
    """Return the rows to show: best, median and worst overlap, or first, middle and last where none is known."""
    seen = np.isfinite(track.overlap)
    known = np.flatnonzero(seen.any(axis=1))
    if not len(known):
        return {"first": 0, "middle": len(track.frame) // 2, "last": len(track.frame) - 1}
    mean = np.where(seen, track.overlap, 0).sum(1)[known] / seen.sum(1)[known]
    order = known[np.argsort(-mean, kind="stable")]
    return {"best": int(order[0]), "median": int(order[len(order) // 2]), "worst": int(order[-1])}


def _side_by_side(views: list[U8]) -> U8:
    import cv2

    height = min(view.shape[0] for view in views)
    wall = np.hstack([cv2.resize(view, (round(view.shape[1] * height / view.shape[0]), height)) for view in views])
    size = (WIDTH, round(wall.shape[0] * WIDTH / wall.shape[1]))
    return np.asarray(cv2.resize(wall, size, interpolation=cv2.INTER_AREA), np.uint8)


def _overlaps(track: Track, row: int) -> str:
    known = [f"{value:.3f}" if np.isfinite(value) else "unseen" for value in track.overlap[row]]
    return "overlap per view " + ", ".join(known) if np.isfinite(track.overlap[row]).any() else "overlap unknown"
