"""Stage `coupled_loop`: the frames in order, each from what the one before has left."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from mocapflow.assets import Background
from mocapflow.caching.keys import FREE
from mocapflow.components import ClothFitter, Matcher, Observe, PoseSolver, Predictor, Prior, Recovery, Segmenter, Stage
from mocapflow.data import Frame, FrameResult, FrameState, Past, Pose, Start
from mocapflow.dressing.roles import Draper
from mocapflow.errors import ComponentFailed, PipelineError, noting
from mocapflow.functional import image_cost
from mocapflow.guards.matcher_inputs import check_matcher_inputs
from mocapflow.guards.outputs import pose_of, result_of
from mocapflow.loop import LAPS, Steps, settle
from mocapflow.model import ClothedModel
from mocapflow.prediction import initial_state, lost, notes_on, seen
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, silent
from mocapflow.results import ImageFlow, Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow.steady import Steady
from mocapflow.storage.checkpoint import Checkpoint, Rest
from mocapflow.timing import Stopwatch

LOG = logging.getLogger("mocapflow")
TIMED = ("decode", "predict", "drape", *LAPS, "recover")
MOVING = 2  # frames before that tell how the person moves
GO_ON = "the frame is saved; on_unsteady: go_on continues after it, steady: {max_turns: …} gives it more turns"


class CoupledLoop(Stage):
    """Tracks the person through the recording, saved frame by frame.

    Source: Rosenhahn 2008, Fig. 12.14
    """

    name: ClassVar[str] = "coupled_loop"
    predictor: Predictor  # where each frame begins
    segmenter: Segmenter  # of every turn
    first_segmenter: Segmenter | None = None  # settles the first two frames beforehand: one that needs no good pose
    matchers: Annotated[tuple[Matcher, ...], Field(min_length=1)]  # their pairs are pooled
    pose_solver: PoseSolver  # of every turn
    draper: Draper | None = None  # needed with a garment
    cloth_fitter: ClothFitter | None = None  # needed with a garment
    priors: tuple[Prior, ...] = ()  # added to the matches
    recovery: Recovery | None = None  # looks again where a fit is lost
    steady: Steady = Steady()
    body_faces: Annotated[int, Field(ge=2000)] = 12_000  # that are tracked: more take longer for the same angles
    keep: Annotated[Literal["final", "trace"], FREE] = "final"  # trace: also the pose of every turn before recovery
    on_unsteady: Annotated[Literal["go_on", "stop"], FREE] = "go_on"  # after a frame that did not come to rest

    @model_validator(mode="after")
    def _cloth_is_draped_and_fitted(self) -> CoupledLoop:
        if (self.draper is None) != (self.cloth_fitter is None):
            raise ValueError("name both draper and cloth_fitter, or none: one lays the cloth, the other fits it")
        return self

    def need(self, recording: Recording) -> None:
        """Raise if no matcher would find a pair in the recording."""
        check_matcher_inputs(self.matchers, recording)

    def run(
        self,
        recording: Recording,
        start: Start,
        scene: Scene,
        checkpoint: Checkpoint,
        background: Background | None = None,
        flow: ImageFlow | None = None,
        checks: ViewChecks | None = None,
    ) -> Track:
        """Return the track; frames that are already saved are not computed again.

        Raises:
            PipelineError: there is a garment, and nothing that drapes it.
        """
        if scene.garment is not None and self.draper is None:
            hint = "name a draper and a cloth_fitter, or track the bare body: garment: null"
            raise PipelineError(f"the person wears a {scene.garment.name}, which the track does not drape", hint=hint)
        for said in check_matcher_inputs(self.matchers, recording):
            LOG.warning(said)
        able, model = self if background else self.without_scene(), self.model_of(scene, background)
        if self.keeps_turns:
            checkpoint.keep_turns(self.steady.cap)
        if self.looks_back:
            self._refuse(rest for rest in checkpoint.rests() if rest.frame in recording.indices)
        past, watch = checkpoint.past(), Stopwatch(TIMED)
        for raw in recording.frames(since=checkpoint.next_index):
            with noting(f"frame {raw.index}"):
                frame = prepared(raw, checks, flow)
                watch.lap("decode")
                result = able.fit(frame, past, start, model, checkpoint.observe, watch)
            past = checkpoint.commit(frame, past, result)
            self.complain(frame, result)
            watch = Stopwatch(TIMED)
        return checkpoint.track()

    def model_of(self, scene: Scene, background: Background | None) -> ClothedModel:
        """Return the person of a scene as they are tracked: with fewer faces, their clothes draped."""
        return ClothedModel(scene=scene.with_background(background).simplified(self.body_faces), draper=self.draper)

    def without_scene(self) -> CoupledLoop:
        """Return the loop without the parts that need the empty scene, which no stage has made; warn of each."""
        parts = {"first_segmenter": self.first_segmenter, "recovery": self.recovery}
        idle = {role: part for role, part in parts.items() if part and part.needs_background}
        for role, part in idle.items():
            LOG.warning(f"{role} {part.name} needs the empty scene, which no stage before makes: it is not asked")
        return self.model_copy(update=dict.fromkeys(idle))

    @property
    def looks_back(self) -> bool:
        """True where a stored track is checked, too: an earlier run may have gone on after an unsteady frame."""
        return self.on_unsteady == "stop"

    @property
    def keeps_turns(self) -> bool:
        """True where a trace is wanted."""
        return self.keep == "trace"

    def look_back(self, made: Track) -> None:
        """Stop at a track of the store with a frame that did not settle, if that is wanted.

        Raises:
            ComponentFailed: it has one.
        """
        self._refuse(map(Rest, made.frame.tolist(), made.iterations.tolist(), made.steady.tolist()))

    @property
    def steps(self) -> Steps:
        """The components as the loop takes them."""
        return Steps(
            segmenter=self.segmenter,
            matchers=self.matchers,
            pose_solver=self.pose_solver,
            cloth_fitter=self.cloth_fitter,
            priors=self.priors,
            steady=self.steady,
        )

    def fit(
        self, frame: Frame, past: Past, start: Start, model: ClothedModel, observe: Observe, watch: Stopwatch
    ) -> FrameResult:
        """Return the result of one frame: predicted, settled by the loop, and recovered if the loop was lost."""
        known, begun = past.trusted(), self.begin(frame, past, start, model, watch)
        if seen(frame):
            near = begun if len(known.moments) >= MOVING else self.approach(frame, begun, known, model)
            watch.lap("predict")
            result = settle(frame, near, known, self.steps, model, observe)
            watch.take(result.seconds)
            result = self.recovered(frame, begun, result, known, model)
            watch.lap("recover")
        else:
            result = lost(frame, begun, self.steps, model)
        notes = (*notes_on(frame, model.scene, known, result), *result.notes)
        return replace(result, notes=notes, seconds=watch.seconds)

    def begin(self, frame: Frame, past: Past, start: Start, model: ClothedModel, watch: Stopwatch) -> FrameState:
        """Return the predicted state of a frame: the pose before looking, clothed."""
        pose, parameters = start.pose, start.parameters
        if past.moments:
            pose = pose_of(self.predictor, frame, past, model.scene)
            parameters = past.moments[-1].cloth.parameters
        elif start.others and seen(frame):
            pose = self.best_start(frame, start, model)
        watch.lap("predict")
        cloth = model.drape(pose, parameters, past)
        watch.lap("drape")
        return initial_state(pose, parameters, cloth)

    def best_start(self, frame: Frame, start: Start, model: ClothedModel) -> Pose:
        """Return of the poses that a start leaves open the one from which the first frame is fitted best.

        From that one it is fitted once more: onlookers, and a trace, see the turns of one fit.
        """

        def badness(pose: Pose) -> tuple[bool, float]:
            alone = replace(start, pose=pose, others=())
            result = self.fit(frame, Past(), alone, model, silent, Stopwatch(TIMED))
            return result.doubted, image_cost(result.energy, result.energy_terms)

        return min((start.pose, *start.others), key=badness)

    def approach(self, frame: Frame, state: FrameState, past: Past, model: ClothedModel) -> FrameState:
        """Return a first or second frame's state moved near the person by the first segmenter, if there is one.

        At the second frame it is not known yet how the person moves: they may run. A segmenter that knows only the
        empty room is misled by a limb that looks like what is behind it, so the state moves only if the images then
        fit better.
        """
        if self.first_segmenter is None:
            return state
        steps = replace(self.steps, segmenter=self.first_segmenter)
        near = settle(frame, state, past, steps, model, silent).state
        begins = (state, initial_state(near.estimate.pose, near.cloth.parameters, near.cloth))
        once = replace(self.steps, steady=Steady(max_turns=1))

        def costs(begin: FrameState) -> float:
            result = settle(frame, begin, past, once, model, silent)
            return image_cost(result.energy, result.energy_terms)

        return min(begins, key=costs)

    def recovered(
        self, frame: Frame, state: FrameState, result: FrameResult, past: Past, model: ClothedModel
    ) -> FrameResult:
        """Return the result of the loop, or a better one if the loop was lost."""
        finder = self.recovery
        if finder is None:
            return result
        found = finder.recover(frame, state, result, past, model, partial(self.settled, frame, past, model))
        return result_of(finder, found, result, model.scene)

    def settled(self, frame: Frame, past: Past, model: ClothedModel, pose: Pose, parameters: F64) -> FrameResult:
        """Return the result of the loop from a pose and cloth parameters; nobody looks on."""
        with noting(f"frame {frame.index}"):
            begun = initial_state(pose, parameters, model.drape(pose, parameters, past))
            return settle(frame, begun, past, self.steps, model, silent)

    def complain(self, frame: Frame, result: FrameResult) -> None:
        """Stop at a frame that did not settle, if that is wanted."""
        if self.on_unsteady == "stop" and not result.steady and result.iterations:
            kind = "swings between two states" if result.oscillating else "did not come to rest"
            moved = f"{1000 * result.change.body:.2f} mm and {np.degrees(result.change.angles):.2f}° in the last turn"
            raise ComponentFailed(f"frame {frame.index} {kind} in {result.iterations} turns: {moved}", hint=GO_ON)

    @staticmethod
    def _refuse(rests: Iterable[Rest]) -> None:
        """Raise for the first saved frame that did not come to rest; see `complain`."""
        for rest in rests:
            if rest.turns and not rest.steady:
                raise ComponentFailed(f"frame {rest.frame} did not come to rest in {rest.turns} turns", hint=GO_ON)


def prepared(frame: Frame, checks: ViewChecks | None, flow: ImageFlow | None) -> Frame:
    """Return a frame as it is tracked: without wrong views, with the flow into it."""
    passed = checks.passed(frame) if checks else frame
    return replace(passed, flow=flow.into(frame.index)) if flow else passed
