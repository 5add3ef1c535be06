"""Every type that travels between steps.

Conventions, everywhere: SI units inside, pixels for images, radians; world right-handed, z up; images indexed
[row = y, column = x] with pixel centres on integers; transforms read `a_from_b`; column vectors, active
transforms; twists are (omega, v). Lens distortion is removed when a frame is decoded, so every `Frame` and the
cameras of a `Scene` are pinhole. Pose increments (omega, v) are left-multiplied, in the world frame.

Axis names: C cameras, V body vertices, F faces, J joints, D screws (the angles), W cloth vertices, Q cloth
parameters, M matches, T frames, S = 6 + D + Q unknowns of a frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.records import F32, F64, I16, I32, U8, Bool, array, record

BODY, CLOTH, LANDMARK = 0, 1, 2  # values of Surface.layer
BORDER = 3  # px along the image border where a silhouette is cut, not occluding


@record
class Camera:
    """A calibrated camera; distortion is OpenCV's k1 k2 p1 p2 k3 (fisheye: k1 k2 k3 k4 0)."""

    name: str
    size: I32 = array(2, unit="px, width and height")
    intrinsics: F64 = array(3, 3, unit="px")
    distortion: F64 = array(5, unit="1")
    camera_from_world: F64 = array(4, 4, unit="m")
    fisheye: bool = False


@record
class Flow:
    """Points tracked from the previous frame into this one, in one view."""

    pixel: F32 = array("P", 2, unit="px, in the previous frame")
    displacement: F32 = array("P", 2, unit="px")


@record
class Rig:
    """The pinhole cameras of a scene, where a stage has corrected them."""

    cameras: tuple[Camera, ...]


@record
class Frame:
    """One moment, seen by every camera."""

    index: int
    time: float  # s
    images: tuple[U8, ...]  # C x (H, W, 3) BGR, undistorted
    usable: Bool = array("C", unit="False: lost or corrupted view")
    reasons: tuple[str, ...] = ()  # why a view is not usable, "" where it is; empty: all usable
    flow: tuple[Flow | None, ...] | None = None
    keypoints: tuple[F64, ...] | None = None  # C x (N people, K, 3) px, px, confidence; undistorted


@record
class Body:
    """A body at rest: triangle mesh, kinematic chain of zero-pitch screws, linear blend skinning (an asset).

    Joints are ordered parents first and the screws of a joint stand together, in the order of the joints.
    """

    vertices: F64 = array("V", 3, unit="m, at rest")
    faces: I32 = array("F", 3, unit="vertex index, outward by the right hand")
    joint_names: tuple[str, ...]
    parents: I32 = array("J", unit="joint index, -1 for the root")
    positions: F64 = array("J", 3, unit="m, at rest")
    screw_names: tuple[str, ...]  # e.g. knee_l.flexion
    twists: F64 = array("D", 6, unit="unit twists (omega, v) at rest")
    screw_joint: I32 = array("D", unit="joint index")
    limits: F64 = array("D", 2, unit="rad")
    rest_spread: F64 = array("D", unit="rad, standard deviation about zero; inf where free")
    skin_joint: I32 = array("V", 5, unit="joint index")
    skin_weight: F64 = array("V", 5, unit="1, rows sum to one")
    cut: Bool = array("V", unit="True on the rim where a partial body was cut off")
    morph_offset: F64 | None = array("V", 3, unit="m, added at rest in full where the morph is complete", default=None)
    morph_screw: int = -1  # the angle that drives the morph
    morph_range: tuple[float, float] = (0.0, 1.0)  # rad, where the morph begins and where it is complete

    def joint(self, name: str) -> int:
        """Return the index of a joint by name."""
        return self.joint_names.index(name)


@record
class GarmentMesh:
    """A garment at rest on the rest body (an asset)."""

    name: str
    vertices: F64 = array("W", 3, unit="m, at rest")
    faces: I32 = array("G", 3, unit="vertex index")
    strands: I32 = array("N", "L", unit="vertex index from the pinned end, -1 padded")
    rings: I32 = array("E", 2, unit="vertex index: links around the garment")
    ring_length: F64 = array("E", unit="m, rest length of each link")
    carried_by: I32 = array("W", unit="joint that moves the vertex before the drape")
    pinned: I32 = array("P", unit="vertex index")
    pinned_to: I32 = array("P", unit="body vertex index")
    parameter_names: tuple[str, ...]
    parameter_bounds: F64 = array("Q", 2, unit="unit of the parameter")


@record
class Background:
    """The empty scene, per camera: mean and spread of every pixel."""

    mean: tuple[F32, ...]  # C x (H, W, 3) grey levels
    spread: tuple[F32, ...]  # C x (H, W, 3) grey levels, standard deviation


@record
class Pose:
    """Root transform and joint angles of one moment."""

    root: F64 = array(4, 4, unit="m, world_from_body")
    angles: F64 = array("D", unit="rad")


@record
class PoseBatch:
    """B poses of one body."""

    root: F64 = array("B", 4, 4, unit="m, world_from_body")
    angles: F64 = array("B", "D", unit="rad")


@record
class Cloth:
    """The draped garment and the parameters (with forces) that draped it; empty without a garment."""

    vertices: F64 = array("W", 3, unit="m, world")
    parameters: F64 = array("Q", unit="by name, see GarmentMesh.parameter_names")


NO_CLOTH = Cloth(vertices=np.empty((0, 3)), parameters=np.empty(0))


@record
class Surface:
    """Posed triangle mesh in world coordinates: body vertices first, then cloth.

    `joints` and `screws` say how body vertices move: the skin of joint j moves with `joints[j]`, and a unit
    change of angle d moves everything below its joint by the world twist `screws[d]`.
    """

    vertices: F64 = array("N", 3, unit="m")
    faces: I32 = array("F", 3, unit="vertex index")
    edges: I32 = array("E", 4, unit="two vertices, then the faces left and right of the way between them, or -1")
    layer: U8 = array("N", unit="0 body, 1 cloth, 2 landmark")
    joints: F64 = array("J", 4, 4, unit="m, world_from_rest")
    screws: F64 = array("D", 6, unit="twist (omega, v) in the world")

    @cached_property
    def normals(self) -> F64:
        """Unit vertex normals (N, 3)."""
        from mocapflow.geometry.meshes import vertex_normals  # compiled code, loaded where it is used

        return vertex_normals(self.vertices, self.faces)


@record
class Contour:
    """The occluding contour of a surface in one view: evenly spaced points on the boundary of its silhouette.

    A point lies on an edge of the mesh; `vertex` is the nearer end of that edge and `anchor` where it projects.
    """

    vertex: I32 = array("K", unit="surface vertex index")
    anchor: F64 = array("K", 2, unit="px, image of the vertex")
    pixel: F64 = array("K", 2, unit="px")
    normal: F64 = array("K", 2, unit="1, unit, out of the silhouette")


@record
class Silhouette:
    """A signed distance to the outline in one view, positive inside, clipped to a band; mask = distance > 0."""

    camera: int
    layer: str  # person, garment or skin
    distance: F32 = array("H", "W", unit="px")

    @cached_property
    def zero_level(self) -> tuple[F64, F64]:
        """The image contour: pixels (K, 2) sorted by row, and unit normals (K, 2) out of the silhouette."""
        from mocapflow.geometry.contours import zero_crossings  # compiled code, loaded where it is used

        return zero_crossings(self.distance, BORDER)


@record
class Segmentation:
    """The silhouettes of one frame, one per usable view and layer, and what they cost."""

    silhouettes: tuple[Silhouette, ...]
    energies: Mapping[str, float] = field(default_factory=dict)
    appearance: Mapping[str, F64] = field(default_factory=dict)  # region statistics for the next frame


@record
class Matches:
    """Image points paired with surface vertices.

    Where `direction` is a unit vector, only the distance along it counts (a point on a contour may slide along
    the contour); where it is zero, the full displacement counts.
    """

    camera: I16 = array("M", unit="camera index")
    pixel: F64 = array("M", 2, unit="px, undistorted")
    direction: F64 = array("M", 2, unit="1")
    vertex: I32 = array("M", unit="surface vertex index")
    weight: F64 = array("M", unit="px^-2, one over the variance, robust factor included")


@record
class Residual:
    """What a prior adds to the pose equations; the columns are (omega, v, angles) and, if wider, cloth."""

    error: F64 = array("K", unit="1, whitened")
    jacobian: F64 = array("K", "S", unit="1 per m, rad or parameter")
    energy: float  # what accept or reject compares: half the squared error, or -log p


@record
class Estimate:
    """Pose and cloth parameters with their covariance; increments as everywhere."""

    pose: Pose
    parameters: F64 = array("Q", unit="by name")
    covariance: F64 = array("S", "S", unit="of (omega, v, angles, parameters)")
    energies: Mapping[str, float] = field(default_factory=dict)


@record
class FrameState:
    """One turn of the loop: what is known of a frame so far."""

    estimate: Estimate
    cloth: Cloth
    segmentation: Segmentation
    matches: Matches


@record
class Change:
    """How far one turn moved the solution."""

    surface: float  # m, largest move of a surface vertex
    body: float  # m, largest move of a body vertex: cloth may swing while the body rests
    angles: float  # rad, largest change of a joint angle


@record
class Turn:
    """Where the loop stands: schedules (coarse to fine, shares) read it."""

    index: int
    cap: int
    change: Change | None = None


@record
class FrameResult:
    """What the loop hands over for one frame."""

    state: FrameState
    iterations: int
    steady: bool
    oscillating: bool
    change: Change
    overlap: F64 = array("C", unit="1, intersection over union of model and image silhouette; NaN where unseen")
    seconds: Mapping[str, float] = field(default_factory=dict)  # CPU time of each step; never part of a result


@record
class Moment:
    """A committed frame, as later frames may know it."""

    time: float  # s
    pose: Pose
    cloth: Cloth


@record
class Past:
    """Everything a frame may know of earlier frames: the last two, latest last, and the last appearance."""

    moments: tuple[Moment, ...] = ()
    appearance: Mapping[str, F64] = field(default_factory=dict)

    def after(self, moment: Moment, appearance: Mapping[str, F64]) -> Past:
        """Return the past one frame later."""
        return Past(moments=(*self.moments, moment)[-2:], appearance=appearance)


@record
class Start:
    """Pose and cloth parameters of the first frame."""

    pose: Pose
    parameters: F64 = array("Q", unit="by name")


@record
class Track:
    """The result over T frames."""

    frame: I32 = array("T", unit="frame index in the videos")
    time: F64 = array("T", unit="s")
    root: F64 = array("T", 4, 4, unit="m, world_from_body")
    angles: F64 = array("T", "D", unit="rad")
    covariance: F64 = array("T", "R", "R", unit="of (omega, v, angles)")
    cloth: F64 = array("T", "W", 3, unit="m")
    cloth_parameters: F64 = array("T", "Q", unit="by name")
    iterations: I16 = array("T", unit="turns of the loop")
    steady: Bool = array("T", unit="True where the loop came to rest")
    usable: Bool = array("T", "C", unit="False: lost or corrupted view")
    overlap: F64 = array("T", "C", unit="1, intersection over union of model and image silhouette")
    seconds: F64 = array("T", "K", unit="s of CPU per step of the loop")
    step_names: tuple[str, ...]  # the K steps
    notes: tuple[str, ...] = ()  # what happened to frames, e.g. "frame 12: cam02 black"
    raw_root: F64 | None = array("T", 4, 4, unit="m, world_from_body, before smoothing", default=None)
    raw_angles: F64 | None = array("T", "D", unit="rad, before smoothing", default=None)

    def pose(self, row: int) -> Pose:
        """Return the pose of one row."""
        return Pose(root=self.root[row].copy(), angles=self.angles[row].copy())


@record
class RunFolder:
    """Where a run writes its results, and how it was made."""

    path: Path
    recipe: Mapping[str, Any]  # pipeline, settings, versions, and per finished stage: key, cached, seconds


@record
class Files:
    """Files written into the run folder; a stage that returns them always runs."""

    paths: tuple[Path, ...]


@record
class Evaluation:
    """One row per compared angle; a stage that returns it always runs."""

    reference: str  # the file compared with, "" where there is none
    rows: tuple[Mapping[str, float | str], ...]
    note: str = ""  # why there are no rows


def empty_matches() -> Matches:
    """Return matches without any pair."""
    pixels = np.empty((0, 2))
    return Matches(
        camera=np.empty(0, np.int16),
        pixel=pixels,
        direction=pixels.copy(),
        vertex=np.empty(0, np.int32),
        weight=np.empty(0),
    )
