"""Calibration files of every format, and what is said of bad ones."""

import re
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.geometry.cameras import centre
from mocapflow.io.cameras.calibration import calibration_files, find_calibration, read_cameras
from mocapflow.io.cameras.pose2sim import metadata, write_cameras
from tests.fixtures.recordings import ring

ARRAYS = ("size", "intrinsics", "distortion", "camera_from_world")
LENS = (-0.05, 0.14, 0.0006, 0.0007)

QUALISYS = """<?xml version='1.0' encoding='ASCII'?>
<calibration created="2024"><results/><cameras>
<camera active="1" serial="26578">
<fov_video bottom="1919" left="0" right="1087" top="0"/>
<transform r11="0" r12="1" r13="0" r21="0" r22="0" r23="1" r31="1" r32="0" r33="0" x="2500" y="100" z="1200"/>
<intrinsic centerPointU="34816" centerPointV="61440" focalLengthU="107520" focalLengthV="107584"
 radialDistortion1="-0.05" radialDistortion2="0.14" radialDistortion3="0.01" tangentalDistortion1="0.001"
 tangentalDistortion2="0.002" skew="0"/>
</camera>
<camera active="0" serial="9"/>
</cameras></calibration>
"""


def assert_same(some, others):
    assert [c.name for c in some] == [c.name for c in others]
    for one, other in zip(some, others, strict=True):
        for name in ARRAYS:
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-12)
        assert one.fisheye == other.fisheye


def test_toml_there_and_back(tmp_path):
    cameras = list(ring(distortion=LENS))
    cameras[1] = replace(cameras[1], distortion=np.array([0.1, 0.2, 0.3, 0.4, 0.5]))
    cameras[2] = replace(cameras[2], fisheye=True)
    write_cameras(tmp_path / "cameras.toml", cameras)
    assert_same(read_cameras(tmp_path), cameras)


@pytest.mark.parametrize("name", ["left cam", "cam.1", 'the "old" one', "Kamera größer", ""])
def test_any_name_there_and_back(tmp_path, name):
    cameras = (replace(ring()[0], name=name), *ring()[1:])
    write_cameras(tmp_path / "cameras.toml", cameras)
    assert_same(read_cameras(tmp_path), cameras)


@pytest.mark.parametrize("form", ["frame_rate = 100\n{}", "{}frame_rate = 100\n"])
def test_a_frame_rate_in_the_wrong_place(tmp_path, form):
    path = tmp_path / "cameras.toml"
    write_cameras(path, ring())
    path.write_text(form.format(path.read_text()))
    with pytest.raises(RecordingError, match=r"toml:\d+:1  frame_rate is not under \[metadata\]\n"):
        read_cameras(path)


def test_anipose_names_and_metadata(tmp_path):
    path = tmp_path / "calibration.toml"
    path.write_text(
        '[cam_0]\nname = "A"\nsize = [64, 48]\nmatrix = [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]\n'
        "distortions = [0.1, 0, 0, 0, 0]\nrotation = [0, 0, 0]\ntranslation = [0, 0, 3]\n\n"
        "[metadata]\nadjusted = false\nframe_rate = 60\n[charuco]\nsize = [4, 5]\n"
    )
    (camera,) = read_cameras(path)
    assert camera.name == "A"
    assert not camera.fisheye
    assert metadata(path)["frame_rate"] == 60


def test_qualisys_units_and_axes(tmp_path):
    path = tmp_path / "trial.qca.txt"
    path.write_text(QUALISYS)
    (camera,) = read_cameras(tmp_path)
    assert camera.name == "26578"
    assert camera.size.tolist() == [1088, 1920]
    np.testing.assert_allclose(camera.intrinsics, [[1680, 0, 544], [0, 1681, 960], [0, 0, 1]])
    np.testing.assert_allclose(camera.distortion, [-0.05, 0.14, 0.001, 0.002, 0.01])
    np.testing.assert_allclose(centre(camera), [2.5, 0.1, 1.2])
    np.testing.assert_allclose(camera.camera_from_world[:3, :3], [[0, 1, 0], [0, 0, -1], [-1, 0, 0]])  # y down, z ahead
    assert metadata(path) == {}


def write_easymocap(folder, cameras, sizes=True, vectors=True):
    inner = cv2.FileStorage(str(folder / "intri.yml"), cv2.FILE_STORAGE_WRITE)
    outer = cv2.FileStorage(str(folder / "extri.yml"), cv2.FILE_STORAGE_WRITE)
    for storage in (inner, outer):
        storage.startWriteStruct("names", cv2.FILE_NODE_SEQ)
        for camera in cameras:
            storage.write("", camera.name)
        storage.endWriteStruct()
    for camera in cameras:
        rotation = camera.camera_from_world[:3, :3].copy()
        inner.write(f"K_{camera.name}", camera.intrinsics.copy())
        inner.write(f"dist_{camera.name}", camera.distortion[None].copy())
        if sizes:
            inner.write(f"W_{camera.name}", int(camera.size[0]))
            inner.write(f"H_{camera.name}", int(camera.size[1]))
        if vectors:
            outer.write(f"R_{camera.name}", cv2.Rodrigues(rotation)[0])
        outer.write(f"Rot_{camera.name}", rotation)
        outer.write(f"T_{camera.name}", camera.camera_from_world[:3, 3:].copy())
    inner.release()
    outer.release()


@pytest.mark.parametrize("vectors", [True, False])
def test_easymocap_pair(tmp_path, vectors):
    cameras = ring(names=("01", "02", "03"), distortion=LENS)
    write_easymocap(tmp_path, cameras, vectors=vectors)
    assert_same(read_cameras(tmp_path), cameras)
    assert [p.name for p in calibration_files(find_calibration(tmp_path))] == ["intri.yml", "extri.yml"]


def test_easymocap_without_sizes(tmp_path):
    write_easymocap(tmp_path, ring(), sizes=False)
    assert not read_cameras(tmp_path)[0].size.any()


@pytest.mark.parametrize("width", ['"64"', "[ 64, 48 ]"])
def test_easymocap_whose_size_is_no_number(tmp_path, width):
    write_easymocap(tmp_path, ring())
    path = tmp_path / "intri.yml"
    path.write_text(path.read_text().replace("W_cam01: 64", f"W_cam01: {width}"))
    with pytest.raises(RecordingError, match=r"intri\.yml:\d+:1  camera 'cam01' has no number in W_cam01"):
        read_cameras(tmp_path)


def test_easymocap_needs_both_files(tmp_path):
    write_easymocap(tmp_path, ring())
    (tmp_path / "extri.yml").unlink()
    with pytest.raises(
        RecordingError, match=r"extri\.yml  no such calibration file\n.*a pair: intri\.yml and extri\.yml"
    ):
        read_cameras(tmp_path)


def write_changed(path, old, new):
    write_cameras(path, ring())
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


def test_missing_field(tmp_path):
    path = write_changed(tmp_path / "cameras.toml", "rotation =", "rotations =")
    with pytest.raises(RecordingError, match="camera 'cam01' lacks rotation\n.*each camera needs size, matrix"):
        read_cameras(path)


@pytest.mark.parametrize(("rotation", "turn"), [("[69.0, 81.6, -72.7]", "129.2"), ("[0.0, 0.0, 6.5]", "6.5")])
def test_rotation_in_degrees(tmp_path, rotation, turn):
    path = tmp_path / "cameras.toml"
    write_cameras(path, ring())
    path.write_text(re.sub(r"rotation = \[.*?\]", f"rotation = {rotation}", path.read_text(), count=1))
    with pytest.raises(RecordingError, match=rf"'cam01' turns by {turn} rad, .*: it looks like degrees"):
        read_cameras(path)


@pytest.mark.parametrize(("unit", "factor", "away"), [("mm", 1000, 4272), ("cm", 100, 427)])
def test_calibration_in_other_units(tmp_path, unit, factor, away):
    cameras = [replace(c, camera_from_world=c.camera_from_world * [[1, 1, 1, factor]]) for c in ring()]
    path = tmp_path / "cameras.toml"
    write_cameras(path, cameras)
    board = ";\n       if their unit is a square of the calibration board, multiply by its side" if unit == "cm" else ""
    message = (
        rf"cameras\.toml:1:3  camera 'cam01' stands {away} m from the origin: the calibration is in {unit}\n"
        rf"       lengths are in metres: divide every translation by {factor}{board}$"
    )
    with pytest.raises(RecordingError, match=message):
        read_cameras(path)


def test_nan(tmp_path):
    path = write_changed(tmp_path / "cameras.toml", "translation = [", "translation = [nan, 0.0, 1.0]\n# [")
    with pytest.raises(RecordingError, match="camera 'cam01' has NaN or infinity in translation"):
        read_cameras(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("size = [64, 48]", "size = [64]", "has 1 numbers in size; expected 2"),
        ("size = [64, 48]", f"size = [1{'0' * 400}, 48]", "has no numbers in size"),
        ("size = [64, 48]", "size = [-64, 48]", "has the size -64 x 48"),
        ("size = [64, 48]", "size = [64, 1e30]", r"has the size 64 x 1e\+30"),
        ("size = [64, 48]", 'size = ["big", 48]', r"has no numbers in size: \['big', 48\]"),
        ("rotation = [", "rotation = [[1.0, 0.0], [0.0, 1.0, 0.0]] # [", "has no numbers in rotation"),
        ("distortions = [0.0, 0.0, 0.0, 0.0]", "distortions = [[0.0], 0.0]", "has no numbers in distortions"),
        ("matrix = [[60.0", "matrix = [[-60.0", "has no camera matrix"),
        ("[0.0, 60.0,", "[1.0, 60.0,", "has no camera matrix"),
        ("[0.0, 60.0,", "[0.0, -60.0,", "has no camera matrix"),
        ("[0.0, 0.0, 1.0]]", "[1.0, 0.0, 1.0]]", "has no camera matrix"),
        ("[0.0, 0.0, 1.0]]", "[0.0, 1.0, 1.0]]", "has no camera matrix"),
        ("[0.0, 0.0, 1.0]]", "[0.0, 0.0, 2.0]]", "has no camera matrix"),
        ("fisheye = false", 'fisheye = "false"', "has fisheye = 'false'\n       write true or false"),
        ("fisheye = false", "fisheye = 1", "has fisheye = 1\n"),
        ("fisheye = false", "fish_eye = true", "has a field 'fish_eye', .*\n.* did you mean 'fisheye'"),
        ("rotation = [", "rotation = [[2, 0, 0], [0, 1, 0], [0, 0, 1]] # [", "has a matrix that is not a rotation"),
        ("rotation = [", "rotation = [[-1, 0, 0], [0, 1, 0], [0, 0, 1]] # [", "has a matrix that is not a rotation"),
        ("distortions = [0.0, 0.0, 0.0, 0.0]", "distortions = [0, 0, 0, 0, 0, 0.1]", "has 6 distortion coefficients"),
        ("distortions = [0.0, 0.0, 0.0, 0.0]", "distortions = [0.1, 0, 0.1]", "has 3 distortion .*\n.* k1 k2 p1 p2 k3"),
    ],
)
def test_bad_numbers(tmp_path, old, new, message):
    with pytest.raises(RecordingError, match=f"camera 'cam01' {message}"):
        read_cameras(write_changed(tmp_path / "cameras.toml", old, new))


def test_a_fisheye_with_the_coefficients_of_another_lens(tmp_path):
    path = tmp_path / "cameras.toml"
    write_cameras(path, [replace(c, fisheye=True) for c in ring()])
    path.write_text(path.read_text().replace("[0.0, 0.0, 0.0, 0.0]", "[0.1, 0, 0, 0, 0.1]", 1))
    with pytest.raises(RecordingError, match="'cam01' has 5 distortion coefficients\n       a fisheye has 4"):
        read_cameras(path)


def test_skew_goes_with_a_lens_without_distortion_alone(tmp_path):
    path = write_changed(tmp_path / "cameras.toml", "matrix = [[60.0, 0.0,", "matrix = [[60.0, 3.0,")
    assert read_cameras(path)[0].intrinsics[0, 1] == 3
    path.write_text(path.read_text().replace("distortions = [0.0,", "distortions = [-0.1,", 1))
    with pytest.raises(RecordingError, match="camera 'cam01' has a skew of 3 px\n.*without skew"):
        read_cameras(path)
    qualisys = tmp_path / "trial.qca.txt"
    qualisys.write_text(QUALISYS.replace('skew="0"', 'skew="-128"'))
    with pytest.raises(RecordingError, match="camera '26578' has a skew of -2 px"):
        read_cameras(qualisys)


def test_trailing_zero_coefficients_are_left_out(tmp_path):
    path = write_changed(tmp_path / "cameras.toml", "distortions = [0.0,", "distortions = [0, 0, 0, 0, 0.0,")
    assert read_cameras(path)[0].distortion.shape == (5,)


def test_not_a_calibration(tmp_path):
    with pytest.raises(RecordingError, match="no calibration file\n.*cameras.toml"):
        read_cameras(tmp_path)
    with pytest.raises(RecordingError, match="no such calibration file"):
        read_cameras(tmp_path / "cameras.toml")
    (tmp_path / "a.qca.txt").write_text("hello")
    with pytest.raises(RecordingError, match="not a Qualisys calibration"):
        read_cameras(tmp_path)
    (tmp_path / "._a.qca.txt").write_bytes(b"\x00\x05\x16\x07")  # as a Mac leaves them on other disks
    with pytest.raises(RecordingError, match="not a Qualisys calibration"):
        read_cameras(tmp_path)
    (tmp_path / "b.qca.txt").write_text(QUALISYS)
    with pytest.raises(RecordingError, match=r"2 calibration files: a\.qca\.txt, b\.qca\.txt"):
        read_cameras(tmp_path)
    (tmp_path / "cameras.toml").write_text("[cam01")
    with pytest.raises(RecordingError, match="not TOML: "):
        read_cameras(tmp_path)
    (tmp_path / "cameras.toml").write_text("[metadata]\n")
    with pytest.raises(RecordingError, match="the file holds no camera"):
        read_cameras(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('x="2500"', "", "camera '26578' lacks x in <transform>"),
        ('x="2500"', 'x="far"', "camera '26578' has x='far' in <transform>, not a number"),
        ("<fov_video", "<fov_marker", "camera '26578' lacks <fov_video>"),
    ],
)
def test_incomplete_qualisys(tmp_path, old, new, message):
    path = tmp_path / "trial.qca.txt"
    path.write_text(QUALISYS.replace(old, new))
    with pytest.raises(RecordingError, match=message):
        read_cameras(path)


@pytest.mark.parametrize("content", ["", "hello\n", "%YAML:1.0\n---\nnames: [ 1", "%YAML:1.0\n---\n- 1\n"])
def test_not_opencv_yaml(tmp_path, content):
    write_easymocap(tmp_path, ring())
    (tmp_path / "intri.yml").write_text(content)
    with pytest.raises(RecordingError, match=r"not an OpenCV YAML file|holds no camera"):
        read_cameras(tmp_path)


@pytest.mark.parametrize("names", ["4", '"cam01"', "[ 1, 2 ]", "{ cam01: 1 }"])
def test_easymocap_whose_names_are_no_list(tmp_path, names):
    write_easymocap(tmp_path, ring())
    (tmp_path / "intri.yml").write_text(f"%YAML:1.0\n---\nnames: {names}\n")
    with pytest.raises(RecordingError, match=r"intri\.yml  names is no list of camera names"):
        read_cameras(tmp_path)


def test_easymocap_lacks_a_matrix(tmp_path):
    write_easymocap(tmp_path, ring())
    path = tmp_path / "extri.yml"
    path.write_text(path.read_text().replace("T_cam02", "T_cam99"))
    with pytest.raises(RecordingError, match=r"extri\.yml  camera 'cam02' lacks T_cam02"):
        read_cameras(tmp_path)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("rows: 3", "rows: 4"),
        ("rows: 3", "rows: -3"),
        ("dt: d", "dt: q"),
        ("data: [", "data: x # ["),
        ("data: [ ", "data: [ x, "),
    ],
)
def test_easymocap_with_no_matrix_where_one_should_be(tmp_path, old, new):
    write_easymocap(tmp_path, ring())
    path = tmp_path / "intri.yml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(RecordingError, match=r"intri\.yml:\d+:1  camera 'cam01' has no matrix in K_cam01\n.*as many"):
        read_cameras(tmp_path)


def test_easymocap_whose_matrix_does_not_say_its_columns(tmp_path):
    """In a process of its own: OpenCV's way to read it would write beyond its memory, and that may kill."""
    write_easymocap(tmp_path, ring())
    path = tmp_path / "extri.yml"
    path.write_text(path.read_text().replace("   cols: 1\n", ""))
    words = [sys.executable, "-m", "mocapflow", "doctor", str(tmp_path)]
    done = subprocess.run(words, capture_output=True, check=False, text=True)
    assert done.returncode == 2, done.stderr
    assert "camera 'cam01' has no matrix in" in done.stdout


def test_one_name_twice(tmp_path):
    path = tmp_path / "cameras.toml"
    write_cameras(path, ring())
    path.write_text(path.read_text().replace('name = "cam02"', 'name = "cam01"'))
    with pytest.raises(RecordingError, match="camera 'cam01' is there more than once"):
        read_cameras(path)
