"""How a camera has turned, or was focused anew, between two pictures of a room, and what it would have seen before."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry.point_tracking import LucasKanade, track_points
from mocapflow.records import F32, F64, U8, Bool

Picture = TypeVar("Picture", U8, F32)

CORNERS, STRENGTH, SPACING_PX = 200, 0.005, 8.0  # at most; share of the strongest one's strength; apart
STEPS = LucasKanade(window_px=21, levels=3, most=30, rest_px=0.01, round_trip_px=0.3)
AGREE_PX = 1.0  # a corner off the common motion belongs to the person, or to what was moved in the room
FEWEST, SHARE = 12, 0.6  # of corners that have to agree
LEAST_PX, CLEAR = 0.5, 2.0  # by which corners of the room move, root mean square; times what the motion leaves of it


def turn_between(before: U8, after: U8, shown: Bool, camera: Camera) -> F64 | None:
    """Return how pixels of a picture of a room lie in a later one of the same camera; None where too little tells.

    The result is a homography (3, 3), that of a rotation about the camera's centre and of a lens that is focused anew:
    by a nudge the room comes no nearer. It is the identity of a camera that rests. Whoever stands or moves in the room
    does not count, as long as most of it is seen.

    Args:
        before: (H, W, 3) BGR.
        after: (H, W, 3) BGR, about as bright.
        shown: (H, W) which pixels of the first picture count.
        camera: a pinhole, as calibrated.
    """
    import cv2

    here, there = (points.astype(float) for points in _followed_corners(_grey(before), _grey(after), shown))
    if len(here) < FEWEST:
        return None
    _, agree = cv2.findHomography(here, there, cv2.RANSAC, AGREE_PX)
    inner = agree.ravel().astype(bool)
    if inner.sum() < max(FEWEST, SHARE * len(here)):
        return None
    here, there = here[inner], there[inner]
    turn = _fitted(here, there, camera)
    explained = warped_points(here, turn)
    clear_px = max(LEAST_PX, CLEAR * _rms(there - explained))
    return turn if _rms(explained - here) >= clear_px else np.eye(3)


def homography(rotation: F64, camera: Camera, zoom: float = 1.0) -> F64:
    """Return how pixels (3, 3) of a pinhole camera move if a rotation (3, 3) turns what it sees, in its own axes.

    Its focal length becomes `zoom` times as long after that.
    """
    lens = camera.intrinsics @ np.diag([zoom, zoom, 1.0])
    return np.asarray(lens @ rotation @ np.linalg.inv(camera.intrinsics), float)


def shift_px(turn: F64, camera: Camera) -> float:
    """Return how far the middle of a side of the picture moves at most, if pixels move by a homography (3, 3)."""
    width, height = camera.size
    middles = np.array([[0, height / 2], [width, height / 2], [width / 2, 0], [width / 2, height]])
    return float(np.linalg.norm(warped_points(middles, turn) - middles, axis=1).max())


def warped(picture: Picture, turn: F64) -> tuple[Picture, Bool]:
    """Return what a camera that has turned sees of a picture (H, W or H, W, 3), and where (H, W) that is known."""
    import cv2

    height, width = picture.shape[:2]
    size = (width, height)
    moved = cv2.warpPerspective(picture, turn, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    known = cv2.warpPerspective(np.ones((height, width), np.float32), turn, size) > 1 - 1e-6
    return np.clip(moved, 0, 255).astype(picture.dtype), np.asarray(known)


def warped_points(points: F64, turn: F64) -> F64:
    """Return points (..., 2 or more: px, px and what stays) of a picture where a camera that has turned sees them."""
    seen, pixels = points.copy(), np.concatenate([points[..., :2], np.ones_like(points[..., :1])], axis=-1) @ turn.T
    seen[..., :2] = pixels[..., :2] / pixels[..., 2:]
    return seen


def _fitted(here: F64, there: F64, camera: Camera) -> F64:
    """Return the homography (3, 3) of the turn and zoom that take pixels (N, 2) nearest to others."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    def motion(parameters: F64) -> F64:
        return homography(Rotation.from_rotvec(parameters[:3]).as_matrix(), camera, parameters[3])

    def off(parameters: F64) -> F64:
        return np.ravel(warped_points(here, motion(parameters)) - there)

    return motion(least_squares(off, np.array([0.0, 0.0, 0.0, 1.0]), method="lm").x)


def _rms(offsets: F64) -> float:
    return float(np.sqrt(np.square(offsets).sum(axis=1).mean()))


def _grey(picture: U8) -> U8:
    import cv2

    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))


def _followed_corners(before: U8, after: U8, shown: Bool) -> tuple[F32, F32]:
    """Return corners (N, 2) of a grey picture and where another one has them."""
    import cv2

    corners = cv2.goodFeaturesToTrack(before, CORNERS, STRENGTH, SPACING_PX, mask=shown.view(np.uint8), blockSize=5)
    if corners is None:
        return np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32)
    start = np.asarray(corners[:, 0], np.float32)
    there, kept = track_points(before, after, start, STEPS)
    return start[kept], there[kept]
