"""Clean plates of a camera that was nudged afterwards: how it has turned, and what it would see of the plate now."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.records import F32, F64, U8, Bool

CORNERS, STRENGTH, SPACING_PX = 500, 0.005, 8.0  # at most; share of the strongest one's strength; apart
WINDOW_PX, LEVELS, STEPS, REST_PX = 21, 3, 30, 0.01  # that is compared; of the pyramid; at most a level; small enough
ROUND_TRIP_PX = 0.3  # from a corner to where following it there and back leads
AGREE_PX = 1.0  # a corner off the common motion belongs to the person, or to what was moved in the room
FEWEST, SHARE = 12, 0.6  # corners that have to agree
LEAST_PX = 0.5  # that the picture moves; noise of a camera at rest makes 0.3 at most


def turn_between(plate: F32, picture: F32, shown: Bool, camera: Camera) -> F64 | None:
    """Return how pixels of a plate lie in a later picture of a camera that was turned meanwhile, None if it was not.

    The result is a homography (3, 3), that of a rotation about the camera's centre: by a nudge the room comes no
    nearer. None as well where too few corners of the room tell.

    Args:
        plate: (H, W, 3) grey levels, the empty room.
        picture: (H, W, 3) the room with or without somebody, as bright.
        shown: (H, W) which of its pixels count.
        camera: a pinhole, as calibrated.
    """
    import cv2
    from scipy.spatial.transform import Rotation

    here, there = _followed(_grey(plate), _grey(picture), shown)
    if len(here) < FEWEST:
        return None
    _, agree = cv2.findHomography(here, there, cv2.RANSAC, AGREE_PX)
    inner = agree.ravel().astype(bool)
    if inner.sum() < max(FEWEST, SHARE * len(here)):
        return None
    back = np.linalg.inv(camera.intrinsics)
    before, after = (np.column_stack([p[inner], np.ones(inner.sum())]) @ back.T for p in (here, there))
    turn = camera.intrinsics @ Rotation.align_vectors(after, before)[0].as_matrix() @ back
    return turn if shift_px(turn, camera) >= LEAST_PX else None


def shift_px(turn: F64, camera: Camera) -> float:
    """Return how far the middle of a side of the picture moves at most, if pixels move by a homography (3, 3)."""
    width, height = camera.size
    ends = np.array([[0, height / 2, 1], [width, height / 2, 1], [width / 2, 0, 1], [width / 2, height, 1]])
    moved = ends @ turn.T
    return float(np.linalg.norm(moved[:, :2] / moved[:, 2:] - ends[:, :2], axis=1).max())


def as_seen(plate: F32, turn: F64) -> tuple[F32, Bool]:
    """Return a plate (H, W, 3) as the turned camera sees it, and where (H, W) it is known."""
    import cv2

    height, width = plate.shape[:2]
    moved = cv2.warpPerspective(plate, turn, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    whole = np.ones((height, width), np.float32)
    known = cv2.warpPerspective(whole, turn, (width, height), flags=cv2.INTER_LINEAR) > 1 - 1e-6
    return np.asarray(np.clip(moved, 0, 255), np.float32), np.asarray(known)


def _grey(picture: F32) -> U8:
    import cv2

    return np.asarray(cv2.cvtColor(np.clip(np.rint(picture), 0, 255).astype(np.uint8), cv2.COLOR_BGR2GRAY))


def _followed(plate: U8, picture: U8, shown: Bool) -> tuple[F32, F32]:
    """Return corners (N, 2) of a plate and where the picture has them."""
    import cv2

    corners = cv2.goodFeaturesToTrack(plate, CORNERS, STRENGTH, SPACING_PX, mask=shown.view(np.uint8), blockSize=5)
    if corners is None:
        return np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32)
    start = np.asarray(corners[:, 0], np.float32)
    there, found = _step(plate, picture, start)
    back, refound = _step(picture, plate, there)
    kept = found & refound & (np.linalg.norm(back - start, axis=1) < ROUND_TRIP_PX)
    return start[kept], there[kept]


def _step(old: U8, new: U8, points: F32) -> tuple[F32, Bool]:
    """Return where points (N, 2) px of a grey picture (H, W) are in another, and which were found."""
    import cv2

    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, STEPS, REST_PX)
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        old, new, points, np.empty_like(points), winSize=(WINDOW_PX, WINDOW_PX), maxLevel=LEVELS, criteria=stop
    )
    return np.asarray(there, np.float32), np.asarray(found).ravel().astype(bool)
