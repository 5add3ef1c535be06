"""Trimaps: where an image surely shows the person, where surely the empty room, and where it may be either."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mocapflow_levelset import crops
from mocapflow_levelset.channels import ChannelName, features
from mocapflow_levelset.colours import bins_of
from mocapflow_levelset.plates import USUAL, Plate, density_image, plate_in, squared_deviations
from mocapflow_levelset.shadows import floor_around

from mocapflow.assets import Background, Camera
from mocapflow.data import Frame, Surface
from mocapflow.geometry.cameras import magnification, shrunk
from mocapflow.geometry.silhouettes import covered, distance_to
from mocapflow.memo import memoised
from mocapflow.records import F32, F64, U8, Bool

CHANNELS: tuple[ChannelName, ...] = ("lab",)
ROWS = 160  # of a small view, about
EMPTY = 3.0  # standard deviations within which a pixel is that of the empty room
SPECK = 0.01  # of the largest part's area: smaller parts are noise
MOST = 3.0  # of the model's area: more can't be the person
LEAST = 0.1  # of it: less is hardly the person; something may stand before them
SURELY = 1.0  # log density of a colour on the garment over that elsewhere from which on it is the garment's
SEAM = np.ones((5, 5), np.uint8)  # gaps in the person so narrow are the person's


class SmallRoom(NamedTuple):
    """The empty room as a small camera sees it."""

    camera: Camera
    factor: int  # by which it is smaller than the recording's
    plate: Plate


class Trimap(NamedTuple):
    """The trimap of one small view. Shadows of the person, and clothes of the colours of the room, are neither."""

    camera: Camera
    person: Bool  # (h, w) surely no empty room, lit or in a shadow
    cloth: Bool  # (h, w) pixels of the person that show the garment, by its colours; none are known in a first frame
    informative: bool  # whether the person is more than a scrap; else it tells nothing of a pose
    distance: F32  # (h, w) px to the nearest pixel that may be the person; 0 on it
    pixel_m: float  # how large a pixel is where the person stands
    known: float  # share of the model's area before a room that somebody knows


@memoised
def small_rooms(background: Background, cameras: tuple[Camera, ...]) -> tuple[SmallRoom, ...]:
    """Return the empty room in small images, by camera; made once, forgotten with the background."""
    rooms = []
    for number, camera in enumerate(cameras):
        factor = max(round(camera.size[1] / ROWS), 1)
        rooms.append(SmallRoom(shrunk(camera, factor), factor, plate_in(background, number, CHANNELS, factor)))
    return tuple(rooms)


def trimaps(
    frame: Frame,
    surface: Surface,
    rooms: Sequence[SmallRoom],
    near_m: float,
    garment: F64 | None = None,
    no_shadow: Sequence[Bool] | None = None,
) -> list[Trimap]:
    """Return the trimaps of the usable views of a frame, each at the size of its camera.

    A view that is unlike the empty room nearly everywhere shows nothing surely and is left out.

    Args:
        frame: the images, in full size.
        surface: the person as predicted or fitted: parts further away than `near_m` in the image are somebody else.
        rooms: the empty room by camera.
        near_m: see `surface`.
        garment: (BINS,) log density of colours on the garment over that on parts outside of it; None: it is not known.
        no_shadow: (H, W) by camera, in full size, True where other views see that there is none; None: nobody knows.
    """
    found, middle = [], surface.vertices.mean(axis=0)
    for number in np.flatnonzero(frame.usable).tolist():
        camera, factor, plate = rooms[number]
        model, pixel_m = covered(surface, camera), 1 / magnification(camera, middle)
        small, visible = crops.shrink(frame.images[number], factor), _visible(frame.hidden_in(number), factor)
        floor = floor_around(surface, camera)
        if no_shadow is not None:
            floor = floor & ~crops.shrink_mask(no_shadow[number], factor)
        changed, same = _compared(small, plate, floor)
        person = _near(changed & visible, model, near_m / pixel_m)
        seen, expected = np.count_nonzero(person), np.count_nonzero(model)
        if seen < MOST * expected:
            cloth = np.zeros(person.shape, bool) if garment is None else person & (garment[bins_of(small)] > SURELY)
            known = float(np.isfinite(plate.spread)[model].mean())
            informative, distance = bool(seen > LEAST * expected), _distance(same & visible, person)
            found.append(Trimap(camera, person, cloth, informative, distance, pixel_m, known))
    return found


def changes(image: U8, hidden: Bool | None, room: SmallRoom) -> Bool:
    """Return where (h, w) an image (H, W, 3), but for what hides the scene, differs from the empty room.

    The shadows of whoever is there are included.
    """
    small = crops.shrink(image, room.factor)
    return _compared(small, room.plate, np.zeros(small.shape[:2], bool))[0] & _visible(hidden, room.factor)


def _visible(hidden: Bool | None, factor: int) -> Bool | bool:
    """Return where (h, w) no pixel of a mask (H, W) hides the scene; True: everywhere."""
    return True if hidden is None else np.asarray(crops.shrink(hidden.astype(np.float32), factor) == 0)


def _compared(image: U8, plate: Plate, floor: Bool) -> tuple[Bool, Bool]:
    """Return where an image (h, w, 3) is not the empty room, lit or shaded, and where it looks just like it.

    Where nobody knows the room, it is neither.
    """
    values = features(image, CHANNELS)
    off = squared_deviations(values, plate, CHANNELS)
    changed = density_image(values, plate, floor, CHANNELS, USUAL) < 0
    return changed, (off < EMPTY**2) & np.isfinite(plate.spread)


def _distance(empty: Bool, person: Bool) -> F32:
    """Return the distance (h, w) px of every pixel from what may be the person: that is not empty, or in a gap."""
    import cv2

    closed = cv2.morphologyEx(person.view(np.uint8), cv2.MORPH_CLOSE, SEAM)
    return distance_to(~empty | (closed != 0))


def _near(changed: Bool, model: Bool, near_px: float) -> Bool:
    """Return the parts of a change that are no specks and not far from the model."""
    import cv2

    count, label, stats, _ = cv2.connectedComponentsWithStats(changed.view(np.uint8), connectivity=8)
    kept = np.zeros(count, bool)
    kept[label[distance_to(model) <= near_px]] = True
    kept[0] = False
    area = np.where(kept, stats[:, cv2.CC_STAT_AREA], 0)
    kept &= area >= max(SPECK * area.max(initial=0), 2)
    near: Bool = kept[label]
    return near
