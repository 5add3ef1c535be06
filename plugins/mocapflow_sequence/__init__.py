"""Whole-sequence stages: the first pose, fitting the subject, smoothing, evaluation, export, report."""

from __future__ import annotations

from mocapflow.components import Stage
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_stages() -> list[type[Stage]]:
    """Return the stages of this package."""
    from mocapflow.track import CoupledLoop
    from mocapflow_sequence.align_cameras import AlignCameras
    from mocapflow_sequence.background import EmptyScene
    from mocapflow_sequence.calibrate_limbs import CalibrateLimbs
    from mocapflow_sequence.evaluate import Evaluate
    from mocapflow_sequence.export import Export
    from mocapflow_sequence.fit_subject import FitSubject
    from mocapflow_sequence.flow import FollowPoints
    from mocapflow_sequence.join import Join
    from mocapflow_sequence.overlay import Overlay
    from mocapflow_sequence.report import Report
    from mocapflow_sequence.smooth import Smooth
    from mocapflow_sequence.start_from_file import StartFromFile
    from mocapflow_sequence.start_from_keypoints import StartFromKeypoints
    from mocapflow_sequence.virtual import Virtual

    return [
        EmptyScene,
        CoupledLoop,
        StartFromFile,
        StartFromKeypoints,
        AlignCameras,
        FitSubject,
        CalibrateLimbs,
        FollowPoints,
        Evaluate,
        Export,
        Join,
        Overlay,
        Report,
        Smooth,
        Virtual,
    ]
