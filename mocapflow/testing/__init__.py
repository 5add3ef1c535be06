"""What plugin authors test with: a tiny scene, a check of Jacobians, and conformance tests for every role.

    from mocapflow.testing import GarmentConformance

    class TestCape(GarmentConformance):
        garment = Cape()

Needs pytest.
"""

from __future__ import annotations

from mocapflow.testing.assets import BodyConformance, DraperConformance, GarmentConformance
from mocapflow.testing.bodies import template_body, tiny_body, tiny_garment
from mocapflow.testing.fits import ClothFitterConformance, PoseSolverConformance, PriorConformance
from mocapflow.testing.images import MatcherConformance, PredictorConformance, SegmenterConformance
from mocapflow.testing.jacobians import check_jacobian
from mocapflow.testing.pictures import tiny_frame, tiny_segmentation, tiny_state
from mocapflow.testing.recovery import RecoveryConformance
from mocapflow.testing.same import assert_pure, same
from mocapflow.testing.scenes import tiny_cloth, tiny_past, tiny_pose, tiny_scene
from mocapflow.testing.stages import StageConformance

__all__ = [
    "BodyConformance",
    "ClothFitterConformance",
    "DraperConformance",
    "GarmentConformance",
    "MatcherConformance",
    "PoseSolverConformance",
    "PredictorConformance",
    "PriorConformance",
    "RecoveryConformance",
    "SegmenterConformance",
    "StageConformance",
    "assert_pure",
    "check_jacobian",
    "same",
    "template_body",
    "tiny_body",
    "tiny_cloth",
    "tiny_frame",
    "tiny_garment",
    "tiny_past",
    "tiny_pose",
    "tiny_scene",
    "tiny_segmentation",
    "tiny_state",
]
