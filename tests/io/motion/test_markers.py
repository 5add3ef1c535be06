"""Marker and motion files there and back, and what is said of bad ones."""

import struct

import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.io.motion.markers import (
    _is_cut_off,
    opensim_from_world,
    read_c3d,
    read_mot,
    read_trc,
    world_from_opensim,
    write_mot,
    write_trc,
)


def positions(frames=7, markers=3):
    return np.random.default_rng(0).normal(size=(frames, markers, 3))


def test_trc_there_and_back(tmp_path):
    path, points = tmp_path / "joints.trc", positions()
    points[2, 1] = np.nan
    points[6, 2] = np.nan  # the last cells of the last row
    write_trc(path, ["hip_l", "knee_l", "ankle_l"], points, 30.0, start=0.5)
    rows = path.read_text().replace("\n", "\t\t\n")  # as some programs write text: cells too many, and a mark
    path.write_text(rows, encoding="utf-8-sig")
    names, read, time, rate = read_trc(path)
    assert names == ("hip_l", "knee_l", "ankle_l")
    assert rate == 30
    np.testing.assert_allclose(read, points, atol=1e-8)
    np.testing.assert_allclose(time, 0.5 + np.arange(7) / 30, atol=1e-8)


def test_trc_header_is_opensim_s(tmp_path):
    write_trc(tmp_path / "a.trc", ["p", "q"], positions(5, 2), 60.0)
    lines = (tmp_path / "a.trc").read_text().splitlines()
    assert lines[0] == "PathFileType\t4\t(X/Y/Z)\ta.trc"
    assert lines[2] == "60\t60\t5\t2\tm\t60\t1\t5"
    assert lines[3].split("\t") == ["Frame#", "Time", "p", "", "", "q", "", ""]
    assert lines[4].split("\t") == ["", "", "X1", "Y1", "Z1", "X2", "Y2", "Z2"]
    assert lines[6].startswith("1\t0.00000000\t")
    write_trc(tmp_path / "a.trc", ["p", "q"], np.array([[[1.0, 2.0, 3.0], [np.nan] * 3]]), 60.0)
    row = (tmp_path / "a.trc").read_text().splitlines()[6].split("\t")
    assert row[2:] == ["1.00000000", "2.00000000", "3.00000000", "", "", ""]  # what is not seen has no numbers


def test_trc_in_mm(tmp_path):
    path = tmp_path / "a.trc"
    write_trc(path, ["p"], positions(2, 1) * 1000, 60.0)
    path.write_text(path.read_text().replace("\tm\t", "\tmm\t"))
    np.testing.assert_allclose(read_trc(path)[1], positions(2, 1), atol=1e-8)


def test_axes():
    points = positions()
    assert opensim_from_world(np.array([0, 0, 1.0])).tolist() == [0, 1, 0]  # up
    np.testing.assert_array_equal(world_from_opensim(opensim_from_world(points)), points)
    turn = opensim_from_world(np.eye(3))
    assert np.linalg.det(turn) == pytest.approx(1)  # no mirror


def test_mot_there_and_back(tmp_path):
    path, time = tmp_path / "angles.mot", np.arange(4) / 30
    columns = {"knee_angle_l": np.array([1.5, -2, 3, 4]), "pelvis_tx": np.array([0.1, 0.2, 0.3, 0.4])}
    write_mot(path, columns, time)
    read, when = read_mot(path)
    assert list(read) == list(columns)
    np.testing.assert_allclose(when, time, atol=1e-8)
    for name, column in columns.items():
        np.testing.assert_allclose(read[name], column, atol=1e-8)
    assert path.read_text().splitlines()[:6] == [
        "angles", "version=1", "nRows=4", "nColumns=3", "inDegrees=yes", "endheader",
    ]  # fmt: skip


def test_mot_in_radians_is_read_in_degrees(tmp_path):
    columns = {"knee_angle_l": np.full(3, np.pi / 2), "pelvis_ty": np.full(3, 0.9)}
    write_mot(tmp_path / "a.sto", columns, np.arange(3) / 10)
    said = (tmp_path / "a.sto").read_text()
    (tmp_path / "a.sto").write_text(said.replace("inDegrees=yes", "inDegrees=no"))
    read, time = read_mot(tmp_path / "a.sto")
    np.testing.assert_allclose(read["knee_angle_l"], 90, atol=1e-6)
    np.testing.assert_allclose(read["pelvis_ty"], 0.9)
    np.testing.assert_allclose(time, [0, 0.1, 0.2])


def test_a_marker_at_three_zeros_is_not_seen(tmp_path):
    path, points = tmp_path / "a.trc", positions(3, 2)
    points[1, 0], points[2, 1, 0] = 0.0, 0.0
    write_trc(path, ["p", "q"], points, 60.0)
    found = read_trc(path)[1]
    assert np.isnan(found[1, 0]).all() and np.isfinite(np.delete(found.reshape(6, 3), 2, axis=0)).all()


def test_bad_trc(tmp_path):
    path = tmp_path / "a.trc"
    with pytest.raises(RecordingError, match="no such file"):
        read_trc(path)
    path.write_text("frame,x\n")
    with pytest.raises(RecordingError, match="not a TRC file: its first word is not PathFileType"):
        read_trc(path)
    write_trc(path, ["p", "q"], positions(5, 2), 60.0)
    good = path.read_text()
    path.write_text(good.replace("\tm\t", "\tfurlong\t"))
    with pytest.raises(RecordingError, match="unknown unit 'furlong'\n       known: m, cm, mm"):
        read_trc(path)
    path.write_text("\n".join(good.splitlines()[:6]))
    with pytest.raises(RecordingError, match="no row of positions below the header"):
        read_trc(path)
    path.write_text(good.rstrip() + "\t1.0\n")
    with pytest.raises(RecordingError, match=r"a\.trc:11  9 columns; expected 8"):
        read_trc(path)
    path.write_text(good.replace("\n2\t", "\ntwo\t"))
    with pytest.raises(RecordingError, match=r"a\.trc:8:\d+  'two' is no number"):
        read_trc(path)
    path.write_text(good.replace("DataRate", "Rate"))
    with pytest.raises(RecordingError, match=r"a\.trc:3  no DataRate above zero"):
        read_trc(path)


def test_bad_mot(tmp_path):
    path = tmp_path / "a.mot"
    write_mot(path, {"x": np.arange(3.0)}, np.arange(3.0))
    good = path.read_text()
    path.write_text(good.replace("endheader", ""))
    with pytest.raises(RecordingError, match="not a MOT file: no line says endheader"):
        read_mot(path)
    path.write_text(good.replace("time\t", "when\t"))
    with pytest.raises(RecordingError, match=r"a\.mot:7  no column 'time'\n       the columns are: when, x"):
        read_mot(path)
    path.write_text(good + "3.0\n")
    with pytest.raises(RecordingError, match=r"a\.mot:11  1 columns; expected 2"):
        read_mot(path)


def test_c3d(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    made, path, points = ezc3d.c3d(), tmp_path / "a.c3d", positions(5, 2)
    made["parameters"]["POINT"]["LABELS"]["value"] = ["hip", "knee"]
    made["parameters"]["POINT"]["RATE"]["value"] = [100]
    made["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    stacked = np.ones((4, 2, 5))
    stacked[:3] = np.moveaxis(points, -1, 0).swapaxes(1, 2) * 1000
    made["data"]["points"] = stacked
    made.write(str(path))
    names, read, time, rate = read_c3d(path)
    assert names == ("hip", "knee")
    assert rate == 100
    np.testing.assert_allclose(read, points, atol=1e-6)
    np.testing.assert_allclose(time, np.arange(5) / 100)
    whole = path.read_bytes()
    broken = {b"nothing": "can't be read", whole[:700]: "is cut off", whole[:520]: "is cut off"}
    broken |= {whole[:-512]: "is cut off", whole[: -512 + 100]: "is cut off"}  # the last block is that of the frames
    for content, said in broken.items():
        path.write_bytes(content)
        with pytest.raises(RecordingError, match=f"this C3D file {said}"):
            read_c3d(path)
    path.write_bytes(whole[:515] + b"\0" + whole[516:])  # the processor that wrote it
    with pytest.raises(RecordingError, match="this C3D file can't be read: Could not read the processor type"):
        read_c3d(path)
    path.write_bytes(whole.replace(struct.pack("<f", 100), bytes(4)))
    with pytest.raises(RecordingError, match=r"a\.c3d  no POINT:RATE above zero"):
        read_c3d(path)
    made["parameters"]["POINT"]["UNITS"]["value"] = []
    made.write(str(path))
    with pytest.raises(RecordingError, match=r"a\.c3d  unknown unit ''\n.*known: m, cm, mm"):
        read_c3d(path)


def test_a_trc_without_markers(tmp_path):
    write_trc(tmp_path / "a.trc", [], np.empty((2, 0, 3)), 30)
    with pytest.raises(RecordingError, match=r"a\.trc:4  no marker is named"):
        read_trc(tmp_path / "a.trc")


def test_c3d_without_ezc3d(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ezc3d", None)
    with pytest.raises(RecordingError, match="C3D files need ezc3d\n       pip install 'mocapflow"):
        read_c3d(tmp_path / "a.c3d")


@pytest.mark.parametrize(
    ("processor", "order", "one"), [(84, "<", b"\0\0\x80\x3f"), (85, "<", b"\x80\x40\0\0"), (86, ">", b"\x3f\x80\0\0")]
)
@pytest.mark.parametrize("floats", [False, True])
def test_files_of_every_processor_have_their_length(tmp_path, processor, order, one, floats):
    """Intel, DEC and MIPS: a header of a block, two of parameters, four frames of 300 points."""
    sign = {84: 3, 85: 1, 86: 0}[processor]
    scale = bytes(byte | 0x80 * (floats and place == sign) for place, byte in enumerate(one))
    words = struct.pack(f"{order}5H", 300, 0, 7, 10, 0)
    header = bytes([2, 0x50]) + words + scale + struct.pack(f"{order}H", 4)
    parameters = bytes([1, 0x50, 2, processor])
    whole = header.ljust(512, b"\0") + parameters.ljust(1024, b"\0") + bytes(4 * 300 * 4 * (4 if floats else 2))
    for content, cut in ((whole, False), (whole[:-1], True)):
        (tmp_path / "a.c3d").write_bytes(content)
        assert _is_cut_off(tmp_path / "a.c3d") == cut
