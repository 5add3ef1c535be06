"""Exported files read back by libraries that did not write them: joint names, and centres (T, J, 3) in m, z up.

Where there is only one library, glTF is read by its specification; Rerun's own reader has to do for `.rrd`.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

Joints = tuple[list[str], np.ndarray]


def bvh(path: Path) -> Joints:
    import bvhio

    root = bvhio.readAsHierarchy(str(path))
    names, rows = [joint.Name for joint, _, _ in root.layout()], []
    for row in range(len(root.Keyframes)):
        root.loadPose(row)
        rows.append([list(joint.PositionWorld) for joint, _, _ in root.layout()])
    return names, z_up(np.array(rows) / 100)


def c3d(path: Path) -> Joints:
    import c3d as library

    with path.open("rb") as file:
        reader = library.Reader(file)
        rows = [points[:, :3] for _, points, _ in reader.read_frames()]
    return [label.strip() for label in reader.point_labels], np.array(rows) / 1000


def gltf(path: Path) -> Joints:
    scene = Gltf(path)
    names = [scene.file.nodes[joint].name for joint in scene.file.skins[0].joints]
    return names, z_up(np.stack([scene.joints(row)[:, :3, 3] for row in range(scene.frames)]))


def movement(path: Path) -> Joints:
    import netCDF4

    with netCDF4.Dataset(path) as dataset:
        names, position = dataset["keypoints"][:], dataset["position"]
        assert position.dimensions == ("time", "space", "keypoints", "individuals")
        return [str(name) for name in names], np.asarray(position[:, :, :, 0]).swapaxes(1, 2)


def trc(path: Path) -> Joints:
    data = pytest.importorskip("trc").TRCData()
    data.load(str(path))
    y_up = np.moveaxis(np.array([data[name] for name in data["Markers"]]), 0, 1)
    return list(data["Markers"]), y_up[..., [2, 0, 1]]  # OpenSim's x, y, z are the world's y, z, x


def usd(path: Path) -> Joints:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdSkel

    stage = Usd.Stage.Open(str(path))
    query = UsdSkel.Cache().GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/World/Person/Skeleton")))
    times = np.arange(stage.GetStartTimeCode(), stage.GetEndTimeCode() + 1)
    rows = [np.array(query.ComputeJointSkelTransforms(Usd.TimeCode(time)))[:, 3, :3] for time in times]
    return [joint.rpartition("/")[2] for joint in query.GetJointOrder()], np.array(rows)


def rrd(path: Path) -> Joints:
    logged = rerun_entities(path)
    names = logged["/world/joints"]["Points3D:labels"][0]
    return list(names), np.array(logged["/world/joints"]["Points3D:positions"])


JOINTS = {"bvh": bvh, "c3d": c3d, "gltf": gltf, "movement": movement, "rrd": rrd, "trc": trc, "usd": usd}


def parquet(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a table."""
    import duckdb

    columns: dict[str, np.ndarray] = duckdb.read_parquet(str(path)).fetchnumpy()
    return columns


def rerun_entities(path: Path) -> dict[str, dict[str, list[Any]]]:
    """Return what a Rerun recording holds: per entity and component its values in the order of the timeline `frame`."""
    reader = pytest.importorskip("rerun.chunk").RrdReader(path)
    found: dict[str, dict[str, list[Any]]] = {}
    for chunk in reader.stream().collect().stream():
        batch = chunk.to_record_batch()
        entity = found.setdefault(chunk.entity_path, {})
        for name in batch.schema.names:
            entity.setdefault(name, []).extend(batch[name].to_pylist())
    for entity in found.values():
        order = np.argsort(entity.get("frame", [0]), kind="stable")
        for name, values in entity.items():
            entity[name] = [values[k] for k in order] if len(values) == len(order) else values
    return found


def z_up(places: np.ndarray) -> np.ndarray:
    """Return places (..., 3) of a y-up file in the z-up world."""
    return np.stack([places[..., 0], -places[..., 2], places[..., 1]], axis=-1)


class Gltf:
    """A glTF file played by the rules of the format; frames are those of the first animation."""

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        magic, version, length, count, kind = struct.unpack("<4sIII4s", content[:20])
        assert (magic, version, length, kind) == (b"glTF", 2, len(content), b"JSON")
        self.file = json.loads(content[20 : 20 + count], object_hook=lambda found: SimpleNamespace(**found))
        self._blob = content[20 + count + 8 :]
        self.frames = len(self._values(self.file.animations[0].samplers[0].input))

    def joints(self, row: int) -> np.ndarray:
        """Return the world transforms of the joints of the skin in a frame: (J, 4, 4), y up."""
        return self._world(row)[self.file.skins[0].joints]

    def skinned(self, row: int) -> np.ndarray:
        """Return the vertices of the body in a frame: (V, 3) m, z up."""
        (primitive,) = self._mesh("body").primitives
        rest = self._values(primitive.attributes.POSITION)
        inverse = self._values(self.file.skins[0].inverseBindMatrices).reshape(-1, 4, 4).swapaxes(1, 2)
        moves = self.joints(row) @ inverse
        joints, weights = (self._values(getattr(primitive.attributes, name)) for name in ("JOINTS_0", "WEIGHTS_0"))
        blended = np.einsum("vk,vkab->vab", weights, moves[joints])
        return z_up(np.einsum("vab,vb->va", blended[:, :3, :3], rest) + blended[:, :3, 3])

    def garment(self, row: int) -> np.ndarray:
        """Return the vertices of the garment in a frame: (W, 3) m, z up; the node above turns them y up."""
        (primitive,) = self._mesh("garment").primitives
        shapes = np.stack([self._values(target.POSITION) for target in primitive.targets])
        weights = self._played("weights")[1].reshape(self.frames, -1)[row]
        local = self._values(primitive.attributes.POSITION) + np.einsum("k,kva->va", weights, shapes)
        node = next(k for k, each in enumerate(self.file.nodes) if each.name == "garment")
        world = self._world(row)[node]
        return z_up(local @ world[:3, :3].T + world[:3, 3])

    def attribute(self, name: str, what: str) -> np.ndarray:
        """Return what the vertices of a mesh have, in its own axes."""
        return self._values(getattr(self._mesh(name).primitives[0].attributes, what))

    def shapes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return when each shape of the garment is the one that is on (s), and its displacements (S, W, 3) m."""
        channel = next(c for c in self.file.animations[0].channels if c.target.path == "weights")
        sampler = self.file.animations[0].samplers[channel.sampler]
        targets = self._mesh("garment").primitives[0].targets
        on = self._values(sampler.output).reshape(-1, len(targets))
        assert (np.argmax(on, axis=1) == np.arange(len(on))).all() and (on.sum(axis=1) == 1).all()
        return self._values(sampler.input), np.stack([self._values(target.POSITION) for target in targets])

    def _mesh(self, name: str) -> Any:
        return next(mesh for mesh in self.file.meshes if mesh.name == name)

    def _world(self, row: int) -> np.ndarray:
        moving = {(c.target.node, c.target.path): c.sampler for c in self.file.animations[0].channels}
        world = np.tile(np.eye(4), (len(self.file.nodes), 1, 1))

        def visit(index: int, parent: np.ndarray) -> None:
            node = self.file.nodes[index]
            local = np.eye(4)
            turn = self._sampled(moving.get((index, "rotation")), row, getattr(node, "rotation", [0, 0, 0, 1]))
            local[:3, :3] = Rotation.from_quat(turn).as_matrix()
            local[:3, 3] = self._sampled(
                moving.get((index, "translation")), row, getattr(node, "translation", [0, 0, 0])
            )
            world[index] = parent @ local
            for child in getattr(node, "children", []):
                visit(child, world[index])

        visit(0, np.eye(4))
        return world

    def _sampled(self, sampler: int | None, row: int, still: Any) -> Any:
        return still if sampler is None else self._values(self.file.animations[0].samplers[sampler].output)[row]

    def _played(self, what: str) -> tuple[int, np.ndarray]:
        channel = next(c for c in self.file.animations[0].channels if c.target.path == what)
        return channel.target.node, self._values(self.file.animations[0].samplers[channel.sampler].output)

    def _values(self, index: int) -> np.ndarray:
        accessor = self.file.accessors[index]
        view = self.file.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor.type]
        kind = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}[accessor.componentType]
        values = np.frombuffer(self._blob, kind, accessor.count * width, view.byteOffset)
        return values.reshape(-1, width) if width > 1 else values
