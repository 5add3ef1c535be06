"""Markers of C3D files, and what is said of bad ones."""

import struct

import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.io.motion.c3d import _is_cut_off, read_c3d
from tests.io.motion.test_trc import positions


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
