"""Of several garments that are worn as one, each by itself: so drapers lay them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mocapflow.data import Past
from mocapflow.dressing.roles import Draper
from mocapflow.records import Bool
from mocapflow.scene import Scene


class Piece(NamedTuple):
    """A garment, and which of the vertices and parameters of all that is worn are its own."""

    scene: Scene  # the person in this garment alone
    vertices: slice
    parameters: slice

    def past(self, past: Past) -> Past:
        """Return the past with the cloth of this garment alone."""
        if self.vertices == slice(None):
            return past
        moments = []
        for moment in past.moments:
            cloth = replace(
                moment.cloth,
                vertices=moment.cloth.vertices[self.vertices],
                parameters=moment.cloth.parameters[self.parameters],
            )
            moments.append(replace(moment, cloth=cloth))
        return replace(past, moments=tuple(moments))


def pieces_of(scene: Scene) -> Iterator[Piece]:
    """Yield each of the garments that a person wears."""
    if len(scene.pieces) == 1:
        yield Piece(scene.pieces[0], slice(None), slice(None))
        return
    vertex = parameter = 0
    for piece in scene.pieces:
        assert piece.garment is not None
        vertices = slice(vertex, vertex := vertex + len(piece.garment.vertices))
        parameters = slice(parameter, parameter := parameter + len(piece.garment.parameter_names))
        yield Piece(piece, vertices, parameters)


def touchable(draper: Draper, scene: Scene) -> Bool:
    """Return which joints (J,) move what the garments hang from or can touch, from the root on."""
    from mocapflow.geometry import kinematics  # compiled code, loaded where it is used

    each = np.stack([draper.touchable(piece.scene) for piece in pieces_of(scene)])
    return np.asarray(kinematics.descendants(scene.body.parents) @ each.any(axis=0))
