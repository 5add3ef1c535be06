"""Recovery `limb_search`: where person and model are apart, look for the pose part by part."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Annotated, ClassVar

import numpy as np
from mocapflow_levelset.layers import garment_log_ratio
from mocapflow_levelset.shadow_consistency import no_shadows
from mocapflow_matching.camouflage import with_feet
from mocapflow_priors.density import Density, Poses, read
from mocapflow_priors.parzen import SHIPPED
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from mocapflow.assets import Body
from mocapflow.data import Frame, FrameResult, FrameState, Past, Pose, Surface
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_recovery.disagreement import FLYING, HANGING
from mocapflow_recovery.limb_visibility import camouflaged_feet, warn_of_camouflage, warn_of_occluders
from mocapflow_recovery.sampling import SHARES, Plan, Spread
from mocapflow_recovery.scoring import FACES, Fit, Mismatch, Scorer, StartPose, mismatch_of
from mocapflow_recovery.search_history import history_of, one_frame_of, with_search, without_history
from mocapflow_recovery.search_triggers import Trigger, TriggeredSearch, stay_overbent
from mocapflow_recovery.searches import Searches
from mocapflow_recovery.trimaps import Trimap, small_rooms, trimaps

LOG = logging.getLogger("mocapflow")
UNDOUBTED = 2.0  # times as distant may be a fit that is doubted no more: a leg lay where a skirt flew
WITHOUT_HINT = 1.1  # the same, without a hint: of a lost foot all other limbs and the cloth tell nothing
NEAR_M = 0.35  # changes farther than this from the model are somebody else
START = np.radians(6.0)  # how far off, in each angle, a given first pose may be
FIRST_REPEATS = 2  # times that each search is repeated in a first frame whose fit is doubted
KNOWN = 0.4  # share of the room behind the model, mean of views: where less is known, that is told
UNKNOWN = "little is known of the room behind the person: a limb that is lost there may go unnoticed"
FEET_CAMOUFLAGED = "the feet look like the floor: outlines are not compared with them, and ankles are unsure"
UNSEARCHED = "fit doubted as in frames before: not searched again yet"
UNSEEN = "fit doubted: no picture tells person from room where it lies"
Settle = Callable[[Pose, F64], FrameResult]  # from a pose, with cloth parameters
Search = Callable[[np.random.Generator], Pose]  # finds a pose by samples


class LimbSearch(TriggeredSearch):
    """Compares the fitted model with what the images surely show, which does not depend on the model.

    A level set that starts from the model can't find a limb the model has lost, so the two agree in their error.

    Where large parts of person and model lie far apart, the search begins at the best of the fitted pose, the one that
    was predicted, that of the frame before, and poses that people were seen in. Around it poses are sampled part
    by part, limbs also as people were seen to hold them. A second search begins at the pose of the frame before, in
    which trunk and legs have not yet gone astray together. A part moves only if that lessens the mismatch: a leg
    must not take a new place under the skirt because an arm was lost. The loop settles again from what is found.

    It also looks where images need not contradict a limb that is elsewhere: in the first frame and after frames that
    did not show the person, where a leg may rest on the contour of the other one and a foot lie turned in its own;
    where a joint is bent beyond its limits; where a little of the person is off the model, if `hint_cm2` says so; and
    where a limb has leapt into a pose that nobody was seen in. There a part moves only if that brings person and model
    together. A joint bent too far, and a limb that leapt, are looked for alone: nothing is known against the others.

    The first frame starts from a pose that was given and is about right. So it is searched near that one
    first, and of two poses that fit alike the nearer one is taken: crossed legs look the same when exchanged. If its
    fit is doubted, the pose is also tried turned round: a standing person looks much the same from behind.

    Cloth off the model, as its colours tell, calls for a search, but moves no part and raises no doubt: it may fly. So
    the search is made twice: as if cloth lay where the body holds it, which tells of legs that nobody sees, and as if
    it flew, which leads no leg astray. The fit that agrees better is taken, by skin above all.

    A doubt that lasts is mostly one about the room, and a joint that stays beyond its limits can be bent so far: such
    frames are searched only now and then (`vain_every`), and ever more rarely while a doubt stays the same.

    If the first frame shows feet that look like a floor without colours, such as white socks on white, later frames do
    not match them: the outline ends above them, and would draw them up.

    It needs the empty scene. Where nobody knows what is behind the person, nothing speaks for or against a limb.
    """

    name: ClassVar[str] = "limb_search"
    needs_background: ClassVar[bool] = True
    gain: Annotated[float, Field(ge=0, lt=1)] = 0.1  # share that each part mends, and a fit that cures no doubt
    samples: PositiveInt = 40  # samples of each part in a round
    poses: Poses = SHIPPED  # poses that people were seen in, made by `mocapflow prior fit`: limbs are tried as there
    seen_samples: NonNegativeInt = 100  # samples of each limb from `poses`, in the first round
    vain_every: PositiveInt = 4  # after three searches in vain, or overbent frames, one of so many is searched at first
    spread_deg: PositiveFloat = 25.0  # standard deviation of the first samples; less where a joint hardly bends
    root_spread_deg: PositiveFloat = 8.0  # standard deviation of the first samples of the root's orientation
    root_spread_m: PositiveFloat = 0.06  # standard deviation of the first samples of the root's place

    def recover(
        self, frame: Frame, state: FrameState, result: FrameResult, past: Past, model: ClothedModel, settle: Settle
    ) -> FrameResult:
        """Return the result, or a better one; see the class."""
        found = self._recovered(frame, state, result, past, model, settle)
        if past.moments or past.after_gap:
            return found
        noted_feet = self.with_camouflaged_feet(frame, found, past, model)
        if noted_feet is not found:
            LOG.warning(FEET_CAMOUFLAGED)
        return noted_feet

    def with_camouflaged_feet(self, frame: Frame, result: FrameResult, past: Past, model: ClothedModel) -> FrameResult:
        """Return the result of a frame; if feet look like a floor without colours in it, it says so to later ones."""
        background, surface = model.scene.background, model.scene.surface_of(result.state)
        if background is None or background.floor_m is None:
            return result
        trimaps = self.trimaps(frame, surface, past, model.scene)
        if not trimaps or not (feet := camouflaged_feet(surface, trimaps, model.scene.body)).any():
            return result
        segmentation = result.state.segmentation
        known = replace(segmentation, appearance=with_feet(segmentation.appearance, feet))
        return replace(result, state=replace(result.state, segmentation=known))

    def _recovered(
        self, frame: Frame, state: FrameState, result: FrameResult, past: Past, model: ClothedModel, settle: Settle
    ) -> FrameResult:
        scene, surface = model.scene, model.scene.surface_of(result.state)
        trimaps = self.trimaps(frame, surface, past, scene)
        if not trimaps:
            return noted(result, UNSEEN, doubted=True)
        if not past.moments:
            if np.mean([trimap.known for trimap in trimaps]) < KNOWN:
                LOG.warning(UNKNOWN)
            given = scene.surface_of(state)
            warn_of_camouflage(surface, trimaps, scene.body)
            warn_of_occluders(given, self.trimaps(frame, given, past, scene), scene.body)
        mismatch = mismatch_of(surface, scene, trimaps)
        fitted, predicted, body = result.state.estimate.pose, state.estimate.pose, scene.body
        trigger = self.trigger(mismatch, fitted, predicted, past, body, self._density)
        if trigger is None:
            return without_history(result, past)
        if not self._due(trigger, mismatch, frame.time, past, body):
            return noted(result, UNSEARCHED, doubted=True) if trigger.doubtful else without_history(result, past)
        scorer = self._scorer(predicted, result, trimaps, past, model)
        searches = Searches(scorer, self._plan(body), predicted, fitted, self.gain)
        found = self._searched(frame.index, scorer.score(result), searches, trigger, settle)
        return with_search(found, result, mismatch.area, past)

    def _due(self, trigger: Trigger, mismatch: Mismatch, time: float, past: Past, body: Body) -> bool:
        """Return whether a fit is searched in this frame: what lasts is searched only now and then."""
        if trigger.doubtful:
            return history_of(past).due(mismatch.area, time, past, self.vain_every)
        return not stay_overbent(past, body) or one_frame_of(self.vain_every, time, past)

    def trimaps(self, frame: Frame, surface: Surface, past: Past, scene: Scene) -> list[Trimap]:
        """Return the trimaps of a frame around a surface, in a scene whose empty room is known."""
        assert scene.background is not None
        rooms = small_rooms(scene.background, scene.cameras)
        no_shadow = no_shadows(frame, scene.background, scene.cameras)
        return trimaps(frame, surface, rooms, NEAR_M, garment_log_ratio(past, scene), no_shadow)

    def _searched(self, index: int, fit: Fit, searches: Searches, trigger: Trigger, settle: Settle) -> FrameResult:
        """Return the result of the best pose that is found, or that of the fit where none is better."""
        scorer, strategies = searches.scorer, self._strategies(searches, trigger)

        def settled(number: int, search: Search) -> Fit:
            return scorer.score(settle(search(np.random.default_rng([index, number])), scorer.parameters))

        fits = [settled(number, search) for number, search in enumerate(strategies)]
        best = self._better(min(fits, key=lambda other: (self.doubtful(other.mismatch), other.distance)), fit)
        if scorer.start and trigger.doubtful:
            turned = self._better(settled(len(strategies), searches.turned_round), best)
            if turned is not best:
                LOG.warning("the first pose looks the other way: the person was found turned round by half a turn")
            best = turned
        if best is not fit:
            note = f"{trigger.reason}: found again by search; then {best.mismatch}"
            return noted(best.result, note, self.doubtful(best.mismatch))
        if trigger.doubtful:
            return noted(fit.result, f"{trigger.reason}: search found nothing better", doubted=True)
        return fit.result

    def _strategies(self, searches: Searches, trigger: Trigger) -> list[Search]:
        """Return the ways to search for the pose, each from its own samples."""
        if trigger.limbs:
            return [partial(searches.limbs_alone, limbs=trigger.limbs)]
        wide = partial(searches.wide, by_area=trigger.doubtful)
        if searches.scorer.start:  # where all begins, chance shall not decide
            local = partial(searches.local, spread=2 * START)
            return [local, partial(wide, cloth_weight=HANGING)] * FIRST_REPEATS if trigger.doubtful else [local]
        weights = (HANGING, FLYING) if searches.scorer.model.clothed else (HANGING,)
        return [partial(wide, cloth_weight=weight) for weight in weights]

    def _better(self, other: Fit, fit: Fit) -> Fit:
        """Return another fit if it is clearly nearer to the person, or free of a doubt or hint and not much farther."""
        most = 1 - self.gain
        if not self.doubtful(other.mismatch):
            if self.doubtful(fit.mismatch):
                most = UNDOUBTED
            elif fit.mismatch.hint > self.hint_cm2 >= other.mismatch.hint:
                most = WITHOUT_HINT
        return other if other.distance < most * fit.distance else fit

    def _scorer(
        self, predicted: Pose, result: FrameResult, trimaps: Sequence[Trimap], past: Past, model: ClothedModel
    ) -> Scorer:
        start = None if past.moments or past.after_gap else StartPose(predicted, START)
        coarse = model.scene.simplified(FACES)
        cloth_weight = HANGING if start else FLYING  # where all begins, the garment's colours are not known
        return Scorer(model, coarse, trimaps, result.state.cloth.parameters, past, start, cloth_weight)

    def _plan(self, body: Body) -> Plan:
        spread = Spread(np.radians(self.spread_deg), np.radians(self.root_spread_deg), self.root_spread_m)
        return Plan(spread, SHARES, self.samples, self._density.on(body.screw_names), self.seen_samples)

    @cached_property
    def _density(self) -> Density:
        return read(self.poses)


def noted(result: FrameResult, note: str, doubted: bool) -> FrameResult:
    """Return a result with one more note, and whether it is still doubted."""
    return replace(result, notes=(*result.notes, note), doubted=doubted)
