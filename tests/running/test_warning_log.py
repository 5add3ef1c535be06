"""What is kept of the warnings of a stage."""

import logging
import sys
from threading import Thread
from types import ModuleType

import pytest

from mocapflow.observers import LOG
from mocapflow.running.warning_log import warnings_logged
from tests.fixtures.stores import PLUGIN, run_tiny, write_pipeline, write_recording


def test_warnings_are_kept_but_for_those_of_onlookers(caplog):
    caplog.set_level(logging.INFO)
    logger = logging.getLogger("mocapflow")
    with warnings_logged() as said:
        logger.warning("frame %d is dark", 3)
        logger.info("all is well")
        LOG.warning("an onlooker raised")
    logger.warning("too late")
    assert said == ["frame 3 is dark"]


def test_warnings_of_a_plugin_that_logs_by_its_own_name_are_kept_once(monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, "mocapflow_my_dress.garment", ModuleType("mocapflow_my_dress.garment"))
    with warnings_logged() as said:
        logging.getLogger("mocapflow_my_dress.garment").warning("a guess")
        logging.getLogger("mocapflow.track").warning("a doubt")
        logging.getLogger("elsewhere").warning("of a library")
    assert said == ["a guess", "a doubt"]
    assert caplog.messages == [*said, "of a library"]


@pytest.mark.parametrize("name", ["dress", None], ids=["a name of its own", "none"])
def test_warnings_of_a_plugin_are_kept_whatever_its_logger_is_called(name):
    with warnings_logged([__name__.partition(".")[0]]) as said:
        logging.getLogger(name).warning("a guess")
        LOG.warning("an onlooker raised")
    with warnings_logged(["another"]) as nothing:
        logging.getLogger(name).warning("a guess")
    assert (said, nothing) == (["a guess"], [])


def test_warnings_of_any_module_of_a_plugin_are_kept(monkeypatch):
    module = ModuleType("dresses.lace")
    module.__file__ = __file__
    monkeypatch.setitem(sys.modules, "dresses.lace", module)
    with warnings_logged(["dresses"]) as said:
        logging.getLogger("lace").warning("a guess")
    assert said == ["a guess"]


def test_what_a_plugin_file_warns_of_is_kept_with_what_it_made(tmp_path):
    own = tmp_path / "mine.py"
    own.write_text(PLUGIN.read_text().replace('logging.getLogger("mocapflow")', 'logging.getLogger("mine")'))
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", 3))
    path.write_text(path.read_text().replace(str(PLUGIN), str(own)))
    summary, _ = run_tiny(path, tmp_path, "stages.start.angle_rad=2")
    said = {stage["label"]: stage["warnings"] for stage in summary.stages}
    assert said["start"] == ["the first pose bends far"]


def test_warnings_of_a_run_in_another_thread_are_not_kept():
    logger = logging.getLogger("mocapflow")
    with warnings_logged() as said:
        other = Thread(target=logger.warning, args=["of another recording"])
        other.start()
        other.join()
        logger.warning("of this one")
    assert said == ["of this one"]
