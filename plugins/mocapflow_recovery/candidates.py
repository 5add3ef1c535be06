"""Which of many poses are worth a search: unlike each other, or looking different ways."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.data import Pose
from mocapflow.records import F64
from mocapflow_recovery.placing import heading_between

ALIKE = 1.5  # times the least cost: so little worse, and another direction may be the right one
OTHERWISE = np.radians(30.0)  # between two directions that a person looks in


def likely_headings(poses: Sequence[Pose], off: F64) -> list[int]:
    """Return which of some poses may be right by their costs (B,), best first: one of each way that a person looks."""
    chosen: list[int] = []
    for row in np.argsort(off)[: np.count_nonzero(off <= ALIKE * off.min())]:
        if all(heading_between(poses[row], poses[other]) > OTHERWISE for other in chosen):
            chosen.append(int(row))
    return chosen


def separate_minima(off: F64, count: int) -> list[int]:
    """Return the directions, of N around a circle (N,), of least cost, best first; none beside a better one."""
    chosen: list[int] = []
    for turn in np.argsort(off):
        if all(abs(int(turn) - other) not in (1, len(off) - 1) for other in chosen):
            chosen.append(int(turn))
    return chosen[:count]


def farthest_points(poses: F64, count: int) -> list[F64]:
    """Return the rest pose and those of N poses (N, D) that are farthest from it and each other."""
    chosen, away = [np.zeros(poses.shape[1])], np.full(len(poses), np.inf)
    while len(chosen) < min(count, len(poses) + 1):
        away = np.minimum(away, ((poses - chosen[-1]) ** 2).sum(axis=1))
        chosen.append(poses[int(away.argmax())])
    return chosen
