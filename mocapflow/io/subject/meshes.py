"""Triangle meshes: Wavefront OBJ with the vertices in the order of the file, other formats through Open3D.

Skin weights are stored per vertex of the file, so the order matters; general mesh readers split vertices at the
seams of a texture, drop those that no face uses, or sort them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.geometry.libraries import load_open3d
from mocapflow.records import F64, I32, out_of_range

OPPOSED = 0.01  # of the edges of a mesh, that two triangles go along the same way; a scan has a few
OPEN3D_FORMATS = (".ply", ".stl", ".off", ".gltf", ".glb")


def read_mesh(path: Path) -> tuple[F64, I32]:
    """Read vertices (V, 3) and triangles (F, 3) of a mesh file, by its suffix.

    Raises:
        RecordingError: the file is missing or of a format not known, holds no mesh, a face names a vertex that is not
            there.
        MocapflowError: Open3D is needed and can't be loaded.
    """
    if path.suffix.lower() not in (".obj", *OPEN3D_FORMATS):
        hint = f"meshes are read from .obj, {', '.join(OPEN3D_FORMATS)}; .obj keeps the order of the vertices"
        raise RecordingError(f"a mesh in '{path.suffix}' can't be read", where=str(path), hint=hint)
    if not path.is_file():
        raise RecordingError("no such mesh", where=str(path))
    vertices, triangles = _read_obj(path) if path.suffix.lower() == ".obj" else _read_by_open3d(path)
    return _checked(vertices, triangles, path)


def _read_obj(path: Path) -> tuple[F64, list[tuple[int, int, int]]]:
    """Return vertices and triangles; larger polygons are cut into fans."""
    points: list[tuple[float, ...]] = []
    triangles: list[tuple[int, int, int]] = []
    with path.open(encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(lines, 1):
            kind, *fields = line.split() or [""]
            if kind == "v":
                points.append(_point(fields, f"{path}:{number}"))
            elif kind == "f":
                triangles += _fan(fields, len(points), f"{path}:{number}")
    return np.array(points, np.float64).reshape(-1, 3), triangles


def _point(fields: Sequence[str], where: str) -> tuple[float, ...]:
    """Return a vertex; colours may follow its three numbers."""
    try:
        x, y, z = map(float, fields[:3])
    except ValueError:
        hint = "was the file cut off? copy it again"
        raise RecordingError(f"a vertex with '{' '.join(fields)}', not three numbers", where=where, hint=hint) from None
    return x, y, z


def _read_by_open3d(path: Path) -> tuple[F64, I32]:
    mesh = load_open3d(str(path)).io.read_triangle_mesh(path)
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.triangles, np.int32)


def _fan(fields: Sequence[str], known: int, where: str) -> list[tuple[int, int, int]]:
    """Return the triangles of one face; each field is vertex, vertex/texture or vertex/texture/normal."""
    try:
        named = [int(field.split("/")[0]) for field in fields]
    except ValueError:
        raise RecordingError(f"a face with '{' '.join(fields)}', not vertex numbers", where=where) from None
    corners = [n - 1 if n > 0 else known + n for n in named]  # negative: counted back from the last vertex
    return [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]


def _checked(vertices: F64, triangles: Sequence[tuple[int, int, int]] | I32, path: Path) -> tuple[F64, I32]:
    faces = np.array(triangles, np.int64).reshape(-1, 3)
    if not len(vertices) or not len(faces):
        raise RecordingError(f"{len(vertices)} vertices and {len(faces)} faces: no mesh", where=str(path))
    if not np.isfinite(vertices).all():
        raise RecordingError("a vertex is not a number", where=str(path))
    if out_of_range(faces, len(vertices)) is not None:
        raise RecordingError(f"a face names a vertex that is not there; the file has {len(vertices)}", where=str(path))
    return vertices, faces.astype(np.int32)


def check_winding(faces: I32, where: str) -> None:
    """Check that the triangles (F, 3) of a mesh agree on which side is outside.

    Raises:
        RecordingError: many edges have two triangles that go along them in the same direction: one is inside out.
    """
    _, count = np.unique(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=0, return_counts=True)
    if (share := float(np.mean(count > 1))) > OPPOSED:
        hint = "let a mesh program turn them all outward, e.g. Blender: Mesh > Normals > Recalculate Outside"
        message = f"its faces look both inward and outward: at {100 * share:.0f} % of the edges two disagree"
        raise RecordingError(message, where=where, hint=hint)


def outward(vertices: F64, faces: I32) -> I32:
    """Return the triangles (F, 3) of a mesh so that they look outward, if they agree on a side.

    They all look inward, and the volume is negative, where a mesh was mirrored, or its program counts clockwise.
    """
    a, b, c = np.moveaxis((vertices - vertices.mean(axis=0))[faces], 1, 0)
    volume = float(np.einsum("fi,fi->", a, np.cross(b, c)))
    return faces if volume >= 0 else np.ascontiguousarray(faces[:, ::-1])
