"""What the documents tell a reader to write works as it stands there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mocapflow import load_pipeline, load_registry
from mocapflow.help.manual import manual

ROOT = Path(__file__).parents[1]


def blocks(document: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", (ROOT / document).read_text(encoding="utf-8"), re.M | re.S)


def test_the_plugin_in_contributing_loads_and_conforms(tmp_path: Path) -> None:
    plugin, test = blocks("CONTRIBUTING.md", "python")
    (tmp_path / "toes_ahead.py").write_text(plugin, encoding="utf-8")
    (tmp_path / "test_toes_ahead.py").write_text(test, encoding="utf-8")
    registry = load_registry([tmp_path / "toes_ahead.py"])
    assert "toes_ahead" in registry.names("prior"), registry.failures
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_toes_ahead.py"]
    env = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # they take longer than its tests
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, env=env)
    assert run.returncode == 0, run.stdout
    assert "11 passed" in run.stdout


def test_the_pipeline_in_contributing_uses_the_plugin(tmp_path: Path) -> None:
    (tmp_path / "toes_ahead.py").write_text(blocks("CONTRIBUTING.md", "python")[0], encoding="utf-8")
    (pipeline,) = blocks("CONTRIBUTING.md", "yaml")
    (tmp_path / "mine.yaml").write_text(pipeline.replace("pipelines/", f"{ROOT}/pipelines/"), encoding="utf-8")
    track = next(named.stage for named in load_pipeline(tmp_path / "mine.yaml").stages if named.label == "track")
    assert [prior.name for prior in track.priors][-2:] == ["parzen", "toes_ahead"]  # type: ignore[attr-defined]


@pytest.mark.parametrize(("document", "least"), [("README.md", 5), ("CONTRIBUTING.md", 1), ("docs/tutorial.md", 7)])
def test_every_bash_block_is_run_by_ci(document: str, least: int) -> None:
    assert len(blocks(document, "bash")) >= least
    assert f"readme_commands.py {document}" in (ROOT / ".ci/run").read_text(encoding="utf-8")


def test_the_table_of_settings_is_what_the_code_says() -> None:
    written = (ROOT / "docs/settings.md").read_text(encoding="utf-8")
    again = "write it again: mocapflow settings mocapflow > docs/settings.md"
    assert written == manual(load_registry(), "mocapflow"), again


def test_every_setting_has_a_meaning() -> None:
    rows = re.findall(r"^\| `(.*?)` \|.*\| (.*?) ?\|$", (ROOT / "docs/settings.md").read_text(encoding="utf-8"), re.M)
    assert len(rows) > 200
    assert [name for name, meaning in rows if not meaning] == []


def test_every_code_of_the_method_is_explained() -> None:
    known = set(re.findall(r"^\| (T-[A-Z]+\d*)", (ROOT / "tests/README.md").read_text(encoding="utf-8"), re.M))
    used = {code for path in (ROOT / "tests").rglob("*.py") for code in re.findall(r"T-[A-Z]+\d*", path.read_text())}
    assert used == known
