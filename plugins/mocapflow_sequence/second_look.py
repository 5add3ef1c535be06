"""Stage `second_look`: frames that leap out from between their neighbours are fitted again, from there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.data import Frame, FrameResult
from mocapflow.functional import image_cost
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, I32, Bool
from mocapflow.results import ImageFlow, Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow.track import CoupledLoop, prepared
from mocapflow_sequence.fits import Fits

HELD = 8  # pictures of each camera in memory
LED = 4  # frames before a leap that may have to be looked at again as well, one by one


class SecondLook(Stage):
    """Looks again at frames that leap out from between the frame before and the one after.

    A track knows only what came before. Where a limb has moved too far from one frame to the next, the fit may end
    beside it, and a frame later, begun elsewhere, lie on it again. Both neighbours together say better where the limb
    was: the frame begins between them and is settled like any other. Of the two fits that one is kept which costs less
    by the pictures and leaps less; where the person has leapt, both are the same.

    It goes from later frames to earlier ones: a limb that was lost for some frames is found in one leap, and from there
    each frame leads to the one before.
    """

    name: ClassVar[str] = "second_look"
    leap_mm: PositiveFloat = 40.0  # of a joint, from between where it is before and after: more is looked at again
    other_mm: PositiveFloat = 10.0  # of a joint, between two fits: less, and they are the same
    leap_weight: NonNegativeFloat = 0.15  # half the leap makes up for 0.69 times this share of what the pictures cost

    def run(
        self,
        track: Track,
        loop: CoupledLoop,
        recording: Recording,
        scene: Scene,
        background: Background | None = None,
        flow: ImageFlow | None = None,
        checks: ViewChecks | None = None,
    ) -> Track:
        """Return the track with better fits of some frames, each with a note."""
        model, looked = loop.model_of(scene, background), np.zeros(len(track.frame), bool)
        fits = Fits(track, model.scene.body)
        while (suspect := self._leaping(fits) & ~looked).any():
            for rows, pictures in pictured(recording, track.frame, windows(suspect)):
                frames = [prepared(picture, checks, flow) for picture in pictures]
                self._look(rows, frames, fits, looked, loop, model)
        return fits.track()

    def _look(
        self, rows: I32, frames: Sequence[Frame], fits: Fits, looked: Bool, loop: CoupledLoop, model: ClothedModel
    ) -> None:
        """Look at those rows of a window that leap, but the last one; again where a neighbour has another fit now."""
        colours: Mapping[str, F64] | None = None
        for row, frame, after in reversed(list(zip(rows.tolist(), frames, frames[1:], strict=False))):
            if looked[row] or not self._leaping(fits)[row]:
                continue
            if colours is None:
                colours = self._colours(after, row + 1, fits, loop, model)
            parameters = fits.before.cloth_parameters[row].copy()
            result = loop.settled(frame, fits.past(row, colours), model, fits.between(row), parameters)
            looked[row] = True
            if self._better(result, row, fits):
                fits.take(row, frame, result)
                looked[[row - 1, row + 1]] = fits.other(row - 1), fits.other(row + 1)

    def _leaping(self, fits: Fits) -> Bool:
        return np.asarray(fits.leaps() > self.leap_mm / 1000)

    def _colours(self, frame: Frame, row: int, fits: Fits, loop: CoupledLoop, model: ClothedModel) -> Mapping[str, F64]:
        """Return what a frame shows of the person's colours; a track keeps only those of its end."""
        parameters = fits.before.cloth_parameters[row].copy()
        result = loop.settled(frame, fits.past(row, {}), model, fits.pose(row), parameters)
        return result.state.segmentation.appearance

    def _better(self, result: FrameResult, row: int, fits: Fits) -> bool:
        """Return whether another fit of a frame is to be preferred; see the class."""
        pose, before = result.state.estimate.pose, fits.before
        if fits.apart(row, pose) < self.other_mm / 1000:
            return False
        cost = image_cost(before.energy[row], before.energy_terms)
        dearer = (image_cost(result.energy, result.energy_terms) - cost) / max(abs(cost), 1.0)
        smoother = np.log(fits.leap(row, fits.pose(row)) / max(fits.leap(row, pose), 1e-9))
        return bool(dearer < self.leap_weight * smoother)


def windows(suspect: Bool) -> Iterator[I32]:
    """Yield rows that hang together, at most `HELD`: suspect ones (T,), those that led to them, and the one after.

    The last row of each is there for what it shows alone; where a window is cut, it is the first of the next.
    """
    wanted = suspect.copy()
    for back in range(1, LED + 1):
        wanted[:-back] |= suspect[back:]
    wanted[1:] |= suspect[:-1]
    rows = np.flatnonzero(wanted).astype(np.int32)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        for end in range(len(run) - (len(run) - 2) // (HELD - 1) * (HELD - 1), len(run) + 1, HELD - 1):
            yield run[max(end - HELD, 0) : end]


def pictured(recording: Recording, number: I32, groups: Iterable[I32]) -> Iterator[tuple[I32, list[Frame]]]:
    """Yield each group of rows with its frames, whose numbers (T,) are known by row; no picture is decoded twice."""
    held: list[Frame] = []
    coming: Iterator[Frame] | None = None
    for rows in groups:
        first, last = int(number[rows[0]]), int(number[rows[-1]])
        coming = coming or recording.frames(since=first)
        held = [frame for frame in held if frame.index >= first]
        while not held or held[-1].index < last:
            frame = next(coming)
            held += [frame] if frame.index >= first else []
        yield rows, held
