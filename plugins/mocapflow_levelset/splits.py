"""Where a part ends in an image, looked for along the normal of its edge in the model: compiled kernels."""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_levelset.colours import bin_at

ENDS = 3  # samples at either end of a profile of colours that say what its two sides look like
MARGIN = 2  # px that a profile of colours is longer than what its place was found by, on either side


@numba.njit(cache=True)
def split(image, inside, ratio, layer, pixel, normal, clip, reach, half, least):  # type: ignore[no-untyped-def]
    """Return how far (K,) px along their normals parts end, in whole px; NaN where no end is found.

    At an end, the mean log ratio over `half` px is above `least` before it and below -`least` behind; of several the
    best is taken, as clear as near.

    Args:
        image: (H, W, 3) BGR.
        inside: (H, W) positive on the person; what is off the person is not of the part.
        ratio: (L, BINS) log ratio of each layer to the rest, by colour.
        layer: (K,) the layer of the part.
        pixel: (K, 2) px.
        normal: (K, 2) out of the part.
        clip: bound of the log ratio.
        reach: px.
        half: px.
        least: see above.
    """
    height, width = inside.shape
    count = 2 * (reach + half)
    offset, total = np.full(len(pixel), np.nan), np.zeros(count + 1)
    for k in range(len(pixel)):
        row = ratio[layer[k]]
        for s in range(count):
            t = s - reach - half + 0.5  # between whole offsets
            x = int(math.floor(pixel[k, 0] + t * normal[k, 0] + 0.5))
            y = int(math.floor(pixel[k, 1] + t * normal[k, 1] + 0.5))
            value = -clip
            if 0 <= x < width and 0 <= y < height and inside[y, x] > 0:
                value = row[bin_at(image, y, x)]
            total[s + 1] = total[s] + value
        best = 0.0
        for t in range(-reach, reach + 1):
            s = t + reach + half
            before, behind = (total[s] - total[s - half]) / half, (total[s + half] - total[s]) / half
            if before < least or behind > -least:
                continue
            score = 1.0 + 0.5 * (before - behind) / clip - abs(t) / reach
            if score > best:
                best, offset[k] = score, t
    return offset


@numba.njit(cache=True)
def greatest(image, ratio, layer, pixel, direction, first, last):  # type: ignore[no-untyped-def]
    """Return the greatest log ratio (K,) of `first` to `last` px before points (K, 2), against their directions."""
    height, width = image.shape[:2]
    best = np.full(len(pixel), -np.inf)
    for k in range(len(pixel)):
        for t in range(first, last + 1):
            x = int(math.floor(pixel[k, 0] - t * direction[k, 0] + 0.5))
            y = int(math.floor(pixel[k, 1] - t * direction[k, 1] + 0.5))
            x, y = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
            best[k] = max(best[k], ratio[layer[k], bin_at(image, y, x)])
    return best


@numba.njit(cache=True)
def refine(image, pixel, normal, offset, half):  # type: ignore[no-untyped-def]
    """Return the offsets (K,) to a fraction of a px, and the variance (K,) px² by the noise of the two colours.

    Along the normal the colour goes from that of one side to that of the other; how much of the profile belongs to the
    first says where it ends, whatever blur is between.
    """
    arm = half + MARGIN
    exact, variance = np.full(len(pixel), np.nan), np.full(len(pixel), np.inf)
    profile = np.empty((2 * arm + 1, 3))
    for k in range(len(pixel)):
        if math.isnan(offset[k]) or not _look_along(image, pixel[k], normal[k], offset[k], arm, profile):
            continue
        mine, variance[k] = _first_share(profile)
        exact[k] = offset[k] + mine - arm - 0.5
    return exact, variance


@numba.njit(cache=True)
def _look_along(image, pixel, normal, offset, arm, profile):  # type: ignore[no-untyped-def]
    """Write the colours (2 arm + 1, 3) around an offset along a normal; return whether all are in the image."""
    height, width = image.shape[:2]
    for s in range(len(profile)):
        t = offset + s - arm
        x, y = pixel[0] + t * normal[0], pixel[1] + t * normal[1]
        left, top = int(math.floor(x)), int(math.floor(y))
        if not (0 <= left < width - 1 and 0 <= top < height - 1):
            return False
        fx, fy = x - left, y - top
        for c in range(3):
            upper = (1 - fx) * image[top, left, c] + fx * image[top, left + 1, c]
            lower = (1 - fx) * image[top + 1, left, c] + fx * image[top + 1, left + 1, c]
            profile[s, c] = (1 - fy) * upper + fy * lower
    return True


@numba.njit(cache=True)
def _first_share(profile):  # type: ignore[no-untyped-def]
    """Return how much of a profile (S, 3) is of its first side, px, and the variance; NaN and inf: its sides match."""
    count = len(profile)
    one, other = np.zeros(3), np.zeros(3)
    for s in range(ENDS):
        one += profile[s] / ENDS
        other += profile[count - 1 - s] / ENDS
    step = other - one
    square = step @ step
    if square < 1.0:
        return np.nan, np.inf
    mine, noise = 0.0, 0.0
    for s in range(count):
        share = (profile[s] - one) @ step / square
        mine += 1.0 - share
        if s < ENDS:
            noise += share * share
        elif s >= count - ENDS:
            noise += (1.0 - share) * (1.0 - share)
    return mine, count * noise / (2 * ENDS - 2)
