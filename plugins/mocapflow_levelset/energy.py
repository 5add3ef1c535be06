"""The segmentation energy on full arrays, exactly as printed: the reference for the kernels."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F32, F64


def heaviside(distance: F32 | F64, sigma_px: float) -> F64:
    """Return the smooth step of a level set (H, W) px, 1/2 at the contour: the error function of width `sigma_px`."""
    from scipy.special import erf

    step: F64 = 0.5 * (1 + erf(np.asarray(distance, np.float64) / (np.sqrt(2) * sigma_px)))
    return step


def delta(distance: F32 | F64, sigma_px: float) -> F64:
    """Return the derivative (H, W) of the smooth step, 1/px: only pixels near the contour can move it."""
    scaled = np.asarray(distance, np.float64) / sigma_px
    slope: F64 = np.exp(-0.5 * scaled**2) / (np.sqrt(2 * np.pi) * sigma_px)
    return slope


def length(distance: F32 | F64, sigma_px: float) -> float:
    """Return the length of the contour in px, the integral of |grad H|."""
    step = heaviside(distance, sigma_px)
    forward_x = np.diff(step, axis=1, append=step[:, -1:])
    forward_y = np.diff(step, axis=0, append=step[-1:])
    return float(np.hypot(forward_x, forward_y).sum())


def curvature(distance: F32 | F64) -> F64:
    """Return div(grad phi / |grad phi|) in 1/px by central differences: negative on a convex shape's contour."""
    padded = np.pad(np.asarray(distance, np.float64), 1, mode="edge")
    left, right, up, down = padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1]
    dx, dy, centre = (right - left) / 2, (down - up) / 2, padded[1:-1, 1:-1]
    dxx, dyy = right - 2 * centre + left, down - 2 * centre + up
    dxy = (padded[2:, 2:] - padded[2:, :-2] - padded[:-2, 2:] + padded[:-2, :-2]) / 4
    square = dx**2 + dy**2 + 1e-6
    return (dxx * dy**2 - 2 * dx * dy * dxy + dyy * dx**2) / square**1.5


def energy(
    distance: F32 | F64,
    log_inside: F32 | F64,
    log_outside: F32 | F64,
    prior: F32 | F64,
    sigma_px: float,
    length_weight: float,
    shape_weight: float,
) -> tuple[float, float, float]:
    """Return the data, length and shape terms of a level set; all arrays (H, W).

    The length counts as a penalty and the shape term is squared, which the print of (12.1) and of section 12.4
    leaves out.

    Source: Rosenhahn 2008, Eq. (12.1) and (12.9)
    """
    step = heaviside(distance, sigma_px)
    data = -float((step * log_inside + (1 - step) * log_outside).sum())
    shape = float(((np.asarray(distance, np.float64) - prior) ** 2).sum())
    return data, length_weight * length(distance, sigma_px), shape_weight * shape


def descent(
    distance: F32 | F64,
    log_ratio: F32 | F64,
    prior: F32 | F64,
    sigma_px: float,
    length_weight: float,
    shape_weight: float,
) -> F64:
    """Return the direction of steepest descent of the energy, dphi/dt (H, W).

    Source: Rosenhahn 2008, Eq. (12.10)
    """
    push = log_ratio + length_weight * curvature(distance)
    return delta(distance, sigma_px) * push + 2 * shape_weight * (np.asarray(prior, np.float64) - distance)
