"""Garments: what tape measures become, and what is said when they can't be meant."""

from dataclasses import replace

import numpy as np
import pytest
from drape_bodies import SKIRT, legs
from mocapflow_garments import sections
from mocapflow_garments.cylinder import Cylinder
from mocapflow_garments.outfit import Outfit
from mocapflow_garments.shorts import Shorts
from mocapflow_garments.skirt import Skirt
from pydantic import ValidationError

from mocapflow.errors import GarmentError, MocapflowError
from mocapflow.scene import Scene
from mocapflow.testing import template_body

BODY = legs()
SHORTS = dict(
    waist_height_m=1.08, waist_circumference_m=0.92, hip_circumference_m=1.1, leg_opening_circumference_m=0.65,
    inseam_m=0.18, length_m=0.52,
)  # fmt: skip


def around(garment, vertices):
    return np.linalg.norm(vertices - np.roll(vertices, -1, axis=0), axis=1).sum()


def test_a_skirt_has_its_measures():
    garment = Skirt(**SKIRT, strands=40, rings=20).sew(BODY)
    grid = garment.vertices[garment.strands]
    assert grid.shape == (40, 20, 3)
    np.testing.assert_allclose(np.linalg.norm(np.diff(grid, axis=1), axis=2).sum(axis=1), 0.6, atol=1e-12)
    np.testing.assert_allclose(grid[:, 0, 2], 1.08)
    assert abs(around(garment, grid[:, 0]) - 0.92) < 0.005
    assert abs(around(garment, grid[:, -1]) - 1.7) < 0.01
    lengths = garment.ring_length.reshape(20, 40).sum(axis=1)
    assert abs(lengths[0] - 0.92) < 0.005
    assert abs(lengths[-1] - 1.7) < 1e-9
    assert (np.diff(lengths) >= 0).all()
    assert BODY.joint_names[garment.carried_by[0]] == "pelvis"


def test_a_skirt_may_be_a_full_circle():
    hem = SKIRT["waist_circumference_m"] + 2 * np.pi * 0.3
    circle = Skirt(**{**SKIRT, "length_m": 0.3, "hem_circumference_m": hem}, rings=50).sew(BODY).vertices
    assert np.isfinite(circle).all() and np.ptp(circle[:, 2]) < 0.1


def test_a_skirt_is_nowhere_tighter_than_the_hips():
    """On a trunk that widens evenly from the waist down; below, where the legs have parted, it keeps its width."""
    wider = np.where(BODY.vertices[:, 2:] > 0, 2.08 - BODY.vertices[:, 2:], 1.0)  # by a tenth in ten centimetres
    body = replace(BODY, vertices=BODY.vertices * np.hstack([wider, wider, np.ones_like(wider)]))
    sewn = Skirt(**{**SKIRT, "hem_circumference_m": 0.95}, strands=40, rings=61).sew(body)
    lengths, height = sewn.ring_length.reshape(61, 40).sum(axis=1), 1.08 - np.linspace(0, 0.6, 61)
    trunk = [max(map(sections.perimeter, sections.outlines(body, sections.level(z)))) for z in height[:13]]
    np.testing.assert_allclose(lengths[:13] - trunk, 0.92 - trunk[0], atol=1e-3)
    assert lengths[12] > 1.0 and (np.diff(lengths) >= 0).all() and lengths[-1] < 1.3
    hem = f"hem_circumference_m 0.950 is tighter than the body; widened to {lengths[-1]:.3f}"
    assert sewn.repairs == (hem,)


def test_faces_look_outwards():
    for garment in (Skirt(**SKIRT).sew(BODY), Cylinder().sew(BODY)):
        a, b, c = np.moveaxis(garment.vertices[garment.faces], 1, 0)
        out = (a + b + c) / 3 - garment.vertices.mean(axis=0)
        normal = np.cross(b - a, c - a)
        assert ((out * normal)[:, :2].sum(axis=1) > 0).all()


def test_shorts_have_two_legs_with_their_measures():
    garment = Shorts(**SHORTS).sew(BODY)
    assert garment.strands.shape == (64, 20)
    used = garment.strands >= 0
    long = used.all(axis=1)
    grid = garment.vertices[garment.strands[long]]
    np.testing.assert_allclose(np.linalg.norm(np.diff(grid, axis=1), axis=2).sum(axis=1), 0.52, atol=1e-12)
    assert long.sum() == 48
    assert abs(around(garment, grid[:, 0]) - 0.92) < 0.005
    assert (grid[:24, :, 0] > 0).all() and (grid[24:, :, 0] < 0).all()  # each leg's own
    pairs = np.sort(np.stack([garment.faces, np.roll(garment.faces, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    down = np.sort(np.stack([garment.strands[:, :-1][long], garment.strands[:, 1:][long]], axis=-1)).reshape(-1, 2)
    sides = (pairs[:, None] == down[:, None].swapaxes(0, 1)).all(axis=2).sum(axis=0)
    assert (sides == 2).all()  # there is cloth on both sides of every link
    inner = garment.strands[~long]
    seam = used[~long].sum(axis=1)
    assert np.ptp(seam) == 0
    assert abs((seam[0] - 1) * 0.52 / 19 - 0.18) < 0.52 / 19
    assert np.isin(inner[:, 0], garment.pinned).all()
    last = garment.strands[np.arange(64), used.sum(axis=1) - 1]
    assert {BODY.joint_names[j] for j in garment.carried_by[last]} == {"hip_l", "hip_r"}
    trousers = Shorts(**{**SHORTS, "length_m": 0.98, "inseam_m": 0.64}, rings=30).sew(BODY)
    assert {BODY.joint_names[j] for j in trousers.carried_by} == {"pelvis", "hip_l", "hip_r"}
    a, b = garment.rings.T
    openings = np.isin(a, last) & np.isin(b, last)
    assert abs(garment.ring_length[openings].sum() - 2 * 0.65) < 1e-9


def test_shorts_lie_outside_of_hips_that_bulge_below_the_waist():
    wider = 1 + 0.25 * np.exp(-(((BODY.vertices[:, 2:] - 1.0) / 0.04) ** 2))
    body = replace(BODY, vertices=BODY.vertices * np.hstack([wider, wider, np.ones_like(wider)]))
    sewn = Shorts(**{**SHORTS, "hip_circumference_m": 1.3}).sew(body)
    grid = sewn.vertices[sewn.strands[(sewn.strands >= 0).all(axis=1)]]
    for row in range(1, 5):
        for x, y, z in grid[:, row]:
            closed = max(sections.outlines(body, sections.level(z)), key=sections.perimeter)
            edge = np.roll(closed, -1, axis=0) - closed
            outward = np.stack([edge[:, 1], -edge[:, 0]], axis=1) / np.linalg.norm(edge, axis=1, keepdims=True)
            assert np.max(np.sum(outward * ([x, y] - closed), axis=1)) > -0.003  # m; links are made even afterwards


def test_a_cylinder_has_its_measures_and_runs_down_its_limb():
    garment = Cylinder(upper_circumference_m=0.60, lower_circumference_m=0.56, strands=40, rings=20).sew(BODY)
    grid, lengths = garment.vertices[garment.strands], garment.ring_length.reshape(20, 40).sum(axis=1)
    assert (lengths[0], lengths[-1]) == (pytest.approx(0.60), pytest.approx(0.56))
    assert around(garment, grid[:, 0]) == pytest.approx(0.60, abs=0.005)
    assert around(garment, grid[:, -1]) == pytest.approx(0.56, abs=0.01)
    np.testing.assert_allclose(np.linalg.norm(np.diff(grid, axis=1), axis=2).sum(axis=1), 0.40, atol=1e-12)
    hip, knee = (BODY.positions[BODY.joint(name)] for name in ("hip_l", "knee_l"))
    np.testing.assert_allclose(grid[:, 0].mean(axis=0), hip + 0.3 * (knee - hip), atol=0.01)
    down = grid[:, -1].mean(axis=0) - grid[:, 0].mean(axis=0)
    assert down @ (knee - hip) / np.linalg.norm(knee - hip) == pytest.approx(0.40, abs=0.005)


def test_a_band_has_its_length_and_faces_outwards():
    square = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    ring, facing = sections.band(square, 0.05, 400)
    assert abs(sections.perimeter(ring) - (0.8 + 2 * np.pi * 0.05)) < 1e-3
    assert ((ring * facing).sum(axis=1) > 0.1).all()


def test_a_section_of_two_legs_is_two_outlines():
    found = sections.sections(BODY, sections.level(0.6))
    assert len(found) == 2
    for points in found:
        assert abs(sections.perimeter(sections.outline(points)) - 2 * np.pi * 0.08) < 2e-3


def test_a_section_between_rows_of_vertices_lies_on_the_skin():
    """Of legs that widen upwards as cones do, cut across, and of straight ones, cut aslant."""
    cone = replace(
        BODY, vertices=BODY.vertices * np.stack([BODY.vertices[:, 2]] * 2 + [np.ones(len(BODY.vertices))], 1)
    )
    for height in (0.613, 0.7):
        found = sections.sections(cone, sections.level(height))
        for points in found:
            assert abs(sections.perimeter(sections.outline(points)) / height - 2 * np.pi * 0.08) < 2e-3
    leg = sections.outline(sections.sections(BODY, sections.level(0.6))[0]).mean(axis=0)
    tilted = np.array([[np.cos(0.3), 0, np.sin(0.3)], [0, 1.0, 0]])
    plane = sections.Plane(point=np.array([*leg, 0.6]), across=tilted)
    points = min(sections.sections(BODY, plane), key=lambda points: np.linalg.norm(points.mean(axis=0)))
    away = np.linalg.norm(plane.lift(points)[:, :2] - leg, axis=1)
    assert 0.079 < away.min() < away.max() < 0.081


def test_a_band_begins_so_many_spacings_from_the_first_axis():
    diamond = np.array([[0.3, 0.0], [0.0, 0.4], [-0.3, 0.0], [0.0, -0.4]])
    ring, facing = sections.band(diamond, 0.0, 8, 0.5)
    np.testing.assert_allclose(np.arctan2(*facing[0][::-1]), 0.5 * 2 * np.pi / 8)
    np.testing.assert_allclose(ring[0], [0.225, 0.1], atol=1e-3)  # an eighth of a metre from the first corner


@pytest.mark.parametrize(("garment", "measures"), [(Skirt, SKIRT), (Shorts, SHORTS)])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 0.0, -0.3, 108.0])
def test_a_measure_that_is_no_length_in_metres_is_refused(garment, measures, value):
    for measure in measures:
        with pytest.raises(ValidationError, match=f"{measure}\n.* should be (greater than|less than|a finite number)"):
            garment(**{**measures, measure: value})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (dict(length_m=1.2), "below the floor"),
        (dict(waist_height_m=2.5), "there is no body at waist_height_m = 2.50"),
        (dict(waist_height_m=0.6, length_m=0.3), "at waist_height_m = 0.60 the legs have parted"),
        (dict(waist_circumference_m=1.9), "can't stay up on a body"),
        (dict(waist_circumference_m=0.5), "but the body measures"),
        (dict(hem_circumference_m=3.9, length_m=0.3), "wider than a full circle"),
    ],
)
def test_a_skirt_that_can_not_be_says_what_to_do(change, said):
    with pytest.raises(GarmentError, match=said):
        Skirt(**{**SKIRT, **change}).sew(BODY)


@pytest.mark.parametrize(("cut", "said"), [(False, "is the body this person's"), (True, "body.part: full")])
def test_a_waist_above_the_body_may_be_above_the_part_of_it_that_is_used(cut, said):
    body = replace(BODY, cut=np.full(len(BODY.vertices), cut))
    with pytest.raises(GarmentError, match=rf"there is no body at(.|\n)*{said}"):
        Skirt(**{**SKIRT, "waist_height_m": 2.5}).sew(body)


def test_a_skirt_does_not_hang_from_the_shoulders():
    body = template_body()
    shoulders = body.positions[body.joint("shoulder_l"), 2]
    with pytest.raises(GarmentError, match=r"it would hang from the shoulders(.|\n)*shoulders are \d\.\d\d m high"):
        Skirt(**{**SKIRT, "waist_height_m": shoulders + 0.02, "waist_circumference_m": 1.2}).sew(body)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (dict(inseam_m=0.52), "the inseam"),
        (dict(length_m=1.2), "below the floor"),
        (dict(inseam_m=0.5), "legs have not parted"),
        (dict(leg_opening_circumference_m=0.1), "leg_opening_circumference_m of 0.10 m is .* m, but the body measures"),
    ],
)
def test_shorts_that_can_not_be_say_what_to_do(change, said):
    with pytest.raises(GarmentError, match=said):
        Shorts(**{**SHORTS, **change}).sew(BODY)


@pytest.mark.parametrize(
    ("garment", "measure", "said"),
    [
        (Skirt(**{**SKIRT, "waist_circumference_m": 0.80}), "waist", "waist_circumference_m 0.800 is tighter"),
        (Skirt(**{**SKIRT, "hem_circumference_m": 0.70}), "hem", "hem_circumference_m 0.700 is tighter"),
        (Shorts(**{**SHORTS, "hip_circumference_m": 0.80}), "hip", "hip_circumference_m 0.800 is tighter"),
        (
            Shorts(**{**SHORTS, "leg_opening_circumference_m": 0.45}),
            "leg",
            "leg_opening_circumference_m 0.450",
        ),
        (Cylinder(upper_circumference_m=0.45), "upper", "upper_circumference_m 0.450 is tighter"),
    ],
)
def test_a_measure_inside_the_body_is_widened_and_recorded(garment, measure, said):
    sewn = garment.sew(BODY)
    (repair,) = [text for text in sewn.repairs if text.startswith(measure)]
    assert repair.startswith(said)
    assert f"{sewn.name}: {repair}" in Scene(cameras=(), body=BODY, garment=sewn).warnings


@pytest.mark.parametrize(("garment", "measures"), [(Skirt, SKIRT), (Shorts, SHORTS)])
def test_a_scan_may_stand_beside_the_origin(garment, measures):
    aside = np.array([0.3, -0.2, 0.0])
    moved = replace(BODY, vertices=BODY.vertices + aside, positions=BODY.positions + aside)
    here, there = (garment(**measures).sew(body) for body in (BODY, moved))
    np.testing.assert_allclose(there.vertices, here.vertices + aside, atol=1e-9)
    np.testing.assert_array_equal(there.carried_by, here.carried_by)


def test_hands_before_the_hips_are_no_parted_legs():
    """A scan with its arms raised forwards: the box about all that is cut lies before the trunk."""
    body = template_body()
    arms = np.isin(body.skin_joint[:, 0], [body.joint(f"wrist_{side}") for side in "lr"])
    reached = replace(body, vertices=body.vertices - 0.4 * np.eye(3)[1] * arms[:, None])
    hands = reached.vertices[arms, 2]
    sewn = Skirt(**{**SKIRT, "waist_height_m": float(np.median(hands)), "length_m": 0.5}).sew(reached)
    assert np.isfinite(sewn.vertices).all()


def test_thighs_may_touch_below_the_crotch():
    garment = Shorts(**{**SHORTS, "inseam_m": 0.43}).sew(BODY)  # 3 cm above where the legs of this body part
    assert np.isfinite(garment.vertices).all()
    assert abs(garment.vertices[:, 2].min() - (1.08 - 0.52)) < 0.02


def test_a_waist_inside_the_body_is_pushed_out():
    garment = Skirt(**{**SKIRT, "waist_circumference_m": 0.80}).sew(BODY)
    waist = garment.vertices[garment.pinned]
    assert np.hypot(waist[:, 0] / 0.16, waist[:, 1] / 0.12).min() > 1.0


def test_measures_that_fit_are_not_repaired():
    assert [garment.sew(BODY).repairs for garment in (Skirt(**SKIRT), Shorts(**SHORTS), Cylinder())] == [(), (), ()]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda mesh: {"vertices": np.where(np.arange(len(mesh.vertices))[:, None] == 7, np.nan, mesh.vertices)},
         "vertex 7 is not finite"),
        (lambda mesh: {"vertices": np.concatenate([mesh.vertices[:1], mesh.vertices[:1], mesh.vertices[2:]])},
         "strand 0 has a link of zero length"),
        (lambda mesh: {"faces": mesh.faces + 1}, "a face names vertex"),
        (lambda mesh: {"faces": mesh.faces - 1}, "a face names vertex -1 of"),
        (lambda mesh: {"rings": -1 - mesh.rings}, "a ring names vertex -"),
        (lambda mesh: {"pinned": mesh.pinned - 5}, "a pin names vertex -5 of"),
        (lambda mesh: {"strands": mesh.strands - 2}, "a strand names vertex -"),
        (lambda mesh: {"ring_length": 0 * mesh.ring_length}, "ring link 0 has no length"),
    ],
)  # fmt: skip
def test_a_garment_that_can_not_be_draped_is_refused_when_it_is_made(change, said):
    mesh = Skirt(**SKIRT).sew(BODY)
    with pytest.raises(GarmentError, match=f"skirt: {said}"):
        replace(mesh, **change(mesh))


def test_a_cylinder_on_an_unknown_limb_is_refused():
    with pytest.raises(MocapflowError, match=r"no joint 'hip_left'(.|\n)*did you mean 'hip_l'"):
        Cylinder(joint="hip_left").sew(BODY)
    with pytest.raises(GarmentError, match="nothing follows joint 'knee_l'"):
        Cylinder(joint="knee_l").sew(BODY)


def test_an_outfit_is_what_its_garments_are():
    tubes = [Cylinder(joint=joint, upper_circumference_m=0.6) for joint in ("hip_l", "hip_r")]
    both = Outfit(garments=(Skirt(**SKIRT), *tubes)).sew(BODY)
    assert both.name == "outfit" and [piece.name for piece in both.pieces] == [
        "skirt", "cylinder_hip_l", "cylinder_hip_r"
    ]  # fmt: skip
    alone = Skirt(**SKIRT).sew(BODY)
    np.testing.assert_array_equal(both.vertices[: len(alone.vertices)], alone.vertices)
    np.testing.assert_array_equal(both.pieces[2].vertices, tubes[1].sew(BODY).vertices)


def test_a_garment_of_an_outfit_that_can_not_be_sewn_is_told():
    outfit = Outfit(garments=(Skirt(**SKIRT), Cylinder(upper_circumference_m=0.1)))
    with pytest.raises(GarmentError, match="cylinder_hip_l: upper_circumference_m is 0.10 m"):
        outfit.sew(BODY)


def test_a_sleeve_that_begins_at_the_trunk_is_told_to_begin_lower():
    body, measures = template_body(), dict(joint="shoulder_l", upper_circumference_m=0.36)
    Cylinder(start=0.3, **measures).sew(body)
    with pytest.raises(GarmentError, match=r"the body measures 1\.\d+ m there") as caught:
        Cylinder(start=0.1, **measures).sew(body)
    assert caught.value.hint.startswith("check `start` (near 0 the trunk is measured with the limb) and the measure")


def test_a_garment_that_is_worn_twice_is_refused():
    left, right, lower = Cylinder(), Cylinder(joint="hip_r"), Cylinder(start=0.6)
    Outfit(garments=(left, right, lower)).sew(BODY)
    with pytest.raises(GarmentError, match="garment 3 of the outfit is the same cylinder") as caught:
        Outfit(garments=(left, right, Cylinder())).sew(BODY)
    assert "such as the joint" in caught.value.hint
