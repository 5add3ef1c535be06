"""The level set in motion: descent in the band around the contour."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.records import F32, I32
from mocapflow_levelset import front_kernels as kernels
from mocapflow_levelset.evidence import Evidence
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.statistics import Window, local_gaussians, step_table, totals

FRONT = 3.5  # sigmas: beyond, the slope of the smooth step is below 0.3 % of its peak
REST = 4  # pixels that the contour sweeps between two estimates of the statistics, at most, when it rests


class Weights(NamedTuple):
    """The constants of the energy and of its descent."""

    sigma_px: float
    length: float
    shape: float
    clip: float  # bound on the log ratio
    step: float  # size of a time step
    band_px: float
    any_colour: float = -6.0  # least log density inside, where the outside's is that of the empty scene


class Schedule(NamedTuple):
    """How many steps, and how often statistics and distances are renewed."""

    steps: int
    statistics_every: int
    redistance_every: int
    to_rest: bool = False  # fewer, if the contour rests


class Settled(NamedTuple):
    """Where the descent ended, the last evidence along the runs it moved in, and the prior that it kept near."""

    level: F32  # (H, W) px, near a signed distance within the band
    ratio: F32  # (H, W) log p1 - log p2
    runs: I32  # (N, 3) y, first x, last x + 1
    prior: F32  # (H, W) px, signed distance to the model's outline


class Costs(NamedTuple):
    """The terms of the energy near the contour, the data up to a sum that depends on the outside alone."""

    data: float  # -sum of H log(p1 / p2)
    length: float
    shape: float


def settle(level: F32, prior: F32, evidence: Evidence, window: Window, weights: Weights, schedule: Schedule) -> Settled:
    """Descend from `level` for some steps, renewing statistics and distances in between.

    Args:
        level: (H, W) px, a signed distance (clipped is fine), positive inside.
        prior: (H, W) px, signed distance to the model's outline.
        evidence: features, mask and plate on the same grid.
        window: how local the statistics are.
        weights: the constants of energy and descent.
        schedule: how many steps, and how often the rest is renewed.

    Source: Rosenhahn 2008, Eq. (12.10)
    """
    stride = evidence.stride
    weight = np.ascontiguousarray(evidence.weight[::stride, ::stride])
    grid = Window(window.rho_px / stride, max(window.cell_px // stride, 1), window.least_sd)
    first = (grid.cell_px - 1) * stride // 2
    reach = FRONT * weights.sigma_px / stride + 3 * grid.cell_px
    sums = totals(evidence.sparse, weight, grid.cell_px)
    level = np.clip(level, -np.float32(weights.band_px), np.float32(weights.band_px))
    ratio, change = np.zeros_like(level), np.empty_like(level)
    runs, before = near(level, weights, first), level > 0 if schedule.to_rest else None
    for step in range(schedule.steps):
        if step and step % schedule.redistance_every == 0:
            level = redistance(level, weights.band_px)
        if step % schedule.statistics_every == 0:
            if step and before is not None:
                now = level > 0
                if np.count_nonzero(now != before) <= REST:
                    break
                before = now
            sparse = np.ascontiguousarray(level[::stride, ::stride]) / np.float32(stride)
            gaussians = local_gaussians(evidence.sparse, weight, sparse, sums, grid, weights.sigma_px / stride, reach)
            runs = near(level, weights, first) if step else runs
            log_ratio(runs, evidence, gaussians, grid.cell_px, weights, ratio)
            if evidence.colour_ratio is not None:
                ratio = np.clip(ratio + evidence.colour_ratio, -weights.clip, weights.clip)
        advance(level, ratio, prior, runs, change, weights)
    return Settled(level, ratio, runs, prior)


def costs(settled: Settled, weights: Weights) -> Costs:
    """Return the terms of the energy where the descent ended.

    The data term of (12.1) is -sum of H log p1 + (1 - H) log p2, over the whole picture. Here it is without -sum of
    log p2, by the clipped ratio, over the last runs alone. So the data of two turns compare only as far as p2 and the
    runs stay the same, and p2 is estimated anew around each contour: `steady.energy_share` sees that change, too.
    """
    table, sigma, band = step_table(), np.float32(weights.sigma_px), np.float32(weights.band_px)
    data, length, shape = kernels.terms(settled.level, settled.ratio, settled.prior, settled.runs, table, sigma, band)
    return Costs(float(data), weights.length * float(length), weights.shape * float(shape))


def near(level: F32, weights: Weights, first: int = 0) -> I32:
    """Return the runs (N, 3) of pixels near enough to the contour to move it, rows of (y, first x, last x + 1)."""
    reach = min(FRONT * weights.sigma_px, weights.band_px - 1e-3)
    runs: I32 = kernels.find_runs(level, np.float32(reach), first)
    return runs


def log_ratio(runs: I32, evidence: Evidence, gaussians: F32, cell: int, weights: Weights, out: F32) -> None:
    """Write log p1 - log p2, clipped, into `out` (H, W) along the runs; masked pixels get 0.

    The Gaussians are of cells of `cell` times `cell` pixels of the sparse features.
    Outside, the empty scene speaks where it is known (no NaN), else the local statistics. Beside it no colour is less
    likely on the person than `any_colour`: what the room surely does not show is the person, seen there before or not.
    """
    if not len(runs):  # the contour has left the image
        return
    values = evidence.along(runs)
    known = evidence.outside is not None
    outside = evidence.outside(runs, values) if evidence.outside else np.empty(0, np.float32)
    first = np.float32((cell - 1) * evidence.stride / 2)  # centre of the first cell's pixels
    bounds = np.float32(weights.clip), np.float32(weights.any_colour)
    size = cell * evidence.stride
    kernels.log_ratio(runs, values, evidence.weight, outside, known, gaussians, size, first, *bounds, out)


def advance(level: F32, ratio: F32, prior: F32, runs: I32, change: F32, weights: Weights) -> None:
    """Take one step in place: data and length explicitly, the shape prior implicitly (stable for any weight)."""
    constants = weights.sigma_px, weights.length, weights.shape, weights.step, weights.band_px
    kernels.advance(level, ratio, prior, runs, change, *map(np.float32, constants))
