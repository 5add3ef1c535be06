"""What is found before a track: where the cameras stand, the subject's measures, the first pose."""

from __future__ import annotations

from mocapflow.components import Stage
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_stages() -> list[type[Stage]]:
    """Return the stages of this package."""
    from mocapflow_fitting.align_cameras import AlignCameras
    from mocapflow_fitting.calibrate_limbs import CalibrateLimbs
    from mocapflow_fitting.fit_subject import FitSubject
    from mocapflow_fitting.start_from_file import StartFromFile
    from mocapflow_fitting.start_from_keypoints import StartFromKeypoints

    return [StartFromFile, StartFromKeypoints, AlignCameras, FitSubject, CalibrateLimbs]
