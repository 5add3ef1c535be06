"""What is known of a frame without a look at it: its predicted state, and why nobody could look."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.data import (
    UNKNOWN,
    Change,
    Cloth,
    Estimate,
    Frame,
    FrameResult,
    FrameState,
    Past,
    Pose,
    Segmentation,
    blind,
    empty_matches,
)
from mocapflow.functional import Functional
from mocapflow.loop import Steps
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow.scene import Scene

VIEWS = 2  # fewer than these do not fix a pose in space


def seen(frame: Frame) -> bool:
    """True where enough views are usable to fix a pose."""
    return int(frame.usable.sum()) >= enough(frame)


def enough(frame: Frame) -> int:
    """Return how many views fix a pose as well as the cameras allow."""
    return min(VIEWS, len(frame.usable))


def initial_state(pose: Pose, parameters: F64, cloth: Cloth) -> FrameState:
    """Return the state of a frame nobody has looked at."""
    covariance = UNKNOWN * np.eye(6 + len(pose.angles) + len(parameters))
    return FrameState(
        estimate=Estimate(pose=pose, parameters=parameters, covariance=covariance, observed=np.zeros(len(pose.angles))),
        cloth=cloth,
        segmentation=Segmentation(silhouettes=()),
        matches=empty_matches(),
    )


def lost(frame: Frame, begun: FrameState, steps: Steps, model: ClothedModel) -> FrameResult:
    """Return the prediction as the result of a frame that too few cameras have seen."""
    terms = Functional(model, steps.priors, Past()).terms
    return FrameResult(
        state=begun,
        iterations=0,
        steady=False,
        oscillating=False,
        change=Change(body=0.0, cloth=0.0, angles=0.0, sigmas=0.0),
        overlap=np.full(len(frame.usable), np.nan),
        energy=np.full((steps.steady.cap, len(terms)), np.nan),
        energy_terms=terms,
    )


def notes_on(frame: Frame, scene: Scene, known: Past, result: FrameResult) -> Sequence[str]:
    """Return what went wrong with the views of a frame and with those before it; see `Past.trusted`."""
    reasons = frame.reasons or ("",) * len(frame.usable)
    views = zip(scene.cameras, frame.usable, reasons, strict=True)
    notes = [f"{camera.name} not usable: {reason or 'no image'}" for camera, usable, reason in views if not usable]
    if not seen(frame):
        return [*notes, f"lost, fewer than {enough(frame)} views; the prediction is kept"]
    if blind(result.state.estimate.observed):
        return [*notes, "no view shows the person; the prediction is kept"]
    anew = "begun anew, like a first frame: the frames before do not show the person"
    return [*notes, anew] if known.after_gap else notes
