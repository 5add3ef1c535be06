"""The matches of all matchers as one set, where nothing hides the person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mocapflow.assets import Camera
from mocapflow.components import Matcher
from mocapflow.data import Frame, Matches, Past, Segmentation, Surface, Turn, empty_matches
from mocapflow.geometry.cameras import project
from mocapflow.geometry.contours import at_nearest
from mocapflow.guards.outputs import matches_of
from mocapflow.records import joined_rows, picked_rows
from mocapflow.scene import Scene


def pool_matches(
    matchers: Sequence[Matcher],
    frame: Frame,
    segmentation: Segmentation,
    past: Past,
    scene: Scene,
    turn: Turn,
    surface: Surface,
) -> Matches:
    """Return the matches of all matchers together, each with its share, where nothing hides the person."""
    found = [weighted(matches_of(m, frame, segmentation, surface, past, scene, turn), m.share) for m in matchers]
    return unhidden(pool(found), frame, surface, scene.cameras)


def unhidden(matches: Matches, frame: Frame, surface: Surface, cameras: Sequence[Camera]) -> Matches:
    """Return the matches whose pixel and whose surface point both lie where the picture shows the scene.

    The contour of a point that is hidden is hidden too: one that is seen and found for it belongs to something else.
    """
    seen = np.ones(len(matches.camera), bool)
    for number, hidden in enumerate(frame.hidden):
        rows = np.flatnonzero(matches.camera == number)
        points = project(surface.vertices.take(matches.vertex[rows], axis=0), cameras[number])
        seen[rows] = (at_nearest(hidden, matches.pixel[rows]) == 0) & (at_nearest(hidden, points) == 0)
    return matches if seen.all() else picked_rows(matches, seen)


def weighted(matches: Matches, share: float) -> Matches:
    """Return matches that count so many times as much."""
    return matches if share == 1.0 else replace(matches, weight=share * matches.weight)


def pool(parts: Sequence[Matches]) -> Matches:
    """Return several sets of matches as one; none of none."""
    if len(parts) < 2:
        return parts[0] if parts else empty_matches()
    return joined_rows(parts)
