"""The chapter's segmenter: a level set that maximises the posterior of two regions and keeps near the model."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from mocapflow.components import Segmenter
from mocapflow.data import Frame, FrameState, Past, Segmentation, Silhouette, Surface, Turn
from mocapflow.geometry.silhouettes import model_distance
from mocapflow.records import F32
from mocapflow.scene import Scene
from mocapflow_levelset.channels import ChannelName
from mocapflow_levelset.evolve import Rhythm, Weights
from mocapflow_levelset.masks import counted, without_cut
from mocapflow_levelset.plates import Shadow
from mocapflow_levelset.shadows import floor_around
from mocapflow_levelset.statistics import Window
from mocapflow_levelset.view import Level, Method, View, find

Count = Annotated[int, Field(gt=0)]
NonNegativeCount = Annotated[int, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, lt=1)]

PERSON = "person"
INNER_BAND_PX = 7.0  # while the contour moves


class LevelSet(Segmenter):
    """Region-based level set (12.1) with the projected model as shape prior (12.9), descended by (12.10).

    The chapter's own settings: `use_background: false`, `coarse_steps: 0`, `cell_px: 1`, `steps: 50`,
    `statistics_every: 1`; `shape_weight: 0` uncouples it from the model.
    """

    name: ClassVar[str] = "levelset"

    channels: tuple[ChannelName, ...] = Field(("lab",), min_length=1)  # independent, their likelihoods add
    decorrelate: bool = True  # turn the channels to the image's principal axes, where no empty scene is known
    rho_px: Positive = 12.0  # Gaussian window of the local statistics; inf: one Gaussian per region
    cell_px: Count = 9  # the statistics are summed over cells of this size
    stride_px: Count = 3  # and taken from every so many-th pixel; 1: from all
    variance_floor: Positive = 0.03  # smallest standard deviation inside and outside, share of a channel's range
    sigma_px: Positive = 1.5  # width of the smooth step
    length_weight: NonNegative = 0.9  # nu; explicit steps are stable below 0.94
    shape_weight: NonNegative = 0.05  # lambda: 0.05 clean, 0.1 with occlusion, 0.1-0.3 in heavy noise, 0 uncoupled
    ratio_clip: Positive = 6.0  # bound on log p1/p2
    time_step: Positive = 1.0
    coarse_factor: Count = 4
    coarse_steps: NonNegativeCount = 9  # on the first turn, at 1 / coarse_factor of the size
    coarse_rho_px: Positive = 32.0  # window there, in px of the full image: a poor start needs a wide one
    steps: Count = 6  # on the first turn
    later_steps: Count = 3  # on later turns, from the last turn's contour
    local_steps: NonNegativeCount = 3  # after those against the empty scene, with local statistics on both sides
    statistics_every: Count = 3  # steps
    redistance_every: Count = 3  # steps
    band_px: Annotated[float, Field(ge=8)] = 12.0
    median_px: NonNegativeCount = 0  # median filter against pixels of no meaning, e.g. 9; 0: none
    border_px: NonNegativeCount = 3  # left out at the image's border
    margin_px: Count = 40  # of the crop around the start contour
    use_background: bool = True  # take the outside's density from the empty scene, where it is known
    spread_floor: Positive = 0.012  # smallest standard deviation of the empty scene, share of the range
    calm_px: NonNegative = 1.0  # smoothing of the image before it is compared with the empty scene
    shadow_share: Share = 0.5  # of the background; 0: shadows count as changes
    shadow_reach_m: Positive = 2.0  # shadows fall on the floor within this distance of the person
    darkest_shadow: Annotated[float, Field(gt=0, lt=1)] = 0.5  # factor of L + 16, a and b in the deepest shadow
    shadow_chroma: Positive = 0.005  # how far a shadow may be off the plate's chromaticity, share of the range
    stranger: float = -6.0  # log density below which no region calls a pixel more unlikely

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the person's silhouette in each usable view.

        The first turn starts from the projected model, later turns from the last turn's silhouettes.
        """
        surface = scene.surface(state.estimate.pose, state.cloth)
        last = {s.camera: s.distance for s in state.segmentation.silhouettes if s.layer == PERSON}
        silhouettes: list[Silhouette] = []
        energies: dict[str, float] = {}
        for c, camera in enumerate(scene.cameras):
            if not frame.usable[c]:
                continue
            model = model_distance(surface, camera, self.band_px)
            warm = turn.index > 0 and c in last
            view = View(
                image=frame.images[c],
                start=last[c] if warm else model,
                prior=model,
                counted=without_cut(counted(model.shape, self.border_px), model, scene.body, surface, camera),
                plate=self._plate(scene, surface, c),
            )
            found = find(view, self._levels(warm, view.plate is not None), self._method(), self.band_px)
            silhouettes.append(Silhouette(camera=c, layer=PERSON, distance=found.level))
            terms = {"data": found.data, "length": found.length, "shape": found.shape}
            energies |= {f"{camera.name}.{term}": value for term, value in terms.items()}
        return Segmentation(silhouettes=tuple(silhouettes), energies=energies)

    def _plate(self, scene: Scene, surface: Surface, camera: int) -> tuple[F32, F32, F32] | None:
        if scene.background is None or not self.use_background:
            return None
        floor = floor_around(surface, scene.cameras[camera], self.shadow_reach_m)
        return scene.background.mean[camera], scene.background.spread[camera], floor

    def _levels(self, warm: bool, known: bool) -> list[Level]:
        steps = self.later_steps if warm else self.steps
        fine = Level(1, self._rhythm(steps), Window(self.rho_px, self.cell_px, self.variance_floor))
        levels = [fine, *self._exact(fine, known)]
        if warm or not self.coarse_steps or self.coarse_factor == 1:
            return levels
        wide = Window(self.coarse_rho_px, 2 * self.cell_px, self.variance_floor)
        return [Level(self.coarse_factor, self._rhythm(self.coarse_steps), wide), *levels]

    def _exact(self, fine: Level, known: bool) -> list[Level]:
        """Return the last steps after the plate: it tells the sides apart, the local statistics where they meet.

        A pixel on the edge mixes both colours, so the plate's narrow density takes it for the person.
        """
        if not known or not self.local_steps:
            return []
        return [fine._replace(rhythm=self._rhythm(self.local_steps), use_plate=False)]

    def _rhythm(self, steps: int) -> Rhythm:
        return Rhythm(steps, self.statistics_every, self.redistance_every)

    def _method(self) -> Method:
        return Method(
            channels=self.channels,
            median_px=self.median_px,
            weights=Weights(
                self.sigma_px, self.length_weight, self.shape_weight, self.ratio_clip, self.time_step, INNER_BAND_PX
            ),
            shadow=Shadow(self.spread_floor, self.shadow_share, self.darkest_shadow, self.shadow_chroma, self.stranger),
            calm_px=self.calm_px,
            decorrelate=self.decorrelate,
            stride=self.stride_px,
            margin_px=self.margin_px,
        )
