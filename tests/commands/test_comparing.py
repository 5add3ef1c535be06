"""The command `compare`: a cell that fails is told, and the others go on."""

import csv
import os
import sys
from pathlib import Path

import pytest
import yaml
from mocapflow_evaluation import variants
from typer.testing import CliRunner

from mocapflow import cli
from mocapflow.commands import comparing
from mocapflow.config.experiment import Cell
from tests.fixtures.stores import PLUGIN, STAGES, write_pipeline, write_recording


@pytest.fixture
def compare(tmp_path, monkeypatch):
    """Call `compare` on a short and a longer recording."""
    monkeypatch.chdir(tmp_path)
    for name, frames in {"short": 3, "long": 7}.items():
        write_recording(tmp_path / name, frames=frames)
    write_pipeline(tmp_path, "short", stages={**STAGES, "export": "export"})
    grid = {"mocapflow": 1, "pipeline": "tiny.yaml", "recordings": ["long", "short"]}
    grid["factors"] = {"draper": {"one": None, "other": {"stages.track.draper": "other_draper"}}}
    Path("grid.yaml").write_text(yaml.safe_dump(grid))

    def invoke(*words, file="grid.yaml"):
        words = ("compare", file, "--out", "grid", *words)
        monkeypatch.setattr(sys, "argv", ["mocapflow", *words])
        return CliRunner().invoke(cli.app, words, prog_name="mocapflow")

    return invoke


def runs():
    with Path("grid/runs.csv").open() as file:
        return {(run["variant"], run["recording"]): (int(run["frames"]), run["failed"]) for run in csv.DictReader(file)}


@pytest.mark.long
def test_all_cells(compare):
    done = compare("--frames", "0:2")
    assert done.exit_code == 0, done.output
    assert runs() == {(variant, clip): (2, "") for variant in ("one", "other") for clip in ("long", "short")}


@pytest.mark.long
def test_a_cell_that_fails_does_not_end_the_others(compare, monkeypatch):
    monkeypatch.setenv("TINY_RAISE_AT", "5")
    done = compare()
    assert done.exit_code == 1
    assert [run for run, (frames, _) in runs().items() if frames == 3] == [("one", "short"), ("other", "short")]
    why = runs()["one", "long"][1]
    assert "tiny_segmenter" in why and "failed at frame 5" in why and "spring force overflow" in why
    assert f"failed: one on long: {why}" in done.stdout.splitlines()
    assert "run the same command to continue at 5" in done.stderr
    monkeypatch.delenv("TINY_RAISE_AT")
    assert compare().exit_code == 0
    assert runs()["one", "long"] == (7, "")


def test_runs_without_anything_to_compare_with_are_told(tmp_path, monkeypatch, capsys):
    place = tmp_path / "grid.yaml"
    cells = [Cell(variant=v, name=n, recording=tmp_path / n, pipeline=place, folder=tmp_path, changes=(), places=(),
                  frames=None) for v in ("one", "other") for n in ("known", "new", "broken")]  # fmt: skip
    rows = [{**dict.fromkeys(comparing.SHOWN, 0.0), "variant": v, "recording": "known"} for v in ("one", "other")]
    monkeypatch.setattr(variants, "compare", lambda runs, folder: rows)
    comparing.show(tmp_path, cells, {cell: "why" for cell in cells if cell.name == "broken"})
    (told,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("not compared")]
    assert told.endswith("lack a truth or reference, or a stage evaluate: one/new, other/new")


def test_paths_of_changes_start_at_the_folder_of_the_file(compare, tmp_path):
    there = tmp_path / "not/here"
    there.mkdir(parents=True)
    grid = yaml.safe_load(Path("grid.yaml").read_text())
    grid |= {"pipeline": "../../tiny.yaml", "recordings": ["../../short"]}
    grid["change"] = {"plugins": [os.path.relpath(PLUGIN, there)]}
    (there / "grid.yaml").write_text(yaml.safe_dump(grid))
    done = compare(file="not/here/grid.yaml")
    assert done.exit_code == 0, done.output


def test_what_cannot_be_loaded_is_told_before_anything_runs(compare):
    text = Path("grid.yaml").read_text().replace("other_draper", "no_draper")
    Path("grid.yaml").write_text(text)
    assert compare().exit_code == 2
    assert not Path("grid").exists()


def test_a_wrong_setting_is_told_where_the_experiment_says_it(compare):
    text = Path("grid.yaml").read_text().replace("stages.track.draper: other_draper", "stages.track.nope: 3")
    Path("grid.yaml").write_text(text)
    line = text.splitlines().index("      stages.track.nope: 3") + 1
    done = compare()
    assert done.exit_code == 2
    assert f"grid.yaml:{line}:7  variant 'other': stages.track.nope: unknown setting" in done.stderr
    assert "--set" not in done.stderr


def test_a_variant_that_exports_nothing_is_told_before_anything_runs(compare):
    Path("grid.yaml").write_text(Path("grid.yaml").read_text() + "change: {stages.export: null}\n")
    done = compare()
    assert done.exit_code == 2
    assert "variant 'one': the pipeline has no stage `export`" in done.stderr
    assert not Path("grid").exists()
