"""Layers: what the surface draws where is learned, and tells colours apart."""

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_levelset.colours import BINS, bins_of
from mocapflow_levelset.layered import Layered
from mocapflow_levelset.layers import COLOURS, colour_model, garment_log_ratio, layer_histograms, layer_of
from mocapflow_levelset.room_colours import ROOM

from mocapflow.data import BODY, CLOTH, Frame, Past, Turn
from mocapflow.geometry.outfits import together
from mocapflow.geometry.visibility import front_vertices
from mocapflow.testing import tiny_cloth, tiny_frame, tiny_past, tiny_pose, tiny_scene, tiny_segmentation, tiny_state

SCENE = tiny_scene(clothed=True)
POSE = tiny_pose(SCENE, 1, 0.05)
SKIN, CLOTHS = (40, 80, 170), (60, 140, 60)  # BGR


def painted(colour_of, pose=POSE, noise=3.0, lower_m=0.0):
    """Pictures in which each layer of the surface has the colour of `colour_of`, and cloth hangs so much lower."""
    surface, layers = SCENE.surface(pose, tiny_cloth(SCENE, pose)), layer_of(SCENE)
    surface = replace(surface, vertices=surface.vertices - lower_m * (surface.layer == CLOTH)[:, None] * [0, 0, 1])
    palette = np.array([colour_of(layer) for layer in range(layers.max() + 1)], np.float64)
    images, rng = [], np.random.default_rng(7)
    for camera in SCENE.cameras:
        width, height = camera.size
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2).astype(np.float64)
        vertex, _ = front_vertices(surface, camera, grid)
        image = np.where(vertex[:, None] >= 0, palette[layers[vertex]], 120.0).reshape(height, width, 3)
        images.append(np.clip(image + noise * rng.normal(size=image.shape), 0, 255).astype(np.uint8))
    return Frame(index=1, time=0.0, images=tuple(images), usable=np.ones(len(images), bool))


def dressed(layer):
    return CLOTHS if layer == layer_of(SCENE).max() else SKIN


def learned(frame, past=None, keep=0.9, pose=POSE):
    surface = SCENE.surface(pose, tiny_cloth(SCENE, pose))
    return layer_histograms(frame, tiny_segmentation(SCENE, pose).silhouettes, surface, SCENE, past or Past(), keep, 3)


def test_sides_share_a_layer_and_cloth_is_the_last():
    layers, body = layer_of(SCENE), SCENE.body
    carrier = body.skin_joint[np.arange(len(body.vertices)), body.skin_weight.argmax(axis=1)]
    knees = [set(layers[: len(carrier)][carrier == body.joint(name)]) for name in ("knee_l", "knee_r")]
    assert knees[0] == knees[1] and len(knees[0]) == 1
    assert set(layers[SCENE.layer == CLOTH]) == {layers.max()}
    assert layers.max() not in layers[SCENE.layer == BODY]


def test_each_garment_is_a_layer_and_sides_share_it():
    long, sleeves = SCENE.garment, [replace(SCENE.garment, name=f"sleeve_{side}") for side in "lr"]
    worn, layers = replace(SCENE, garment=together("all", [sleeves[0], long, sleeves[1]])), layer_of(SCENE)
    found = layer_of(worn)
    body, count = len(SCENE.body.vertices), len(long.vertices)
    np.testing.assert_array_equal(found[:body], layers[:body])
    np.testing.assert_array_equal(found[body:] - found[:body].max(), np.repeat([1, 2, 1], count))


def test_the_colours_of_several_garments_are_all_the_garment_s():
    """A part that has a garment's colour and lies outside of it takes that colour away, and no other."""
    worn = replace(SCENE, garment=together("both", [SCENE.garment, replace(SCENE.garment, name="apron")]))
    colours = [SKIN, CLOTHS, (20, 200, 20)]
    skin, cloth, apron = (int(bins_of(np.array(colour, np.uint8))) for colour in colours)
    counts = np.zeros((layer_of(worn).max() + 1, BINS))
    counts[:-2, skin], counts[-1, cloth], counts[-2, apron] = 1000, 1000, 1000
    told = garment_log_ratio(Past(appearance={COLOURS: counts}), worn)
    assert told[cloth] > 2 and told[apron] > 2 and told[skin] < -2
    counts[layer_of(worn)[SCENE.body.vertices[:, 2].argmin()], apron] = 1000  # a sock
    told = garment_log_ratio(Past(appearance={COLOURS: counts}), worn)
    assert told[cloth] > 2 and told[apron] < 1


def test_a_layer_has_the_colours_that_it_is_drawn_on():
    counts = learned(painted(dressed, noise=0.0))
    cloth, skin = (int(bins_of(np.array(colour, np.uint8))) for colour in (CLOTHS, SKIN))
    assert counts[-1, cloth] == counts[-1].sum() > 100
    assert counts[:-1, skin].sum() == counts[:-1].sum() > 100


def test_what_is_apart_is_told_and_what_is_alike_is_not():
    layers = layer_of(SCENE)
    knee = layers[np.linalg.norm(SCENE.body.vertices - [0.1, 0, 0.3], axis=1).argmin()]
    told = colour_model(Past(appearance={COLOURS: learned(painted(dressed))}))
    skin, cloth = (int(bins_of(np.array(colour, np.uint8))) for colour in (SKIN, CLOTHS))
    assert told.distinct[knee, layers.max()] and told.distinct[layers.max(), knee]
    assert told.ratio[knee, skin] > 2 and told.ratio[knee, cloth] < -2
    assert not told.distinct[:-1, :-1].any()  # all skin
    same = colour_model(Past(appearance={COLOURS: learned(painted(lambda layer: SKIN))}))
    assert not same.distinct.any() and not same.ratio.any()


def test_the_garment_is_told_from_every_part_outside_of_it_or_not_at_all():
    skin, cloth = (int(bins_of(np.array(colour, np.uint8))) for colour in (SKIN, CLOTHS))
    told = garment_log_ratio(Past(appearance={COLOURS: learned(painted(dressed))}), SCENE)
    assert told[cloth] > 2 and told[skin] < -2
    socks = layer_of(SCENE)[SCENE.body.vertices[:, 2].argmin()]  # of the garment's colour
    alike = painted(lambda layer: CLOTHS if layer == socks else dressed(layer))
    told = garment_log_ratio(Past(appearance={COLOURS: learned(alike)}), SCENE)
    assert told[cloth] < 0.5
    assert garment_log_ratio(Past(), SCENE) is None
    assert garment_log_ratio(Past(appearance={COLOURS: learned(alike)}), SCENE.undressed) is None


def test_a_garment_that_leaves_no_part_outside_is_not_told(monkeypatch):
    monkeypatch.setitem(vars(SCENE), "near_garment", np.ones(len(SCENE.body.vertices), bool))
    assert garment_log_ratio(Past(appearance={COLOURS: learned(painted(dressed))}), SCENE) is None


def test_old_colours_are_forgotten():
    first = learned(painted(dressed))
    past = Past(appearance={COLOURS: first})
    second = learned(painted(dressed), past, keep=0.5)
    assert second.sum() == pytest.approx(1.5 * first.sum(), rel=0.02)


def test_a_part_does_not_learn_what_is_surely_another_s():
    past = Past(appearance={COLOURS: learned(painted(dressed))})
    swapped = painted(lambda layer: SKIN if layer == layer_of(SCENE).max() else CLOTHS)
    kept = learned(swapped, past, keep=0.5)
    np.testing.assert_allclose(kept[-1], 0.5 * past.appearance[COLOURS][-1])


def test_the_segmenter_hands_them_on():
    """Learned on the second turn; in the next frame, contours are looked for by them from the first turn on."""
    past, turn = tiny_past(SCENE, POSE), Turn(index=1)
    frame, state = tiny_frame(SCENE, POSE), tiny_state(SCENE, POSE)
    found = Layered().segment(frame, state, past, SCENE, turn)
    assert found.inner is None and ROOM not in found.appearance
    then = Layered().segment(frame, state, replace(past, appearance=found.appearance), SCENE, Turn(index=0))
    assert then.inner is not None
    assert then.appearance == found.appearance
    assert len(found.silhouettes) == len(SCENE.cameras)
    assert found.appearance[COLOURS].shape == (layer_of(SCENE).max() + 1, BINS)
    assert found.appearance[COLOURS].sum() > 100


def test_what_is_hidden_is_not_learned():
    frame = painted(dressed)
    hidden = tuple(np.ones(image.shape[:2], bool) for image in frame.images)
    assert learned(replace(frame, hidden=hidden)).sum() == 0
