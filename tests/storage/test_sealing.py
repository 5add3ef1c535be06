"""A track written out as named arrays: block by block, lengthened where it was sealed before, frames all there."""

import numpy as np
import pytest
import zarr

from mocapflow.series import BLOCK
from mocapflow.storage.growing import NUMBERS, Growing
from mocapflow.storage.rows import Corrupted, group_meta, write_json
from mocapflow.storage.sealing import seal, told

COLUMNS = {"frame": (), "angles": (2,)}
FRAMES = range(10, 10 + 3 * BLOCK)
SAID = {"cloth_vertices": 0, "step_names": [], "energy_terms": []}


@pytest.fixture
def growing(tmp_path):
    write_json(tmp_path / "zarr.json", group_meta({}))
    made = Growing(tmp_path, FRAMES, ("cam01",))
    for row, frame in enumerate(FRAMES):
        made.write_numbers(row, np.array([frame, row, -row], float))
    return made


def test_what_was_sealed_is_lengthened(tmp_path, growing):
    attributes = SAID
    for count in (BLOCK - 1, BLOCK, BLOCK + 6, 3 * BLOCK):
        attributes = seal(tmp_path, attributes, growing.array(NUMBERS), COLUMNS, FRAMES[:count])
        group = zarr.open_group(str(tmp_path), mode="r")
        assert group.attrs["complete"] is True and group.attrs["sealed"] == count
        np.testing.assert_array_equal(group["frame"][:], FRAMES[:count])
        np.testing.assert_array_equal(group["angles"][:], np.outer(np.arange(count), [1, -1]))
        assert group["cloth"].shape == (count, 0, 3)


def test_a_frame_in_the_place_of_another_is_not_sealed(tmp_path, growing):
    growing.write_numbers(3, np.array([12.0, 0.0, 0.0]))
    with pytest.raises(Corrupted, match="frames are missing"):
        seal(tmp_path, SAID, growing.array(NUMBERS), COLUMNS, FRAMES[:5])
    assert "complete" not in zarr.open_group(str(tmp_path), mode="r").attrs


def test_notes_are_told_frame_by_frame():
    notes = [(2, 6, "dark"), (4, 4, "lost")]
    assert told(notes, range(0, 9, 2)) == ["frame 2: dark", "frame 4: dark", "frame 4: lost", "frame 6: dark"]
    assert told(notes, range(0, 4, 2)) == ["frame 2: dark"]
