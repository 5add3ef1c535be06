"""Paths that OpenCV would misread, or die of."""

import os
from pathlib import Path

import pytest

from mocapflow.errors import MocapflowError
from mocapflow.io.paths import for_opencv


def test_a_path_is_absolute_so_that_a_colon_names_no_protocol(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert for_opencv(Path("take:1/Müller.mp4")) == str(tmp_path / "take:1" / "Müller.mp4")


def test_a_path_that_is_not_utf_8_is_an_error_for_people():
    with pytest.raises(MocapflowError, match="holds bytes that are no UTF-8\n.*rename") as raised:
        for_opencv(Path(os.fsdecode(b"/disk/M\xfcller/cam01.mp4")))
    assert str(raised.value).encode()
