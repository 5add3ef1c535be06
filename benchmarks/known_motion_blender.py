"""Blender's part of `known_motion.py`: `blender -b -t 1 -P known_motion_blender.py -- WORK ROOM` (Blender 3.4).

Reads WORK/scene.npz. Writes to WORK cloth.npy (T,C,3), CAMERA_FRAME.png (what surrounds the person) and boxes.json:
x, y, width and height of these per camera and frame. Writes CAMERA_K.png, the empty room, to ROOM unless it is there.
"""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

WORK, ROOM = (Path(x) for x in sys.argv[sys.argv.index("--") + 1 :])
GAP = 0.003  # m, between cloth and skin
SAMPLES = 4  # a pixel
HALF = 5.0  # m, of the room's width
AMBIENT = 0.30  # light from all around that costs no noise
Colour = tuple[float, ...]
Box = tuple[int, int, int, int]  # x, y, width, height


def add_mesh(name: str, vertices: np.ndarray, faces: np.ndarray) -> Any:
    """Add a smooth mesh and return the object."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), bool))
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


# --- cloth ------------------------------------------------------------------------------------------------------------


def drape(scene: dict[str, np.ndarray]) -> np.ndarray:
    """Return the garment (T,C,3), pinned at its bands, draped on the moving body, from frame 0 on."""
    bodies, faces, pinned, targets = (scene[k] for k in ("body", "faces", "pinned", "garment"))
    targets[0] = lifted(targets[0], bodies[0], faces, pinned, 2 * GAP)[0]
    body, garment = add_mesh("body", bodies[0], faces), add_mesh("garment", targets[0], scene["quads"])
    follow(body, bodies)
    follow(garment, targets)
    body.modifiers.new("collision", "COLLISION")
    body.collision.thickness_outer, body.collision.cloth_friction = GAP, 5.0
    garment.vertex_groups.new(name="pins").add(pinned.tolist(), 1.0, "REPLACE")
    apart = np.flatnonzero(~scene["self_collision"])  # these pass through each other
    garment.vertex_groups.new(name="apart").add(apart.tolist(), 1.0, "REPLACE")
    set_up_cloth(garment.modifiers.new("cloth", "CLOTH"), len(apart) < len(targets[0]), len(targets))
    draped, inside, places = [], [], np.empty(targets[0].size)
    for frame, skin in enumerate(bodies):
        bpy.context.scene.frame_set(frame + 1)
        garment.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices.foreach_get("co", places)
        if frame >= scene["first"]:
            clean, share = lifted(places.reshape(-1, 3), skin, faces, pinned, GAP)
            draped.append(clean)
            inside.append(share)
    print(f"cloth more than 5 mm inside the body before it was lifted out: {100 * np.mean(inside):.3f} %")
    for thing in (body, garment):
        bpy.data.objects.remove(thing)
    return np.stack(draped).astype("f4")


def follow(thing: Any, places: np.ndarray) -> None:
    """Move the vertices of an object to these places (T,V,3), frame 1 on."""
    file = WORK / f"{thing.name}.pc2"
    header = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, places.shape[1], 0.0, 1.0, len(places))
    file.write_bytes(header + places.astype("<f4").tobytes())
    cache = thing.modifiers.new("cache", "MESH_CACHE")
    cache.cache_format, cache.filepath, cache.frame_start = "PC2", str(file), 1


def set_up_cloth(cloth: Any, self_collision: bool, frames: int) -> None:
    """Give the cloth its fabric and tell it what it touches."""
    fabric, touch = cloth.settings, cloth.collision_settings
    fabric.quality, fabric.mass, fabric.air_damping, fabric.vertex_group_mass = 24, 0.17, 1.0, "pins"
    fabric.tension_stiffness = fabric.compression_stiffness = 40.0
    fabric.shear_stiffness, fabric.bending_stiffness = 20.0, 0.3
    touch.collision_quality, touch.distance_min, touch.friction = 8, 0.004, 3.3
    touch.use_self_collision, touch.self_distance_min = self_collision, 0.003
    touch.vertex_group_self_collisions = "apart"
    bpy.context.scene.frame_start = cloth.point_cache.frame_start = 1
    bpy.context.scene.frame_end = cloth.point_cache.frame_end = frames


def lifted(
    cloth: np.ndarray, body: np.ndarray, faces: np.ndarray, pinned: np.ndarray, gap: float
) -> tuple[np.ndarray, float]:
    """Return the cloth (C,3) moved out of the body, except where it is pinned, and the share that was 5 mm inside."""
    tree = BVHTree.FromPolygons(body.tolist(), faces.tolist(), all_triangles=True)
    result, deep = cloth.copy(), 0
    for i in np.setdiff1d(np.arange(len(cloth)), pinned):
        place, normal, _, distance = tree.find_nearest(Vector(cloth[i]), 0.04)
        if place is not None:
            inside = (Vector(cloth[i]) - place).dot(normal) < 0
            deep += inside and distance > 0.005
            if inside or distance < gap:
                result[i] = place + gap * normal
    return result, deep / len(cloth)


# --- the room ---------------------------------------------------------------------------------------------------------


class Look(NamedTuple):
    """Colours (3), or one (N,3) for each corner of the faces, with spots of others, so many a metre."""

    colour: Any
    spots: Any
    scale: float


def mottled(colour: Any, darker: float, scale: float) -> Look:
    """Return the look of a colour with spots that are darker by a share."""
    return Look(colour, np.multiply(colour, 1 - darker), scale)


def paint(thing: Any, look: Look, boards: bool = False) -> None:
    """Give a mesh this look, matt and glowing a little; laid as boards: beside others of one colour, with gaps."""
    for name, colours in (("colour", look.colour), ("spots", look.spots)):
        rgba = np.ones((len(thing.data.loops), 4), "f4")
        rgba[:, :3] = colours
        thing.data.attributes.new(name, "FLOAT_COLOR", "CORNER").data.foreach_set("color", rgba.ravel())
    made = bpy.data.materials.new(thing.name)
    made.use_nodes, made.cycles.sample_as_light = True, False
    tree = made.node_tree
    place = node(tree, "TexCoord", {}).outputs["Object"]
    noise = node(tree, "TexNoise", {"Vector": place, "Scale": look.scale}).outputs["Fac"]
    share = node(tree, "MapRange", {"Value": noise, "From Min": 0.35, "From Max": 0.65}).outputs["Result"]
    own, other = node(tree, "Attribute", {}), node(tree, "Attribute", {})
    own.attribute_name, other.attribute_name = "colour", "spots"
    colour = node(tree, "MixRGB", {"Fac": share, "Color1": own.outputs["Color"], "Color2": other.outputs["Color"]})
    if boards:
        size = {"Scale": 1.0, "Brick Width": 0.9, "Row Height": 0.14, "Mortar Size": 0.004}
        dark = {"Color2": (0.42, 0.35, 0.27, 1), "Mortar": (0.10, 0.08, 0.06, 1)}
        colour = node(tree, "TexBrick", {"Vector": place, "Color1": colour.outputs["Color"], **dark, **size})
    surface = node(tree, "BsdfDiffuse", {"Color": colour.outputs["Color"]})
    glow = node(tree, "Emission", {"Color": colour.outputs["Color"], "Strength": AMBIENT})
    both = node(tree, "AddShader", {0: surface.outputs[0], 1: glow.outputs[0]})
    tree.links.new(both.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    thing.data.materials.append(made)


def node(tree: Any, kind: str, inputs: dict[Any, Any]) -> Any:
    """Add a node to a material, whose inputs are values or what other nodes put out, and return it."""
    added = tree.nodes.new("ShaderNode" + kind)
    for name, given in inputs.items():
        if isinstance(given, bpy.types.NodeSocket):
            tree.links.new(given, added.inputs[name])
        else:
            added.inputs[name].default_value = given
    return added


def add_box(low: Colour, high: Colour, look: Look, boards: bool = False) -> None:
    """Add a box between two corners."""
    corners = np.array([[(low, high)[(k >> a) & 1][a] for a in range(3)] for k in range(8)])
    faces = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    thing = add_mesh("box", corners, faces)
    thing.data.polygons.foreach_set("use_smooth", np.zeros(6, bool))
    paint(thing, look, boards)


def along_wall(
    axis: int, sign: int, thick: tuple[float, float], span: tuple[float, float], z: tuple[float, float], look: Look
) -> None:
    """Add a box at a wall, of this thickness inwards from and to, along the wall from and to, and in height."""
    low, high = [span[0], span[0], z[0]], [span[1], span[1], z[1]]
    low[axis], high[axis] = sorted(sign * (HALF - x) for x in thick)
    add_box(tuple(low), tuple(high), look)


def furnish(room: dict[str, Any]) -> None:
    """Build floor, walls, pictures, boxes, tape on the floor and light, of a `known_takes.Room`."""
    random, wall = np.random.default_rng(room["seed"]), mottled(room["wall"], 0.06, 0.7)
    base, tape = mottled((0.07, 0.05, 0.04), 0.1, 5.0), mottled((0.62, 0.58, 0.16), 0.1, 5.0)
    add_box((-HALF, -HALF, -0.1), (HALF, HALF, 0.0), mottled(room["floor"], 0.15, 6.0), room["boards"])
    add_box((-0.9, -0.35, 0.0), (0.9, -0.31, 0.002), tape)
    add_box((0.25, -1.2, 0.0), (0.29, 1.0, 0.0021), tape)
    for axis, sign in ((0, -1), (0, 1), (1, -1), (1, 1)):
        along_wall(axis, sign, (-0.1, 0.0), (-HALF, HALF), (0, 3.4), wall)
        along_wall(axis, sign, (-0.1, 0.02), (-HALF, HALF), (0, 0.13), base)
        for place in (-2.6, -1.0, 1.5, 3.2):
            bottom, width, top = random.uniform(0.7, 1.2), random.uniform(0.5, 0.9), random.uniform(1.8, 2.5)
            colour, scale, spots = random.uniform(0.02, 0.4, 3), random.uniform(3, 8), random.uniform(0.02, 0.4, 3)
            look = Look(colour, spots, scale)
            along_wall(axis, sign, (0.0, 0.03), (place, place + width), (bottom, top), look)
        place, width, top = random.uniform(-3, 2), random.uniform(0.3, 0.7), random.uniform(0.5, 1.1)
        look = mottled(random.uniform(0.05, 0.45, 3), 0.4, 5.0)
        along_wall(axis, sign, (0.5, 0.9), (place, place + width), (0, top), look)
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "AREA"))
    lamp.data.energy, lamp.data.size, lamp.location = 215, 1.0, room["lamp"]
    lamp.rotation_euler = (Vector((0, 0, 0.6)) - Vector(room["lamp"])).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(lamp)
    bpy.context.scene.world = world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.9, 0.95, 1.0, 1)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.22


# --- pictures ---------------------------------------------------------------------------------------------------------


def set_up_cycles(width: int, height: int) -> None:
    """Choose a few samples and one bounce, on one core, and the size of the pictures."""
    render, cycles = bpy.context.scene.render, bpy.context.scene.cycles
    render.engine, cycles.device, bpy.context.scene.view_settings.view_transform = "CYCLES", "CPU", "Standard"
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = SAMPLES, False, False
    cycles.max_bounces = cycles.diffuse_bounces = 1
    render.use_persistent_data, render.threads_mode, render.threads = True, "FIXED", 1
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100


def add_camera(name: str, given: dict[str, Any]) -> Any:
    """Add a camera; OpenCV's looks along +z with y down, Blender's along -z with y up."""
    camera, turn, placed = bpy.data.objects.new(name, bpy.data.cameras.new(name)), np.array(given["turn"]), np.eye(4)
    camera.data.sensor_fit, camera.data.sensor_width = "HORIZONTAL", 36.0
    camera.data.lens = given["matrix"][0][0] * 36.0 / given["size"][0]
    placed[:3, :3], placed[:3, 3] = turn.T @ np.diag([1, -1, -1]), -turn.T @ given["translation"]
    camera.matrix_world = Matrix(placed)
    bpy.context.scene.collection.objects.link(camera)
    return camera


def surroundings(points: np.ndarray, light: Colour, camera: dict[str, Any], pad: int) -> Box:
    """Return the box of the picture around points (N,3) and their shadow on the floor, and so many pixels more."""
    away = points - np.array(light)
    shadow = np.array(light) - away * (light[2] / away[:, 2:])
    seen = np.vstack([points, shadow]) @ np.transpose(camera["turn"]) + camera["translation"]
    pixels = ((seen / seen[:, 2:]) @ np.array(camera["matrix"]).T)[:, :2]
    low, high = (np.clip(x, 0, camera["size"]).astype(int) for x in (pixels.min(0) - pad, pixels.max(0) + pad))
    return (*low.tolist(), *(high - low).tolist())


def draw(camera: Any, file: Path, seed: int, box: Box | None = None) -> None:
    """Render one picture, or a box of it."""
    scene, render = bpy.context.scene, bpy.context.scene.render
    scene.camera, scene.cycles.seed, render.filepath = camera, seed, str(file)
    render.use_border = render.use_crop_to_border = box is not None
    if box:
        x, y, w, h = box
        edge, width, height = 1e-4, render.resolution_x, render.resolution_y  # Blender rounds down
        render.border_min_x, render.border_max_x = (x + edge) / width, (x + w + edge) / width
        render.border_min_y, render.border_max_y = (height - y - h + edge) / height, (height - y + edge) / height
    bpy.ops.render.render(write_still=True)


def dress(scene: dict[str, np.ndarray]) -> tuple[Any, Any]:
    """Add the painted body and the garment."""
    body = add_mesh("body", scene["body"][0], scene["faces"])
    worn = add_mesh("worn", scene["garment"][0], scene["quads"])
    paint(body, mottled(scene["paint"][scene["faces"].ravel()], 0.15, 30.0))
    paint(worn, mottled(np.repeat(scene["cloth_paint"], 4, axis=0), 0.12, 30.0))
    return body, worn


def main() -> None:
    """Drape and draw."""
    scene = dict(np.load(WORK / "scene.npz"))
    plates, room, given = int(scene["plates"]), *(json.loads(str(scene[k])) for k in ("room", "cameras"))
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    cloth = drape(scene)
    np.save(WORK / "cloth.npy", cloth)
    furnish(room)
    set_up_cycles(*next(iter(given.values()))["size"])
    cameras = {name: add_camera(name, c) for name, c in given.items()}
    for name, camera in cameras.items():
        for k in range(plates):
            if not (ROOM / f"{name}_{k}.png").exists():
                draw(camera, ROOM / f"{name}_{k}.png", k)
    things, boxes = dress(scene), {name: [] for name in cameras}
    for frame, shapes in enumerate(zip(scene["body"][scene["first"] :], cloth, strict=True)):
        for thing, places in zip(things, shapes, strict=True):
            thing.data.vertices.foreach_set("co", places.ravel())
            thing.data.update()
        for name, camera in cameras.items():
            boxes[name].append(surroundings(np.vstack(shapes)[::5], room["lamp"], given[name], room["pad_px"]))
            draw(camera, WORK / f"{name}_{frame:06}.png", frame % plates, boxes[name][-1])
    (WORK / "boxes.json").write_text(json.dumps(boxes))


main()
