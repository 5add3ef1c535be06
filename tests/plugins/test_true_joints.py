"""Joint centres of the truth: read beside its angles, and compared as they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mocapflow_evaluation import tracked_motion, true_joints
from mocapflow_evaluation.evaluate import evaluate
from mocapflow_evaluation.references import read_reference
from mocapflow_evaluation.tracked_motion import TrackedMotion
from mocapflow_export import layout, tables
from results_scene import demo_scene, stepping

from mocapflow.errors import RecordingError
from mocapflow.records import F64

SCENE = demo_scene()
SHIFT = np.array([0.003, 0.0, 0.004])  # m: 5 mm


@pytest.fixture(scope="module")
def own() -> TrackedMotion:
    return tracked_motion.of_track(stepping(SCENE.body, 30), SCENE)


def write_truth(folder: Path, own: TrackedMotion, places: F64, names: tuple[str, ...] | None = None) -> Path:
    """Write the angles of a track as the truth, and joint centres (T, J, 3) m, a row for each frame of the video."""
    tables.write_columns(
        folder / "angles.csv", {n: own.columns[n] for n in ("frame", "knee_flexion_l", "hip_flexion_l")}
    )
    np.savez(folder / "joints.npz", positions=places.astype(np.float32), names=names or own.stick.names)
    return folder / "angles.csv"


def distances(folder: Path) -> dict[str, float]:
    rows = [line.split(",") for line in (folder / layout.DISTANCES).read_text().splitlines()]
    return {row[0]: float(row[rows[0].index("mean_mm")]) for row in rows[1:]}


@pytest.mark.usefixtures("undrawn")
def test_a_whole_person_beside_the_truth_is_not_moved_to_it(own: TrackedMotion, tmp_path: Path) -> None:
    got = evaluate(own, write_truth(tmp_path, own, own.stick.places + SHIFT), tmp_path / "run")
    far = distances(tmp_path / "run")
    assert far.keys() == set(own.stick.names)
    np.testing.assert_allclose(list(far.values()), 5.0, atol=0.01)
    assert not any("registered" in note for note in got.notes)


@pytest.mark.usefixtures("undrawn")
def test_rows_are_those_of_the_frames(own: TrackedMotion, tmp_path: Path) -> None:
    """The run and the table of angles begin at frame 10, the centres at the first frame of the video."""
    path = write_truth(tmp_path, own, own.stick.places)
    columns, raw = ({name: values[10:] for name, values in part.items()} for part in (own.columns, own.raw))
    late = TrackedMotion(columns=columns, raw=raw, stick=replace(own.stick, places=own.stick.places[10:]))
    tables.write_columns(path, {name: columns[name] for name in ("frame", "knee_flexion_l")})
    evaluate(late, path, tmp_path / "run")
    assert max(distances(tmp_path / "run").values()) < 0.01


def test_a_table_by_time_has_no_centres(own: TrackedMotion, tmp_path: Path) -> None:
    path = write_truth(tmp_path, own, own.stick.places)
    path.write_text("time,knee_flexion_l\n0,1\n0.04,2\n")
    assert read_reference(path).joints is None


@pytest.mark.usefixtures("undrawn")
def test_centres_of_other_names_are_told(own: TrackedMotion, tmp_path: Path) -> None:
    names = tuple(f"joint {number}" for number in range(len(own.stick.names)))
    got = evaluate(own, write_truth(tmp_path, own, own.stick.places, names), tmp_path / "run")
    assert "no joint distances: too few joint centres that both systems have" in got.notes


def test_centres_that_can_not_be_read_are_told(own: TrackedMotion, tmp_path: Path) -> None:
    path = write_truth(tmp_path, own, own.stick.places[:20])
    for frame in (-1.0, 0.5):
        with pytest.raises(RecordingError, match=rf"frame {frame:g} is not among its 20 rows"):
            true_joints.beside(path, np.array([frame]))
    with pytest.raises(RecordingError, match=r"joints\.npz  frame 20 is not among its 20 rows(.|\n)*row i is frame i"):
        evaluate(own, path, tmp_path)
    write_truth(tmp_path, own, own.stick.places[:, :3])
    with pytest.raises(RecordingError, match=r"shape \(30, 3, 3\), expected \(T, 19, 3\)"):
        evaluate(own, path, tmp_path)
    write_truth(tmp_path, own, own.stick.places[..., :2])
    with pytest.raises(RecordingError, match=r"shape \(30, 19, 2\), expected"):
        evaluate(own, path, tmp_path)
    np.savez(tmp_path / "joints.npz", places=own.stick.places)
    with pytest.raises(RecordingError, match=r"can't be read: .*names(.|\n)*positions \(T, J, 3\) m, names"):
        evaluate(own, path, tmp_path)
    whole = (tmp_path / "joints.npz").read_bytes()
    for content in (b"no archive", b"", whole[:-9], whole.replace(b"NUMPY", b"numpy", 1)):
        (tmp_path / "joints.npz").write_bytes(content)
        with pytest.raises(RecordingError, match=r"joints\.npz  can't be read"):
            evaluate(own, path, tmp_path)
