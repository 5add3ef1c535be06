"""MOT and STO files there and back, and what is said of bad ones."""

import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.io.motion.mot import read_mot, write_mot


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


@pytest.mark.parametrize("line", ["inDegrees=no", "InDegrees = No", "inDegrees=no\t\t"])  # a spreadsheet adds tabs
def test_mot_in_radians_is_read_in_degrees(tmp_path, line):
    columns = {"knee_angle_l": np.full(3, np.pi / 2), "pelvis_ty": np.full(3, 0.9)}
    write_mot(tmp_path / "a.sto", columns, np.arange(3) / 10)
    said = (tmp_path / "a.sto").read_text()
    (tmp_path / "a.sto").write_text(said.replace("inDegrees=yes", line))
    read, time = read_mot(tmp_path / "a.sto")
    np.testing.assert_allclose(read["knee_angle_l"], 90, atol=1e-6)
    np.testing.assert_allclose(read["pelvis_ty"], 0.9)
    np.testing.assert_allclose(time, [0, 0.1, 0.2])


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
