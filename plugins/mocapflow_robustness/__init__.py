"""Images that do not cooperate: made on purpose, and found where they happen."""

from __future__ import annotations

from mocapflow.components import Stage
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_stages() -> list[type[Stage]]:
    """Return the stages of this package."""
    from mocapflow_robustness.bilateral import Bilateral
    from mocapflow_robustness.check_views import CheckViews
    from mocapflow_robustness.corrupt import Corrupt
    from mocapflow_robustness.denoise import Denoise
    from mocapflow_robustness.exposure import Exposure
    from mocapflow_robustness.hysteresis import Hysteresis

    return [Bilateral, CheckViews, Corrupt, Denoise, Exposure, Hysteresis]
