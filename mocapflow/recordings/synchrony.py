"""How late each camera is against the others, from what they see of the person."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.cameras.views import View
from mocapflow.recordings.paired_views import Signals, keypoint_signals, outline_signals
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, record

FRAMES = 600  # at most, that are looked at
WIDTH = 480  # px, to which larger images are shrunk
SECONDS = 0.5  # the largest lag that is looked for
LEAST = 0.5  # frames; less than that can't be mended by taking another frame
SURE = 3.0  # standard deviations
SHARED = 0.5  # share of the frames that two cameras must both have at a lag
CLIP = 3.0  # standard deviations at the best lag, beyond which an error counts no more
EXACT = 1e-6  # variances that are left at the best lag at least: signals without noise are not infinitely sure
ALIKE = 5  # frames in a row whose errors are alike: they count as one


@record
class Lateness:
    """How many frames a camera's pictures come after those of the others, and its standard deviation."""

    camera: str
    frames: float
    sd: float

    @property
    def sure(self) -> bool:
        """True where it is more than chance, and so much that whole frames can mend it."""
        return abs(self.frames) > max(LEAST, SURE * self.sd)


def measure(whole: Recording) -> list[Lateness]:
    """Return how late each camera of a recording is, on top of what its recording.json says.

    Keypoints tell, where two cameras have enough of them, else the person's outlines.

    Raises:
        RecordingError: too little is seen by two cameras at once.
    """
    scale = min(1.0, WIDTH / max(int(lens.size[0]) for lens in whole.lenses))
    views = tuple(View(lens=lens, scale=scale) for lens in whole.lenses)
    recording = replace(whole, views=views, indices=whole.indices[:FRAMES])
    names = [camera.name for camera in recording.cameras]
    reach = max(min(round(SECONDS * whole.frame_rate), len(recording.indices) // 3), 2)
    with suppress(RecordingError):
        return lateness(names, keypoint_signals(recording), reach)
    return lateness(names, outline_signals(recording), reach)


def lateness(names: Sequence[str], signals: Signals, reach: int) -> list[Lateness]:
    """Return how late each camera is; the middle one counts as punctual.

    Args:
        names: of the cameras.
        signals: what two of them agree on.
        reach: largest lag between two cameras that is looked for, frames.

    Raises:
        RecordingError: too little is seen by two cameras at once.
    """
    pairs = list(combinations(range(len(names)), 2))
    found = [best_lag(*signals(*pair), reach) for pair in pairs]
    known = [(pair, lag, information) for pair, (lag, information) in zip(pairs, found, strict=True) if information > 0]
    matrix = np.zeros((len(known), len(names)))
    for row, ((one, other), _, _) in enumerate(known):
        matrix[row, one], matrix[row, other] = -1, 1
    if len(known) < len(names) - 1 or np.linalg.matrix_rank(matrix) < len(names) - 1:
        raise RecordingError("the cameras see too little of the same person at the same time to be compared")
    lags, weights = (np.array([row[k] for row in known]) for k in (1, 2))
    weighted = matrix * weights[:, None]
    covariance = np.linalg.pinv(matrix.T @ weighted)
    late = covariance @ weighted.T @ lags
    late = (late - np.sort(late)[(len(late) - 1) // 2]).tolist()
    sd = np.sqrt(np.diagonal(covariance)).tolist()
    return [Lateness(camera=name, frames=late[k], sd=sd[k]) for k, name in enumerate(names)]


def best_lag(one: F64, other: F64, reach: int) -> tuple[float, float]:
    """Return by how many frames signals (T, K) of another camera are late against those of one, and the information.

    The information is one over the variance; 0 where nothing moves or too little is known.
    """
    lags = range(-reach, reach + 1)
    errors = [_centred(*_overlapping(one, other, lag)) for lag in lags]
    most = max(np.isfinite(error).sum() for error in errors)
    enough = np.array([np.isfinite(error).sum() >= max(SHARED * most, 2) for error in errors])
    raw = np.array([np.nanmedian(np.abs(e)) if ok else np.inf for e, ok in zip(errors, enough, strict=True)])
    scale = max(1.4826 * float(raw.min()), 1e-9)
    clipped = [np.minimum((e / scale) ** 2, CLIP**2) for e in errors]
    cost = np.array([np.nanmean(c) if ok else np.inf for c, ok in zip(clipped, enough, strict=True)])
    at = int(np.argmin(cost))
    if not 0 < at < len(lags) - 1 or not np.isfinite(cost[at - 1 : at + 2]).all():
        return 0.0, 0.0
    before, least, after = cost[at - 1 : at + 2]
    bend = before - 2 * least + after
    independent = np.isfinite(errors[at]).any(axis=1).sum() / ALIKE
    information = bend / (2 * max(least, EXACT)) * independent
    return float(lags[at] + (before - after) / (2 * bend)), float(information)


def _overlapping(one: F64, other: F64, lag: int) -> tuple[F64, F64]:
    """Return the rows of two signals that show the same moments if the other is late by `lag` frames."""
    count = len(one) - abs(lag)
    return one[max(0, -lag) :][:count], other[max(0, lag) :][:count]


def _centred(one: F64, other: F64) -> F64:
    """Return the difference of two signals less its median: a calibration that is a little off makes no lag."""
    difference = one - other
    known = np.isfinite(difference).any(axis=0)
    middle = np.zeros(difference.shape[1])
    middle[known] = np.nanmedian(difference[:, known], axis=0)
    return difference - middle
