"""glTF: the skinned body moving in its garment, for viewers and animation programs; m, y up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from mocapflow.geometry import meshes
from mocapflow.records import F64, I32
from mocapflow.series import Wide
from mocapflow_export.formats.result import Result, library

Z_UP = [-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]  # quaternion x y z w, to glTF's y up
SHAPES = 240  # shapes of the garment at most: each is stored whole, viewers blend between two
COLOURS = {"body": [0.78, 0.6, 0.5, 1.0], "garment": [0.2, 0.45, 0.5, 1.0]}


def write(result: Result, path: Path) -> None:
    """Write a binary glTF file with one animation: a rotation per joint, and the garment as a series of shapes.

    The second shape that a body may have (`morph`) is not written.
    """
    Author(result).scene().save_binary(str(path))


class Author:
    """Puts a result together, part by part."""

    def __init__(self, result: Result) -> None:
        self._lib: Any = library("pygltflib", "gltf")
        self._result, self._body = result, result.scene.body
        self._gltf, self._data = self._lib.GLTF2(), bytearray()
        self._animation = self._lib.Animation(name="motion")
        self._times = self._add((result.track.time - result.track.time[0]).astype(np.float32))

    def scene(self) -> Any:
        """Return the whole file."""
        gltf, lib = self._gltf, self._lib
        gltf.nodes = [lib.Node(name="world", rotation=Z_UP, children=[])]
        self._add_skeleton()
        self._add_body()
        if self._result.scene.garment is not None and self._result.track.cloth.shape[1]:
            self._add_garment(self._result.scene.garment.faces, self._result.track.cloth)
        gltf.materials = [
            lib.Material(name=n, doubleSided=True, pbrMetallicRoughness=lib.PbrMetallicRoughness(
                baseColorFactor=colour, metallicFactor=0.0, roughnessFactor=0.9)) for n, colour in COLOURS.items()
        ]  # fmt: skip
        gltf.animations = [self._animation]
        gltf.scenes, gltf.scene = [lib.Scene(nodes=[0])], 0
        gltf.buffers = [lib.Buffer(byteLength=len(self._data))]
        gltf.set_binary_blob(bytes(self._data))
        return gltf

    def _add_skeleton(self) -> None:
        """Add a node for each joint, from node 1 on, and its motion."""
        body, turns = self._body, self._result.turns
        for joint, name in enumerate(body.joint_names):
            parent = int(body.parents[joint])
            offset = body.positions[joint] - (body.positions[parent] if parent >= 0 else 0)
            self._gltf.nodes.append(self._lib.Node(name=name, translation=offset.tolist(), children=[]))
            self._gltf.nodes[parent + 1].children.append(joint + 1)
            quaternion = Rotation.from_matrix(turns[:, joint]).as_quat()
            self._animate(joint + 1, "rotation", the_shorter_way(quaternion))
            if parent < 0:
                self._animate(joint + 1, "translation", self._result.places[:, joint])

    def _add_body(self) -> None:
        body, lib = self._body, self._lib
        inverse = np.tile(np.eye(4), (len(body.parents), 1, 1))
        inverse[:, :3, 3] = -body.positions
        columns = np.swapaxes(inverse, 1, 2).reshape(-1, 16).astype(np.float32)
        joints = list(range(1, len(body.parents) + 1))
        self._gltf.skins = [lib.Skin(joints=joints, inverseBindMatrices=self._add(columns))]
        strongest = np.argsort(-body.skin_weight, axis=1, kind="stable")[:, :4]  # viewers read four
        weight, carrier = (np.take_along_axis(of, strongest, 1) for of in (body.skin_weight, body.skin_joint))
        weight = weight / weight.sum(axis=1, keepdims=True)
        attributes = lib.Attributes(
            POSITION=self._add(body.vertices.astype(np.float32), vertices=True),
            NORMAL=self._add(meshes.vertex_normals(body.vertices, body.faces).astype(np.float32)),
            JOINTS_0=self._add(np.where(weight > 0, carrier, 0).astype(np.uint16)),
            WEIGHTS_0=self._add(weight.astype(np.float32)),
        )
        primitive = lib.Primitive(attributes=attributes, indices=self._indices(body.faces), material=0)
        self._add_mesh("body", lib.Mesh(primitives=[primitive]), skin=0)

    def _add_garment(self, faces: I32, cloth: Wide) -> None:
        """Add the garment as its first shape and displacements from it, one switched on after the other."""
        lib = self._lib
        rows = np.unique(np.linspace(0, len(cloth) - 1, min(SHAPES, len(cloth))).round().astype(int))
        targets = [
            lib.Attributes(POSITION=self._add((cloth[row] - cloth[0]).astype(np.float32), vertices=True))
            for row in rows
        ]
        attributes = lib.Attributes(
            POSITION=self._add(cloth[0].astype(np.float32), vertices=True),
            NORMAL=self._add(meshes.vertex_normals(cloth[0], faces).astype(np.float32)),
        )
        primitive = lib.Primitive(attributes=attributes, indices=self._indices(faces), material=1, targets=targets)
        node = self._add_mesh("garment", lib.Mesh(primitives=[primitive], weights=[0.0] * len(rows)))
        time = self._result.track.time
        self._animate(node, "weights", np.eye(len(rows)).ravel(), (time[rows] - time[0]).astype(np.float32))

    def _add_mesh(self, name: str, mesh: Any, skin: int | None = None) -> int:
        mesh.name = name
        self._gltf.meshes.append(mesh)
        self._gltf.nodes.append(self._lib.Node(name=name, mesh=len(self._gltf.meshes) - 1, skin=skin))
        self._gltf.nodes[0].children.append(len(self._gltf.nodes) - 1)
        return len(self._gltf.nodes) - 1

    def _animate(self, node: int, what: str, values: F64, times: npt.NDArray[np.float32] | None = None) -> None:
        given = self._times if times is None else self._add(times)
        sampler = self._lib.AnimationSampler(input=given, output=self._add(values.astype(np.float32)))
        target = self._lib.AnimationChannelTarget(node=node, path=what)
        self._animation.channels.append(
            self._lib.AnimationChannel(sampler=len(self._animation.samplers), target=target)
        )
        self._animation.samplers.append(sampler)

    def _indices(self, faces: I32) -> int:
        return self._add(faces.ravel().astype(np.uint32), self._lib.ELEMENT_ARRAY_BUFFER)

    def _add(self, array: npt.NDArray[Any], target: int | None = None, vertices: bool = False) -> int:
        """Append an array to the buffer and return its accessor."""
        lib, rows = self._lib, array.reshape(len(array), -1)
        kind = {1: lib.SCALAR, 3: lib.VEC3, 4: lib.VEC4, 16: lib.MAT4}[rows.shape[1]]
        component = {"float32": lib.FLOAT, "uint16": lib.UNSIGNED_SHORT, "uint32": lib.UNSIGNED_INT}[array.dtype.name]
        bounded = vertices or kind == lib.SCALAR  # viewers ask for the bounds of places and times
        self._gltf.bufferViews.append(
            lib.BufferView(buffer=0, byteOffset=len(self._data), byteLength=array.nbytes, target=target)
        )
        self._gltf.accessors.append(
            lib.Accessor(
                bufferView=len(self._gltf.bufferViews) - 1, componentType=component, count=len(array), type=kind,
                min=rows.min(axis=0).tolist() if bounded else None, max=rows.max(axis=0).tolist() if bounded else None,
            )
        )  # fmt: skip
        self._data += array.tobytes()  # every kind here is a multiple of four bytes long
        return len(self._gltf.accessors) - 1


def the_shorter_way(quaternions: F64) -> F64:
    """Return the same turns by quaternions (T, 4) of the sign that leads the shorter way from each to the next."""
    back = np.einsum("ta,ta->t", quaternions[1:], quaternions[:-1]) < 0
    signs = np.concatenate([[1.0], np.cumprod(np.where(back, -1.0, 1.0))])
    way: F64 = quaternions * signs[:, None]
    return way
