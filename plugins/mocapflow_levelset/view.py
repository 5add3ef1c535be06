"""One view: from a start contour to the silhouette, coarse to fine, within a crop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.records import F32, U8, Bool
from mocapflow_levelset import crops
from mocapflow_levelset.channels import ChannelName
from mocapflow_levelset.colours import bins_of
from mocapflow_levelset.crops import Crop
from mocapflow_levelset.evidence import Evidence, Room, from_image, in_room
from mocapflow_levelset.evolve import Costs, Schedule, Settled, Weights, costs, settle
from mocapflow_levelset.islands import without_islands
from mocapflow_levelset.matting import NEAR_PX, sharpened
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.statistics import Window

# half width of the band in which a silhouette's distances are computed; that of `functional`, so that the distance to
# the model's outline is computed once for both
BAND_PX = 12.0


class Contact(NamedTuple):
    """How to go on where the body meets the floor, in full size."""

    zone: Bool  # (H, W)
    schedule: Schedule
    window: Window


class Matte(NamedTuple):
    """How to place the contour within its pixels."""

    room: F32  # (H, W, 3) BGR, the empty room
    known: Bool  # (H, W) True where it is known
    reach_px: int  # across the edge to either side


class View(NamedTuple):
    """What is given of one view."""

    image: U8  # (H, W, 3) BGR
    start: F32  # (H, W) signed distance to the start contour, positive inside; only its zero contour counts
    prior: F32  # (H, W) px, signed distance to the model's outline
    counted: Bool  # (H, W) True where a pixel counts
    rooms: Mapping[int, Room] | None = None  # the empty room, by how much it is shrunk
    colours: F32 | None = None  # (BINS,) log ratio of each colour on the person and in the room, by earlier frames
    contact: Contact | None = None
    matte: Matte | None = None
    moved: Bool | None = None  # (H, W) True around where the contour is found anew; None: all of it

    def of(self, crop: Crop) -> View:
        """Return what is given of a rectangle of the view."""
        rooms, contact, matte = self.rooms, self.contact, self.matte
        return self._replace(
            image=crop.of(self.image), start=crop.of(self.start), prior=crop.of(self.prior),
            counted=crop.of(self.counted),
            rooms=rooms and {factor: room.of(crop.at(factor)) for factor, room in rooms.items()},
            contact=contact and contact._replace(zone=crop.of(contact.zone)),
            matte=matte and matte._replace(room=crop.of(matte.room), known=crop.of(matte.known)),
            moved=None if self.moved is None else crop.of(self.moved),
        )  # fmt: skip


class Resolution(NamedTuple):
    """An image shrunk by a factor, and how long to stay there."""

    factor: int
    schedule: Schedule
    window: Window  # in px of the shrunken image
    use_plate: bool = True  # False: local statistics on both sides even where the empty scene is known


class Method(NamedTuple):
    """How to find a silhouette."""

    channels: Sequence[ChannelName]
    weights: Weights
    decorrelate: bool
    stride: int  # of the pixels of the full image that the statistics are taken from
    margin_px: int


class Found(NamedTuple):
    """The silhouette of one view and its costs; where only a part was found anew, by how much they have changed."""

    level: F32  # (H, W) px, signed distance clipped to the band
    costs: Costs


def find(view: View, resolutions: Sequence[Resolution], method: Method) -> Found:
    """Return the silhouette of one view (H, W) and its costs; everything outside without a start contour.

    Args:
        view: what is given of it.
        resolutions: coarse to fine; the last is of the image as it is.
        method: the constants.
    """
    due, multiple = view.start if view.moved is None else view.moved, max(each.factor for each in resolutions)
    crop = crops.around(due, method.margin_px, multiple)
    whole = np.full(view.start.shape, -BAND_PX, np.float32) if view.moved is None else view.start.copy()
    if crop is None:
        return Found(whole, Costs(0.0, 0.0, 0.0))
    part = view.of(crop)
    settled = _settled(part, resolutions, method)
    found = redistance(_refined(settled.level, part, method), BAND_PX)
    # near the rim of a part its statistics lack a side
    kept = crop if view.moved is None else crops.around(view.moved, method.margin_px // 2, multiple)
    assert kept is not None
    kept.of(whole)[:] = kept.within(crop).of(found)
    now = _costs(crop.of(whole), settled, method)
    if view.moved is None:
        return Found(whole, now)
    before = _costs(part.start, settled, method)
    return Found(whole, Costs(*(new - old for new, old in zip(now, before, strict=True))))


def _settled(view: View, resolutions: Sequence[Resolution], method: Method) -> Settled:
    """Return where the descent ended, coarse to fine."""
    images = crops.pyramid(view.image, [each.factor for each in resolutions])
    front, factor = view.start, 1
    for resolution in resolutions:
        prior = crops.coarser(view.prior, resolution.factor)
        front = _brought(front, factor, resolution.factor, method.weights.band_px)
        evidence = _evidence(images[resolution.factor], view, resolution, method)
        begin = without_islands(front, evidence)
        settled = settle(begin, prior, evidence, resolution.window, method.weights, resolution.schedule)
        front, factor = settled.level, resolution.factor
    return settled


def _refined(front: F32, view: View, method: Method) -> F32:
    """Return a level set that has gone on where the body meets the floor, and within its pixels.

    A matte does not move it where a shadow that the empty room lacks ends at the foot.
    """
    movable = view.counted
    if view.contact is not None:
        front = _by_chromaticity(front, view, view.contact, method)
        movable = movable & ~view.contact.zone
    if view.matte is None:
        return front
    movable = movable & view.matte.known
    return sharpened(redistance(front, NEAR_PX), view.image, view.matte.room, movable, view.matte.reach_px)


def _costs(level: F32, settled: Settled, method: Method) -> Costs:
    """Return what a level set costs by the evidence at hand, where the contour has moved in it."""
    band = np.float32(method.weights.band_px)
    return costs(settled._replace(level=np.clip(level, -band, band)), method.weights)


def _by_chromaticity(front: F32, view: View, contact: Contact, method: Method) -> F32:
    """Return a level set that has gone on by chromaticity where the body meets the floor, and stays elsewhere.

    The edge of a foot that stands is dark, and so is the floor below it: by brightness the contour runs a pixel or
    two inside the foot, which then seems to stand higher than it does.
    """
    near = crops.around(contact.zone, round(min(2 * contact.window.rho_px, method.margin_px)), 1)
    if near is None:
        return front
    image, weight = near.of(view.image), near.of(view.counted).astype(np.float32)
    evidence = from_image(image, weight, ("chromaticity",), method.stride, method.decorrelate)
    start = redistance(np.ascontiguousarray(near.of(front)), method.weights.band_px)
    prior = np.ascontiguousarray(near.of(view.prior))
    found = settle(start, prior, evidence, contact.window, method.weights, contact.schedule).level
    whole = front.copy()
    zone = near.of(contact.zone)
    near.of(whole)[zone] = found[zone]
    return whole


def _brought(level: F32, factor: int, wanted: int, band_px: float) -> F32:
    """Return a level set of the image shrunk by `factor` as a signed distance where it is shrunk by `wanted`.

    Enlarged, it is not clipped to the band.
    """
    if wanted < factor:  # a distance first, where it costs least
        return crops.finer(redistance(level, band_px), factor // wanted)
    return redistance(crops.coarser(level, wanted // factor), band_px)


def _evidence(small: U8, view: View, resolution: Resolution, method: Method) -> Evidence:
    """Return what the image says at one resolution, to which it is shrunk."""
    factor = resolution.factor
    room = view.rooms[factor] if view.rooms and resolution.use_plate else None
    weight = crops.shrink_mask(view.counted, factor).astype(np.float32)
    turned = method.decorrelate and room is None
    evidence = from_image(small, weight, method.channels, max(method.stride // factor, 1), turned)
    if room is not None:
        evidence = in_room(evidence, small, method.channels, room)
    if view.colours is None:
        return evidence
    return evidence._replace(colour_ratio=evidence.weight * view.colours[bins_of(small)])
