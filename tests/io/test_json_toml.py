"""Files that people type: where they can't be read."""

import pytest

from mocapflow.errors import RecordingError
from mocapflow.io.json_toml import place, read_json, read_toml


@pytest.mark.parametrize(
    ("read", "text", "message"),
    [
        (read_json, b'{"a": 1,\n "b": }', "file:2:7  not JSON: Expecting value\n       do this"),
        (read_toml, b"a = 1\nb = [1, 2\n", "file  not TOML: Unclosed array\n       do this"),
        (read_toml, b"a = 1\na = 2\n", "file:2:6  not TOML: Cannot overwrite a value\n       do this"),
        (read_json, b'{"a": 1,\n "a": 2}', "file:1:3  'a' is there more than once\n       do this"),
        (read_json, b"\xff\xfe", "file  is not UTF-8 text\n       do this"),
        (read_toml, b"\xff\xfe", "file  is not UTF-8 text\n       do this"),
    ],
)
def test_the_place_and_what_to_do(tmp_path, monkeypatch, read, text, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_bytes(text)
    with pytest.raises(RecordingError) as found:
        read((tmp_path / "file").relative_to(tmp_path), "do this")
    assert str(found.value) == message


@pytest.mark.parametrize(("read", "text"), [(read_json, b'{"a": 1}'), (read_toml, b"a = 1\n")])
def test_a_byte_order_mark_is_passed_over(tmp_path, read, text):
    (tmp_path / "file").write_bytes(b"\xef\xbb\xbf" + text)
    assert read(tmp_path / "file") == {"a": 1}


@pytest.mark.parametrize("kind", ["brackets", "digits"])
def test_json_that_no_reader_takes(tmp_path, kind):
    (tmp_path / "file").write_text({"brackets": "[" * 200_000, "digits": "9" * 20_000}[kind])
    with pytest.raises(RecordingError, match="this JSON can't be read: "):
        read_json(tmp_path / "file")


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(RecordingError, match="can't be read: No such file"):
        read_json(tmp_path / "file")


def test_the_place_of_a_name(tmp_path):
    file = tmp_path / "file"
    file.write_text('{"knee_left": 1,\n "knee_l": [1, 2]}\n[knee_r]\n')
    assert place(file, "knee_l") == f"{file}:2:3"
    assert place(file, "knee_r") == f"{file}:3:2"
    assert place(file, "knee") == str(file)
    assert place(tmp_path / "nowhere", "knee") == str(tmp_path / "nowhere")
