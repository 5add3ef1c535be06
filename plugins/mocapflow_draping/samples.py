"""Samples of a garment's parameters: forces in all directions, thicknesses, and the neighbours of a guess."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from mocapflow.assets import GarmentMesh
from mocapflow.geometry.sewing import THICKNESS
from mocapflow.records import F64

FORCE = re.compile(r"(?P<force>[\w.]+?)(_cos|_sin)?_rad")
THICKNESSES = 6  # evenly spaced within the bounds


def coarse(garment: GarmentMesh, directions: int, amounts: F64) -> Iterator[tuple[list[int], F64]]:
    """Yield, one force after the other and the thickness last, its columns and the values (B, columns) to try."""
    for columns in forces(garment):
        yield columns, in_all_directions(len(columns), directions, amounts)
    for column in garment.columns(THICKNESS):
        low, high = garment.parameter_bounds[column]
        yield [column], np.linspace(low, high, THICKNESSES)[:, None]


def forces(garment: GarmentMesh) -> list[list[int]]:
    """Return the columns of each force: a cosine with its sine, which have a direction, or a flare alone."""
    found: dict[str, list[int]] = {}
    for column, name in enumerate(garment.parameter_names):
        if match := FORCE.fullmatch(name):
            found.setdefault(match["force"], []).append(column)
    return list(found.values())


def in_all_directions(columns: int, directions: int, amounts: F64) -> F64:
    """Return values (B, columns) of one force: none, and each amount in each direction; a flare goes out or in."""
    if columns == 1:
        return np.concatenate([[0.0], amounts, -amounts])[:, None]
    azimuth = np.linspace(0.0, 2 * np.pi, directions, endpoint=False)
    circle = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    return np.concatenate([np.zeros((1, 2)), (amounts[:, None, None] * circle).reshape(-1, 2)])


def replaced(garment: GarmentMesh, parameters: F64, columns: list[int], values: F64) -> F64:
    """Return parameters (B, Q) with some columns set to each of the values (B, columns), within their bounds."""
    rows = np.repeat(parameters[None], len(values), axis=0)
    rows[:, columns] = values
    return within(garment, rows)


def neighbours(garment: GarmentMesh, parameters: F64, columns: list[int], step: float) -> F64:
    """Return parameters (B, Q) one step up and down in each of some columns."""
    moves = step * np.eye(len(parameters))[columns]
    return within(garment, parameters + np.concatenate([moves, -moves]))


def within(garment: GarmentMesh, parameters: F64) -> F64:
    """Return parameters (B, Q) moved within their bounds."""
    return np.clip(parameters, *garment.parameter_bounds.T)
