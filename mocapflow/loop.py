"""The coupled loop of one frame: segment, match, solve, fit the cloth, until the surface stops moving."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from mocapflow.components import ClothFitter, Matcher, Observe, PoseSolver, Predictor, Prior, Segmenter, pool
from mocapflow.data import Change, Frame, FrameResult, FrameState, Matches, Past, Segmentation, Surface, Turn
from mocapflow.geometry import silhouettes
from mocapflow.model import ClothedModel
from mocapflow.records import F64, record
from mocapflow.scene import Scene
from mocapflow.timing import Stopwatch


@record
class Steady:
    """When the loop counts as at rest, and how long it may go on."""

    surface: float  # m
    angle: float  # rad
    turns: int  # consecutive turns within both tolerances
    max_turns: int

    def holds(self, change: Change) -> bool:
        """True where a change is within both tolerances."""
        return change.surface <= self.surface and change.angles <= self.angle


@record
class Steps:
    """The components of the loop."""

    predictor: Predictor
    segmenter: Segmenter
    matchers: Sequence[Matcher]
    pose_solver: PoseSolver
    cloth_fitter: ClothFitter
    priors: Sequence[Prior]
    steady: Steady


def settle(
    frame: Frame, state: FrameState, past: Past, steps: Steps, model: ClothedModel, observe: Observe
) -> FrameResult:
    """Repeat segmentation, pose and cloth until the surface stops moving.

    Source: Rosenhahn 2008, Fig. 12.14
    """
    calm, earlier, turn, watch = 0, state, Turn(index=0, cap=steps.steady.max_turns), Stopwatch()
    for index in range(steps.steady.max_turns):
        turn = Turn(index=index, cap=turn.cap, change=turn.change)
        segmentation = steps.segmenter.segment(frame, state, past, model.scene, turn)
        watch.lap("segment")
        match = partial(pool_matches, steps.matchers, frame, segmentation, past, model.scene, turn)
        estimate = steps.pose_solver.solve(match, state, model, steps.priors, past, turn)
        watch.lap("solve")
        cloth = steps.cloth_fitter.fit(frame, segmentation, estimate, model, past, turn)
        watch.lap("cloth")
        matches = match(model.surface(estimate.pose, cloth))
        new = FrameState(segmentation=segmentation, matches=matches, estimate=estimate, cloth=cloth)
        change, swing = measure_change(state, new, model), measure_change(earlier, new, model)
        watch.lap("match")
        observe(frame.index, turn, new)
        earlier, state = state, new
        turn = Turn(index=index, cap=turn.cap, change=change)
        calm = calm + 1 if steps.steady.holds(change) else 0
        if calm >= steps.steady.turns:
            break
    assert turn.change is not None
    return FrameResult(
        state=state,
        iterations=turn.index + 1,
        steady=calm >= steps.steady.turns,
        oscillating=calm == 0 and turn.index > 1 and steps.steady.holds(swing),
        change=turn.change,
        overlap=overlaps(state, model),
        seconds=watch.seconds,
    )


def pool_matches(
    matchers: Sequence[Matcher],
    frame: Frame,
    segmentation: Segmentation,
    past: Past,
    scene: Scene,
    turn: Turn,
    surface: Surface,
) -> Matches:
    """Return the matches of all matchers together, each with its share."""
    return pool([(m.share, m.match(frame, segmentation, surface, past, scene, turn)) for m in matchers])


def measure_change(old: FrameState, new: FrameState, model: ClothedModel) -> Change:
    """Return how far the surface and the joint angles moved between two states."""
    before = model.surface(old.estimate.pose, old.cloth).vertices
    after = model.surface(new.estimate.pose, new.cloth).vertices
    moved = np.sqrt(np.sum((after - before) ** 2, axis=1))
    angles = np.abs(new.estimate.pose.angles - old.estimate.pose.angles)
    return Change(
        surface=float(moved.max()),
        body=float(moved[: len(model.scene.body.vertices)].max()),
        angles=float(angles.max(initial=0)),
    )


def overlaps(state: FrameState, model: ClothedModel) -> F64:
    """Return intersection over union of the model's silhouette and the person's in each view; NaN where unseen."""
    surface = model.surface(state.estimate.pose, state.cloth)
    overlap = np.full(len(model.scene.cameras), np.nan)
    for silhouette in state.segmentation.silhouettes:
        if silhouette.layer == "person":
            camera = model.scene.cameras[silhouette.camera]
            covered = silhouettes.mask(silhouettes.outline(surface, camera), camera)
            overlap[silhouette.camera] = silhouettes.intersection_over_union(covered, silhouette.distance > 0)
    return overlap
