"""Every component of every installed plugin, through the conformance tests of its role."""

from importlib.util import find_spec

import pytest

from mocapflow import testing
from mocapflow.config.documents import Document, Place
from mocapflow.config.resolve import Resolver
from mocapflow.help.shipped import shipped
from mocapflow.registry import PROVIDERS, load_registry

REGISTRY = load_registry()
CLIP = shipped("examples", "data", "skirt_steps")
CONFORMANCE = {
    "predictor": testing.PredictorConformance,
    "segmenter": testing.SegmenterConformance,
    "matcher": testing.MatcherConformance,
    "pose_solver": testing.PoseSolverConformance,
    "draper": testing.DraperConformance,
    "cloth_fitter": testing.ClothFitterConformance,
    "recovery": testing.RecoveryConformance,
    "prior": testing.PriorConformance,
    "garment": testing.GarmentConformance,
    "body": testing.BodyConformance,
    "stage": testing.StageConformance,
}
NEEDED = {  # what has no default, as a pipeline would write it; measures fit the tiny body
    ("garment", "skirt"): dict(
        waist_height_m=1.05, waist_circumference_m=1.05, hem_circumference_m=1.7, length_m=0.6
    ),
    ("garment", "shorts"): dict(
        waist_height_m=1.05, waist_circumference_m=1.05, hip_circumference_m=1.2, leg_opening_circumference_m=0.8,
        inseam_m=0.3, length_m=0.6,
    ),
    ("garment", "outfit"): dict(
        garments=["cylinder", {"use": "cylinder", "joint": "hip_r"}]
    ),
}  # fmt: skip
EXTRAS = {("draper", "xpbd"): "newton"}  # what they need beyond the base installation
TRAITS = {("prior", "parzen"): {"bounds_energy": True}}  # what the conformance class has to know of them
PARTS = {  # for settings that are components themselves
    "Predictor": "hold",
    "Segmenter": "levelset",
    "Matcher": "contour_icp",
    "PoseSolver": "twist_gauss_newton",
    "ClothFitter": "fixed",
    "Prior": "joint_limits",
}


def component(role, name):
    """The component with its default settings, as a pipeline file would build it."""
    fields = REGISTRY.get(role, name).model_fields.items()
    required = [(setting, str(field.annotation)) for setting, field in fields if field.is_required()]
    parts = {setting: part for setting, kind in required for base, part in PARTS.items() if f".{base}" in kind}
    given = {"use": name, **parts, **NEEDED.get((role, name), {})}
    return Resolver(Document({}, {(): Place("here", CLIP)}), REGISTRY).component(role, given, ())


for _role in PROVIDERS:
    for _name in REGISTRY.names(_role):
        _parts = {_role: property(lambda self, role=_role, name=_name: component(role, name)), "recording": CLIP}
        _parts |= TRAITS.get((_role, _name), {})
        _extra = EXTRAS.get((_role, _name))
        _mark = pytest.mark.skipif(_extra is not None and find_spec(_extra) is None, reason=f"needs {_extra}")
        globals()[f"Test_{_role}_{_name}"] = _mark(type(f"Test_{_role}_{_name}", (CONFORMANCE[_role],), _parts))


def test_every_plugin_loads():
    assert [str(failure) for failure in REGISTRY.failures] == []


@pytest.mark.parametrize("role", sorted(set(PROVIDERS) - {"stage"}))
def test_every_role_is_played(role):
    assert REGISTRY.names(role)
