"""A picture of a garment: at rest, draped, and laid flat with its measures."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.config.documents import Document, Place
from mocapflow.config.measures import garment_of, wearer
from mocapflow.config.resolve import Resolver
from mocapflow.data import Past, Pose
from mocapflow.dressing.guards import mesh_of
from mocapflow.dressing.roles import Draper, Garment
from mocapflow.errors import RecordingError, StoreError
from mocapflow.help.shipped import shipped
from mocapflow.io.paths import for_opencv
from mocapflow.model import ClothedModel
from mocapflow.records import F64, U8
from mocapflow.registry import Registry
from mocapflow.running.component_failures import naming_failures
from mocapflow.scene import Scene

CLIPS = ("skirt_steps", "shorts_steps")
RAISED = {"hip_l.flexion": 65.0, "knee_l.flexion": 70.0}  # deg


def draw_garment(registry: Registry, name: str, recording: Path | None, draper: str, out: Path) -> list[str]:
    """Write the picture of a garment on the person of a recording, or the template, and return lines to print.

    Raises:
        MocapflowError: the recording is not there, the garment needs measures that it does not have, or can't be sewn
            from them; or the draper can't be made.
        ComponentFailed: the garment or the draper raised, or returned what is none; the traceback lies beside `out`.
        StoreError: the picture can't be written.
    """
    import cv2

    recording = recording or _example(name)
    if not recording.is_dir():
        raise RecordingError("no such recording folder", where=str(recording))
    resolver = Resolver(Document({}, {(): Place(f"show garment {name}", Path())}), registry)
    garment: Any = garment_of(name, recording, resolver)
    lays = resolver.component("draper", draper, ())
    with naming_failures(garment, registry, out.with_suffix(".log")):
        body, scanned = wearer(recording, registry)
        scene = Scene(cameras=(), body=body, garment=mesh_of(garment, body))
        image = poster(scene, garment, lays)
    file = for_opencv(out)
    with suppress(OSError):
        out.parent.mkdir(parents=True, exist_ok=True)
    if not (out.parent.is_dir() and cv2.haveImageWriter(file) and cv2.imwrite(file, image)):
        hint = "--out names a .png, in a folder that may be written"
        raise StoreError("the picture can't be written", where=str(out), hint=hint)
    assert scene.garment is not None
    count, strands = len(scene.garment.vertices), len(scene.garment.strands)
    wears = recording.name if scanned else "the template"
    sewn = f"sewn on {wears}: {count} vertices in {strands} strands; picture: {out}"
    return [*(f"warning: {said}" for said in scene.warnings), sewn]


def poster(scene: Scene, garment: Garment, draper: Draper) -> U8:
    """Return the image (H, W, 3) BGR: rest from two sides, draped standing and with a knee raised, the pattern."""
    from mocapflow_report import drawing, portrait

    assert scene.garment is not None
    standing, raised = _pose(scene, {}), _pose(scene, RAISED)
    panels = {
        "at rest, from the front": portrait.portrait(scene, standing, scene.garment.vertices, bearing_deg=0),
        "at rest, from behind": portrait.portrait(scene, standing, scene.garment.vertices, bearing_deg=145),
        "draped": portrait.portrait(scene, standing, _draped(draper, scene, standing)),
        "draped, knee raised": portrait.portrait(scene, raised, _draped(draper, scene, raised), opacity=0.8),
    } | {f"pattern of {piece.name}": portrait.pattern(piece) for piece in scene.garment.pieces or (scene.garment,)}
    for title, panel in panels.items():
        drawing.label(panel, title)
    image = np.hstack(list(panels.values()))
    measures = [f"{key} {value:g}" for key, value in garment.model_dump().items() if key.endswith("_m")]
    drawing.note(image, f"{garment.name}: {', '.join(measures)}" if measures else garment.name, (8, image.shape[0] - 8))
    return image


def _draped(draper: Draper, scene: Scene, pose: Pose) -> F64:
    return ClothedModel(scene=scene, draper=draper).drape(pose, scene.neutral_parameters, Past()).vertices


def _pose(scene: Scene, degrees: dict[str, float]) -> Pose:
    names = scene.body.screw_names
    return Pose(root=np.eye(4), angles=np.array([np.radians(degrees.get(name, 0.0)) for name in names]))


def _example(name: str) -> Path:
    """Return the shipped clip whose person wears such a garment, or the first."""
    clips = [shipped("examples", "data", clip) for clip in CLIPS]
    worn = {json.loads((clip / "subject" / "garment.json").read_text())["type"]: clip for clip in clips}
    return worn.get(name, clips[0])
