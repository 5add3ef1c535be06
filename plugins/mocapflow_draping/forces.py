"""What a garment's parameters mean: thickness, and a tail angle per azimuth as a low Fourier series.

Order 0 is a flare, order 1 the wind of the chapter (its direction and amount as two components), order 2 two legs
inside one ring. Azimuths are those of the rest garment, so the series turns with the joint that carries it.
"""

from __future__ import annotations

import re

import numpy as np

from mocapflow.data import GarmentMesh
from mocapflow.errors import PluginError, alternatives
from mocapflow.records import F64

HARMONICS = {"flare": 0, "wind": 1, "two": 2}
MEANING = re.compile(r"(?P<force>flare|wind|two)(_(?P<part>cos|sin))?_rad")


def tail_angles(garment: GarmentMesh, parameters: F64, azimuth: F64) -> F64:
    """Return the tail angle (B, N) rad of each strand for parameters (B, Q); positive stands out from the body.

    Raises:
        PluginError: the garment declares a parameter this draper has no meaning for.
    """
    angles = np.zeros((len(parameters), len(azimuth)))
    for column, name in enumerate(garment.parameter_names):
        if name == "thickness_m":
            continue
        found = MEANING.fullmatch(name)
        if found is None:
            known = ["thickness_m", "flare_rad", "wind_cos_rad", "wind_sin_rad", "two_cos_rad", "two_sin_rad"]
            raise PluginError(
                f"garment {garment.name} has a parameter '{name}' that draper kinematic does not know",
                hint=alternatives(name, known),
            )
        wave = np.sin if found["part"] == "sin" else np.cos
        angles += parameters[:, column, None] * wave(HARMONICS[found["force"]] * azimuth)
    return angles


def thickness(garment: GarmentMesh, parameters: F64) -> F64:
    """Return the cloth's thickness (B,) m; zero where the garment has no such parameter."""
    if "thickness_m" not in garment.parameter_names:
        return np.zeros(len(parameters))
    column: F64 = np.maximum(parameters[:, garment.parameter_names.index("thickness_m")], 0.0)
    return column
