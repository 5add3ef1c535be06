"""How far one angle curve is from another: the figures of a row of the evaluation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mocapflow.records import F64

# errors hang together for a third of a second, so the bootstrap draws whole blocks of three times that
BLOCK_S = 1.0
LEAST_BLOCKS = 4  # of a short take, whose blocks are shorter
DRAWS = 1000
SEED = 0
NINETY = 1.6449  # standard deviations
NINETY_FIVE = 1.96  # standard deviations
ANGLE_LAG_S = 0.2  # of one curve behind the other; more would leave too little of a short take to compare


def figures(ours: F64, truth: F64, sd: F64, frame: F64, rate: float) -> dict[str, float]:
    """Return the deviations of ours from the truth over all frames that have both (degrees, frames).

    Args:
        ours: (T,) deg.
        truth: (T,) deg.
        sd: (T,) deg, our own standard deviations.
        frame: (T,) frame numbers.
        rate: frames per second.
    """
    late = lag(ours, truth, rate)
    both = np.isfinite(ours) & np.isfinite(truth)
    ours, truth, sd, frame = ours[both], truth[both], sd[both], frame[both]
    error = ours - truth
    size, offset = np.abs(error), float(np.mean(error))
    low, high = rms_interval(error, rate)
    known = np.isfinite(sd)
    return {
        "frames": len(error),
        "rms_deg": rms(error),
        "rms_low_deg": low,
        "rms_high_deg": high,
        "rms_without_offset_deg": rms(error - offset),
        "mae_deg": float(np.mean(size)),
        "offset_deg": offset,
        "p95_deg": float(np.percentile(size, 95)),
        "max_deg": float(np.max(size)),
        "worst_frame": int(frame[np.argmax(size)]),
        "correlation": correlation(ours, truth),
        "lag_frames": late,
        "coverage_90": float(np.mean(size[known] <= NINETY * sd[known])) if known.any() else np.nan,
        **agreement(error),
        "rom_deg": float(np.ptp(ours)),
        "rom_reference_deg": float(np.ptp(truth)),
        "cmc": cmc(np.stack([ours, truth])[None]),
    }


def agreement(error: F64) -> dict[str, float]:
    """Return the limits between which 95 % of the differences lie, deg: Bland & Altman, Lancet 327 (1986), 307."""
    half = NINETY_FIVE * float(np.std(error, ddof=1)) if len(error) > 1 else np.nan
    middle = float(np.mean(error))
    return {"agreement_low_deg": middle - half, "agreement_high_deg": middle + half}


def cmc(curves: F64) -> float:
    """Return the coefficient of multiple correlation of two systems that saw the same motion: 1 where they agree.

    Ferrari, Cutti, Cappello, Gait & Posture 31 (2010), 540: an offset or another gain between the systems lowers it.
    NaN where they differ by more than the curves move.

    Args:
        curves: (G, P, F), of G cycles by P systems at F times.
    """
    cycles, systems, times = curves.shape
    between = np.sum((curves - curves.mean(axis=1, keepdims=True)) ** 2) / (cycles * times * (systems - 1))
    about = np.sum((curves - curves.mean(axis=(1, 2), keepdims=True)) ** 2) / (cycles * (systems * times - 1))
    return float(np.sqrt(1 - between / about)) if 0 < about >= between else np.nan


def rms(error: F64) -> float:
    """Return the root of the mean square of what is finite, NaN of nothing."""
    known = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else np.nan


def rms_interval(error: F64, rate: float) -> tuple[float, float]:
    """Return the 95 % interval of the RMS of an error (T,) by a circular block bootstrap with a fixed seed.

    A short take has few blocks to draw from and can't tell how much another one would differ. Where errors hang
    together for a third of a second, the interval holds the true RMS of 86 % of takes of 30 s (simulated; of 16 s 83,
    of 8 s 77, of 4 s 70, of 2 s 60 %), at any frame rate.
    """
    drawn = np.sqrt(np.mean(error[drawn_blocks(len(error), rate)] ** 2, axis=1))
    return middle_95(drawn, len(error))


def middle_95(drawn: F64, count: int) -> tuple[float, float]:
    """Return between which values 95 % of draws (DRAWS,) from so many frames lie; NaN of too few to draw from."""
    low, high = np.percentile(drawn, [2.5, 97.5]) if count >= LEAST_BLOCKS else (np.nan, np.nan)
    return float(low), float(high)


def drawn_blocks(count: int, rate: float) -> npt.NDArray[np.intp]:
    """Return row numbers (DRAWS, count) of a circular block bootstrap of so many rows per second, always the same."""
    block = min(max(round(BLOCK_S * rate), 1), -(-count // LEAST_BLOCKS))
    starts = np.random.default_rng(SEED).integers(0, count, size=(DRAWS, -(-count // block)))
    return (starts[:, :, None] + np.arange(block)).reshape(DRAWS, -1)[:, :count] % count


def correlation(ours: F64, truth: F64) -> float:
    """Return Pearson's correlation, NaN where a curve does not move."""
    a, b = ours - ours.mean(), truth - truth.mean()
    scale = np.linalg.norm(a) * np.linalg.norm(b)
    return float(a @ b / scale) if scale > 0 else np.nan


def lag(ours: F64, truth: F64, rate: float) -> float:
    """Return by how many frames ours comes later than the truth, to a fraction of a frame; NaN where none fits best.

    It minimises the mean square of the difference without its mean, over the frames (T,) that have both at every shift,
    and places the minimum by a parabola through the best shift and its neighbours.
    """
    known = np.flatnonzero(np.isfinite(ours) & np.isfinite(truth))
    if not len(known) or np.ptp(truth[known]) == 0:
        return np.nan
    ours, truth = (curve[known[0] : known[-1] + 1] for curve in (ours, truth))
    reach = min(round(ANGLE_LAG_S * rate), (len(ours) - 1) // 3)
    shifts = np.arange(-reach, reach + 1)
    middle = truth[reach : len(truth) - reach]
    off = np.stack([ours[reach + s : len(ours) - reach + s] - middle for s in shifts])  # (S, T)
    shared = np.isfinite(off).all(axis=0)
    if reach < 1 or 3 * shared.sum() < len(known):
        return np.nan
    spread = off[:, shared].var(axis=1)
    best = int(np.argmin(spread))
    if spread[best] == 0:
        return float(shifts[best])
    return turning_point(shifts, spread, best)


def turning_point(shifts: npt.NDArray[np.intp], values: F64, best: int) -> float:
    """Return where a parabola through the best of values (S,) and its neighbours turns; NaN at the first and the last.

    It is the whole shift where a neighbour is not known (infinite).
    """
    if best in (0, len(values) - 1):
        return np.nan
    before, at, after = values[best - 1 : best + 2]
    bend = before - 2 * at + after
    return float(shifts[best] + (0.5 * (before - after) / bend if np.isfinite(bend) and bend else 0.0))
