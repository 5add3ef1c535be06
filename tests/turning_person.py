"""A person who turns once around and swings the legs, which four cameras do not see for half of the time."""

import numpy as np

from mocapflow.assets import Background, Camera
from mocapflow.data import NO_CLOTH, Frame, Pose
from mocapflow.geometry import silhouettes, twists
from mocapflow.geometry.cameras import project
from mocapflow.scene import Scene
from mocapflow.testing.bodies import template_body

FRAMES, RATE = 60, 30.0  # one turn in two seconds
SIDE, DISTANCE, FOCAL = 320, 3.5, 420.0  # px, m, px: 2.7 m are seen
MIDDLE = np.array([0.0, 0.0, 1.3])  # of the room
UNSEEN = range(15, 45)
WALL, CLOTHES, BOX = 90, 200, 0  # grey levels
BEYOND = 8.0  # px around the legs
LEGS = [f"{joint}_{side}" for joint in ("hip", "knee", "ankle", "toe") for side in "lr"]
SWING = 40  # frames: legs that vanish in mid-swing come back at its end
KNEE, HIP, APART = (25.0, 16.0), (10.0, 12.0), (8.0, 0.0)  # degrees, the middle of the swing and how far it goes


def camera(index, azimuth):
    """A pinhole camera on the circle about the middle of the room."""
    forward = -np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    right = np.cross(forward, [0, 0, 1.0])
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    camera_from_world[:3, 3] = -camera_from_world[:3, :3] @ (MIDDLE - DISTANCE * forward)
    centre = (SIDE - 1) / 2
    return Camera(
        name=f"cam{index + 1:02}", size=np.array([SIDE, SIDE], np.int32), distortion=np.zeros(5),
        intrinsics=np.array([[FOCAL, 0, centre], [0, FOCAL, centre], [0, 0, 1]]), camera_from_world=camera_from_world,
    )  # fmt: skip


def scene():
    """The person of the template in a room of even grey."""
    wall = np.full((SIDE, SIDE, 3), WALL, np.float32)
    room = Background(mean=(wall,) * 4, spread=(np.full_like(wall, 2.0),) * 4)
    return Scene(
        cameras=tuple(camera(k, (k + 0.3) * np.pi / 2) for k in range(4)), body=template_body(), background=room
    )


def pose(body, index, axis):
    """The pose of a frame: turned about the middle of the body, legs apart, swinging against each other."""
    swing = np.sin(2 * np.pi * (index - UNSEEN.start) / SWING)
    angles = np.zeros(len(body.screw_names))
    for side, ahead in (("l", -swing), ("r", swing)):
        bent = {"knee_{}.flexion": KNEE, "hip_{}.flexion": HIP, "hip_{}.abduction": APART}
        for name, (middle, reach) in bent.items():
            angles[body.screw_names.index(name.format(side))] = np.radians(middle + reach * ahead)
    root = twists.exp(np.concatenate([2 * np.pi * index / FRAMES * np.asarray(axis), np.zeros(3)]))
    root[:3, 3] = MIDDLE - root[:3, :3] @ body.positions[0]
    return Pose(root=root, angles=angles)


def frame(scene, index, axis):
    """The pictures of a frame: an even person in an even room, a box before the legs while they are not seen."""
    surface = scene.surface(pose(scene.body, index, axis), NO_CLOTH)
    masks = [silhouettes.covered(surface, view) for view in scene.cameras]
    boxes = [
        around_legs(scene, surface, view) if index in UNSEEN else np.zeros((SIDE, SIDE), bool) for view in scene.cameras
    ]
    grey = [np.where(box, BOX, np.where(mask, CLOTHES, WALL)) for mask, box in zip(masks, boxes, strict=True)]
    images = tuple(np.repeat(view[..., None], 3, axis=2).astype(np.uint8) for view in grey)
    return Frame(index=index, time=index / RATE, images=images, usable=np.ones(4, bool), hidden=tuple(boxes))


def around_legs(scene, surface, view):
    """The rectangle (SIDE, SIDE) around the legs in a view."""
    legs = np.isin(np.array(scene.body.joint_names)[scene.body.skin_joint[:, 0]], LEGS)
    pixels = project(surface.vertices[legs], view)
    left, top = np.maximum(pixels.min(axis=0) - BEYOND, 0).astype(int)
    right, bottom = np.maximum(pixels.max(axis=0) + BEYOND, 0).astype(int)
    box = np.zeros((SIDE, SIDE), bool)
    box[top:bottom, left:right] = True
    return box
