"""The tools that test plugins find what is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.components import Prior, Recovery, Stage
from mocapflow.data import Pose, Residual, Start, Turn
from mocapflow.dressing.roles import Garment
from mocapflow.errors import PluginError, ShapeError
from mocapflow.geometry.meshes import edges
from mocapflow.testing import (
    GarmentConformance,
    PriorConformance,
    RecoveryConformance,
    StageConformance,
    assert_pure,
    check_jacobian,
    same,
    tiny_body,
    tiny_frame,
    tiny_garment,
    tiny_pose,
    tiny_scene,
)


def test_a_wrong_jacobian_is_found():
    def residual(x, factor=1.0):
        return np.sin(x), factor * np.diag(np.cos(x))

    check_jacobian(residual, np.array([0.3, -1.2]))
    with pytest.raises(AssertionError, match=r"Jacobian \[0, 0\] is 1.91.*, differences say 0.955"):
        check_jacobian(lambda x: residual(x, 2.0), np.array([0.3, -1.2]))
    with pytest.raises(AssertionError, match="the Jacobian has shape"):
        check_jacobian(lambda x: (np.sin(x), np.zeros((1, 2))), np.zeros(2))


def test_same():
    nan = np.array([np.nan])
    assert same({"a": (nan, 1, float("nan"))}, {"a": (nan.copy(), 1, float("nan"))})
    assert not same(np.zeros(2), np.zeros(2, np.float32))
    assert not same(np.zeros(2), np.zeros(3))
    assert not same(Turn(index=0), Turn(index=1))
    assert not same([1], (1,))


def test_impure_steps_are_found():
    calls = []

    def counting(x):
        calls.append(x)
        return float(len(calls))

    def changing(x):
        x += 1
        return 0

    with pytest.raises(AssertionError, match="two different results"):
        assert_pure(counting, np.zeros(2))
    with pytest.raises(AssertionError, match="argument 0 was changed"):
        assert_pure(changing, np.zeros(2))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda body: {"faces": body.faces - 1}, "a face names vertex -1 of"),
        (lambda body: {"faces": body.faces + 1}, "a face names vertex"),
        (lambda body: {"skin_joint": body.skin_joint - 1}, "the skin names joint -1 of"),
        (lambda body: {"screw_joint": body.screw_joint + 9}, "a screw names joint"),
        (lambda body: {"parents": body.parents + 2}, "a parent names joint"),
        (lambda body: {"parents": np.where(body.parents < 0, 1, body.parents)}, "parents have to stand before"),
        (lambda body: {"screw_joint": body.screw_joint[::-1].copy()}, "parents have to stand before"),
        (lambda body: {"morph_offset": body.vertices, "morph_screw": -1, "morph_range": (0.0, 1.0)}, "its morph"),
        (lambda body: {"morph_offset": body.vertices, "morph_screw": 0, "morph_range": (1.0, 1.0)}, "its morph"),
        (lambda body: {"shape_modes": body.vertices[None]}, "modes of its shape move the joints"),
        (lambda body: {"joint_modes": body.positions[None]}, "modes of its shape move the joints"),
    ],
)
def test_a_body_that_contradicts_itself_is_refused_when_it_is_made(change, said):
    body = tiny_body()
    with pytest.raises(ShapeError, match=f"Body: {said}"):
        replace(body, **change(body))


def test_the_tiny_scene():
    scene = tiny_scene(clothed=True)
    assert 500 < len(scene.body.vertices) < 700
    assert (edges(scene.body.faces)[:, 3] >= 0).all()  # watertight
    a, b, c = np.moveaxis(scene.body.vertices[scene.body.faces], 1, 0)
    assert 0.04 < (a * np.cross(b, c)).sum() / 6 < 0.06  # faces outwards
    frame = tiny_frame(scene, tiny_pose(scene))
    assert [image.shape for image in frame.images] == [(240, 320, 3)] * 4


class TestTube(GarmentConformance):
    class Tube(Garment):
        """The tube of cloth of the tiny scene."""

        name = "tube"

        def sew(self, body):
            return tiny_garment(body)

    garment = Tube()


def test_conformance_finds_a_garment_that_is_sewn_wrong():
    class Torn(Garment):
        name = "torn"

        def sew(self, body):
            mesh = tiny_garment(body)
            faces = mesh.faces.copy()
            faces[0, 0] = faces[0, 1]
            return type(mesh)(**{**vars(mesh), "faces": faces})

    tests = GarmentConformance()
    tests.garment = Torn()
    with pytest.raises(AssertionError, match="a face has no area"):
        tests.test_faces_are_not_degenerate()
    with pytest.raises(AssertionError, match="say in a docstring what it does"):
        tests.test_it_plays_its_role()


def test_conformance_finds_a_vertex_that_lies_on_no_strand():
    class Loose(Garment):
        """Leaves a strand out."""

        name = "loose"

        def sew(self, body):
            mesh = tiny_garment(body)
            return replace(mesh, strands=mesh.strands[1:])

    tests = GarmentConformance()
    tests.garment = Loose()
    with pytest.raises(AssertionError, match=r"vertex \d+ lies on 0 strands"):
        tests.test_every_vertex_lies_on_one_strand()


def test_conformance_says_how_far_a_pin_is_from_the_skin():
    class Wide(Garment):
        """Stands off at the waist."""

        name = "wide"

        def sew(self, body):
            mesh = tiny_garment(body)
            return replace(mesh, vertices=mesh.vertices * [2.0, 2.0, 1.0])

    tests = GarmentConformance()
    tests.garment = Wide()
    with pytest.raises(AssertionError, match=r"a pin is 0\.\d+ m from vertex \d+, .*; at most 0\.1 m: begin nearer"):
        tests.test_pins_lie_on_the_body()


def test_conformance_finds_a_garment_that_no_draper_can_lay():
    class Unhung(Garment):
        """Has one strand that nothing holds."""

        name = "unhung"

        def sew(self, body):
            mesh = tiny_garment(body)
            return replace(mesh, pinned=mesh.pinned[1:], pinned_to=mesh.pinned_to[1:])

    tests = GarmentConformance()
    tests.garment = Unhung()
    tests.test_every_vertex_lies_on_one_strand()
    tests.test_pins_lie_on_the_body()
    with pytest.raises(PluginError, match=r"strand of vertex \d+ hangs from nothing"):
        tests.test_installed_drapers_lay_it()


class TestAtRest(RecoveryConformance):
    class AtRest(Recovery):
        """Begins again at rest where model and person overlap badly in a view."""

        name = "at_rest"

        def recover(self, frame, state, result, past, model, settle):
            if result.overlap.min() > 0.85:
                return result
            pose = state.estimate.pose
            found = settle(Pose(root=pose.root, angles=np.zeros_like(pose.angles)), state.estimate.parameters)
            return replace(found, notes=("begun again at rest",))

    recovery = AtRest()


def test_conformance_finds_a_prior_with_a_wrong_energy():
    class Doubled(Prior):
        """Pulls the angles to zero and counts it twice."""

        name = "doubled"

        def residual(self, pose, past, scene):
            jacobian = np.pad(np.eye(len(pose.angles)), ((0, 0), (6, 0)))
            return Residual(error=pose.angles.copy(), jacobian=jacobian, energy=float(pose.angles @ pose.angles))

    tests = PriorConformance()
    tests.prior = Doubled()
    with pytest.raises(AssertionError, match="Not equal to tolerance"):
        tests.test_its_jacobian_is_its_derivative(1, 0.1)


def test_conformance_finds_a_stage_with_an_input_of_no_type():
    class Blind(Stage):
        """Takes it does not say what."""

        name = "blind"

        def run(self, *, recording) -> Start:
            return recording

    tests = StageConformance()
    tests.stage = Blind()
    with pytest.raises(AssertionError, match="run needs a type for recording"):
        tests.test_its_inputs_and_output_are_typed()


def test_the_tiny_garment_hangs_on_the_tiny_body():
    body = tiny_body()
    mesh = tiny_garment(body)
    assert np.linalg.norm(mesh.vertices[mesh.pinned] - body.vertices[mesh.pinned_to], axis=1).max() < 0.06
