"""Stage `fit_stature`: how tall the person is, before anything is tracked."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from typing import ClassVar, Literal

import numpy as np
from mocapflow_draping.kinematic import Kinematic
from mocapflow_fitting.detections import frames_seen, has_keypoints
from mocapflow_fitting.keypoint_fit import fit
from mocapflow_fitting.landmarks import landmarks
from mocapflow_fitting.proportions import of_stature
from mocapflow_priors.density import Poses, read
from mocapflow_priors.parzen import SHIPPED
from pydantic import NonNegativeFloat

from mocapflow.assets import Body
from mocapflow.components import Stage
from mocapflow.data import Pose
from mocapflow.dressing.roles import Draper
from mocapflow.dressing.tailor import Tailor
from mocapflow.errors import GarmentError
from mocapflow.io.recording.plates import plate_files
from mocapflow.recordings.recording import Recording
from mocapflow.scene import Scene
from mocapflow_recovery.silhouette_target import Target, first_trimaps, target_of

LOG = logging.getLogger("mocapflow")
STEP = 1.03  # times as tall as the next
COARSE = 2  # steps at once, as long as poses are not searched yet
FARTHEST = 16  # steps: from 0.62 to 1.6 times as tall
SPREAD = {"stature": 0.2}  # standard deviation of the log, where keypoints tell it


class FitStature(Stage):
    """Makes a body as tall as the person whom the first frame shows, all of it to one scale.

    The garment has the person's measures: on a template of another stature it hangs elsewhere, or can't be sewn at all.
    Poses that people were seen in are compared with the silhouettes by bodies of several statures, as
    `start_from_silhouettes` does: as they are at first, and searched with the best stature and its neighbours. It comes
    within some 3 %.
    Without clean plates the keypoints of the first frames tell it.
    """

    name: ClassVar[str] = "fit_stature"
    extent: ClassVar[Literal["beginning"]] = "beginning"
    poses: Poses = SHIPPED  # that people were seen in, made by `mocapflow prior fit`
    draper: Draper | None = Kinematic(sweeps=4)  # of the garment; null: clothes are left out
    least: NonNegativeFloat = 0.04  # a difference less than this share is left to `calibrate_limbs`

    def run(self, recording: Recording, tailor: Tailor) -> Body:
        """Return the body, scaled.

        Raises:
            RecordingError: fewer than two cameras see a person in the first frame.
            GarmentError: the garment can't be sewn on a body of any stature.
        """
        if plate_files(recording.folder, recording.views):
            times = self._by_silhouettes(recording, tailor)
        elif has_keypoints(recording):
            times = _by_keypoints(recording, tailor)
        else:
            LOG.warning("neither clean plates nor keypoints tell how tall the person is: say so by body.height_m")
            return tailor.body
        height = float(np.ptp(tailor.body.vertices[:, 2]))
        near = abs(np.log(times)) < np.log1p(self.least) and _dressed(tailor, 1.0) is not None
        kept = "is left" if near else "is scaled"
        LOG.info("the person is about %.2f m tall; the body, %.2f m, %s", times * height, height, kept)
        return tailor.body if near else of_stature(tailor.body, times)

    def _by_silhouettes(self, recording: Recording, tailor: Tailor) -> float:
        found = first_trimaps(recording, Scene(cameras=tailor.cameras, body=tailor.body))
        seen = read(self.poses).on(tailor.body.screw_names)

        def target_at(steps: int) -> Target | None:
            scene = _dressed(tailor, STEP**steps) if abs(steps) <= FARTHEST else None
            return None if scene is None else target_of(scene, self.draper, found, seen)

        ladder = Ladder(target_at)
        outward = sorted(range(-FARTHEST, FARTHEST + 1), key=abs)
        begin = next((steps for steps in outward if ladder.target(steps)), None)
        if begin is None:
            tailor.dressed(tailor.body)  # says why not
            raise AssertionError("a garment that is sewn on a body can be sewn on it again")
        about = descended(ladder.as_they_are, begin, COARSE)
        closely = ladder.searched_from(about)
        best = descended(closely, about, 1)
        for end, steps in (("shorter", best - 1), ("taller", best + 1)):
            if ladder.target(steps) is None:
                _warn_at_an_end(end, STEP**best * float(np.ptp(tailor.body.vertices[:, 2])), abs(steps) > FARTHEST)
        return float(STEP ** vertex(closely, best))


class Ladder:
    """How well bodies of several statures agree with the silhouettes of a frame; they are told by their steps."""

    def __init__(self, target_at: Callable[[int], Target | None]) -> None:
        self.target = cache(target_at)  # None: no body of that stature wears the garment
        self.begins = cache(self._begins)

    def as_they_are(self, steps: int) -> float:
        """Return what the best of the poses that people were seen in costs."""
        target = self.target(steps)
        return np.inf if target is None else float(target.costs(self.begins(steps)[:1])[0])

    def searched_from(self, about: int) -> Callable[[int], float]:
        """Return what a pose costs by a stature, searched from the best one that a search finds by another."""
        there = self.target(about)
        assert there is not None
        ends = [there.searched(pose, number) for number, pose in enumerate(self.begins(about))]
        best = ends[int(there.costs(ends).argmin())]

        @cache
        def cost(steps: int) -> float:
            target = self.target(steps)
            return np.inf if target is None else float(target.costs([target.searched(target.centred(best), 0)])[0])

        return cost

    def _begins(self, steps: int) -> list[Pose]:
        target = self.target(steps)
        return [] if target is None else target.begins()


def _warn_at_an_end(end: str, height: float, farthest: bool) -> None:
    """Say that the person may be shorter or taller than a height (m): nobody farther off was tried, or wears that."""
    why = "are the cameras in metres?" if farthest else "are its measures right, waist_height_m above all?"
    tried = "nobody was tried" if farthest else "the garment can't be sewn on anybody"
    LOG.warning("%s who is %s than %.2f m, as the person may be: %s", tried, end, height, why)


def _dressed(tailor: Tailor, times: float) -> Scene | None:
    """Return the person so many times as tall as the body, None where the garment can't be sewn on them."""
    try:
        return tailor.dressed(of_stature(tailor.body, times))
    except GarmentError:
        return None


def _by_keypoints(recording: Recording, tailor: Tailor) -> float:
    names = landmarks(tailor.body).names
    found = frames_seen(recording, recording.indices, tailor.cameras, names)
    return fit(tailor.body, list(found.values()), tailor.cameras, SPREAD)[0]["stature"]


def descended(cost: Callable[[int], float], begin: int, stride: int) -> int:
    """Return the place, from one on, that costs no more than those a stride beside it."""
    while (best := min((begin, begin - stride, begin + stride), key=cost)) != begin:
        begin = best
    return begin


def vertex(cost: Callable[[int], float], least: int) -> float:
    """Return the lowest place of the parabola through a place of least cost and its neighbours."""
    before, there, after = (cost(least + step) for step in (-1, 0, 1))
    bend = before - 2 * there + after
    return least + (before - after) / (2 * bend) if 0 < bend < np.inf else float(least)
