"""T-OUT3: angle diagrams, both systems in one, smooth and raw, and the tables that hold what they show."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure
from mocapflow_evaluation.evaluate import Evaluate
from mocapflow_evaluation.panels import title
from mocapflow_export import layout, tables
from mocapflow_export.export import Export
from mocapflow_report import plots
from mocapflow_report.report import Report
from mocapflow_sequence.smooth import Smooth
from results_scene import DEMO, demo_scene, stepping

from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.recordings.recording import open_recording
from mocapflow.results import RunFolder


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """The run folder, what was found in the comparison, and the panels of the diagram, by title."""
    scene, folder, figures = demo_scene(), tmp_path_factory.mktemp("run"), {}
    track = stepping(scene.body, 20)
    shaken = track.angles + 0.02 * np.random.default_rng(0).normal(size=track.angles.shape)
    track = Smooth().run(track=replace(track, angles=shaken), scene=scene)
    given = dict(scene=scene, recording=open_recording(DEMO), run_folder=RunFolder(path=folder, recipe={}))
    Export().run(track=track, **given)
    evaluation = Evaluate().run(track=track, **given)
    with pytest.MonkeyPatch.context() as patch:
        save = plots.save
        patch.setattr(plots, "save", lambda figure, path: figures.update({path.name: figure}) or save(figure, path))
        Report().run(track=track, evaluation=evaluation, **given)
    return folder, evaluation, [panel for panel in figures[layout.PLOT.name].axes if panel.lines]


def curves(panel):
    return {line.get_label(): line.get_xydata().T for line in panel.lines}


def test_every_panel_shows_the_tables_and_the_reference(drawn):
    folder, _, panels = drawn
    ours, raw = (read_columns(folder / table) for table in (layout.ANGLES, layout.RAW_ANGLES))
    truth, names = read_columns(DEMO / "truth" / "angles.csv"), tables.angle_names(ours)
    assert len(panels) == len(names) == 8
    for panel, name in zip(panels, names, strict=True):
        shown = curves(panel)
        assert set(shown) == {"mocapflow", "unsmoothed", "reference"}
        for label, table in (("mocapflow", ours), ("unsmoothed", raw), ("reference", truth)):
            np.testing.assert_array_equal(shown[label][0], ours["frame"])
            np.testing.assert_allclose(shown[label][1], table[name][:20], atol=1e-4)  # digits of the table
        assert np.abs(shown["mocapflow"][1] - shown["unsmoothed"][1]).max() > 0.1
        assert {line.get_label(): line.get_color() for line in panel.lines}["reference"] == "black"


def test_the_rms_is_printed_over_each_panel(drawn):
    _, evaluation, panels = drawn
    for panel, row in zip(panels, evaluation.rows, strict=True):
        shown = curves(panel)
        off = np.sqrt(np.mean((shown["mocapflow"][1] - shown["reference"][1]) ** 2))
        assert off == pytest.approx(row["rms_deg"], abs=0.01)
        assert panel.get_title(loc="left") == f"{title(str(row['angle']))}   RMS {row['rms_deg']:.2f}°"


def test_the_band_about_a_curve_is_its_interval_of_ninety_per_cent():
    panel, frame, value = Figure().subplots(), np.arange(4.0), np.array([10.0, 60.0, 30.0, 20.0])
    ours = {"frame": frame, "ankle_l": value, "ankle_l_sd": np.array([1.0, 2.0, np.nan, 300.0])}
    plots._curves(panel, "ankle_l", ours, {"ankle_l": value + 1}, {"ankle_l": value - 1})
    (band,) = panel.collections
    at = {(x, round(y, 4)) for x, y in band.get_paths()[0].vertices}
    for side in (-1.6449, 1.6449):
        assert at >= {
            (0, round(10 + side, 4)),
            (1, round(60 + 2 * side, 4)),
            (2, 30),
        }  # of a frame that nobody knows none
    assert panel.get_ylim() == pytest.approx((9 - 0.12 * 52, 61 + 0.12 * 52))  # however wide the band
    ours["ankle_l"] = np.array([10.0, 11.0, 10.5, 10.0])
    plots._curves(panel, "ankle_l", ours, ours, {})
    assert panel.get_ylim() == pytest.approx((8, 13))


def test_the_pictures_read_back(drawn):
    folder, _, _ = drawn
    for path in (layout.PLOT, layout.OVERLAP):
        assert cv2.imread(str(folder / path)).std() > 10
