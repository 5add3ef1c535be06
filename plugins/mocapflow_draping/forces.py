"""What a garment's parameters mean: thickness, take-up, and a tail angle per azimuth as a low Fourier series.

Order 0 is a flare, order 1 the wind of the chapter (its direction and amount as two components), order 2 two legs
inside one ring, order 3 a ring that one leg leaves. Azimuths are those of the rest garment, so the series turns with
the joint that carries it.
"""

from __future__ import annotations

from itertools import chain

import numpy as np

from mocapflow.assets import GarmentMesh
from mocapflow.errors import PluginError, alternatives
from mocapflow.geometry.sewing import HARMONICS, NO_FORCES, TAKE_UP, THICKNESS
from mocapflow.records import F64

STEEPEST = np.radians(80.0)  # a tail tilted further would rise above its support


def tilts(garment: GarmentMesh, parameters: F64, azimuth: F64) -> tuple[F64, F64]:
    """Return how far each tail is tilted (B, N) rad, outwards and to its left, for parameters (B, Q).

    A ring of cloth does not stretch, so what bulges out at one azimuth comes from the sides: a term cos(n a) outwards
    goes with -sin(n a) / n sideways. At n = 1 every strand then tilts the same way: a wind.

    Raises:
        PluginError: the garment declares a parameter this draper has no meaning for.
    """
    out = np.zeros((len(parameters), len(azimuth)))
    aside = np.zeros_like(out)
    for column, name in enumerate(garment.parameter_names):
        if name in NO_FORCES:
            continue
        order, part = _meaning(garment, name)
        amount = parameters[:, column, None]
        if order == 0:
            out += amount
        elif part == "cos":
            out += amount * np.cos(order * azimuth)
            aside -= amount * np.sin(order * azimuth) / order
        else:
            out += amount * np.sin(order * azimuth)
            aside += amount * np.cos(order * azimuth) / order
    beyond = np.maximum(np.hypot(out, aside) / STEEPEST, 1.0)
    return out / beyond, aside / beyond


def _meaning(garment: GarmentMesh, name: str) -> tuple[int, str]:
    for order, names in enumerate(HARMONICS):
        if name in names:
            return order, "sin" if name.endswith("_sin_rad") else "cos"
    raise PluginError(
        f"garment {garment.name} has a parameter '{name}' that draper kinematic does not know",
        hint=alternatives(name, [*NO_FORCES, *chain.from_iterable(HARMONICS)]),
    )


def wind(garment: GarmentMesh, parameters: F64, turn: F64) -> tuple[F64, F64]:
    """Return the chapter's force: horizontal unit direction (B, 3) in the world and amount (B,) rad.

    Args:
        garment: the garment; only its order 1 parameters are read.
        parameters: (B, Q).
        turn: (B, 3, 3), world_from_rest rotation of what carries the garment.
    """
    parts = [_column(garment, parameters, name) for name in ("wind_cos_rad", "wind_sin_rad")]
    force = np.einsum("bij,bj->bi", turn[:, :, :2], np.stack(parts, axis=1))
    force[:, 2] = 0.0
    amount = np.hypot(parts[0], parts[1])
    return force / np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-12), amount


def thickness(garment: GarmentMesh, parameters: F64) -> F64:
    """Return the cloth's thickness (B,) m; zero where the garment has no such parameter."""
    return np.maximum(_column(garment, parameters, THICKNESS), 0.0)


def remaining_length(garment: GarmentMesh, parameters: F64) -> F64:
    """Return the share (B,) of their sewn length that strands span: what folds and gathers take up is lost."""
    return 1.0 - np.maximum(_column(garment, parameters, TAKE_UP), 0.0)


def _column(garment: GarmentMesh, parameters: F64, name: str) -> F64:
    """Return the values (B,) of one parameter of (B, Q); zero where the garment has no such parameter."""
    if name not in garment.parameter_names:
        return np.zeros(len(parameters))
    return parameters[:, garment.parameter_names.index(name)]
