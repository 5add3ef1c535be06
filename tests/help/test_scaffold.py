"""New plugins: what is written loads, conforms, and passes our own linter."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from mocapflow import load_registry
from mocapflow.cli import app
from mocapflow.data import NO_CLOTH, Past, Turn
from mocapflow.errors import PluginError
from mocapflow.help.scaffold import KINDS, write_plugin
from mocapflow.testing import same, tiny_frame, tiny_pose, tiny_scene, tiny_segmentation


@pytest.mark.parametrize("role", KINDS)
def test_a_new_plugin_loads_and_conforms(role: str, tmp_path: Path) -> None:
    folder = tmp_path / "mocapflow-my-own"
    said = CliRunner().invoke(app, ["new", "plugin", "my-own", "--role", role, "--out", str(folder)])
    assert said.exit_code == 0, said.output
    registry = load_registry([folder / "mocapflow_my_own.py"])
    assert "my_own" in registry.names(role), registry.failures
    paths = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "PYTHONPATH": paths, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # they take longer than its tests
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=env)
    assert run.returncode == 0, run.stdout
    ruff = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "E,F,I,B", "--line-length", "120", folder]
    assert subprocess.run(ruff, capture_output=True, check=False).returncode == 0


def test_a_new_matcher_leaves_silhouettes_of_other_layers_alone(tmp_path: Path) -> None:
    write_plugin("my-own", "matcher", tmp_path / "new")
    matcher: Any = load_registry([tmp_path / "new" / "mocapflow_my_own.py"]).get("matcher", "my_own")()
    scene = tiny_scene()
    pose = tiny_pose(scene)
    surface, seen = scene.surface(pose, NO_CLOTH), tiny_segmentation(scene, pose)
    skin = tuple(replace(silhouette, layer="skin") for silhouette in seen.silhouettes)
    asked = (surface, Past(), scene, Turn(index=0))
    frame = tiny_frame(scene, pose)
    found = matcher.match(frame, replace(seen, silhouettes=(*seen.silhouettes, *skin)), *asked)
    assert same(found, matcher.match(frame, seen, *asked))


def test_errors(tmp_path: Path) -> None:
    with pytest.raises(PluginError, match=r"'My Dress' can't be the name of a package\n.*a letter first: my-dress"):
        write_plugin("My Dress", "garment", tmp_path / "new")
    with pytest.raises(PluginError, match=r"there is something already\n.*--out"):
        write_plugin("dress", "garment", tmp_path)
    with pytest.raises(PluginError, match=r"there is a package mocapflow_levelset already\n"):
        write_plugin("levelset", "matcher", tmp_path / "other")
    with pytest.raises(PluginError, match=r"there are no templates for a stage\n.*garment"):
        write_plugin("dress", "stage", tmp_path / "new")
