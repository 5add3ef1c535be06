"""OBJ files: the order of the vertices is kept, whatever else the file holds. Other formats: Open3D's."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mocapflow.errors import MocapflowError, RecordingError
from mocapflow.io.subject.meshes import read_mesh

DEMO = Path(__file__).parents[3] / "examples" / "data"


@pytest.mark.parametrize("clip", ["skirt_steps", "shorts_steps"])
def test_demo_bodies_keep_their_order(clip):
    path = DEMO / clip / "subject" / "body.obj"
    vertices, faces = read_mesh(path)
    lines = [line.split() for line in path.read_text().splitlines()]
    np.testing.assert_array_equal(vertices, np.array([line[1:] for line in lines if line[0] == "v"], float))
    np.testing.assert_array_equal(faces, np.array([line[1:] for line in lines if line[0] == "f"], int) - 1)
    with np.load(path.parent / "weights.npz") as content:
        assert len(content["weights"]) == len(vertices)


def test_seams_groups_polygons_and_unused_vertices(tmp_path):
    (tmp_path / "a.obj").write_text(
        "# scan\nmtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0 0.5 0.5 0.5\nv 5 5 5\nvt 0 0\nvt 1 1\nvn 0 0 1\n"
        "g front\nusemtl skin\nf 1/1/1 2/2/1 3/1/1\ng back\nf 1/2/1 3/1/1 4/2/1\nf 1//1 2//1 3//1 4//1\nf -5 -4 -3\n"
    )
    vertices, faces = read_mesh(tmp_path / "a.obj")
    np.testing.assert_array_equal(vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]])
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 1, 2]]
    assert faces.dtype == np.int32


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0 0\n", r"a\.obj  1 vertices and 0 faces: no mesh"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", r"a\.obj  a face names a vertex that is not there; the file has 3"),
        ("v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", r"a\.obj:1  a vertex with '0 0', not three numbers\n"),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 -",
            r"a\.obj:4  a vertex with '1 -', not three numbers\n       was the file cut",
        ),
        ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", r"a\.obj  a vertex is not a number"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 x\n", r"a\.obj:4  a face with '1 2 x', not vertex numbers"),
    ],
)
def test_bad_meshes(tmp_path, text, message):
    (tmp_path / "a.obj").write_text(text)
    with pytest.raises(RecordingError, match=message):
        read_mesh(tmp_path / "a.obj")


def test_unknown_formats_and_missing_files(tmp_path):
    with pytest.raises(
        RecordingError, match=r"a mesh in '\.fbx' can't be read\n       meshes are read from \.obj, \.ply"
    ):
        read_mesh(tmp_path / "a.fbx")
    for name in ("a.obj", "a.ply"):
        with pytest.raises(RecordingError, match="no such mesh"):
            read_mesh(tmp_path / name)


def open3d_with(vertices, triangles):
    """A stand-in for the module: its reader gives this mesh."""
    mesh = SimpleNamespace(vertices=vertices, triangles=triangles)
    return SimpleNamespace(io=SimpleNamespace(read_triangle_mesh=lambda path: mesh))


@pytest.mark.parametrize("suffix", [".ply", ".STL", ".off", ".gltf", ".glb"])
def test_other_formats_go_through_open3d(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"a{suffix}"
    path.touch()
    monkeypatch.setitem(sys.modules, "open3d", open3d_with([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    vertices, faces = read_mesh(path)
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int32)
    assert faces.tolist() == [[0, 1, 2]]
    monkeypatch.setitem(sys.modules, "open3d", open3d_with([], []))  # what Open3D says of a file it can't read
    with pytest.raises(RecordingError, match="0 vertices and 0 faces: no mesh"):
        read_mesh(path)


def test_without_open3d_the_error_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "a.ply").touch()
    monkeypatch.setitem(sys.modules, "open3d", None)  # makes its import fail
    with pytest.raises(MocapflowError, match=r"a\.ply  Open3D can't be loaded: .*open3d.*\n.*install libusb-1.0-0"):
        read_mesh(tmp_path / "a.ply")
