"""Which frames of a stored track have no trace: those that were tracked while nobody asked for one."""

from __future__ import annotations

from collections.abc import Sequence

from mocapflow.storage.artifacts import Artifact
from mocapflow.storage.growing import TRACE
from mocapflow.storage.rows import Corrupted, Rows


def untraced(artifact: Artifact, indices: Sequence[int]) -> str:
    """Return for people which of the committed frames have no readable trace, such as `0–11, 20`; empty: all have.

    Args:
        artifact: the track, half done or finished.
        indices: of the wanted frames; each is a row.
    """
    ends: list[list[int]] = []  # the first and last row of each stretch
    for row in range(min(artifact.frames, len(indices))):
        if _traced(artifact, row):
            continue
        if ends and ends[-1][1] == row - 1:
            ends[-1][1] = row
        else:
            ends.append([row, row])
    return ", ".join(f"{indices[a]}" if a == b else f"{indices[a]}–{indices[b]}" for a, b in ends)


def _traced(artifact: Artifact, row: int) -> bool:
    try:
        Rows(artifact.path / TRACE).read(row)
    except Corrupted:
        return False
    return True
