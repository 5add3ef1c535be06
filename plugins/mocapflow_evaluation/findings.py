"""What a reader of an evaluation should know of the two systems, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mocapflow_export.tables import angle_names

from mocapflow.records import F64
from mocapflow_evaluation.alignment import HALF, Alignment
from mocapflow_evaluation.cycles import Cycle
from mocapflow_evaluation.references import Reference
from mocapflow_evaluation.tracked_motion import TrackedMotion

MOST = 10  # names in a note
BENT = 20.0  # deg that some angle of a person who moves exceeds
LARGER = 20.0  # times, that our angles are larger than a reference in radians at least: 57 where both agree
ALIKE = 0.01  # by which two frame rates may differ that are the same


def nothing_shared(own: TrackedMotion, reference: Reference) -> str:
    """Return what to say of a reference without our angles, or without values of them in our frames."""
    if len(reference.at) and not own.columns.keys().isdisjoint(reference.curves):
        kind, unit = ("frame", "") if reference.by_frame else ("time", " s")
        clock = own.columns[kind]
        at = reference.moments(clock)
        theirs, ours = (f"{kind} {each[0]:g} to {each[-1]:g}{unit}" for each in (at, clock))
        return f"the reference has no angle where the track has one: it has {theirs}, the track {ours}"
    had = ", ".join(angle_names(own.columns))
    return f"the reference shares no angle with the track, which has {had}"


def said(
    own: TrackedMotion, reference: Reference, found: Alignment, strides: Sequence[Cycle], longest_lag_s: float
) -> list[str]:
    """Return how the reference came to our frames, its lag, the curves it counts the other way, and the strides."""
    notes = apart_in_time(own, reference)
    if unknown := [name for name in reference.curves if name not in own.columns]:
        more = f" and {len(unknown) - MOST} more" if len(unknown) > MOST else ""
        notes.append(f"not compared, for the track has no such angles: {', '.join(unknown[:MOST])}{more}")
    if not reference.by_frame and len(reference.at) > 1:
        notes.append(f"reference at {1 / reference.step:.4g} per second, interpolated at our {own.frame_rate:.4g}")
    ours, theirs = (_largest([known[name] for name in found.signs]) for known in (own.columns, reference.curves))
    if theirs <= np.pi and ours > min(BENT, LARGER * theirs):
        notes.append(f"no angle of the reference is above {theirs:.1f}, ours reach {ours:.0f}: is it in radians?")
    if np.isnan(found.lag):
        notes.append(f"no lag within {longest_lag_s:g} s fits best; see longest_lag_s of stage evaluate")
    elif found.worth:
        when = "later" if found.lag > 0 else "earlier"
        late = f"{abs(found.lag):.1f} frames ({1000 * abs(found.lag) / own.frame_rate:.0f} ms) {when}"
        notes.append(f"we come {late} than the reference; only 'aligned' takes it out")
    turned = [name for name, sign in found.signs.items() if sign < 0]
    if turned:
        notes.append(f"the reference counts the other way: {', '.join(turned)}; only 'aligned' turns it round")
    if strides:
        count = {side: sum(c.side == side for c in strides) for side in ("l", "r")}
        notes.append(f"strides, by heel strikes in our own joint centres: {count['l']} left, {count['r']} right")
    return notes


def _largest(curves: Sequence[F64]) -> float:
    return max((float(np.nanmax(np.abs(curve), initial=0.0)) for curve in curves), default=0.0)


def apart_in_time(own: TrackedMotion, reference: Reference) -> list[str]:
    """Return what to doubt where a reference has other times at our frames than we do."""
    frame, time = own.columns["frame"], own.columns["time"]
    _, ours, theirs = np.intersect1d(frame, reference.at, return_indices=True)
    if not reference.by_frame or reference.time is None or not len(ours) or len(frame) < 2:
        return []
    late, rate = float(np.median(reference.time[theirs] - time[ours])), float(np.median(np.diff(frame) / np.diff(time)))
    lasts = float(np.median(np.diff(reference.time) / np.diff(reference.at))) if len(reference.at) > 1 else 0.0
    if lasts > 0 and abs(lasts * rate - 1) > ALIKE:
        said = f"the reference has {1 / lasts:.4g} frames per second, ours {rate:.4g}"
        return [f"frames are matched by number, but {said}: without its column frame it is matched by time"]
    if abs(late) * rate > HALF:
        return [f"frames are matched by number, but the reference's time is off by {late:.4f} s: does it count from 1?"]
    return []
