"""What is kept of the warnings of a stage."""

import logging

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
