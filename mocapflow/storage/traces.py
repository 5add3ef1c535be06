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
    rows = range(min(artifact.frames, len(indices)))
    try:
        trace = Rows(artifact.path / TRACE)
        lacking = {row for row in rows if not _is_there(trace, row)}
    except Corrupted:
        lacking = set(rows)
    firsts = [row for row in sorted(lacking) if row - 1 not in lacking]
    lasts = [row for row in sorted(lacking) if row + 1 not in lacking]
    ends = [(indices[a], indices[b]) for a, b in zip(firsts, lasts, strict=True)]
    return ", ".join(f"{a}" if a == b else f"{a}–{b}" for a, b in ends)


def _is_there(trace: Rows, row: int) -> bool:
    try:
        trace.read(row)
    except Corrupted:
        return False
    return True
