"""The coupled loop of one frame: segment, match, solve, fit the cloth, until the surface stops moving."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import partial

import numpy as np

from mocapflow.components import ClothFitter, Matcher, Observe, PoseSolver, Prior, Segmenter
from mocapflow.data import NO_CLOTH, Frame, FrameResult, FrameState, Past, Turn
from mocapflow.errors import noting
from mocapflow.functional import Functional, overlaps
from mocapflow.guards.outputs import cloth_of, estimate_of, segmentation_of
from mocapflow.model import ClothedModel
from mocapflow.pooling import pool_matches
from mocapflow.records import record
from mocapflow.steady import Steady, measure_change
from mocapflow.timing import Stopwatch

LAPS = ("segment", "solve", "cloth", "energy")  # of a turn, timed


@record
class Steps:
    """The components of the loop."""

    segmenter: Segmenter
    matchers: Sequence[Matcher]
    pose_solver: PoseSolver
    cloth_fitter: ClothFitter | None  # None: no garment
    priors: Sequence[Prior]
    steady: Steady


def settle(
    frame: Frame, state: FrameState, past: Past, steps: Steps, model: ClothedModel, observe: Observe
) -> FrameResult:
    """Repeat segmentation, pose and cloth until the surface stops moving.

    Source: Rosenhahn 2008, Fig. 12.14
    """
    functional, watch = Functional(model, steps.priors, past), Stopwatch(LAPS)
    far = not past.moments
    steady = steps.steady.beginning if far else steps.steady
    at_rest, change = 0, None
    recent = deque([state], maxlen=3)
    energy, cost = np.full((steady.cap, len(functional.terms)), np.nan), np.nan
    for index in range(steady.cap):
        turn = Turn(index=index, change=change, far=far)
        with noting(f"frame {frame.index}, iteration {index + 1}"):
            state = take_turn(frame, state, steps, functional, turn, watch)
            energy[index] = functional.values(state)
        last_cost, cost = cost, functional.total(energy[index])
        change = measure_change(recent[-1], state, model.scene)
        recent.append(state)
        if index == 0 and steady.far(change):
            far, steady = True, steady.beginning
        watch.lap("energy")
        observe(frame.index, turn, state)
        at_rest = at_rest + 1 if steady.holds(change, index + 1) and steady.even(last_cost, cost) else 0
        if at_rest >= steady.turns or index + 1 >= steady.max_turns:
            break
    assert change is not None
    swing = measure_change(recent[0], state, model.scene)  # over the last two turns
    return FrameResult(
        state=state,
        iterations=index + 1,
        steady=at_rest >= steady.turns,
        oscillating=at_rest == 0 and index > 1 and steady.holds(swing, index + 1),
        change=change,
        overlap=overlaps(model.scene.surface_of(state), state.segmentation, model.scene.cameras),
        energy=energy,
        energy_terms=functional.terms,
        seconds=watch.seconds,
    )


def take_turn(
    frame: Frame, state: FrameState, steps: Steps, functional: Functional, turn: Turn, watch: Stopwatch
) -> FrameState:
    """Return the state after one turn: silhouettes, then the pose by the matches, then the cloth."""
    model, priors, past = functional.model, functional.priors, functional.past
    segmentation = segmentation_of(steps.segmenter, frame, state, past, model.scene, turn)
    watch.lap("segment")
    match = partial(pool_matches, steps.matchers, frame, segmentation, past, model.scene, turn)
    estimate = estimate_of(steps.pose_solver, match, state, model, priors, past, turn)
    watch.lap("solve")
    fitter = steps.cloth_fitter
    cloth = cloth_of(fitter, frame, segmentation, estimate, model, past, turn) if fitter else NO_CLOTH
    estimate, cloth = functional.step(state, segmentation, estimate, cloth, steps.steady.halvings)
    watch.lap("cloth")
    matches = match(model.surface(estimate.pose, cloth)) if estimate.matches is None else estimate.matches
    return FrameState(segmentation=segmentation, matches=matches, estimate=estimate, cloth=cloth)
