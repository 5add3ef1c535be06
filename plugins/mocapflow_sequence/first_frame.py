"""Which of a pixel's colours is the empty scene's: the start pose says about where the person first is."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from mocapflow_levelset.shadows import floor_around

from mocapflow.assets import Camera
from mocapflow.data import Surface
from mocapflow.geometry.cameras import magnification
from mocapflow.geometry.silhouettes import covered, distance_to
from mocapflow.records import F32, F64, U8, Bool
from mocapflow_sequence.colours import DEEP, Colours, alike, lab_bins, more_common, shaded
from mocapflow_sequence.dominant_colours import dominant_colours
from mocapflow_sequence.learnt import LEAST_SHARE, Learnt, brightest, shown

COLOURS = 4  # of each pixel that are looked at: the room's, of who stands there, of shadows
REACH_M = 0.15  # from the body at the start pose: limbs may be off by so much, and clothes stand off
AROUND_M = 0.5  # up to where the room beside the person is looked at
ROUNDS = 2  # first the body in its start pose is the person, then what differs there from the room that was found


class Evidence(NamedTuple):
    """What tells the room's colours from the person's."""

    first: F32  # (H, W, 3) the first frame
    far: Bool  # (H, W) True where it shows the room, but for shadows that have moved
    rooms: Bool  # for each colour, whether it is more common beside the person than on it
    persons: Bool  # for each colour, whether it is more common on the person

    def of_room(self, colour: Colours) -> Bool:
        """Return where (H, W) a colour is the room's."""
        bins = lab_bins(colour.mean)
        lit = shaded(colour.mean, self.first, DEEP) & ~self.persons[bins]  # the first frame need not show it anywhere
        return np.where(self.far, alike(colour, self.first) | lit, self.rooms[bins])


def empty_scene(
    pictures: U8, first: U8, body: Surface, camera: Camera, nobody: Bool | None = None, nobody_first: Bool | None = None
) -> Learnt:
    """Return one view of the empty scene: of the dominant colours of each pixel the first that is the room's.

    Away from the body in its start pose, the first frame shows the room, but where a limb was that the pose has
    elsewhere. Near it a colour is the room's if it is more common beside the body than on it.

    Args:
        pictures: (N, H, W, 3) BGR, from all over the recording.
        first: (H, W, 3) the first frame.
        body: the person in it, in the start pose.
        camera: the view.
        nobody: (N, H, W) False where somebody is known to be seen; None: nothing is known.
        nobody_first: (H, W) the same of the first frame.
    """
    nobody_first = np.ones(first.shape[:2], bool) if nobody_first is None else nobody_first
    colours, now = dominant_colours(pictures, COLOURS, nobody), lab_bins(first)
    usual = np.median(colours[0].spread, axis=(0, 1))
    beginning = shown(first, usual, nobody_first)
    person, away_m = _about(body, camera)
    far = (away_m > REACH_M) & nobody_first
    beside = far & (away_m < AROUND_M)
    for _ in range(ROUNDS):
        rooms, persons = more_common(now[beside], now[person]), more_common(now[person], now[beside])
        far = far & ~_left_behind(colours[0], beginning, rooms)
        beside = beside & far
        evidence = Evidence(beginning.mean, far, rooms, persons)
        learnt = chosen((*colours, beginning), evidence)
        person = ~far & learnt.known & ~alike(beginning, learnt.mean) & ~shaded(beginning.mean, learnt.mean)
    return lit(learnt, pictures, evidence, usual, floor_around(body, camera) & learnt.known)


def chosen(colours: Iterable[Colours], evidence: Evidence) -> Learnt:
    """Return the first colour of each pixel that is the room's."""
    learnt = Learnt(evidence.first.copy(), np.full(evidence.first.shape, np.inf, np.float32))
    for colour in colours:
        learnt.take(colour, (colour.share >= LEAST_SHARE) & ~learnt.known & evidence.of_room(colour))
    return learnt


def lit(learnt: Learnt, pictures: U8, evidence: Evidence, usual: F32, floor: Bool) -> Learnt:
    """Return an empty scene whose floor is as bright as any picture shows it."""
    if not floor.any():  # a view that shows none, or none that is known
        return learnt
    dim = Learnt(*(part[floor][:, None] for part in learnt))
    there = evidence._replace(first=evidence.first[floor][:, None], far=evidence.far[floor][:, None])
    colours = (shown(picture[floor][:, None], usual) for picture in pictures)
    found = brightest(dim, ((colour, there.of_room(colour)) for colour in colours))
    learnt.mean[floor], learnt.spread[floor] = found.mean[:, 0], found.spread[:, 0]
    return learnt


def _left_behind(dominant: Colours, first: Colours, rooms: Bool) -> Bool:
    """Return where (H, W) most pictures show a colour of the room, and the first frame another one that is not."""
    other = rooms[lab_bins(dominant.mean)] & ~rooms[lab_bins(first.mean)] & ~alike(dominant, first.mean)
    return other & (dominant.share > 0)


def _about(body: Surface, camera: Camera) -> tuple[Bool, F64]:
    """Return where (H, W) a body is seen, and how far (H, W) m from it every pixel is, at its distance."""
    person = covered(body, camera)
    if not person.any():  # beside the picture or behind the camera
        return person, np.full(person.shape, np.inf)
    away_px = distance_to(person).astype(np.float64)
    return person, away_px / magnification(camera, body.vertices.mean(axis=0))
