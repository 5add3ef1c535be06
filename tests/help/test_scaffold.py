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
from mocapflow.data import NO_CLOTH, Past, Residual, Turn
from mocapflow.errors import PluginError
from mocapflow.help.scaffold import KINDS, write_plugin
from mocapflow.testing import same, tiny_frame, tiny_pose, tiny_scene, tiny_segmentation


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A new plugin of each role, under names of their own."""
    made = {role: tmp_path_factory.mktemp("new") / f"mocapflow-my-{role}" for role in KINDS}
    for role, folder in made.items():
        name = f"my-{role.replace('_', '-')}"
        said = CliRunner().invoke(app, ["new", "plugin", name, "--role", role, "--out", str(folder)])
        assert said.exit_code == 0, said.output
    return made


@pytest.fixture(scope="module")
def tested(folders: dict[str, Path]) -> list[str]:
    """What pytest tells of each test of the new plugins, in one process: it takes longer to start than they."""
    paths = os.pathsep.join([*map(str, folders.values()), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "PYTHONPATH": paths, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # they take longer than the tests
    command = [sys.executable, "-m", "pytest", "-rA", "-p", "no:cacheprovider", "--continue-on-collection-errors"]
    command += ["-c", folders["draper"] / "pyproject.toml"]  # the same for each role
    command += [folder / "tests" for folder in folders.values()]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=env, cwd=folders["draper"])
    assert run.returncode in {0, 1}, run.stdout + run.stderr  # passed, or some failed
    return run.stdout.splitlines()


@pytest.fixture(scope="module")
def linted(folders: dict[str, Path]) -> list[str]:
    """What our linter tells of the new plugins."""
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "E,F,I,B", "--line-length", "120"]
    command += ["--output-format", "concise", *map(str, folders.values())]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode in {0, 1}, run.stderr
    return run.stdout.splitlines()


@pytest.mark.parametrize("role", KINDS)
def test_a_new_plugin_loads_and_conforms(
    role: str, folders: dict[str, Path], tested: list[str], linted: list[str]
) -> None:
    registry = load_registry([folders[role] / f"mocapflow_my_{role}.py"])
    assert f"my_{role}" in registry.names(role), registry.failures
    ours = [line for line in tested if f"test_my_{role}.py" in line]
    assert any(line.startswith("PASSED") for line in ours), "\n".join(tested)
    assert not any(line.startswith(("FAILED", "ERROR")) for line in ours), "\n".join(tested)
    assert not [line for line in linted if f"mocapflow-my-{role}" in line]


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


@pytest.mark.parametrize("name", ["prior", "residual", "pose"])
def test_a_plugin_may_be_called_like_a_type_it_needs(name: str, tmp_path: Path) -> None:
    write_plugin(name, "prior", tmp_path / "new")
    prior: Any = load_registry([tmp_path / "new" / f"mocapflow_{name}.py"]).get("prior", name)()
    scene = tiny_scene()
    assert isinstance(prior.residual(tiny_pose(scene), Past(), scene), Residual)


def test_the_command_to_go_on_with_can_be_typed(tmp_path: Path) -> None:
    folder = tmp_path / "my own"
    said = CliRunner().invoke(app, ["new", "plugin", "my-own", "--out", str(folder)])
    assert said.stdout.endswith(f"to go on: pip install -e '{folder}[test]' && pytest '{folder}'\n")


def test_errors(tmp_path: Path) -> None:
    with pytest.raises(PluginError, match=r"'My Dress' can't be the name of a package\n.*a letter first: my-dress"):
        write_plugin("My Dress", "garment", tmp_path / "new")
    with pytest.raises(PluginError, match=r"there is something already\n.*--out"):
        write_plugin("dress", "garment", tmp_path)
    with pytest.raises(PluginError, match=r"there is a package mocapflow_levelset already\n"):
        write_plugin("levelset", "matcher", tmp_path / "other")
    with pytest.raises(PluginError, match=r"there is a garment 'skirt' already\n.*another name"):
        write_plugin("skirt", "garment", tmp_path / "other")
    with pytest.raises(PluginError, match=r"there are no templates for a recovery\n.*garment"):
        write_plugin("dress", "recovery", tmp_path / "new")
