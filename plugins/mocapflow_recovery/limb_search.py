"""Recovery `limb_search`: where person and model are apart, look for the pose part by part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from mocapflow_priors.density import read
from mocapflow_priors.parzen import SHIPPED
from pydantic import Field

from mocapflow.assets import Body
from mocapflow.components import Recovery
from mocapflow.data import NO_CLOTH, Cloth, Frame, FrameResult, FrameState, Past, Pose, PoseBatch, Surface
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow_recovery.certain import View, small_room, views
from mocapflow_recovery.coarse import coarse_body
from mocapflow_recovery.disagreement import distance, floating_area, uncovered_area
from mocapflow_recovery.sampling import Plan, Spread, put_back, search, seen_samples

Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]


class Stray(NamedTuple):
    """How much of person and model lie apart, cm²."""

    uncovered: float
    floating: float

    def doubtful(self, uncovered: float, floating: float) -> bool:
        """True where one of the two is larger than it may be."""
        return self.uncovered > uncovered or self.floating > floating

    def __str__(self) -> str:
        return f"{self.uncovered:.0f} cm² of the person uncovered, {self.floating:.0f} cm² of skin in empty space"


class LimbSearch(Recovery):
    """Compares the fitted model with what the images surely show, which does not depend on the model.

    A level set that starts from the model can't find a limb the model has lost, so the two agree in their error.
    Where large parts of person and model lie far apart, the best is taken of the fitted pose, the one that was believed
    before, that of the frame before, and poses that people were seen in. Around it poses are sampled part by part, and
    limbs as people were seen to hold them; the loop settles again from the best of these.
    It needs the empty scene; without one every fit is taken as it is.
    """

    name: ClassVar[str] = "limb_search"
    uncovered_cm2: Positive = 60.0  # of the person off the model, in all views: more, and the fit is doubted
    floating_cm2: Positive = 60.0  # likewise, of skin in empty space
    reach_m: Positive = 0.06  # what lies nearer to the other does not count
    cloth_m: Positive = 0.2  # what lies so near to the garment may be the garment, wherever it swings
    gain: Annotated[float, Field(ge=0, lt=1)] = 0.1  # by which share another fit must be nearer to be taken
    tolerance: Annotated[float, Field(ge=0)] = 0.03  # by which share a part may be farther that stays as it was fitted
    rows: Annotated[int, Field(ge=50)] = 160  # images are shrunk to about this height
    faces: Annotated[int, Field(ge=200)] = 2600  # of the body that is searched with
    near_m: Positive = 0.35  # changes further than this from the model are somebody else
    cap_m: Positive = 0.2  # beyond, it does not matter how far
    samples: Count = 40  # of each part in a round
    poses: Path = SHIPPED  # that people were seen in, made by `mocapflow prior fit`: limbs are tried as they are there
    seen_samples: Annotated[int, Field(ge=0)] = 100  # of each limb in the first round, from `poses`
    shares: Annotated[tuple[Positive, ...], Field(min_length=1)] = (1.0, 0.6, 0.4, 0.25, 0.12)  # of the spread
    spread_deg: Positive = 25.0  # standard deviation of the first samples; less where a joint at rest hardly bends
    root_spread_deg: Positive = 8.0  # likewise, of the root's turn
    root_spread_m: Positive = 0.06  # likewise, of its place

    def recover(
        self,
        frame: Frame,
        state: FrameState,
        result: FrameResult,
        past: Past,
        model: ClothedModel,
        settle: Callable[[Pose, F64], FrameResult],
    ) -> FrameResult:
        """Return the result, or a better one; see the class."""
        background = model.scene.background
        if background is None:
            return result
        room, surface = small_room(background, model.scene.cameras, self.rows), surface_of(model, result)
        seen = views(frame, surface, room, self.near_m)
        stray = self._stray(model, seen, surface)
        if not stray.doubtful(self.uncovered_cm2, self.floating_cm2):
            return result
        found = self._search(frame, state, result.state, seen, past, model)
        other = settle(found, result.state.cloth.parameters)
        again = surface_of(model, other)
        if distance(again, seen, self.cap_m) < (1 - self.gain) * distance(surface, seen, self.cap_m):
            return noted(other, f"fit doubted, {stray}: found again by search; then {self._stray(model, seen, again)}")
        return noted(result, f"fit doubted, {stray}: search found nothing better")

    def _search(
        self, frame: Frame, state: FrameState, settled: FrameState, seen: Sequence[View], past: Past,
        model: ClothedModel,
    ) -> Pose:  # fmt: skip
        """Return the pose that agrees best with the views, sampled around those at hand."""
        parameters, body = settled.cloth.parameters, model.scene.body
        few = coarse_body(body, self.faces) if len(body.faces) > self.faces else body
        coarse = replace(model.scene, body=few)

        def cost(poses: Sequence[Pose]) -> F64:
            clothes = drapes(model, poses, parameters, past)
            return np.array([
                distance(coarse.surface(pose, cloth), seen, self.cap_m)
                for pose, cloth in zip(poses, clothes, strict=True)
            ])  # fmt: skip

        plan, rng = self._plan(body), np.random.default_rng(frame.index)
        at_rest, every = np.zeros(len(body.twists)), np.arange(len(body.twists), dtype=np.int32)
        begins = [settled.estimate.pose, state.estimate.pose, *(moment.pose for moment in past.moments[-1:])]
        begins += seen_samples(Pose(root=state.estimate.pose.root, angles=at_rest), every, body, plan, rng)
        found = search(cost, begins[int(cost(begins).argmin())], body, plan, rng)
        return put_back(cost, found, [settled.estimate.pose, state.estimate.pose], body, self.tolerance)

    def _plan(self, body: Body) -> Plan:
        spread = Spread(np.radians(self.spread_deg), np.radians(self.root_spread_deg), self.root_spread_m)
        return Plan(spread, self.shares, self.samples, read(self.poses).on(body.screw_names), self.seen_samples)

    def _stray(self, model: ClothedModel, seen: Sequence[View], surface: Surface) -> Stray:
        return Stray(
            uncovered=1e4 * uncovered_area(surface, seen, self.reach_m, self.cloth_m),
            floating=1e4 * floating_area(model.scene.bare(surface), seen, self.reach_m),
        )


def surface_of(model: ClothedModel, result: FrameResult) -> Surface:
    """Return the surface that a result believes in."""
    return model.surface(result.state.estimate.pose, result.state.cloth)


def noted(result: FrameResult, note: str) -> FrameResult:
    """Return a result with one more note."""
    return replace(result, notes=(*result.notes, note))


def drapes(model: ClothedModel, poses: Sequence[Pose], parameters: F64, past: Past) -> list[Cloth]:
    """Return the garment laid on each of several poses; poses that lay it alike are draped once."""
    if model.draper is None or not model.clothed:
        return [NO_CLOTH] * len(poses)
    lays = model.draper.touchable(model.scene)[model.scene.body.screw_joint]
    root, angles = np.stack([pose.root for pose in poses]), np.stack([pose.angles for pose in poses])
    told_apart = np.concatenate([root.reshape(len(poses), -1), angles[:, lays]], axis=1)
    _, first, same = np.unique(told_apart, axis=0, return_index=True, return_inverse=True)
    batch = PoseBatch(root=root[first], angles=angles[first])
    vertices = model.draper.drape(batch, np.repeat(parameters[None], len(first), axis=0), past, model.scene)
    return [Cloth(vertices=vertices[row], parameters=parameters) for row in same.ravel()]
