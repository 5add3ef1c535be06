"""What is kept of the warnings of a stage."""

import logging
import sys
from threading import Thread
from types import ModuleType

from mocapflow.observers import LOG
from mocapflow.running.warned import warnings_logged


def test_warnings_are_kept_but_for_those_of_onlookers():
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


def test_warnings_of_a_run_in_another_thread_are_not_kept():
    logger = logging.getLogger("mocapflow")
    with warnings_logged() as said:
        other = Thread(target=logger.warning, args=["of another recording"])
        other.start()
        other.join()
        logger.warning("of this one")
    assert said == ["of this one"]
