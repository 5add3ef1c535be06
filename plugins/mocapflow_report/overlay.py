"""Stage `overlay`: outline and skeleton of the model on every image."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from mocapflow_export import layout

from mocapflow.assets import Camera
from mocapflow.components import Stage
from mocapflow.data import CLOTH, NO_CLOTH, Frame, Pose, Surface
from mocapflow.geometry import cameras, kinematics, meshes, silhouettes
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, I32, U8
from mocapflow.results import Files, RunFolder, Track, ViewChecks, rows_with_frames
from mocapflow.scene import Scene
from mocapflow_report import drawing

LEAST_HEIGHT = 600  # px; smaller images are enlarged so that lines can be told apart


class Overlay(Stage):
    """Writes overlay/<camera>.mp4: body outline, garment outline and skeleton on the undistorted images.

    The outline of the body is drawn where the garment hides it, too. One frame is in memory at a time. `vp09`
    plays in browsers but takes about twenty times as long to write as `mp4v`.
    """

    name: ClassVar[str] = "overlay"
    codec: Literal["mp4v", "vp09"] = "mp4v"  # vp09 plays in browsers, mp4v is fast

    def run(
        self,
        track: Track,
        scene: Scene,
        recording: Recording,
        run_folder: RunFolder,
        checks: ViewChecks | None = None,
    ) -> Files:
        """Write one video per view and return their paths."""
        paths = [layout.place(run_folder.path, layout.overlay(camera.name)) for camera in scene.cameras]
        painter = Painter(scene)
        with drawing.videos(paths, recording.run_rate, self.codec) as opened:
            for row, frame in rows_with_frames(track, recording.frames(), checks):
                for video, image in zip(opened, painter.paint(frame, track, row), strict=True):
                    video.write(image)
        return Files(paths=tuple(paths))


class Painter:
    """Draws the model of one row of a track onto a view."""

    def __init__(self, scene: Scene) -> None:
        self._cameras = scene.cameras
        self._bare = scene.undressed
        self._cloth_faces = np.empty((0, 3), np.int32) if scene.garment is None else scene.garment.faces
        self._cloth_edges = meshes.edges(self._cloth_faces)

    def paint(self, frame: Frame, track: Track, row: int) -> list[U8]:
        """Return the image (H, W, 3) of each view, enlarged if small, with the model drawn on it."""
        pose = track.pose(row)  # of all views: they share the surface that is posed so
        return [self._painted(frame, track, row, view, pose) for view in range(len(self._cameras))]

    def _painted(self, frame: Frame, track: Track, row: int, view: int, pose: Pose) -> U8:
        import cv2

        camera, image = self._cameras[view], np.array(frame.images[view])
        factor = -(-LEAST_HEIGHT // image.shape[0])
        if factor > 1:
            image = np.asarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC), np.uint8)
        self.draw(image, camera, factor, pose, track.cloth[row])
        drawing.label(image, f"{camera.name}  frame {frame.index}")
        for line, text in enumerate(_remarks(frame, track, row, view)):
            drawing.label(image, text, line + 1)
        return image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2].copy()  # codecs want even sizes

    def draw(self, image: U8, camera: Camera, enlarged: float, pose: Pose, cloth: F64) -> None:
        """Draw outlines and skeleton of a pose and its cloth (W, 3) m into an image, enlarged from the camera's."""
        camera = cameras.scaled(camera, enlarged)
        thick = max(1, round(image.shape[0] / 800))
        body = self._bare.surface(pose, NO_CLOTH)
        drawing.segments(image, silhouettes.outline(body, camera).pixel, drawing.BODY, thick)
        if len(self._cloth_faces) and len(cloth):
            surface = _cloth_surface(cloth, self._cloth_faces, self._cloth_edges, body)
            drawing.segments(image, silhouettes.outline(surface, camera).pixel, drawing.CLOTH, thick)
        places = kinematics.joint_positions(self._bare.body, body.joints)
        pixels = cameras.project(places, camera)
        drawing.segments(image, drawing.bones(self._bare.body.parents, pixels), drawing.BONE, thick)
        drawing.dots(image, pixels, drawing.JOINT, 2.0 * thick)


def _cloth_surface(vertices: F64, faces: I32, edges: I32, body: Surface) -> Surface:
    layer = np.full(len(vertices), CLOTH, np.uint8)
    return Surface(
        vertices=vertices.copy(), faces=faces, edges=edges, layer=layer, joints=body.joints, screws=body.screws
    )


def _remarks(frame: Frame, track: Track, row: int, view: int) -> list[str]:
    """Return what a viewer should know of a view: no image or a wrong one, a lost frame, a fit in doubt."""
    said = []
    if not frame.usable[view]:
        said.append(f"no image: {frame.reasons[view]}" if frame.reasons else "no image")
    elif not track.usable[row, view]:
        said.append("not used: this picture was not trusted")
    if track.lost[row]:
        said.append("frame lost, bridged")
    if track.doubted[row]:
        said.append("doubted: images or keypoints contradict this pose")
    return said
