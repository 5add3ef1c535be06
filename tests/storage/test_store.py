"""Artifacts: what goes in comes back, for us and for others; locks; damage; a full disk."""

import errno
import json
import os
import re
import shutil
import socket
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import zarr

from mocapflow import records
from mocapflow.assets import Background
from mocapflow.data import Frame, Past, Pose, Silhouette, Start
from mocapflow.errors import ComponentFailed, MocapflowError, ShapeError, StoreError
from mocapflow.io.atomic import PART
from mocapflow.records import F64, record
from mocapflow.running.execution import Execution
from mocapflow.series import BLOCK, Series, Wide
from mocapflow.storage import locks, rows
from mocapflow.storage.artifacts import remove
from mocapflow.storage.growing import SEEN
from mocapflow.storage.packing import FINE, match_row, quantised
from mocapflow.storage.rows import Corrupted, Rows
from mocapflow.storage.store import Store
from tests.fixtures.stores import actions, run_tiny, same, the_track
from tests.fixtures.tiny_plugin import TinyMatcher, tiny_body

RECIPE = {"component": {"name": "some"}}


@pytest.fixture
def store(tmp_path):
    made = Store(tmp_path / "store.zarr")
    made.create()
    return made


def put(store, value, key="1" * 32):
    store.save(store.begin("some", key, RECIPE), value)
    return store.find(key)


def equal(one, other):
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        assert one.shape == other.shape
        assert one.tobytes() == other.tobytes()
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            equal(a, b)
    elif isinstance(one, dict):
        assert list(one) == list(other)
        equal(tuple(one.values()), tuple(other.values()))
    elif hasattr(one, "__dataclass_fields__"):
        for name in one.__dataclass_fields__:
            equal(getattr(one, name), getattr(other, name))
    else:
        assert one == other


@dataclass
class Noted:
    """As a plugin may write it: its types are types, not text."""

    where: Path
    twin: Path | None = None
    more: tuple[Path, ...] = ()


@record
class Curve:
    """A record with a field called as the store calls the array of a group."""

    values: "F64" = records.array("T", unit="rad")


@record
class Long:
    """A record of more rows than a chunk has: `few` are read at once, `many` when they are asked for."""

    few: "F64" = records.array("T", unit="rad")
    many: "Wide" = records.array("T", 2, unit="rad")


@dataclass
class Held:
    """Anything, within anything."""

    what: object


POSE = Pose(root=np.eye(4), angles=np.array([0.1, np.nan]))
VALUES = {
    "start": Start(pose=POSE, parameters=np.empty(0)),
    "open start": Start(pose=POSE, parameters=np.zeros(2), others=(POSE, POSE)),
    "background": Background(
        mean=(np.ones((2, 3, 3), "f4"), np.zeros((4, 5, 3), "f4")), spread=(np.ones((1, 1, 3), "f4"),)
    ),
    "body": tiny_body(1.0),
    "paths": Noted(where=Path("a"), twin=Path("b"), more=(Path("c"),)),
    "records with values": Held((Curve(values=np.arange(3.0)), Curve(values=np.arange(2.0)))),
    "values in a mapping": Held({"knee": {"values": np.arange(3.0)}}),
    "tuples in a mapping": Held({"range": (1, 2.5, ("a", None, True))}),
    "mapping": Past(moments=(), appearance={"a/b": np.ones(3), "c": np.ones((2, 2))}),
}


@pytest.mark.parametrize("kind", VALUES)
def test_records_come_back_as_they_were(store, kind):
    value = VALUES[kind]
    made = put(store, value)
    assert made.complete
    equal(value, store.load(made))


@pytest.mark.parametrize(("other", "kind"), [(3, "int"), ("text", "str")])
def test_numbers_and_text_do_not_go_beside_arrays(store, other, kind):
    mixed = Past(appearance={"mean": np.ones(3), "count": other})
    with pytest.raises(ShapeError, match=f"appearance: 'count' is {kind}, beside arrays or records\n.*its own"):
        put(store, mixed)


@pytest.mark.parametrize(
    ("what", "told"),
    [
        (np.int64(3), "Held.what holds int64, which can't be kept\n.*Python's numbers"),
        (np.ones(2), "Held.what holds ndarray, which .*\n.*arrays declared with"),
        ({"seen": {1, 2}}, "Held.what holds set"),
        ({1: "one"}, "Held.what holds dict"),
        ({"": np.ones(2)}, "what: nothing can be kept under the key ''\n.*no two"),
        ({1: np.ones(2)}, "under the key 1"),
        ({"a": np.ones(2), "a/values": np.ones(2)}, "under the key 'a/values'"),
    ],
)
def test_what_cannot_be_kept_is_told(store, what, told):
    with pytest.raises(ShapeError, match=told):
        put(store, Held(what))


def test_a_bare_array_that_is_missing_is_damage(store):
    made = put(store, VALUES["background"])
    shutil.rmtree(made.path / "mean" / "0" / "values")
    with pytest.raises(Corrupted):
        store.load(made)


def test_plain_values_that_are_no_mapping_are_damage(store):
    made = put(store, VALUES["background"])
    meta = json.loads((made.path / "zarr.json").read_text())
    meta["attributes"]["plain"] = "floor"
    (made.path / "zarr.json").write_text(json.dumps(meta))
    with pytest.raises(Corrupted):
        store.load(made)


def test_a_record_says_how_its_types_are_to_be_written():
    with pytest.raises(ShapeError, match="knee: begin the module of a record with `from __future__"):

        @record
        class Knees:
            knee: F64 = records.array("T", unit="rad")

        Knees(knee=np.zeros(3))


def test_arrays_say_their_axes_and_units(store):
    group = zarr.open_group(str(put(store, tiny_body(1.0)).path), mode="r")
    assert group["twists"].metadata.dimension_names == ("D", "twists_1")
    assert group["vertices"].attrs["unit"] == "m, at rest"


def test_every_array_of_a_store_says_its_axes_and_unit(tmp_path, path):
    run_tiny(path, tmp_path, "stages.track.keep=trace", frames=3)
    nodes = dict(zarr.open_group(str(tmp_path / "store.zarr"), mode="r").members(max_depth=None))
    arrays = {name.partition("/")[2]: node for name, node in nodes.items() if isinstance(node, zarr.Array)}
    assert {"trace", "live/rows", "match_count", "mean/0/values", "pose/root", "raw_angles"} <= set(arrays)
    for name, array in arrays.items():
        axes = array.metadata.dimension_names
        assert axes is not None and all(axes), name
        assert len(set(axes)) == len(axes), name
        assert not any(axis.startswith("axis_") for axis in axes), name
        assert array.attrs.get("unit"), name


@pytest.mark.usefixtures("ran")
@pytest.mark.long
def test_a_track_is_read_by_xarray(tmp_path):
    xarray = pytest.importorskip("xarray")
    (folder,) = (tmp_path / "store.zarr").glob("track-*")
    data = xarray.open_zarr(str(folder), consolidated=False, zarr_format=3)
    assert dict(data.sizes) | {"T": 12, "D": 2, "W": 4, "Q": 1, "C": 2, "K": 8} == dict(data.sizes)
    assert data["angles"].attrs["unit"] == "rad"
    assert np.array_equal(data["angles"].values, the_track(tmp_path).angles)


def test_a_track_has_named_arrays_whose_equal_axes_are_equally_long(tmp_path, path):
    run_tiny(path, tmp_path, frames=7)
    run_tiny(path, tmp_path)
    (folder,) = (tmp_path / "store.zarr").glob("track-*")
    group, lengths = zarr.open_group(str(folder), mode="r"), {}
    for name, array in group.arrays():
        names = array.metadata.dimension_names
        assert len(set(names)) == len(names), name
        for axis, length in zip(names, array.shape, strict=True):
            assert lengths.setdefault(axis, length) == length, (name, axis)
    assert {"root", "angles", "covariance", "cloth", "usable", "seconds"} <= set(group.array_keys())
    assert group["cloth"].chunks == (1, 4, 3)
    assert group["silhouettes/person/cam01"].metadata.dimension_names == ("T", "y", "x")
    assert group["silhouettes/person/cam01"].attrs["unit"] == "1/8 px"


@pytest.mark.parametrize("damaged", [False, True])
@pytest.mark.long
def test_others_read_the_store_without_complaint(tmp_path, path, damaged):
    xarray = pytest.importorskip("xarray")
    run_tiny(path, tmp_path, frames=5)
    store = tmp_path / "store.zarr"
    if damaged:
        for group in store.glob("*-*"):
            damage_zarr_json(group)
            (group / f"{PART}0.json").touch()  # as a machine leaves it that stops at a commit
        run_tiny(path, tmp_path, frames=5)
    whole = zarr.open_group(str(store), mode="r")
    names = {name.partition("-")[0] for name, _ in whole.members(max_depth=None) if "/" not in name}
    assert names == {"background", "start", "track", "smooth", ".state"}
    assert "track-" in str(whole.tree())
    xarray.open_zarr(str(store), consolidated=False).load()
    tree = xarray.open_datatree(str(store), engine="zarr", consolidated=False).load()
    (track,) = (name for name in tree.children if name.startswith("track-"))
    assert tree[track]["angles"].shape == (5, 2)


def test_what_a_stopped_commit_leaves_is_gone_when_the_track_goes_on(tmp_path, path):
    run_tiny(path, tmp_path, frames=5)
    (group,) = (tmp_path / "store.zarr").glob("track-*")
    (group / f"{PART}0.json").touch()
    run_tiny(path, tmp_path)
    assert not list(group.glob(f"{PART}*"))


def test_attributes_are_written_alike_in_every_locale(tmp_path):
    value = {"unit": "px^-2 or px⁻²", "file": "caméra \udcff.png"}  # a name that is no UTF-8 comes so from the system
    rows.write_json(tmp_path / "zarr.json", value)
    assert (tmp_path / "zarr.json").read_bytes().isascii()
    assert rows.read_json(tmp_path / "zarr.json") == value


def test_silhouettes_keep_their_mask_and_an_eighth_of_a_pixel():
    distance = np.random.default_rng(1).uniform(-20, 20, (64, 80)).astype(np.float32)
    distance[0, :4] = [0.01, -0.01, 0.0, 0.06]
    back = quantised(Silhouette(camera=0, layer="person", distance=distance)) / np.float32(FINE)
    assert np.array_equal(back > 0, distance > 0)
    near = np.abs(distance) < 15
    assert np.abs(back - distance)[near].max() <= 1 / FINE


def test_matches_come_back():
    frame = Frame(index=3, time=0.0, images=(), usable=np.zeros(0, bool))
    surface = type("S", (), {"vertices": np.zeros((5, 3))})
    matches = TinyMatcher().match(frame, None, surface, None, None, None)
    packed = match_row(matches)
    parts = np.split(packed[: len(matches.weight)], [1, 3, 5, 6], axis=1)
    for name, part in zip(("camera", "pixel", "direction", "vertex", "weight"), parts, strict=True):
        assert np.array_equal(part.squeeze(1) if part.shape[1] == 1 else part, getattr(matches, name))
    assert not packed[len(matches.weight) :].any()


@pytest.mark.usefixtures("ran")
def test_what_was_seen_can_be_read_back(tmp_path):
    store = Store(tmp_path / "store.zarr")
    (found,) = [a for a in store.artifacts() if a.path.name.startswith("track-")]
    group = zarr.open_group(str(found.path), mode="r")
    for camera in ("cam01", "cam02"):
        steps = group[f"silhouettes/person/{camera}"][6]
        assert steps.shape == (16, 24) and steps.max() > 0 > steps.min()
    assert group["match_count"][6] == 100
    assert (group["matches/128"][6, :, 6] > 0).sum() == 100


def test_an_unfinished_result_is_none(store):
    store.begin("some", "1" * 32, RECIPE)
    assert not store.find("1" * 32).complete
    put(store, VALUES["start"])  # takes its place
    assert len(store.artifacts()) == 1


def test_what_is_compared_with_is_the_newest_of_the_same_stage(store):
    for digit, label, created in (("1", "some", "3"), ("2", "some", "1"), ("3", "other", "4"), ("4", "some", "5")):
        made = put(store, VALUES["start"], key=digit * 32).path
        meta = rows.read_json(made / "zarr.json")
        rows.write_json(made / "zarr.json", meta | {"attributes": meta["attributes"] | {"created": created}})
        made.rename(made.with_name(f"{label}-{digit * 12}"))
    assert store.nearest("some", RECIPE, but="4" * 32).key == "1" * 32
    assert store.nearest("gone", RECIPE, but="4" * 32).key == "3" * 32
    assert store.nearest("some", {"component": {"name": "another"}}, but="") is None


def test_a_folder_with_other_things_becomes_no_store(tmp_path):
    empty, papers = tmp_path / "empty", tmp_path / "papers"
    for folder, name in ((empty, ".hidden"), (papers, "letter.txt")):
        folder.mkdir()
        (folder / name).write_text("")
    Store(empty).create()
    told = r"this folder is no store: it holds letter.txt(.|\n)*--store .*store\.zarr"
    with pytest.raises(MocapflowError, match=told) as caught:
        Store(papers).create()
    assert caught.value.exit_status == 2


def test_a_store_elsewhere_on_the_net_is_refused():
    with pytest.raises(MocapflowError, match="has to be a folder") as caught:
        Store(Path("s3://bucket/store"))
    assert caught.value.exit_status == 2


# ---- damage


def damage_zarr_json(group):
    (group / "zarr.json").write_text('{"attributes": {"key": ')


def lose_attributes(group):
    meta = rows.read_json(group / "zarr.json")
    rows.write_json(group / "zarr.json", meta | {"attributes": {}})


def damage_array_json(group):
    (group / "angles" / "zarr.json").write_text("{")


def damage_chunk(group):
    (file,) = (file for file in (group / "angles").rglob("*") if file.is_file() and file.name != "zarr.json")
    file.write_bytes(file.read_bytes()[:-5])


def remove_chunk(group):
    (file,) = (file for file in (group / "angles").rglob("*") if file.is_file() and file.name != "zarr.json")
    file.unlink()


def remove_array(group):
    (group / "root").rename(group.parent.parent / "gone")


def without_smooth(folder):
    """Return the group of a track that somebody wants to read."""
    (smooth,) = (folder / "store.zarr").glob("smooth-*")
    smooth.rename(folder / "smooth")
    (group,) = (folder / "store.zarr").glob("track-*")
    return group


def remove_rows(group):
    remove_chunk(group)
    (group / "live" / "rows" / "c.3.0").unlink()


@pytest.mark.parametrize("damage", [damage_zarr_json, lose_attributes, remove_rows])
def test_a_damaged_group_is_set_aside_and_made_anew(tmp_path, ran, damage):
    whole, group = the_track(tmp_path), without_smooth(tmp_path)
    damage(group)
    _, lines = run_tiny(ran, tmp_path)
    (warning,) = [line for line in lines if "damaged and made" in line]
    assert warning.startswith(f"warning: {group.name} is damaged and made anew: ")
    (aside,) = Store(tmp_path / "store.zarr").aside()
    assert aside.name.startswith(f"damaged-{group.name}-")
    assert warning.endswith(f"(kept as .state/{aside.name})")
    assert same(whole, the_track(tmp_path))


@pytest.mark.parametrize("damage", [damage_array_json, damage_chunk, remove_chunk, remove_array])
@pytest.mark.long
def test_damaged_arrays_of_a_track_are_written_anew_from_its_frames(tmp_path, ran, damage):
    whole, group = the_track(tmp_path), without_smooth(tmp_path)
    damage(group)
    _, lines = run_tiny(ran, tmp_path)
    assert any(line.startswith(f"warning: {group.name} is damaged and written anew from its frames") for line in lines)
    assert not any(line.startswith("track: 1") for line in lines)  # no frame is tracked again
    assert not Store(tmp_path / "store.zarr").aside()
    assert same(whole, the_track(tmp_path))


def test_a_track_whose_arrays_are_damaged_goes_on_from_its_frames(tmp_path, path, whole):
    run_tiny(path, tmp_path, frames=5)
    (group,) = (tmp_path / "store.zarr").glob("track-*")
    damage_array_json(group)
    _, lines = run_tiny(path, tmp_path)
    assert any(line.startswith(f"warning: {group.name} is damaged and written anew from its frames") for line in lines)
    assert [line for line in lines if "going on after" in line][-1] == "track: going on after 12 frames"
    assert same(the_track(whole), the_track(tmp_path))


@pytest.mark.parametrize("name", ["angles", "doubted"])  # doubted: zeros, which zarr by itself does not write
def test_a_chunk_that_is_missing_is_no_zeros(tmp_path, ran, name):
    made = json.loads((tmp_path / "out" / "results.json").read_text())["angles"]
    (smooth,) = (tmp_path / "store.zarr").glob("smooth-*")
    (chunk,) = (path for path in (smooth / name / "c").rglob("*") if path.is_file())
    chunk.unlink()
    _, lines = run_tiny(ran, tmp_path)
    assert any(re.search(f"{smooth.name} is damaged and made anew: .* chunk 0 of {name} is missing", x) for x in lines)
    assert json.loads((tmp_path / "out" / "results.json").read_text())["angles"] == made


def test_a_damaged_result_that_another_run_makes_anew_is_left_alone(tmp_path, ran, monkeypatch):
    real = Store.load

    def load(self, artifact, frames=None):
        monkeypatch.setattr(Store, "load", real)  # the other is done before this one can write
        raise Corrupted("damaged")

    monkeypatch.setattr(Store, "load", load)
    summary, lines = run_tiny(ran, tmp_path)  # `export` reads it
    assert actions(summary)["smooth"] == "hit"
    assert not [line for line in lines if "damaged" in line]
    assert not Store(tmp_path / "store.zarr").aside()


def test_a_result_that_another_run_left_damaged_is_made_anew(tmp_path, ran, monkeypatch):
    (group,) = (tmp_path / "store.zarr").glob("smooth-*")
    damage_chunk(group)
    real = Execution._find
    monkeypatch.setattr(Execution, "_find", lambda self, step: None if step.label == "smooth" else real(self, step))
    summary, lines = run_tiny(ran, tmp_path)  # the other is done when this one may write
    assert actions(summary)["smooth"] == "run"
    assert sum("is damaged and made anew" in line for line in lines) == 1


@pytest.mark.usefixtures("ran")
def test_what_is_wide_stays_in_the_store_and_is_missed_when_it_is_removed(tmp_path):
    kept = Store(tmp_path / "store.zarr")
    (found,) = [a for a in kept.artifacts() if a.path.name.startswith("track-")]
    track = kept.load(found, 5)
    assert isinstance(track.cloth, Series) and track.cloth.shape == (5, 4, 3)
    assert np.isfinite(track.covariance[4]).all()
    other = kept.load(found)
    remove(found.path)
    with pytest.raises(Corrupted, match="cloth of .* can't be read back"):
        other.cloth[0]


@pytest.fixture
def long_record(store):
    few = np.arange(2.5 * BLOCK)
    many = np.outer(few, [1, -1])
    return put(store, Long(few=few, many=Series(many.shape, lambda numbers: many[numbers])))


@pytest.mark.parametrize("wanted", [None, 3, BLOCK, BLOCK + 1])
def test_what_is_longer_than_a_chunk_comes_back_block_by_block(store, long_record, wanted):
    made, few = store.load(long_record, wanted), np.arange(2.5 * BLOCK)[:wanted]
    np.testing.assert_array_equal(made.few, few)
    np.testing.assert_array_equal(made.many[:], np.outer(few, [1, -1]))
    mixed = np.arange(len(few))[::-2]
    np.testing.assert_array_equal(made.many[mixed], np.outer(few[mixed], [1, -1]))


@pytest.mark.parametrize("name", ["few/c/2", "many/c/2/0"])
def test_a_chunk_that_is_missing_at_the_end_is_damage_for_who_reads_so_far(store, long_record, name):
    (long_record.path / name).unlink()
    assert len(store.load(long_record, 2 * BLOCK).few) == 2 * BLOCK
    for wanted in (2 * BLOCK + 1, None):
        with pytest.raises(Corrupted, match=f"chunk 2 of {name.partition('/')[0]} is missing"):
            store.load(long_record, wanted)


@pytest.mark.parametrize("name", ["few", "many"])
def test_a_chunk_that_is_removed_while_it_is_read_is_no_zeros(store, long_record, monkeypatch, name):
    read = zarr.Array.__getitem__

    def removed(self, which):
        shutil.rmtree(long_record.path / name / "c")
        monkeypatch.setattr(zarr.Array, "__getitem__", read)
        return read(self, which)

    def when_it_is_its_turn(self, which):
        return removed(self, which) if self.path == name else read(self, which)

    monkeypatch.setattr(zarr.Array, "__getitem__", when_it_is_its_turn)
    with pytest.raises(Corrupted, match=f"chunk 0 of {name} is missing"):
        store.load(long_record)


def test_fewer_rows_than_there_should_be_are_damage(store, long_record):
    with pytest.raises(Corrupted, match="few has 160 rows of 161"):
        store.load(long_record, 161)
    many = long_record.path / "many" / "zarr.json"
    rows.write_json(many, rows.read_json(many) | {"shape": [159, 2]})
    with pytest.raises(Corrupted, match="many has 159 rows of 160"):
        store.load(long_record, 160)


def cut_back(group, frames):
    """Leave a finished track as a run leaves it that is killed after so many frames."""
    meta = rows.read_json(group / "zarr.json")
    attributes = {name: value for name, value in meta["attributes"].items() if name != "sealed"}
    rows.write_json(group / "zarr.json", meta | {"attributes": attributes | {"frames_done": frames, "complete": False}})


@pytest.mark.parametrize(
    ("lost", "told"),
    [
        ("live/rows/c.5.*", "row 5 of .*/live/rows is missing"),
        ("cloth/c.4.*", "row 4 of .*/cloth is missing"),
        ("live/appearance-*/c.*", "row 1 of .*/live/appearance-[0-9]+ is missing"),
        (None, "the appearance of frame 5 is missing in .*"),  # those of frames 10 and 11 are there
    ],
)
@pytest.mark.long
def test_a_half_done_track_whose_files_are_missing_is_made_anew(tmp_path, ran, lost, told):
    whole = the_track(tmp_path)
    (group,) = (tmp_path / "store.zarr").glob("track-*")
    cut_back(group, 6)
    for file in group.glob(lost) if lost else ():
        file.unlink()
    _, lines = run_tiny(ran, tmp_path)
    assert any(re.search(f"is damaged and made anew: {told}", line) for line in lines), lines
    assert same(whole, the_track(tmp_path))


@pytest.mark.parametrize(
    ("done", "told"),
    [
        (8, "damaged and written anew from its frames: frame has 4 rows of 8"),
        *((done, "damaged and made anew: its description can't be read") for done in ("x", -1, True, None)),
    ],
)
@pytest.mark.long
def test_a_count_of_frames_that_is_not_true(tmp_path, path, done, told):
    run_tiny(path, tmp_path, frames=4)
    (group,) = (tmp_path / "store.zarr").glob("track-*")
    meta = rows.read_json(group / "zarr.json")
    rows.write_json(group / "zarr.json", meta | {"attributes": meta["attributes"] | {"frames_done": done}})
    _, lines = run_tiny(path, tmp_path, frames=8)
    assert any(told in line for line in lines), lines
    assert len(the_track(tmp_path).frame) == 8


@pytest.fixture
def unsafe(monkeypatch):
    """The files of a track that a power loss would take: written, but not known to be on the drive."""
    found, real = {}, (Path.write_bytes, Path.write_text, os.fsync)

    def written(kind):
        def write(self, *args, **kwargs):
            size = real[kind](self, *args, **kwargs)
            if "track-" in str(self):
                found[self.stat().st_ino] = str(self)
            return size

        return write

    def fsync(number):
        real[2](number)
        found.pop(os.fstat(number).st_ino, None)

    monkeypatch.setattr(Path, "write_bytes", written(0))
    monkeypatch.setattr(Path, "write_text", written(1))
    monkeypatch.setattr(os, "fsync", fsync)
    return found


def test_a_frame_is_on_the_drive_before_it_counts(tmp_path, path, monkeypatch, unsafe):
    """What was seen of it, which no run goes on from, before the track is complete."""
    left, seen, replace = [], [], Path.replace

    def counted(self, target):
        if Path(target).parent.name.startswith("track-"):
            seen.append(sum(any(f"/{name}/" in file for name in SEEN) for file in unsafe.values()))
            left.append(len(unsafe) - seen[-1])
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", counted)
    run_tiny(path, tmp_path, "stages.track.keep=trace")
    assert left == [0] * 14  # begun, twelve frames, sealed
    assert (seen[0], seen[-1]) == (0, 0) and seen[1] > 0


def test_a_result_is_on_the_drive_before_it_is_complete(store, monkeypatch):
    synced, real = set(), os.fsync
    monkeypatch.setattr(os, "fsync", lambda number: (synced.add(os.fstat(number).st_ino), real(number)))
    made = put(store, tiny_body(1.0))
    files = {file for file in made.path.rglob("*") if file.is_file()} - {made.path / "zarr.json"}
    assert len(files) > 10
    assert {file.stat().st_ino for file in files} <= synced


# ---- a store that can't be written


def test_a_full_store_says_so_and_keeps_the_frames(tmp_path, path, monkeypatch, whole):
    real, left = Rows.write, [23]

    def write(self, row, values, **how):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(self, row, values, **how)

    monkeypatch.setattr(rows.Rows, "write", write)
    with pytest.raises(StoreError) as raised:
        run_tiny(path, tmp_path)
    store = tmp_path / "store.zarr"
    assert str(raised.value) == (
        f"the store {store} is full\n       free some space, or name another store\n"
        "       frames 0–2 are saved; run the same command to continue at 3"
    )
    assert raised.value.exit_status == 1
    monkeypatch.undo()
    _, lines = run_tiny(path, tmp_path)
    assert "track: going on after 3 frames" in lines
    assert same(the_track(whole), the_track(tmp_path))


def test_an_unwritable_store_says_so(tmp_path, path, monkeypatch):
    def refuse(self, *args, **kwargs):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(StoreError) as raised:
        run_tiny(path, tmp_path)
    assert str(raised.value) == (
        f"can't write to the store {tmp_path / 'store.zarr'}: Permission denied\n"
        "       make it writable, or name another store"
    )


def test_a_file_in_the_place_of_the_store(tmp_path, path):
    (tmp_path / "store.zarr").write_text("")
    with pytest.raises(MocapflowError, match="can't write to the store") as caught:
        run_tiny(path, tmp_path)
    assert caught.value.exit_status == 2


# ---- locks


def test_two_may_make_the_same_store_at_once(tmp_path):
    path = tmp_path / "zarr.json"
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda k: rows.write_json(path, {"by": k}), range(400)))
    assert "by" in rows.read_json(path)
    assert os.listdir(tmp_path) == ["zarr.json"]


def test_two_runs_at_once_share_the_work(tmp_path, path, monkeypatch):
    monkeypatch.setenv("TINY_SLOW", "0.01")
    said, failed = {}, []

    def go(name):
        try:
            (tmp_path / name).mkdir()
            (tmp_path / name / "store.zarr").symlink_to(tmp_path / "store.zarr")
            said[name] = run_tiny(path, tmp_path / name)
        except BaseException as error:
            failed.append(error)

    (tmp_path / "store.zarr").mkdir()
    threads = [threading.Thread(target=go, args=(name,)) for name in ("one", "two")]
    for thread in threads:
        thread.start()
        time.sleep(0.2)
    for thread in threads:
        thread.join()
    assert not failed
    cached = [[s["cached"] for s in summary.stages if s["label"] == "track"] for summary, _ in said.values()]
    assert sorted(cached) == [[False], [True]]
    waited = [line for _, lines in said.values() for line in lines if "waiting for process" in line]
    assert waited
    assert f"process {os.getpid()} on {socket.gethostname()}, which is making it" in waited[0]
    assert same(the_track(tmp_path / "one"), the_track(tmp_path / "two"))
    assert not list((tmp_path / "store.zarr" / ".state").glob("*.lock"))


@pytest.mark.parametrize(
    ("holder", "age", "stale"),
    [
        ({"pid": 2**22 + 1, "host": socket.gethostname()}, 0, True),  # no such process
        ({"pid": os.getpid(), "host": socket.gethostname(), "born": "1"}, 0, True),  # the number is used again
        ({"pid": os.getpid(), "host": socket.gethostname(), "born": locks._born(os.getpid())}, 1e6, False),
        ({"pid": 2**22 + 1, "host": socket.gethostname(), "space": "pid:[1]"}, 0, False),  # in a container
        ({"pid": 1, "host": "elsewhere"}, 0, False),
        ({"pid": 1, "host": "elsewhere"}, 1e6, True),  # no heartbeat
        (None, 1e6, True),  # half written
    ],
)
def test_stale_locks_are_taken_over_with_a_message(tmp_path, monkeypatch, holder, age, stale):
    path, lines = tmp_path / "x.lock", []
    path.write_text("{" if holder is None else json.dumps(holder))
    os.utime(path, (time.time() - age,) * 2)
    monkeypatch.setattr(locks.time, "sleep", lambda _: path.unlink())  # the other one has finished
    locks.acquire(path, "track-12", lines.append).release()
    assert ("taking over" if stale else "waiting for") in lines[0]
    assert len(lines) == 1
    assert not path.exists()


def test_a_full_drive_leaves_no_lock_that_nobody_holds(tmp_path, monkeypatch):
    def full(self, text):
        self.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="No space"):
        locks.acquire(tmp_path / "x.lock", "track-12", print)
    assert not (tmp_path / "x.lock").exists()


def test_a_lock_is_held_as_long_as_its_run_is_alive(store):
    key, lock = "1" * 32, store.path / ".state" / f"{'1' * 12}.lock"
    assert not store.busy(key)
    with store.writer(key, "track-12", print):
        assert store.busy(key)
    lock.write_text(json.dumps({"pid": 2**22 + 1, "host": socket.gethostname()}))  # it was killed
    assert not store.busy(key)


def test_nobody_begins_to_write_what_is_being_removed(store, monkeypatch):
    made = put(store, VALUES["start"])
    aside, written = Store.set_aside, threading.Event()

    def write():
        with store.writer(made.key, "some", print):
            written.set()

    writer = threading.Thread(target=write, daemon=True)

    def slow(self, path):
        writer.start()
        assert not written.wait(0.3)
        return aside(self, path)

    monkeypatch.setattr(Store, "set_aside", slow)
    assert store.drop(made.path) and store.find(made.key) is None
    writer.join(5)
    assert written.is_set() and not store.aside()
    assert store.drop(made.path)  # gone already


def test_a_lock_is_as_old_as_the_drive_says_whatever_the_time_is_here(tmp_path, monkeypatch):
    path, lines = tmp_path / "x.lock", []
    path.write_text(json.dumps({"pid": 1, "host": "elsewhere"}))
    monkeypatch.setattr(locks.time, "time", lambda: path.stat().st_mtime + 3600)
    looks = iter((path.exists, path.unlink))
    monkeypatch.setattr(locks.time, "sleep", lambda _: next(looks)())
    locks.acquire(path, "track-12", lines.append).release()
    assert lines == ["track-12: waiting for process 1 on elsewhere, which is making it"]


def test_the_drive_s_time_is_that_of_now_not_of_when_the_locks_were_last_looked_at(tmp_path, monkeypatch):
    path, lines = tmp_path / "x.lock", []
    monkeypatch.setattr(locks.time, "sleep", lambda _: path.unlink())  # who waits would wait for ever
    path.write_text(json.dumps({"pid": 1, "host": "elsewhere"}))
    (tmp_path / locks.GUARD).touch()
    for file in (path, tmp_path / locks.GUARD):
        os.utime(file, (1, 1))
    locks.acquire(path, "track-12", lines.append).release()
    assert lines == ["track-12: taking over from process 1 on elsewhere, which ended without finishing"]


def test_a_lock_that_is_taken_over_is_another_file(tmp_path):
    """That of somebody else may be removed by all who may write to the folder, but not be written."""
    path = tmp_path / "x.lock"
    path.write_text(json.dumps({"pid": 2**22 + 1, "host": socket.gethostname()}))
    os.link(path, tmp_path / "theirs")
    before = path.read_text()
    locks.acquire(path, "track-12", print).release()
    assert (tmp_path / "theirs").read_text() == before


def test_of_two_locks_of_one_process_each_knows_its_own(tmp_path):
    first = locks.acquire(tmp_path / "x.lock", "track-12", print)
    (tmp_path / "x.lock").unlink()
    second = locks.acquire(tmp_path / "x.lock", "track-12", print)
    with pytest.raises(StoreError, match="another run took over track-12"):
        first.check()
    first.release()
    second.check()
    second.release()


def test_a_lock_says_whose_it_is(tmp_path, monkeypatch):
    lock = locks.acquire(tmp_path / "x.lock", "track-12", print)
    holder = json.loads((tmp_path / "x.lock").read_text())
    lock.release()
    assert locks.gone(holder) is False
    assert locks.gone(holder | {"pid": "1"}) is None
    monkeypatch.setattr(locks, "_space", lambda: "pid:[1]")  # this process is in a container, its number another's
    assert locks.gone(holder) is None


def test_a_process_is_told_by_its_start_from_others_of_its_number(monkeypatch):
    times = " ".join(map(str, range(4, 53)))  # in the place of each value its number in proc(5)
    monkeypatch.setattr(Path, "read_text", lambda self: f"7 (a) b) S {times}")
    assert locks._born(7) == "22"


def test_who_has_ended_but_is_remembered_by_its_parent_is_gone():
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as child:
        there = {**locks.myself(), "pid": child.pid, "born": locks._born(child.pid)}
        assert locks.gone(there) is False
        child.stdin.close()
        os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)  # it stays, as a zombie
        assert locks.gone(there) is True


def test_a_process_of_somebody_else_is_alive(monkeypatch):
    """Of which some machines don't tell either when it has started."""

    def refuse(*_, **__):
        raise PermissionError

    holder = locks.myself()
    monkeypatch.setattr(os, "kill", refuse)
    assert locks.gone(holder) is False
    monkeypatch.setattr(Path, "read_text", refuse)
    assert locks.gone(holder) is False


def test_a_lock_that_was_taken_over_is_noticed_before_the_next_write(tmp_path):
    lock = locks.acquire(tmp_path / "x.lock", "track-12", print)
    lock.check()
    for change in ((tmp_path / "x.lock").unlink, lambda: (tmp_path / "x.lock").write_text("another")):
        change()
        with pytest.raises(StoreError, match="another run took over track-12"):
            lock.check()
    lock.release()
    assert (tmp_path / "x.lock").exists()  # it is not ours


def test_a_store_that_is_removed_while_a_run_goes_on_is_told(store):
    with pytest.raises(StoreError, match="store.zarr is gone"), store.writer("1" * 32, "some", print) as lock:
        shutil.rmtree(store.path)
        lock.check()


def test_the_heartbeat_keeps_a_lock_fresh(tmp_path, monkeypatch):
    monkeypatch.setattr(locks, "BEAT", 0.01)
    lock = locks.acquire(tmp_path / "x.lock", "track-12", print)
    os.utime(tmp_path / "x.lock", (1, 1))
    until = time.monotonic() + 5
    while (tmp_path / "x.lock").stat().st_mtime < 2 and time.monotonic() < until:
        time.sleep(0.01)
    assert (tmp_path / "x.lock").stat().st_mtime > 2
    lock.release()
    assert not (tmp_path / "x.lock").exists()
    assert not [thread for thread in threading.enumerate() if "x.lock" in thread.name]


def beat(lock):
    """Let the heart of a lock that is released beat once."""
    waits = iter((False, True))
    lock._done = SimpleNamespace(wait=lambda _: next(waits))
    lock._beat()


def test_the_heart_of_who_has_lost_a_lock_does_not_beat_for_who_has_it(tmp_path, monkeypatch):
    path = tmp_path / "x.lock"
    lock = locks.acquire(path, "track-12", print)
    said = path.read_text()
    lock.release()
    for text, beats in (("another", False), (said, True)):
        path.write_text(text)
        os.utime(path, (1, 1))
        beat(lock)
        assert (path.stat().st_mtime > 1) is beats

    def gone(path):
        raise FileNotFoundError

    monkeypatch.setattr(os, "utime", gone)
    beat(lock)  # its thread does not end: `check` tells


def test_a_failed_run_gives_its_lock_back(tmp_path, path, monkeypatch):
    monkeypatch.setenv("TINY_RAISE_AT", "2")
    with pytest.raises(ComponentFailed):
        run_tiny(path, tmp_path)
    assert not list((tmp_path / "store.zarr" / ".state").glob("*.lock"))


@pytest.mark.parametrize("library", ["numpy", "open3d"])  # the latter makes the body of fewer faces
def test_other_versions_are_told(tmp_path, path, monkeypatch, library):
    from mocapflow.running import ledger
    from mocapflow.storage import artifacts

    real = artifacts.versions()
    run_tiny(path, tmp_path, frames=5)
    for module in (artifacts, ledger):
        monkeypatch.setattr(module, "versions", lambda: real | {library: "9.9"})
    said = f"frames 0–4 of track were made with {library} {real[library]}, now 9.9"
    for _ in range(2):  # gone on with, then all done: the mixture is still told
        summary, lines = run_tiny(path, tmp_path)
        assert f"warning: {said}" in lines
        (track,) = [stage for stage in summary.stages if stage["label"] == "track"]
        assert track["warnings"] == [said]  # in run.json, too
    for module in (artifacts, ledger):
        monkeypatch.setattr(module, "versions", lambda: real | {library: "10"})
    _, lines = run_tiny(path, tmp_path)
    assert f"warning: frames 5–11 of track were made with {library} 9.9, now 10" in lines
    _, lines = run_tiny(path, tmp_path, frames=3)  # what is not asked for is no matter
    assert [line for line in lines if "of track were made" in line] == [
        f"warning: frames 0–2 of track were made with {library} {real[library]}, now 10"
    ]
