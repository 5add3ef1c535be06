"""Inner markers that only a standing trial has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from marker_take import NAMES, on_landmarks
from mocapflow_evaluation.evaluate import chosen
from mocapflow_evaluation.references import Reference, read_reference
from results_scene import demo_scene, make_track, stepping

from mocapflow.data import PoseBatch
from mocapflow.errors import RecordingError
from mocapflow.geometry import kinematics
from mocapflow.io.motion.opensim_axes import opensim_from_world
from mocapflow.io.motion.trc import write_trc
from mocapflow.results import Track

BODY = demo_scene().body
MOVING = stepping(BODY, 40)
STILL = make_track(np.tile(np.eye(4), (5, 1, 1)), np.zeros((5, len(BODY.screw_names))))
ASIDE_M = 0.07  # of a marker on a thigh or shank, off the line between its ends
Markers = dict[str, np.ndarray]  # (T, 3) m by label


def markers(track: Track) -> Markers:
    """Return all markers of a track: landmarks, one more on each thigh and shank, and one on each hand."""
    at = {name: BODY.positions[BODY.joint(name)] for name in BODY.joint_names}
    placed = {f"{mark[-1].upper()}{NAMES[mark[:-2]]}": where for mark, where in on_landmarks(BODY).items()}
    for side, sign in (("l", 1.0), ("r", -1.0)):
        for label, upper, lower in (("THI", "hip", "knee"), ("TIB", "knee", "ankle")):
            middle = (at[f"{upper}_{side}"] + at[f"{lower}_{side}"]) / 2
            placed[f"{side.upper()}{label}"] = f"{upper}_{side}", middle + [sign * ASIDE_M, 0.02, 0]
        # it hangs beside the thigh, between its ends
        placed[f"{side.upper()}FIN"] = f"wrist_{side}", (at[f"hip_{side}"] + 2 * at[f"knee_{side}"]) / 3
    joints = kinematics.chain_batch(BODY, PoseBatch(root=track.root, angles=track.angles))
    carried = {label: joints[:, BODY.joint(joint)] for label, (joint, _) in placed.items()}
    return {label: c[:, :3, :3] @ placed[label][1] + c[:, :3, 3] for label, c in carried.items()}


def write(path: Path, shown: Markers) -> Path:
    write_trc(path, list(shown), opensim_from_world(np.stack(list(shown.values()), axis=1)), 30.0)
    return path


def without(shown: Markers, *ends: str) -> Markers:
    return {label: places for label, places in shown.items() if not label.endswith(ends)}


def read(folder: Path, moving: Markers, still: Markers | None = None) -> Reference:
    """Return a reference without the inner markers of the legs, beside a standing trial that has them."""
    write(folder / "static.trc", markers(STILL) if still is None else still)
    return read_reference(write(folder / "walk.trc", without(moving, "KNM", "MED")))


@pytest.mark.parametrize("share", [1.0, 0.15], ids=["steps", "knees that hardly bend"])
def test_inner_markers_are_carried_along_as_they_stood(share: float, tmp_path: Path) -> None:
    moving = markers(make_track(MOVING.root, share * MOVING.angles))
    if share < 1:
        moving = without(moving, "FIN")  # a hand that stays where it hung is one with the thigh
    whole = read_reference(write(tmp_path / "whole.trc", moving))
    got = read(tmp_path, moving)
    assert got.curves.keys() == whole.curves.keys() >= {"knee_flexion_l", "knee_angle_r", "ankle_l"}
    for name, curve in whole.curves.items():
        np.testing.assert_allclose(got.curves[name], curve, atol=1e-3, err_msg=name)
    said = "knee_medial_l, knee_medial_r, ankle_medial_l, ankle_medial_r as they stood in static.trc"
    assert any(note.startswith(said) for note in got.notes)


def test_a_joint_is_unknown_while_its_segment_shows_too_little(tmp_path: Path) -> None:
    moving = markers(MOVING)
    moving["LTHI"][10:13] = moving["LKNE"][11] = np.nan
    got = read(tmp_path, moving).curves
    assert np.flatnonzero(np.isnan(got["knee_flexion_l"])).tolist() == [10, 11, 12]
    assert np.isfinite(got["knee_flexion_r"]).all()


@pytest.mark.parametrize("trial", ["motion", "standing trial"])
@pytest.mark.parametrize("hidden", ["LTHI", "LASI"])
def test_without_an_end_or_a_third_marker_a_segment_tells_no_turn(trial: str, hidden: str, tmp_path: Path) -> None:
    both = {"motion": markers(MOVING), "standing trial": markers(STILL)}
    both[trial] = without(both[trial], hidden)
    got = read(tmp_path, both["motion"], both["standing trial"])
    assert not {"knee_flexion_l", "ankle_l"} & got.curves.keys()
    assert ("knee_flexion_r" in got.curves) == (hidden == "LTHI")  # hips need both front spines
    (said,) = (note for note in got.notes if "can't be carried along" in note)
    assert said.startswith("knee_medial_l, ")


def test_points_on_one_line_tell_no_turn(tmp_path: Path) -> None:
    moving, still = markers(MOVING), markers(STILL)
    for trial in (moving, still):
        trial["LTHI"] = 0.5 * (trial["LKNE"] + _hip(tmp_path, trial))
    assert "hip_flexion_l" not in read(tmp_path, moving, still).curves


def _hip(folder: Path, trial: Markers) -> np.ndarray:
    found = read_reference(write(folder / "hips.trc", trial))
    assert found.joints is not None
    return found.joints[:, found.joint_names.index("hip_l")]


def test_what_the_motion_shows_is_not_replaced(tmp_path: Path) -> None:
    moving = markers(MOVING)
    write(tmp_path / "static.trc", {**markers(STILL), "LKNM": markers(STILL)["LKNM"] + [0.02, 0, 0]})
    got = read_reference(write(tmp_path / "walk.trc", moving))
    expected = read_reference(write(tmp_path / "static.trc", moving))  # a file has no standing trial in itself
    np.testing.assert_array_equal(got.curves["knee_flexion_l"], expected.curves["knee_flexion_l"])


def test_who_moves_does_not_stand(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"static\.trc  \w+ moves by 0\.\d\d m in this standing trial\n.*cut it"):
        read(tmp_path, markers(MOVING), markers(MOVING))


def test_names_told_may_be_those_of_one_of_both(tmp_path: Path) -> None:
    (tmp_path / "markers.toml").write_text('knee_medial_l = "Inner"\n')
    still = markers(STILL)
    still["Inner"] = still.pop("LKNM")
    assert "knee_flexion_l" in read(tmp_path, markers(MOVING), still).curves


def test_a_standing_trial_is_no_reference_itself(tmp_path: Path) -> None:
    (tmp_path / "reference").mkdir()
    read(tmp_path / "reference", markers(MOVING))
    assert chosen(tmp_path, "") == (tmp_path / "reference" / "walk.trc", "")
