"""Forces and thickness: T-CL6 to T-CL8 and what the parameters of a garment mean."""

from unittest.mock import Mock

import drape_bodies
import numpy as np
import pytest
from drape_bodies import (
    SKIN,
    box,
    check_whole_and_outside,
    distances,
    leg_poses,
    prepared,
    skirted,
    swing,
)
from mocapflow_draping import kinematic
from mocapflow_draping.directions import tilted
from mocapflow_draping.forces import thickness, tilts, wind
from mocapflow_draping.literal import blow_in_steps

from mocapflow.assets import Camera
from mocapflow.data import Cloth, Past, Pose, PoseBatch
from mocapflow.errors import PluginError
from mocapflow.geometry import silhouettes

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def draper():
    """Strands alone, at the contact distance of these tests."""
    return drape_bodies.draper(sweeps=0)


def parameters(garment, **values):
    return np.array([[values.get(name, 0.0) for name in garment.parameter_names]])


def standing():
    return PoseBatch(root=np.eye(4)[None], angles=np.zeros((1, 4)))


def from_the_front(scene, cloth):
    """Return the silhouette of who stands there, as a camera far away sees it: a millimetre a pixel."""
    camera = Camera(
        name="front", size=np.array([900, 900], np.int32), distortion=np.zeros(5),
        intrinsics=np.array([[40000.0, 0, 450], [0, 40000.0, 450], [0, 0, 1]]),
        camera_from_world=np.array([[1.0, 0, 0, 0], [0, 0, -1, 0.75], [0, 1, 0, 40], [0, 0, 0, 1]]),
    )  # fmt: skip
    surface = scene.surface(Pose(root=np.eye(4), angles=np.zeros(4)), cloth)
    return silhouettes.covered(surface, camera)


def blown(body, grid, force, degrees, fixed=(0,)):
    values, parts = prepared(body)
    pinned = np.zeros((1, *grid.shape[:2]), bool)
    pinned[..., list(fixed)] = True
    out = grid[None].copy()
    rows = np.zeros(len(grid), np.int32), np.full(len(grid), grid.shape[1] - 1, np.int32)
    blow_in_steps(out, pinned, *rows, np.array([SKIN]), np.array([force], float), np.radians([degrees]), parts, values)
    return out[0]


def test_the_chapters_wind_lifts_a_hanging_strand_by_its_amount():
    nothing = box([5, 5, 5], [5.1, 5.1, 5.1])
    hanging = np.outer(0.02 * np.arange(21), DOWN)[None]
    tip = blown(nothing, hanging, [1, 0, 0], 23.0)[0, -1]
    np.testing.assert_allclose(tip, 0.4 * np.array([np.sin(np.radians(23)), 0, -np.cos(np.radians(23))]), atol=1e-9)
    np.testing.assert_array_equal(blown(nothing, hanging, [1, 0, 0], 0.0)[0], hanging[0])


def test_wind_never_turns_a_strand_beyond_its_own_direction():
    nothing = box([5, 5, 5], [5.1, 5.1, 5.1])
    level = np.outer(0.02 * np.arange(6), [np.cos(0.1), 0, -np.sin(0.1)])[None]
    np.testing.assert_allclose(blown(nothing, level, [1, 0, 0], 40.0)[0, -1], [0.1, 0, 0], atol=1e-9)


def test_wind_against_a_wall_moves_nothing_into_it():
    wall = box([0.03, -0.5, -0.6], [0.13, 0.5, 0.1])
    hanging = np.outer(0.02 * np.arange(21), DOWN)[None]
    pressed = blown(wall, hanging, [1, 0, 0], 30.0)
    assert distances(wall, pressed).min() > SKIN - 1e-4
    touching = hanging + [0.03 - SKIN, 0, 0]
    np.testing.assert_allclose(blown(wall, touching, [1, 0, 0], 30.0), touching, atol=1e-3)


def test_forces_together_lift_no_tail_above_its_support():
    scene = skirted()
    names = [name for name in scene.garment.parameter_names if name.endswith("_rad")]
    out, aside = tilts(scene.garment, parameters(scene.garment, **dict.fromkeys(names, 0.7)), np.linspace(0, 6, 99))
    amount = np.degrees(np.hypot(out, aside))
    assert amount.max() == pytest.approx(80)
    assert np.abs(np.degrees(aside)).max() > 30  # both parts count


@pytest.mark.parametrize("towards", [0.0, 1.0, 2.5])
def test_order_one_is_a_wind_that_turns_every_strand_alike(towards):
    scene = skirted()
    azimuth = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    wind = parameters(scene.garment, wind_cos_rad=0.3 * np.cos(towards), wind_sin_rad=0.3 * np.sin(towards))
    out, aside = tilts(scene.garment, wind, azimuth)
    facing = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], -1)
    down = tilted(np.broadcast_to(DOWN, facing.shape), facing, out[0], aside[0])
    force = np.array([np.cos(towards), np.sin(towards), 0])
    np.testing.assert_allclose(down, np.broadcast_to(np.cos(0.3) * DOWN + np.sin(0.3) * force, down.shape), atol=1e-12)


def test_a_flare_lifts_all_tails_outwards():
    garment = skirted().garment
    out, aside = tilts(garment, parameters(garment, flare_rad=0.2), np.linspace(0, 6, 7))
    np.testing.assert_allclose([out[0], aside[0]], np.outer([0.2, 0.0], np.ones(7)))


def test_the_chapters_wind_turns_with_what_carries_the_garment():
    garment, amounts = skirted().garment, np.array([0.0, 0.05, 0.6])
    blown = np.concatenate([parameters(garment, wind_sin_rad=amount) for amount in amounts])
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # from y to -x
    direction, amount = wind(garment, blown, np.stack([np.eye(3), quarter, np.eye(3)]))
    np.testing.assert_allclose(direction, [[0, 0, 0], [-1, 0, 0], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(amount, amounts)


def test_a_bulge_does_not_stretch_its_ring():
    scene = skirted()
    azimuth = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    for name in ("wind_cos_rad", "two_sin_rad", "two_cos_rad"):
        small = 1e-3
        out, aside = tilts(scene.garment, parameters(scene.garment, **{name: small}), azimuth)
        radius = 1 + out[0]
        ring = np.stack([radius * np.cos(azimuth) - aside[0] * np.sin(azimuth),
                         radius * np.sin(azimuth) + aside[0] * np.cos(azimuth)], -1)  # fmt: skip
        links = np.linalg.norm(np.roll(ring, -1, 0) - ring, axis=1)
        assert np.ptp(links) / links.mean() < 1e-5


def test_a_hanging_strand_reaches_the_tilt_it_is_given():
    nothing = box([5, 5, 5], [5.1, 5.1, 5.1])
    tilts = np.array([20.0, 0.0, -35.0])
    laid, _ = swing(nothing, [[0.0, 0.0, 0.0]], [1.0, 0.0, 0.0], 21, 0.02, start=60, tilts=tilts)
    angle = np.radians(tilts)
    tips = 0.4 * np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=1)
    np.testing.assert_allclose(laid[:, 0, -1], tips, atol=1e-9)


@pytest.mark.parametrize("name", ["flare_rad", "wind_cos_rad", "wind_sin_rad", "two_cos_rad", "two_sin_rad"])
def test_no_force_presses_cloth_into_the_body(draper, name):
    scene = skirted()
    for amount in (-0.4, 0.4):
        force = np.repeat(parameters(scene.garment, **{name: amount}), 4, axis=0)
        draped = draper.drape(leg_poses(), force, Past(), scene)
        free = np.setdiff1d(np.arange(draped.shape[1]), scene.garment.pinned)
        assert distances(scene.body, draped[:, free], leg_poses()).min() > SKIN - 1e-4


def test_wind_turns_with_the_person():
    scene = skirted()
    turn = np.eye(4)
    turn[:2, :2] = [[0, -1], [1, 0]]
    wind = parameters(scene.garment, wind_cos_rad=0.2)
    draper = drape_bodies.draper()
    ahead = draper.drape(standing(), wind, Past(), scene)[0]
    turned = draper.drape(PoseBatch(root=turn[None], angles=np.zeros((1, 4))), wind, Past(), scene)[0]
    np.testing.assert_allclose(turned, ahead @ turn[:3, :3].T, atol=1e-6)


def test_25_winds_share_one_drape(draper, monkeypatch):  # what they cost: benchmarks/draping.py
    scene = skirted()
    laid = Mock(side_effect=kinematic.drape_strands)
    monkeypatch.setattr(kinematic, "drape_strands", laid)
    poses, winds = leg_poses(), np.zeros((35, len(scene.garment.parameter_names)))
    winds[:, 2:4] = np.random.default_rng(0).uniform(-0.3, 0.3, (35, 2))
    rows = np.repeat([0, 3], [25, 10])  # and ten of another pose
    draper.drape(PoseBatch(root=poses.root[rows], angles=poses.angles[rows]), winds, Past(), scene)
    assert [len(call.args[2][0]) for call in laid.call_args_list] == [2]  # where strands begin, at each pose laid


def test_winds_of_one_drape_are_its_winds_one_by_one(draper):
    scene = skirted()
    winds = np.zeros((9, len(scene.garment.parameter_names)))
    winds[:6, 1:6] = np.random.default_rng(1).uniform(-0.3, 0.3, (6, 5))
    winds[6:] = winds[5] * [[0.5], [0.9], [1.1]]  # harder and harder: each goes on where the one before has ended
    pose = PoseBatch(root=leg_poses().root[1:2].copy(), angles=leg_poses().angles[1:2].copy())
    same = PoseBatch(root=np.repeat(pose.root, 9, axis=0), angles=np.repeat(pose.angles, 9, axis=0))
    together = draper.drape(same, winds, Past(), scene)
    alone = np.concatenate([draper.drape(pose, wind[None], Past(), scene) for wind in winds])
    np.testing.assert_array_equal(together[:7], alone[:7])
    assert np.linalg.norm(together - alone, axis=-1).max() < 1e-3


def test_a_wind_on_one_pose_does_not_need_one_on_the_pose_before(draper):
    scene, poses = skirted(), PoseBatch(root=leg_poses().root[[0, 3]], angles=leg_poses().angles[[0, 3]])
    calm, windy = parameters(scene.garment), parameters(scene.garment, wind_cos_rad=0.2)
    together = draper.drape(poses, np.concatenate([calm, windy]), Past(), scene)
    second = PoseBatch(root=poses.root[1:], angles=poses.angles[1:])
    np.testing.assert_allclose(together[1:], draper.drape(second, windy, Past(), scene), atol=1e-12)


def test_the_silhouette_grows_by_the_thickness_on_either_side(draper):
    """T-CL7: so of silhouettes of thin and thick cloth the true thickness alone fits, and others fit the less."""
    scene, amounts = skirted(), np.linspace(0, 0.010, 6)
    thick = np.concatenate([parameters(scene.garment, thickness_m=h) for h in (*amounts, 0.006)])
    poses = PoseBatch(root=np.tile(np.eye(4), (len(thick), 1, 1)), angles=np.zeros((len(thick), 4)))
    drapes = draper.drape(poses, thick, Past(), scene)
    *tried, seen = [from_the_front(scene, Cloth(vertices=v, parameters=p)) for v, p in zip(drapes, thick, strict=True)]
    hem = [np.flatnonzero(mask[650]) for mask in tried]
    assert np.ptp(hem[-1]) - np.ptp(hem[0]) == pytest.approx(20, abs=2)
    off = np.array([np.count_nonzero(mask != seen) for mask in tried])
    assert off.argmin() == 3 and off[3] == 0
    assert (np.diff(off[:4]) < 0).all() and (np.diff(off[3:]) > 0).all()


def test_thick_cloth_keeps_farther_from_the_skin(draper):
    scene = skirted()
    thick = draper.drape(standing(), parameters(scene.garment, thickness_m=0.010), Past(), scene)
    free = np.setdiff1d(np.arange(thick.shape[1]), scene.garment.pinned)
    nearest = distances(scene.body, thick[:, free], standing()).min()
    assert nearest == pytest.approx(draper.skin_m + 0.010, abs=4e-4)
    two = np.repeat(parameters(scene.garment, thickness_m=0.003), 2, axis=0)
    np.testing.assert_array_equal(thickness(scene.garment, two), [0.003, 0.003])


@pytest.mark.parametrize("settings", [dict(sweeps=0), dict(sweeps=20), dict(sweeps=0, rule="literal", limited=True)])
def test_cloth_hangs_as_much_shorter_as_folds_take_up(settings):
    scene = skirted()
    poses, draper = leg_poses(), drape_bodies.draper(**settings)
    folded = np.repeat(parameters(scene.garment, take_up=0.1), 4, axis=0)
    draped = draper.drape(poses, folded, Past(), scene)
    whole = draper.drape(poses, 0 * folded, Past(), scene)
    if "rule" not in settings:
        check_whole_and_outside(scene, draped, poses, take_up=0.1)
    hem = scene.garment.strands[:, -1]
    assert (draped[0, hem, 2] - whole[0, hem, 2]).mean() == pytest.approx(
        0.1 * drape_bodies.SKIRT["length_m"], abs=0.01
    )


def test_drapes_of_one_pose_have_their_own_take_up():
    scene = skirted()
    draper, pose = drape_bodies.draper(), leg_poses()
    same = PoseBatch(root=np.repeat(pose.root[1:2], 3, axis=0), angles=np.repeat(pose.angles[1:2], 3, axis=0))
    amounts = np.concatenate([parameters(scene.garment, take_up=u, flare_rad=0.1) for u in (0.0, 0.05, 0.1)])
    together = draper.drape(same, amounts, Past(), scene)
    for row in range(3):
        alone = PoseBatch(root=same.root[:1].copy(), angles=same.angles[:1].copy())
        np.testing.assert_array_equal(draper.drape(alone, amounts[row : row + 1], Past(), scene)[0], together[row])


def test_a_parameter_without_a_meaning_is_refused():
    scene = skirted()
    names = ("thickness_m", "flair_rad", *scene.garment.parameter_names[2:])
    odd = type(scene.garment)(**{**vars(scene.garment), "parameter_names": names})
    with pytest.raises(PluginError, match=r"'flair_rad'(.|\n)*did you mean 'flare_rad'"):
        tilts(odd, np.zeros((1, len(names))), np.zeros(3))


@pytest.mark.parametrize("rule", ["contact", "literal"])
@pytest.mark.parametrize("yaw", [0.0, 1.1])
def test_a_wind_blows_where_it_says(yaw, rule):
    scene = skirted()
    garment, turn, way = scene.garment, np.eye(4), np.array([0.6, 0.8])
    turn[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    poses = PoseBatch(root=np.stack([turn, turn]), angles=np.zeros((2, 4)))
    wind = parameters(garment, wind_cos_rad=0.2 * way[0], wind_sin_rad=0.2 * way[1])
    draper = drape_bodies.draper(rule=rule, limited=True, sweeps=0)
    calm, blown = draper.drape(poses, np.concatenate([0 * wind, wind]), Past(), scene)
    moved = (blown - calm)[garment.strands[:, -1], :2] @ turn[:2, :2]
    assert (moved @ way).min() > -0.005  # to windward legs hold the cloth
    assert 0.08 < (moved @ way).max() < 0.6 * np.sin(0.2) + 0.005  # of a strand of 0.6 m
    assert np.abs(moved @ [-way[1], way[0]]).max() < 0.03
