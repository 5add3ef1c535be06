"""Files for other programs, each read back by an independent library: joint centres to a tenth of a millimetre."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mocapflow_formats import Result, write
from results_scene import DEMO, demo_scene, stepping
from scipy.spatial.transform import Rotation

from mocapflow.errors import PipelineError
from mocapflow.recording import open_recording

NEAR = 1e-4  # m


@pytest.fixture(scope="module")
def result() -> Result:
    """A few frames of the demo person stepping, turned about."""
    scene = demo_scene(clothed=True)
    track = stepping(scene.body, 5)
    assert scene.garment is not None
    cloth = np.stack([scene.garment.vertices + [0, 0, 0.01 * row] for row in range(5)])
    track = replace(track, cloth=cloth, cloth_parameters=np.zeros((5, 0)))
    return Result(track=track, scene=scene, recording=open_recording(DEMO))


@pytest.mark.parametrize(
    ("name", "needed"),
    [
        ("c3d", "ezc3d"),
        ("gltf", "pygltflib"),
        ("movement", "h5netcdf"),
        ("parquet", "pyarrow.parquet"),
        ("rrd", "rerun"),
    ],
)
def test_a_missing_library_is_named(
    name: str, needed: str, result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, needed, None)
    with pytest.raises(PipelineError, match=r"this format needs .*\n.*pip install 'mocapflow\["):
        write(name, result, tmp_path)


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of the reader
def test_bvh(result: Result, tmp_path: Path) -> None:
    import bvhio

    root = bvhio.readAsHierarchy(str(write("bvh", result, tmp_path)))
    for row in range(len(result.track.frame)):
        root.loadPose(row)
        for joint, _, _ in root.layout():
            x, y, z = joint.PositionWorld
            expected = result.places[row, result.scene.body.joint(joint.Name)]
            np.testing.assert_allclose([x / 100, -z / 100, y / 100], expected, atol=NEAR)


def test_bvh_by_another_reader(result: Result, tmp_path: Path) -> None:
    from bvh import Bvh

    text = Bvh(write("bvh", result, tmp_path).read_text())
    assert text.nframes == 5
    assert text.frame_time == pytest.approx(1 / result.track.frame_rate, abs=1e-6)
    assert set(text.get_joints_names()) == set(result.scene.body.joint_names)


@pytest.mark.filterwarnings("ignore:No analog data")
def test_c3d(result: Result, tmp_path: Path) -> None:
    import c3d

    with write("c3d", result, tmp_path).open("rb") as file:
        reader = c3d.Reader(file)
        frames = [points[:, :3] for _, points, _ in reader.read_frames()]
    assert [label.strip() for label in reader.point_labels] == list(result.scene.body.joint_names)
    assert reader.point_rate == pytest.approx(result.track.frame_rate)
    np.testing.assert_allclose(np.array(frames) / 1000, result.places, atol=NEAR)


def test_parquet(result: Result, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    table = pq.read_table(write("parquet", result, tmp_path))
    assert table.column_names[:4] == ["frame", "time", "knee_flexion_l", "knee_flexion_l_sd"]
    np.testing.assert_array_equal(table["frame"].to_numpy(), result.track.frame)


def test_movement(result: Result, tmp_path: Path) -> None:
    import xarray

    with xarray.open_dataset(write("movement", result, tmp_path), engine="h5netcdf") as dataset:
        assert dataset.position.dims == ("time", "space", "keypoints", "individuals")
        assert (dataset.attrs["ds_type"], dataset.attrs["time_unit"]) == ("poses", "seconds")
        knee = dataset.position.sel(keypoints="knee_l", individuals="person")
        np.testing.assert_allclose(knee, result.places[:, result.scene.body.joint("knee_l")])


def test_gltf(result: Result, tmp_path: Path) -> None:
    import trimesh

    path = write("gltf", result, tmp_path)
    viewed = trimesh.load(path)
    assert result.scene.garment is not None
    assert len(viewed.geometry["body"].faces) == len(result.scene.body.faces)
    assert len(viewed.geometry["garment"].faces) == len(result.scene.garment.faces)
    places = played(path, 3)
    y_up = np.stack([places[..., 0], -places[..., 2], places[..., 1]], axis=-1)
    np.testing.assert_allclose(y_up, result.places[3], atol=NEAR)


def played(path: Path, row: int) -> np.ndarray:
    """Return where the joints of a glTF file are in one frame, by the rules of the format: (J, 3) m, y up."""
    import pygltflib

    gltf = pygltflib.GLTF2.load_binary(str(path))
    blob = gltf.binary_blob()

    def values(index: int, width: int) -> np.ndarray:
        view = gltf.bufferViews[gltf.accessors[index].bufferView]
        return np.frombuffer(blob, np.float32, view.byteLength // 4, view.byteOffset).reshape(-1, width)

    moves: dict[int, Any] = {k: SimpleNamespace(rotation=None, translation=None) for k in range(len(gltf.nodes))}
    for channel in gltf.animations[0].channels:
        output = gltf.animations[0].samplers[channel.sampler].output
        width = {"rotation": 4, "translation": 3, "weights": 5}[channel.target.path]
        setattr(moves[channel.target.node], channel.target.path, values(output, width)[row])
    world = {}

    def visit(index: int, parent: np.ndarray) -> None:
        node, local = gltf.nodes[index], np.eye(4)
        rotation, translation = moves[index].rotation, moves[index].translation
        turn = node.rotation if rotation is None else rotation
        shift = node.translation if translation is None else translation
        local[:3, :3] = np.eye(3) if turn is None else Rotation.from_quat(turn).as_matrix()
        local[:3, 3] = 0 if shift is None else shift
        world[index] = parent @ local
        for child in node.children:
            visit(child, world[index])

    visit(0, np.eye(4))
    return np.array([world[joint][:3, 3] for joint in gltf.skins[0].joints])


def test_rerun(result: Result, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    path = write("rrd", result, tmp_path)
    assert path.read_bytes()[:3] == b"RRF"
    assert path.stat().st_size > 50_000
