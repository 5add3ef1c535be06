"""What gives a wrong picture away: no contrast, another camera's room, a moment that does not fit in."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mocapflow.records import F32, F64, Bool

LEAST_CONTRAST = 1.5  # grey levels, standard deviation of a thumbnail that shows something
FAINT = 0.1  # share of the usual contrast below which nothing is shown
NEARER = 0.5  # a picture is of another camera if it differs from that one's room by less than this share
NOBODY = 0.1  # share of the contrast to its room that a camera's pictures with most in them have; below, nobody is seen
FAST = 4  # times the usual step: no body moves much faster than that, from frame to frame
NEIGHBOURS = 4  # steps before and after a burst that say how fast things move


def contrast(grey: F32) -> F64:
    """Return the standard deviation (...) of thumbnails (..., S, S)."""
    spread: F64 = grey.std(axis=(-2, -1)).astype(np.float64)
    return spread


def blank(grey: F32, room: F32) -> Bool:
    """Return (T, C) which thumbnails (T, C, S, S) show nothing, by what the empty room (C, S, S) shows."""
    return contrast(grey) < np.maximum(LEAST_CONTRAST, FAINT * contrast(room))


def lookalike(grey: F32, room: F32) -> tuple[Bool, npt.NDArray[np.intp]]:
    """Return (T, C) which thumbnails look like another camera's room (C, S, S), and which camera's."""
    off = np.stack([distance(grey - other) for other in room], axis=-1)  # (T, C, C)
    own = np.diagonal(off, axis1=1, axis2=2)
    others = np.where(np.eye(len(room), dtype=bool), np.inf, off)
    return others.min(axis=-1) < NEARER * own, others.argmin(axis=-1)


def shows_person(grey: F32, room: F32, good: Bool) -> Bool:
    """Return (T, C) which thumbnails differ from the empty room (C, S, S): an empty one hardly changes either.

    Args:
        grey: (T, C, S, S) thumbnails.
        room: (C, S, S) likewise, of the empty scene.
        good: (T, C) which of them show what their camera saw: what is usual is theirs.
    """
    off = contrast(grey - room)  # a person dims the whole room, too
    usual = [np.percentile(off[rows, camera], 90) if rows.any() else 0.0 for camera, rows in enumerate(good.T)]
    return off > NOBODY * np.array(usual)


def bursts(grey: F32, longest: int, strong: float, weak: float) -> Bool:
    """Return (T, C) which thumbnails jump away and come back within `longest` frames.

    A jump is a step that exceeds what moves around it by a factor: `strong` in one view at least, `weak` in the
    others that jump with it. Motion starts and ends over several frames; it does not do that.
    """
    steps = distance(np.diff(grey, axis=0))  # step s leads from frame s to s + 1
    found = sorted(candidates(grey, steps, longest, strong), key=lambda burst: -burst[0])
    wrong, taken = np.zeros(grey.shape[:2], bool), np.zeros(len(steps), bool)
    for _, enter, leave, size in found:
        if not taken[enter : leave + 1].any():
            taken[enter : leave + 1] = True
            wrong[enter + 1 : leave + 1] |= size > weak
    return wrong


def candidates(grey: F32, steps: F64, longest: int, strong: float) -> list[tuple[float, int, int, F64]]:
    """Return the strength of each possible burst, the steps into and out of it, and its strength in each view."""
    found: list[tuple[float, int, int, F64]] = []
    if len(steps) < 4:
        return found
    usual = np.maximum(np.median(steps, axis=0), 1e-6)
    slow, fast = usual / 4, np.minimum(np.percentile(steps, 90, axis=0), FAST * usual)  # wrong pictures count in both
    for enter in range(1, len(steps) - 1):
        before = steps[max(0, enter - NEIGHBOURS) : enter].max(axis=0)
        for leave in range(enter + 1, min(enter + longest, len(steps) - 2) + 1):
            after = steps[leave + 1 : leave + 1 + NEIGHBOURS].max(axis=0)
            # a quick gesture moves within as it does at its ends; a torn picture too, but no body is as fast
            within = np.minimum(steps[enter + 1 : leave].max(axis=0, initial=0), fast)
            across = distance(grey[leave + 1] - grey[enter]) / (leave + 1 - enter)  # a step that stays is no burst
            size = np.minimum(steps[enter], steps[leave]) / np.max([slow, before, after, within, across], axis=0)
            if size.max() > strong:
                found.append((float(size.max()), enter, leave, size))
    return found


def distance(difference: F32) -> F64:
    """Return the root mean square (...) of differences of thumbnails (..., S, S)."""
    root: F64 = np.sqrt(np.mean(np.square(difference, dtype=np.float64), axis=(-2, -1)))
    return root


def interpolated(grey: F32, good: Bool) -> F32:
    """Return thumbnails (T, C, S, S) whose bad ones are interpolated in time, so that they make no steps."""
    filled, rows = grey.copy(), np.arange(len(grey))
    for camera in range(grey.shape[1]):
        known = np.flatnonzero(good[:, camera])
        if not len(known):
            continue
        at = np.interp(rows, known, np.arange(len(known)))
        low = known[np.floor(at).astype(int)]
        high = known[np.ceil(at).astype(int)]
        share = (at % 1).astype(np.float32)[:, None, None]
        filled[:, camera] = (1 - share) * grey[low, camera] + share * grey[high, camera]
    return filled
