"""Searches that did not help: a doubt that stays is mostly one about the room, and is searched ever more rarely."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mocapflow.data import FrameResult, Past
from mocapflow.periodic import falls_due

HISTORY = "searches in vain"  # of Segmentation.appearance: (2,) a `SearchHistory`
PATIENCE = 3  # such searches in a row, after which the next one waits
LONGEST_S = 1.0  # that it waits, at most
CHANGED = 1.5  # times as large, or as small, may be the mismatch of a doubt that is still the same
MORE = 300.0  # cm² by which it may be larger: a limb that is lost before a room that has changed has more


class SearchHistory(NamedTuple):
    """Searches after which the fit was still doubted."""

    searches: int = 0  # in a row; from `PATIENCE` on those that found nothing better of a doubt that stays the same
    mismatch: float = 0.0  # cm² before the last one

    def due(self, mismatch: float, time: float, past: Past, every: int) -> bool:
        """Return whether a fit of such a mismatch (cm²) is searched now.

        After a few searches one frame of `every` is; the wait doubles with each search that finds nothing better of a
        doubt that stays the same, unless `every` is 1.
        """
        if self.searches < PATIENCE or not past.moments:
            return True
        wait = every
        if self.unchanged(mismatch) and every > 1:
            longest = round(LONGEST_S / (time - past.moments[-1].time))
            wait = max(every, min(every << (self.searches - PATIENCE), longest))
        return one_frame_of(wait, time, past)

    def after(self, mismatch: float, helped: bool) -> SearchHistory:
        """Return what is known after one more search, of a fit of such a mismatch (cm²)."""
        searches = self.searches + 1
        return SearchHistory(min(searches, PATIENCE) if helped or not self.unchanged(mismatch) else searches, mismatch)

    def unchanged(self, mismatch: float) -> bool:
        """Return whether a doubt stays the same: the mismatch (cm²) is about as large as before."""
        return self.mismatch / CHANGED < mismatch < min(CHANGED * self.mismatch, self.mismatch + MORE)


def one_frame_of(every: int, time: float, past: Past) -> bool:
    """Return whether this is the one frame of so many; by time, as frames may be left out."""
    last = past.moments[-1].time
    return falls_due(last, time, every * (time - last))


def history_of(past: Past) -> SearchHistory:
    """Return the searches of earlier frames that did not help."""
    searches, mismatch = past.appearance.get(HISTORY, np.zeros(2))
    return SearchHistory(int(searches), float(mismatch))


def with_search(found: FrameResult, fitted: FrameResult, mismatch: float, past: Past) -> FrameResult:
    """Return what a search found, as later frames know it.

    Args:
        found: its result.
        fitted: that of the loop; the same state: nothing better was found.
        mismatch: cm², of it.
        past: of the frame.
    """
    if not found.doubted:
        return without_history(found, past)
    return _with(found, past, history_of(past).after(mismatch, helped=found.state is not fitted.state))


def without_history(result: FrameResult, past: Past) -> FrameResult:
    """Return a result that is not doubted: later frames know of no searches."""
    return _with(result, past, SearchHistory()) if history_of(past).searches else result


def _with(result: FrameResult, past: Past, history: SearchHistory) -> FrameResult:
    segmentation = result.state.segmentation
    appearance = {**past.appearance, **segmentation.appearance, HISTORY: np.array(history, np.float64)}
    known = replace(segmentation, appearance=appearance)
    return replace(result, state=replace(result.state, segmentation=known))
