"""Whether cameras make sense together, by their numbers alone; what the doctor makes of it is tested there."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocapflow.geometry.cameras import centre, directions
from mocapflow.io.cameras.rigs import examine_rig, examine_view
from tests.fixtures.recordings import look_at, ring


def moved(camera, turn_deg=0.0, aside_m=0.0):
    """Return a camera that is rolled about its viewing direction where it stands, and then put aside."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    motion[0, 3] = aside_m
    return replace(camera, name="another", camera_from_world=motion @ camera.camera_from_world)


@pytest.mark.parametrize(
    ("turn_deg", "aside_m", "told"),
    [(0.0, 0.0, True), (0.9, 0.0, True), (1.1, 0.0, False), (0.0, 0.019, True), (0.0, -0.021, False)],
)
def test_two_cameras_are_one_within_two_centimetres_and_a_degree(turn_deg, aside_m, told):
    cameras = ring()
    said = [finding.message for finding in examine_rig([*cameras, moved(cameras[0], turn_deg, aside_m)])]
    assert said == ["cam01 and another stand in one place and look the same way"] * told


@pytest.mark.parametrize(
    ("x", "y", "seen"),
    [(63.4, 20, True), (63.6, 20, False), (-0.4, 20, True), (-0.6, 20, False), (30, 47.4, True), (30, 47.6, False)],
)
def test_a_point_is_seen_where_it_lies_in_the_picture(x, y, seen):
    camera = ring()[0]  # 64 x 48 px
    point = centre(camera) + 4 * directions(np.array([x, y]), camera)
    told = [finding.message for finding in examine_view([camera], point, "the root")]
    assert told == ["no camera sees the root"] * (not seen)


def test_a_single_camera_may_stand_below_the_floor():
    low = look_at("low", np.array([0.5, -4.0, -0.2]))
    for cameras, told in (([*ring(), low], False), ([low, replace(low, name="twin")], True)):
        assert any("below the floor" in finding.message for finding in examine_rig(cameras)) == told


def test_cameras_on_their_sides_all_around_agree_on_no_up():
    said = [finding.message for finding in examine_rig([moved(camera, 90) for camera in ring()])]
    assert not any("up is" in message for message in said)
