"""What a recording says of the garments that are worn."""

import json

import pytest
from mocapflow_garments.cylinder import Cylinder
from mocapflow_garments.outfit import Outfit
from mocapflow_garments.skirt import Skirt

from mocapflow.config.documents import Document, Place
from mocapflow.config.measures import garment_of, place_of, recorded_garment
from mocapflow.config.resolve import Resolver
from mocapflow.errors import MocapflowError
from mocapflow.registry import load_registry

REGISTRY = load_registry()
SKIRT = {"type": "skirt", "waist_height": 1.05, "waist_circumference": 0.75, "hem_circumference": 1.5, "length": 0.7}
SLEEVE = {"type": "cylinder", "joint": "shoulder_l", "start": 0.2, "length": 0.36}


@pytest.fixture
def clip(tmp_path):
    (tmp_path / "subject").mkdir()
    return tmp_path


def write(clip, said):
    (clip / "subject" / "garment.json").write_text(json.dumps(said, indent=1))


def named(value, clip):
    return garment_of(value, clip, Resolver(Document({}, {(): Place("pipeline.yaml:2:1", clip)}), REGISTRY))


def test_one_garment_may_be_a_list_of_one(clip):
    write(clip, SKIRT)
    alone = recorded_garment(clip, REGISTRY)
    assert isinstance(alone, Skirt) and alone.length_m == 0.7
    write(clip, [SKIRT])
    assert recorded_garment(clip, REGISTRY) == alone


def test_several_garments_are_an_outfit(clip):
    write(clip, [SKIRT, SLEEVE, {**SLEEVE, "joint": "shoulder_r"}])
    outfit = recorded_garment(clip, REGISTRY)
    assert isinstance(outfit, Outfit) and outfit == named("outfit", clip)
    assert [type(garment) for garment in outfit.garments] == [Skirt, Cylinder, Cylinder]
    assert [garment.length_m for garment in outfit.garments] == [0.7, 0.36, 0.36]
    assert [garment.joint for garment in outfit.garments[1:]] == ["shoulder_l", "shoulder_r"]


def test_any_setting_can_be_said_in_the_recording(clip):
    write(clip, {**SKIRT, "strands": 16, "force_orders": [0]})
    skirt = recorded_garment(clip, REGISTRY)
    assert skirt.strands == 16 and skirt.force_orders == (0,)


def test_a_setting_of_the_pipeline_is_meant_for_the_garments_that_have_it(clip):
    write(clip, [SKIRT, {**SLEEVE, "strands": 8}])
    skirt, sleeve = named({"use": "from_recording", "strands": 24, "joint": "hip_l"}, clip).garments
    assert skirt.strands == sleeve.strands == 24 and sleeve.joint == "hip_l"
    with pytest.raises(MocapflowError, match=r"garment\.hem_m: unknown setting of skirt"):
        named({"use": "from_recording", "hem_m": 1.5}, clip)


def test_an_outfit_that_does_not_say_its_garments_is_from_the_recording(clip):
    write(clip, [SKIRT, SLEEVE])
    for value in ("outfit", {"use": "outfit"}):
        assert named(value, clip) == named("from_recording", clip)
    assert [garment.strands for garment in named({"use": "outfit", "strands": 24}, clip).garments] == [24, 24]


def test_an_outfit_of_a_pipeline_has_its_own_measures(clip):
    write(clip, [SKIRT, SLEEVE])
    sleeves = [{"use": "cylinder", "joint": joint} for joint in ("shoulder_l", "shoulder_r")]
    outfit = named({"use": "outfit", "garments": sleeves}, clip)
    assert outfit == Outfit(garments=(Cylinder(joint="shoulder_l"), Cylinder(joint="shoulder_r")))
    with pytest.raises(MocapflowError, match=r"garment\.garments\.0: skirt needs waist_height_m") as caught:
        named({"use": "outfit", "garments": ["skirt"]}, clip)
    assert "come from" not in caught.value.hint


def test_a_recording_says_no_outfit(clip):
    write(clip, {"type": "outfit", "garments": [SKIRT, SLEEVE]})
    with pytest.raises(MocapflowError, match="several garments are written as a list of them") as caught:
        recorded_garment(clip, REGISTRY)
    assert caught.value.where == f"{clip / 'subject' / 'garment.json'}:2:11"


def test_measures_of_a_recording_are_said_to_be_there(clip):
    places = Resolver(Document({}, {(): Place("pipeline.yaml:2:1", clip)}), REGISTRY)
    for value in ("from_recording", "outfit", {"use": "outfit", "strands": 24}):
        assert place_of(value, clip, places) == str(clip / "subject" / "garment.json")
    for value in ("skirt", {"use": "outfit", "garments": ["skirt"]}):
        assert place_of(value, clip, places) == "pipeline.yaml:2:1"


def test_a_measure_that_more_than_one_garment_has_is_refused(clip):
    write(clip, [SKIRT, SLEEVE])
    with pytest.raises(MocapflowError, match=r"garment\.length_m: more than one garment") as caught:
        named({"use": "from_recording", "length_m": 0.4}, clip)
    assert caught.value.where == "pipeline.yaml:2:1"
    skirt, _ = named({"use": "from_recording", "waist_height_m": 1.0}, clip).garments
    assert skirt.waist_height_m == 1.0


def test_a_pipeline_may_take_some_of_several(clip):
    write(clip, [SKIRT, SLEEVE])
    assert named("skirt", clip) == Skirt(**{f"{k}_m": v for k, v in SKIRT.items() if k != "type"})
    assert named({"use": "cylinder", "strands": 8}, clip).joint == "shoulder_l"
    write(clip, [SKIRT, SLEEVE, {**SLEEVE, "joint": "shoulder_r"}])
    assert [garment.joint for garment in named({"use": "cylinder", "strands": 8}, clip).garments] == [
        "shoulder_l", "shoulder_r"
    ]  # fmt: skip


def test_what_is_wrong_is_told_with_its_line(clip):
    file = clip / "subject" / "garment.json"
    write(clip, [SKIRT, {**SLEEVE, "length": 36}])
    line = 1 + file.read_text().splitlines().index('  "length": 36')
    with pytest.raises(MocapflowError) as caught:
        recorded_garment(clip, REGISTRY)
    assert caught.value.where == f"{file}:{line}:4"
    assert caught.value.message == "garment.length: input should be less than 4, not 36"
    assert f"come from {file}, which describes a cylinder" in caught.value.hint
    write(clip, [SKIRT, {**SLEEVE, "type": "sleeve"}])
    with pytest.raises(MocapflowError, match="no garment named 'sleeve'") as caught:
        recorded_garment(clip, REGISTRY)
    assert caught.value.where.startswith(f"{file}:{line - 3}:")
    write(clip, [SKIRT, {**SLEEVE, "length_m": 0.3}])
    with pytest.raises(MocapflowError, match="'length' and 'length_m' are one measure") as caught:
        recorded_garment(clip, REGISTRY)
    assert caught.value.where == f"{file}:{line + 1}:4"


def test_a_garment_that_lacks_a_measure_is_told_with_its_line(clip):
    write(clip, [SLEEVE, {"type": "skirt", "length": 0.7}])
    with pytest.raises(MocapflowError, match="skirt needs waist_height_m") as caught:
        recorded_garment(clip, REGISTRY)
    assert caught.value.where == f"{clip / 'subject' / 'garment.json'}:9:12"


@pytest.mark.parametrize("said", [[], [SKIRT, 3], [SKIRT, {"length": 0.3}], "skirt"])
def test_what_is_no_garment(clip, said):
    write(clip, said)
    with pytest.raises(MocapflowError, match="it does not say its type") as caught:
        recorded_garment(clip, REGISTRY)
    assert "several garments as a list of them" in caught.value.hint
