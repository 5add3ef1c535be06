"""Which detections, one per camera, are the same person: those that reproject best together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.geometry.cameras import project
from mocapflow.records import F64, array, record
from mocapflow_fitting.triangulate import USUAL_PX, Points, triangulate

HALVING_SHARE = 1 / 60  # of the diagonal of a person's box: so far off, a keypoint counts half
LEAST_HALVING_PX = 2.0


@record
class Person:
    """One person's detections over the cameras, and the points they give."""

    pixels: F64 = array("C", "K", 2, unit="px")
    confidence: F64 = array("C", "K", unit="1, zero where unseen")
    points: Points
    support: float  # confidence of all observations that agree, summed


def find_person(detections: Sequence[F64], cameras: Sequence[Camera]) -> Person | None:
    """Return the person whom most confident keypoints of most cameras support; None: nobody is seen by two cameras.

    Args:
        detections: per camera (N people, K, 3) px, px, confidence.
        cameras: pinhole cameras.

    Every pair of detections of two cameras proposes a person; each further camera joins with the detection that lies
    closest to the projected points, if any does. A bystander seen by fewer cameras, smaller or less clearly loses.

    Raises:
        RecordingError: cameras list different keypoints.
    """
    counts = sorted({people.shape[1] for people in detections if len(people)})
    if len(counts) > 1:
        message = f"cameras list {' and '.join(map(str, counts))} keypoints of a person"
        raise RecordingError(message, hint="use one estimator with one layout for all cameras")
    chosen = dict.fromkeys(_joined(detections, cameras, pair) for pair in _pairs(detections))  # each once, in order
    people = [_person(detections, cameras, rows) for rows in chosen]
    best = max(people, key=lambda person: person.support, default=None)
    return best if best is not None and best.support > 0 else None


def _pairs(detections: Sequence[F64]) -> Iterator[dict[int, int]]:
    """Yield every two detections of two cameras, by camera."""
    for a, b in combinations(range(len(detections)), 2):
        for i, j in product(range(len(detections[a])), range(len(detections[b]))):
            yield {a: i, b: j}


def _joined(detections: Sequence[F64], cameras: Sequence[Camera], pair: dict[int, int]) -> tuple[int, ...]:
    """Return the row of each camera's detection, -1 for none: of a pair, and of what lies closest to its points."""
    person = _person(detections, cameras, tuple(pair.get(c, -1) for c in range(len(cameras))))
    chosen = []
    for c, camera in enumerate(cameras):
        agreement = [_agreement(person.points.position, points, camera) for points in detections[c]]
        row = pair.get(c, int(np.argmax(agreement)) if agreement and max(agreement) > 0.25 else -1)
        chosen.append(row)
    return tuple(chosen)


def _agreement(position: F64, points: F64, camera: Camera) -> float:
    """Return the share of a detection's confidence that lies near the projected points."""
    error = np.linalg.norm(project(position, camera) - points[:, :2], axis=1)
    near = 1 / (1 + (error / halving_px(points)) ** 2)
    return float(np.nansum(points[:, 2] * near) / max(points[:, 2].sum(), 1e-9))


def _person(detections: Sequence[F64], cameras: Sequence[Camera], chosen: tuple[int, ...]) -> Person:
    count = max((d.shape[1] for d in detections if len(d)), default=0)
    rows = np.stack([detections[c][row] if row >= 0 else np.zeros((count, 3)) for c, row in enumerate(chosen)])
    sizes = [halving_px(points) for points in rows if points[:, 2].any()]
    scale = float(np.median(sizes)) if sizes else USUAL_PX  # estimators list people of whom they see no point
    points = triangulate(rows[..., :2], rows[..., 2], cameras, scale)
    found = np.isfinite(points.position).all(axis=1)
    support = float(points.weight[:, found].sum())
    return Person(pixels=rows[..., :2].copy(), confidence=rows[..., 2].copy(), points=points, support=support)


def halving_px(points: F64) -> float:
    """Return the error (px) that halves the weight of a keypoint among those of a person (K, 3)."""
    seen = points[points[:, 2] > 0, :2]
    diagonal = float(np.linalg.norm(np.ptp(seen, axis=0))) if len(seen) else 0.0
    return max(HALVING_SHARE * diagonal, LEAST_HALVING_PX)
