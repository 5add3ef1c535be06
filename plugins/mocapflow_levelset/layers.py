"""The layers of a person: body parts and garments, each with the colours that the tracked surface has shown.

Left and right limbs share a layer, and so do the sleeves on them. A layer is a histogram of colours, gathered from the
pixels that the posed and clothed surface draws it on; layers that look alike are one to the eye and are not told apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Frame, Past, Silhouette, Surface
from mocapflow.geometry.skeleton import unsided
from mocapflow.geometry.visibility import front_vertices
from mocapflow.memo import memoised
from mocapflow.records import F32, F64, I32, Bool
from mocapflow.scene import Scene
from mocapflow_levelset.colours import BINS, SIDE, bins_of

COLOURS = "layers"  # of Segmentation.appearance: (L, BINS) pixels of each layer by colour, older ones discounted
SMOOTH = 0.7  # bins; standard deviation by which colours are smoothed
UNSEEN = 0.1  # share of pixels by which a layer may have any colour: shadows, highlights
OVERLAP = 0.5  # Bhattacharyya coefficient of their colours from which on two layers are one to the eye
LEAST = 50.0  # pixels that a layer has to have shown to be known
CLIP = 4.0  # bound on the log ratio of a pixel
SURELY = -2.0  # log ratio below which a pixel is another layer's, whatever the surface says


class ColourModel(NamedTuple):
    """What a pixel's colour says of layers, learned from earlier frames."""

    ratio: F32  # (L, BINS) log density in a layer over the greatest in any layer unlike it; 0: nothing is known
    distinct: Bool  # (L, L) True where two layers are told apart by colour
    log_density: F64  # (L, BINS) log density in a layer, part of which may have any colour


@memoised
def layer_of(scene: Scene) -> I32:
    """Return the layer (N,) of each surface vertex: that of the joint that moves it, sides together; cloth is last."""
    body, garments = scene.body, [piece.garment for piece in scene.pieces if piece.garment is not None]
    _, of_joint = np.unique([unsided(name) for name in body.joint_names], return_inverse=True)
    _, of_garment = np.unique([unsided(garment.name) for garment in garments], return_inverse=True)
    layers = [of_joint[body.main_joint], of_joint.max() + 1 + of_garment[scene.garment_index[len(body.vertices) :]]]
    return np.concatenate(layers, dtype=np.int32)


def layer_histograms(
    frame: Frame, silhouettes: Sequence[Silhouette], surface: Surface, scene: Scene, past: Past, keep: float, grid: int
) -> F64:
    """Return the colours (L, BINS) that layers have shown: `keep` of what is known, and those of this frame.

    Pixels count every `grid` px, where the surface draws the same layer all around, well inside the silhouette.
    What colours surely say is another layer does not count: a limb gone astray must not learn what it lies on.
    """
    layers, counts = layer_of(scene), np.zeros((int(layer_of(scene).max()) + 1, BINS))
    known = past.appearance.get(COLOURS)
    for silhouette in silhouettes:
        camera = scene.cameras[silhouette.camera]
        inside, hidden = silhouette.distance[::grid, ::grid] > grid, frame.hidden_in(silhouette.camera)
        if hidden is not None:
            inside &= ~hidden[::grid, ::grid]
        pixel, layer = _drawn(surface, camera, layers, inside, grid)
        colour = bins_of(frame.images[silhouette.camera][pixel[:, 1], pixel[:, 0]])
        if known is not None:
            mine = colour_model(past).ratio[layer, colour] > SURELY
            layer, colour = layer[mine], colour[mine]
        counts += np.bincount(layer * BINS + colour, minlength=counts.size).reshape(counts.shape)
    return counts if known is None else keep * known + counts


def _drawn(surface: Surface, camera: Camera, layers: I32, inside: Bool, grid: int) -> tuple[I32, I32]:
    """Return pixels (P, 2) and the layer (P,) drawn there, of those on a grid (h, w), away from borders of layers."""
    row, column = np.nonzero(inside)
    vertex, _ = front_vertices(surface, camera, np.stack([column, row], axis=1).astype(np.float64) * grid)
    drawn = np.full(inside.shape, -1, np.int32)
    drawn[row, column] = np.where(vertex >= 0, layers[vertex], -1)
    whole = np.zeros(inside.shape, bool)
    core = drawn[1:-1, 1:-1]
    around = [drawn[:-2, 1:-1], drawn[2:, 1:-1], drawn[1:-1, :-2], drawn[1:-1, 2:]]
    whole[1:-1, 1:-1] = (core >= 0) & np.logical_and.reduce([core == other for other in around])
    row, column = np.nonzero(whole)
    return np.stack([column, row], axis=1).astype(np.int32) * np.int32(grid), drawn[row, column]


@memoised
def colour_model(past: Past) -> ColourModel:
    """Return what colours say of the layers, by what earlier frames have shown."""
    counts = past.appearance[COLOURS]
    known = counts.sum(axis=1) >= LEAST
    density = densities(counts)
    root = np.sqrt(density)
    distinct = (root @ root.T < OVERLAP) & known[:, None] & known[None]
    log_density = np.log((1 - UNSEEN) * density + UNSEEN / BINS)
    ratio = np.zeros(counts.shape, np.float32)
    for layer in np.flatnonzero(distinct.any(axis=1)):
        ratio[layer] = np.clip(log_density[layer] - log_density[distinct[layer]].max(axis=0), -CLIP, CLIP)
    return ColourModel(ratio, distinct, log_density)


def garment_log_ratio(past: Past, scene: Scene) -> F64 | None:
    """Return the log density (BINS,) of colours on the garment over that on any part that is mostly outside of it.

    Parts under the garment have shown its colours themselves, where it hung otherwise than it was drawn. None without a
    garment, where it leaves no part outside, and before a frame has shown it.
    """
    if scene.garment is None or COLOURS not in past.appearance:
        return None
    layers, density = layer_of(scene), colour_model(past).log_density
    skin, cloth = np.split(layers, [len(scene.body.vertices)])
    outside = np.bincount(skin, scene.near_garment, len(density)) < 0.5 * np.bincount(skin, minlength=len(density))
    return density[np.unique(cloth)].max(axis=0) - density[outside].max(axis=0) if outside.any() else None


def densities(counts: F64) -> F64:
    """Return the smoothed densities (L, BINS) of colours that were counted (L, BINS)."""
    from scipy.ndimage import gaussian_filter1d

    cube = counts.reshape(len(counts), SIDE, SIDE, SIDE)
    for axis in (1, 2, 3):
        cube = gaussian_filter1d(cube, SMOOTH, axis=axis, mode="constant", truncate=3.0)
    density: F64 = cube.reshape(counts.shape) / np.maximum(cube.sum(axis=(1, 2, 3)), 1e-9)[:, None]
    return density
