"""Several garments at once are draped each by itself."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.data import Cloth, Moment, Past, PoseBatch
from mocapflow.dressing.guards import drape_of, velocity_of
from mocapflow.dressing.pieces import touchable
from mocapflow.geometry.outfits import together
from mocapflow.output_checks import InvalidOutput
from mocapflow.scene import Scene
from mocapflow.testing.bodies import tiny_body, tiny_garment
from mocapflow.testing.scenes import Rigid, tiny_pose

BODY = tiny_body()
WIDE = tiny_garment(BODY)
NARROW = replace(WIDE, name="narrow", vertices=WIDE.vertices * [0.8, 0.8, 1.0])
ALONE = [Scene(cameras=(), body=BODY, garment=garment) for garment in (WIDE, NARROW)]
BOTH = Scene(cameras=(), body=BODY, garment=together("both", [WIDE, NARROW]))
COUNT = len(WIDE.vertices)


seen = []  # by `Seeing`


class Seeing(Rigid):
    """Remembers what it was given, and is moved by the joint that the width of a garment tells."""

    name = "seeing"

    def drape(self, poses, parameters, past, scene):
        if past.moments:
            seen.append((scene.garment.name, past.moments[-1].cloth))
        return super().drape(poses, parameters, past, scene)

    def touchable(self, scene):
        touched = "knee_l" if scene.garment is WIDE else "hip_r"
        return np.array([name == touched for name in scene.body.joint_names])


def batch(*seeds):
    poses = [tiny_pose(BOTH, seed) for seed in seeds]
    return PoseBatch(root=np.stack([p.root for p in poses]), angles=np.stack([p.angles for p in poses]))


def test_each_garment_hangs_as_it_does_alone():
    parameters = np.random.default_rng(0).uniform(-0.3, 0.3, (3, 6))
    laid = drape_of(Rigid(), batch(0, 1, 2), parameters, Past(), BOTH)
    one = drape_of(Rigid(), batch(0, 1, 2), parameters[:, :3], Past(), ALONE[0])
    other = drape_of(Rigid(), batch(0, 1, 2), parameters[:, 3:], Past(), ALONE[1])
    np.testing.assert_array_equal(laid, np.concatenate([one, other], axis=1))


@pytest.mark.parametrize("vertices", [[3, COUNT + 2, 0, 2 * COUNT - 1], [1, 2], [COUNT]])
def test_each_garment_moves_as_it_does_alone(vertices):
    pose, parameters = tiny_pose(BOTH), np.array([0.0, 0.1, -0.2, 0.0, 0.3, 0.05])
    vertices = np.array(vertices, np.int32)
    told = velocity_of(Rigid(), pose, parameters, vertices, Past(), BOTH)
    moved = 6 + len(pose.angles)
    for k, vertex in enumerate(vertices):
        piece, own = divmod(int(vertex), COUNT)
        its = slice(3 * piece, 3 * piece + 3)
        alone = velocity_of(Rigid(), pose, parameters[its], np.array([own], np.int32), Past(), ALONE[piece])[0]
        np.testing.assert_array_equal(told[k, :, :moved], alone[:, :moved])
        expected = np.zeros((3, 6))
        expected[:, its] = alone[:, moved:]
        np.testing.assert_array_equal(told[k, :, moved:], expected)
        assert np.abs(expected).max() > 0.01 or own < 16  # the upper edge does not lean


def test_one_that_is_worn_as_several_is_told_by_its_own_names():
    class Naming(Rigid):
        name = "naming"

        def drape(self, poses, parameters, past, scene):
            assert scene.garment is WIDE
            return super().drape(poses, parameters, past, scene)

    one, parameters = replace(BOTH, garment=together("one", [WIDE])), np.array([0.0, 0.1, -0.2])
    vertices = np.arange(COUNT, dtype=np.int32)
    laid = drape_of(Naming(), batch(0), parameters[None], Past(), one)
    np.testing.assert_array_equal(laid, drape_of(Rigid(), batch(0), parameters[None], Past(), ALONE[0]))
    told = velocity_of(Naming(), tiny_pose(one), parameters, vertices, Past(), one)
    alone = velocity_of(Rigid(), tiny_pose(one), parameters, vertices, Past(), ALONE[0])
    np.testing.assert_array_equal(told, alone)


def test_each_garment_knows_its_own_past():
    pose, vertices = tiny_pose(BOTH), np.arange(6.0 * COUNT).reshape(-1, 3)
    cloth = Cloth(vertices=vertices, parameters=np.arange(6.0))
    past = Past(moments=(Moment(time=0.0, pose=pose, cloth=cloth),), after_gap=True)
    seen.clear()
    drape_of(Seeing(), batch(0), np.zeros((1, 6)), past, BOTH)
    assert [name for name, _ in seen] == ["tube", "narrow"]
    for piece, (_, own) in enumerate(seen):
        np.testing.assert_array_equal(own.vertices, vertices[piece * COUNT : (piece + 1) * COUNT])
        np.testing.assert_array_equal(own.parameters, [3 * piece, 3 * piece + 1, 3 * piece + 2])


def test_what_moves_one_of_them_moves_the_cloth():
    """A knee is moved by its hip and the pelvis, too."""

    def names(scene):
        return [name for name, moves in zip(BODY.joint_names, touchable(Seeing(), scene), strict=True) if moves]

    assert names(ALONE[0]) == ["pelvis", "hip_l", "knee_l"]
    assert names(ALONE[1]) == ["pelvis", "hip_r"]
    assert names(BOTH) == ["pelvis", "hip_l", "knee_l", "hip_r"]


def test_what_a_draper_returns_is_checked_garment_by_garment():
    class Short(Rigid):
        name = "short"

        def drape(self, poses, parameters, past, scene):
            return super().drape(poses, parameters, past, scene)[:, : COUNT - (scene.garment is NARROW)]

    with pytest.raises(InvalidOutput, match="cloth"):
        drape_of(Short(), batch(0), np.zeros((1, 6)), Past(), BOTH)
