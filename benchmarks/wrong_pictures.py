"""How many wrong pictures `check_views` finds, and how many right ones it takes for wrong.

`python benchmarks/wrong_pictures.py RECORDING…`. First the clean recording: pictures flagged, and the strongest jump
there is, against the threshold. Then 30 trials of each kind at random: two to four consecutive pictures of one view, or
of all, as thumbnails; the share of the wrong ones that is found, and how many right ones were flagged with them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from mocapflow_robustness import picture_checks
from mocapflow_robustness.check_views import JUMP, faults, longest, rooms
from mocapflow_robustness.thumbnails import Thumbnails, thumbnails

from mocapflow.recordings.recording import open_recording
from mocapflow.records import F32, F64

TRIALS = 30
KINDS = ("other time, one view", "other time, all", "other camera, one view", "other camera, all", "frozen, one view")


def spoil(seen: Thumbnails, kind: str, rng: np.random.Generator) -> tuple[F32, F64, np.ndarray]:
    """Thumbnails and change of a recording with wrong pictures, and which these are (T, C)."""
    frames, cameras = seen.usable.shape
    count = int(rng.integers(2, 5))
    first = int(rng.integers(3, frames - count - 3))
    rows, wrong = slice(first, first + count), np.zeros(seen.usable.shape, bool)
    views = slice(None) if kind.endswith("all") else [int(rng.integers(cameras))]
    grey, change = seen.grey.copy(), seen.change.copy()
    if kind.startswith("other time"):
        instead = seen.grey[(np.arange(first, first + count) + rng.integers(8, frames - 8)) % frames]
    elif kind.startswith("other camera"):
        instead = np.roll(seen.grey[rows], -1, axis=1)
    else:
        instead = np.repeat(seen.grey[first - 1 : first], count, axis=0)
        change[rows, views] = 0
    grey[rows, views], wrong[rows, views] = instead[:, views], True
    return grey, change, wrong


def main(folders: list[Path]) -> None:
    """Print a line for each recording."""
    print(f"{'':20} flagged  strongest (of {JUMP:g})  " + "  ".join(KINDS))
    for folder in folders:
        recording = open_recording(folder)
        seen, names = thumbnails(recording), [camera.name for camera in recording.cameras]
        room = rooms(seen, recording.background())

        def flagged(grey: F32, change: F64, seen: Thumbnails = seen, room: F32 = room) -> np.ndarray:
            given = Thumbnails(grey=grey, change=change, usable=seen.usable)
            return faults(given, room, recording.frame_rate, names) != ""  # noqa: B023  used in this round only

        steps = picture_checks.distance(np.diff(seen.grey, axis=0))
        bursts = picture_checks.candidates(seen.grey, steps, longest(recording.frame_rate), 0.1)
        strongest = max((found[0] for found in bursts), default=0.0)
        line = f"{folder.name:20} {flagged(seen.grey, seen.change).sum():7} {strongest:10.2f}          "
        rng = np.random.default_rng(2)
        for kind in KINDS:
            trials = [
                (flagged(grey, change), wrong)
                for grey, change, wrong in (spoil(seen, kind, rng) for _ in range(TRIALS))
            ]
            found, too_many = (np.sum([(told & part).sum() for told, part in rows]) for rows in pairs(trials))
            total = np.sum([wrong.sum() for _, wrong in trials])
            line += f"  {100 * found / total:5.0f} % (+{too_many})"
        print(line, flush=True)


def pairs(trials: list[tuple[np.ndarray, np.ndarray]]) -> tuple[list, list]:
    """What was flagged with what was wrong, and with what was right."""
    return trials, [(told, ~wrong) for told, wrong in trials]


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
