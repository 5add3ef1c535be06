"""Body `scanned`: mesh, skeleton and weights from the recording's `subject/`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from pydantic import model_validator

from mocapflow.assets import Body
from mocapflow.dressing.roles import BodyModel
from mocapflow.errors import RecordingError
from mocapflow.io.subject.meshes import check_winding, outward, read_mesh
from mocapflow.io.subject.skeleton import check_size, need_scan, read_skeleton
from mocapflow.io.subject.weights import read_weights
from mocapflow.records import F64
from mocapflow.settings import Settings
from mocapflow_bodies.assemble import Part, SecondShape, assemble
from mocapflow_bodies.weights import heat_weights


class Morph(Settings):
    """A second shape of the same mesh, blended in as one angle goes through a range (method: local morphing)."""

    mesh: str  # path inside the recording, with the vertices of body.obj in the same order
    angle: str  # e.g. knee_l.flexion
    from_deg: float  # where the shape of body.obj begins to change
    to_deg: float  # where the second shape is complete

    @model_validator(mode="after")
    def _not_empty(self) -> Morph:
        if self.from_deg == self.to_deg:
            raise ValueError("from_deg and to_deg must differ")
        return self


class Scanned(BodyModel):
    """A scan of the person: `subject/body.obj`, `skeleton.json` and, if there, `weights.npz`."""

    name: ClassVar[str] = "scanned"
    part: Part = "full"  # what is used of it; the rest is cut off. legs: up to the waist, see pipelines/legs.yaml
    morph: Morph | None = None  # a second shape, for a knee or elbow that bends far

    def inputs(self, folder: Path) -> Sequence[Path]:
        """Return the files that are read."""
        subject = folder / "subject"
        files = [subject / "body.obj", subject / "skeleton.json"]
        if (subject / "weights.npz").exists():
            files.append(subject / "weights.npz")
        return [*files, folder / self.morph.mesh] if self.morph else files

    def need(self, folder: Path) -> None:
        """Raise if a mesh is missing, or no skeleton can be read."""
        need_scan(folder / "subject" / "body.obj")
        if self.morph and not (folder / self.morph.mesh).is_file():
            read_mesh(folder / self.morph.mesh)  # says so
        read_skeleton(folder / "subject" / "skeleton.json")

    def load(self, folder: Path) -> Body:
        """Return the body at rest.

        Raises:
            RecordingError: a file is missing, malformed, not in metres, inside out in part, or contradicts another.
            PipelineError: the morph names an angle the body lacks.
        """
        subject = folder / "subject"
        need_scan(subject / "body.obj")
        vertices, faces = read_mesh(subject / "body.obj")
        check_winding(faces, str(subject / "body.obj"))
        faces = outward(vertices, faces)
        skeleton = read_skeleton(subject / "skeleton.json")
        check_size(vertices, skeleton, str(subject / "body.obj"))
        if (subject / "weights.npz").exists():
            weights = read_weights(subject / "weights.npz", skeleton, vertices)
        else:
            weights = heat_weights(vertices, faces, skeleton)
        if self.morph is None:
            return assemble(vertices, faces, skeleton, weights, self.part)
        offset = self._second_shape(folder, vertices, self.morph) - vertices
        between = (math.radians(self.morph.from_deg), math.radians(self.morph.to_deg))
        second = SecondShape(offset, self.morph.angle, between)
        return assemble(vertices, faces, skeleton, weights, self.part, second)

    @staticmethod
    def _second_shape(folder: Path, vertices: F64, morph: Morph) -> F64:
        path = folder / morph.mesh
        shape, _ = read_mesh(path)
        if shape.shape != vertices.shape:
            hint = "both shapes must be the same mesh, vertex by vertex"
            raise RecordingError(
                f"the second shape has {len(shape)} vertices, body.obj has {len(vertices)}", where=str(path), hint=hint
            )
        return shape
