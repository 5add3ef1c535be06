"""Synthetic pictures with a known outline for the tests of the segmenters."""

import numpy as np
from mocapflow_levelset.evidence import Evidence, gather_planes
from mocapflow_levelset.evolve import Schedule, Weights, settle
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.statistics import Window

SIZE = 160
BAND = 7.0


def ellipse(x=80.0, y=80.0, a=38.0, b=52.0, size=SIZE):
    """Return a signed distance to an ellipse, positive inside, clipped to 12 px."""
    rows, columns = np.mgrid[:size, :size]
    level = 1 - np.hypot((columns - x) / a, (rows - y) / b)
    return redistance((level * min(a, b)).astype(np.float32), 12.0)


def ramp_scene(disturbance="clean", seed=0):
    """Return features (3, 160, 160) of an ellipse on a ramp of colour (scene of T-LS6), and its mask."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:SIZE, :SIZE]
    inside = ((columns - 80) / 38) ** 2 + ((rows - 80) / 52) ** 2 < 1
    first = 0.2 + 0.5 * columns / SIZE + 0.18 * inside
    second = 0.6 - 0.3 * rows / SIZE - 0.05 * inside
    planes = np.stack([first, second, np.full((SIZE, SIZE), 0.5)])
    if disturbance == "occluder":
        planes[:, 55:105, 95:135] = np.array([0.9, 0.1, 0.1])[:, None, None]
    planes += rng.normal(0, 0.05, planes.shape)
    if disturbance == "replaced":
        lost = rng.random((SIZE, SIZE)) < 0.6
        planes[:, lost] = rng.uniform(0, 1, (3, lost.sum()))
    return np.clip(planes, 0, 1).astype(np.float32), inside


def descend(planes, start, prior, steps, shape=0.0, rho=12.0, cell=2, every=1, length=0.5, to_rest=False):
    """Return the level set after some steps with the literal constants of the chapter's specification."""
    weights = Weights(1.5, length, shape, 6.0, 1.0, BAND)
    evidence = from_features(planes, np.ones(start.shape, np.float32))
    return settle(start, prior, evidence, Window(rho, cell, 0.02), weights, Schedule(steps, every, 5, to_rest)).level


def from_features(planes, weight):
    """Return the evidence of features (C, H, W) as they are."""
    return Evidence(planes, weight, 1, lambda runs: gather_planes(planes, runs))


def overlap(level, mask):
    inside = level > 0
    return (inside & mask).sum() / (inside | mask).sum()
