"""What tests of several plugins begin with."""

import pytest


@pytest.fixture(scope="session")
def body():
    """The person of the demo as the template makes it."""
    from keypoint_recording import template

    return template()


@pytest.fixture(scope="session")
def cameras():
    """The cameras of the demo."""
    from keypoint_recording import DEMO

    from mocapflow.recordings.recording import open_recording

    return open_recording(DEMO).cameras
