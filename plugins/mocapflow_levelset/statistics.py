"""Local Gaussian statistics of two regions: every pixel has its own mean and variance per channel and region.

Sums are taken over square cells, smoothed with the Gaussian window on the grid of cells, and interpolated where a
pixel needs them. With cells of one pixel this is the windowed statistic of the chapter exactly.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from mocapflow.records import F32
from mocapflow_levelset import statistics_kernels as kernels
from mocapflow_levelset.statistics_kernels import STEP_BINS, STEP_RANGE

TRUNCATE = 3.0  # sigmas of the Gaussian window


class Window(NamedTuple):
    """How local the statistics are."""

    rho_px: float  # standard deviation of the Gaussian window; inf: one Gaussian per region
    cell_px: int  # edge of the cells the sums are taken over, a multiple of the stride of the features
    least_sd: float  # smallest standard deviation, as a share of the channel's range


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
    sums: F32 = kernels.totals(features, weight, cell_px)
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
    inside = kernels.inside_sums(features, weight, level, sums, window.cell_px, step_table(), np.float32(sigma_px))
    both = np.concatenate([inside, sums - inside], axis=2)
    everywhere = both.reshape(-1, both.shape[2]).sum(axis=0, dtype=np.float64).astype(np.float32)
    smooth = _smooth(both, window)
    scale, least = np.float32(1 / window.cell_px**2), np.float32(window.least_sd**2)
    gaussians: F32 = kernels.gaussians(smooth, everywhere, level, window.cell_px, np.float32(reach_px), scale, least)
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
