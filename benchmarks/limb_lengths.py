"""Does `calibrate_limbs` give back the lengths of limbs that are wrong in the model?

`OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/limb_lengths.py RECORDING [FRAMES [LAST]]`, for a recording
with truth/joints.npz. The thigh of the model is made 2 % too long and the shank 2 % too short; FRAMES (of the stage),
spread over the recording up to LAST, start 1° a joint off. Printed is what the lengths are wrong by before and after.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from clothed import pipeline_for
from limits import true_poses
from mocapflow_fitting.calibrate_limbs import CalibrateLimbs
from mocapflow_fitting.proportions import scaled

from mocapflow.assets import Body
from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import Pose
from mocapflow.geometry.skeleton import segment_lengths
from mocapflow.recordings.recording import open_recording
from mocapflow.results import Track
from mocapflow.scene import Scene
from mocapflow.track import CoupledLoop

WRONG = {"thigh": 1.02, "shank": 0.98}
OFF = np.radians(1.0)  # rad, standard deviation of each angle at the start


def main() -> None:
    folder = Path(sys.argv[1])
    frames = int(sys.argv[2]) if len(sys.argv) > 2 else CalibrateLimbs.model_fields["frames"].default
    pipeline = load_pipeline(pipeline_for(folder), recording=folder)
    stages = {stage.label: stage.stage for stage in pipeline.stages}
    loop, recording, body = stages["track"], open_recording(folder), pipeline.body.load(folder)
    assert isinstance(loop, CoupledLoop) and pipeline.garment is not None
    wrong = scaled(body, WRONG)
    scene = Scene(cameras=recording.cameras, body=wrong, garment=pipeline.garment.sew(wrong))
    background = stages["background"].run(recording, scene)
    count = min(int(sys.argv[3]), recording.length) if len(sys.argv) > 3 else recording.length
    rows = np.linspace(0, count - 1, frames).round().astype(int).tolist()
    truth = true_poses(folder, replace(scene, body=body), rows)
    print(f"frames {rows}\n{'before':10}{told(wrong, body)}")
    stage = CalibrateLimbs(
        segmenter=loop.segmenter, matchers=loop.matchers, draper=loop.draper, proportions=tuple(WRONG), frames=frames
    )  # fmt: skip
    start = time.process_time()
    found = stage.run(recording, scene, background, track_of(scene, rows, truth))
    print(f"{'after':10}{told(found, body)}   ({time.process_time() - start:.0f} s of CPU)", flush=True)


def track_of(scene: Scene, rows: Sequence[int], truth: Sequence[Pose]) -> Track:
    """Return a track whose poses are off by `OFF`."""
    count, size = len(rows), len(scene.body.twists)
    parameters = scene.neutral_parameters
    return Track(
        frame=np.array(rows, np.int32), time=np.array(rows) / 30.0, root=np.stack([pose.root for pose in truth]),
        angles=np.stack([p.angles for p in truth]) + OFF * np.random.default_rng(0).normal(size=(count, size)),
        covariance=np.zeros((count, 6 + size, 6 + size)), observed=np.ones((count, size)),
        cloth=np.zeros((count, 0, 3)), cloth_parameters=np.tile(parameters, (count, 1)),
        iterations=np.ones(count, np.int16), steady=np.ones(count, bool), oscillating=np.zeros(count, bool),
        doubted=np.zeros(count, bool),
        usable=np.ones((count, len(scene.cameras)), bool), overlap=np.ones((count, len(scene.cameras))),
        seconds=np.zeros((count, 1)), step_names=("none",), energy=np.zeros((count, 1, 1)), energy_terms=("none",),
    )  # fmt: skip


def told(found: Body, true: Body) -> str:
    """Return by how many mm each limb is too long, left and right."""
    ours, theirs = segment_lengths(found), segment_lengths(true)
    off = {limb: [1000 * (ours[f"{limb}_{side}"] - theirs[f"{limb}_{side}"]) for side in "lr"] for limb in WRONG}
    return "   ".join(f"{limb} {left:+5.1f} {right:+5.1f} mm" for limb, (left, right) in off.items())


if __name__ == "__main__":
    main()
