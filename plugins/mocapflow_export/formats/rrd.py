"""Rerun: cameras, images, outlines, body, garment and angles on one timeline."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.geometry import silhouettes
from mocapflow.results import rows_with_frames
from mocapflow_export.formats.result import Result, library

BODY, GARMENT, OUTLINE = (200, 160, 135), (60, 120, 130), (255, 200, 0)
QUALITY = 80  # of the images, per cent
DOT = 0.012  # m, radius of a joint
CENTRE = 0.5  # px, where Rerun has the centre of the first pixel; ours are at whole numbers


def write(result: Result, path: Path) -> None:
    """Write a recording that `rerun` and `mocapflow view` open; one frame is in memory at a time."""
    rr = library("rerun", "view")
    stream = rr.RecordingStream("mocapflow")
    stream.save(str(path))
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    log_cameras(rr, stream, result)
    for row, frame in rows_with_frames(result.track, result.recording.frames(), result.checks):
        stream.set_time("time", duration=frame.time)
        stream.set_time("frame", sequence=frame.index)
        log_model(rr, stream, result, row)
        log_images(rr, stream, result, row, frame.images)
    stream.disconnect()


def log_cameras(rr: Any, stream: Any, result: Result) -> None:
    """Log where the cameras are and what lens they have."""
    for camera in result.scene.cameras:
        world_from_camera = np.linalg.inv(camera.camera_from_world)
        place = rr.Transform3D(translation=world_from_camera[:3, 3], mat3x3=world_from_camera[:3, :3])
        entity = rr.new_entity_path(["world", camera.name])
        stream.log(entity, place, static=True)
        matrix = camera.intrinsics.copy()
        matrix[:2, 2] += CENTRE
        lens = rr.Pinhole(image_from_camera=matrix, resolution=camera.size, camera_xyz=rr.ViewCoordinates.RDF)
        stream.log(entity, lens, static=True)


def log_model(rr: Any, stream: Any, result: Result, row: int) -> None:
    """Log body, garment, stick model and angles of a row."""
    scene, track = result.scene, result.track
    body = result.bare(row)
    skin = rr.Mesh3D(
        vertex_positions=body.vertices, triangle_indices=body.faces, vertex_normals=body.normals, albedo_factor=BODY
    )
    stream.log("world/body", skin)
    if scene.garment is not None and track.cloth.shape[1]:
        cloth = rr.Mesh3D(
            vertex_positions=track.cloth[row], triangle_indices=scene.garment.faces, albedo_factor=GARMENT
        )
        stream.log("world/garment", cloth)
    bones = [[result.places[row, p], result.places[row, j]] for j, p in enumerate(scene.body.parents) if p >= 0]
    stream.log("world/skeleton", rr.LineStrips3D(bones))
    names = list(scene.body.joint_names)
    stream.log("world/joints", rr.Points3D(result.places[row], labels=names, show_labels=False, radii=DOT))
    for name, value in zip(result.angles.names, result.angles.value[row], strict=True):
        stream.log(f"angles/{name}", rr.Scalars(value))


def log_images(rr: Any, stream: Any, result: Result, row: int, images: Any) -> None:
    """Log the image of every view with the outline of the model on it."""
    import cv2

    track = result.track
    surface = result.surface(row)
    for camera, image, usable in zip(result.scene.cameras, images, track.usable[row], strict=True):
        shown = rr.Clear(recursive=False)  # else the viewer goes on showing the picture before
        if usable:
            _, encoded = cv2.imencode(".jpg", np.asarray(image), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
            shown = rr.EncodedImage(contents=encoded.tobytes(), media_type="image/jpeg")
        stream.log(rr.new_entity_path(["world", camera.name, "image"]), shown)
        outline = silhouettes.outline(surface, camera).pixel + CENTRE
        stream.log(rr.new_entity_path(["world", camera.name, "outline"]), rr.LineStrips2D(outline, colors=[OUTLINE]))
