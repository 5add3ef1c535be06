"""An arm before clothes that no garment models does not take their edge for its own, and keeps its own elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.loose import on_arm, stands_off

from mocapflow.data import NO_CLOTH, Frame, Past, Pose, Segmentation, Silhouette, Turn
from mocapflow.geometry import silhouettes
from mocapflow.scene import Scene
from mocapflow.testing import template_body
from mocapflow.testing.views import tiny_camera

BODY = template_body()
SCENE = Scene(cameras=(tiny_camera(0, np.pi / 2),), body=BODY)
SURFACE = SCENE.surface(Pose(root=np.eye(4), angles=np.zeros(len(BODY.twists))), NO_CLOTH)
MODEL = silhouettes.mask(silhouettes.outline(SURFACE, SCENE.cameras[0]), SCENE.cameras[0])
ARM, LEG = (int(np.flatnonzero(which)[0]) for which in (on_arm(BODY), ~on_arm(BODY)))
ROW = 180  # px, below the hands
THIGH = int(np.flatnonzero(MODEL[ROW]).max())  # its right edge
EDGE = THIGH + 16  # of a skirt


def person(gap: bool) -> Silhouette:
    """The person in a skirt; or with something apart from them instead of its edge."""
    covered = MODEL.copy()
    covered[ROW - 30 : ROW + 30, THIGH - 5 : EDGE + 1] = True
    if gap:
        covered[ROW - 30 : ROW + 30, THIGH + 1 : EDGE - 3] = False
    return Silhouette(camera=0, layer="person", distance=np.where(covered, 8, -8).astype(np.float32))


def test_arms_are_those_of_the_body() -> None:
    arm = on_arm(BODY)
    assert 0.1 < arm.mean() < 0.5  # hands have many vertices
    assert BODY.vertices[arm, 0].std() > 2 * BODY.vertices[~arm, 0].std()  # it stands with its arms apart


@pytest.mark.parametrize(("vertex", "gap", "loose_m", "uncertain"), [
    (ARM, False, 0.15, True),
    (ARM, True, 0.15, False),  # an arm seen apart
    (ARM, False, 0.05, False),  # no clothes stand off so far
    (LEG, False, 0.15, False),
])  # fmt: skip
def test_an_arm_is_not_sure_of_an_edge_before_which_clothes_may_hang(vertex, gap, loose_m, uncertain) -> None:
    pixel, normal = np.array([[EDGE, ROW]], float), np.array([[1.0, 0.0]])
    off = stands_off(pixel, normal, np.array([vertex], np.int32), person(gap), SURFACE, SCENE, loose_m)
    assert (off[0] > 5) == uncertain and (off[0] == 0) != uncertain


def test_pairs_of_arms_before_a_wide_skirt_weigh_next_to_nothing() -> None:
    hands = silhouettes.occluding_contour(SURFACE, SCENE.cameras[0], 4.0).pixel
    right, row = hands[hands[:, 0].argmax()].astype(int)
    covered = MODEL.copy()
    covered[row - 30 : row + 30, THIGH - 5 : right + 6] = True
    skirt = Silhouette(camera=0, layer="person", distance=np.where(covered, 8, -8).astype(np.float32))
    seen, frame = Segmentation(silhouettes=(skirt,)), Frame(index=0, time=0.0, images=(), usable=np.ones(1, bool))
    sure, loose = (
        ContourIcp(loose_m=metres).match(frame, seen, SURFACE, Past(), SCENE, Turn(index=0, cap=4))
        for metres in (0.0, 0.6)
    )
    arm = on_arm(BODY)[loose.vertex] & (np.abs(loose.pixel[:, 1] - row) < 20) & (loose.pixel[:, 0] > right - 8)
    assert arm.any() and loose.weight[arm].max() < 0.01 * sure.weight[arm].max()
    others = ~on_arm(BODY)[loose.vertex]
    assert (loose.weight[others] == sure.weight[others]).all()
