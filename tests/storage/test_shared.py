"""A store shared at a URL: fetched when somebody else has made it, sent when it is done, whole or not at all."""

import json
import os
from pathlib import Path

import fsspec
import numpy as np
import pytest
import zarr

from mocapflow.assets import Background
from mocapflow.commands.invocation import placed
from mocapflow.errors import ComponentFailed, MocapflowError, StoreError
from mocapflow.running.runner import plan, run
from mocapflow.storage.copies import Copies
from mocapflow.storage.rows import group_meta, write_json
from mocapflow.storage.shared import open_store
from mocapflow.storage.store import Store
from tests.fixtures.stores import actions, load, run_tiny, same, the_track, write_pipeline, write_recording

KEY = "0123456789abcdef"
MADE = {"background": "hit", "start": "hit", "track": "hit", "smooth": "hit", "export": "run"}


@pytest.fixture
def url(request, tmp_path):
    """Where copies go: in memory, unless a test asks for `file` because the kind of filesystem matters to it."""
    if getattr(request, "param", "memory") == "file":
        return (tmp_path / "far").as_uri()
    return f"memory://{tmp_path.name}/store"  # of the whole process


everywhere = pytest.mark.parametrize("url", ["memory", "file"], indirect=True)


@pytest.fixture
def path(tmp_path):
    return write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=8))


def shared(path, folder, url, *changes, frames=None):
    """Run a pipeline in a folder of its own, its results shared; return the summary and the lines reported."""
    lines = []
    pipeline = load(path, *changes, frames=frames)
    return run(pipeline, store=folder / "store.zarr", out=folder / "out", url=url, report=lines.append), lines


def copies(url):
    """The names of the copies at a URL."""
    files, root = fsspec.core.url_to_fs(url)
    return sorted(Path(p).name for p in files.ls(root, detail=False) if not p.endswith("zarr.json"))


@everywhere
@pytest.mark.long
def test_what_one_has_made_another_finds(tmp_path, path, url):
    shared(path, tmp_path / "one", url)
    actions_of_plan = {line.label: line.action for line in plan(load(path), store=tmp_path / "two/store.zarr", url=url)}
    assert actions_of_plan == MADE
    summary, _ = shared(path, tmp_path / "two", url)
    assert actions(summary) == MADE
    here = {a.path.name.rpartition("-")[0] for a in Store(tmp_path / "two" / "store.zarr").artifacts()}
    assert here == {"smooth"}  # what export reads; the rest is not even fetched
    changed, _ = shared(path, tmp_path / "two", url, "stages.smooth={use: tiny_smooth, width: 5}")
    assert actions(changed) == MADE | {"smooth": "run"}
    assert same(the_track(tmp_path / "one"), the_track(tmp_path / "two"))


@everywhere
def test_a_copy_is_plain_zarr(tmp_path, path, url):
    shared(path, tmp_path / "one", url)
    group = zarr.open_group(url, mode="r")
    (name,) = [name for name in copies(url) if name.startswith("track-")]
    track = the_track(tmp_path / "one")
    np.testing.assert_array_equal(group[f"{name}/angles"][:], track.angles)
    assert group[name].attrs["complete"] is True


@pytest.mark.long
def test_a_run_that_stopped_goes_on_elsewhere(tmp_path, path, url, monkeypatch):
    monkeypatch.setenv("TINY_RAISE_AT", "7")
    with pytest.raises(ComponentFailed, match="failed at frame 7"):
        shared(path, tmp_path / "one", url)
    monkeypatch.delenv("TINY_RAISE_AT")
    _, lines = shared(path, tmp_path / "two", url)
    assert "track: going on after 7 frames" in lines
    run_tiny(path, tmp_path / "alone")
    assert same(the_track(tmp_path / "two"), the_track(tmp_path / "alone"))
    assert len([name for name in copies(url) if name.startswith("track-")]) == 1  # the finished one


def test_who_writes_looks_at_what_is_here(tmp_path, path, url):
    """A copy that arrives while somebody makes the same must not be fetched under the maker's own lock."""
    shared(path, tmp_path / "one", url)
    key = the_track_key(tmp_path / "one")
    name = Copies(url).find(key).group
    Copies(url).remove(key)
    store = open_store(tmp_path / "two" / "store.zarr", url)
    store.create()
    with store.writer(key, name, lambda _: None):
        Copies(url).send(tmp_path / "one" / "store.zarr" / name)
        assert store.find(key) is None
    assert store.load(store.find(key)) is not None


@pytest.mark.long
def test_what_is_made_anew_takes_the_place_of_the_copy(tmp_path, path, url, monkeypatch):
    shared(path, tmp_path / "one", url)
    pipeline, folder = load(path), tmp_path / "one"
    monkeypatch.setenv("TINY_RAISE_AT", "5")
    with pytest.raises(ComponentFailed, match="failed at frame 5"):
        run(pipeline, store=folder / "store.zarr", out=folder / "out", url=url, fresh=True)
    monkeypatch.delenv("TINY_RAISE_AT")
    _, lines = shared(path, folder, url)  # not the old copy
    assert "track: going on after 5 frames" in lines


@everywhere
@pytest.mark.long
def test_a_copy_that_never_arrived_is_not_seen(tmp_path, path, url, monkeypatch):
    def broken(self, path, value, **options):
        if path.endswith("zarr.json") and "track-" in path:
            raise OSError("the line is cut")
        return real(self, path, value, **options)

    files, _ = fsspec.core.url_to_fs(url)
    real = type(files).pipe_file
    monkeypatch.setattr(type(files), "pipe_file", broken)
    with pytest.raises(StoreError, match="can't reach the store at .*the line is cut"):
        shared(path, tmp_path / "one", url)
    monkeypatch.setattr(type(files), "pipe_file", real)
    assert any(name.startswith("track-") for name in copies(url))
    key = the_track_key(tmp_path / "one")
    assert Copies(url).find(key) is None
    summary, _ = shared(path, tmp_path / "two", url)
    assert actions(summary)["track"] == "run"
    assert Copies(url).find(key) is not None


def cut_line(monkeypatch, url):
    """Let a copy break off after its first file."""
    files, _ = fsspec.core.url_to_fs(url)
    real = type(files).get

    def get(self, sources, targets, **options):
        real(self, sources[:1], targets[:1], **options)
        raise OSError("the line is cut")

    monkeypatch.setattr(type(files), "get", get)


@everywhere
@pytest.mark.long
def test_a_copy_that_breaks_off_leaves_what_is_here(tmp_path, path, url, monkeypatch):
    shared(path, tmp_path / "one", url)
    run_tiny(path, tmp_path / "two", frames=5)
    with monkeypatch.context() as patch:
        cut_line(patch, url)
        with pytest.raises(StoreError, match="can't reach the store at .*the line is cut"):
            shared(path, tmp_path / "two", url, "stages.smooth={use: tiny_smooth, width: 5}")
    assert len(the_track(tmp_path / "two").frame) == 5
    state = tmp_path / "two" / "store.zarr" / ".state"
    assert [p.name for p in state.iterdir() if p.is_dir()] == []
    shared(path, tmp_path / "two", url, "stages.smooth={use: tiny_smooth, width: 5}")
    assert same(the_track(tmp_path / "one"), the_track(tmp_path / "two"))


def test_what_a_run_had_fetched_when_it_was_killed_can_be_pruned(tmp_path, url, monkeypatch):
    key = KEY
    there, here = Store(tmp_path / "one"), open_store(tmp_path / "two", url)
    for store in (there, here):
        store.create()
    made = there.begin("track", key, {})
    there.save(made, Background(mean=(), spread=()))
    Copies(url).send(made.path)
    found, kept = Copies.fetch, []

    def fetch(copies, copy, folder):
        found(copies, copy, folder)
        kept.append([here.drop(part) for part in here.aside()])  # meanwhile
        raise SystemExit("killed")

    with monkeypatch.context() as patch:
        patch.setattr(Copies, "fetch", fetch)
        patch.setattr("mocapflow.storage.shared.shutil.rmtree", lambda *_, **__: None)
        with pytest.raises(SystemExit):
            here.load(here.find(key))
    assert kept == [[False]]
    (part,) = here.aside()
    assert here.drop(part) and here.aside() == []
    assert here.load(here.find(key)).mean == ()


@pytest.mark.long
def test_a_copy_that_is_dropped_meanwhile_leaves_what_is_here(tmp_path, path, url, monkeypatch):
    """Another machine has sent one that is further."""
    shared(path, tmp_path / "one", url)
    run_tiny(path, tmp_path / "two", frames=5)
    found = Copies.fetch

    def dropped(copies, copy, folder):
        copies.remove(copy.attributes["key"])
        found(copies, copy, folder)

    with monkeypatch.context() as patch:
        patch.setattr(Copies, "fetch", dropped)
        _, lines = shared(path, tmp_path / "two", url)
    assert "track: going on after 5 frames" in lines
    assert same(the_track(tmp_path / "one"), the_track(tmp_path / "two"))


def begun(folder, frames=0, complete=True):
    """The only artifact of a store: of so many frames, as far as its attributes tell."""
    store = Store(folder)
    store.create()
    made = store.begin("track", KEY, {})
    (made.path / "angles").mkdir()
    (made.path / "angles" / "c.0").write_bytes(b"some")
    write_json(made.path / "zarr.json", group_meta({**made.attributes, "frames_done": frames, "complete": complete}))
    return store.find(KEY)


@everywhere
@pytest.mark.parametrize("removed_first", [True, False])
def test_a_copy_that_is_dropped_while_it_is_fetched_is_not_whole(tmp_path, url, monkeypatch, removed_first):
    copies, files = Copies(url), type(fsspec.core.url_to_fs(url)[0])
    copies.send(begun(tmp_path / "one").path)
    copy, get = copies.find(KEY), files.get

    def meanwhile(self, *args, **options):
        steps = [lambda: copies.remove(KEY), lambda: get(self, *args, **options)]
        for step in steps if removed_first else reversed(steps):
            step()

    monkeypatch.setattr(files, "get", meanwhile)
    copies.fetch(copy, tmp_path / "part")
    assert not (tmp_path / "part" / "zarr.json").exists()


@everywhere
def test_what_is_half_removed_is_no_copy(tmp_path, url, monkeypatch):
    copies, files = Copies(url), type(fsspec.core.url_to_fs(url)[0])
    copies.send(begun(tmp_path / "one").path)
    rm = files.rm

    def cut(self, path, recursive=False, **options):
        if recursive:
            raise OSError("the line is cut")
        rm(self, path, **options)

    monkeypatch.setattr(files, "rm", cut)
    with pytest.raises(StoreError, match="the line is cut"):
        copies.remove(KEY)
    assert copies.find(KEY) is None


@everywhere
def test_what_is_half_sent_is_no_copy(tmp_path, url, monkeypatch):
    copies, files = Copies(url), type(fsspec.core.url_to_fs(url)[0])
    put = files.put

    def cut(self, *args, **options):
        put(self, *args, **options)
        raise OSError("the line is cut")

    monkeypatch.setattr(files, "put", cut)
    with pytest.raises(StoreError, match="the line is cut"):
        copies.send(begun(tmp_path / "one").path)
    assert copies.find(KEY) is None


def test_of_what_is_here_and_there_the_further_counts(tmp_path, url):
    here, there = open_store(tmp_path / "two" / "store.zarr", url), begun(tmp_path / "one", frames=8)
    begun(here.path, frames=5)
    Copies(url).send(there.path)
    assert here.find(KEY).frames == 8
    begun(here.path, frames=9, complete=False)
    assert here.find(KEY).frames == 9


def test_what_is_done_is_sent_whatever_ends_the_run(tmp_path, url, monkeypatch):
    here, lines = open_store(tmp_path / "one", url), []

    def stopped(frames):
        with pytest.raises(KeyboardInterrupt), here.writer(KEY, "track", lines.append):
            begun(here.path, frames=frames, complete=False)
            raise KeyboardInterrupt

    def broken(self, path):
        raise StoreError("the line is cut")

    here.create()
    stopped(frames=0)
    assert Copies(url).find(KEY) is None
    stopped(frames=3)
    assert Copies(url).find(KEY).attributes["frames_done"] == 3
    monkeypatch.setattr(Copies, "send", broken)
    stopped(frames=4)
    assert lines == ["warning: the line is cut"]


def test_what_is_fetched_is_on_the_drive_and_nothing_beside_it(tmp_path, url, monkeypatch):
    synced, here = set(), open_store(tmp_path / "two", url)
    Copies(url).send(begun(tmp_path / "one", frames=3).path)
    here.create()
    left = here.state / f"damaged-track-{KEY[:12]}"  # by a run that was killed
    left.mkdir()
    (left / "older").write_text("")
    monkeypatch.setattr(os, "fsync", lambda number: synced.add(os.fstat(number).st_ino))
    with here.writer(KEY, "track", print):
        made = here.find(KEY).path
    files = {file.relative_to(made).as_posix(): file.stat().st_ino for file in made.rglob("*") if file.is_file()}
    assert set(files) == {"zarr.json", "angles/c.0"} and set(files.values()) <= synced


def test_what_others_send_or_remove_meanwhile_is_no_error(tmp_path, url, monkeypatch):
    copies, made, (files, root) = Copies(url), begun(tmp_path / "one"), fsspec.core.url_to_fs(url)
    listed, ls = {}, type(files).ls
    monkeypatch.setattr(type(files), "ls", lambda self, path, **how: listed.setdefault(path, ls(self, path, **how)))
    monkeypatch.setattr(type(files), "invalidate_cache", lambda self, path=None: listed.clear())
    copies.send(made.path)
    name = copies.find(KEY).name
    for text in (b"{", b"{}", b"[]"):
        files.pipe_file(f"{root}/{name}/zarr.json", text)
        assert copies.find(KEY) is None
    copies.send(made.path)
    gone = copies.find(KEY)
    copies.remove(KEY)
    copies._drop(gone)


@pytest.mark.parametrize("frames", [(8, 5), (5, 8)])
def test_the_furthest_copy_stays_whoever_sends_last(tmp_path, url, frames):
    for number in frames:
        Copies(url).send(begun(tmp_path / str(number), frames=number).path)
    assert Copies(url).find(KEY).attributes["frames_done"] == 8
    assert len(copies(url)) == 1


def test_of_equal_copies_all_keep_the_same(tmp_path, url, monkeypatch):
    made = begun(tmp_path / "one")
    with monkeypatch.context() as patch:
        patch.setattr(Copies, "_drop", lambda self, copy: None)  # the other has not looked yet
        Copies(url).send(made.path)
        Copies(url).send(made.path)
    assert len(copies(url)) == 2
    files = type(fsspec.core.url_to_fs(url)[0])
    ls, found = files.ls, []
    for reverse in (False, True):
        monkeypatch.setattr(
            files, "ls", lambda *args, reverse=reverse, **how: sorted(ls(*args, **how), reverse=reverse)
        )
        found.append(Copies(url).find(KEY).name)
    assert found[0] == found[1]


@pytest.mark.long
def test_a_copy_takes_the_place_of_what_is_damaged_here(tmp_path, path, url):
    shared(path, tmp_path / "one", url)
    run_tiny(path, tmp_path / "two", frames=5)
    (group,) = (tmp_path / "two" / "store.zarr").glob("track-*")
    (group / "zarr.json").write_text("{")
    summary, _ = shared(path, tmp_path / "two", url, "stages.smooth={use: tiny_smooth, width: 5}")
    assert actions(summary)["track"] == "hit"
    assert same(the_track(tmp_path / "one"), the_track(tmp_path / "two"))


@pytest.mark.long
def test_a_copy_takes_the_place_of_a_result_that_is_damaged_here(tmp_path, path, url):
    shared(path, tmp_path / "one", url)
    before = copies(url)
    (group,) = (tmp_path / "one" / "store.zarr").glob("smooth-*")
    for chunk in (group / "angles" / "c").rglob("*"):
        _ = chunk.is_dir() or chunk.write_bytes(b"nonsense")
    summary, lines = shared(path, tmp_path / "one", url)
    assert actions(summary) == MADE and copies(url) == before
    assert any(f"{group.name} is damaged and replaced by its copy" in line for line in lines)
    assert not any("is damaged" in line for line in shared(path, tmp_path / "one", url)[1])


@pytest.mark.long
def test_a_copy_takes_the_place_of_frames_that_are_damaged_here(tmp_path, path, url, monkeypatch):
    monkeypatch.setenv("TINY_RAISE_AT", "7")
    with pytest.raises(ComponentFailed, match="failed at frame 7"):
        shared(path, tmp_path / "one", url)
    monkeypatch.delenv("TINY_RAISE_AT")
    (rows,) = (tmp_path / "one" / "store.zarr").glob("track-*/live/rows")
    for row in rows.glob("c.*"):
        row.write_bytes(b"nonsense")
    _, lines = shared(path, tmp_path / "one", url)
    assert lines.count("track: going on after 7 frames") == 2  # its own, then the copy's
    assert not any("made anew" in line for line in lines)


def the_track_key(folder):
    return next(a.key for a in Store(folder / "store.zarr").artifacts() if a.path.name.startswith("track-"))


def test_two_that_make_the_same_leave_one_copy(tmp_path, path, url):
    run_tiny(path, tmp_path)
    (artifact,) = [a for a in Store(tmp_path / "store.zarr").artifacts() if a.path.name.startswith("track-")]
    here, there = Copies(url), Copies(url)
    here.send(artifact.path)
    there.send(artifact.path)
    assert len(copies(url)) == 1
    assert here.find(artifact.key) == there.find(artifact.key)
    assert json.loads((artifact.path / "zarr.json").read_text())["attributes"] == here.find(artifact.key).attributes


@pytest.mark.long
def test_a_damaged_copy_is_made_anew(tmp_path, path, url):
    shared(path, tmp_path / "one", url)
    files, root = fsspec.core.url_to_fs(url)
    (name,) = [name for name in copies(url) if name.startswith("smooth-")]
    for file in files.find(f"{root}/{name}/angles"):
        if "/c" in file.removeprefix(root):
            files.pipe_file(file, b"nonsense")
    summary, lines = shared(path, tmp_path / "two", url)
    assert actions(summary)["smooth"] == "run"
    assert any("is damaged and made anew" in line for line in lines)
    assert actions(shared(path, tmp_path / "three", url)[0]) == MADE


def test_what_cannot_be_reached_is_told(tmp_path, path):
    with pytest.raises(MocapflowError, match=r"no store can be at nowhere://lab: .*nowhere") as caught:
        shared(path, tmp_path, "nowhere://lab")
    assert caught.value.exit_status == 2


def test_a_missing_package_is_wrong_input(monkeypatch):
    def url_to_fs(url, **options):
        raise ImportError("FarFileSystem requires far")

    monkeypatch.setattr(fsspec.core, "url_to_fs", url_to_fs)
    with pytest.raises(MocapflowError, match=r"needs a package: FarFileSystem requires far\n +pip install") as caught:
        Copies("far://lab")
    assert caught.value.exit_status == 2


def test_a_store_is_named_by_folder_or_url(tmp_path):
    assert placed(None, tmp_path) == (str(tmp_path), None)
    assert placed("elsewhere", tmp_path) == ("elsewhere", None)
    assert placed("s3://lab/store", tmp_path) == (str(tmp_path), "s3://lab/store")
