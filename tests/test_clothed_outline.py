"""What `benchmarks/optimisers.py` minimises, on silhouettes of a known leg in known cloth."""

import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import Past, Segmentation, Silhouette
from mocapflow.geometry.silhouettes import model_distance
from mocapflow.help.shipped import shipped
from mocapflow.model import ClothedModel
from mocapflow.prediction import initial_state

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "benchmarks"))

import basin  # noqa: E402
import minimisers  # noqa: E402
from clothed_outline import Outline  # noqa: E402
from optimisers import LEG  # noqa: E402

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def known():
    """The state of a frame whose silhouettes are those of its pose and cloth, and the model."""
    clip = shipped("examples", "data", "skirt_steps")
    pipeline = load_pipeline(shipped("pipelines", "skirt.yaml"), recording=clip)
    scene, pose = basin.scene_of("skirt_steps")
    scene = replace(scene, garment=pipeline.garment.sew(scene.body))
    model = ClothedModel(scene=scene, draper=next(s.stage for s in pipeline.stages if s.label == "track").draper)
    cloth = model.drape(pose, scene.neutral_parameters, Past())
    surface = model.surface(pose, cloth)
    fields = [model_distance(surface, camera, 12.0) for camera in scene.cameras]
    seen = tuple(Silhouette(camera=k, layer="person", distance=field) for k, field in enumerate(fields))
    state = initial_state(pose, cloth.parameters, cloth)
    return replace(state, segmentation=Segmentation(silhouettes=seen)), model


@pytest.mark.parametrize("angles", [(), LEG], ids=["cloth", "leg and cloth"])
@pytest.mark.parametrize("rule", ["fd", "strand"])
def test_equations_lead_to_the_known_cloth(known, angles, rule):
    """T-FUT."""
    problem = Outline(*known, angles)
    budget = minimisers.Budget(problem, 100)
    start = problem.within(0.7 * np.random.default_rng(0).normal(size=problem.unknowns))
    with suppress(minimisers.Spent):
        minimisers.gauss_newton(budget, start, rule)
    assert budget.least[-1] < 0.05 * budget.least[0]


def test_both_rules_agree(known):
    problem = Outline(*known, LEG)
    at = 0.7 * np.random.default_rng(0).normal(size=problem.unknowns)
    fd, strand = (problem.equations(at, rule).gradient for rule in ("fd", "strand"))
    assert np.linalg.norm(fd - strand) < 0.2 * np.linalg.norm(strand)
    cloth = slice(len(LEG), None)
    assert np.linalg.norm(fd[cloth] - strand[cloth]) < 0.2 * np.linalg.norm(strand[cloth])


def test_first_are_tried_take_ups_and_forces_as_their_fitters_try_them(known):
    problem = Outline(*known, LEG)
    tried = [values * problem.spread[columns] for columns, values in problem.coarse[len(LEG) :]]
    assert [each.shape for each in tried] == [(15, 1), (7, 1), (25, 2), (25, 2)]
    assert np.abs(tried[0]).max() == pytest.approx(0.14)  # share of a strand
    assert np.degrees([np.linalg.norm(each, axis=1).max() for each in tried[1:]]) == pytest.approx(20.0)
