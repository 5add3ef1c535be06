"""Stage `join`: the parts of a track as one."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from pydantic import PositiveFloat

from mocapflow.components import Stage
from mocapflow.errors import PipelineError
from mocapflow.geometry import kinematics
from mocapflow.records import F64, I32, Bool, array_fields
from mocapflow.results import Track, notes_of
from mocapflow.scene import Scene
from mocapflow.series import Series, joined, picked

LOG = logging.getLogger("mocapflow")


class Join(Stage):
    """Goes over from each part to the next at the frame in which they agree best.

    How far apart they are there, and in all frames that both have, is noted at that frame: the mean distance of
    their joint centres. Nothing is blended: every frame stays one that the loop came to.
    """

    name: ClassVar[str] = "join"
    tolerance_mm: PositiveFloat = 20.0  # parts farther apart where they are joined get a warning

    def run(self, parts: tuple[Track, ...], scene: Scene) -> Track:
        """Return the joined track.

        Raises:
            PipelineError: two parts have no frame in common.
        """
        track = parts[0]
        for later in parts[1:]:
            common, apart = disagreement(track, later, scene)
            best = int(np.argmin(apart))
            seam = int(common[best])
            note = self._note(seam, 1000 * apart, best)
            before, after = cut(track, track.frame < seam), cut(later, later.frame >= seam)
            track = together(before, replace(after, notes=(note, *after.notes)))
        return track

    def _note(self, seam: int, apart_mm: F64, best: int) -> str:
        far = apart_mm[best] > self.tolerance_mm
        said = (
            f"frame {seam}: parts {'that disagree are ' if far else ''}joined, {apart_mm[best]:.1f} mm apart; in the "
            f"{len(apart_mm)} frames of both {np.median(apart_mm):.1f} mm in the median, {apart_mm.max():.1f} at most"
        )
        if far:
            LOG.warning(said)
        return said


def disagreement(one: Track, other: Track, scene: Scene) -> tuple[I32, F64]:
    """Return the frames (K,) that two tracks share and how far apart they are (K,) m: the mean over joint centres.

    Raises:
        PipelineError: they share none.
    """
    common = np.intersect1d(one.frame, other.frame)
    if not len(common):
        hint = "parts that are joined need frames in common: parts.overlap says how many"
        raise PipelineError(f"frames {one.frame[-1]} and {other.frame[0]} have nothing between them", hint=hint)
    shared = [cut(track, np.isin(track.frame, common)) for track in (one, other)]
    places = [kinematics.joint_centres(scene.body, track.root, track.angles) for track in shared]
    return common.astype(np.int32), np.linalg.norm(places[0] - places[1], axis=2).mean(axis=1)


def cut(track: Track, rows: Bool) -> Track:
    """Return some rows (T,) of a track, with the notes on them."""
    values: dict[str, Any] = {name: picked(getattr(track, name), rows) for name in _by_frame(track)}
    return replace(track, notes=notes_of(values["frame"], track.notes), **values)


def together(first: Track, second: Track) -> Track:
    """Return two tracks one after the other."""
    both: dict[str, Any] = {name: end_to_end(getattr(first, name), getattr(second, name)) for name in _by_frame(first)}
    return replace(first, notes=first.notes + second.notes, **both)


def end_to_end(first: Any, second: Any) -> Any:
    """Return the rows of two arrays, or of two series, one after the other."""
    if isinstance(first, Series) or isinstance(second, Series):
        return joined(first, second)
    return np.concatenate([first, second])


def _by_frame(track: Track) -> list[str]:
    """Return the names of the arrays with a row per frame."""
    declared = array_fields(Track).items()
    return [name for name, field in declared if field.axes[0] == "T" and getattr(track, name) is not None]
