"""What people look at: the report, overlays on the images, the virtual environment, pictures of garments."""

from __future__ import annotations

from mocapflow.components import Stage
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_stages() -> list[type[Stage]]:
    """Return the stages of this package."""
    from mocapflow_report.overlay import Overlay
    from mocapflow_report.report import Report
    from mocapflow_report.virtual import Virtual

    return [Overlay, Report, Virtual]
