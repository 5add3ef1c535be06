"""Reading Wavefront OBJ: vertices in file order, polygons as fans of triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.records import F64, I32


def read_mesh(path: Path) -> tuple[F64, I32]:
    """Return vertices (V, 3) and triangles (F, 3) of an OBJ file; the order of the vertices is kept.

    Raises:
        RecordingError: the file is missing, malformed or has no faces.
    """
    if not path.is_file():
        raise RecordingError(
            "there is no body mesh", where=str(path), hint="expected a triangle mesh as OBJ, in metres, z up"
        )
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        kind, *words = line.split() or [""]
        try:
            if kind == "v":
                vertices.append([float(word) for word in words[:3]])
            elif kind == "f":
                corners = [int(word.partition("/")[0]) for word in words]
                corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
                faces += [(corners[0], b, c) for b, c in zip(corners[1:], corners[2:], strict=False)]
        except ValueError as error:
            raise RecordingError(f"not a line of an OBJ file: {error}", where=f"{path}:{number}") from error
    points, triangles = np.array(vertices, np.float64).reshape(-1, 3), np.array(faces, np.int32).reshape(-1, 3)
    sound = len(points) and len(triangles) and np.isfinite(points).all()
    if not sound or triangles.min() < 0 or triangles.max() >= len(points):
        hint = "expected finite vertices and faces that use them"
        raise RecordingError(f"not a mesh: {len(points)} vertices, {len(triangles)} faces", where=str(path), hint=hint)
    return points, triangles
