"""What is kept of the warnings of a stage."""

import logging
from threading import Thread

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


def test_warnings_of_a_run_in_another_thread_are_not_kept():
    logger = logging.getLogger("mocapflow")
    with warnings_logged() as said:
        other = Thread(target=logger.warning, args=["of another recording"])
        other.start()
        other.join()
        logger.warning("of this one")
    assert said == ["of this one"]
