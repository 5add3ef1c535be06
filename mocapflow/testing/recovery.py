"""What recoveries have to hold to."""

from __future__ import annotations

import numpy as np

from mocapflow.components import Recovery
from mocapflow.data import NO_CLOTH, Change, FrameResult, FrameState, Pose
from mocapflow.functional import overlaps
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.testing import pictures, scenes
from mocapflow.testing.component import Conformance
from mocapflow.testing.same import assert_pure, same


class RecoveryConformance(Conformance):
    """A recovery, in a room whose empty view is known."""

    role = "recovery"
    recovery: Recovery

    def test_a_right_fit_is_left_alone(self) -> None:
        """Where model and images agree nothing is tried, and the result stays as it is."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 3, 0.1)
        state = pictures.tiny_state(scene, pose)
        result = settled(state, scene)
        frame, model, past = pictures.tiny_frame(scene, pose), scenes.tiny_model(scene), scenes.tiny_past(scene, pose)
        recovered = assert_pure(self.recovery.recover, frame, state, result, past, model, _not_to_be_called)
        assert same(recovered, result), "the result is another one"

    def test_a_lost_limb_does_not_stay_unnoticed(self) -> None:
        """With a leg where there is none, the loop is begun elsewhere, nearer; what happened is noted."""
        scene = scenes.tiny_scene()
        truth = scenes.tiny_pose(scene, 3, 0.1)
        lost = Pose(root=truth.root, angles=truth.angles + np.where(np.arange(len(truth.angles)) == 1, 0.9, 0.0))
        state, model = pictures.tiny_state(scene, lost, truth), scenes.tiny_model(scene)
        frame, past = pictures.tiny_frame(scene, truth), scenes.tiny_past(scene, lost)

        def settle(pose: Pose, parameters: F64) -> FrameResult:
            return settled(pictures.tiny_state(scene, pose, truth), scene)

        recovered = assert_pure(self.recovery.recover, frame, state, settled(state, scene), past, model, settle)
        assert recovered.notes, "notes of the result say nothing of it"
        wanted = scene.surface(truth, NO_CLOTH).vertices
        before, after = (
            np.linalg.norm(scene.surface(pose, NO_CLOTH).vertices - wanted, axis=1).max()
            for pose in (lost, recovered.state.estimate.pose)
        )
        assert after < 0.5 * before, f"the model is {after:.3f} m off, and was {before:.3f} m before"


def settled(state: FrameState, scene: Scene) -> FrameResult:
    """Return a state as what the loop hands over."""
    surface = scene.surface_of(state)
    return FrameResult(
        state=state,
        iterations=1,
        steady=True,
        oscillating=False,
        change=Change(body=0.0, cloth=0.0, angles=0.0, sigmas=0.0),
        overlap=overlaps(surface, state.segmentation, scene.cameras),
        energy=np.zeros((1, 0)),
        energy_terms=(),
    )


def _not_to_be_called(pose: Pose, parameters: F64) -> FrameResult:
    raise AssertionError("a fit that is right needs no other")
