"""USD: the skinned body moving in its garment, for film and simulation programs; m, z up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from mocapflow.assets import Body
from mocapflow.records import F64, I32
from mocapflow_export.formats.result import Result, library

PERSON = "/World/Person"
SKIN, CLOTH = (0.78, 0.6, 0.5), (0.2, 0.45, 0.5)  # RGB


def write(result: Result, path: Path) -> None:
    """Write a binary stage: a skeleton with a rotation per joint and frame, its skin, and the garment's points.

    The second shape that a body may have (`morph`) is not written.
    """
    Author(result, path).save()


def joint_paths(body: Body) -> list[str]:
    """Return every joint as USD names it: by its ancestors, `pelvis/hip_l/knee_l`."""
    paths: list[str] = []
    for name, parent in zip(body.joint_names, body.parents, strict=True):
        paths.append(f"{paths[parent]}/{name}" if parent >= 0 else name)
    return paths


class Author:
    """Puts a result together, part by part."""

    def __init__(self, result: Result, path: Path) -> None:
        self._usd, self._geom = library("pxr.Usd", "usd"), library("pxr.UsdGeom", "usd")
        self._skel, self._gf, self._vt = (library(f"pxr.{name}", "usd") for name in ("UsdSkel", "Gf", "Vt"))
        self._result, self._body = result, result.scene.body
        self._frames = [int(frame) for frame in result.track.frame]
        self._stage: Any = self._usd.Stage.CreateNew(str(path))

    def save(self) -> None:
        """Write the file."""
        stage, geom = self._stage, self._geom
        geom.SetStageUpAxis(stage, geom.Tokens.z)
        geom.SetStageMetersPerUnit(stage, 1.0)
        rate = self._result.recording.frame_rate
        stage.SetTimeCodesPerSecond(rate)  # codes are frames of the videos
        stage.SetFramesPerSecond(rate)
        stage.SetStartTimeCode(self._frames[0])
        stage.SetEndTimeCode(self._frames[-1])
        stage.SetDefaultPrim(geom.Xform.Define(stage, "/World").GetPrim())
        self._skel.Root.Define(stage, PERSON)
        self._add_skeleton()
        self._add_body()
        garment, cloth = self._result.scene.garment, self._result.track.cloth
        if garment is not None and cloth.shape[1]:
            points = self._add_mesh("/World/Garment", garment.vertices, garment.faces, CLOTH).GetPointsAttr()
            for frame, vertices in zip(self._frames, cloth, strict=True):
                points.Set(self._vectors(vertices), frame)
        stage.GetRootLayer().Save()

    def _add_skeleton(self) -> None:
        """Add the joints at rest, and a rotation of each and the root's place for every frame."""
        body, joints = self._body, joint_paths(self._body)
        offsets = body.positions - np.where(body.parents[:, None] >= 0, body.positions[body.parents], 0.0)
        skeleton = self._skel.Skeleton.Define(self._stage, f"{PERSON}/Skeleton")
        skeleton.CreateJointsAttr(joints)
        skeleton.CreateBindTransformsAttr(self._shifts(body.positions))
        skeleton.CreateRestTransformsAttr(self._shifts(offsets))
        animation = self._skel.Animation.Define(self._stage, f"{PERSON}/Skeleton/Motion")
        self._skel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
        animation.CreateJointsAttr(joints)
        animation.CreateScalesAttr(self._vt.Vec3hArray(len(joints), self._gf.Vec3h(1)))
        turns, places = animation.CreateRotationsAttr(), animation.CreateTranslationsAttr()
        root = body.parents < 0
        for row, frame in enumerate(self._frames):
            x, y, z, w = Rotation.from_matrix(self._result.turns[row]).as_quat().T.tolist()
            turns.Set(self._vt.QuatfArray([self._gf.Quatf(*q) for q in zip(w, x, y, z, strict=True)]), frame)
            places.Set(self._vectors(np.where(root[:, None], self._result.places[row], offsets)), frame)

    def _add_body(self) -> None:
        body = self._body
        mesh = self._add_mesh(f"{PERSON}/Body", body.vertices, body.faces, SKIN)
        binding = self._skel.BindingAPI.Apply(mesh.GetPrim())
        binding.CreateSkeletonRel().SetTargets([f"{PERSON}/Skeleton"])
        binding.CreateGeomBindTransformAttr(self._gf.Matrix4d(1))
        influences = body.skin_joint.shape[1]
        binding.CreateJointIndicesPrimvar(False, influences).Set(self._vt.IntArray.FromNumpy(body.skin_joint.ravel()))
        weights = body.skin_weight.ravel().astype(np.float32)
        binding.CreateJointWeightsPrimvar(False, influences).Set(self._vt.FloatArray.FromNumpy(weights))

    def _add_mesh(self, path: str, vertices: F64, faces: I32, colour: tuple[float, float, float]) -> Any:
        mesh = self._geom.Mesh.Define(self._stage, path)
        mesh.CreatePointsAttr(self._vectors(vertices))
        mesh.CreateFaceVertexCountsAttr([3] * len(faces))
        mesh.CreateFaceVertexIndicesAttr(self._vt.IntArray.FromNumpy(faces.ravel()))
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.CreateDoubleSidedAttr(True)
        mesh.CreateDisplayColorAttr([self._gf.Vec3f(*colour)])
        return mesh

    def _vectors(self, values: F64) -> Any:
        return self._vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))

    def _shifts(self, offsets: F64) -> list[Any]:
        return [self._gf.Matrix4d(1).SetTranslate(self._gf.Vec3d(*offset)) for offset in offsets.tolist()]
