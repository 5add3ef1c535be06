"""Which of a pixel's colours is the empty scene's: the start pose says about where the person first is."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from mocapflow_levelset.shadows import floor_around

from mocapflow.assets import Camera
from mocapflow.data import Surface
from mocapflow.geometry.cameras import magnification
from mocapflow.geometry.silhouettes import mask, outline
from mocapflow.records import F32, F64, I32, U8, Bool
from mocapflow_sequence.commonest import Colours, commonest

COLOURS = 4  # of each pixel that are looked at: the room's, of who stands there, of shadows
ALIKE = 3.0  # standard deviations within which two colours of a pixel are the same
NOISE = 3.0  # grey levels, the least standard deviation
TINT, SHADE = 1.07, 2.0  # one colour in a shadow of the other: channels fall alike, to half of the levels at most
REACH_M = 0.15  # from the body at the start pose: limbs may be off by so much, and clothes stand off
AROUND_M = 0.5  # up to where the room beside the person is looked at
ROOM = 1.5  # times as common beside the person as on it: a colour of the room
ROUNDS = 2  # first the body as believed is the person, then what differs there from the room that was found
BINS = (32, 64, 64)  # of lightness and the two colours of CIELAB
SMOOTH = 1.0  # bins, of the densities
RARE = 3e-4  # a colour that is rarer beside the person says nothing


class Learnt(NamedTuple):
    """The empty scene in one view, in grey levels."""

    mean: F32  # (H, W, 3)
    spread: F32  # (H, W, 3) standard deviation, inf where nobody knows

    @property
    def known(self) -> Bool:
        """Where (H, W) somebody knows."""
        return np.asarray(np.isfinite(self.spread[..., 0]))


class Evidence(NamedTuple):
    """What tells the room's colours from the person's."""

    first: F32  # (H, W, 3) the first frame
    far: Bool  # (H, W) True where it shows the room, but for shadows that have moved
    floor: Bool  # (H, W) True where the floor may be seen
    rooms: tuple[Bool, Bool]  # elsewhere and on the floor: which colours are more common beside the person than on it

    def of_room(self, colour: Colours) -> Bool:
        """Return where (H, W) a colour is the room's."""
        bins = bins_of(colour.mean)
        rooms = np.where(self.floor, self.rooms[True][bins], self.rooms[False][bins])
        return np.where(self.far, alike(colour, self.first) | (shaded(colour.mean, self.first) & rooms), rooms)


def empty_scene(pictures: U8, first: U8, body: Surface, camera: Camera, least_share: float) -> Learnt:
    """Return one view of the empty scene: of the commonest colours of each pixel the first that is the room's.

    Away from the body as believed in the first frame, that frame shows the room. Near it a colour is the room's if it
    is more common beside the body than on it.

    Args:
        pictures: (N, H, W, 3) BGR, from all over the recording.
        first: (H, W, 3) the first frame.
        body: the person as believed in it.
        camera: the view.
        least_share: of the pictures that have to show a colour.
    """
    colours, now, floor = commonest(pictures, COLOURS), bins_of(first), floor_around(body, camera)
    usual = np.median(colours[0].spread, axis=(0, 1))
    shown = _shown(first, usual)
    person, away_m = _about(body, camera)
    far = away_m > REACH_M
    beside = far & (away_m < AROUND_M)
    for _ in range(ROUNDS):
        rooms = [more_common(now[beside & part], now[person & part]) for part in (~floor, floor)]
        evidence = Evidence(shown.mean, far, floor, (rooms[0], rooms[1]))
        learnt = chosen((*colours, shown), evidence, least_share)
        person = ~far & learnt.known & ~alike(shown, learnt.mean) & ~shaded(shown.mean, learnt.mean)
    return lit(learnt, pictures, evidence, usual)


def chosen(colours: Iterable[Colours], evidence: Evidence, least_share: float) -> Learnt:
    """Return the first colour of each pixel that is the room's."""
    learnt = Learnt(evidence.first.copy(), np.full(evidence.first.shape, np.inf, np.float32))
    for colour in colours:
        _take(learnt, colour, (colour.share >= least_share) & ~learnt.known & evidence.of_room(colour))
    return learnt


def lit(learnt: Learnt, pictures: U8, evidence: Evidence, usual: F32) -> Learnt:
    """Return an empty scene whose floor is as bright as any picture shows it, for the person may always shade it."""
    floor = evidence.floor & learnt.known
    dim = Learnt(*(part[floor][:, None] for part in learnt))
    there = evidence._replace(first=evidence.first[floor][:, None], far=evidence.far[floor][:, None])
    there = there._replace(floor=evidence.floor[floor][:, None])
    found = Learnt(dim.mean.copy(), dim.spread)
    for picture in pictures:
        colour = _shown(picture[floor][:, None], usual)
        brighter = _every(colour.mean > found.mean) & ~alike(colour, found.mean)
        _take(found, colour, brighter & shaded(colour.mean, dim.mean) & there.of_room(colour))
    learnt.mean[floor], learnt.spread[floor] = found.mean[:, 0], found.spread[:, 0]
    return learnt


def more_common(beside: I32, on: I32) -> Bool:
    """Return for each colour whether it is more common among some pixels (N,) than among others (M,)."""
    found: Bool = _density(beside) > ROOM * (_density(on) + RARE)
    return found


def alike(colour: Colours, other: F32) -> Bool:
    """Return where (H, W) a colour is another one but for noise."""
    near = np.abs(colour.mean - other) < ALIKE * np.maximum(colour.spread, NOISE)
    return _every(near)


def shaded(colour: F32, other: F32) -> Bool:
    """Return where (H, W) one of two colours is the other in a neutral shadow."""
    b, g, r = np.moveaxis((colour + 1) / (other + 1), 2, 0)
    low, high = np.minimum(np.minimum(b, g), r), np.maximum(np.maximum(b, g), r)
    found: Bool = (high < TINT * low) & (low > 1 / SHADE) & (high < SHADE)
    return found


def bins_of(image: U8 | F32) -> I32:
    """Return the number of the colour of each pixel (H, W) of an image (H, W, 3) BGR."""
    import cv2

    number = np.zeros(image.shape[:2], np.int32)
    lab = cv2.cvtColor(np.rint(image).astype(np.uint8), cv2.COLOR_BGR2LAB)
    for channel, count in zip(cv2.split(lab), BINS, strict=True):
        number = number * count + channel.astype(np.int32) * count // 256
    return number


def _density(bins: I32) -> F64:
    """Return how common each colour is among pixels (N,)."""
    from scipy.ndimage import gaussian_filter

    counts = np.bincount(bins, minlength=int(np.prod(BINS))).astype(np.float64).reshape(BINS)
    found: F64 = gaussian_filter(counts, SMOOTH).ravel() / max(len(bins), 1)
    return found


def _every(channels: Bool) -> Bool:
    """Return where (H, W) all three channels hold; `all(axis=2)` takes four times as long."""
    b, g, r = np.moveaxis(channels, 2, 0)
    found: Bool = b & g & r
    return found


def _shown(picture: U8, usual: F32) -> Colours:
    """Return the colours of one picture, as noisy (3,) as is usual."""
    spread = np.broadcast_to(usual, picture.shape)
    return Colours(picture.astype(np.float32), spread, np.ones(picture.shape[:2], np.float32))


def _about(body: Surface, camera: Camera) -> tuple[Bool, F64]:
    """Return where (H, W) a body is seen, and how far (H, W) m from it every pixel is, at its distance."""
    import cv2

    person = mask(outline(body, camera), camera)
    away_px = np.asarray(cv2.distanceTransform((~person).view(np.uint8), cv2.DIST_L2, 3), np.float64)
    return person, away_px / magnification(camera, body.vertices.mean(axis=0))


def _take(learnt: Learnt, colour: Colours, where: Bool) -> None:
    """Put a colour into what is learnt, in place."""
    learnt.mean[where], learnt.spread[where] = colour.mean[where], colour.spread[where]
