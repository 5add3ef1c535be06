"""Cameras that takes are filmed by if not by those of the recording of their subject."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

SIZE = 640, 800  # px
AIM = 0.9  # m, the height that all look at
HEIGHTS = 1.2, 2.2, 0.7, 1.6, 1.2, 2.4, 0.9, 1.7  # m
DISTANCES = 4.2, 4.6, 4.0, 4.4, 4.2, 4.8, 4.3, 4.1  # m from the middle, along the floor
FOCAL = 1450, 1500, 1400, 1450, 1450, 1500, 1450, 1400  # px
FIRST, ASIDE = 12.0, 6.0  # deg, of the first camera, and by how much at most any is off an even ring


def ring(centre: np.ndarray) -> str:
    """Return cameras.toml of eight cameras around a place (2) of the floor."""
    aside = np.random.default_rng(7).uniform(-ASIDE, ASIDE, len(HEIGHTS))
    tables = []
    for k, angle in enumerate(np.radians(FIRST + 45 * np.arange(len(HEIGHTS)) + aside)):
        place = np.array([*(centre + DISTANCES[k] * np.array([np.cos(angle), np.sin(angle)])), HEIGHTS[k]])
        ahead = np.array([*centre, AIM]) - place
        right = np.cross(ahead, [0, 0, 1])
        axes = np.stack([right, np.cross(ahead, right), ahead])
        tables.append(table(f"cam{k + 1:02}", FOCAL[k], axes / np.linalg.norm(axes, axis=1, keepdims=True), place))
    return "\n".join([*tables, "[metadata]\n"])


def table(name: str, focal: float, turn: np.ndarray, place: np.ndarray) -> str:
    """Return the table of a camera whose axes are the rows of `turn` (3,3), at a place (3) of the world."""
    width, height = SIZE
    matrix = [[float(focal), 0.0, (width - 1) / 2], [0.0, float(focal), (height - 1) / 2], [0.0, 0.0, 1.0]]
    lines = [
        f"[{name}]",
        f'name = "{name}"',
        f"size = [{width}, {height}]",
        f"matrix = {matrix}",
        "distortions = [0.0, 0.0, 0.0, 0.0]",
        f"rotation = {Rotation.from_matrix(turn).as_rotvec().tolist()}",
        f"translation = {(-turn @ place).tolist()}",
        "fisheye = false\n",
    ]
    return "\n".join(lines)


RIGS = {"ring": ring}
