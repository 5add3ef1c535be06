"""Matchers: pairs of image points and surface points."""

from __future__ import annotations

from mocapflow.components import Matcher
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_matchers() -> list[type[Matcher]]:
    """Return the built-in matchers."""
    from mocapflow_matching.containment import Containment
    from mocapflow_matching.contour_icp import ContourIcp
    from mocapflow_matching.fourier_icp import FourierIcp
    from mocapflow_matching.inner_contours import InnerContours
    from mocapflow_matching.keypoints import Keypoints
    from mocapflow_matching.layered_icp import LayeredIcp
    from mocapflow_matching.optical_flow import OpticalFlow

    return [ContourIcp, Containment, FourierIcp, InnerContours, Keypoints, LayeredIcp, OpticalFlow]
