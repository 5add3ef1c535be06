"""What holds in all tests."""

import os
import shutil
from pathlib import Path

import mocapflow_levelset
import pytest
from threadpoolctl import threadpool_limits

from mocapflow.caching.digests import Digests
from tests.fixtures.stores import run_tiny, write_pipeline, write_recording


@pytest.fixture(scope="session", autouse=True)
def code_is_known():
    """Let every store begin with what is known of the code, as in a second run: reading it all takes a second.

    Size and time of change are looked at as ever; what has no memory of its own, as in the tests of keys, reads for
    itself.
    """
    code, plugins = Digests(), Path(mocapflow_levelset.__file__).parents[1]
    code.core()
    for package in plugins.glob("mocapflow_*"):
        code.package(package.name)

    def begin(self: Digests, memory: Path | None = None) -> None:
        real(self, memory)
        if memory is not None:
            self._known = {**code._known, **self._known}

    real = Digests.__init__
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Digests, "__init__", begin)
        yield


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """Compute in one thread, as a run does: the threads of several workers wait for each other."""
    with threadpool_limits(limits=1):
        yield


@pytest.fixture(scope="session", autouse=True)
def no_waiting_for_the_drive():
    """Don't wait until files are on the drive: no test cuts the power, and what is killed is a process of its own.

    Who counts what is flushed wraps this, and sees every call.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda number: None)
        yield


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compose pictures of a comparison but don't render them, which takes a second each: for who reads its figures."""
    from mocapflow_evaluation import comparison_plots

    monkeypatch.setattr(comparison_plots, "save", lambda figure, path: path)


@pytest.fixture
def undrawn(unrendered: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Don't even compose them, of a dozen panels each."""
    from mocapflow_evaluation import comparison_plots

    monkeypatch.setattr(comparison_plots, "draw", lambda *_: [])
    monkeypatch.setattr(comparison_plots, "draw_sticks", lambda path, *_: path)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The tiny pipeline, not run yet."""
    return write_pipeline(tmp_path, write_recording(tmp_path / "clip"))


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run of the tiny pipeline without a break: to compare with, not to write to."""
    folder = tmp_path_factory.mktemp("whole")
    run_tiny(write_pipeline(folder, write_recording(folder / "clip")), folder)
    return folder


@pytest.fixture
def ran(tmp_path: Path, path: Path, whole: Path) -> Path:
    """The tiny pipeline after a run, whose store and results are a copy: it takes a quarter of the time."""
    for name in ("store.zarr", "out"):
        shutil.copytree(whole / name, tmp_path / name)
    return path
