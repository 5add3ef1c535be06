"""Experiments: every combination of levels on every recording, and errors with their lines."""

from __future__ import annotations

from pathlib import Path

import pytest

from mocapflow.config.experiment import load_experiment
from mocapflow.errors import PipelineError

GRID = """mocapflow: 1
pipeline: base.yaml
recordings: [takes/a, b]
frames: 0:20
change: {stages.overlay: null}
factors:
  draper:
    rings:
    strands: {stages.track.draper: {use: kinematic, sweeps: 0}}
  matcher:
    contours:
    both: {stages.track.matchers: [contour_icp, optical_flow], pipeline: other.yaml}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "grid.yaml"
    path.write_text(text)
    return path


def test_every_combination_on_every_recording(tmp_path: Path) -> None:
    cells = load_experiment(written(tmp_path, GRID))
    assert [cell.variant for cell in cells[::2]] == ["rings+contours", "rings+both", "strands+contours", "strands+both"]
    assert [cell.name for cell in cells[:2]] == ["a", "b"]
    assert cells[0].recording == tmp_path / "takes" / "a"
    assert cells[0].changes == ("stages.overlay=null",)
    last = cells[-1]
    assert (last.pipeline, last.frames) == (tmp_path / "other.yaml", "0:20")
    assert last.changes == (
        "stages.overlay=null",
        'stages.track.draper={"use": "kinematic", "sweeps": 0}',
        'stages.track.matchers=["contour_icp", "optical_flow"]',
    )


def test_frames_that_are_given_count_and_paths_start_at_the_folder_of_the_experiment(tmp_path: Path) -> None:
    path = written(tmp_path, GRID.replace("other.yaml", "elsewhere/other.yaml"))
    last = load_experiment(path, frames="0:5")[-1]
    assert (last.pipeline, last.folder, last.frames) == (tmp_path / "elsewhere" / "other.yaml", tmp_path, "0:5")


def test_a_step_of_no_frame_is_refused_however_it_is_written(tmp_path: Path) -> None:
    for said in ("0:20:0", "{step: 0}"):
        with pytest.raises(PipelineError, match="input should be greater than 0, not 0"):
            load_experiment(written(tmp_path, GRID.replace("frames: 0:20", f"frames: {said}")))


def test_each_change_knows_where_it_is_said(tmp_path: Path) -> None:
    last = load_experiment(written(tmp_path, GRID))[-1]
    assert [place.removeprefix(f"{tmp_path}/") for place in last.places] == [
        "grid.yaml:5:10",
        "grid.yaml:9:15",
        "grid.yaml:12:12",
    ]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("stages.track.draper", "stages.track.draper"),
        ("stages.track.draper.sweeps", "stages.track.draper"),
        ("stages.corrupt before track", "stages.corrupt"),
        ("pipeline", "pipeline"),
    ],
)
def test_factors_that_change_the_same_are_refused_with_both_lines(tmp_path: Path, first: str, second: str) -> None:
    text = GRID.replace("stages.track.draper:", f"{first}:").replace("stages.track.matchers:", f"{second}:")
    with pytest.raises(PipelineError) as caught:
        load_experiment(written(tmp_path, text.replace(", pipeline: other.yaml", "")))
    said = str(caught.value)
    assert f"grid.yaml:12:12  '{second}' would take the place of '{first}', which another factor changes" in said
    assert "grid.yaml:9:15\n" in said


def test_a_factor_may_set_a_part_of_what_an_earlier_one_chose(tmp_path: Path) -> None:
    last = load_experiment(written(tmp_path, GRID.replace("track.matchers:", "track.draper.gap:")))[-1]
    assert last.changes[1:] == (
        'stages.track.draper={"use": "kinematic", "sweeps": 0}',
        'stages.track.draper.gap=["contour_icp", "optical_flow"]',
    )


def test_a_level_holds_after_what_all_variants_change(tmp_path: Path) -> None:
    path = "stages.track.draper"
    said = GRID.replace("{stages.overlay: null}", f"{{{path}.sweeps: 1}}")
    said = said.replace("    rings:\n", f"    rings: {{{path}: kinematic}}\n")
    said = said.replace("    contours:\n", f"    contours: {{{path}.sweeps: 9}}\n")
    cells = load_experiment(written(tmp_path, said))
    assert cells[0].changes == (f'{path}="kinematic"', f"{path}.sweeps=9")


def test_a_date_in_a_change_is_text(tmp_path: Path) -> None:
    text = GRID.replace("change: {stages.overlay: null}", "change: {stages.track.file: 2024-02-03}")
    assert load_experiment(written(tmp_path, text))[0].changes == ('stages.track.file="2024-02-03"',)


@pytest.mark.parametrize(
    ("said", "frames"),
    [
        ("10:20", "10:20"),  # without quotes
        ("10:20:2", "10:20:2"),
        (":20", "0:20"),
        ("{start: 5}", "5:"),
        ("{stop: 20, step: 2}", "0:20:2"),
        ("{step: 1}", "0::1"),
        ("null", None),
    ],
)
def test_frames_are_said_as_in_a_pipeline_or_on_the_command_line(tmp_path: Path, said: str, frames: str | None) -> None:
    cells = load_experiment(written(tmp_path, GRID.replace("frames: 0:20", f"frames: {said}")))
    assert cells[0].frames == frames


def test_recordings_of_one_name_are_told_apart(tmp_path: Path) -> None:
    cells = load_experiment(written(tmp_path, GRID), [Path("one/take"), Path("two/take"), Path("three")])
    assert [cell.name for cell in cells[:3]] == ["one-take", "two-take", "three"]


def test_a_recording_is_called_by_its_folder_however_it_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "one" / "take").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "one" / "take")
    cells = load_experiment(written(tmp_path, GRID), [Path(), Path(".."), Path("../../two/take")])
    assert [cell.name for cell in cells[:3]] == ["one-take", "one", "two-take"]


@pytest.mark.parametrize("folders", [("one/take", "one/take"), ("a/x/take", "b/x/take"), ("a/x", "b/x", "a-x")])
def test_recordings_that_cannot_be_told_apart_are_refused(tmp_path: Path, folders: tuple[str, ...]) -> None:
    with pytest.raises(PipelineError, match=r"2 recordings would be called '(\w-|one-)(x|take)': ") as caught:
        load_experiment(written(tmp_path, GRID), list(map(Path, folders)))
    assert "name each recording once" in caught.value.hint


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("pipeline: base.yaml\n", "", r"grid\.yaml:1:1  an experiment needs pipeline"),
        ("recordings: [takes/a, b]", "recordings: []", r"grid\.yaml:3:13?.*recordings"),
        ("frames:", "frame:", r"grid\.yaml:4:1  frame: unknown setting of an experiment"),
        ("change: {stages", "change: {recording: c, stages", r"grid\.yaml:5:10  a variant can't change 'recording'"),
        ("frames: 0:20", "stages: {}", r"grid\.yaml  this is a pipeline, no experiment\n +`mocapflow run` runs one"),
        ("recordings: [takes/a, b]", "recordings: b", r"grid\.yaml:3:1  recordings: input should be a list, not 'b'"),
        ("    rings:", "    rings: 3", r"grid\.yaml:8:5  factors\.draper\.rings: input should be `name: value` lines"),
        ("frames: 0:20", "frames: 0-20", r"grid\.yaml:4:1  frames: frames are written A:B or A:B:STEP"),
        ("frames: 0:20", "frames: 9:2", r"grid\.yaml:4:1  frames: 9:2 holds no frame"),
        ("frames: 0:20", "frames: {stp: 2}", r"grid\.yaml:4:10  frames\.stp: unknown setting of frames"),
        ("    rings:", "    rings: {recording: c}", r"grid\.yaml:8:13  a variant can't change 'recording'"),
        ("    rings:", "    a/b:", r"grid\.yaml:8:5  a level can't be called 'a/b'"),
        ("    rings:", "    ..:", r"grid\.yaml:8:5  a level can't be called '\.\.'"),
        ("    rings:", "    runs.csv:", r"grid\.yaml:8:5  a level can't be called 'runs\.csv'"),
        ("    rings:", '    "a\\0":', r"grid\.yaml:8:5  a level can't be called 'a\\x00'"),
        ("    rings:", f"    {'a' * 250}:", r"grid\.yaml:8:5  a variant's name has 259 bytes, more than 255"),
    ],
)
def test_what_is_wrong_is_told_by_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(PipelineError, match=message):
        load_experiment(written(tmp_path, GRID.replace(old, new)))
