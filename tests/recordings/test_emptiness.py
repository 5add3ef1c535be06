"""An empty scene that was assumed is held against the first frame, in which it is known where the person is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mocapflow.data import Start
from mocapflow.geometry import twists
from mocapflow.recordings.emptiness import MOST, believable, share_alike
from mocapflow.testing import pictures, scenes

SCENE = scenes.tiny_scene()
POSE = scenes.tiny_pose(SCENE, 3)
FRAME = pictures.tiny_frame(SCENE, POSE)
RECORDING = SimpleNamespace(indices=range(5, 9), frame={5: FRAME}.__getitem__)


def assumed(*views):
    """Return the empty scene, with the person in some views."""
    mean = [FRAME.images[c].astype(np.float32) if c in views else view for c, view in enumerate(SCENE.background.mean)]
    return replace(SCENE.background, mean=tuple(mean), assumed=True)


@pytest.mark.parametrize(("views", "empty"), [((), True), ((2,), False), ((0, 1, 2, 3), False)])
def test_who_stands_in_a_view_is_found(views, empty, caplog):
    assert believable(assumed(*views), RECORDING, Start(pose=POSE, parameters=np.empty(0)), SCENE) is empty
    assert ("the person stands in what was taken for the empty scene" in caplog.text) is not empty


def test_a_pose_that_is_somewhat_off_will_do():
    off = replace(POSE, root=twists.exp(np.array([0, 0, 0.05, 0, 0.02, 0])) @ POSE.root)
    start = Start(pose=off, parameters=np.empty(0))
    assert believable(assumed(), RECORDING, start, SCENE)
    assert not believable(assumed(1), RECORDING, start, SCENE)


def test_plates_are_believed():
    plates = replace(assumed(0, 1, 2, 3), assumed=False)
    assert believable(plates, RECORDING, Start(pose=POSE, parameters=np.empty(0)), SCENE)


def test_a_view_that_can_not_be_used_tells_nothing():
    recording = SimpleNamespace(indices=range(5, 9), frame=lambda index: pictures.without_view(FRAME, 2))
    assert believable(assumed(2), recording, Start(pose=POSE, parameters=np.empty(0)), SCENE)


def test_shares():
    surface = SCENE.undressed.surface(POSE, scenes.tiny_cloth(SCENE, POSE))
    shares = [share_alike(assumed(0), FRAME, surface, SCENE.cameras[c], c) for c in (0, 1)]
    assert shares[0] > 0.95 > MOST > 0.05 > shares[1]
