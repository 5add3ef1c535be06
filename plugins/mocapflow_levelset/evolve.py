"""The level set in motion: kernels over the runs of pixels near the contour."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from mocapflow.records import F32, I32
from mocapflow_levelset.plates import Plate, Shadow, plate_density
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.statistics import STEP_BINS, STEP_RANGE, Window, local_gaussians, step_table, totals

FRONT = 3.5  # sigmas: beyond, the slope of the smooth step is below 0.3 % of its peak


class Evidence(NamedTuple):
    """What an image says, on one grid."""

    features: F32  # (C, H, W) in [0, 1]
    weight: F32  # (H, W) 1 where a pixel counts, 0 where it is masked
    plate: Plate | None = None  # the empty scene, where it is known
    shadow: Shadow | None = None


class Weights(NamedTuple):
    """The constants of the energy and of its descent."""

    sigma_px: float
    length: float
    shape: float
    clip: float  # bound on the log ratio
    step: float  # size of a time step
    band_px: float


class Rhythm(NamedTuple):
    """How many steps, and how often statistics and distances are renewed."""

    steps: int
    statistics_every: int
    redistance_every: int


class Settled(NamedTuple):
    """Where the descent ended and what it costs."""

    level: F32  # (H, W) px, signed distance within the band
    data: float  # -sum of H log(p1 / p2) near the contour
    length: float
    shape: float


def settle(level: F32, prior: F32, evidence: Evidence, window: Window, weights: Weights, rhythm: Rhythm) -> Settled:
    """Descend from `level` for some steps, renewing statistics and distances in between.

    Args:
        level: (H, W) px, positive inside; only its zero contour counts.
        prior: (H, W) px, signed distance to the model's outline.
        evidence: features, mask and plate on the same grid.
        window: how local the statistics are.
        weights: the constants of energy and descent.
        rhythm: how many steps, and how often the rest is renewed.

    Source: Rosenhahn 2008, Eq. (12.10)
    """
    sums = totals(evidence.features, evidence.weight, window.cell_px)
    level = redistance(level, weights.band_px)
    prior = np.clip(prior, -weights.band_px, weights.band_px)
    ratio, change = np.zeros_like(level), np.empty_like(level)
    runs = near(level, prior, weights)
    for step in range(rhythm.steps):
        if step and step % rhythm.redistance_every == 0:
            level = redistance(level, weights.band_px)
        if step % rhythm.statistics_every == 0:
            gaussians = local_gaussians(evidence.features, evidence.weight, level, sums, window, weights.sigma_px)
            runs = near(level, prior, weights)
            log_ratio(runs, evidence, gaussians, window.cell_px, weights.clip, ratio)
        advance(level, ratio, prior, runs, change, weights)
    level = redistance(level, weights.band_px)
    table = step_table(weights.sigma_px)
    data, length, shape = _terms(level, ratio, prior, table, np.float32(weights.sigma_px))
    return Settled(level, float(data), weights.length * float(length), weights.shape * float(shape))


def near(level: F32, prior: F32, weights: Weights) -> I32:
    """Return the runs of pixels that may change, rows of (y, first x, last x + 1)."""
    reach = FRONT * weights.sigma_px + 2
    runs: I32 = _runs(level, prior, np.float32(reach), np.float32(weights.band_px - 1e-3), weights.shape > 0)
    return runs


def log_ratio(runs: I32, evidence: Evidence, gaussians: F32, cell_px: int, clip: float, out: F32) -> None:
    """Write log p1 - log p2, clipped, into `out` (H, W) along the runs; masked pixels get 0."""
    plate, shadow = evidence.plate, evidence.shadow
    if plate is None or shadow is None:
        _log_ratio(runs, evidence.features, evidence.weight, gaussians, cell_px, np.float32(clip), out)
        return
    constants = tuple(np.float32(value) for value in shadow)
    _log_ratio_plate(
        runs,
        evidence.features,
        evidence.weight,
        plate.features,
        plate.spread,
        constants,
        gaussians,
        cell_px,
        np.float32(clip),
        out,
    )


def advance(level: F32, ratio: F32, prior: F32, runs: I32, change: F32, weights: Weights) -> None:
    """Take one step in place: data and length explicitly, the shape prior implicitly (stable for any weight)."""
    _advance(
        level,
        ratio,
        prior,
        runs,
        change,
        np.float32(weights.sigma_px),
        np.float32(weights.length),
        np.float32(weights.shape),
        np.float32(weights.step),
    )


@numba.njit(cache=True)
def _runs(level, prior, reach, band, shape):  # type: ignore[no-untyped-def]
    height, width = level.shape
    runs = np.empty((height * (width // 2 + 1), 3), np.int32)
    count = 0
    for y in range(height):
        start = -1
        for x in range(width):
            moves = abs(level[y, x]) < reach or (shape and (abs(level[y, x]) < band or abs(prior[y, x]) < band))
            if moves and start < 0:
                start = x
            elif not moves and start >= 0:
                runs[count, 0], runs[count, 1], runs[count, 2] = y, start, x
                count += 1
                start = -1
        if start >= 0:
            runs[count, 0], runs[count, 1], runs[count, 2] = y, start, width
            count += 1
    return runs[:count].copy()


@numba.njit(cache=True)
def _log_ratio(runs, features, weight, gaussians, cell, clip, out):  # type: ignore[no-untyped-def]
    entries = gaussians.shape[3]
    inside, outside = np.empty(entries, np.float32), np.empty(entries, np.float32)
    for n in range(len(runs)):
        y = runs[n, 0]
        for x in range(runs[n, 1], runs[n, 2]):
            _interpolate(gaussians, cell, y, x, 0, inside)
            _interpolate(gaussians, cell, y, x, 1, outside)
            ratio = _log_gaussian(features, y, x, inside) - _log_gaussian(features, y, x, outside)
            out[y, x] = weight[y, x] * min(max(ratio, -clip), clip)


@numba.njit(cache=True)
def _log_ratio_plate(  # type: ignore[no-untyped-def]
    runs, features, weight, plate, spread, shadow, gaussians, cell, clip, out
):
    inside = np.empty(gaussians.shape[3], np.float32)
    for n in range(len(runs)):
        y = runs[n, 0]
        image, empty = features[:, y], plate[:, y]
        for x in range(runs[n, 1], runs[n, 2]):
            _interpolate(gaussians, cell, y, x, 0, inside)
            person = max(_log_gaussian(features, y, x, inside), shadow[3])
            ratio = person - plate_density(image, empty, spread[y, x], shadow, x)
            out[y, x] = weight[y, x] * min(max(ratio, -clip), clip)


@numba.njit(cache=True)
def _interpolate(gaussians, cell, y, x, region, out):  # type: ignore[no-untyped-def]
    """Write a region's Gaussian at a pixel into `out`: bilinear between the centres of the cells."""
    rows, columns, _, entries = gaussians.shape
    scale, shift, zero, one = np.float32(1 / cell), np.float32((cell - 1) / 2), np.float32(0), np.float32(1)
    v = min(max((np.float32(y) - shift) * scale, zero), np.float32(rows - 1))
    u = min(max((np.float32(x) - shift) * scale, zero), np.float32(columns - 1))
    i, j = int(v), int(u)
    below, right = min(i + 1, rows - 1), min(j + 1, columns - 1)
    fy, fx = v - np.float32(i), u - np.float32(j)
    w00, w01, w10, w11 = (one - fy) * (one - fx), (one - fy) * fx, fy * (one - fx), fy * fx
    a, b = gaussians[i, j, region], gaussians[i, right, region]
    c, d = gaussians[below, j, region], gaussians[below, right, region]
    for k in range(entries):
        out[k] = w00 * a[k] + w01 * b[k] + w10 * c[k] + w11 * d[k]


@numba.njit(cache=True)
def _log_gaussian(features, y, x, gaussian):  # type: ignore[no-untyped-def]
    channels = features.shape[0]
    total = gaussian[0]
    for c in range(channels):
        off = features[c, y, x] - gaussian[1 + c]
        total -= off * off * gaussian[1 + channels + c]
    return total


@numba.njit(cache=True)
def _advance(level, ratio, prior, runs, change, sigma, nu, shape, tau):  # type: ignore[no-untyped-def]
    height, width = level.shape
    one, two, half, quarter = np.float32(1), np.float32(2), np.float32(0.5), np.float32(0.25)
    peak = tau / (np.float32(np.sqrt(2 * np.pi)) * sigma)
    narrow = half / (sigma * sigma)
    blend = one / (one + 2 * tau * shape)
    pull = one - blend
    for n in range(len(runs)):
        y, first, last = runs[n, 0], runs[n, 1], runs[n, 2]
        up, here, down = level[max(y - 1, 0)], level[y], level[min(y + 1, height - 1)]
        pushed, wanted, out = ratio[y], prior[y], change[y]
        for x in range(max(first, 1), min(last, width - 1)):
            centre = here[x]
            dx, dy = half * (here[x + 1] - here[x - 1]), half * (down[x] - up[x])
            dxx = here[x + 1] - two * centre + here[x - 1]
            dyy = down[x] - two * centre + up[x]
            dxy = quarter * (down[x + 1] - down[x - 1] - up[x + 1] + up[x - 1])
            square = dx * dx + dy * dy + np.float32(1e-6)
            bend = (dxx * dy * dy - two * dx * dy * dxy + dyy * dx * dx) / (square * np.sqrt(square))
            bend = bend if bend > -one else -one
            bend = bend if bend < one else one
            slope = peak * _decay(centre * centre * narrow)
            out[x] = (centre + slope * (pushed[x] + nu * bend)) * blend + pull * wanted[x]
        if first == 0:
            out[0] = here[0]
        if last == width:
            out[width - 1] = here[width - 1]
    for n in range(len(runs)):
        y, first, last = runs[n, 0], runs[n, 1], runs[n, 2]
        level[y, first:last] = change[y, first:last]


@numba.njit(cache=True)
def _terms(level, ratio, prior, table, sigma):  # type: ignore[no-untyped-def]
    """Return data, length and shape terms without their weights; the length is that of forward differences of H."""
    height, width = level.shape
    data, length, shape = 0.0, 0.0, 0.0
    step = np.empty((2, width), np.float32)
    reach = np.float32(STEP_RANGE) * sigma
    bins = np.float32(STEP_BINS) / (2 * reach)
    for y in range(height):
        here, before = step[y % 2], step[(y + 1) % 2]
        for x in range(width):
            here[x] = table[int((min(max(level[y, x], -reach), reach) + reach) * bins)]
            off = level[y, x] - prior[y, x]
            shape += off * off
            data -= here[x] * ratio[y, x]
            if x and y:
                length += np.sqrt((here[x] - here[x - 1]) ** 2 + (here[x] - before[x]) ** 2)
    return data, length, shape


@numba.njit(cache=True, inline="always")
def _decay(x):  # type: ignore[no-untyped-def]
    """Return exp(-x) for x >= 0, to 2e-5 of its value up to x = 8, from eight factors exp(-x / 8); it vectorises."""
    z = x * np.float32(0.125)
    z = z if z < np.float32(1) else np.float32(1)
    e = np.float32(0.0382712) - z * np.float32(0.0050758)
    e = np.float32(0.4996010) - z * (np.float32(0.1649499) - z * e)
    e = np.float32(1) - z * (np.float32(0.9999677) - z * e)
    e = e * e
    e = e * e
    return e * e
