"""Closed contours of a silhouette as Fourier series, and what a low-pass leaves of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.records import F64, Bool, array, record


@record
class Curve:
    """A closed contour: as it is, and low-passed; the silhouette is on the side that the normal looks away from."""

    raw: F64 = array("K", 2, unit="px, evenly spaced")
    pixel: F64 = array("K", 2, unit="px, low-passed")
    normal: F64 = array("K", 2, unit="1, of the low-passed contour")
    curvature: F64 = array("K", unit="px^-1, of the low-passed contour, positive where the silhouette is convex")


class Components(NamedTuple):
    """The closed contours (K, 2) px of a mask, those of holes run the other way round."""

    outer: Sequence[F64]
    holes: Sequence[F64]


def closed_contours(mask: Bool, least_px: float) -> Components:
    """Return the contours of a mask (H, W) that are at least `least_px` long, about a point per px."""
    import cv2

    found, hierarchy = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    outer: list[F64] = []
    holes: list[F64] = []
    for index, contour in enumerate(found):
        points, hole = contour[:, 0].astype(np.float64), bool(hierarchy[0, index, 3] >= 0)
        if cv2.arcLength(contour, True) < least_px:
            continue
        if (_signed_area(points) < 0) != hole:
            points = points[::-1]
        (holes if hole else outer).append(evenly(points))
    return Components(outer, holes)


def low_passed(contour: F64, harmonics: int) -> Curve:
    """Return a closed contour (K, 2) with what is left of it by the frequencies up to `harmonics` per turn.

    F_m = 1/N sum_k X_k exp(-2 pi i m k / N) with X = x + i y; those with |m| <= harmonics are kept.

    Source: Rosenhahn 2004, pose estimation of free-form surfaces, section 3 (contours as sums of coupled rotations)
    """
    count = len(contour)
    order = np.fft.fftfreq(count, 1 / count)
    series = np.fft.fft(contour[:, 0] + 1j * contour[:, 1]) * (np.abs(order) <= harmonics)
    point, first, second = (np.fft.ifft(series * (2j * np.pi * order) ** power) for power in range(3))
    speed = np.maximum(np.abs(first), 1e-12)
    normal = -1j * first / speed  # outward where the area on the screen, y down, is positive
    return Curve(
        raw=contour,
        pixel=np.column_stack([point.real, point.imag]),
        normal=np.column_stack([normal.real, normal.imag]),
        curvature=np.imag(np.conj(first) * second) / speed**3,
    )


def _signed_area(points: F64) -> float:
    ahead = np.roll(points, -1, axis=0)
    return 0.5 * float(np.sum(points[:, 0] * ahead[:, 1] - ahead[:, 0] * points[:, 1]))


def evenly(points: F64) -> F64:
    """Return the closed contour resampled to about 1 px spacing along its length."""
    closed = np.concatenate([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], max(int(along[-1]), 3), endpoint=False)
    return np.column_stack([np.interp(at, along, closed[:, axis]) for axis in (0, 1)])
