"""Stage `flow`: points on the person followed from each frame of the run into the next, in every view."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveFloat

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.data import Flow, Frame
from mocapflow.geometry.point_tracking import LucasKanade, track_points
from mocapflow.recordings.recording import Recording
from mocapflow.records import F32, U8
from mocapflow.results import ImageFlow, ViewChecks

LEAST_CORNER = 0.005  # share of the best corner's strength
BLOCK = 5  # px, over which a corner is judged
REST_PX, STEPS = 0.03, 30  # a point is found when it moves by less in a step; at most so many steps a level
SPECK = 5  # px; what differs from the empty scene in less than half of such a square is noise


class FollowPoints(Stage):
    """Follows corners by pyramids of Lucas-Kanade steps, forward and back; those that do not come back are dropped.

    Where the empty scene is known, corners are looked for only if they differ from it; what hides the scene has none.
    What moves into a frame depends on no later frame.
    """

    name: ClassVar[str] = "flow"
    causal: ClassVar[bool] = True
    points: Annotated[int, Field(ge=1, le=500)] = 500  # points in a view, at most
    spacing_px: PositiveFloat = 3.0  # distance between points, at least
    window_px: Annotated[int, Field(ge=3)] = 11  # edge of the square that is compared
    levels: NonNegativeInt = 4  # levels of the pyramid: each doubles the motion that can be followed
    round_trip_px: PositiveFloat = 1.0  # how near a point has to come to where it was
    difference: PositiveFloat = 20.0  # grey levels by which a pixel has to differ from the empty scene

    def run(
        self, recording: Recording, background: Background | None = None, checks: ViewChecks | None = None
    ) -> ImageFlow:
        """Return the points followed into every frame but the first."""
        frames = recording.frames() if checks is None else map(checks.passed, recording.frames())
        parts = list(self._parts(frames, background))
        return ImageFlow(
            frame=np.concatenate([np.full(len(flow.pixel), index, np.int32) for index, _, flow in parts]),
            camera=np.concatenate([np.full(len(flow.pixel), camera, np.int16) for _, camera, flow in parts]),
            pixel=np.concatenate([flow.pixel for _, _, flow in parts]),
            displacement=np.concatenate([flow.displacement for _, _, flow in parts]),
            cameras=len(recording.views),
        )

    def _parts(self, frames: Iterable[Frame], background: Background | None) -> Iterator[tuple[int, int, Flow]]:
        """Yield frame, camera and flow of every view that this frame and the one before it both have."""
        before: Frame | None = None
        for frame in frames:
            for camera in range(len(frame.usable)):
                flow = NOTHING
                if before is not None and before.usable[camera] and frame.usable[camera]:
                    where = self._worth_following(before, background, camera)
                    flow = self.follow(before.images[camera], frame.images[camera], where)
                yield frame.index, camera, flow
            before = frame

    def follow(self, old: U8, new: U8, where: U8 | None = None) -> Flow:
        """Return corners of the old picture (H, W, 3) that are found in the new one and from there back.

        `where` (H, W) is above 0 where they are looked for; None: everywhere.
        """
        import cv2

        a, b = (np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8) for picture in (old, new))
        corners = self._corners(a, np.ones_like(a) if where is None else where)
        if corners is None:
            return NOTHING
        there, kept = track_points(
            a, b, corners, LucasKanade(self.window_px, self.levels, STEPS, REST_PX, self.round_trip_px)
        )
        return Flow(pixel=corners[kept], displacement=(there - corners)[kept])

    def _corners(self, grey: U8, mask: U8) -> F32 | None:
        """Return corners (N, 2) where the mask is set; strengths elsewhere are not worth their time."""
        import cv2

        left, top, width, height = cv2.boundingRect(mask)
        left, top, right, bottom = max(left - BLOCK, 0), max(top - BLOCK, 0), left + width + BLOCK, top + height + BLOCK
        part = slice(top, bottom), slice(left, right)
        found = cv2.goodFeaturesToTrack(
            grey[part], self.points, LEAST_CORNER, self.spacing_px, mask=mask[part], blockSize=BLOCK
        )
        return None if found is None else np.asarray(found + np.array([left, top]), np.float32).reshape(-1, 2)

    def _worth_following(self, frame: Frame, background: Background | None, camera: int) -> U8:
        """Return 1 where a view (H, W) may show the person, else 0."""
        import cv2

        picture, hidden = frame.images[camera], frame.hidden_in(camera)
        everywhere = np.ones(picture.shape[:2], np.uint8)
        where = everywhere if background is None else self.differs(picture, background, camera)
        if hidden is None:
            return where
        beside = np.ones((self.window_px, self.window_px), np.uint8)  # there the edge of what hides is followed
        return np.where(cv2.dilate(hidden.view(np.uint8), beside) > 0, np.uint8(0), where)

    def differs(self, picture: U8, background: Background, camera: int) -> U8:
        """Return 1 where a picture differs from the empty scene (specks are noise) or nobody knows it, else 0."""
        import cv2

        away = cv2.absdiff(picture, cv2.convertScaleAbs(background.mean[camera]))  # rounds and clips to bytes
        different = cv2.max(cv2.max(away[..., 0], away[..., 1]), away[..., 2]) > self.difference
        return np.where(background.known[camera], cv2.medianBlur(different.astype(np.uint8), SPECK), np.uint8(1))


NOTHING = Flow(pixel=np.empty((0, 2), np.float32), displacement=np.empty((0, 2), np.float32))
