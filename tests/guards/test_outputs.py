"""What components return is checked: what is wrong names who returned it, and nothing wrong goes on."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from mocapflow.cli import app
from mocapflow.components import ClothFitter, Matcher, PoseSolver, Predictor, Prior, Recovery, Segmenter, Stage
from mocapflow.data import NO_CLOTH, Matches, Past, Pose, Residual, Start, Turn
from mocapflow.dressing.guards import body_of, mesh_of
from mocapflow.dressing.roles import BodyModel, Draper, Garment
from mocapflow.errors import MocapflowError, RecordingError
from mocapflow.guards.outputs import (
    cloth_of,
    estimate_of,
    made_of,
    matches_of,
    pose_of,
    residual_of,
    result_of,
    segmentation_of,
)
from mocapflow.output_checks import InvalidOutput, of_kind
from mocapflow.results import Track
from mocapflow.testing import pictures, scenes
from mocapflow.testing.recovery import settled
from tests.fixtures.stores import STAGES, load, run_tiny, write_pipeline, write_recording
from tests.plugins.results_scene import stepping

SCENE = scenes.tiny_scene()
POSE = scenes.tiny_pose(SCENE)
FRAME, SEEN = pictures.tiny_frame(SCENE, POSE), pictures.tiny_segmentation(SCENE, POSE)
SURFACE, WIDTH = SCENE.surface(POSE, NO_CLOTH), 6 + len(POSE.angles)
GOOD = Matches(
    camera=np.zeros(3, np.int16), pixel=np.ones((3, 2)), direction=np.zeros((3, 2)),
    vertex=np.arange(3, dtype=np.int32), weight=np.ones(3),
)  # fmt: skip


class Saying(Matcher, PoseSolver, Predictor, Prior):
    """Says what it is told to."""

    name = "saying"
    output: object

    def match(self, frame, segmentation, surface, past, scene, turn):
        return self.output

    def predict(self, frame, past, scene):
        return self.output

    def residual(self, pose, past, scene):
        return self.output

    def solve(self, match, state, model, priors, past, turn):
        return self.output


def test_a_wrong_output_reaches_another_process() -> None:
    there = pickle.loads(pickle.dumps(InvalidOutput(Saying(output=1), "nonsense")))
    assert str(there) == "matcher 'saying' returned nonsense" and there.what == "nonsense"


def matches(output):
    return matches_of(Saying(output=output), FRAME, SEEN, SURFACE, Past(), SCENE, Turn(index=0))


def residual(error=0.0, jacobian=0.0, energy=0.0, width=WIDTH):
    output = Residual(error=np.full(2, error), jacobian=np.full((2, width), jacobian), energy=energy)
    return residual_of(Saying(output=output), POSE, Past(), SCENE)


def other(name, value):
    values = np.array(getattr(GOOD, name))
    values[1] = value
    return replace(GOOD, **{name: values})


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (None, "NoneType, not Matches"),
        (other("vertex", -1), "a pair of vertex -1; there are 0 to"),
        (other("vertex", 10**6), "a pair of vertex 1000000; there are 0 to"),
        (other("camera", 9), "a pair of camera 9; there are 0 to"),
        (other("pixel", np.nan), "a pixel that is not finite"),
        (other("direction", np.inf), "a direction that is not finite"),
        (other("weight", np.inf), "a weight that is not finite"),
        (other("weight", -1.0), "a weight below zero"),
        (other("direction", 17.0), "a direction that is neither a unit vector nor zero"),
    ],
)
def test_pairs_that_are_none(output, said):
    with pytest.raises(InvalidOutput, match=f"'saying' returned {said}"):
        matches(output)


def test_pairs_that_are_some():
    assert matches(GOOD) is GOOD
    none = replace(GOOD, **{name: getattr(GOOD, name)[:0] for name in GOOD.__dataclass_fields__})
    assert matches(none) is none


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (dict(error=np.nan), "an error or a jacobian that is not finite"),
        (dict(jacobian=-np.inf), "an error or a jacobian that is not finite"),
        (dict(error=1e300), r"an error or a jacobian that is not finite, or above 1e\+100"),
        (dict(energy=np.nan), "the energy nan"),
        (dict(energy="0"), "the energy '0'"),
        (dict(width=WIDTH - 6), rf"a jacobian of {WIDTH - 6} columns; \(omega, v, angles\) are {WIDTH}"),
    ],
)
def test_residuals_that_are_none(output, said):
    with pytest.raises(InvalidOutput, match=f"'saying' returned {said}"):
        residual(**output)


def test_an_infinite_energy_rules_a_pose_out():
    assert residual(energy=np.inf).energy == np.inf
    assert residual(width=WIDTH + 2).jacobian.shape == (2, WIDTH + 2)  # of the cloth, too


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (POSE.root, "ndarray, not Pose"),
        (Pose(root=POSE.root, angles=POSE.angles[:-1]), "joint angles; the body has"),
        (Pose(root=POSE.root, angles=POSE.angles * np.nan), "a pose that is not finite"),
        (Pose(root=np.diag([-1.0, 1, 1, 1]), angles=POSE.angles), "a root that is no rigid motion"),
        (Pose(root=np.diag([2.0, 2, 2, 1]), angles=POSE.angles), "a root that is no rigid motion"),
    ],
)
def test_poses_that_are_none(output, said):
    with pytest.raises(InvalidOutput, match=f"'saying' returned .*{said}"):
        pose_of(Saying(output=output), FRAME, Past(), SCENE)


PLUGIN = """
import numpy as np
from mocapflow import Prior, Residual, hookimpl


class Nan(Prior):
    \"\"\"Says nothing of use.\"\"\"

    name = "nan"

    def residual(self, pose, past, scene):
        count = len(pose.angles)
        return Residual(error=np.full(count, np.nan), jacobian=np.zeros((count, 6 + count)), energy=0.0)


class Leaves(Prior):
    \"\"\"Ends the program.\"\"\"

    name = "leaves"

    def residual(self, pose, past, scene):
        raise SystemExit(0)


class Explains(Prior):
    \"\"\"Says more than what is wrong.\"\"\"

    name = "explains"

    def residual(self, pose, past, scene):
        error = ValueError("torn")
        error.add_note("mend it")
        raise error


class Interrupted(Prior):
    \"\"\"Ctrl-C arrives in compiled code.\"\"\"

    name = "interrupted"

    def residual(self, pose, past, scene):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise SystemError("CPUDispatcher returned a result with an exception set") from error


class Keeps(Prior):
    \"\"\"Remembers the last pose.\"\"\"

    name = "keeps"

    def residual(self, pose, past, scene):
        self.last = pose


class Asks(Prior):
    \"\"\"Asks for a joint that is not there.\"\"\"

    name = "asks"

    def residual(self, pose, past, scene):
        scene.body.joint("left_hip")


@hookimpl
def mocapflow_priors():
    return [Nan, Leaves, Explains, Interrupted, Keeps, Asks]
"""


@pytest.mark.parametrize(
    ("prior", "said"),
    [
        ("nan", r"prior 'nan' \(.*\) failed at frame 0, iteration 1: it returned an error or a jacobian"),
        ("leaves", r"prior 'leaves' \(.*\) failed at frame 0, iteration 1: it left with status 0"),
        ("explains", r"prior 'explains' \(.*\) failed at frame 0, iteration 1: ValueError: torn\n"),
        ("keeps", r"prior 'keeps' \(.*\) failed .*: it sets 'last', but a component .* keeps nothing between calls"),
        ("asks", r"^prior 'asks'  the body has no joint 'left_hip'\n +available: root, top"),
    ],
)
def test_a_run_names_who_returns_what_is_wrong(tmp_path, prior, said):
    path = with_prior(tmp_path, prior)
    assert load(path)
    with pytest.raises(MocapflowError, match=said):
        run_tiny(path, tmp_path, frames=2)


def test_nobody_is_blamed_for_an_interrupt(tmp_path):
    path = with_prior(tmp_path, "interrupted")
    done = CliRunner().invoke(app, ["run", str(path), "--out", str(tmp_path / "out"), "--frames", "0:2"])
    assert done.exit_code == 130
    assert "interrupted; what is finished is saved" in done.output
    assert "failed" not in done.output
    assert not (tmp_path / "out" / "failed.log").exists()


def with_prior(tmp_path, prior):
    (tmp_path / "bad.py").write_text(PLUGIN)
    stages = STAGES | {"track": STAGES["track"] | {"priors": [prior]}}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages)
    path.write_text(path.read_text().replace("plugins:\n", f"plugins:\n- {tmp_path / 'bad.py'}\n"))
    return path


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"pose": Pose(root=np.full((4, 4), np.nan), angles=POSE.angles)}, "a pose that is not finite"),
        ({"pose": Pose(root=np.zeros((4, 4)), angles=POSE.angles)}, "a root that is no rigid motion"),
        ({"pose": Pose(root=POSE.root, angles=POSE.angles[1:])}, "the body has"),
        ({"observed": np.full(len(POSE.angles), np.nan)}, "observed shares that are not finite"),
        ({"observed": np.ones(1)}, "observed shares of shape"),
        ({"parameters": np.ones(3)}, "parameters of shape"),
        ({"covariance": np.eye(4)}, "a covariance of shape"),
        ({"covariance": np.zeros((WIDTH, WIDTH))}, "a variance that is not above zero"),
        ({"covariance": np.ones((WIDTH, WIDTH))}, "a covariance that is not positive definite"),
        ({"covariance": np.eye(WIDTH) + 5 * np.eye(WIDTH)[::-1]}, "a covariance that is not positive definite"),
    ],
)
def test_an_estimate_that_is_none_names_the_solver(change, said) -> None:
    state = pictures.tiny_state(SCENE, POSE, POSE)
    good = state.estimate
    asked = (None, state, scenes.tiny_model(SCENE), (), Past(), Turn(index=0))
    assert estimate_of(Saying(output=good), *asked) is good
    with pytest.raises(InvalidOutput, match=f"'saying' returned .*{said}"):
        estimate_of(Saying(output=replace(good, **change)), *asked)


def test_what_is_of_another_kind_names_who_made_it() -> None:
    with pytest.raises(InvalidOutput, match="'saying' returned NoneType, not Matches"):
        of_kind(Saying(output=None), None, Matches)


CLOTHED = scenes.tiny_scene(clothed=True)
MODEL = scenes.tiny_model(CLOTHED)
CLOTH = scenes.tiny_cloth(CLOTHED, POSE)
STATE = pictures.tiny_state(SCENE, POSE)


class Dressing(Draper, ClothFitter, Garment, Segmenter, BodyModel):
    """Says what it is told to."""

    name = "dressing"
    output: object

    def drape(self, poses, parameters, past, scene):
        return self.output

    def velocity(self, pose, parameters, vertices, past, scene):
        return self.output

    def fit(self, frame, segmentation, estimate, model, past, turn):
        return self.output

    def sew(self, body):
        return self.output

    def load(self, folder):
        return self.output

    def segment(self, frame, state, past, scene, turn):
        return self.output


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda v: None, "NoneType, not ndarray"),
        (lambda v: v[:, 1:], "cloth of shape .*, not"),
        (lambda v: v * np.nan, "cloth that is not finite"),
        (lambda v: v.astype(np.float32), "cloth of float32, not float64"),
        (lambda v: v + [0, 100, 0], "cloth 1.* m from the body; is it in metres"),
        (lambda v: 1000 * v, "cloth .* m from the body; is it in metres"),
    ],
)
def test_drapes_that_are_none(change, said):
    model = replace(MODEL, draper=Dressing(output=change(CLOTH.vertices[None])))
    with pytest.raises(InvalidOutput, match=f"draper 'dressing' returned {said}"):
        model.drapes(POSE, CLOTH.parameters[None], Past())
    model = replace(MODEL, draper=Dressing(output=CLOTH.vertices[None]))
    assert np.array_equal(model.drapes(POSE, CLOTH.parameters[None], Past())[0], CLOTH.vertices)


def test_velocities_that_are_none():
    vertices, width = np.arange(2, dtype=np.int32), WIDTH + len(CLOTH.parameters)
    for output, said in ((np.zeros((2, 3, WIDTH - 1)), "shape"), (np.full((2, 3, width), np.inf), "are not finite")):
        with pytest.raises(InvalidOutput, match=f"returned velocities .*{said}"):
            replace(MODEL, draper=Dressing(output=output)).velocity(POSE, CLOTH, vertices, Past())


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (CLOTH.vertices, "ndarray, not Cloth"),
        (NO_CLOTH, r"cloth of shape \(0, 3\), not"),
        (replace(CLOTH, vertices=CLOTH.vertices * np.nan), "cloth that is not finite"),
        (replace(CLOTH, vertices=CLOTH.vertices - 100), "cloth 1.* m from the body"),
        (replace(CLOTH, parameters=np.zeros(9)), r"cloth parameters of shape \(9,\)"),
        (replace(CLOTH, parameters=CLOTH.parameters + 1), "1 for parameter 'thickness_m', which goes from 0 to 0.01"),
    ],
)
def test_fitted_cloth_that_is_none(output, said):
    asked = (FRAME, SEEN, STATE.estimate, MODEL, Past(), Turn(index=0))
    assert cloth_of(Dressing(output=CLOTH), *asked) is CLOTH
    with pytest.raises(InvalidOutput, match=f"'dressing' returned {said}"):
        cloth_of(Dressing(output=output), *asked)


BODY = CLOTHED.body


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vertices": BODY.vertices * np.nan}, "vertices that are not finite"),
        ({"skin_weight": 2 * BODY.skin_weight}, "skin weights that do not sum to one"),
        ({"twists": 2 * BODY.twists}, "a twist about an axis that is no unit vector"),
    ],
)
def test_bodies_that_are_none(change, said):
    assert body_of(Dressing(output=BODY), Path()) is BODY
    with pytest.raises(InvalidOutput, match=f"'dressing' returned {said}"):
        body_of(Dressing(output=replace(BODY, **change)), Path())


def test_a_body_in_millimetres_or_apart_from_its_joints():
    with pytest.raises(RecordingError, match=r"body 'dressing'  the mesh measures .* in millimetres: divide by 1000"):
        body_of(Dressing(output=replace(BODY, vertices=1000 * BODY.vertices)), Path())
    with pytest.raises(RecordingError, match=r"7 of 7 joints lie more than 10 cm outside the mesh, first 'pelvis'"):
        body_of(Dressing(output=replace(BODY, positions=1000 * BODY.positions)), Path())


MESH = CLOTHED.garment


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"pinned_to": MESH.pinned_to + 10**6}, "cloth pinned to vertex .*; the body has 0 to"),
        ({"carried_by": MESH.carried_by - 1}, "cloth carried by joint -1; the body has 0 to"),
        ({"pinned": MESH.pinned[:0], "pinned_to": MESH.pinned_to[:0]}, "cloth that is pinned nowhere"),
        ({"vertices": 1000 * MESH.vertices}, "a pin .* m from the skin that holds it; are its measures in metres?"),
        ({"parameter_names": ()}, "3 bounds of parameters for the names none"),
        ({"parameter_names": ("a", "a", "b", "c")}, "3 bounds of parameters for the names a, a, b, c"),
        ({"parameter_bounds": MESH.parameter_bounds[:, ::-1]}, "the bounds .* of parameter"),
        ({"parameter_bounds": np.full_like(MESH.parameter_bounds, np.inf)}, "the bounds .* of parameter"),
    ],
)
def test_garments_that_are_none(change, said):
    assert mesh_of(Dressing(output=MESH), CLOTHED.body) is MESH
    with pytest.raises(InvalidOutput, match=f"'dressing' returned {said}"):
        mesh_of(Dressing(output=replace(MESH, **change)), CLOTHED.body)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"camera": 7}, "a silhouette of camera 7; there are 0 to 3"),
        ({"camera": "cam02"}, "a silhouette of camera cam02; there are 0 to 3"),
        ({"camera": 0}, "two silhouettes of camera 0, layer 'person'"),
        ({"layer": "Person"}, "a silhouette of layer 'Person'; there are person, garment, skin"),
        ({"distance": SEEN.silhouettes[1].distance[1:]}, "a silhouette of .* px; the picture is"),
        ({"distance": SEEN.silhouettes[1].distance * np.float32(np.nan)}, "a silhouette that is not finite"),
    ],
)
def test_silhouettes_that_are_none(change, said):
    asked = (FRAME, STATE, Past(), SCENE, Turn(index=0))
    assert segmentation_of(Dressing(output=SEEN), *asked) is SEEN
    one, two, *rest = SEEN.silhouettes
    wrong = replace(SEEN, silhouettes=(one, replace(two, **change), *rest))
    with pytest.raises(InvalidOutput, match=f"'dressing' returned {said}"):
        segmentation_of(Dressing(output=wrong), *asked)
    with pytest.raises(InvalidOutput, match="'dressing' returned silhouettes as a Silhouette, not a tuple of them"):
        segmentation_of(Dressing(output=replace(SEEN, silhouettes=one)), *asked)


class Lost(Recovery):
    """Finds nothing."""

    name = "lost"

    def recover(self, frame, state, result, past, model, settle_from):
        return None


LOOPED = settled(STATE, SCENE)
ESTIMATE = STATE.estimate


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (None, "NoneType, not FrameResult"),
        (replace(LOOPED, overlap=np.ones(1)), r"the overlap of shape \(1,\), not \(4,\)"),
        (replace(LOOPED, energy=np.zeros((2, 7))), r"the energy of shape \(2, 7\), not \(1, 0\)"),
        (replace(LOOPED, notes="found"), "notes as a str, not a tuple of them"),
        (replace(LOOPED, state=replace(STATE, cloth=CLOTH)), r"cloth of shape .*, not \(0, 3\)"),
        (replace(LOOPED, state=replace(STATE, estimate=replace(ESTIMATE, covariance=np.nan * ESTIMATE.covariance))),
         "a covariance that is not finite"),
    ],
)  # fmt: skip
def test_a_recovery_that_returns_no_result(output, said):
    assert result_of(Lost(), replace(LOOPED, notes=("found",)), LOOPED, SCENE).notes == ("found",)
    with pytest.raises(InvalidOutput, match=f"recovery 'lost' returned {said}"):
        result_of(Lost(), output, LOOPED, SCENE)


def test_a_recovery_that_leaves_the_cloth_behind():
    worn = replace(LOOPED, state=replace(STATE, cloth=CLOTH))
    left = replace(worn, state=replace(STATE, cloth=replace(CLOTH, vertices=CLOTH.vertices + 100)))
    assert result_of(Lost(), left, left, SCENE) is left  # what the loop found was looked at there
    with pytest.raises(InvalidOutput, match=r"recovery 'lost' returned cloth 1.* m from the body"):
        result_of(Lost(), left, worn, SCENE)


class Idle(Stage):
    """Is given what it is said to have made."""

    name = "idle"


@pytest.mark.parametrize("field", ["root", "angles"])
def test_a_stage_that_makes_motion_that_is_not_finite(field):
    lost = {field: np.nan * getattr(POSE, field)}
    start = Start(pose=POSE, parameters=np.empty(0))
    track = stepping(SCENE.body, count=2)
    broken = replace(track, **{field: np.nan * getattr(track, field)})
    assert made_of(Idle(), start, Start) is start
    assert made_of(Idle(), track, Track) is track
    nowhere = replace(POSE, **lost)
    for made in (replace(start, pose=nowhere), replace(start, others=(POSE, nowhere)), broken):
        with pytest.raises(InvalidOutput, match="stage 'idle' returned a pose that is not finite"):
            made_of(Idle(), made, type(made))
