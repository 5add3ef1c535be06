"""Compiled kernels of `statistics`: sums over cells, the part inside a level set, Gaussians of both regions."""

from __future__ import annotations

import numba
import numpy as np

STEP_RANGE = 4.5  # sigmas beyond which the smooth step counts as 0 or 1
STEP_BINS = 512
FAINT = 1e-3  # share of the window below which a region takes its global statistics


@numba.njit(cache=True, error_model="numpy")
def totals(features, weight, cell):  # type: ignore[no-untyped-def]
    """Return the sums of weight, weight F and weight F^2 per cell, (h, w, 1 + 2 C)."""
    channels, height, width = features.shape
    rows, columns = (height + cell - 1) // cell, (width + cell - 1) // cell
    sums = np.zeros((rows, columns, 1 + 2 * channels), np.float32)
    for y in range(height):
        row = sums[y // cell]
        for x in range(width):
            row[x // cell, 0] += weight[y, x]
        for c in range(channels):
            line = features[c, y]
            for x in range(width):
                value = weight[y, x] * line[x]
                row[x // cell, 1 + c] += value
                row[x // cell, 1 + channels + c] += value * line[x]
    return sums


@numba.njit(cache=True, error_model="numpy")
def inside_sums(features, weight, level, sums, cell, table, sigma):  # type: ignore[no-untyped-def]
    """Return the sums weighted with the smooth step.

    A cell starts as all in or all out, by its middle; only pixels that differ from that are visited.
    """
    channels, height, width = features.shape
    rows, columns = sums.shape[:2]
    out = np.empty_like(sums)
    reach = np.float32(STEP_RANGE) * sigma
    bins = np.float32(STEP_BINS / 2) / reach
    most = np.float32(STEP_BINS - 1)
    for i in range(rows):
        for j in range(columns):
            middle = level[min(i * cell + cell // 2, height - 1), min(j * cell + cell // 2, width - 1)] > 0
            usual = np.float32(middle)
            for k in range(out.shape[2]):
                out[i, j, k] = usual * sums[i, j, k]
            for y in range(i * cell, min((i + 1) * cell, height)):
                for x in range(j * cell, min((j + 1) * cell, width)):
                    distance = level[y, x]
                    if (distance >= reach and middle) or (distance <= -reach and not middle):
                        continue
                    place = min(max((distance + reach) * bins, np.float32(0)), most)
                    k = int(place)
                    step = table[k] + (place - np.float32(k)) * (table[k + 1] - table[k])
                    extra = (step - usual) * weight[y, x]
                    out[i, j, 0] += extra
                    for c in range(channels):
                        value = features[c, y, x]
                        out[i, j, 1 + c] += extra * value
                        out[i, j, 1 + channels + c] += extra * value * value
    return out


@numba.njit(cache=True, error_model="numpy")
def gaussians(smooth, everywhere, level, cell, reach, scale, least_variance):  # type: ignore[no-untyped-def]
    """Return log norm, means and 1 / (2 variance) of both regions, blended to global where the window is empty.

    Cells further than `reach` from the contour are left zero.
    """
    rows, columns, twice = smooth.shape
    height, width = level.shape
    entries = twice // 2
    channels = (entries - 1) // 2
    out = np.zeros((rows, columns, 2, entries), np.float32)
    one, two_pi = np.float32(1), np.float32(2 * np.pi)
    for i in range(rows):
        for j in range(columns):
            middle = level[min(i * cell + cell // 2, height - 1), min(j * cell + cell // 2, width - 1)]
            if abs(middle) > reach:
                continue
            for region in range(2):
                at = region * entries
                whole = max(everywhere[at], np.float32(1e-6))
                share = smooth[i, j, at] * scale
                trust = share / (share + np.float32(FAINT))
                inverse = scale / max(share, np.float32(1e-12))
                product = one
                for c in range(channels):
                    first, second = 1 + c, 1 + channels + c
                    far_mean = everywhere[at + first] / whole
                    far_variance = everywhere[at + second] / whole - far_mean * far_mean
                    mean = smooth[i, j, at + first] * inverse
                    variance = smooth[i, j, at + second] * inverse - mean * mean
                    mean = trust * mean + (one - trust) * far_mean
                    variance = max(trust * variance + (one - trust) * far_variance, least_variance)
                    out[i, j, region, first] = mean
                    out[i, j, region, second] = np.float32(0.5) / variance
                    product *= two_pi * variance
                out[i, j, region, 0] = np.float32(-0.5) * np.log(product)
    return out
