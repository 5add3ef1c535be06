"""The chapter's segmenter: a level set that maximises the posterior of two regions and keeps near the model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from mocapflow.assets import Background, Camera
from mocapflow.data import Frame, FrameState, Past, Segmentation, Silhouette, Surface, Turn
from mocapflow.geometry.silhouettes import model_distance
from mocapflow.records import F32, Bool
from mocapflow.scene import Scene
from mocapflow.settings import PositiveOrInf
from mocapflow_levelset.channels import ChannelName
from mocapflow_levelset.contact import contact_zone
from mocapflow_levelset.crops import shrink_mask
from mocapflow_levelset.evidence import Room
from mocapflow_levelset.evolve import Schedule, Weights
from mocapflow_levelset.masks import counted, without_cut
from mocapflow_levelset.moved import moved_outline
from mocapflow_levelset.plates import plate_in
from mocapflow_levelset.shadows import ShadowAware, shadowed
from mocapflow_levelset.statistics import Window
from mocapflow_levelset.view import BAND_PX, Contact, Matte, Method, Resolution, View, find

Share = Annotated[float, Field(ge=0, lt=1)]

INNER_BAND_PX = 7.0  # half width of the band while the contour moves: only what is within 3.5 sigma of it, 5.3 px, does
BORDER_PX = 3  # of the image that is left out
REDUCED_RHO_PX = 8.0  # Gaussian window of the local statistics at reduced sizes, in px of the shrunken image
COARSE, HALF, FULL = 4, 2, 1  # what the image is shrunk by
RATIO_CLIP = 6.0  # bound on log p1/p2


class LevelSet(ShadowAware):
    """Region-based level set (12.1) with the projected model as shape prior (12.9), descended by (12.10).

    It goes from coarse to fine. The empty scene, where it is known, gives the density of the outside at reduced size;
    at full size both sides have local statistics, because a pixel on the edge mixes two colours and the narrow density
    of an empty scene takes it for the person.

    The chapter's own settings are those of `pipelines/paper.yaml`; `shape_weight: 0` uncouples it from the model.
    """

    name: ClassVar[str] = "levelset"

    channels: tuple[ChannelName, ...] = Field(("lab",), min_length=1)  # independent, their likelihoods add
    decorrelate: bool = True  # turn the channels to the image's principal axes, where the empty scene gives no density
    rho_px: PositiveOrInf = 12.0  # Gaussian window of the local statistics at full size; inf: one Gaussian per region
    cell_px: PositiveInt = 8  # size of the cells that the statistics are summed over, in whole strides
    stride_px: PositiveInt = 4  # the statistics take every so many-th pixel; 1: all
    variance_floor: PositiveFloat = 0.03  # smallest standard deviation inside and outside, share of a channel's range
    sigma_px: PositiveFloat = 1.5  # width of the smooth step
    length_weight: NonNegativeFloat = 0.9  # nu, weight of the contour's length; explicit steps are stable below 0.94
    shape_weight: NonNegativeFloat = 0.05  # lambda: more gains nothing in noise or behind a stripe; 0 uncoupled
    any_colour: float = -3.0  # least log density of any colour on the person, where the empty scene is known
    coarse_steps: NonNegativeInt = 32  # steps at a quarter of the size on the first turn, at most
    half_steps: NonNegativeInt = 4  # steps at half the size
    steps: PositiveInt = 3  # steps at full size on the first turn
    later_steps: PositiveInt = 3  # steps at full size on later turns, which start from the last turn's contour
    contact_steps: NonNegativeInt = 10  # steps by chromaticity where body and floor meet and both are dark; 0: none
    matte_px: NonNegativeInt = 2  # reach about an edge in which pixels mix person and empty room; 0: they are not used
    keep_px: NonNegativeFloat = 2.0  # move of the model's outline in a turn up to which the contour stays; 0: never
    statistics_every: PositiveInt = 4  # steps between estimates of the colours
    redistance_every: PositiveInt = 4  # steps between repairs of the distance function
    margin_px: PositiveInt = 40  # margin of the crop around the start contour
    use_background: bool = True  # take the outside's density from the empty scene, where it is known
    shadow_share: Share = 0.5  # prior share of shadow on the background; 0: shadows count as changes

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the person's silhouette in each usable view.

        The first turn starts from the projected model, later turns from the last turn's silhouettes. Where the model's
        outline has hardly moved these stay as they are; in a frame that began far off only from the third turn on, for
        the contour may have had farther to go than its steps reached.
        """
        surface = scene.surface_of(state)
        # a view in which nobody was begins anew from the model, which may stand in it by now
        last = {s.camera: s for s in state.segmentation.of("person") if len(s.zero_level[0])} if turn.index else {}
        parts = {c: self._moved(surface, scene.cameras[c], turn) for c in last}
        due = [c for c in np.flatnonzero(frame.usable).tolist() if (part := parts.get(c)) is None or part.any()]
        if last and not due:
            return state.segmentation
        silhouettes, energies = dict(last), dict(state.segmentation.energies) if last else {}
        for c in due:
            resolutions = self._resolutions(warm=c in last)
            view = self._view(frame, surface, past, scene, c, resolutions)
            if c in last:
                view = view._replace(start=last[c].distance, moved=parts[c])
            found = find(view, resolutions, self._method())
            silhouettes[c] = Silhouette(camera=c, layer="person", distance=found.level)
            for term, cost in found.costs._asdict().items():
                key = f"{scene.cameras[c].name}.{term}"
                energies[key] = cost if view.moved is None else energies.get(key, np.nan) + cost
        return Segmentation(silhouettes=tuple(silhouettes[c] for c in sorted(silhouettes)), energies=energies)

    def _view(
        self, frame: Frame, surface: Surface, past: Past, scene: Scene, camera: int, resolutions: Sequence[Resolution]
    ) -> View:
        """Return what is given of one view, to start from the projected model."""
        lens = scene.cameras[camera]
        model = model_distance(surface, lens, BAND_PX)
        counts = counted(model.shape, BORDER_PX, frame.hidden_in(camera))
        return View(
            image=frame.images[camera],
            start=model,
            prior=model,
            counted=without_cut(counts, model, scene.body, surface, lens),
            rooms=self._rooms(frame, surface, scene, camera, resolutions),
            colours=self._colours(past, camera),
            contact=self._contact(surface, lens),
            matte=self._matte(scene, camera),
        )

    def _moved(self, surface: Surface, camera: Camera, turn: Turn) -> Bool | None:
        """Return around where (H, W) the contour has to be found anew; None: everywhere."""
        if not self.keep_px or turn.change is None or (turn.far and turn.index == 1):
            return None
        return moved_outline(surface, turn.change, camera, self.keep_px)

    def _rooms(
        self, frame: Frame, surface: Surface, scene: Scene, camera: int, resolutions: Sequence[Resolution]
    ) -> dict[int, Room] | None:
        background = self._background(scene)
        if background is None:
            return None
        floor, shadow = shadowed(frame, surface, scene, camera), self.shadow(frame.images[camera], background, camera)
        return {
            factor: Room(plate_in(background, camera, self.channels, factor), shrink_mask(floor, factor), shadow)
            for factor in (each.factor for each in resolutions if each.use_plate)
        }  # the empty room is compared with small images alone, which are smooth

    def _colours(self, past: Past, camera: int) -> F32 | None:
        """Return what colours tell of person and room in a view (BINS,); None: nothing is learned."""
        return None

    def _contact(self, surface: Surface, camera: Camera) -> Contact | None:
        if not self.contact_steps:
            return None
        return Contact(contact_zone(surface, camera), self._schedule(self.contact_steps), self._window(self.rho_px))

    def _matte(self, scene: Scene, camera: int) -> Matte | None:
        background = self._background(scene)
        if background is None or not self.matte_px:
            return None
        return Matte(background.mean[camera], background.known[camera], self.matte_px)

    def _background(self, scene: Scene) -> Background | None:
        return scene.background if self.use_background else None

    def _resolutions(self, warm: bool) -> list[Resolution]:
        reduced, full = self._window(REDUCED_RHO_PX), self._window(self.rho_px)
        resolutions = [
            Resolution(COARSE, self._schedule(0 if warm else self.coarse_steps, to_rest=True), reduced),
            Resolution(HALF, self._schedule(self.half_steps), reduced),
            Resolution(FULL, self._schedule(self.later_steps if warm else self.steps), full, use_plate=False),
        ]
        return [each for each in resolutions if each.schedule.steps]

    def _window(self, rho_px: float) -> Window:
        return Window(rho_px, self.cell_px, self.variance_floor)

    def _schedule(self, steps: int, to_rest: bool = False) -> Schedule:
        return Schedule(steps, self.statistics_every, self.redistance_every, to_rest)

    def _method(self) -> Method:
        return Method(
            channels=self.channels,
            weights=Weights(
                sigma_px=self.sigma_px,
                length=self.length_weight,
                shape=self.shape_weight,
                clip=RATIO_CLIP,
                any_colour=self.any_colour,
                step=1.0,  # `length_weight` is stable with it
                band_px=INNER_BAND_PX,
            ),
            decorrelate=self.decorrelate,
            stride=self.stride_px,
            margin_px=self.margin_px,
        )
