"""The next pose is where the flow of the image takes the surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mocapflow_matching.flow_points import CLOTH_SHARE, distances, flow_points
from mocapflow_matching.robust import robust_weights
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton
from pydantic import PositiveFloat

from mocapflow.components import Predictor
from mocapflow.data import NO_CLOTH, Frame, Matches, Past, Pose, Surface, Turn
from mocapflow.geometry.cameras import project_each
from mocapflow.guards.outputs import pose_of
from mocapflow.model import ClothedModel
from mocapflow.prediction import initial_state
from mocapflow.scene import Scene
from mocapflow_priors.constant_velocity import ConstantVelocity
from mocapflow_priors.joint_limits import JointLimits
from mocapflow_priors.rest_pose import RestPose

SOLVER = TwistGaussNewton(iterations=8, angle_sd_deg=20.0)  # of the pose that the points show
PRIORS = (JointLimits(), RestPose())  # points on one side of a limb do not tell how it is turned
LEAST_POINTS = 30  # that are followed; fewer are not trusted
LEAST_AGREEMENT = 0.5  # share of points that come to lie within `AGREEING_PX`
AGREEING_PX = 4.0  # distance to where it was tracked


class ImageFlowPredictor(Predictor):
    """Moves the last pose so that its surface points follow the points tracked into this frame (stage `flow`).

    What no point shows goes on as it was. Where points are few, or most of them contradict each other (a wrong
    picture), the whole pose goes on as it was.
    """

    name = "image_flow"

    otherwise: Predictor = ConstantVelocity()  # guesses what no point shows
    sigma_px: PositiveFloat = 1.0  # standard deviation of a tracked point
    scale: PositiveFloat = 2.0  # standard deviations beyond which a point pulls no harder (Huber)
    touching_mm: PositiveFloat = 20.0  # from the skin within which cloth touches it; points on other cloth do not count

    def predict(self, frame: Frame, past: Past, scene: Scene) -> Pose:
        """Return the pose the flow leads to, or what `otherwise` predicts."""
        guess = pose_of(self.otherwise, frame, past, scene)
        followed = self.on_skin(flow_points(frame, past, scene), past, scene)
        if len(followed.vertex) < LEAST_POINTS:
            return guess
        model = ClothedModel(scene=scene.undressed)

        def match(surface: Surface) -> Matches:
            away = distances(followed, surface, scene)
            robust = robust_weights(away / self.sigma_px, "huber", self.scale)
            return replace(followed, weight=followed.weight * robust / self.sigma_px**2)

        state = initial_state(guess, np.empty(0), NO_CLOTH)
        pose = SOLVER.solve(match, state, model, PRIORS, past, Turn(index=0)).pose
        reached = distances(followed, model.surface(pose, NO_CLOTH), scene)
        return pose if np.mean(reached < AGREEING_PX) >= LEAST_AGREEMENT else guess

    def on_skin(self, matches: Matches, past: Past, scene: Scene) -> Matches:
        """Return the points with those on cloth moved to the skin that it touches; other cloth is left out."""
        cloth = matches.vertex >= len(scene.body.vertices)
        if not cloth.any():
            return matches
        from scipy.spatial import cKDTree

        surface = scene.surface(past.moments[-1].pose, past.moments[-1].cloth)
        skin = surface.vertices[~surface.cloth]
        reach = self.touching_mm / 1000
        _, below = cKDTree(skin).query(surface.vertices[matches.vertex[cloth]], distance_upper_bound=reach)
        vertex, touching = matches.vertex.copy(), np.ones(len(cloth), bool)
        touching[cloth] = below < len(skin)
        vertex[cloth] = np.where(below < len(skin), below, 0)
        on_skin, on_cloth = (
            project_each(surface.vertices[points], matches.camera, scene.cameras) for points in (vertex, matches.vertex)
        )
        return Matches(
            camera=matches.camera[touching],
            pixel=(matches.pixel + on_skin - on_cloth)[touching],
            direction=matches.direction[touching],
            vertex=vertex[touching],
            weight=(matches.weight * np.where(cloth, CLOTH_SHARE, 1.0))[touching],
        )
