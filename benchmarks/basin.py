"""How far off a start may be: success of the contour matchers on exact silhouettes of the demo bodies.

Run `OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/basin.py [STARTS]`. Every joint angle is off by a normal
error of 5, 10 or 20 degrees, the root by a third of that and 1.4 mm a degree. A start counts as found when the surface
comes to lie within 1 cm of the true one in the mean. The bodies and cameras (320 x 400 px) are those of the two demo
clips, without cloth, in a room of even grey.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mocapflow_bodies.scanned import Scanned
from mocapflow_draping.fixed import Fixed
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.fourier_icp import FourierIcp
from mocapflow_matching.optical_flow import OpticalFlow
from mocapflow_priors.joint_limits import JointLimits
from mocapflow_priors.rest_pose import RestPose
from mocapflow_priors.spine_coupling import SpineCoupling
from mocapflow_recovery.limb_search import LimbSearch
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton

from mocapflow.assets import Background
from mocapflow.components import Matcher, Recovery, Segmenter
from mocapflow.data import NO_CLOTH, Frame, FrameResult, FrameState, Past, Pose, Segmentation, Silhouette, Turn
from mocapflow.geometry import silhouettes, twists
from mocapflow.help.shipped import shipped
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.io.subject.first_pose import read_pose
from mocapflow.loop import Steps, settle
from mocapflow.model import ClothedModel
from mocapflow.prediction import initial_state
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.steady import Steady

CLIPS = ("skirt_steps", "shorts_steps")
SPREADS = (5.0, 10.0, 20.0)  # degrees
FOUND = 0.01  # m
FLOW = OpticalFlow(between="shapes")
VARIANTS: dict[str, tuple[Sequence[Matcher], Recovery | None]] = {
    "contour_icp": ([ContourIcp()], None),
    "fourier_icp": ([FourierIcp()], None),
    "contour_icp + optical_flow": ([ContourIcp(), FLOW], None),
    "fourier_icp + optical_flow": ([FourierIcp(), FLOW], None),
    "contour_icp + limb_search": ([ContourIcp()], LimbSearch()),
    "contour_icp + flow + search": ([ContourIcp(), FLOW], LimbSearch()),
    "fourier_icp + flow + search": ([FourierIcp(), FLOW], LimbSearch()),
}
WALL, CLOTHES = 90, 200  # grey levels


class Given(Segmenter):
    """Hands over the silhouettes of the state."""

    name = "given"

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the silhouettes of the state."""
        return state.segmentation


def scene_of(clip: str) -> tuple[Scene, Pose]:
    """The unclothed scene of a clip, and a pose in it."""
    folder = shipped("examples", "data", clip)
    body, cameras = Scanned().load(folder), read_cameras(folder)
    empty = tuple(np.full((camera.size[1], camera.size[0], 3), WALL, np.float32) for camera in cameras)
    room = Background(mean=empty, spread=tuple(np.ones_like(view) for view in empty))
    return Scene(cameras=cameras, body=body, background=room), read_pose(folder / "init.json", body)


def shown(scene: Scene, pose: Pose) -> Segmentation:
    """The exact silhouettes of a pose."""
    surface = scene.surface(pose, NO_CLOTH)
    fields = [silhouettes.model_distance(surface, camera, 10.0) for camera in scene.cameras]
    return Segmentation(
        silhouettes=tuple(Silhouette(camera=k, layer="person", distance=field) for k, field in enumerate(fields))
    )


def pictured(scene: Scene, seen: Segmentation) -> Frame:
    """The images of the silhouettes: an even person in an even room."""
    masks = [silhouette.distance > 0 for silhouette in seen.silhouettes]
    images = tuple(np.repeat(np.where(mask, CLOTHES, WALL).astype(np.uint8)[..., None], 3, axis=2) for mask in masks)
    return Frame(index=0, time=0.0, images=images, usable=np.ones(len(scene.cameras), bool))


def bent(scene: Scene, pose: Pose, spread_deg: float, rng: np.random.Generator) -> Pose:
    """A pose off by so much in every angle, within the limits, and by a third in the turn of the root."""
    spread = np.radians(spread_deg)
    root = pose.root.copy()
    root[:3, :3] = twists.exp(np.concatenate([spread / 3 * rng.normal(size=3), np.zeros(3)]))[:3, :3] @ root[:3, :3]
    root[:3, 3] += 0.0014 * spread_deg * rng.normal(size=3)
    angles = np.clip(pose.angles + spread * rng.normal(size=len(pose.angles)), *scene.body.limits.T)
    return Pose(root=root, angles=angles)


def error(scene: Scene, truth: Pose, start: Pose, matchers: Sequence[Matcher], recovery: Recovery | None) -> float:
    """The mean distance (m) of the surface from the true one when the loop is done."""
    seen, model = shown(scene, truth), ClothedModel(scene=scene)
    frame = pictured(scene, seen)
    steps = Steps(
        segmenter=Given(), matchers=matchers, pose_solver=TwistGaussNewton(iterations=5),
        cloth_fitter=Fixed(), priors=[JointLimits(), RestPose(), SpineCoupling()],
        steady=Steady(surface_mm=2.0, angle_deg=0.3, turns=1),
    )  # fmt: skip

    def settle_from(pose: Pose, parameters: F64) -> FrameResult:
        begun = replace(initial_state(pose, parameters, NO_CLOTH), segmentation=seen)
        return settle(frame, begun, Past(), steps, model, lambda *_: None)

    result = settle_from(start, np.empty(0))
    if recovery is not None:
        begun = initial_state(start, np.empty(0), NO_CLOTH)
        result = recovery.recover(frame, begun, result, Past(), model, settle_from)
    found = result.state.estimate.pose
    one, other = (scene.surface(pose, NO_CLOTH).vertices for pose in (truth, found))
    return float(np.linalg.norm(one - other, axis=1).mean())


def main() -> None:
    starts = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    scenes = [scene_of(clip) for clip in CLIPS]
    print(f"found of {len(CLIPS) * starts} starts a row; seconds of CPU a start")
    print(f"{'off by':>8}  {'matchers':28}{'found':>7}{'median mm':>11}{'s':>7}")
    for spread in SPREADS:
        for name, (matchers, recovery) in VARIANTS.items():
            begin, errors = time.process_time(), []
            for number, (scene, truth) in enumerate(scenes):
                for seed in range(starts):
                    rng = np.random.default_rng([number, seed])
                    errors.append(error(scene, truth, bent(scene, truth, spread, rng), matchers, recovery))
            spent = (time.process_time() - begin) / len(errors)
            found = int(np.sum(np.array(errors) < FOUND))
            print(f"{spread:7.0f}°  {name:28}{found:7}{1e3 * np.median(errors):11.1f}{spent:7.2f}", flush=True)


if __name__ == "__main__":
    main()
