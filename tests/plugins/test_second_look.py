"""Frames that leap out from between their neighbours: which are looked at again, from where, and what is kept."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from mocapflow_matching.camouflage import FEET
from mocapflow_recovery.limb_search import LimbSearch
from mocapflow_recovery.refit_windows import LEAD_IN, WINDOW, pictured, windows
from mocapflow_recovery.revised_track import RevisedTrack
from mocapflow_recovery.scoring import mismatch_of
from mocapflow_recovery.second_look import Refitter, SecondLook
from results_scene import DEMO, demo_scene, stepping

from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import NO_CLOTH, Change, Cloth, FrameResult, Past, Pose
from mocapflow.help.shipped import shipped
from mocapflow.prediction import initial_state
from mocapflow.recordings.recording import open_recording
from mocapflow.results import ImageFlow, Track, ViewChecks
from mocapflow.series import Series
from mocapflow.testing import pictures, recovery, scenes
from mocapflow.track import CoupledLoop

SCENE = demo_scene()
TRUE = stepping(SCENE.body)  # 40 frames, both knees swing
KNEE = SCENE.body.screw_names.index("knee_l.x")
ROW = 12
RECORDING = open_recording(DEMO, stop=len(TRUE.frame))
STAGES = load_pipeline(shipped("pipelines", "bare.yaml"), recording=DEMO).stages
LOOP = next(named.stage for named in STAGES if isinstance(named.stage, CoupledLoop))
MORE_MISMATCH = Refitter.more_mismatch


def astray(*rows: int, by: float = 0.8) -> Track:
    """The track with a knee that is off in some rows."""
    angles = TRUE.angles.copy()
    angles[list(rows), KNEE] += by
    return replace(TRUE, angles=angles, notes=("frame 3: cam01 black", "frame 30: lost"))


def fitted(pose: Pose, cost: float = 0.5) -> FrameResult:
    """A result of the loop that costs so much by the pictures; those of the track cost 0.5."""
    return FrameResult(
        state=initial_state(pose, np.zeros(0), NO_CLOTH), iterations=1, steady=True, oscillating=False,
        change=Change(body=0.0, cloth=0.0, angles=0.0, sigmas=0.0), overlap=np.full(4, 0.8),
        energy=np.array([[cost, 0.0], [np.nan, np.nan], [np.nan, np.nan]]),
        energy_terms=("cam01.data", "rest_pose"),
    )  # fmt: skip


@pytest.fixture(autouse=True)
def mismatch(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Of the person off the model, cm²: in the fit that stands, and in the other one."""
    areas = [0.0, 0.0]
    monkeypatch.setattr(Refitter, "more_mismatch", lambda *given: areas[1] - areas[0])
    return areas


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, Past, Pose]]:
    """What the loop is asked for: frame, past and start. It answers with the true pose, which pictures like."""
    asked = []

    def settle(loop, frame, past, model, pose, parameters):
        asked.append((frame.index, past, pose))
        return fitted(TRUE.pose(frame.index), cost=0.49)

    monkeypatch.setattr(CoupledLoop, "settled", settle)
    return asked


def second_look(track: Track, **settings: float) -> Track:
    return SecondLook(**settings).run(track, LOOP, RECORDING, SCENE, RECORDING.background())


def test_a_frame_that_leaps_is_fitted_again_from_between_its_neighbours(looked):
    again = second_look(replace(astray(ROW), doubted=TRUE.frame == ROW))
    np.testing.assert_array_equal(again.angles, TRUE.angles)
    np.testing.assert_array_equal(again.root, TRUE.root)
    assert np.flatnonzero(again.doubted).tolist() == [ROW]  # the room behind is what it was
    colours, same, (index, past, start) = looked  # the frame after that wrong one leaps, too
    assert (colours[0], same[0], index) == (ROW + 2, ROW + 1, ROW)
    assert abs(start.angles[KNEE] - TRUE.angles[[ROW - 1, ROW + 1], KNEE].mean()) < 1e-12
    assert [moment.time for moment in past.moments] == TRUE.time[ROW - 3 : ROW].tolist()
    assert again.overlap[ROW].tolist() == [0.8] * 4 and again.overlap[ROW + 1].tolist() == [0.9] * 4
    assert (again.seconds == TRUE.seconds).all()
    assert again.covariance.shape == TRUE.covariance.shape and again.covariance[ROW, 0, 0] > 1
    first, note, last = again.notes
    assert (first, last) == astray(ROW).notes
    assert note == f"frame {ROW}: fitted again from between its neighbours"


def test_what_a_frame_knows_of_those_before_it_is_their_better_fit():
    fits, frame = RevisedTrack(astray(ROW), SCENE.body), next(RECORDING.frames(since=ROW))
    better = fitted(TRUE.pose(ROW))
    hung = Cloth(vertices=np.ones((4, 3)), parameters=np.array([0.1, 0.2]))
    sure = replace(better.state.estimate, observed=np.full(len(TRUE.angles[ROW]), 0.75))
    fits.replace_fit(ROW, frame, replace(better, state=replace(better.state, estimate=sure, cloth=hung)))
    assert fits.cloth(ROW).parameters.tolist() == [0.1, 0.2] and (fits.cloth(ROW).vertices == 1).all()
    latest = fits.past(ROW + 1, {}).moments[-1]
    assert latest.cloth.parameters.tolist() == [0.1, 0.2] and (latest.observed == 0.75).all()
    assert latest.pose.angles[KNEE] == TRUE.angles[ROW, KNEE] and latest.time == TRUE.time[ROW]
    assert fits.past(ROW + 2, {}).moments[-1].pose.angles[KNEE] == TRUE.angles[ROW + 1, KNEE]
    windy = RevisedTrack(replace(TRUE, cloth_parameters=np.arange(80.0).reshape(40, 2)), SCENE.body)
    assert windy.cloth(ROW).parameters.tolist() == [2 * ROW, 2 * ROW + 1]
    seen = TRUE.observed * ~np.isin(TRUE.frame, [ROW - 2, ROW - 1])[:, None]
    gap = RevisedTrack(replace(TRUE, observed=seen), SCENE.body).past(ROW, {})
    assert gap.after_gap and not gap.moments


@pytest.mark.parametrize("row", [ROW, len(TRUE.frame) - 1])
def test_feet_that_look_like_the_floor_stay_unmatched(looked, monkeypatch, row):
    def told(finder, frame, result, past, model):
        known = replace(result.state.segmentation, appearance={FEET: np.ones(3)})
        return replace(result, state=replace(result.state, segmentation=known))

    monkeypatch.setattr(LimbSearch, "with_camouflaged_feet", told)
    second_look(astray(row))
    (_, colours, _), *_, (last, known, _) = looked
    assert FEET not in colours.appearance
    assert last == row and FEET in known.appearance


def test_a_limb_that_was_lost_for_some_frames_is_followed_back(looked):
    rows = range(ROW, ROW + WINDOW + LEAD_IN)  # longer than a window
    again = second_look(astray(*rows))
    np.testing.assert_array_equal(again.angles, TRUE.angles)
    indices = [index for index, *_ in looked]
    assert set(rows) <= set(indices) and len(indices) < 2 * len(rows)


def test_a_row_at_which_a_window_is_cut_is_fitted_in_the_next(looked, monkeypatch):
    """There the row after it shows the colours; where it is the last, only those before it are at hand."""
    shown = []  # (fits so far, row that shows colours)

    def appearance(refitter, frame, row):
        shown.append((len(looked), row))
        return {}

    monkeypatch.setattr(Refitter, "appearance", appearance)
    again = second_look(astray(*range(ROW, ROW + WINDOW, 2)))
    np.testing.assert_array_equal(again.angles, TRUE.angles)
    assert len(shown) > 1
    for (first, row), (after, _) in pairwise([*shown, (len(looked), 0)]):
        assert all(index < row for index, *_ in looked[first:after])


def test_a_frame_is_due_again_when_one_beside_it_has_another_fit(monkeypatch):
    track, asked = astray(ROW, ROW + 1), []

    def settle(loop, frame, past, model, pose, parameters):
        asked.append(frame.index)
        lost = frame.index == ROW + 1 and asked.count(ROW + 1) == 1
        return fitted((track if lost else TRUE).pose(frame.index), cost=0.49)

    monkeypatch.setattr(CoupledLoop, "settled", settle)
    np.testing.assert_array_equal(second_look(track).angles, TRUE.angles)


def test_a_frame_that_has_another_fit_is_not_fitted_again(monkeypatch):
    asked, better = [], astray(ROW, ROW + 1, by=0.5)

    def settle(loop, frame, past, model, pose, parameters):
        asked.append(frame.index)
        return fitted(better.pose(frame.index), cost=0.49)

    monkeypatch.setattr(CoupledLoop, "settled", settle)
    np.testing.assert_array_equal(second_look(astray(ROW, ROW + 1)).angles, better.angles)
    assert asked.count(ROW) == asked.count(ROW + 1) == 1


@pytest.mark.parametrize("end", [0, len(TRUE.frame) - 1])
def test_an_end_is_fitted_again_if_the_frame_beside_it_leaps(looked, end):
    again = second_look(astray(end))
    np.testing.assert_array_equal(again.angles, TRUE.angles)
    assert f"frame {end}: fitted again, for the frame beside it leaps" in again.notes
    indices = [index for index, *_ in looked]  # what shows the colours, and is fitted again by them, in turn
    assert indices == ([end, end - 1, end - 1, end] if end else [2, 1, 0])
    _, past, start = looked[-1]
    near, next_to_near = TRUE.angles[[1, 2], KNEE]
    frame = next(RECORDING.frames(since=end))
    lead = LOOP.predictor.predict(frame, past, SCENE).angles[KNEE] if end else 2 * near - next_to_near
    assert abs(start.angles[KNEE] - lead) < 1e-12


def test_of_two_frames_none_leaps():
    track = astray(0)
    two = SimpleNamespace(root=track.root[:2], angles=track.angles[:2], lost=np.zeros(2, bool))
    assert RevisedTrack(two, SCENE.body).leaps().tolist() == [0.0, 0.0]


def test_a_smooth_track_stays_as_it_is_and_no_picture_is_read(looked, monkeypatch):
    monkeypatch.setattr(type(RECORDING), "frames", None)
    assert second_look(TRUE) is TRUE
    assert not looked


@pytest.mark.parametrize(
    ("cost", "kept"),
    [(0.5, False), (0.4, False), (0.8, False), (1.0, True)],  # of the fit that leaps less, beside 0.5
)
def test_the_pictures_have_their_say(monkeypatch, cost, kept):
    monkeypatch.setattr(CoupledLoop, "settled", lambda *given: fitted(TRUE.pose(given[1].index), cost))
    track = astray(ROW)
    assert (second_look(track) is track) is kept


@pytest.mark.parametrize(("areas", "kept"), [((0.0, 400.0), True), ((100.0, 0.0), False)])
def test_the_mismatch_has_its_say(monkeypatch, mismatch, areas, kept):
    track = astray(ROW)
    cost = 0.5 if kept else 0.6  # of silhouettes that like the other fit, or do not
    monkeypatch.setattr(CoupledLoop, "settled", lambda *given: fitted(TRUE.pose(given[1].index), cost))
    mismatch[:] = areas
    assert (second_look(track) is track) is kept


def test_what_lies_apart_more_is_the_person_off_the_model_and_skin_in_empty_space():
    """Of a leg that is spread by too much in both fits."""
    scene = scenes.tiny_scene()
    pose = scenes.tiny_pose(scene, 3, 0.1)
    leg = np.arange(len(pose.angles)) == 1
    stands, other = (Pose(root=pose.root, angles=pose.angles + by * leg) for by in (0.4, 0.8))
    frame, past = pictures.tiny_frame(scene, pose), Past()
    trimaps = LimbSearch().trimaps(frame, scene.surface(stands, NO_CLOTH), past, scene)
    before, now = (mismatch_of(scene.surface(each, NO_CLOTH), scene, trimaps) for each in (stands, other))
    standing = SimpleNamespace(pose=lambda row: stands, cloth=lambda row: NO_CLOTH)
    refitter = Refitter(SimpleNamespace(recovery=None), scenes.tiny_model(scene), standing, 0.04, np.zeros(1, bool))
    result = recovery.settled(pictures.tiny_state(scene, other, pose), scene)
    assert min(before.hint, before.floating, now.hint, now.floating) > 100  # cm²
    more = now.hint + now.floating - before.hint - before.floating
    assert MORE_MISMATCH(refitter, frame, 0, past, result) == pytest.approx(more)


def test_a_track_that_nothing_recovers_is_looked_at_too(looked):
    loop = LOOP.model_copy(update={"recovery": None})
    again = SecondLook().run(astray(ROW), loop, RECORDING, SCENE, RECORDING.background())
    np.testing.assert_array_equal(again.angles, TRUE.angles)


def test_pictures_are_those_that_were_tracked(monkeypatch):
    """Without wrong views, with the flow into them."""
    shown = []
    monkeypatch.setattr(Refitter, "refit", lambda again, rows, frames: again.tried.fill(True) or shown.extend(frames))
    checks = ViewChecks(frame=np.array([ROW], np.int32), camera=np.array([1], np.int16), reasons=("torn",))
    one = {"pixel": np.ones((1, 2), np.float32), "displacement": np.ones((1, 2), np.float32)}
    flow = ImageFlow(frame=np.full(1, ROW, np.int32), camera=np.full(1, 2, np.int16), cameras=4, **one)
    SecondLook().run(astray(ROW), LOOP, RECORDING, SCENE, RECORDING.background(), flow, checks)
    (frame,) = (frame for frame in shown if frame.index == ROW)
    assert frame.usable.tolist() == [True, False, True, True]
    assert [len(view.pixel) for view in frame.flow] == [0, 0, 1, 0]


def test_without_the_empty_scene_no_frame_is_looked_at(looked, caplog):
    track = astray(ROW)
    assert SecondLook().run(track, LOOP, RECORDING, SCENE) is track
    assert not looked and "second_look needs the empty scene" in caplog.text


def test_where_the_person_leapt_both_fits_are_the_same(monkeypatch):
    track = astray(ROW)
    monkeypatch.setattr(CoupledLoop, "settled", lambda *given: fitted(track.pose(given[1].index), cost=0.1))
    assert second_look(track) is track


@pytest.mark.parametrize("lost", [ROW - 1, ROW, ROW + 1])
def test_lost_frames_say_nothing_of_their_neighbours(looked, lost):
    track = astray(ROW)
    usable = track.usable.copy()
    usable[lost] = False
    assert second_look(replace(track, usable=usable)).angles[ROW, KNEE] == track.angles[ROW, KNEE]


def test_times_say_where_between_a_frame_is():
    fits = RevisedTrack(replace(TRUE, time=np.where(TRUE.frame < 13, TRUE.time, TRUE.time + 2 / 30)), SCENE.body)
    quarter = fits.between(12).angles[KNEE]
    assert abs(quarter - (0.75 * TRUE.angles[11, KNEE] + 0.25 * TRUE.angles[13, KNEE])) < 1e-12
    midway = RevisedTrack(TRUE, SCENE.body).between(12)
    assert fits.leap_of(12, fits.between(12)) < 0.1 * fits.leap_of(12, midway)


def test_leaps_are_what_joints_are_off_by():
    track = replace(TRUE, angles=np.tile(TRUE.angles[:1], (40, 1)))
    root = track.root.copy()
    root[20, :3, 3] += [0.03, 0.0, 0.04]
    leaps = RevisedTrack(replace(track, root=root), SCENE.body).leaps()
    np.testing.assert_allclose(leaps[[19, 20, 21]], [0.025, 0.05, 0.025], atol=1e-9)
    assert leaps[:19].max() < 1e-12 and leaps[22:].max() < 1e-12


@pytest.mark.parametrize("end", [0, len(TRUE.frame) - 1])
def test_an_end_leaps_by_what_the_frame_beside_it_is_off_by(end):
    root = np.tile(TRUE.root[:1], (40, 1, 1))
    root[end, 0, 3] += 0.05
    fits = RevisedTrack(replace(TRUE, root=root, angles=np.tile(TRUE.angles[:1], (40, 1))), SCENE.body)
    beside = 1 if end == 0 else end - 1
    assert fits.leap_of(end, fits.pose(end)) == pytest.approx(0.025)
    assert fits.leap_of(end, fits.pose(beside)) == pytest.approx(0, abs=1e-12)


def test_wide_arrays_stay_on_the_drive():
    track = astray(ROW)
    read = []
    covariance = Series(track.covariance.shape, lambda rows: read.append(rows) or np.asarray(track.covariance)[rows])
    again = RevisedTrack(replace(track, covariance=covariance), SCENE.body)
    read.clear()
    again.replace_fit(ROW, next(RECORDING.frames(since=ROW)), fitted(TRUE.pose(ROW)))
    made = again.track()
    assert isinstance(made.covariance, Series) and not read
    assert made.covariance[ROW][0, 0] > 1 > made.covariance[ROW + 1][0, 0]


@pytest.mark.parametrize("count", [1, 2, 5, 9, 30])
def test_windows_overlap_by_the_row_that_shows_colours(count):
    suspect = np.zeros(60, bool)
    suspect[20 : 20 + count] = True
    rows = [window.tolist() for window in windows(suspect)]
    assert rows[0][0] == 20 - LEAD_IN and rows[-1][-1] == 20 + count
    assert all(len(window) <= WINDOW for window in rows)
    assert all(one[-1] == other[0] for one, other in zip(rows, rows[1:], strict=False))
    assert {row for window in rows for row in window[:-1]} >= set(range(20, 20 + count))


def test_windows_at_the_ends_and_of_nothing():
    assert list(windows(np.zeros(5, bool))) == []
    assert [window.tolist() for window in windows(np.array([False, True, False, False]))] == [[0, 1, 2]]


def test_pictures_are_decoded_once(monkeypatch):
    read = []
    frames = RECORDING.frames

    def told(self, since=None):
        for frame in frames(since):
            read.append(frame.index)
            yield frame

    monkeypatch.setattr(type(RECORDING), "frames", told)
    number = np.arange(40, dtype=np.int32)
    groups = [np.array([5, 6, 7], np.int32), np.array([7, 8], np.int32), np.array([20, 21], np.int32)]
    found = [[frame.index for frame in held] for _, held in pictured(RECORDING, number, groups)]
    assert found == [[5, 6, 7], [7, 8], [20, 21]]
    assert read == list(range(5, 22))
