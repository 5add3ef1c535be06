"""New plugins: what is written loads, conforms, and passes our own linter."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import textwrap
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from mocapflow import load_registry
from mocapflow.cli import app
from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import NO_CLOTH, Past, Residual, Turn, empty_matches
from mocapflow.errors import PluginError, RecordingError, UnknownComponent
from mocapflow.geometry.meshes import vertex_normals
from mocapflow.help.scaffold import KINDS, write_plugin
from mocapflow.help.shipped import shipped
from mocapflow.model import ClothedModel
from mocapflow.registry import PROVIDERS
from mocapflow.settings import Component
from mocapflow.testing import same, tiny_frame, tiny_pose, tiny_scene, tiny_segmentation, tiny_state
from mocapflow.testing.recovery import settled


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


def test_there_are_templates_for_every_role() -> None:
    assert set(KINDS) == set(PROVIDERS)


@pytest.mark.parametrize("role", KINDS)
def test_a_new_plugin_is_used_by_the_line_that_it_names(role: str, folders: dict[str, Path], tmp_path: Path) -> None:
    indent, example = re.findall(r"( +)(extends: .*)", (folders[role] / "README.md").read_text(), re.DOTALL)[0]
    text = textwrap.dedent(indent + example).replace("PATH/TO", str(shipped("pipelines")))
    file = tmp_path / "mine.yaml"
    file.write_text(f"{text}  plugins: [{folders[role]}/mocapflow_my_{role}.py]\n", encoding="utf-8")
    pipeline = load_pipeline(file)
    stages = {named.label: named.stage for named in pipeline.stages}
    settings = [value if isinstance(value, tuple) else (value,) for _, value in stages["track"]]
    parts = [pipeline.body, pipeline.garment, *stages.values(), *chain.from_iterable(settings)]
    used = [part for part in parts if isinstance(part, Component)]
    assert [part.role for part in used if part.name == f"my_{role}"] == [role]


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


def new(role: str, folder: Path) -> Any:
    """Return a component of a new plugin."""
    write_plugin("my-own", role, folder / "new")
    return load_registry([folder / "new" / "mocapflow_my_own.py"]).get(role, "my_own")()


def test_a_new_body_is_the_scan_grown_by_the_thickness_of_cloth(tmp_path: Path) -> None:
    clip, body = shipped("examples", "data", "skirt_steps"), new("body", tmp_path)
    scan = load_registry().get("body", "scanned")().load(clip)  # type: ignore[attr-defined]
    grown = body.load(clip)
    away = np.einsum("va,va->v", grown.vertices - scan.vertices, vertex_normals(scan.vertices, scan.faces))
    np.testing.assert_allclose(away, body.cloth_mm / 1000, atol=1e-9)
    with pytest.raises(RecordingError, match="no such mesh"):
        body.need(tmp_path)


def test_a_new_pose_solver_without_matches_is_led_by_the_priors(tmp_path: Path) -> None:
    scene = tiny_scene()
    state = tiny_state(scene, tiny_pose(scene))
    given = (state, ClothedModel(scene=scene), [new("prior", tmp_path)], Past(), Turn(index=0))
    solver = new("pose_solver", tmp_path / "other")
    found = solver.solve(lambda surface: empty_matches(), *given)
    np.testing.assert_allclose(found.pose.angles, 0.0, atol=0.01)  # where the new prior holds them
    np.testing.assert_allclose(found.observed, 0.0, atol=1e-9)


def test_a_new_recovery_says_that_its_search_was_in_vain(tmp_path: Path) -> None:
    scene = tiny_scene()
    lost = settled(tiny_state(scene, tiny_pose(scene, 1), tiny_pose(scene, 2)), scene)
    asked = (tiny_frame(scene, tiny_pose(scene, 2)), lost.state, lost, Past(), ClothedModel(scene=scene))
    found = new("recovery", tmp_path).recover(*asked, lambda pose, parameters: lost)
    assert found.doubted
    assert len(found.notes) == 1
    assert same(found.state, lost.state)


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
    with pytest.raises(UnknownComponent, match=r"there is no role 'exporter'\n.*available: body, .* stage"):
        write_plugin("dress", "exporter", tmp_path / "new")
