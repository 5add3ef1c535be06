"""What an image surely shows: here the person, there the empty room, and elsewhere either, for all one can tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from mocapflow_levelset import crops
from mocapflow_levelset.channels import ChannelName, features
from mocapflow_levelset.evidence import without_outliers
from mocapflow_levelset.plates import Plate, Shadow, density_of, plate_of
from mocapflow_levelset.shadows import floor_around

from mocapflow.assets import Background, Camera
from mocapflow.data import Frame, Surface
from mocapflow.geometry.silhouettes import mask, outline
from mocapflow.records import F32, U8, Bool

CHANNELS: tuple[ChannelName, ...] = ("lab",)
SHADOW = Shadow(floor=0.012, share=0.2, darkest=0.5, chroma=0.005, stranger=-6.0)
EMPTY = 3.0  # standard deviations within which a pixel is that of the empty room
FLOOR_REACH = 2.0  # m, from the person, where their shadow may fall
SPECK = 0.01  # of the largest part's area: smaller parts are noise
MOST = 3.0  # of the model's area: more can't be the person
SEAM = np.ones((5, 5), np.uint8)  # gaps in the person so narrow are the person's


class View(NamedTuple):
    """One small view. The person casts shadows and may wear the colours of the room: such pixels are neither."""

    camera: Camera
    person: Bool  # (h, w) surely no empty room, lit or in a shadow
    away: F32  # (h, w) px to the nearest pixel that may be the person; 0 on it
    pixel_m: float  # how large a pixel is where the person stands


def views(
    frame: Frame,
    surface: Surface,
    cameras: tuple[Camera, ...],
    room: tuple[Plate, ...],
    near_m: float,
    median_px: int = 0,
    hidden: Sequence[Bool | None] | None = None,
) -> list[View]:
    """Return what the usable views of a frame surely show, each at the size of its camera.

    A view that is unlike the empty room nearly everywhere shows nothing surely and is left out.

    Args:
        frame: the images, in full size.
        surface: the person as believed: parts further away than `near_m` in the image are somebody else.
        cameras: those of the scene, shrunk.
        room: the empty room at the same size.
        near_m: see `surface`.
        median_px: width of a median filter of the images, against pixels of no meaning; 0 for none.
        hidden: per view where it shows neither room nor person, in full size; None: nowhere.
    """
    found = []
    for camera, plate, c in zip(cameras, room, range(len(cameras)), strict=True):
        model = mask(outline(surface, camera), camera)
        image, cover = frame.images[c], None if hidden is None else hidden[c]
        view = _view(image, surface, model, camera, plate, near_m, median_px, cover) if frame.usable[c] else None
        if view is not None and np.count_nonzero(view.person) < MOST * np.count_nonzero(model):
            found.append(view)
    return found


def empty_room(background: Background, cameras: tuple[Camera, ...]) -> tuple[Plate, ...]:
    """Return the empty room as the small cameras see it."""
    shrunk = zip(background.mean, background.spread, cameras, strict=True)
    return tuple(plate_of(mean, spread, CHANNELS, mean.shape[1] // camera.size[0]) for mean, spread, camera in shrunk)


def shrunk(camera: Camera, factor: int) -> Camera:
    """Return a camera whose pixels are the means of squares of another's."""
    to_small = np.array([[1, 0, 0.5 - factor / 2], [0, 1, 0.5 - factor / 2], [0, 0, factor]]) / factor
    return replace(camera, intrinsics=to_small @ camera.intrinsics, size=(camera.size // factor).astype(np.int32))


def pixel_size(camera: Camera, surface: Surface) -> float:
    """Return how many metres a pixel measures at the middle of a surface."""
    depth = (camera.camera_from_world @ np.append(surface.vertices.mean(axis=0), 1.0))[2]
    return float(depth / camera.intrinsics[0, 0])


def _view(
    image: U8,
    surface: Surface,
    model: Bool,
    camera: Camera,
    room: Plate,
    near_m: float,
    median_px: int,
    hidden: Bool | None,
) -> View:
    import cv2

    factor = image.shape[1] // int(camera.size[0])
    values = features(crops.shrink(without_outliers(image, median_px), factor), CHANNELS)
    floor = floor_around(surface, camera, FLOOR_REACH)
    flat, expected, spread = values.reshape(len(values), -1), room.planes.reshape(len(values), -1), room.spread.ravel()
    density = density_of(flat, expected, spread, floor.ravel(), CHANNELS, SHADOW).reshape(floor.shape)
    off = np.sum((values - room.planes) ** 2, axis=0) / np.maximum(room.spread, SHADOW.floor) ** 2
    size = pixel_size(camera, surface)
    told = np.ones(model.shape, bool) if hidden is None else crops.shrink_values(hidden.astype(np.float32), factor) == 0
    person = _near((density < 0) & told, model, near_m / size)
    closed = cv2.morphologyEx(person.view(np.uint8), cv2.MORPH_CLOSE, SEAM)
    empty = (off < EMPTY**2) & (closed == 0) & told
    away = cv2.distanceTransform(empty.view(np.uint8), cv2.DIST_L2, 3)
    return View(camera, person, np.asarray(away, np.float32), size)


def _near(changed: Bool, model: Bool, near_px: float) -> Bool:
    """Return the parts of a change that are no specks and not far from the model."""
    import cv2

    count, label, stats, _ = cv2.connectedComponentsWithStats(changed.view(np.uint8), connectivity=8)
    away = cv2.distanceTransform((~model).view(np.uint8), cv2.DIST_L2, 3)
    kept = np.zeros(count, bool)
    kept[np.unique(label[away <= near_px])] = True
    kept[0] = False
    area = np.where(kept, stats[:, cv2.CC_STAT_AREA], 0)
    kept &= area >= max(SPECK * area.max(initial=0), 2)
    near: Bool = kept[label]
    return near
