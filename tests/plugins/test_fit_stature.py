"""How tall the person is: the way down to the best stature, and what tells it."""

import logging
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from keypoint_recording import copy_demo, write
from mocapflow_bodies.template import Template
from mocapflow_fitting.proportions import modes_of, of_stature, scaled
from mocapflow_fitting.start_from_file import read_pose
from mocapflow_recovery import fit_stature
from mocapflow_recovery.fit_stature import FARTHEST, STEP, FitStature, Ladder, descended, vertex

from mocapflow.config.pipeline import load_pipeline
from mocapflow.dressing.tailor import Tailor
from mocapflow.errors import GarmentError
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording

DATA = Path(__file__).parents[2] / "examples" / "data"
SKIRT = DATA / "skirt_steps"


def height(body):
    return np.ptp(body.vertices[:, 2])


def tailor_of(recording, body, sew=lambda body: None):
    return Tailor(cameras=recording.cameras, body=body, sew=sew)


def wearable(lowest, highest):
    """Return how a garment is sewn that people of some heights can wear."""

    def sew(body):
        if not lowest < height(body) < highest:
            raise GarmentError("it can't be worn", hint="measure it again")

    return sew


def parabola(lowest):
    """Return a target at some steps that costs by how far they are from the lowest place of a parabola."""

    def target_at(steps):
        return SimpleNamespace(
            begins=lambda: [steps],
            costs=lambda poses: np.array([1 + (steps - lowest) ** 2 for _ in poses]),
            searched=lambda pose, seed: pose,
            centred=lambda pose: pose,
        )

    return target_at


def person_at(monkeypatch, body, lowest):
    """Let silhouettes tell best a stature at some steps from a body's."""
    steps_of = {round(height(body) * STEP**steps, 6): steps for steps in range(-FARTHEST, FARTHEST + 1)}
    monkeypatch.setattr(fit_stature, "first_trimaps", lambda recording, bare: None)
    monkeypatch.setattr(
        fit_stature, "target_of", lambda scene, *_: parabola(lowest)(steps_of[round(height(scene.body), 6)])
    )


def test_the_way_down_ends_where_both_neighbours_cost_more():
    assert descended(lambda at: (at - 5) ** 2, 0, 1) == 5
    assert descended(lambda at: (at - 5) ** 2, 0, 2) in (4, 6)
    assert descended(lambda at: np.inf if at > 2 else -at, -3, 1) == 2


@pytest.mark.parametrize("lowest", [-0.4, 0.0, 0.3])
def test_the_lowest_place_between_steps_is_that_of_a_parabola(lowest):
    assert vertex(lambda at: 3 + 2 * (at - lowest) ** 2, 0) == pytest.approx(lowest)


def test_beside_a_body_that_can_not_be_the_step_itself_is_the_lowest():
    assert vertex(lambda at: np.inf if at > 4 else 1.0 - at, 4) == 4.0
    assert vertex(lambda at: 1.0, 4) == 4.0


def test_a_body_of_another_stature_stands_on_its_soles_and_keeps_how_people_differ():
    body = Template().load(SKIRT)
    body = replace(body, vertices=body.vertices + [0, 0, 0.1], positions=body.positions + [0, 0, 0.1])
    other = of_stature(body, 1.1)
    assert height(other) == pytest.approx(1.1 * height(body))
    assert other.vertices[:, 2].min() == pytest.approx(body.vertices[:, 2].min())
    np.testing.assert_allclose(np.diff(other.positions, axis=0), 1.1 * np.diff(body.positions, axis=0), atol=1e-12)
    assert modes_of(other) == modes_of(body)
    by = {"shape_0": 1.0}
    np.testing.assert_allclose(height(scaled(other, by)), 1.1 * height(scaled(body, by)))
    axes = body.twists[:, :3]
    np.testing.assert_array_equal(other.twists[:, :3], axes)
    np.testing.assert_allclose(other.twists[:, 3:], -np.cross(axes, other.positions[body.screw_joint]), atol=1e-12)


def test_on_a_ladder_what_nobody_wears_costs_without_end():
    ladder = Ladder(lambda steps: None if steps > 2 else parabola(1.0)(steps))
    assert ladder.as_they_are(0) == 2.0 and ladder.as_they_are(3) == np.inf
    closely = ladder.searched_from(0)
    assert closely(1) == 1.0 and closely(3) == np.inf


@pytest.mark.parametrize("lowest", [-5.3, 0.2, 6.6])
def test_the_stature_that_silhouettes_tell_best_is_found(monkeypatch, lowest):
    body, recording = Template().load(SKIRT), open_recording(SKIRT)
    person_at(monkeypatch, body, lowest)
    other = FitStature().run(recording, tailor_of(recording, body))
    assert height(other) / height(body) == pytest.approx(STEP**lowest if abs(lowest) > 1 else 1.0)


def test_a_garment_that_ends_the_way_is_warned_of(monkeypatch, caplog):
    body, recording = Template().load(SKIRT), open_recording(SKIRT)
    person_at(monkeypatch, body, 0)
    worn = wearable(STEP**3.5 * height(body), 3.0)
    other = FitStature().run(recording, tailor_of(recording, body, worn))
    assert height(other) == pytest.approx(STEP**4 * height(body))
    assert "can't be sewn on anybody who is shorter than 1.88 m, as the person may be: are its meas" in caplog.text
    with pytest.raises(GarmentError, match="measure it again"):
        FitStature().run(recording, tailor_of(recording, body, wearable(5.0, 6.0)))


def test_a_person_beyond_all_statures_is_warned_of(monkeypatch, caplog):
    body, recording = Template().load(SKIRT), open_recording(SKIRT)
    person_at(monkeypatch, body, 40)
    FitStature().run(recording, tailor_of(recording, body))
    assert "nobody was tried who is taller than 2.68 m" in caplog.text and "in metres?" in caplog.text


@pytest.mark.parametrize("times", [0.8, 0.98, 1.15])
def test_without_plates_keypoints_tell_the_stature_unless_it_is_near(tmp_path, times, cameras, caplog):
    caplog.set_level(logging.INFO)
    person = Template(shape=0.0).load(SKIRT)
    folder = copy_demo(tmp_path / "recording")
    write(folder, person, [read_pose(SKIRT / "init.json", person)], cameras)
    recording, body = open_recording(folder, stop=1), of_stature(person, 1 / times)
    found = FitStature().run(recording, tailor_of(recording, body))
    assert height(found) == pytest.approx(height(person if abs(times - 1) > 0.04 else body), rel=0.02)
    assert f"the person is about {height(person):.2f}"[:-1] in caplog.text


def test_a_body_that_can_not_wear_the_garment_is_scaled_however_near(monkeypatch):
    body, recording = Template().load(SKIRT), open_recording(SKIRT)
    person_at(monkeypatch, body, 1.2)
    worn = wearable(height(body) + 1e-6, 3.0)
    assert FitStature().run(recording, tailor_of(recording, body)) is body
    assert height(FitStature().run(recording, tailor_of(recording, body, worn))) > 1.02 * height(body)


def test_where_nothing_tells_it_the_body_stays_and_that_is_said(tmp_path, caplog):
    for name in ("videos", "cameras.toml"):
        (tmp_path / name).symlink_to(SKIRT / name)
    recording, body = open_recording(tmp_path), Template().load(SKIRT)
    assert FitStature().run(recording, tailor_of(recording, body)) is body
    assert "say so by body.height_m" in caplog.text


@pytest.mark.long
@pytest.mark.parametrize(("clip", "scanned"), [("skirt_steps", 1.68), ("shorts_steps", 1.76)])
@pytest.mark.parametrize("start", [1.5, 1.9])
def test_from_far_off_the_person_of_a_demo_is_found(clip, scanned, start):
    pipeline = load_pipeline(shipped("pipelines", "skirt.yaml"), recording=DATA / clip)
    recording = open_recording(DATA / clip)
    tailor = tailor_of(recording, Template(height_m=start).load(DATA / clip), pipeline.garment.sew)
    assert height(FitStature().run(recording, tailor)) == pytest.approx(scanned, rel=0.04)
