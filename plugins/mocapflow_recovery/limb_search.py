"""Recovery `limb_search`: where person and model are apart, look for the pose part by part."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from math import inf
from typing import Annotated, ClassVar

import numpy as np
from mocapflow_levelset.layers import garment_told
from mocapflow_levelset.one_floor import no_shadows
from mocapflow_matching.camouflage import with_feet
from mocapflow_priors.density import Density, Poses, read
from mocapflow_priors.parzen import SHIPPED
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from mocapflow.assets import Body
from mocapflow.components import Recovery
from mocapflow.data import Frame, FrameResult, FrameState, Past, Pose, Surface
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.settings import PositiveOrInf
from mocapflow_recovery.certain import View, small_room, views
from mocapflow_recovery.disagreement import FLIES, HANGS
from mocapflow_recovery.judge import FACES, Fit, Given, Judge, Stray, stray_of, surface_of
from mocapflow_recovery.looks import Looks
from mocapflow_recovery.sampling import SHARES, Plan, Spread
from mocapflow_recovery.suspicion import Signs, Suspicion, suspicion
from mocapflow_recovery.told import like_the_floor, warn_of_furniture, warn_of_untold
from mocapflow_recovery.vain import counted, forgotten, in_turn, vain_before

LOG = logging.getLogger("mocapflow")
CURED = 2.0  # times as far apart may be what is doubted no more: a leg lay where a skirt flew
CLEARED = 1.1  # the same, what leaves no hint: of a foot that was lost all other limbs and the cloth tell nothing
NEAR_M = 0.35  # changes farther than this from the model are somebody else
START = np.radians(6.0)  # how far off, in each angle, a given first pose may be
TOLERANCE = 0.03  # share by which the error may grow for parts to stay as they were fitted
FIRST_LOOKS = 2  # times that each search is repeated in a first frame whose fit is doubted
UNKNOWN = "too little is known of the room behind the person: limbs that are lost are not looked for"
FEET_UNTOLD = "the feet look like the floor: outlines are not compared with them, and ankles are unsure"
UNSEARCHED = "fit doubted as in frames before: not searched again yet"
UNSEEN = "fit doubted: no picture tells person from room where it lies"
Settle = Callable[[Pose, F64], FrameResult]  # from a pose, with cloth parameters
Look = Callable[[np.random.Generator], Pose]  # finds a pose by samples


class LimbSearch(Recovery):
    """Compares the fitted model with what the images surely show, which does not depend on the model.

    A level set that starts from the model can't find a limb the model has lost, so the two agree in their error.

    Where large parts of person and model lie far apart, the search begins at the best of the fitted pose, the one that
    was believed before, that of the frame before, and poses that people were seen in. Around it poses are sampled part
    by part, limbs also as people were seen to hold them. A second search begins at the pose of the frame before, in
    which trunk and legs have not yet gone astray together. A part moves only if that brings what strays together: a leg
    must not take a new place under the skirt because an arm was lost. The loop settles again from what is found.

    It also looks where images need not contradict a limb that is elsewhere: in the first frame and after frames that
    did not show the person, where a leg may rest on the contour of the other one and a foot lie turned in its own;
    where a joint is bent beyond its limits; where a little of the person is off the model, if `hint_cm2` says so; and
    where a limb has leapt into a pose that nobody was seen in. There a part moves only if that brings person and model
    together. A joint bent too far, and a limb that leapt, are looked for alone: nothing is known against the others.

    The first frame starts from a pose that was given and is about right. So it is searched near that one
    first, and of two poses that fit alike the nearer one is taken: crossed legs look the same when exchanged. If its
    fit is doubted, the pose is also tried turned round: a standing person looks much the same from behind.

    Cloth that strays, as its colours tell, calls for a search, but moves no part and raises no doubt: it may fly. So
    the search is made twice: as if cloth lay where the body holds it, which tells of legs that nobody sees, and as if
    it flew, which leads no leg astray. The fit that agrees better is taken, by skin above all.

    A doubt that lasts is mostly one about the room, and a joint that stays beyond its limits can be bent so far: such
    frames are searched only now and then (`vain_every`), and ever more rarely while a doubt stays the same.

    If the first frame shows feet that look like a floor without colours, such as white socks on white, later frames do
    not match them: the outline ends above them, and would draw them up.

    It needs the empty scene; where little of it is known behind the person, every fit is taken as it is.
    """

    name: ClassVar[str] = "limb_search"
    needs_background: ClassVar[bool] = True
    uncovered_cm2: PositiveFloat = 30.0  # area of the person off the model, all views, above which the fit is doubted
    floating_cm2: PositiveFloat = 30.0  # area of skin in empty space above which the fit is doubted
    hint_cm2: PositiveOrInf = inf  # area of the person 3 cm off it above which limbs are looked for; noise has some
    beginnings: bool = True  # look for limbs in the first frame, and in the first one after a gap
    leap_deg: PositiveOrInf = 20.0  # a limb so far from what was believed and from all `poses` is looked for
    least_known: Annotated[float, Field(ge=0, le=1)] = 0.4  # of the room behind the model to be known, mean of views
    gain: Annotated[float, Field(ge=0, lt=1)] = 0.1  # share that each part mends, and a fit that cures no doubt
    samples: PositiveInt = 40  # samples of each part in a round
    poses: Poses = SHIPPED  # poses that people were seen in, made by `mocapflow prior fit`: limbs are tried as there
    seen_samples: NonNegativeInt = 100  # samples of each limb from `poses`, in the first round
    vain_every: PositiveInt = 4  # after three searches in vain, or overbent frames, one of so many is searched at first
    spread_deg: PositiveFloat = 25.0  # standard deviation of the first samples; less where a joint hardly bends
    root_spread_deg: PositiveFloat = 8.0  # standard deviation of the first samples of the root's orientation
    root_spread_m: PositiveFloat = 0.06  # standard deviation of the first samples of the root's place

    def recover(
        self,
        frame: Frame,
        state: FrameState,
        result: FrameResult,
        past: Past,
        model: ClothedModel,
        settle: Settle,
    ) -> FrameResult:
        """Return the result, or a better one; see the class."""
        found = self._recovered(frame, state, result, past, model, settle)
        if past.moments or past.after_gap:
            return found
        told = self.feet_told(frame, found, past, model)
        if told is not found:
            LOG.warning(FEET_UNTOLD)
        return told

    def feet_told(self, frame: Frame, result: FrameResult, past: Past, model: ClothedModel) -> FrameResult:
        """Return the result of a frame; if feet look like a floor without colours in it, it says so to later ones."""
        background, surface = model.scene.background, surface_of(model, result)
        if background is None or background.floor_m is None:
            return result
        seen = self.views(frame, surface, past, model.scene)
        if not seen or not (feet := like_the_floor(surface, seen, model.scene.body)).any():
            return result
        segmentation = result.state.segmentation
        known = replace(segmentation, appearance=with_feet(segmentation.appearance, feet))
        return replace(result, state=replace(result.state, segmentation=known))

    def _recovered(
        self,
        frame: Frame,
        state: FrameState,
        result: FrameResult,
        past: Past,
        model: ClothedModel,
        settle: Settle,
    ) -> FrameResult:
        surface, scene = surface_of(model, result), model.scene
        seen = self.views(frame, surface, past, scene)
        if not seen:
            return noted(result, UNSEEN, doubted=True)
        if np.mean([view.known for view in seen]) < self.least_known:
            return result if past.moments else noted(result, UNKNOWN, doubted=False)
        if not past.moments:
            given = scene.surface(state.estimate.pose, state.cloth)
            warn_of_untold(surface, seen, scene.body)
            warn_of_furniture(given, self.views(frame, given, past, scene), scene.body)
        stray = stray_of(surface, scene, seen)
        fitted, believed, body = result.state.estimate.pose, state.estimate.pose, scene.body
        suspected = suspicion(self.signs, stray, fitted, believed, past, body, self._density)
        if suspected is None:
            return forgotten(result, past)
        if not self._due(suspected, stray, frame.time, past, body):
            return noted(result, UNSEARCHED, doubted=True) if suspected.doubtful else forgotten(result, past)
        judge = self._judge(believed, result, seen, past, model)
        looks = Looks(judge, self._plan(body), believed, fitted, self.gain, TOLERANCE)
        found = self._searched(frame.index, judge.of(result), looks, suspected, settle)
        return counted(found, result, stray.area, past)

    def _due(self, suspected: Suspicion, stray: Stray, time: float, past: Past, body: Body) -> bool:
        """Return whether a suspected fit is searched in this frame: what lasts is searched only now and then."""
        if suspected.doubtful:
            return vain_before(past).due(stray.area, time, past, self.vain_every)
        return not self.signs.stay_bent(past, body) or in_turn(self.vain_every, time, past)

    def views(self, frame: Frame, surface: Surface, past: Past, scene: Scene) -> list[View]:
        """Return what the views of a frame surely show around a surface, in a scene whose empty room is known."""
        assert scene.background is not None
        room = small_room(scene.background, scene.cameras)
        no_shadow = no_shadows(frame, scene.background, scene.cameras)
        return views(frame, surface, room, NEAR_M, garment_told(past, scene), no_shadow)

    def _searched(self, index: int, fit: Fit, looks: Looks, suspected: Suspicion, settle: Settle) -> FrameResult:
        """Return the result of the best pose that is found, or that of the fit where none is better."""
        odd, judge, ways = self.signs.doubtful, looks.judge, self._ways(looks, suspected)

        def settled(number: int, look: Look) -> Fit:
            return judge.of(settle(look(np.random.default_rng([index, number])), judge.parameters))

        fits = [settled(number, look) for number, look in enumerate(ways)]
        best = self._better(min(fits, key=lambda other: (odd(other.stray), other.apart)), fit)
        if judge.given and suspected.doubtful:
            turned = self._better(settled(len(ways), looks.turned), best)
            if turned is not best:
                LOG.warning("the first pose looks the other way: the person was found turned round by half a turn")
            best = turned
        if best is not fit:
            return noted(best.result, f"{suspected.why}: found again by search; then {best.stray}", odd(best.stray))
        if suspected.doubtful:
            return noted(fit.result, f"{suspected.why}: search found nothing better", doubted=True)
        return fit.result

    def _ways(self, looks: Looks, suspected: Suspicion) -> list[Look]:
        """Return the ways to look for the pose, each from its own samples."""
        if suspected.limbs:
            return [partial(looks.alone, limbs=suspected.limbs)]
        far = partial(looks.far, astray=suspected.doubtful)
        if looks.judge.given:  # where all begins, chance shall not decide
            near = partial(looks.near, spread=2 * START)
            return [near, partial(far, cloth=HANGS)] * FIRST_LOOKS if suspected.doubtful else [near]
        return [partial(far, cloth=belief) for belief in ((HANGS, FLIES) if looks.judge.model.clothed else (HANGS,))]

    def _better(self, other: Fit, fit: Fit) -> Fit:
        """Return another fit if it is clearly nearer to the person, or free of a doubt or hint and not much farther."""
        most = 1 - self.gain
        if not self.signs.doubtful(other.stray):
            if self.signs.doubtful(fit.stray):
                most = CURED
            elif fit.stray.near > self.hint_cm2 >= other.stray.near:
                most = CLEARED
        return other if other.apart < most * fit.apart else fit

    def _judge(
        self, believed: Pose, result: FrameResult, seen: Sequence[View], past: Past, model: ClothedModel
    ) -> Judge:
        given = None if past.moments or past.after_gap else Given(believed, START)
        coarse = model.scene.simplified(FACES)
        cloth = HANGS if given else FLIES  # where all begins, the garment's colours are not known
        return Judge(model, coarse, seen, result.state.cloth.parameters, past, given, cloth)

    def _plan(self, body: Body) -> Plan:
        spread = Spread(np.radians(self.spread_deg), np.radians(self.root_spread_deg), self.root_spread_m)
        return Plan(spread, SHARES, self.samples, self._density.on(body.screw_names), self.seen_samples)

    @cached_property
    def _density(self) -> Density:
        return read(self.poses)

    @property
    def signs(self) -> Signs:
        """What calls for a search."""
        leap = np.radians(self.leap_deg)
        return Signs(self.uncovered_cm2, self.floating_cm2, self.hint_cm2, self.beginnings, leap)


def noted(result: FrameResult, note: str, doubted: bool) -> FrameResult:
    """Return a result with one more note, and whether it is still doubted."""
    return replace(result, notes=(*result.notes, note), doubted=doubted)
