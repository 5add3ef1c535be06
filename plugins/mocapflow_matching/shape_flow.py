"""Registration of two shapes by the flow between their distance images."""

from __future__ import annotations

import numba
import numpy as np

from mocapflow.records import F32

WARPS = 2  # linearisations a level
SWEEPS = 8  # of successive over-relaxation a linearisation
RELAXATION = 1.8
LEAST_SIDE = 8  # px of the coarsest level


def register(model: F32, image: F32, smoothness: float, levels: int, band_px: float) -> F32:
    """Return the flow (H, W, 2) px, x and y, that takes the shape of one distance image to that of another.

    It minimises the integral of (model(x) - image(x + w))^2 + smoothness |grad w|^2 over the band about the model's
    contour, coarse to fine, by warping and Gauss-Newton; at the edge of the band the flow goes on unchanged.

    Args:
        model: (H, W) px, the distance image that moves.
        image: (H, W) px, the distance image it moves to.
        smoothness: what smoothness costs against squared distance, about 1 to 10.
        levels: how often the images are halved.
        band_px: half the width of the band.
    """
    import cv2

    pyramid = [(model, image)]
    while len(pyramid) <= levels and min(pyramid[-1][0].shape) >= 2 * LEAST_SIDE:
        height, width = pyramid[-1][0].shape
        half = ((width + 1) // 2, (height + 1) // 2)
        one, other = (0.5 * cv2.resize(image, half, interpolation=cv2.INTER_AREA) for image in pyramid[-1])
        pyramid.append((np.asarray(one, np.float32), np.asarray(other, np.float32)))
    flow = np.zeros((*pyramid[-1][0].shape, 2), np.float32)
    for level in range(len(pyramid) - 1, -1, -1):
        one, other = pyramid[level]
        if flow.shape[:2] != one.shape:
            flow = 2 * np.asarray(cv2.resize(flow, one.shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32)
        _refine(one, other, smoothness, max(band_px / 2**level, 3.0), flow)
    return flow


def _refine(model: F32, image: F32, smoothness: float, band: float, flow: F32) -> None:
    """Improve a flow in place by some linearisations."""
    import cv2

    height, width = model.shape
    inside = np.abs(model) < band
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    slope = [cv2.Sobel(image, cv2.CV_32F, 1 - axis, axis, ksize=3, scale=1 / 8) for axis in (0, 1)]
    for _ in range(WARPS):
        at = (x + flow[..., 0], y + flow[..., 1])
        warped, gx, gy = (
            cv2.remap(values, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for values in (image, *slope)
        )
        wanted = model - warped + gx * flow[..., 0] + gy * flow[..., 1]
        _relax(inside, gx, gy, wanted, np.float32(smoothness), flow)


@numba.njit(cache=True)
def _relax(inside, gx, gy, wanted, smoothness, flow):  # type: ignore[no-untyped-def]
    """Solve g (g . w - wanted) = smoothness laplacian(w) at every pixel inside, by over-relaxation."""
    height, width = inside.shape
    places = np.empty((inside.size, 2), np.int32)
    total = 0
    for row in range(height):
        for column in range(width):
            if inside[row, column]:
                places[total, 0], places[total, 1] = row, column
                total += 1
    relaxation = np.float32(RELAXATION)
    for _ in range(SWEEPS):
        for k in range(total):
            row, column = places[k, 0], places[k, 1]
            u = v = count = np.float32(0.0)
            if row > 0 and inside[row - 1, column]:
                u, v, count = u + flow[row - 1, column, 0], v + flow[row - 1, column, 1], count + np.float32(1.0)
            if column > 0 and inside[row, column - 1]:
                u, v, count = u + flow[row, column - 1, 0], v + flow[row, column - 1, 1], count + np.float32(1.0)
            if row < height - 1 and inside[row + 1, column]:
                u, v, count = u + flow[row + 1, column, 0], v + flow[row + 1, column, 1], count + np.float32(1.0)
            if column < width - 1 and inside[row, column + 1]:
                u, v, count = u + flow[row, column + 1, 0], v + flow[row, column + 1, 1], count + np.float32(1.0)
            if count == 0.0:
                continue
            u, v = u / count, v / count
            g, h = gx[row, column], gy[row, column]
            step = (wanted[row, column] - g * u - h * v) / (smoothness * count + g * g + h * h)
            flow[row, column, 0] += relaxation * (u + g * step - flow[row, column, 0])
            flow[row, column, 1] += relaxation * (v + h * step - flow[row, column, 1])
