"""What looks at a whole sequence: the empty scene, flow, the track, the join of parts, smoothing."""

from __future__ import annotations

from mocapflow.components import Stage
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_stages() -> list[type[Stage]]:
    """Return the stages of this package."""
    from mocapflow.track import CoupledLoop
    from mocapflow_sequence.background import EmptyScene
    from mocapflow_sequence.flow import FollowPoints
    from mocapflow_sequence.join import Join
    from mocapflow_sequence.revise_background import ReviseBackground
    from mocapflow_sequence.smooth import Smooth

    return [EmptyScene, CoupledLoop, FollowPoints, Join, ReviseBackground, Smooth]
