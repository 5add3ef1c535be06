"""Exact silhouettes of the tiny body, with stray contour points in them if wanted, and a run of the loop on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mocapflow_draping.fixed import Fixed
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton

from mocapflow.components import Matcher, Prior, Segmenter
from mocapflow.data import (
    NO_CLOTH,
    Change,
    Frame,
    FrameState,
    Past,
    Pose,
    Segmentation,
    Silhouette,
    Surface,
    Turn,
)  # fmt: skip
from mocapflow.geometry import silhouettes, twists
from mocapflow.loop import Steady, Steps, settle
from mocapflow.model import ClothedModel
from mocapflow.records import F64, array, record
from mocapflow.scene import Scene
from mocapflow.testing import tiny_cloth, tiny_pose, tiny_state
from mocapflow.testing.scenes import tiny_past

BAND = 12.0  # px
FIRST = Turn(index=0)
CALM = Turn(index=3, change=Change(body=0.005, cloth=0.0, angles=0.0, sigmas=1.0))
FRAME = Frame(index=0, time=0.0, images=(), usable=np.ones(4, bool))


@record
class Cluttered(Silhouette):
    """A silhouette whose contour has stray points."""

    stray: F64 = array("K", 2, unit="px")
    outward: F64 = array("K", 2, unit="1")

    @property
    def zero_level(self) -> tuple[F64, F64]:
        contour = Silhouette(camera=self.camera, layer=self.layer, distance=self.distance).zero_level
        pixel, normal = (np.concatenate(pair) for pair in zip(contour, (self.stray, self.outward), strict=True))
        order = np.argsort(pixel[:, 1], kind="stable")
        return pixel[order], normal[order]


class Given(Segmenter):
    """Hands over what the state holds."""

    name = "given"

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        return state.segmentation


def bent(pose: Pose, degrees: float, scene: Scene) -> Pose:
    """The same pose with the left hip spread."""
    angles = pose.angles.copy()
    angles[scene.body.screw_names.index("hip_l.abduction")] += np.radians(degrees)
    return Pose(root=pose.root, angles=angles)


def surface_at(pose: Pose, scene: Scene) -> Surface:
    """The surface at a pose, in the garment of the scene if it has one."""
    return scene.surface(pose, tiny_cloth(scene, pose))


def seen(surface: Surface, scene: Scene) -> Segmentation:
    """The exact silhouettes of a surface, to a fraction of a pixel."""
    fields = [silhouettes.model_distance(surface, camera, BAND) for camera in scene.cameras]
    return Segmentation(
        silhouettes=tuple(Silhouette(camera=k, layer="person", distance=field) for k, field in enumerate(fields))
    )


def cluttered(segmentation: Segmentation, share: float, seed: int) -> Segmentation:
    """The same with stray points, a share of the contour's, uniform about the person and facing anywhere."""
    rng = np.random.default_rng(seed)
    return Segmentation(silhouettes=tuple(_cluttered(s, share, rng) for s in segmentation.silhouettes))


def _cluttered(silhouette: Silhouette, share: float, rng: np.random.Generator) -> Cluttered:
    pixel, _ = silhouette.zero_level
    count = round(share * len(pixel))
    turn = rng.uniform(0, 2 * np.pi, count)
    return Cluttered(
        camera=silhouette.camera,
        layer=silhouette.layer,
        distance=silhouette.distance,
        stray=rng.uniform(pixel.min(axis=0) - BAND, pixel.max(axis=0) + BAND, (count, 2)),
        outward=np.column_stack([np.cos(turn), np.sin(turn)]),
    )


def start_near(truth: Pose, angle_deg: float, shift_m: float, seed: int) -> Pose:
    """A pose off by so much in every angle and in the place of the root (1 sigma), by a third in its turn."""
    rng = np.random.default_rng(seed)
    spread = np.radians(angle_deg)
    root = truth.root.copy()
    turn = twists.exp(np.concatenate([spread / 3 * rng.normal(size=3), np.zeros(3)]))
    root[:3, :3] = turn[:3, :3] @ root[:3, :3]
    root[:3, 3] += shift_m * rng.normal(size=3)
    return Pose(root=root, angles=truth.angles + spread * rng.normal(size=len(truth.angles)))


def knee_error_deg(
    scene: Scene,
    matchers: Sequence[Matcher],
    seed: int,
    clutter: float = 0.0,
    off_deg: float = 5.0,
    priors: Sequence[Prior] = (),
) -> float:
    """The larger error of both knees, so many degrees (and about 1.4 mm each) off at first, when the loop is done."""
    truth = tiny_pose(scene, seed + 100)
    segmentation = seen(scene.surface(truth, NO_CLOTH), scene)
    if clutter:
        segmentation = cluttered(segmentation, clutter, seed)
    start = start_near(truth, off_deg, 0.0014 * off_deg, seed)
    state = replace(tiny_state(scene, start), segmentation=segmentation)
    steady = Steady(turns=1, max_turns=5)
    steps = Steps(
        segmenter=Given(), matchers=matchers, pose_solver=TwistGaussNewton(), cloth_fitter=Fixed(),
        priors=priors, steady=steady,
    )  # fmt: skip
    result = settle(FRAME, state, tiny_past(scene, start), steps, ClothedModel(scene=scene), lambda *_: None)
    bent = [k for k, name in enumerate(scene.body.screw_names) if name.startswith("knee")]
    return float(np.degrees(np.abs(result.state.estimate.pose.angles - truth.angles)[bent]).max())
