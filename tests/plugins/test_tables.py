"""Tables of results: which columns and rows they have."""

from dataclasses import replace

import numpy as np
from mocapflow_export.tables import angle_names, energy_columns, write_columns, write_rows
from results_scene import demo_scene, stepping


def test_energy_has_a_row_for_every_turn_that_was_taken_whatever_terms_it_lacks():
    track = stepping(demo_scene().body, 2)
    energy = np.full((2, 3, 2), np.nan)
    energy[0, 0], energy[0, 1], energy[1, 0] = [1.0, 2.0], [3.0, np.nan], [5.0, 6.0]
    frames = replace(track, frame=np.array([7, 8], np.int32), energy=energy, energy_terms=("cam01.data", "rest_pose"))
    columns = energy_columns(frames)
    np.testing.assert_array_equal(np.stack(list(columns.values())), [[7, 7, 8], [0, 1, 0], [1, 3, 5], [2, np.nan, 6]])
    assert list(columns) == ["frame", "turn", "cam01.data", "rest_pose"]


def test_angles_are_told_from_what_is_known_of_them():
    columns = ("frame", "time", "knee_flexion_l", "knee_flexion_l_sd", "ankle_l", "ankle_l_observed")
    assert angle_names(columns) == ["knee_flexion_l", "ankle_l"]


def test_frames_are_whole_times_finer_than_values(tmp_path):
    columns = {"frame": np.array([3.0]), "time": np.array([0.1]), "knee": np.array([1 / 3]), "turn": np.array([2.0])}
    assert write_columns(tmp_path / "a.csv", columns).read_text() == "frame,time,knee,turn\n3,0.100000,0.3333,2\n"


def test_rows_have_one_header(tmp_path):
    rows = [{"angle": "knee", "rms_deg": 1.25}, {"angle": "hip", "rms_deg": 2.0}]
    assert write_rows(tmp_path / "a.csv", rows).read_text() == "angle,rms_deg\nknee,1.2500\nhip,2.0000\n"
    assert write_rows(tmp_path / "none.csv", []).read_text() == ""
