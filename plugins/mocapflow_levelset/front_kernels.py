"""Kernels of the moving front: runs of pixels near the contour, log ratio, one step of descent, energy terms."""

from __future__ import annotations

import numba
import numpy as np

from mocapflow_levelset.statistics_kernels import STEP_BINS, STEP_RANGE

BLOCK = 8  # pixels in a vector


@numba.njit(cache=True, error_model="numpy")
def find_runs(level, reach, first):  # type: ignore[no-untyped-def]
    """Return runs made of whole blocks of pixels, the blocks of a row starting at `first`, modulo a block."""
    height, width = level.shape
    runs = np.empty((height * (width // (2 * BLOCK) + 2), 3), np.int32)
    count = 0
    for y in range(height):
        here = level[y]
        start = -1
        left = min(first - BLOCK, 0)
        while left < width:
            a, b = max(left, 0), min(left + BLOCK, width)
            moves = False
            for x in range(a, b):
                moves |= abs(here[x]) < reach
            if moves and start < 0:
                start = a
            elif not moves and start >= 0:
                runs[count, 0], runs[count, 1], runs[count, 2] = y, start, a
                count += 1
                start = -1
            left += BLOCK
        if start >= 0:
            runs[count, 0], runs[count, 1], runs[count, 2] = y, start, width
            count += 1
    return runs[:count].copy()


@numba.njit(cache=True, error_model="numpy")
def log_ratio(runs, values, weight, outside, known, gaussians, cell, first, clip, any_colour, out):  # type: ignore[no-untyped-def]
    """Add the log densities channel by channel along stretches between two cell centres."""
    rows, columns = gaussians.shape[:2]
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
            stretch(gaussians[i, :, 0], gaussians[below, :, 0], fy, j0, j1, start, scale, values, n, inside[: stop - x])
            if not known or np.isnan(outside[n : n + stop - x]).any():
                stretch(
                    gaussians[i, :, 1], gaussians[below, :, 1], fy, j0, j1, start, scale, values, n, beyond[: stop - x]
                )
            if known:
                for k in range(stop - x):
                    if not np.isnan(outside[n + k]):
                        inside[k], beyond[k] = max(inside[k], any_colour), outside[n + k]
            counts, ratio = weight[y, x:stop], out[y, x:stop]
            for k in range(ratio.size):
                ratio[k] = counts[k] * min(max(inside[k] - beyond[k], -clip), clip)
            n += stop - x
            x = stop


@numba.njit(cache=True, error_model="numpy")
def stretch(upper, lower, fy, j0, j1, start, scale, values, n, out):  # type: ignore[no-untyped-def]
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
def advance(level, ratio, prior, runs, change, sigma, nu, shape, tau, band):  # type: ignore[no-untyped-def]
    """Take one step along the runs: data and length explicitly, the shape prior (clipped to the band) implicitly."""
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
            slope = peak * decay(centre * centre * narrow)
            goal = wanted[k] if wanted[k] > -band else -band
            goal = goal if goal < band else band
            out[k] = (centre + slope * (pushed[k] + nu * bend)) * blend + pull * goal
    for n in range(len(runs)):
        y, x0, x1 = runs[n, 0], max(runs[n, 1], 1), min(runs[n, 2], width - 1)
        level[y, x0:x1] = change[y, x0:x1]


@numba.njit(cache=True, error_model="numpy")
def terms(level, ratio, prior, runs, table, sigma, band):  # type: ignore[no-untyped-def]
    """Return data, length and shape terms without their weights, summed along the runs; the data by the ratio alone."""
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
def decay(x):  # type: ignore[no-untyped-def]
    """Return exp(-x) for x >= 0, to 2e-5 of its value up to x = 8, from eight factors exp(-x / 8); it vectorises."""
    z = x * np.float32(0.125)
    z = z if z < np.float32(1) else np.float32(1)
    e = np.float32(0.0382712) - z * np.float32(0.0050758)
    e = np.float32(0.4996010) - z * (np.float32(0.1649499) - z * e)
    e = np.float32(1) - z * (np.float32(0.9999677) - z * e)
    e = e * e
    e = e * e
    return e * e
