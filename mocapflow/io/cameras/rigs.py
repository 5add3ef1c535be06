"""Whether a set of cameras makes sense together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry.cameras import centre, directions, magnification, pinhole, project, undistort
from mocapflow.io.findings import Finding, note, warning
from mocapflow.io.findings import error as problem
from mocapflow.records import F64, Bool

OPPOSED = 165.0  # deg between two viewing directions
NEAREST, FARTHEST = 0.3, 30.0  # m from a camera, where something to be filmed may stand
DEPTHS = np.geomspace(NEAREST, FARTHEST, 40)  # m
SAME_PLACE, SAME_TURN = 0.02, 1.0  # m and deg, within which two cameras are one
RAYS = 9  # per side of an image
AMPLE, LARGE = 350, 600  # px a metre where the person stands: what angles need, and from where on less is as good
PLACE = (
    "is its place in metres, in the world of the calibration? is rotation camera-from-world, and translation not\n"
    "the camera's position? has each camera its own name?"
)
UPRIGHT = 0.7  # length of the mean "up" of the images from which they agree on a direction


def examine_rig(cameras: Sequence[Camera]) -> Iterator[Finding]:
    """Yield what is odd about a set of cameras of known size."""
    if len(cameras) < 2:
        yield warning("there is one camera only", "depth can't be measured from one view; two or more are needed")
        return
    yield from _common_view(cameras)
    yield from _world_up(cameras)
    yield from _doubles(cameras)
    for (a, va), (b, vb) in combinations([(camera.name, camera.camera_from_world[2, :3]) for camera in cameras], 2):
        angle = np.degrees(np.arccos(np.clip(va @ vb, -1, 1)))
        if angle > OPPOSED:
            hint = "they see mirrored silhouettes and add little to each other; place them more than 15 degrees off"
            yield note(f"{a} and {b} face each other ({angle:.0f} degrees)", hint)


def examine_view(cameras: Sequence[Camera], point: F64, what: str) -> Iterator[Finding]:
    """Yield which cameras of known size don't see a point (3,) m that they should; `what` is its name."""
    blind = [camera.name for camera in cameras if not _sees(camera, point[None]).any()]
    if blind and len(blind) == len(cameras):
        yield problem(f"no camera sees {what}", PLACE)
    elif blind:
        yield warning(f"{', '.join(blind)} {'do' if len(blind) > 1 else 'does'} not see {what}", PLACE)


def examine_size(cameras: Sequence[Camera], point: F64) -> Iterator[Finding]:
    """Yield that images show a person at a point (3,) m larger than is of use."""
    shown = float(np.median([magnification(camera, point) for camera in cameras]))
    if shown > LARGE:
        hint = f"with scale: {1 / round(shown / AMPLE):.2g} in the pipeline a frame takes half the time or less"
        yield note(f"the person is large in the images, {shown:.0f} px a metre: {AMPLE} measure as well", hint)


def _doubles(cameras: Sequence[Camera]) -> Iterator[Finding]:
    """Yield which cameras stand in one place and look the same way, turned alike."""
    for one, other in combinations(cameras, 2):
        turn = one.camera_from_world[:3, :3] @ other.camera_from_world[:3, :3].T
        angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
        if np.linalg.norm(centre(one) - centre(other)) < SAME_PLACE and angle < SAME_TURN:
            hint = "one of them has the other's numbers: copy each camera's own calibration"
            yield problem(f"{one.name} and {other.name} stand in one place and look the same way", hint)


def _common_view(cameras: Sequence[Camera]) -> Iterator[Finding]:
    seen = [np.stack([_sees(other, _seen_space(camera)) for other in cameras]) for camera in cameras]
    alone = [c.name for i, (c, s) in enumerate(zip(cameras, seen, strict=True)) if not np.delete(s, i, 0).any()]
    if alone:
        yield problem(
            f"{', '.join(alone)}: no other camera sees anything of what {'they see' if len(alone) > 1 else 'it sees'}",
            "the calibrations do not belong together: check that rotation is camera-from-world, that translation is\n"
            "in metres and not the camera's position, and that no camera was moved or exchanged after calibrating",
        )
    elif not any(s.all(axis=0).any() for s in seen):
        yield warning("no point in space is seen by all cameras", "the person has to be where all cameras see")


def _seen_space(camera: Camera) -> F64:
    """Return points (P, 3) m all over what a camera sees."""
    grid = np.stack(np.meshgrid(*(np.linspace(0, n - 1, RAYS) for n in camera.size)), -1).reshape(-1, 2)
    rays = directions(undistort(grid, camera), camera)
    return (DEPTHS[:, None, None] * rays).reshape(-1, 3) + centre(camera)


def _sees(camera: Camera, points: F64) -> Bool:
    pixels = project(points, pinhole(camera))
    with np.errstate(invalid="ignore"):
        inside = (pixels >= -0.5) & (pixels <= camera.size - 0.5)
    near = np.linalg.norm(points - centre(camera), axis=1) < FARTHEST
    seen: Bool = inside[:, 0] & inside[:, 1] & near
    return seen


def _world_up(cameras: Sequence[Camera]) -> Iterator[Finding]:
    """Say where the images agree on an up that is not z, or where every camera is below the floor."""
    up = -np.mean([camera.camera_from_world[1, :3] for camera in cameras], axis=0)
    if np.linalg.norm(up) > UPRIGHT and int(np.argmax(np.abs(up))) != 2:
        axis = "xyz"[int(np.argmax(np.abs(up)))]
        hint = "the world has to be z up: turn the calibration, unless cameras lie on their sides or look far down"
        yield warning(f"the images' up is the {axis} axis of the world", hint)
    elif np.linalg.norm(up) > UPRIGHT and up[2] < 0:
        yield warning("the images' up is down in the world", "z has to point up: turn the calibration, or the videos")
    heights = [centre(camera)[2] for camera in cameras]
    if max(heights) < 0:
        low, high = min(heights), max(heights)
        hint = "the floor is z = 0 and z points up"
        yield warning(f"every camera is below the floor (heights {low:.1f} to {high:.1f} m)", hint)
