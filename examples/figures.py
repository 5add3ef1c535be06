"""What the figures share: people of the demo clips in their garments, poses, drapes, and panels side by side."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import numpy as np
from mocapflow_bodies.scanned import Scanned
from mocapflow_fitting.start_from_file import StartFromFile
from mocapflow_report import drawing

from mocapflow import (
    ClothedModel,
    Draper,
    Frame,
    FrameState,
    Past,
    Pose,
    PoseBatch,
    Scene,
    load_pipeline,
    load_registry,
)
from mocapflow.help.shipped import shipped
from mocapflow.loop import settle
from mocapflow.recordings.recording import open_recording
from mocapflow.records import F64, U8
from mocapflow.timing import Stopwatch
from mocapflow.track import TIMED, CoupledLoop


def clothed(clip: str) -> Scene:
    """Return the person of a demo clip in the garment of its tape measures."""
    folder = shipped("examples", "data", clip)
    tapes = json.loads((folder / "subject" / "garment.json").read_text())
    garment = load_registry().get("garment", tapes.pop("type"))(**{f"{key}_m": value for key, value in tapes.items()})
    body = Scanned().load(folder)
    return Scene(cameras=(), body=body, garment=garment.sew(body))


def posed(scene: Scene, **degrees: float) -> Pose:
    """Return the rest pose with some joints flexed, e.g. hip_l=65."""
    flexed = {f"{joint}.flexion": np.radians(angle) for joint, angle in degrees.items()}
    return Pose(root=np.eye(4), angles=np.array([flexed.get(name, 0.0) for name in scene.body.screw_names]))


def draped(draper: Draper, scene: Scene, pose: Pose, **forces: float) -> F64:
    """Return the garment (W, 3) m that a draper lays on a pose, with some of its parameters set."""
    assert scene.garment is not None
    parameters = np.array([[forces.get(name, 0.0) for name in scene.garment.parameter_names]])
    poses = PoseBatch(root=pose.root[None].copy(), angles=pose.angles[None].copy())
    vertices: F64 = draper.drape(poses, parameters, Past(), scene)[0]
    return vertices


def first_frame(changes: tuple[str, ...] = ()) -> tuple[ClothedModel, Frame, FrameState]:
    """Return what the loop makes of the first frame of the skirt's demo clip.

    Args:
        changes: of the pipeline, as `--set` takes them.
    """
    pipeline = load_pipeline(shipped("pipelines", "skirt.yaml"), changes=changes)
    (loop,) = (named.stage for named in pipeline.stages if isinstance(named.stage, CoupledLoop))
    recording = open_recording(pipeline.recording, stop=1)
    body = pipeline.body.load(pipeline.recording)
    assert pipeline.garment is not None
    scene = Scene(cameras=recording.cameras, body=body, garment=pipeline.garment.sew(body))
    model = ClothedModel(scene=scene.with_background(recording.background()), draper=loop.draper)
    frame, start = recording.frame(0), StartFromFile().run(recording, scene)
    begun = loop.approach(frame, loop.begin(frame, Past(), start, model, Stopwatch(TIMED)), Past(), model)
    return model, frame, settle(frame, begun, Past(), loop.steps, model, lambda *_: None).state


def write(panels: dict[str, U8]) -> None:
    """Write panels with their titles side by side, to the path on the command line or beside the script's name."""
    for title, panel in panels.items():
        drawing.label(panel, title)
    script = Path(sys.argv[0])
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(script.with_suffix(".png").name)
    cv2.imwrite(str(path), np.hstack(list(panels.values())))
    print(path)
