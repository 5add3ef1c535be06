"""Local Gaussian statistics of two regions: every pixel has its own mean and variance per channel and region.

Sums are taken over square cells, smoothed with the Gaussian window on the grid of cells, and interpolated where a
pixel needs them. With cells of one pixel this is the windowed statistic of the chapter exactly.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numba
import numpy as np

from mocapflow.records import F32

STEP_RANGE = 4.5  # sigmas beyond which the smooth step counts as 0 or 1
STEP_BINS = 512
FAINT = 1e-3  # share of the window below which a region takes its global statistics
TRUNCATE = 3.0  # sigmas of the Gaussian window


class Window(NamedTuple):
    """How local the statistics are."""

    rho_px: float  # standard deviation of the Gaussian window; inf: one Gaussian per region
    cell_px: int  # edge of the cells the sums are taken over, a multiple of the stride of the features
    floor: float  # smallest standard deviation, as a share of the channel's range


@cache
def step_table() -> F32:
    """Return the smooth step sampled from -STEP_RANGE to STEP_RANGE sigmas, for interpolation in kernels."""
    from scipy.special import erf

    scaled = np.linspace(-STEP_RANGE, STEP_RANGE, STEP_BINS + 1)
    table = 0.5 * (1 + erf(scaled / np.sqrt(2)))
    table[0], table[-1] = 0, 1
    result: F32 = table.astype(np.float32)
    result.flags.writeable = False
    return result


def totals(features: F32, weight: F32, cell_px: int) -> F32:
    """Return sums of weight, weight F and weight F^2 per cell, (h, w, 1 + 2 C), from features (C, H, W)."""
    sums: F32 = _totals(features, weight, cell_px)
    return sums


def local_gaussians(
    features: F32, weight: F32, level: F32, sums: F32, window: Window, sigma_px: float, reach_px: float = np.inf
) -> F32:
    """Return the Gaussians of both regions per cell, (h, w, 2, 1 + 2 C): log norm, means, 1 / (2 variance).

    Region 0 is the inside of the level set, weighted with the smooth step; region 1 is the outside.

    Args:
        features: (C, H, W) in [0, 1].
        weight: (H, W) 1 where a pixel counts, 0 where it is masked.
        level: (H, W) px, a signed distance (clipped is fine), positive inside.
        sums: what `totals` returned for these features.
        window: how local.
        sigma_px: width of the smooth step.
        reach_px: cells whose centre is further from the contour are left zero.

    Source: Rosenhahn 2008, section 12.2.1 (local Gaussian region model)
    """
    inside = _inside_sums(features, weight, level, sums, window.cell_px, step_table(), np.float32(sigma_px))
    both = np.concatenate([inside, sums - inside], axis=2)
    everywhere = both.reshape(-1, both.shape[2]).sum(axis=0, dtype=np.float64).astype(np.float32)
    smooth = _smooth(both, window)
    scale, floor = np.float32(1 / window.cell_px**2), np.float32(window.floor**2)
    gaussians: F32 = _gaussians(smooth, everywhere, level, window.cell_px, np.float32(reach_px), scale, floor)
    return gaussians


def _smooth(sums: F32, window: Window) -> F32:
    """Return the sums seen through the Gaussian window (h, w, K); nothing lies beyond the border."""
    import cv2

    if not np.isfinite(window.rho_px):
        return np.zeros_like(sums)  # no local weight: the global statistics take over
    kernel = _kernel(window.rho_px / window.cell_px)
    padded = np.zeros((sums.shape[0] + 2, sums.shape[1] + 2, sums.shape[2]), np.float32)
    padded[1:-1, 1:-1] = sums  # replicating the rim continues with zeros
    smooth = cv2.sepFilter2D(padded, cv2.CV_32F, kernel, kernel, borderType=cv2.BORDER_REPLICATE)
    return np.ascontiguousarray(smooth[1:-1, 1:-1])


@cache
def _kernel(sigma: float) -> F32:
    """Return the weights of a Gaussian window of `sigma` cells."""
    radius = int(np.ceil(TRUNCATE * sigma))
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    weights: F32 = (kernel / kernel.sum()).astype(np.float32)
    weights.flags.writeable = False
    return weights


@numba.njit(cache=True, error_model="numpy")
def _totals(features, weight, cell):  # type: ignore[no-untyped-def]
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
def _inside_sums(features, weight, level, sums, cell, table, sigma):  # type: ignore[no-untyped-def]
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
def _gaussians(smooth, everywhere, level, cell, reach, scale, floor):  # type: ignore[no-untyped-def]
    """Return log norm, means and 1 / (2 variance) of both regions, blended to global where the window is empty.

    Cells further than `reach` from the contour are left undefined.
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
                    variance = max(trust * variance + (one - trust) * far_variance, floor)
                    out[i, j, region, first] = mean
                    out[i, j, region, second] = np.float32(0.5) / variance
                    product *= two_pi * variance
                out[i, j, region, 0] = np.float32(-0.5) * np.log(product)
    return out
