"""Rows of one array: what zarr reads of them, and damage that is noticed."""

from functools import partial

import numpy as np
import pytest
import zarr

from mocapflow.storage.rows import Corrupted, Rows

VALUES = np.random.default_rng(0).normal(size=(6, 50))


def flipped(data, at):
    """Return bytes of which one has another last bit."""
    changed = bytearray(data)
    changed[at] ^= 1
    return bytes(changed)


def test_rows_are_plain_zarr(tmp_path):
    made = Rows.create(tmp_path / "a", (4, 3, 2), "float64", np.nan, ("T", "x", "y"), {"unit": "m"})
    values = np.random.default_rng(0).normal(size=(3, 2))
    made.write(2, values)
    read = zarr.open_array(str(tmp_path / "a"), mode="r")
    assert np.array_equal(read[2], values)
    assert np.isnan(read[1]).all()
    with pytest.raises(Corrupted, match="row 1 of .* is missing"):
        made.read(1)
    zarr.open_array(str(tmp_path / "a"), mode="r+")[1] = 2 * values
    assert np.array_equal(Rows(tmp_path / "a").read(1), 2 * values)
    made.resize(6)
    assert zarr.open_array(str(tmp_path / "a"), mode="r").shape == (6, 3, 2)


@pytest.mark.parametrize(
    "damage", [lambda data: data[:-3], lambda data: b"", *(partial(flipped, at=place) for place in (0, 9, 200, -1))]
)
def test_a_damaged_row_is_noticed(tmp_path, damage):
    made = Rows.create(tmp_path / "a", VALUES.shape, "float64", np.nan, ("T", "x"), {})
    made.write(2, VALUES[2])
    np.testing.assert_array_equal(Rows(tmp_path / "a").read(2), VALUES[2])
    file = tmp_path / "a" / "c.2.0"
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(Corrupted, match="row 2 of .* is damaged"):
        made.read(2)


@pytest.mark.parametrize("width", [49, 51])
def test_a_row_of_another_length_is_damage(tmp_path, width):
    for name, length in (("a", 50), ("b", width)):
        Rows.create(tmp_path / name, (6, length), "float64", np.nan, ("T", "x"), {}).write(2, np.ones(length))
    (tmp_path / "b" / "c.2.0").replace(tmp_path / "a" / "c.2.0")
    with pytest.raises(Corrupted, match="row 2 of .* is damaged"):
        Rows(tmp_path / "a").read(2)
    with pytest.raises(AssertionError):
        Rows(tmp_path / "a").write(3, np.ones(width))


@pytest.mark.parametrize(("dtype", "fill"), [("float64", np.nan), ("int16", -1), ("bool", 0), ("uint8", 7)])
def test_zarr_reads_blocks_and_the_rest_as_fill(tmp_path, dtype, fill):
    values = (10 * VALUES).astype(dtype)
    Rows.create(tmp_path / "a", (9, 50), dtype, fill, ("frame", "x"), {"unit": "m"}, block=4).write_block(0, values[:4])
    rows = Rows(tmp_path / "a")
    rows.write_block(1, values[4:])
    rows.resize(11)
    read = zarr.open_array(tmp_path / "a", mode="r")
    assert (read.shape, read.dtype, read.attrs["unit"]) == ((11, 50), np.dtype(dtype), "m")
    np.testing.assert_array_equal(read[:6], values)
    np.testing.assert_array_equal(read[6:], np.full((5, 50), fill).astype(dtype))
    assert Rows(tmp_path / "a").shape == (11, 50)


def test_a_new_array_has_no_rows_of_an_older_one_in_its_place(tmp_path):
    for values in (VALUES, VALUES[:3]):
        made = Rows.create(tmp_path / "a", values.shape, "float64", np.nan, ("T", "x"), {})
        with pytest.raises(Corrupted, match="row 2 of .* is missing"):
            made.read(2)
        made.write(2, values[2])


@pytest.mark.parametrize(
    ("text", "told"),
    [('{"shape": [3]}', "is no array of frames"), ("{", r"zarr\.json is damaged"), ("[]", r"zarr\.json is damaged")],
)
def test_what_is_no_array_is_said(tmp_path, text, told):
    (tmp_path / "zarr.json").write_text(text)
    with pytest.raises(Corrupted, match=told):
        Rows(tmp_path)
