"""What limits the knee under a garment? One part of the tracker after another is replaced by the truth.

`OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/limits.py RECORDING [FRAMES]`, for a recording with
truth/joints.npz and truth/cloth.npz. Tracking starts at the true pose; knees, shank directions, hip centres and the
pelvis' turn about its long axis are compared before smoothing. True masks are those of body and true cloth at the true
pose. Joint centres do not tell how a limb is turned about itself, so feet in them may be rolled by a few degrees.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from clothed import pipeline_for

from mocapflow.assets import Camera
from mocapflow.components import Prior, Segmenter
from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import (
    BODY,
    CLOTH,
    NO_CLOTH,
    Frame,
    FrameState,
    Moment,
    Past,
    Pose,
    Residual,
    Segmentation,
    Silhouette,
    Surface,
    Turn,
)  # fmt: skip
from mocapflow.geometry import kinematics, meshes, twists
from mocapflow.geometry.cameras import project
from mocapflow.geometry.silhouettes import model_distance
from mocapflow.io.subject.first_pose import read_pose
from mocapflow.loop import settle
from mocapflow.model import ClothedModel, moved
from mocapflow.prediction import initial_state
from mocapflow.recordings.recording import open_recording
from mocapflow.records import F64, Bool
from mocapflow.scene import Scene
from mocapflow.track import CoupledLoop

CENTRE_SD = 5e-5  # m, of the true joint centres
LOOSE = np.radians(90.0)  # rad, spread of angles that are free
BAND_PX = 12.0
FEET_PX = 8.0


class Errors(NamedTuple):
    """How far one pose is off."""

    knee: F64  # (2,) deg, left and right
    shank: F64  # (2,) deg between directions
    hip: F64  # (2,) mm between centres
    yaw: float  # deg


def main() -> None:
    folder, frames = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 25
    pipeline = load_pipeline(pipeline_for(folder), recording=folder, frames=slice(0, frames))
    recording = open_recording(folder, start=0, stop=frames)
    stages = {stage.label: stage.stage for stage in pipeline.stages}
    loop, body, garment = stages["track"], pipeline.body.load(folder), pipeline.garment
    assert isinstance(loop, CoupledLoop) and garment is not None
    scene = Scene(cameras=recording.cameras, body=body, garment=garment.sew(body))
    truth = true_poses(folder, scene, range(frames))
    model = ClothedModel(scene=scene.with_background(stages["background"].run(recording, scene)), draper=loop.draper)
    print(f"{'RMS over ' + str(frames) + ' frames':28} knees °      shank °  hip centre mm  pelvis yaw °")
    for label, (segmenter, priors) in variants(loop.segmenter, truth, dressed(folder, scene, truth)).items():
        tracked = track(recording.frames(), loop, model, segmenter, priors, truth)
        tell(label, [errors(scene, pose, true) for pose, true in zip(tracked, truth, strict=True)])


def variants(
    segmenter: Segmenter, poses: tuple[Pose, ...], surfaces: tuple[Surface, ...]
) -> dict[str, tuple[Segmenter, tuple[Prior, ...]]]:
    """Return segmenter and further priors of each line of the table."""
    masks = TrueMasks(inner=segmenter, truth=surfaces, part="all")
    return {
        "as shipped": (segmenter, ()),
        "true masks": (masks, ()),
        "true masks below the hem": (masks.model_copy(update={"part": "below"}), ()),
        "true masks at the feet": (masks.model_copy(update={"part": "feet"}), ()),
        "true masks above the waist": (masks.model_copy(update={"part": "above"}), ()),
        "true pelvis": (segmenter, (TruePelvis(truth=poses),)),
    }


def track(
    frames: Iterator[Frame], loop: CoupledLoop, model: ClothedModel, segmenter: Segmenter, priors: Sequence[Prior],
    truth: Sequence[Pose],
) -> list[Pose]:  # fmt: skip
    """Return the pose of each frame, tracked from the true pose of the first."""
    past, poses, pose, parameters = Past(), list[Pose](), truth[0], model.scene.neutral_parameters
    for row, frame in enumerate(frames):
        if past.moments:
            pose = loop.predictor.predict(frame, past, model.scene)
        here = [replace_row(prior, row) for prior in priors]
        steps = replace(loop.steps, segmenter=segmenter, priors=(*loop.priors, *here))
        state = initial_state(pose, parameters, model.drape(pose, parameters, past))
        new = settle(frame, state, past, steps, model, lambda *_: None).state
        parameters = new.cloth.parameters
        found = new.estimate
        moment = Moment(time=frame.time, pose=found.pose, cloth=new.cloth, observed=found.observed)
        past = past.after(moment, new.segmentation.appearance)
        poses.append(found.pose)
    return poses


class TrueMasks(Segmenter):
    """Replaces the silhouettes of another segmenter by the true ones, in the whole image or a part."""

    name = "true_masks"
    inner: Segmenter
    truth: tuple[Surface, ...]
    part: Literal["all", "above", "below", "feet"]
    model_config = {"frozen": True, "arbitrary_types_allowed": True}

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the mixture."""
        found = self.inner.segment(frame, state, past, scene, turn)
        mixed = [self._mixed(silhouette, frame.index, scene) for silhouette in found.silhouettes]
        return replace(found, silhouettes=tuple(mixed))

    def _mixed(self, found: Silhouette, frame: int, scene: Scene) -> Silhouette:
        camera, surface = scene.cameras[found.camera], self.truth[frame]
        band = float(found.distance.max())
        distance, true = found.distance.copy(), model_distance(surface, camera, min(BAND_PX, band))
        cloth = project(surface.vertices[surface.layer == CLOTH], camera)[:, 1]
        first, last = np.clip([cloth.min(), cloth.max()], 0, len(distance)).astype(int)
        rows = {"all": slice(None), "above": slice(0, first), "below": slice(last, None)}
        chosen = around_feet(surface, camera, scene) if self.part == "feet" else rows[self.part]
        distance[chosen] = true[chosen]
        return replace(found, distance=distance)


def around_feet(surface: Surface, camera: Camera, scene: Scene) -> Bool:
    """Return the pixels (H, W) within `FEET_PX` of where a vertex of the feet is seen, hidden or not."""
    import cv2

    body = scene.body
    carrier = body.skin_joint[np.arange(len(body.vertices)), body.skin_weight.argmax(axis=1)]
    feet = np.isin(carrier, [body.joint(f"{name}_{side}") for name in ("ankle", "toe") for side in "lr"])
    width, height = (int(length) for length in camera.size)
    pixels = np.rint(project(surface.vertices[: len(feet)][feet], camera)).astype(int)
    column, row = pixels[((pixels >= 0) & (pixels < camera.size)).all(axis=1)].T
    elsewhere = np.ones((height, width), np.uint8)
    elsewhere[row, column] = 0
    return np.asarray(cv2.distanceTransform(elsewhere, cv2.DIST_L2, 3) < FEET_PX)


class TruePelvis(Prior):
    """Holds the pelvis where it is, within 0.1° and 1 mm."""

    name = "true_pelvis"
    truth: tuple[Pose, ...]
    row: int = 0
    model_config = {"frozen": True, "arbitrary_types_allowed": True}

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return three rows for the turn and three for the place of the root joint."""
        true = self.truth[self.row]
        place, goal = (kinematics.root_position(scene.body, root) for root in (pose.root, true.root))
        jacobian = np.zeros((6, 6 + len(pose.angles)))
        jacobian[:3, :3], jacobian[3:, :3], jacobian[3:, 3:6] = np.eye(3), -twists.hat(place), np.eye(3)
        error = np.append(twists.log_rotation(pose.root[:3, :3] @ true.root[:3, :3].T), place - goal)
        sharpness = np.repeat([1 / np.radians(0.1), 1 / 0.001], 3)
        whitened = sharpness * error
        return Residual(error=whitened, jacobian=sharpness[:, None] * jacobian, energy=0.5 * float(whitened @ whitened))


def replace_row(prior: Prior, row: int) -> Prior:
    """Return a prior that knows the truth, set to a frame."""
    return prior.model_copy(update={"row": row})


def true_poses(folder: Path, scene: Scene, rows: Sequence[int]) -> tuple[Pose, ...]:
    """Return the poses of frames, in order, with the true joint centres; what they leave open stays near rest."""
    from scipy.optimize import least_squares

    archive = np.load(folder / "truth" / "joints.npz")
    names = [str(name) for name in archive["names"]]
    centres = archive["positions"][list(rows)][:, [names.index(name) for name in scene.body.joint_names]]
    spread = np.where(np.isfinite(scene.body.rest_spread), scene.body.rest_spread, LOOSE)
    poses = [read_pose(folder / "init.json", scene.body)]
    for goal in centres:
        last = poses[-1]

        def residual(change: F64, last: Pose = last, goal: F64 = goal) -> F64:
            pose = moved(last, change)
            off = (centres_of(scene, pose) - goal) / CENTRE_SD
            return np.append(off.ravel(), pose.angles / spread)

        poses.append(moved(last, least_squares(residual, np.zeros(6 + len(spread)), x_scale="jac", max_nfev=60).x))
    return tuple(poses[1:])


def dressed(folder: Path, scene: Scene, poses: Sequence[Pose]) -> tuple[Surface, ...]:
    """Return body and true cloth of each frame."""
    cloth = np.load(folder / "truth" / "cloth.npz")
    garment = cloth["faces"].astype(np.int32)
    faces = np.concatenate([scene.body.faces, garment + np.int32(len(scene.body.vertices))])
    edges, shape = meshes.edges(faces), cloth["vertices"]
    layer = np.repeat(np.array([BODY, CLOTH], np.uint8), [len(scene.body.vertices), shape.shape[1]])
    return tuple(
        replace(
            skin,
            vertices=np.concatenate([skin.vertices, shape[row].astype(float)]),
            faces=faces,
            edges=edges,
            layer=layer,
        )  # fmt: skip
        for row, skin in enumerate(scene.undressed.surface(pose, NO_CLOTH) for pose in poses)
    )


def centres_of(scene: Scene, pose: Pose) -> F64:
    """Return the joint centres (J, 3) m."""
    return kinematics.joint_positions(scene.body, kinematics.chain(scene.body, pose)[0])


def errors(scene: Scene, pose: Pose, true: Pose) -> Errors:
    """Return how far a pose is from the true one."""
    chains = np.stack([centres_of(scene, pose), centres_of(scene, true)])
    hip, knee, ankle = (
        chains[:, [scene.body.joint(f"{name}_{side}") for side in "lr"]] for name in ("hip", "knee", "ankle")
    )
    flexion = between(knee - hip, ankle - knee)
    turn = twists.log_rotation(true.root[:3, :3].T @ pose.root[:3, :3])
    return Errors(
        knee=flexion[0] - flexion[1],
        shank=between(*(ankle - knee)),
        hip=1000 * np.linalg.norm(hip[0] - hip[1], axis=-1),
        yaw=float(np.degrees(turn[2])),
    )


def between(one: F64, other: F64) -> F64:
    """Return the angle in degrees between vectors (..., 3)."""
    crossed = np.linalg.norm(np.cross(one, other), axis=-1)
    return np.degrees(np.arctan2(crossed, np.sum(one * other, axis=-1)))


def tell(label: str, rows: Sequence[Errors]) -> None:
    """Print one line."""
    left, right = (rms([row.knee[side] for row in rows]) for side in range(2))
    shank, hip = rms([row.shank for row in rows]), rms([row.hip for row in rows])
    print(
        f"{label:28} {left:4.2f} {right:5.2f}  {shank:8.2f} {hip:13.1f} {rms([row.yaw for row in rows]):13.1f}",
        flush=True,
    )


def rms(values: Sequence[F64] | Sequence[float]) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


if __name__ == "__main__":
    main()
