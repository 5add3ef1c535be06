"""The empty scene as a density: how well the plate, lit or in a shadow, explains a pixel.

In CIELAB a neutral shadow scales (L + 16, a, b) by one factor k < 1, because all three are cube roots of
intensities. So a pixel is the background in shadow where it lies on the ray from black to the plate's colour:
a darker version with the same chromaticity.

Lit or not, a and b scatter less than L: cameras and codecs smooth colours, and a person who dims a room hardly changes
them. So a sock as light as the floor is told from it by its tint. A tint that fits tells no more for the room than L
does, whose norm all channels share: in pictures without colours every tint fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np

from mocapflow.assets import Background
from mocapflow.memo import memoised
from mocapflow.records import F32, Bool
from mocapflow_levelset import crops
from mocapflow_levelset.channels import PLANES, ChannelName, features

BLACK = (-16 / 100, 128 / 255, 128 / 255)  # where the rays start, in lab channels scaled to [0, 1]
BENDING = 0.05  # how far a colour may be off the plate's, or its ray, as a share of the plate's distance from grey
TINT = 0.65  # standard deviation of a and b over a plate's spread: 0.1 to 0.6 were found, the most under noise
STRANGER = np.float32(-6.0)  # log density below which no pixel is called more unlikely
LOG_ROOT = np.float32(-0.5 * np.log(2 * np.pi))


class Shadow(NamedTuple):
    """What counts as background, lit or in a shadow."""

    least_sd: float = 0.012  # smallest standard deviation of the empty scene, share of a channel's range
    share: float = 0.2  # prior share of shadow on the background; 0 switches the suppression off
    darkest: float = 0.5  # smallest factor k of (L + 16, a, b)
    chroma: float = 0.005  # standard deviation of the distance to the ray, share of a channel's range


USUAL = Shadow()


class Plate(NamedTuple):
    """The empty scene in one view, as pixels are compared with it."""

    planes: F32  # (C, H, W) features in [0, 1]
    spread: F32  # (H, W) standard deviation, share of a channel's range: the root mean square over the colours

    def of(self, crop: crops.Crop) -> Plate:
        """Return the rectangle of a plate."""
        rows, columns = slice(crop.top, crop.bottom), slice(crop.left, crop.right)
        return Plate(self.planes[:, rows, columns], self.spread[rows, columns])


def plate_of(mean: F32, spread: F32, channels: Sequence[ChannelName], factor: int = 1) -> Plate:
    """Return a plate, at 1 / factor of its size, from mean and spread (H, W, 3) in grey levels."""
    mean, spread = crops.shrink(mean, factor), crops.shrink(spread, factor) / np.float32(255)
    levels = np.clip(np.rint(mean), 0, 255).astype(np.uint8)
    return Plate(features(levels, channels), np.sqrt(np.mean(spread * spread, axis=2)))


@memoised
def plate_in(background: Background, camera: int, channels: tuple[ChannelName, ...], factor: int = 1) -> Plate:
    """Return the plate of a view of the empty scene; made once, forgotten with the background."""
    return plate_of(background.mean[camera], background.spread[camera], channels, factor)


def density_of(
    values: F32, plate: F32, spread: F32, floor: Bool, channels: Sequence[ChannelName], shadow: Shadow
) -> F32:
    """Return the log density (N,) of pixels under the empty scene; NaN where nobody knows it.

    Args:
        values: (C, N) features of the pixels.
        plate: (C, N) those of the empty scene there.
        spread: (N,) its standard deviation, inf where nobody knows it.
        floor: (N,) True where a shadow may fall.
        channels: what the features are.
        shadow: what counts as background.
    """
    constants = tuple(np.float32(value) for value in shadow)
    out = np.empty(values.shape[1], np.float32)
    _densities(values, plate, spread, floor, constants, first_lab(channels), out)
    return out


def density_image(values: F32, plate: Plate, floor: Bool, channels: Sequence[ChannelName], shadow: Shadow) -> F32:
    """Return `density_of` all pixels (H, W) of an image with these features (C, H, W)."""
    flat, expected = values.reshape(len(values), -1), plate.planes.reshape(len(values), -1)
    return density_of(flat, expected, plate.spread.ravel(), floor.ravel(), channels, shadow).reshape(floor.shape)


def squared_deviations(values: F32, plate: Plate, channels: Sequence[ChannelName]) -> F32:
    """Return how far (H, W) pixels with these features (C, H, W) are off the lit plate, in squared deviations."""
    flat, expected = values.reshape(len(values), -1), plate.planes.reshape(len(values), -1)
    out = np.empty(flat.shape[1], np.float32)
    _squared_deviations(flat, expected, plate.spread.ravel(), np.float32(USUAL.least_sd), first_lab(channels), out)
    return out.reshape(plate.spread.shape)


def first_lab(channels: Sequence[ChannelName]) -> int:
    """Return the index of the first lab plane among the feature planes, -1 without: then no shadow is known."""
    return sum(PLANES[name] for name in channels[: list(channels).index("lab")]) if "lab" in channels else -1


@numba.njit(cache=True, error_model="numpy")
def _densities(values, plate, spread, may_fall, shadow, lab, out):  # type: ignore[no-untyped-def]
    least_sd = shadow[0]
    for n in range(out.size):
        if np.isinf(spread[n]):
            out[n] = np.nan
            continue
        sd = max(spread[n], least_sd)
        norm, inverse = LOG_ROOT - np.log(sd), np.float32(0.5) / (sd * sd)
        tint_inverse = np.float32(0.5) / _tint_variance(plate, n, lab, sd)
        lit, others = np.float32(0), np.float32(0)
        for c in range(values.shape[0]):
            off = values[c, n] - plate[c, n]
            term = norm - off * off * (tint_inverse if _is_tint(c, lab) else inverse)
            lit += term
            if lab < 0 or not lab <= c < lab + 3:
                others += term
        if lab >= 0 and may_fall[n]:
            lit = max(lit, others + _in_shadow(values, plate, n, lab, inverse, shadow))
        out[n] = max(lit, STRANGER)


@numba.njit(cache=True, error_model="numpy")
def _squared_deviations(values, plate, spread, least_sd, lab, out):  # type: ignore[no-untyped-def]
    for n in range(out.size):
        sd, total = max(spread[n], least_sd), np.float32(0)
        tint = _tint_variance(plate, n, lab, sd)
        for c in range(values.shape[0]):
            off = values[c, n] - plate[c, n]
            total += off * off / (tint if _is_tint(c, lab) else sd * sd)
        out[n] = total


@numba.njit(cache=True, error_model="numpy")
def _is_tint(c, lab):  # type: ignore[no-untyped-def]
    """Return whether channel c is a or b; `lab` is the channel L, -1 without."""
    return lab >= 0 and lab < c < lab + 3


@numba.njit(cache=True, error_model="numpy")
def _tint_variance(plate, n, lab, sd):  # type: ignore[no-untyped-def]
    """Return the variance of a and b of pixel n of the lit plate, whose spread is `sd`."""
    if lab < 0:
        return sd * sd
    a, b = plate[lab + 1, n] - np.float32(BLACK[1]), plate[lab + 2, n] - np.float32(BLACK[2])
    return np.float32(TINT * TINT) * sd * sd + np.float32(BENDING * BENDING) * (a * a + b * b)


@numba.njit(cache=True, error_model="numpy")
def _in_shadow(values, plate, n, lab, inverse, shadow):  # type: ignore[no-untyped-def]
    """Return the log density of a shadowed plate: uniform along the ray down to the darkest, Gaussian across."""
    _, share, darkest, chroma = shadow
    if share <= 0:
        return STRANGER
    k, square, residual, across = on_ray(values, plate, n, lab, chroma)
    beyond = k - min(max(k, darkest), np.float32(1))
    off = np.float32(0.5) * residual / across + beyond * beyond * square * inverse
    flat = np.log(share / ((np.float32(1) - darkest) * np.sqrt(square)))
    return flat + LOG_ROOT + LOG_ROOT - np.log(across) - off


@numba.njit(cache=True, error_model="numpy")
def on_ray(values, plate, n, lab, chroma):  # type: ignore[no-untyped-def]
    """Return where pixel n is along the ray of its plate's shadows, and how far off.

    These are the factor of the plate's light, the plate's square distance from black, the pixel's square distance from
    the ray, and the variance of a shadow's.
    """
    black_l, black_a, black_b = np.float32(BLACK[0]), np.float32(BLACK[1]), np.float32(BLACK[2])
    l0, a0, b0 = plate[lab, n] - black_l, plate[lab + 1, n] - black_a, plate[lab + 2, n] - black_b
    l1, a1, b1 = values[lab, n] - black_l, values[lab + 1, n] - black_a, values[lab + 2, n] - black_b
    square = l0 * l0 + a0 * a0 + b0 * b0
    k = (l1 * l0 + a1 * a0 + b1 * b0) / square
    r0, r1, r2 = l1 - k * l0, a1 - k * a0, b1 - k * b0
    # the stronger a colour, the more the colours of lamp and room bend its ray
    across = chroma * chroma + np.float32(BENDING * BENDING) * (a0 * a0 + b0 * b0)
    return k, square, r0 * r0 + r1 * r1 + r2 * r2, across
