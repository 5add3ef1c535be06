import errno
import os
from pathlib import Path

import pytest

from mocapflow.io.atomic import PART, atomic_write, forget_parts


def test_a_file_comes_in_one_step(tmp_path):
    path = tmp_path / "angles.csv"
    path.write_text("old")
    with atomic_write(path) as part:
        assert part.suffix == ".csv"
        part.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_the_old_file_stays_where_writing_fails(tmp_path):
    path = tmp_path / "angles.csv"
    path.write_text("old")
    with pytest.raises(OSError, match="full"), atomic_write(path) as part:
        part.write_text("ne")
        raise OSError("full")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_writer_left_is_forgotten(tmp_path):
    (tmp_path / f"{PART}0.csv").touch()
    (tmp_path / "angles.csv").touch()
    forget_parts(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["angles.csv"]


def test_an_error_names_the_file_itself(tmp_path):
    path = tmp_path / "nowhere" / "angles.csv"
    with pytest.raises(FileNotFoundError) as caught, atomic_write(path) as part:
        part.write_text("new")
    assert caught.value.filename == str(path)


def test_an_error_of_a_full_drive_names_the_file(tmp_path):
    path = tmp_path / "angles.csv"
    with pytest.raises(OSError, match="No space left") as caught, atomic_write(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # as `write` does
    assert caught.value.filename == str(path)


def test_an_error_of_a_drive_that_can_only_be_read_names_the_file(tmp_path, monkeypatch):
    def refused(path, missing_ok=False):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))  # whether it is there or not

    monkeypatch.setattr(Path, "unlink", refused)
    path = tmp_path / "angles.csv"
    with pytest.raises(OSError, match="Read-only") as caught, atomic_write(path) as part:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(part))
    assert caught.value.filename == str(path)
