"""Searches in vain: a doubt that stays as it is is mostly one about the room, and is looked into ever more rarely."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mocapflow.data import FrameResult, Past
from mocapflow.periodic import falls_due

VAIN = "searches in vain"  # of Segmentation.appearance: (2,) a `Vain`
SOON = 3  # such searches in a row, after which the next one waits
LONGEST_S = 1.0  # that it waits, at most
CHANGED = 1.5  # times as much, or as little, may stray of a doubt that is still the same
MORE = 300.0  # cm² that may stray more: a limb that is lost before a room that has changed has more


class Vain(NamedTuple):
    """Searches after which the fit was still doubted."""

    searches: int = 0  # in a row; from `SOON` on those that found nothing better of a doubt that stays the same
    strayed: float = 0.0  # cm² that strayed before the last one

    def due(self, strays: float, time: float, past: Past, every: int) -> bool:
        """Return whether a fit of which so much strays (cm²) is searched now.

        After a few searches one frame of `every` is; the wait doubles with each search that finds nothing better of a
        doubt that stays the same, unless `every` is 1.
        """
        if self.searches < SOON or not past.moments:
            return True
        wait = every
        if self.same(strays) and every > 1:
            longest = round(LONGEST_S / (time - past.moments[-1].time))
            wait = max(every, min(every << (self.searches - SOON), longest))
        return in_turn(wait, time, past)

    def after(self, strays: float, helped: bool) -> Vain:
        """Return what is known after one more search, of a fit of which so much (cm²) strayed."""
        searches = self.searches + 1
        return Vain(min(searches, SOON) if helped or not self.same(strays) else searches, strays)

    def same(self, strays: float) -> bool:
        """Return whether a doubt stays the same: about as much (cm²) strays as before."""
        return self.strayed / CHANGED < strays < min(CHANGED * self.strayed, self.strayed + MORE)


def in_turn(every: int, time: float, past: Past) -> bool:
    """Return whether this is the one frame of so many; by time, as frames may be left out."""
    last = past.moments[-1].time
    return falls_due(last, time, every * (time - last))


def vain_before(past: Past) -> Vain:
    """Return what earlier frames were searched in vain."""
    searches, strayed = past.appearance.get(VAIN, np.zeros(2))
    return Vain(int(searches), float(strayed))


def counted(found: FrameResult, fitted: FrameResult, strays: float, past: Past) -> FrameResult:
    """Return what a search found, as later frames know it.

    Args:
        found: its result.
        fitted: that of the loop; the same state: nothing better was found.
        strays: cm² that strayed of it.
        past: of the frame.
    """
    if not found.doubted:
        return forgotten(found, past)
    return _with(found, past, vain_before(past).after(strays, helped=found.state is not fitted.state))


def forgotten(result: FrameResult, past: Past) -> FrameResult:
    """Return a result that is not doubted: no search was in vain."""
    return _with(result, past, Vain()) if vain_before(past).searches else result


def _with(result: FrameResult, past: Past, vain: Vain) -> FrameResult:
    segmentation = result.state.segmentation
    appearance = {**past.appearance, **segmentation.appearance, VAIN: np.array(vain, np.float64)}
    known = replace(segmentation, appearance=appearance)
    return replace(result, state=replace(result.state, segmentation=known))
