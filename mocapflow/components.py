"""The roles a plugin can play in a run: one base class, one verb each. Those that make its model are `dressing`'s.

A component is a frozen pydantic model, so its fields are its settings: validated, printable, part of the cache
key. Steps are pure functions of their arguments and keep no state between calls; that makes resuming exact.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pydantic import NonNegativeFloat, PositiveFloat

from mocapflow.data import (
    Cloth,
    Estimate,
    Frame,
    FrameResult,
    FrameState,
    Matches,
    Past,
    Pose,
    Residual,
    Segmentation,
    Surface,
    Turn,
)
from mocapflow.records import F64
from mocapflow.settings import Component

if TYPE_CHECKING:
    from pathlib import Path

    from mocapflow.model import ClothedModel
    from mocapflow.recordings.recording import Recording
    from mocapflow.scene import Scene


class Predictor(Component):
    """Guesses the next pose before looking."""

    role: ClassVar[str] = "predictor"

    @abstractmethod
    def predict(self, frame: Frame, past: Past, scene: Scene) -> Pose:
        """Return a first guess of the pose of `frame`; `past` holds at least one moment."""


class Segmenter(Component):
    """Finds the silhouette in each image."""

    role: ClassVar[str] = "segmenter"
    needs_background: ClassVar[bool] = False  # True: it can't do without the empty scene

    @abstractmethod
    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return one silhouette per usable view; `state` holds the current pose and the last turn's silhouettes."""


class Matcher(Component):
    """Pairs image points with surface points."""

    role: ClassVar[str] = "matcher"
    share: PositiveFloat = 1.0  # how much it counts beside other matchers

    @abstractmethod
    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return pairs of image points and vertices of the posed surface."""

    def need(self, recording: Recording) -> None:
        """Raise if nothing in a recording could ever be matched; called before a run begins."""


class PoseSolver(Component):
    """Computes the pose from matches and priors."""

    role: ClassVar[str] = "pose_solver"

    @abstractmethod
    def solve(
        self,
        match: Callable[[Surface], Matches],
        state: FrameState,
        model: ClothedModel,
        priors: Sequence[Prior],
        past: Past,
        turn: Turn,
    ) -> Estimate:
        """Return the pose that explains the matches; it may pose, drape and match again as it goes."""


class ClothFitter(Component):
    """Chooses the cloth parameters and forces that explain the images.

    `GarmentMesh.columns` finds parameters by what they mean: where several garments are worn, each has its own.
    """

    role: ClassVar[str] = "cloth_fitter"

    @abstractmethod
    def fit(
        self,
        frame: Frame,
        segmentation: Segmentation,
        estimate: Estimate,
        model: ClothedModel,
        past: Past,
        turn: Turn,
    ) -> Cloth:
        """Return the cloth at the estimated pose with the parameters that fit best."""


class Prior(Component):
    """A term the pose solver adds: limits, learned poses, smoothness."""

    role: ClassVar[str] = "prior"
    weight: NonNegativeFloat = 1.0  # factor on its energy

    @abstractmethod
    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return the whitened error at `pose` with its Jacobian; an increment of the root is (omega, v)."""


class Recovery(Component):
    """Notices that a fit is lost, and finds the person again."""

    role: ClassVar[str] = "recovery"
    needs_background: ClassVar[bool] = False  # True: it is not asked without the empty scene

    @abstractmethod
    def recover(
        self,
        frame: Frame,
        state: FrameState,
        result: FrameResult,
        past: Past,
        model: ClothedModel,
        settle: Callable[[Pose, F64], FrameResult],
    ) -> FrameResult:
        """Return the result of the loop, or a better one that `settle` has reached from elsewhere.

        `settle` takes a pose and cloth parameters; `state` is what was predicted before looking. What was found
        wrong, and what became of it, goes into `notes`.
        """


class Stage(Component):
    """A whole-sequence step; the annotations of `run` are its wiring.

    A subclass defines `run(self, **typed_inputs) -> Artifact`, a dataclass of arrays, numbers and text, which the store
    keeps, or `Files`, which it has written. Each parameter receives the result of the nearest earlier stage that makes
    its type, or where the type is a stage that stage itself, with its settings; `Scene` (or
    `Tailor`, where the garment may not fit the body yet), `Recording`, `Checkpoint` and `RunFolder` come from the
    runner; `X | None = None` makes an input optional. A stage that returns a `Recording` changes how later stages see
    it.

    `extent` says which frames of the recording it sees, and its cache key names: the "first" one of the run, its
    "beginning" (ten frames, however short the run), those of the "run", or "all" there are; None: the first for a
    Start, all for a Background, Body, Rig or Recording, else the run's.
    What a `causal` stage says of a frame depends on no later frame: a track made with it can go on when the run grows.
    """

    role: ClassVar[str] = "stage"
    extent: ClassVar[Literal["first", "beginning", "run", "all"] | None] = None
    causal: ClassVar[bool] = False
    run: ClassVar[Callable[..., Any]]

    def inputs(self, folder: Path) -> Sequence[Path]:
        """Return files that `run` reads besides the frames: their content is part of the cache key."""
        return ()

    def need(self, recording: Recording) -> None:
        """Raise the error that `run` would for lack of an input; called by `plan`, and before a run begins."""

    @property
    def looks_back(self) -> bool:
        """True where `look_back` has to check a result that comes from the store."""
        return False

    @property
    def keeps_turns(self) -> bool:
        """True where the checkpoint is to keep every turn: frames of the store may lack them, and that is told."""
        return False

    def look_back(self, made: Any) -> None:
        """Raise what `run` would have raised about a stored result: settings outside its key may have changed since."""


Observe = Callable[[int, Turn, FrameState], None]
