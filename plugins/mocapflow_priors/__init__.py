"""What is known before looking: limits, rest, smooth motion; and guesses of the next pose."""

from __future__ import annotations

from mocapflow.components import Predictor, Prior
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_priors() -> list[type[Prior]]:
    """Return the priors of this plugin."""
    from mocapflow_priors.ground_plane import GroundPlane
    from mocapflow_priors.joint_limits import JointLimits
    from mocapflow_priors.parzen import Parzen
    from mocapflow_priors.rest_pose import RestPose
    from mocapflow_priors.smooth_motion import SmoothMotion
    from mocapflow_priors.spine_coupling import SpineCoupling

    return [GroundPlane, JointLimits, Parzen, RestPose, SmoothMotion, SpineCoupling]


@hookimpl
def mocapflow_predictors() -> list[type[Predictor]]:
    """Return the predictors of this plugin."""
    from mocapflow_priors.constant_acceleration import ConstantAcceleration
    from mocapflow_priors.constant_velocity import ConstantVelocity
    from mocapflow_priors.hold import Hold
    from mocapflow_priors.image_flow import ImageFlowPredictor

    return [ConstantAcceleration, ConstantVelocity, Hold, ImageFlowPredictor]
