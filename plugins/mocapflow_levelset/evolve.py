"""The level set in motion: kernels over the runs of pixels near the contour."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from mocapflow.records import F32, I32
from mocapflow_levelset.evidence import Evidence
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.statistics import STEP_BINS, STEP_RANGE, Window, local_gaussians, step_table, totals

FRONT = 3.5  # sigmas: beyond, the slope of the smooth step is below 0.3 % of its peak

BLOCK = 8  # pixels in a vector; runs are made of whole blocks


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
    stride = evidence.stride
    weight = np.ascontiguousarray(evidence.weight[::stride, ::stride])
    grid = Window(window.rho_px / stride, max(window.cell_px // stride, 1), window.floor)
    first = (grid.cell_px - 1) * stride // 2
    reach = FRONT * weights.sigma_px / stride + 3 * grid.cell_px
    sums = totals(evidence.sparse, weight, grid.cell_px)
    level = redistance(level, weights.band_px)
    ratio, change = np.zeros_like(level), np.empty_like(level)
    runs = near(level, prior, weights, first)
    for step in range(rhythm.steps):
        if step and step % rhythm.redistance_every == 0:
            level = redistance(level, weights.band_px)
        if step % rhythm.statistics_every == 0:
            sparse = np.ascontiguousarray(level[::stride, ::stride]) / np.float32(stride)
            gaussians = local_gaussians(evidence.sparse, weight, sparse, sums, grid, weights.sigma_px / stride, reach)
            runs = near(level, prior, weights, first)
            log_ratio(runs, evidence, gaussians, grid.cell_px * stride, stride, weights.clip, ratio)
        advance(level, ratio, prior, runs, change, weights)
    table = step_table(weights.sigma_px)
    data, length, shape = _terms(
        level, ratio, prior, runs, table, np.float32(weights.sigma_px), np.float32(weights.band_px)
    )
    return Settled(level, float(data), weights.length * float(length), weights.shape * float(shape))


def near(level: F32, prior: F32, weights: Weights, first: int = 0) -> I32:
    """Return the runs of pixels that may change, rows of (y, first x, last x + 1)."""
    reach = FRONT * weights.sigma_px
    band = np.float32(weights.band_px - 1e-3)
    runs: I32 = _runs(level, prior, np.float32(reach), band, weights.shape > 0, BLOCK, first)
    return runs


def log_ratio(runs: I32, evidence: Evidence, gaussians: F32, cell_px: int, stride: int, clip: float, out: F32) -> None:
    """Write log p1 - log p2, clipped, into `out` (H, W) along the runs; masked pixels get 0.

    Outside, the empty scene speaks where it is known, else the local statistics.
    """
    values = evidence.along(runs)
    known = evidence.outside is not None
    outside = evidence.outside(runs) if evidence.outside is not None else np.empty(0, np.float32)
    first = np.float32((cell_px // stride - 1) * stride / 2)  # centre of the first cell's pixels
    _log_ratio(runs, values, evidence.weight, outside, known, gaussians, cell_px, first, np.float32(clip), out)


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
        np.float32(weights.band_px),
    )


@numba.njit(cache=True, error_model="numpy")
def _runs(level, prior, reach, band, shape, block, first):  # type: ignore[no-untyped-def]
    """Return runs made of whole blocks of pixels, the blocks of a row starting at `first`, modulo a block."""
    height, width = level.shape
    runs = np.empty((height * (width // (2 * block) + 2), 3), np.int32)
    count = 0
    for y in range(height):
        here, wanted = level[y], prior[y]
        start = -1
        left = min(first - block, 0)
        while left < width:
            a, b = max(left, 0), min(left + block, width)
            moves = False
            for x in range(a, b):
                moves |= abs(here[x]) < reach
            if shape and not moves:
                for x in range(a, b):
                    moves |= abs(here[x]) < band or abs(wanted[x]) < band
            if moves and start < 0:
                start = a
            elif not moves and start >= 0:
                runs[count, 0], runs[count, 1], runs[count, 2] = y, start, a
                count += 1
                start = -1
            left += block
        if start >= 0:
            runs[count, 0], runs[count, 1], runs[count, 2] = y, start, width
            count += 1
    return runs[:count].copy()


@numba.njit(cache=True, error_model="numpy")
def _log_ratio(runs, values, weight, outside, known, gaussians, cell, first, clip, out):  # type: ignore[no-untyped-def]
    """Add the log densities channel by channel along stretches between two cell centres."""
    rows, columns, _, entries = gaussians.shape
    zero, scale = np.float32(0), np.float32(1 / cell)
    inside, beyond = np.empty(weight.shape[1], np.float32), np.empty(weight.shape[1], np.float32)
    n = 0
    for r in range(len(runs)):
        y, x, end = runs[r, 0], runs[r, 1], runs[r, 2]
        v = min(max((np.float32(y) - first) * scale, zero), np.float32(rows - 1))
        i = int(v)
        below, fy = min(i + 1, rows - 1), v - np.float32(i)
        while x < end:
            j = int(np.floor((np.float32(x) - first) * scale))
            stop = min(max(int(np.ceil(first + np.float32(j + 1) * np.float32(cell))), x + 1), end)
            j0, j1 = min(max(j, 0), columns - 1), min(max(j + 1, 0), columns - 1)
            start = (np.float32(x) - first) * scale - np.float32(j)
            _stretch(
                gaussians[i, :, 0], gaussians[below, :, 0], fy, j0, j1, start, scale, values, n, inside[: stop - x]
            )
            if known:
                for k in range(stop - x):
                    inside[k] = max(inside[k], -clip)
                    beyond[k] = outside[n + k]
            else:
                _stretch(
                    gaussians[i, :, 1], gaussians[below, :, 1], fy, j0, j1, start, scale, values, n, beyond[: stop - x]
                )
            counts, ratio = weight[y, x:stop], out[y, x:stop]
            for k in range(ratio.size):
                ratio[k] = counts[k] * min(max(inside[k] - beyond[k], -clip), clip)
            n += stop - x
            x = stop


@numba.njit(cache=True, error_model="numpy")
def _stretch(upper, lower, fy, j0, j1, start, scale, values, n, out):  # type: ignore[no-untyped-def]
    """Write the log density of pixels n, n + 1, … under a Gaussian interpolated between the cells j0 and j1."""
    channels = values.shape[0]
    a, b = upper[j0, 0] + fy * (lower[j0, 0] - upper[j0, 0]), upper[j1, 0] + fy * (lower[j1, 0] - upper[j1, 0])
    slope = (b - a) * scale
    level = a + start * (b - a)
    for k in range(out.size):
        out[k] = level + np.float32(np.int32(k)) * slope
    for c in range(channels):
        m, s = 1 + c, 1 + channels + c
        a, b = upper[j0, m] + fy * (lower[j0, m] - upper[j0, m]), upper[j1, m] + fy * (lower[j1, m] - upper[j1, m])
        mean, mean_slope = a + start * (b - a), (b - a) * scale
        a, b = upper[j0, s] + fy * (lower[j0, s] - upper[j0, s]), upper[j1, s] + fy * (lower[j1, s] - upper[j1, s])
        sharp, sharp_slope = a + start * (b - a), (b - a) * scale
        line = values[c, n : n + out.size]
        for k in range(out.size):
            along = np.float32(np.int32(k))
            off = line[k] - (mean + along * mean_slope)
            out[k] -= off * off * (sharp + along * sharp_slope)


@numba.njit(cache=True, error_model="numpy")
def _advance(level, ratio, prior, runs, change, sigma, nu, shape, tau, band):  # type: ignore[no-untyped-def]
    height, width = level.shape
    one, two, half, quarter = np.float32(1), np.float32(2), np.float32(0.5), np.float32(0.25)
    tiny = np.float32(1e-6)
    peak = tau / (np.float32(np.sqrt(2 * np.pi)) * sigma)
    narrow = half / (sigma * sigma)
    blend = one / (one + two * tau * shape)
    pull = one - blend
    for n in range(len(runs)):
        y, x0, x1 = runs[n, 0], max(runs[n, 1], 1), min(runs[n, 2], width - 1)
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        # one slice per neighbour: an index k + 1 might wrap around for all the compiler knows, and would not vectorise
        here, west, east = level[y, x0:x1], level[y, x0 - 1 : x1 - 1], level[y, x0 + 1 : x1 + 1]
        north, south = level[above, x0:x1], level[below, x0:x1]
        north_west, north_east = level[above, x0 - 1 : x1 - 1], level[above, x0 + 1 : x1 + 1]
        south_west, south_east = level[below, x0 - 1 : x1 - 1], level[below, x0 + 1 : x1 + 1]
        pushed, wanted, out = ratio[y, x0:x1], prior[y, x0:x1], change[y, x0:x1]
        for k in range(out.size):
            centre = here[k]
            dx, dy = half * (east[k] - west[k]), half * (south[k] - north[k])
            dxx = east[k] - two * centre + west[k]
            dyy = south[k] - two * centre + north[k]
            dxy = quarter * (south_east[k] - south_west[k] - north_east[k] + north_west[k])
            square = dx * dx + dy * dy + tiny
            bend = (dxx * dy * dy - two * dx * dy * dxy + dyy * dx * dx) / (square * np.sqrt(square))
            bend = bend if bend > -one else -one
            bend = bend if bend < one else one
            slope = peak * _decay(centre * centre * narrow)
            goal = wanted[k] if wanted[k] > -band else -band
            goal = goal if goal < band else band
            out[k] = (centre + slope * (pushed[k] + nu * bend)) * blend + pull * goal
    for n in range(len(runs)):
        y, x0, x1 = runs[n, 0], max(runs[n, 1], 1), min(runs[n, 2], width - 1)
        level[y, x0:x1] = change[y, x0:x1]


@numba.njit(cache=True, error_model="numpy")
def _terms(level, ratio, prior, runs, table, sigma, band):  # type: ignore[no-untyped-def]
    """Return data, length and shape terms without their weights, summed along the runs."""
    height, width = level.shape
    data, length, shape = 0.0, 0.0, 0.0
    reach = np.float32(STEP_RANGE) * sigma
    bins = np.float32(STEP_BINS / 2) / reach
    for n in range(len(runs)):
        y, x0, x1 = runs[n]
        below = min(y + 1, height - 1)
        for x in range(x0, x1):
            right = min(x + 1, width - 1)
            step = table[int((min(max(level[y, x], -reach), reach) + reach) * bins)]
            dx = table[int((min(max(level[y, right], -reach), reach) + reach) * bins)] - step
            dy = table[int((min(max(level[below, x], -reach), reach) + reach) * bins)] - step
            off = level[y, x] - min(max(prior[y, x], -band), band)
            shape += off * off
            data -= step * ratio[y, x]
            length += np.sqrt(dx * dx + dy * dy)
    return data, length, shape


@numba.njit(cache=True, inline="always", error_model="numpy")
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
