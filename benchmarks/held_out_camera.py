"""Do forces fitted on three cameras explain the fourth? Share of frames where they lower its silhouette error.

`OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/held_out_camera.py [RECORDING [FRAMES]]`. The person is
tracked by skirt.yaml or shorts.yaml; at these poses each cloth fitter, `sampled_forces` and `gauss_newton`, sees all
silhouettes but one. The error in that view is the number of pixels in which the silhouettes of model and person differ.
Calm cloth, without forces, has to be beaten: as thick and as short as the fitted one, for these are no forces, and,
printed second, of no thickness and as sewn.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from clothed import pipeline_for
from mocapflow_draping.sampled_forces import SampledForces
from mocapflow_draping.take_up import TakeUp
from mocapflow_twist.gauss_newton import GaussNewton

from mocapflow.components import ClothFitter
from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import Cloth, Frame, FrameState, Moment, Past, Segmentation, Turn
from mocapflow.geometry import silhouettes
from mocapflow.geometry.sewing import TAKE_UP, THICKNESS
from mocapflow.help.shipped import shipped
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import open_recording
from mocapflow.records import F64
from mocapflow.running.runner import run
from mocapflow.scene import Scene

RECORDING = shipped("examples", "data", "skirt_steps")
TRACK_ONLY = tuple(f"stages.{stage}=null" for stage in ("smooth", "export", "evaluate", "overlay", "virtual", "report"))
TURN = Turn(index=0)


def main() -> None:
    recording = Path(sys.argv[1]) if len(sys.argv) > 1 else RECORDING
    states, model = tracked(recording, int(sys.argv[2]) if len(sys.argv) > 2 else 60)
    for fitter in (SampledForces(), GaussNewton()):
        every = []
        for view, camera in enumerate(model.scene.cameras):
            every.append(errors(fitter, states, model, view))
            tell(f"{fitter.name:15} {camera.name}", every[-1])
        tell(f"{fitter.name:15} all together", np.sum(every, axis=0))


def tell(what: str, found: F64) -> None:
    """Print on how many frames, and by how much in all, the last of the errors (3, T) is less than the others."""
    *calm, fitted = found
    gains = [f"{np.mean(fitted < each):4.0%} of frames ({fitted.sum() / each.sum() - 1:+.0%})" for each in calm]
    print(f"{what}: better on {', thin: '.join(gains)}; {fitted.sum():.0f} px wrong", flush=True)


def tracked(recording: Path, frames: int) -> tuple[list[FrameState], ClothedModel]:
    """Return what is known of each frame, and the model."""
    pipeline = load_pipeline(pipeline_for(recording), recording=recording, changes=TRACK_ONLY, frames=slice(0, frames))
    states: list[FrameState] = []
    observers: Any = pipeline.registry.observers
    observers.frame_done = lambda index, result: states.append(result.state)
    with tempfile.TemporaryDirectory() as folder:
        run(pipeline, store=Path(folder) / "store.zarr", out=Path(folder) / "run")
    assert pipeline.garment is not None
    body, loop = pipeline.body.load(recording), next(s.stage for s in pipeline.stages if s.label == "track")
    scene = Scene(cameras=open_recording(recording).cameras, body=body, garment=pipeline.garment.sew(body))
    return states, ClothedModel(scene=scene, draper=loop.draper)


def errors(fitter: ClothFitter, states: Sequence[FrameState], model: ClothedModel, view: int) -> F64:
    """Return the error (3, T) px of one view with calm cloth, with thin calm cloth, and with what fits the others."""
    past, found = Past(), []
    parameters, garment = np.zeros(len(states[0].cloth.parameters)), model.scene.garment
    assert garment is not None
    lasting = np.array([name in (THICKNESS, TAKE_UP) for name in garment.parameter_names])
    for index, state in enumerate(states):
        frame = Frame(index=index, time=index / 30, images=(), usable=np.empty(0, bool))  # fitters read silhouettes
        others = tuple(s for s in state.segmentation.of("person") if s.camera != view)
        estimate, seen = replace(state.estimate, parameters=parameters), Segmentation(silhouettes=others)
        short = TakeUp().fit(frame, seen, estimate, model, past, TURN)
        cloth = fitter.fit(frame, seen, replace(estimate, parameters=short.parameters), model, past, TURN)
        past = past.after(Moment(time=frame.time, pose=estimate.pose, cloth=cloth), {})
        parameters = cloth.parameters
        calm = [model.drape(estimate.pose, each, past) for each in (lasting * parameters, 0 * parameters)]
        found.append([differing(state, each, model, view) for each in (*calm, cloth)])
    return np.array(found, float).T


def differing(state: FrameState, cloth: Cloth, model: ClothedModel, view: int) -> int:
    """Return how many pixels of a view only one of the two silhouettes covers."""
    seen = next(s for s in state.segmentation.of("person") if s.camera == view)
    camera, surface = model.scene.cameras[view], model.surface(state.estimate.pose, cloth)
    covered = silhouettes.covered(surface, camera)
    return int(np.count_nonzero(covered != (seen.distance > 0)))


if __name__ == "__main__":
    main()
