"""TRC files there and back, and what is said of bad ones."""

import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.io.motion.trc import read_trc, write_trc


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
    with pytest.raises(RecordingError, match=r"a\.trc:8:1  'two' is no number"):
        read_trc(path)
    path.write_text(good.replace("DataRate", "Rate"))
    with pytest.raises(RecordingError, match=r"a\.trc:3  no DataRate above zero"):
        read_trc(path)


def test_a_trc_without_markers(tmp_path):
    write_trc(tmp_path / "a.trc", [], np.empty((2, 0, 3)), 30)
    with pytest.raises(RecordingError, match=r"a\.trc:4  no marker is named"):
        read_trc(tmp_path / "a.trc")
