"""A small scene made by formula: two legs and a trunk of tubes, a hanging tube of cloth, cameras around it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mocapflow.components import Draper
from mocapflow.data import (
    NO_CLOTH,
    Background,
    Body,
    Camera,
    Cloth,
    Estimate,
    Frame,
    FrameState,
    GarmentMesh,
    Matches,
    Moment,
    Past,
    Pose,
    PoseBatch,
    Segmentation,
    Silhouette,
    Surface,
    empty_matches,
)
from mocapflow.geometry import twists
from mocapflow.geometry.cameras import project
from mocapflow.geometry.meshes import grid_faces
from mocapflow.model import ClothedModel
from mocapflow.records import F64, I32, U8, Bool
from mocapflow.scene import Scene

JOINTS = ("pelvis", "hip_l", "knee_l", "ankle_l", "hip_r", "knee_r", "ankle_r")
PARENTS = (-1, 0, 1, 2, 0, 4, 5)
POSITIONS = ((0, 0, 0.95), *((side * 0.1, 0, z) for side in (1, -1) for z in (0.86, 0.48, 0.09)))
HIP = (("flexion", (-1, 0, 0), -50, 145), ("abduction", (0, -1, 0), -50, 80), ("rotation", (0, 0, -1), -80, 80))
FREEDOMS = {"hip": HIP, "knee": (("flexion", (1, 0, 0), -8, 160),), "ankle": (("dorsiflexion", (-1, 0, 0), -75, 75),)}
SIZE = (320, 240)  # px
BAND = 8.0  # px


def tiny_body() -> Body:
    """Return a trunk and two legs, about 600 vertices, three closed surfaces; faces -y, its left is +x."""
    trunk = _tube(0.0, np.linspace(0.80, 1.25, 12), 0.13 + 0.03 * np.cos(np.linspace(-1.6, 4.7, 12)), 16)
    legs = [_tube(x, np.linspace(0.02, 0.88, 16), np.linspace(0.045, 0.085, 16), 12) for x in (0.1, -0.1)]
    vertices = np.concatenate([trunk[0], *(leg[0] for leg in legs)])
    starts = np.cumsum([0, len(trunk[0]), len(legs[0][0])])
    faces = np.concatenate([part[1] + start for part, start in zip([trunk, *legs], starts, strict=True)])
    skin = [_hang(trunk[0], 0), *(_hang(leg[0], hip) for leg, hip in zip(legs, (1, 4), strict=True))]
    names, axes, owners, limits = _freedoms()
    positions = np.array(POSITIONS, np.float64)
    return Body(
        vertices=vertices,
        faces=faces.astype(np.int32),
        joint_names=JOINTS,
        parents=np.array(PARENTS, np.int32),
        positions=positions,
        screw_names=names,
        twists=twists.screw(axes, positions[owners]),
        screw_joint=owners,
        limits=limits,
        rest_spread=np.full(len(names), np.inf),
        skin_joint=np.concatenate([joint for joint, _ in skin]),
        skin_weight=np.concatenate([weight for _, weight in skin]),
        cut=np.zeros(len(vertices), bool),
    )


def tiny_garment(body: Body) -> GarmentMesh:
    """Return a tube of cloth that hangs from the waist of the tiny body to the knees."""
    strands, rows = 16, 8
    turn = 2 * np.pi * np.arange(strands) / strands
    radius, height = np.linspace(0.17, 0.24, rows), np.linspace(1.05, 0.55, rows)
    flat = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    vertices = _rings(flat, radius, height)
    index = np.arange(rows * strands, dtype=np.int32).reshape(rows, strands)
    rings = np.stack([index, np.roll(index, -1, axis=1)], axis=-1).reshape(-1, 2)
    waist = np.linalg.norm(body.vertices[None] - vertices[:strands, None], axis=2).argmin(axis=1)
    return GarmentMesh(
        name="tube",
        vertices=vertices,
        faces=grid_faces(rows, strands, closed=True),
        strands=np.ascontiguousarray(index.T),
        rings=rings,
        ring_length=np.linalg.norm(vertices[rings[:, 0]] - vertices[rings[:, 1]], axis=1),
        carried_by=np.zeros(rows * strands, np.int32),
        pinned=index[0].copy(),
        pinned_to=waist.astype(np.int32),
        parameter_names=("thickness_m", "wind_cos_rad", "wind_sin_rad"),
        parameter_bounds=np.array([[0.0, 0.01], [-0.7, 0.7], [-0.7, 0.7]]),
    )


def tiny_scene(cameras: int = 4, clothed: bool = False) -> Scene:
    """Return the tiny body, dressed or not, in an empty room of even grey seen by pinhole cameras of 320 x 240 px."""
    body = tiny_body()
    room = [_room(camera).astype(np.float32) for camera in range(cameras)]
    return Scene(
        cameras=tuple(_camera(index, 2 * np.pi * (index + 0.3) / cameras) for index in range(cameras)),
        body=body,
        garment=tiny_garment(body) if clothed else None,
        background=Background(mean=tuple(room), spread=tuple(np.full_like(mean, 4.0) for mean in room)),
    )


def tiny_pose(scene: Scene, seed: int = 0, size: float = 0.15) -> Pose:
    """Return a pose of the tiny body near rest: root and angles off by about `size` rad, the root by a third in m."""
    rng = np.random.default_rng(seed)
    root = twists.exp(np.concatenate([size * rng.normal(size=3), np.zeros(3)]))
    pelvis = scene.body.positions[0]
    root[:3, 3] = pelvis - root[:3, :3] @ pelvis + size / 3 * rng.normal(size=3)
    return Pose(root=root, angles=size * rng.normal(size=len(scene.body.limits)))


class Rigid(Draper):
    """A draper for tests: the garment moves with the root, its parameters push it sideways."""

    name = "rigid"

    def drape(self, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
        """Return the rest garment at each root, leaning with the second and third parameter."""
        assert scene.garment is not None
        rest = scene.garment.vertices
        lean = (rest[:, 2].max() - rest[:, 2])[None, :, None] * np.pad(
            parameters[:, None, 1:3], ((0, 0), (0, 0), (0, 1))
        )
        moved: F64 = (rest + lean) @ np.swapaxes(poses.root[:, :3, :3], 1, 2) + poses.root[:, None, :3, 3]
        return moved


def tiny_model(scene: Scene) -> ClothedModel:
    """Return the scene with a draper that needs no plugin."""
    return ClothedModel(scene=scene, draper=Rigid() if scene.garment is not None else None)


def tiny_cloth(scene: Scene, pose: Pose) -> Cloth:
    """Return the cloth of the tiny scene at a pose, at rest."""
    parameters = np.zeros(0 if scene.garment is None else len(scene.garment.parameter_names))
    return tiny_model(scene).drape(pose, parameters, Past())


def tiny_masks(scene: Scene, pose: Pose) -> list[Bool]:
    """Return the true silhouette (240, 320) in each view."""
    surface = scene.surface(pose, tiny_cloth(scene, pose))
    return [_mask(surface, camera) for camera in scene.cameras]


def tiny_frame(scene: Scene, pose: Pose, index: int = 5) -> Frame:
    """Return noisy pictures of the scene at a pose: a bright striped person in the grey room."""
    rng = np.random.default_rng(index)
    images = []
    for number, mask in enumerate(tiny_masks(scene, pose)):
        stripes = 200 + 30 * np.sin(np.arange(SIZE[1]) / 5)[:, None, None] * np.ones((1, SIZE[0], 3))
        clean = np.where(mask[..., None], stripes * [0.6, 0.8, 1.0], _room(number))
        images.append(np.clip(clean + 4 * rng.normal(size=clean.shape), 0, 255).astype(np.uint8))
    return Frame(index=index, time=index / 30, images=tuple(images), usable=np.ones(len(images), bool))


def tiny_segmentation(scene: Scene, pose: Pose) -> Segmentation:
    """Return the true silhouettes as signed distances."""
    return Segmentation(
        silhouettes=tuple(
            Silhouette(camera=camera, layer="person", distance=_distance(mask))
            for camera, mask in enumerate(tiny_masks(scene, pose))
        )
    )


def tiny_state(scene: Scene, pose: Pose, seen: Pose | None = None) -> FrameState:
    """Return what the loop knows when it believes in `pose` while the silhouettes show `seen`."""
    cloth = tiny_cloth(scene, pose)
    unknowns = 6 + len(pose.angles) + len(cloth.parameters)
    estimate = Estimate(pose=pose, parameters=cloth.parameters, covariance=1e-4 * np.eye(unknowns))
    return FrameState(
        estimate=estimate, cloth=cloth, segmentation=tiny_segmentation(scene, seen or pose), matches=empty_matches()
    )


def tiny_past(scene: Scene, *poses: Pose) -> Past:
    """Return a past of poses at 30 a second, the last one at frame 4."""
    first = 5 - len(poses)
    return Past(
        moments=tuple(
            Moment(time=(first + k) / 30, pose=pose, cloth=tiny_cloth(scene, pose)) for k, pose in enumerate(poses)
        )
    )


def exact_matches(scene: Scene, seen: Pose) -> Matches:
    """Return every third body vertex of the true pose paired with its picture in every view."""
    surface = scene.surface(seen, NO_CLOTH)
    vertex = np.arange(0, len(scene.body.vertices), 3, dtype=np.int32)
    pixels = [project(surface.vertices[vertex], camera) for camera in scene.cameras]
    count = len(vertex) * len(scene.cameras)
    return Matches(
        camera=np.repeat(np.arange(len(scene.cameras), dtype=np.int16), len(vertex)),
        pixel=np.concatenate(pixels),
        direction=np.zeros((count, 2)),
        vertex=np.tile(vertex, len(scene.cameras)),
        weight=np.ones(count),
    )


def without_view(frame: Frame, camera: int) -> Frame:
    """Return a frame in which one view is lost."""
    usable = frame.usable.copy()
    usable[camera] = False
    images = tuple(np.zeros_like(image) if k == camera else image for k, image in enumerate(frame.images))
    return replace(frame, images=images, usable=usable)


def without_silhouette(segmentation: Segmentation, camera: int) -> Segmentation:
    """Return a segmentation without one view."""
    kept = tuple(silhouette for silhouette in segmentation.silhouettes if silhouette.camera != camera)
    return replace(segmentation, silhouettes=kept)


def _rings(flat: F64, radius: F64, height: F64) -> F64:
    around = radius[:, None, None] * flat
    level = np.broadcast_to(height[:, None, None], (*around.shape[:2], 1))
    stacked: F64 = np.concatenate([around, level], axis=2).reshape(-1, 3)
    return stacked


def _tube(x: float, height: F64, radius: F64, around: int) -> tuple[F64, I32]:
    """Return a closed upright tube about (x, 0): rings from below, then the two caps."""
    turn = 2 * np.pi * np.arange(around) / around
    rings = _rings(np.stack([np.cos(turn), np.sin(turn)], axis=1), radius, height) + [x, 0, 0]
    ends = np.array([[x, 0, height[0]], [x, 0, height[-1]]])
    low, high = len(rings), len(rings) + 1
    here = np.arange(around)
    ahead, top = np.roll(here, -1), low - around
    sides = grid_faces(len(height), around, closed=True)[:, ::-1]
    bottom = np.stack([np.full(around, low), ahead, here], axis=1)
    lid = np.stack([np.full(around, high), top + here, top + ahead], axis=1)
    return np.concatenate([rings, ends]), np.concatenate([sides, bottom, lid]).astype(np.int32)


def _hang(vertices: F64, hip: int) -> tuple[I32, F64]:
    """Return skin joints and weights (V, 5): the trunk on the pelvis, a leg blended at knee and ankle."""
    joints, weights = np.zeros((len(vertices), 5), np.int32), np.zeros((len(vertices), 5))
    weights[:, 0] = 1.0
    if hip:
        thigh, foot = (np.clip(0.5 + (vertices[:, 2] - z) / 0.1, 0, 1) for z in (0.48, 0.09))
        joints[:, :3] = [hip, hip + 1, hip + 2]
        weights[:, :3] = np.stack([thigh, (1 - thigh) * foot, (1 - thigh) * (1 - foot)], axis=1)
    return joints, weights


def _freedoms() -> tuple[tuple[str, ...], F64, I32, F64]:
    rows = [(f"{joint}.{row[0]}", index, *row[1:]) for index, joint in enumerate(JOINTS)
            for row in FREEDOMS.get(joint[:-2], ())]  # fmt: skip
    names = tuple(row[0] for row in rows)
    owners = np.array([row[1] for row in rows], np.int32)
    return names, np.array([row[2] for row in rows], np.float64), owners, np.radians([row[3:] for row in rows])


def _camera(index: int, azimuth: float) -> Camera:
    target = np.array([0.0, 0.0, 0.65])
    forward = -np.array([np.cos(azimuth), np.sin(azimuth), 0.1])
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    camera_from_world[:3, 3] = -camera_from_world[:3, :3] @ (target - 3 * forward)
    return Camera(
        name=f"cam{index + 1:02}",
        size=np.array(SIZE, np.int32),
        intrinsics=np.array([[400.0, 0, 159.5], [0, 400.0, 119.5], [0, 0, 1]]),
        distortion=np.zeros(5),
        camera_from_world=camera_from_world,
    )


def _room(camera: int) -> F64:
    """Return the empty room (240, 320, 3): a soft pattern, another one in each view."""
    row, column = np.mgrid[: SIZE[1], : SIZE[0]]
    pattern: F64 = 90 + 15 * np.sin(row / 23 + camera)[..., None] + 10 * np.cos(column / 17)[..., None] * [1, 0.5, 0.2]
    return pattern


def _mask(surface: Surface, camera: Camera) -> Bool:
    import cv2

    corners = np.round(project(surface.vertices, camera)[surface.faces] * 16).astype(np.int32)
    mask: U8 = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    for corner in corners:
        cv2.fillConvexPoly(mask, corner, 1, cv2.LINE_8, 4)
    return mask > 0


def _distance(mask: Bool) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    import cv2

    inside = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    outside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    signed = np.where(mask, inside - 0.5, 0.5 - outside)
    return np.clip(signed, -BAND, BAND).astype(np.float32)
