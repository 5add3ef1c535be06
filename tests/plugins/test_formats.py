"""Files for other programs, each read back by an independent library: joint centres to a tenth of a millimetre."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import readers
from mocapflow_export import formats
from mocapflow_export.export import Export
from mocapflow_export.formats import FILES, Result, gltf, write
from mocapflow_export.formats.gltf import the_shorter_way
from results_scene import DEMO, demo_scene, stepping
from scipy.spatial.transform import Rotation

from mocapflow.errors import PipelineError
from mocapflow.geometry import angles, silhouettes, twists
from mocapflow.io.motion.c3d import read_c3d
from mocapflow.knocks import Knocks
from mocapflow.recordings.recording import open_recording
from mocapflow.results import ViewChecks

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
        ("usd", "pxr.Usd"),
    ],
)
def test_a_missing_library_is_named(
    name: str, needed: str, result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, needed, None)
    with pytest.raises(PipelineError, match=r"this format needs .*\n.*pip install 'mocapflow\["):
        write(name, result, tmp_path)


@pytest.mark.parametrize("name", formats.FILES)
def test_all_packages_that_a_format_is_written_with_are_asked_for(name: str) -> None:
    source = (Path(formats.__file__).parent / f"{name}.py").read_text()
    assert set(re.findall(r'library\("(\w+)', source)) == set(formats.PACKAGES.get(name, ()))


def test_a_format_whose_package_is_not_installed_is_told_before_the_run(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    Export().need(result.recording)
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(PipelineError, match=r"this format needs rerun\n.*pip install 'mocapflow\[view\]'"):
        Export(formats=("csv", "bvh", "rrd")).need(result.recording)


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning", "ignore:No analog data")  # of the readers
@pytest.mark.parametrize("name", sorted(set(FILES) & set(readers.JOINTS)))
def test_joint_centres_come_back(name: str, result: Result, tmp_path: Path) -> None:
    """T-OUT4."""
    if name == "usd":
        pytest.importorskip("pxr")
    names, places = readers.JOINTS[name](write(name, result, tmp_path))
    assert set(names) == set(result.scene.body.joint_names)
    order = [names.index(joint) for joint in result.scene.body.joint_names]
    np.testing.assert_allclose(places[:, order], result.places, atol=NEAR)


def test_bvh_turns_on_past_a_half_turn(result: Result, tmp_path: Path) -> None:
    """Programs draw between frames: from 170 to -170 degrees they would turn the person round the other way."""
    from bvh import Bvh

    body, turns = result.scene.body, np.zeros((25, 6))
    track = stepping(body, 25)
    turns[:, 2] = np.radians(30) * np.arange(25)
    turned = replace(result, track=replace(track, root=twists.exp(turns) @ track.root))
    path = write("bvh", turned, tmp_path)
    frames = np.array(Bvh(path.read_text()).frames, float)
    assert np.abs(np.diff(frames[:, 3:], axis=0)).max() < 40
    names, places = readers.bvh(path)
    order = [names.index(name) for name in body.joint_names]
    np.testing.assert_allclose(places[:, order], turned.places, atol=NEAR)


def test_files_of_every_second_frame_have_half_the_rate(result: Result, tmp_path: Path) -> None:
    from bvh import Bvh

    sparse = replace(result.recording, indices=range(0, 10, 2), frame_rate=60.0)
    text = Bvh(write("bvh", replace(result, recording=sparse), tmp_path).read_text())
    assert text.frame_time == pytest.approx(1 / 30, abs=1e-6)


def test_one_frame_has_the_rate_of_its_recording(result: Result, tmp_path: Path) -> None:
    from bvh import Bvh

    alone = replace(result, track=stepping(result.scene.body, 1), recording=replace(result.recording, frame_rate=59.94))
    assert 1 / Bvh(write("bvh", alone, tmp_path).read_text()).frame_time == pytest.approx(59.94, abs=1e-3)


def test_bvh_by_another_reader(result: Result, tmp_path: Path) -> None:
    from bvh import Bvh

    text = Bvh(write("bvh", result, tmp_path).read_text())
    assert text.nframes == 5
    assert text.frame_time == pytest.approx(1 / result.track.frame_rate, abs=1e-6)
    body = result.scene.body
    assert set(text.get_joints_names()) == set(body.joint_names)
    ends = re.findall(r"End Site\n\s*{\n\s*OFFSET (.*)\n", (tmp_path / FILES["bvh"]).read_text())
    assert len(ends) == len(set(range(len(body.parents))) - set(body.parents.tolist()))  # of each limb
    assert np.linalg.norm([np.array(end.split(), float) for end in ends], axis=1) == pytest.approx(5.0, abs=1e-4)  # cm


@pytest.mark.filterwarnings("ignore:No analog data")
def test_c3d_has_the_frame_rate(result: Result, tmp_path: Path) -> None:
    import c3d

    with write("c3d", result, tmp_path).open("rb") as file:
        assert c3d.Reader(file).point_rate == pytest.approx(result.track.frame_rate)


@pytest.mark.filterwarnings("ignore:No analog data")
@pytest.mark.parametrize(("first", "step"), [(0, 1), (1, 1), (10, 3)])
def test_c3d_has_the_times_of_the_track(result: Result, tmp_path: Path, first: int, step: int) -> None:
    import c3d

    frame = first + step * result.track.frame
    track = replace(result.track, frame=frame, time=frame / result.recording.frame_rate)
    path = write("c3d", replace(result, track=track), tmp_path)
    names, places, time, _ = read_c3d(path)
    seen = np.isfinite(places).all(axis=(1, 2))
    assert len(places) == frame[-1] - first + 1
    assert names == result.scene.body.joint_names
    np.testing.assert_allclose(time[seen], track.time, atol=1e-6)  # s; single precision
    np.testing.assert_allclose(places[seen], result.places, atol=NEAR)
    with path.open("rb") as file:
        assert c3d.Reader(file).first_frame == first + 1  # the format counts from 1


@pytest.mark.filterwarnings("ignore:No analog data")
def test_c3d_says_what_it_can_not_count(result: Result, tmp_path: Path) -> None:
    import c3d

    last, beyond = (replace(result.track, frame=result.track.frame + first) for first in (65534, 65535))
    with write("c3d", replace(result, track=last), tmp_path).open("rb") as file:
        assert c3d.Reader(file).first_frame == 65535
    with pytest.raises(PipelineError, match="C3D can't say that a track begins at frame 65535"):
        write("c3d", replace(result, track=beyond), tmp_path)


def test_parquet(result: Result, tmp_path: Path) -> None:
    table = readers.parquet(write("parquet", result, tmp_path))
    assert list(table)[:4] == ["frame", "time", "knee_flexion_l", "knee_flexion_l_sd"]
    np.testing.assert_array_equal(table["frame"], result.track.frame)
    series = angles.measure(result.scene.body, result.track.root, result.track.angles)
    np.testing.assert_array_equal(table["elbow_l"], series.value[:, series.names.index("elbow_l")])


def test_movement_has_the_names_the_toolbox_reads(result: Result, tmp_path: Path) -> None:
    import xarray

    usable = result.track.usable.copy()
    usable[2, 1] = False  # one of four cameras
    track = replace(result.track, usable=usable, time=result.track.time + 2.0)
    with xarray.open_dataset(write("movement", replace(result, track=track), tmp_path), engine="h5netcdf") as dataset:
        np.testing.assert_allclose(dataset.time, track.time)
        np.testing.assert_array_equal(dataset.confidence[:, :, 0].T, [[1, 1, 0.75, 1, 1]] * len(dataset.keypoints))
        assert dataset.position.dims == ("time", "space", "keypoints", "individuals")
        assert (dataset.attrs["ds_type"], dataset.attrs["time_unit"]) == ("poses", "seconds")


def test_gltf_opens_and_moves_body_and_garment(result: Result, tmp_path: Path) -> None:
    import trimesh

    path = write("gltf", result, tmp_path)
    viewed = trimesh.load(path)
    assert result.scene.garment is not None
    assert len(viewed.geometry["body"].faces) == len(result.scene.body.faces)
    assert len(viewed.geometry["garment"].faces) == len(result.scene.garment.faces)
    played = readers.Gltf(path)
    file = played.file
    assert [file.nodes[node].name for node in file.scenes[file.scene].nodes] == ["world"]
    for mesh in file.meshes:
        material = file.materials[mesh.primitives[0].material]
        assert material.name == mesh.name and material.doubleSided
    assert [weight for mesh in file.meshes for weight in getattr(mesh, "weights", [])] == [0.0] * 5
    for row in (0, 3):
        np.testing.assert_allclose(played.garment(row), result.track.cloth[row], atol=NEAR)
        off = np.linalg.norm(played.skinned(row) - result.bare(row).vertices, axis=1)
        assert off.max() < 2e-3  # the format has four joints a vertex, ours five


def test_gltf_keeps_the_strongest_joints_of_each_vertex(result: Result, tmp_path: Path) -> None:
    """Whatever order a body lists them in: the weakest first here."""
    body = result.scene.body
    turned = {name: np.ascontiguousarray(getattr(body, name)[:, ::-1]) for name in ("skin_joint", "skin_weight")}
    other = replace(result, scene=replace(result.scene, body=replace(body, **turned)))
    shown = [readers.Gltf(write("gltf", each, tmp_path)).skinned(3) for each in (result, other)]
    np.testing.assert_allclose(shown[1], shown[0], atol=NEAR)


@pytest.mark.parametrize("name", ["body", "garment"])
def test_gltf_is_lit_from_outside(result: Result, tmp_path: Path, name: str) -> None:
    """Another library weighs the faces about a vertex by their angles there."""
    import trimesh

    worn = result.scene.body if name == "body" else result.scene.garment
    assert worn is not None
    vertices = worn.vertices if name == "body" else result.track.cloth[0]
    expected = trimesh.Trimesh(vertices, worn.faces, process=False).vertex_normals
    found = readers.Gltf(write("gltf", result, tmp_path)).attribute(name, "NORMAL")
    assert np.mean(np.sum(found * expected, axis=1) > 0.95) > 0.95
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-5)


def test_gltf_has_no_more_shapes_of_a_garment_than_asked_for(
    result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gltf, "SHAPES", 3)
    played = readers.Gltf(write("gltf", result, tmp_path))
    moments, shapes = played.shapes()
    np.testing.assert_allclose(moments, result.track.time[[0, 2, 4]])
    np.testing.assert_allclose(shapes, result.track.cloth[[0, 2, 4]] - result.track.cloth[0], atol=NEAR)


@pytest.mark.parametrize("name", ["gltf", "usd"])
def test_a_garment_that_was_not_tracked_is_left_out(result: Result, tmp_path: Path, name: str) -> None:
    if name == "usd":
        pytest.importorskip("pxr")
    bare = replace(result, track=replace(result.track, cloth=np.zeros((5, 0, 3))))
    names, places = readers.JOINTS[name](write(name, bare, tmp_path))
    assert len(names) == places.shape[1]


def test_gltf_counts_seconds_from_its_first_frame_and_says_how_far_things_reach(result: Result, tmp_path: Path) -> None:
    late = replace(result, track=replace(result.track, time=result.track.time + 2.0))
    file = readers.Gltf(write("gltf", late, tmp_path)).file
    last = result.track.time[-1] - result.track.time[0]
    for sampler in file.animations[0].samplers:
        moments = file.accessors[sampler.input]
        assert (moments.min, moments.max) == ([0.0], [pytest.approx(last)])
    names = [node.name for node in file.nodes]
    hanging = [channel.target for channel in file.animations[0].channels if channel.target.path == "weights"]
    assert [names[target.node] for target in hanging] == ["garment"]
    assert file.nodes[names.index("body")].skin == 0 and len(file.skins) == 1
    shown = {mesh.name: mesh.primitives[0] for mesh in file.meshes}
    places, vertices = file.accessors[shown["body"].attributes.POSITION], result.scene.body.vertices
    for part in (shown["garment"].attributes, *shown["garment"].targets):
        assert len(file.accessors[part.POSITION].min) == len(file.accessors[part.POSITION].max) == 3
    assert (places.min, places.max) == (pytest.approx(vertices.min(axis=0)), pytest.approx(vertices.max(axis=0)))
    assert all(0 <= node.mesh < len(file.meshes) for node in file.nodes if getattr(node, "mesh", None) is not None)


def test_turns_go_the_shorter_way_and_past_a_half_turn() -> None:
    """Half a turn at once has no shorter way: the sign stays, and nothing becomes zero."""
    degrees = np.array([0.0, 100.0, 200.0, 300.0, 480.0, 490.0])
    turns = Rotation.from_rotvec(np.outer(np.radians(degrees), [0, 0, 1])).as_quat()
    way = the_shorter_way(np.where(np.arange(6)[:, None] % 2, -1, 1) * turns)
    np.testing.assert_allclose(np.abs(np.einsum("ta,ta->t", way, turns)), 1)
    steps = np.einsum("ta,ta->t", way[1:], way[:-1])
    assert (steps > -1e-12).all() and (np.delete(steps, 3) > 0.6).all()
    exact = the_shorter_way(np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, -1.0, 0, 0]]))
    np.testing.assert_array_equal(exact, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0]])


def test_usd_opens_and_moves_body_and_garment(result: Result, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdSkel

    stage = Usd.Stage.Open(str(write("usd", result, tmp_path)))
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Z", 1.0)
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert result.scene.garment is not None
    for path, worn in (("Person/Body", result.scene.body), ("Garment", result.scene.garment)):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{path}"))
        assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
        np.testing.assert_array_equal(mesh.GetFaceVertexIndicesAttr().Get(), worn.faces.ravel())
        assert mesh.GetSubdivisionSchemeAttr().Get() == "none" and mesh.GetDoubleSidedAttr().Get()
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/World/Person/Skeleton"))
    topology = UsdSkel.Topology(skeleton.GetJointsAttr().Get())
    at_rest = UsdSkel.ConcatJointTransforms(topology, skeleton.GetRestTransformsAttr().Get())
    np.testing.assert_allclose(at_rest, skeleton.GetBindTransformsAttr().Get(), atol=NEAR)
    for rate in (stage.GetTimeCodesPerSecond(), stage.GetFramesPerSecond()):
        assert rate == pytest.approx(result.track.frame_rate)
    garment = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Garment")).GetPointsAttr()
    np.testing.assert_allclose(garment.Get(3), result.track.cloth[3], atol=NEAR)
    assert UsdSkel.BakeSkinning(UsdSkel.Root(stage.GetPrimAtPath("/World/Person")))
    body = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Person/Body")).GetPointsAttr()
    np.testing.assert_allclose(body.Get(3), result.bare(3).vertices, atol=NEAR)


def test_usd_plays_every_other_frame_at_the_speed_of_the_recording(result: Result, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd

    track = replace(result.track, frame=7 + 2 * result.track.frame, time=2 * result.track.time)
    stage = Usd.Stage.Open(str(write("usd", replace(result, track=track), tmp_path)))
    played = (stage.GetEndTimeCode() - stage.GetStartTimeCode()) / stage.GetTimeCodesPerSecond()
    assert played == pytest.approx(track.time[-1] - track.time[0])
    assert stage.GetStartTimeCode() == 7


@pytest.mark.long
def test_rerun_holds_everything_on_one_timeline(result: Result, tmp_path: Path) -> None:
    logged = readers.rerun_entities(write("rrd", result, tmp_path))
    track, body = result.track, result.scene.body
    assert logged["/world/joints"]["frame"] == track.frame.tolist()
    np.testing.assert_allclose(logged["/world/garment"]["Mesh3D:vertex_positions"], track.cloth, atol=NEAR)
    np.testing.assert_allclose(logged["/world/body"]["Mesh3D:vertex_positions"][3], result.bare(3).vertices, atol=NEAR)
    series = angles.measure(body, track.root, track.angles)
    for column, name in enumerate(series.names):
        np.testing.assert_allclose(np.ravel(logged[f"/angles/{name}"]["Scalars:scalars"]), series.value[:, column])
    for camera in result.scene.cameras:
        (lens,) = logged[f"/world/{camera.name}"]["Pinhole:image_from_camera"]
        half = np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])  # px; there pixels begin at whole numbers
        np.testing.assert_allclose(np.reshape(lens, (3, 3)).T, camera.intrinsics + half, rtol=1e-6)
        image = np.array(logged[f"/world/{camera.name}/image"]["EncodedImage:blob"][3][0], np.uint8)
        assert cv2.imdecode(image, cv2.IMREAD_COLOR).shape == (*camera.size[::-1], 3)
        outline = np.concatenate(logged[f"/world/{camera.name}/outline"]["LineStrips2D:strips"][3])
        expected = np.concatenate(silhouettes.outline(result.surface(3), camera).pixel) + 0.5
        np.testing.assert_allclose(outline, expected, rtol=1e-6)


def test_rerun_takes_cameras_whatever_they_are_called(
    result: Result, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    first, *others = result.scene.cameras
    scene = replace(result.scene, cameras=(replace(first, name="left hall: 1"), *others))
    logged = readers.rerun_entities(write("rrd", replace(result, scene=scene), tmp_path))
    assert {f"/world/left\\ hall\\:\\ 1{part}" for part in ("", "/image", "/outline")} <= set(logged)
    assert "WARN" not in capfd.readouterr().err


@pytest.mark.long
def test_rerun_shows_pictures_of_a_knocked_camera_moved_back(result: Result, tmp_path: Path) -> None:
    first, down = np.zeros(1, np.int32), np.array([[1.0, 0, 0], [0, 1, 40], [0, 0, 1]])
    knocks = Knocks(frame=first, camera=np.ones(1, np.int16), turn=down[None])
    checks = ViewChecks(frame=first[:0], camera=np.empty(0, np.int16), reasons=(), knocks=knocks)
    still, knocked = (readers.rerun_entities(write("rrd", replace(result, checks=c), tmp_path)) for c in (None, checks))
    names = [f"/world/{camera}/image" for camera in ("cam01", "cam02")]
    before, after = ([logged[name]["EncodedImage:blob"][0] for name in names] for logged in (still, knocked))
    assert before[0] == after[0] and before[1] != after[1]


def test_rerun_shows_no_picture_where_a_view_was_not_used(result: Result, tmp_path: Path) -> None:
    usable = result.track.usable.copy()
    usable[2, 1] = False
    spoiled = replace(result, track=replace(result.track, usable=usable))
    image = readers.rerun_entities(write("rrd", spoiled, tmp_path))["/world/cam02/image"]
    assert sorted(image["frame"]) == result.track.frame.tolist()
    assert len(image["EncodedImage:blob"]) == 4 and len(image["Clear:is_recursive"]) == 1
