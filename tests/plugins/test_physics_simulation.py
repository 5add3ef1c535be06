"""T-FUT, where the extra is installed: a chain and a strip in equilibrium, and cloth that stays outside the body."""

from importlib.util import find_spec

import numpy as np
import pytest
from drape_bodies import box, deep_poses, distances, leg_poses, lying_cylinder, prepared, skirted
from mocapflow_physics.cloth import GRAVITY, SHEAR
from mocapflow_physics.simulation import SHARE, Simulation
from mocapflow_physics.xpbd import EVERY, Xpbd
from scipy.optimize import brentq

from mocapflow.data import Past

pytestmark = pytest.mark.skipif(find_spec("newton") is None, reason="the extra `physics` is not installed")

RATE = Xpbd.model_fields["rate_hz"].default
FAR = box([-0.1, -0.1, -9.0], [0.1, 0.1, -8.9])


def settled(place, links, pinned, rate, seconds, body=FAR):
    """Return particles (W, 3) m at rest on a body; links are pairs, lengths and stiffness."""
    values, parts = prepared(body)
    simulation, moments = Simulation(links, pinned, 1, 1 / rate), round(seconds * rate / EVERY)
    pins, pull, length = place[None, pinned], np.zeros((1, *place.shape)), links[1][None]
    still = [pins] * moments, [parts] * moments, values, np.array([0.005])
    return simulation.settle(place[None], *still, pull, length, EVERY)[0]


def hung(rate, links=20, span=0.6):
    """Return a chain (W, 3) m of one metre that hangs from both its ends, in the plane y = 0 and about x = 0."""
    along = np.linspace(-0.5, 0.5, links + 1)
    depth = (0.5 - np.abs(along)) * np.sqrt(1 - span**2)
    place, ends = np.stack([span * along, 0 * along, -depth], axis=1), np.abs(along) == 0.5
    pairs = np.stack([np.arange(links), np.arange(links) + 1], axis=1).astype(np.int32)
    return settled(place, (pairs, np.full(links, 1 / links), np.ones(links)), ends, rate, 2.0)


def test_a_hanging_chain_comes_to_the_catenary_as_steps_become_shorter():
    """At the draper's own rate threads give by 0.2 %, as Hooke says: the chain hangs 0.5 % too deep."""
    half = 0.3
    a = brentq(lambda a: 2 * a * np.sinh(half / a) - 1, 0.05, 5)  # of the curve one metre long
    off, longer = [], []
    for rate in (RATE / 2, RATE):
        chain = hung(rate)
        curve = a * (np.cosh(chain[:, 0] / a) - np.cosh(half / a))
        off.append(np.abs(chain[:, 2] - curve).max() / (a * (np.cosh(half / a) - 1)))
        longer.append(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum() - 1)
        middles = (np.arange(20) + 0.5) / 20 - 0.5
        tension = 20 * GRAVITY * np.hypot(a, middles)  # of particles of mass one, twenty a metre
        give = 2 + 1 / SHARE  # in squared steps over masses, after one iteration
        assert longer[-1] == pytest.approx(20 * tension.mean() * give / rate**2, rel=0.05)
    print(f"off the catenary by {off[0]:.2%} and {off[1]:.2%} of its depth, longer by {longer[0]:.2%} {longer[1]:.2%}")
    assert off[1] < 0.01 and off[1] < off[0] / 2


def sag(bending, count=8, link=0.03):
    """Return how far the end of a strip hangs below its clamp, as a share of what sticks out."""
    at = np.arange(2 * count).reshape(count, 2)
    place = np.stack([at // 2 * link, at % 2 * link, 0 * at], axis=-1).reshape(-1, 3)
    threads = [at[:-1].ravel(), at[1:].ravel()], [at[:, 0], at[:, 1]]
    across = [at[:-1].ravel(), at[1:, ::-1].ravel()]
    over_one = [at[:-2].ravel(), at[2:].ravel()]  # these are shortened where the strip bends
    kinds = [np.stack(kind, axis=1) for kind in (*threads, across, over_one)]
    stiff = np.repeat([1.0, 1.0, SHEAR, bending], [len(kind) for kind in kinds])
    pairs = np.concatenate(kinds).astype(np.int32)
    length = np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
    pinned = np.arange(len(place)) < 4
    return -settled(place, (pairs, length, stiff), pinned, RATE, 1.5)[-2:, 2].mean() / ((count - 2) * link)


def test_a_strip_held_at_one_end_hangs_less_the_stiffer_it_is_against_bending():
    """Links over every other particle stiffen it; the draper gives its cloth none, which folds freely."""
    depths = [sag(bending) for bending in (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)]
    print("sags by", np.round(depths, 3), "of what sticks out")
    assert (np.diff(depths) < -0.002).all()
    assert depths[0] == pytest.approx(1, abs=0.02)  # limp: straight down


def test_what_links_pull_into_the_body_is_laid_out_of_it():
    """A particle on a cylinder, tied to both sides by links of less than half the length they would need."""
    place = np.array([[-0.1, 0, -0.1], [0, 0, 0.11], [0.1, 0, -0.1]])
    links, pinned = (np.array([[0, 1], [1, 2]], np.int32), np.full(2, 0.1), np.ones(2)), np.array([True, False, True])
    held = settled(place, links, pinned, RATE, 0.2, lying_cylinder(0.1))[1]
    assert np.hypot(held[0], held[2]) == pytest.approx(0.105, abs=1e-3)


@pytest.mark.parametrize("poses", [leg_poses, deep_poses])
def test_cloth_stays_outside_the_legs(poses):
    scene, posed = skirted(), poses()
    still = np.zeros((len(posed.root), len(scene.garment.parameter_names)))
    draped = Xpbd().drape(posed, still, Past(), scene)
    free = np.setdiff1d(np.arange(draped.shape[1]), scene.garment.pinned)
    apart = distances(scene.body, draped[:, free], posed).min(axis=1)
    print("particles nearest to the body, mm:", np.round(1000 * apart, 1))
    assert apart.min() > Xpbd().skin_m - 0.001
    assert distances(scene.body, draped[:, scene.garment.faces].mean(axis=2), posed).min() > 0  # middles of triangles
