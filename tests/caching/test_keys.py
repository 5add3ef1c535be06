"""A table of edits, each of which must or must not change a key; and what a miss says about its reason."""

import ast
import importlib
import json
import os
import re
import shutil
import sys
from dataclasses import fields, replace
from enum import Enum, IntEnum
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mocapflow import io
from mocapflow.caching import digests, sources
from mocapflow.caching.digests import Digests
from mocapflow.caching.keys import _plain, all_changes, explain, key_of
from mocapflow.data import Start
from mocapflow.errors import PluginError, RecordingError
from mocapflow.recordings.recording import open_recording
from mocapflow.running import recipes
from mocapflow.running.recipes import steps_of
from tests.fixtures.stores import PLUGIN, STAGES, load, write_pipeline, write_recording

SHARED = Digests()  # reads each source file once; every test has files of its own
TRACK = ("background", "start", "track", "smooth", "export")


@pytest.fixture
def clip(tmp_path):
    return write_recording(tmp_path / "clip", frames=4)


def keys(folder, recording, *changes, stages=None, garment="tiny_garment", frames=None, **more):
    path = write_pipeline(folder, recording, stages=stages, garment=garment, **more)
    return {step.label: step.key for step in steps_of(load(path, *changes, frames=frames), SHARED)}


def changed(before, after):
    return {label for label in before if before[label] != after[label]}


def test_fractions_are_numbers_in_a_recipe_and_keys_are_as_before(tmp_path, clip):
    (track,) = [step for step in steps_of(load(write_pipeline(tmp_path, clip)), SHARED) if step.label == "track"]
    assert track.recipe["component"]["settings"]["segmenter"]["settings"]["sigma_px"] == 2.0
    as_text = json.loads(json.dumps(track.recipe), parse_float=str)
    assert key_of(as_text) == track.key and explain(as_text, track.recipe) == ""
    assert [_plain(value, "", None, SHARED) for value in (np.inf, np.nan, np.float64(0.5))] == ["inf", "nan", 0.5]


def test_every_kind_of_setting_is_in_a_key_by_what_it_says(tmp_path):
    def plain(value):
        return _plain(value, "Stage.setting", None, Digests())

    side, file = Enum("Side", ["LEFT", "RIGHT"]).RIGHT, tmp_path / "a.txt"
    assert [plain(value) for value in (None, True, 3, "a", side)] == [None, True, 3, "a", "RIGHT"]
    assert plain(file) == "no file a.txt"
    contents = []
    for text in ("one", "another"):
        file.write_text(text)
        contents.append(plain(file))
    assert contents[0] != contents[1] and all(said.startswith(digests.MARK) for said in contents)
    assert plain(np.arange(3)) == digests.digest_array(np.arange(3)) != plain(np.arange(4))
    assert plain({1: (0.5, side)}) == {"1": [0.5, "RIGHT"]}
    assert plain({"b", "a"}) == plain(frozenset("ab")) == ['"a"', '"b"']
    assert plain({0, 8}) == plain({8, 0})  # equal sets, whose elements come in different order
    assert plain(IntEnum("Level", ["LOW"]).LOW) == "LOW"
    with pytest.raises(PluginError, match=r"setting Stage\.setting is a object, which has no place in a cache key"):
        plain(object())


def test_a_key_does_not_hang_on_order_or_on_where_content_lies():
    content = {"a": 0.5, "b": ["blake2b:12 here.png"]}
    assert key_of(content) == key_of({"b": ["blake2b:12 there.png"], "a": 0.5})
    for other in ({**content, "b": ["blake2b:13 here.png"]}, {**content, "a": 0.25}, {**content, "c": None}):
        assert key_of(other) != key_of(content)
    assert re.fullmatch("[0-9a-f]{32}", key_of(content))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("stages.track.segmenter={use: tiny_segmenter, sigma_px: 3}", {"track", "smooth", "export"}),
        ("stages.track.segmenter={use: tiny_segmenter, sigma_px: 2.0}", set()),  # its default
        ("stages.track.segmenter={use: tiny_segmenter, sigma_px: 2}", set()),  # the same number
        ("stages.track.steady.max_turns=5", {"track", "smooth", "export"}),
        ("stages.track.draper=other_draper", {"track", "smooth", "export"}),
        ("stages.track.priors=[{use: tiny_prior, weight: 2}]", {"track", "smooth", "export"}),
        ("stages.track.priors=[]", {"track", "smooth", "export"}),
        ("stages.track.matchers=[{use: tiny_matcher, share: 0.5}]", {"track", "smooth", "export"}),
        ("stages.track.keep=trace", set()),
        ("stages.track.on_unsteady=stop", set()),
        ("stages.smooth.width=5", {"smooth", "export"}),
        ("stages.start.angle_rad=0.1", {"start", "track", "smooth", "export"}),
        ("garment.length_m=0.6", {"start", "track", "smooth", "export"}),
        ("body.size_m=1.1", {"start", "track", "smooth", "export"}),
        ("scale=0.5", {"background", "start", "track", "smooth", "export"}),
    ],
)
def test_settings(tmp_path, clip, change, expected):
    stages = STAGES | {"smooth": {"use": "tiny_smooth"}, "start": {"use": "tiny_start"}}
    wordy = {"garment": {"use": "tiny_garment"}, "body": {"use": "tiny_body"}}
    before = keys(tmp_path, clip, stages=stages, **wordy)
    assert changed(before, keys(tmp_path, clip, change, stages=stages, **wordy)) == expected


def test_stop_is_only_in_the_key_of_what_reads_the_whole_sequence(tmp_path, clip):
    assert changed(keys(tmp_path, clip), keys(tmp_path, clip, frames=3)) == {"smooth", "export"}


def test_a_stage_that_looks_at_the_beginning_sees_it_however_short_the_run(tmp_path, clip, monkeypatch):
    monkeypatch.setitem(recipes.EXTENTS, Start, "beginning")
    path = write_pipeline(tmp_path, clip, frames={"start": 1})
    for change in ("frames.stop=2", "frames.stop=4"):
        (start,) = (step for step in steps_of(load(path, change), SHARED) if step.label == "start")
        assert list(start.recording.indices) == [1, 2, 3]


def test_start_and_step_are_in_the_key(tmp_path, clip):
    before = keys(tmp_path, clip)
    path = write_pipeline(tmp_path, clip, frames={"start": 0})
    for change, expected in [
        ("frames.start=1", {"start", "track", "smooth", "export"}),
        ("frames.step=2", {"track", "smooth", "export"}),
    ]:
        after = {step.label: step.key for step in steps_of(load(path, change), SHARED)}
        assert changed(before, after) == expected


def test_which_frames_are_read_is_in_a_recipe():
    def read(*frames, chain=False, scale=1.0):
        return recipes._frames(SimpleNamespace(indices=range(*frames)), SimpleNamespace(scale=scale), chain)

    assert all(read(0, 9) != other for other in (read(1, 9), read(0, 8), read(0, 9, 2), read(0, 9, scale=0.5)))
    assert read(0, 1) == read(0, 1, 2)
    chain = read(0, 9, chain=True)
    assert chain == read(0, 8, chain=True) and chain not in (read(1, 9, chain=True), read(0, 9, 2, chain=True))


def test_frames_that_a_stage_changes_as_they_are_read_count_as_frames_do(tmp_path, clip):
    path = write_pipeline(tmp_path, clip, stages={"corrupt": {"use": "corrupt", "noise": 0.5}, **STAGES}, frames={})
    before, after = (
        {step.label: step.key for step in steps_of(load(path, *change), SHARED)} for change in ((), ("frames.start=1",))
    )
    assert changed(before, after) == {"start", "track", "smooth", "export"}


def test_names_and_order_of_stages_and_files_do_not_count(tmp_path, clip):
    before = keys(tmp_path, clip)
    renamed = {"room": "tiny_background", "first": "tiny_start", "loop": STAGES["track"], "smooth": "tiny_smooth"}
    assert set(keys(tmp_path, clip, stages=renamed).values()) == set(before.values()) - {before["export"]}
    swapped = {name: STAGES[name] for name in ("start", "background", "track", "smooth", "export")}
    assert keys(tmp_path, clip, stages=swapped) == before
    elsewhere = shutil.copytree(clip, tmp_path / "elsewhere" / "moved")
    assert keys(tmp_path, elsewhere) == before


def test_an_added_stage_changes_what_reads_it(tmp_path, clip):
    before = keys(tmp_path, clip)
    stages = {"background": "tiny_background", "start": "tiny_start", "grow": "tiny_grow", "track": STAGES["track"]}
    after = keys(tmp_path, clip, stages=stages)
    assert after["start"] == before["start"]  # it comes before the other body
    assert after["track"] != before["track"]
    without = {k: v for k, v in STAGES.items() if k != "background"}
    assert changed(keys(tmp_path, clip, stages=without), before) == {"track", "smooth", "export"}


def test_cameras_made_by_a_stage_change_what_comes_after_it(tmp_path, clip):
    before = keys(tmp_path, clip)
    stages = {"background": "tiny_background", "start": "tiny_start", "align": "tiny_align", "track": STAGES["track"]}
    after = keys(tmp_path, clip, stages=stages)
    assert after["start"] == before["start"]  # it comes before the other cameras
    assert after["track"] != before["track"]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("videos/cam01/000003.png", set(TRACK)),
        ("cameras.toml", set(TRACK)),
        ("subject.txt", {"start", "track", "smooth", "export"}),
        ("init.json", set()),
        ("truth/angles.csv", set()),
        ("reference/angles.csv", set()),
        ("README.md", set()),
        ("videos/cam01/.DS_Store", set()),
        ("videos/.hidden/cam01.mp4", set()),
        ("static/videos/cam01.mp4", set()),
    ],
)
def test_content_of_files(tmp_path, clip, name, expected):
    before = keys(tmp_path, clip)
    path = clip / name
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".png":
        shutil.copy(clip / "videos/cam01/000002.png", path)
    elif path.name == "cameras.toml":
        path.write_text(path.read_text().replace("20.0", "21.0"))
    else:
        path.write_text("other")
    after = changed(before, keys(tmp_path, clip))
    assert after >= expected
    assert bool(after) == bool(expected)


def test_all_of_a_camera_counts(clip):
    camera = open_recording(clip).cameras[0]
    changes = {
        "size": camera.size + 1, "intrinsics": 2 * camera.intrinsics, "distortion": camera.distortion + 0.1,
        "camera_from_world": np.diag([1.0, -1.0, -1.0, 1.0]) @ camera.camera_from_world, "fisheye": True,
    }  # fmt: skip
    cameras = [camera, *(replace(camera, **{name: value}) for name, value in changes.items())]
    assert len({key_of({"camera": recipes._camera(each)}) for each in cameras}) == len(cameras)
    assert {field.name for field in fields(camera)} == {"name", *changes}


def test_cameras_count_for_who_looks_at_no_frame(tmp_path, clip):
    before = keys(tmp_path, clip, stages={"grow": "tiny_grow"})
    (clip / "cameras.toml").write_text((clip / "cameras.toml").read_text().replace("20.0", "21.0"))
    assert changed(before, keys(tmp_path, clip, stages={"grow": "tiny_grow"})) == {"grow"}


def test_all_files_of_a_component_count_by_where_they_lie_in_the_recording(tmp_path, clip):
    paths = [clip / "a" / "x.json", clip / "b" / "x.json", tmp_path / "c" / "x.json", tmp_path / "d" / "x.json"]
    for path in paths:
        path.parent.mkdir()
        path.write_text(path.parent.name)
    component = SimpleNamespace(inputs=lambda folder: [*paths, clip / "none.json"])
    found = recipes._files(component, clip, SHARED)
    assert {name: len(digests) for name, digests in found.items()} == {"a/x.json": 1, "b/x.json": 1, "x.json": 2}


def test_a_join_depends_on_all_its_parts(tmp_path, clip):
    starts = (f"parts.start={{use: tiny_start, angle_rad: {angle}}}" for angle in (0.0, 0.5))
    before, after = (keys(tmp_path, clip, "parts.count=2", "parts.overlap=1", start) for start in starts)
    assert changed(before, after) == {"start_2", "track_2", "track", "smooth", "export"}


@pytest.mark.parametrize("trial", ["auto", "static", "recording"])
def test_the_standing_trial_counts_for_who_looks_at_it(tmp_path, clip, trial):
    stages = STAGES | {"late": {"use": "fit_subject", "trial": trial}}
    film = clip / "static" / "videos" / "cam01.mp4"
    film.parent.mkdir(parents=True)
    film.write_text("one")
    before = keys(tmp_path, clip, stages=stages)
    film.write_text("two")
    assert changed(before, keys(tmp_path, clip, stages=stages)) == (set() if trial == "recording" else {"late"})


def test_the_name_of_a_file_counts_that_a_stage_may_read_by_its_name(tmp_path, clip):
    stages = STAGES | {"start": "start_from_file"}
    for name in ("init.json", "init_000001.json"):
        (clip / name).write_text("{}")
    before = keys(tmp_path, clip, stages=stages)
    (clip / "init_000001.json").rename(clip / "init_000002.json")
    assert changed(before, keys(tmp_path, clip, stages=stages)) == {"start", "track", "smooth", "export"}


def test_a_touched_file_is_the_same(tmp_path, clip):
    before = keys(tmp_path, clip)
    os.utime(clip / "subject.txt")
    assert keys(tmp_path, clip) == before


CODE = '''
"""A module."""
import math

def f(x):
    """Return x."""
    return x + 1  # one more

class A:
    """A class."""
    def g(self):
        """Do it."""
'''


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("# one more", "# one more than x", True),
        ("Return x.", "Return x and so on.", True),
        ('"""A module."""', "", True),
        ("x + 1", "x+1", True),
        ("x + 1", "(x +\n 1)", True),
        ("x + 1", "x + 2", False),
        ("x + 1", "1 + x", False),
        ("def f(x)", "def f(x=0)", False),
        ("import math", "import cmath", False),
        ("class A:", "class B:", False),
    ],
)
def test_code_by_meaning(tmp_path, monkeypatch, old, new, same):
    found = []
    for index, text in enumerate([CODE, CODE.replace(old, new)]):
        folder = tmp_path / str(index) / "mocapflow_sample"
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text("")
        (folder / "inner.py").write_text(text)
        monkeypatch.syspath_prepend(folder.parent)
        found.append(Digests().package("mocapflow_sample.inner"))
        sys.modules.pop("mocapflow_sample", None)
    assert (found[0] == found[1]) is same


def test_code_that_a_plugin_imports_counts(tmp_path, monkeypatch):
    def made(value):
        for name, text in {
            "mocapflow_upper": "from mocapflow_lower import f\nfrom mocapflow.io.cameras import opencv",
            "mocapflow_lower": f"def f():\n    return {value}",
        }.items():
            (tmp_path / name).mkdir(exist_ok=True)
            (tmp_path / name / "__init__.py").write_text(text)
        return Digests().package("mocapflow_upper")

    monkeypatch.syspath_prepend(tmp_path)
    assert made(1) == made(1) != made(2)
    before = made(1)
    monkeypatch.setattr(digests, "LOADED", {})
    monkeypatch.setattr(digests.sources, "meaning", lambda tree: "")  # all else is alike: mocapflow.io counted too
    assert made(1) != before


def test_all_of_io_counts_where_a_plugin_imports_one_file_of_it(tmp_path, monkeypatch):
    (tmp_path / "mocapflow_reader.py").write_text("from mocapflow.io.cameras import opencv")
    monkeypatch.syspath_prepend(tmp_path)
    read, source = [], Digests._source
    monkeypatch.setattr(Digests, "_source", lambda self, path: (read.append(path), source(self, path))[1])
    Digests().package("mocapflow_reader")
    assert {*Path(io.__path__[0]).rglob("*.py"), tmp_path / "mocapflow_reader.py"} == set(read)


def test_code_that_changes_after_it_was_loaded_makes_no_results(tmp_path, monkeypatch):
    (tmp_path / "mocapflow_edited").mkdir()
    (tmp_path / "mocapflow_edited" / "__init__.py").write_text("")
    file = tmp_path / "mocapflow_edited" / "inner.py"
    file.write_text(CODE)
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("mocapflow_edited.inner")
    before = Digests().package("mocapflow_edited")
    file.write_text(CODE.replace("# one more", "# another comment"))
    assert Digests().package("mocapflow_edited") == before
    file.write_text(CODE.replace("x + 1", "x + 2  # two"))
    with pytest.raises(PluginError, match="inner.py  this code has changed since it was loaded\n.*the workers"):
        Digests().package("mocapflow_edited")
    importlib.invalidate_caches()
    assert importlib.reload(module).f(1) == 3
    assert Digests().package("mocapflow_edited") != before
    file.write_text(CODE.replace("x + 1", "x + 3"))
    with pytest.raises(PluginError, match="this code has changed since it was loaded"):
        Digests().package("mocapflow_edited")
    for name in ("mocapflow_edited.inner", "mocapflow_edited"):
        del sys.modules[name]


def test_modules_of_an_author_count_however_they_are_called(tmp_path, monkeypatch):
    (tmp_path / "mocapflow_upper.py").write_text("import numpy\nimport my_helpers.flat")
    (tmp_path / "my_helpers").mkdir()
    (tmp_path / "my_helpers" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    found = []
    for value in (1, 1, 2):
        (tmp_path / "my_helpers" / "flat.py").write_text(f"def f():\n    return {value}")
        found.append(Digests().package("mocapflow_upper"))
    assert found[0] == found[1] != found[2]
    assert not sources.counts("numpy.linalg") and not sources.counts("json")


def test_of_what_is_installed_plugins_count(tmp_path, monkeypatch):
    for place, name in [
        ("site-packages", "mocapflow_installed"), ("site-packages", "installed"), ("site-packages", "open"),
        ("mine", "open"),
    ]:  # fmt: skip
        (tmp_path / place / name).mkdir(parents=True)
        (tmp_path / place / name / "flat.py").write_text("")
        monkeypatch.syspath_prepend(tmp_path / place)
    assert [sources.counts(name) for name in ("mocapflow_installed", "installed", "open")] == [True, False, True]
    assert sources.counts("mocapflow.io.images") and not sources.counts("mocapflow.iodine")


def test_files_of_a_folder_count_in_one_order_without_what_file_browsers_leave(tmp_path, monkeypatch):
    for name in ("a.png", "b.png", "c.png"):
        (tmp_path / name).write_text(name)
    first, real = Digests().file(tmp_path), Path.iterdir
    (tmp_path / "Thumbs.db").write_text("")
    for turned in (sorted, lambda paths: sorted(paths, reverse=True)):
        monkeypatch.setattr(Path, "iterdir", lambda self, turned=turned: iter(turned(real(self))))
        assert Digests().file(tmp_path) == first


def test_a_module_counts_whose_name_begins_that_of_another(tmp_path, monkeypatch):
    for name, text in {"mocapflow_upper": "import my_helpers", "my_helpers": "import my_help"}.items():
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    found = []
    for value in (1, 2):
        (tmp_path / "my_help.py").write_text(f"X = {value}")
        found.append(Digests().package("mocapflow_upper"))
    assert found[0] != found[1]


@pytest.mark.parametrize(
    "line",
    [
        "from mocapflow.recordings.recording import Recording",
        "from mocapflow.recordings import recording",
        "import mocapflow.recordings.recording",
    ],
)
def test_the_reader_of_recordings_counts_however_it_is_imported(line):
    counted = {name for name in sources.imports(ast.parse(line)) if sources.counts(name)}
    assert {sources.unit_of(name) for name in counted} == {"mocapflow.recordings.recording"}


def test_packages_without_an_init_count_like_others(tmp_path, monkeypatch):
    """The plugin imports a helper, and the plugin itself is in two folders of the path."""
    for folder in ("one/mocapflow_open", "two/mocapflow_open", "one/my_open_helper"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "one/mocapflow_open/garment.py").write_text("import my_open_helper.flat")
    for folder in ("two", "one"):
        monkeypatch.syspath_prepend(tmp_path / folder)
    found = [Digests().package("mocapflow_open.garment")]
    for name, text in {
        "one/mocapflow_open/garment.py": "import my_open_helper.flat\nX = 1",
        "one/my_open_helper/flat.py": "X = 1",
        "two/mocapflow_open/inner.py": "X = 1",
        "two/mocapflow_open/body.obj": "v 0",
        "one/mocapflow_open/inner.py": "X = 2",
    }.items():
        (tmp_path / name).write_text(text)
        found.append(Digests().package("mocapflow_open.garment"))
    assert len(set(found)) == len(found)
    (tmp_path / "two/mocapflow_open/inner.py").write_text("X = 3")  # hidden by the first of its name
    assert Digests().package("mocapflow_open.garment") == found[-1]


def test_package_data_counts(tmp_path, monkeypatch):
    folder = tmp_path / "mocapflow_withdata"
    (folder / "__pycache__").mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    found = []
    for name, text in [("body.obj", "v 0"), ("__pycache__/x.nbi", "1"), ("body.obj", "v 1 0")]:
        (folder / name).write_text(text)
        found.append(Digests().package("mocapflow_withdata"))
    assert found[0] == found[1] != found[2]


def test_the_core_covers_what_every_result_depends_on(monkeypatch):
    read = []
    meaning = Digests._source
    monkeypatch.setattr(Digests, "_source", lambda self, path: (read.append(path.stem), meaning(self, path))[1])
    Digests().core()
    assert {"twists", "kinematics", "scene", "model", "loop", "track", "data", "components", "steady"} <= set(read)
    assert not {"cli", "store", "runner", "keys", "registry", "checkpoint"} & set(read)


def test_every_part_of_the_core_exists():
    assert all(list(sources.python_files(f"mocapflow.{part}")) for part in (*digests.CORE, *sources.SHARED))


def test_all_of_mocapflow_that_a_plugin_or_the_core_imports_counts():
    """What finds plugins, refuses, is computed once, saves and takes the time changes no result."""
    free = {"caching.keys", "config.levels", "errors", "guards.matcher_inputs", "hookspecs", "memo", "settings"}
    free |= {"storage.checkpoint", "timing"}
    known = {*digests.CORE, *sources.SHARED, *free}
    plugins = (PLUGIN.parents[2] / "plugins").rglob("*.py")
    core = (path for part in digests.CORE for _, path in sources.python_files(f"mocapflow.{part}"))
    imported = {
        next((part for part in known if f"{name}.".startswith(f"mocapflow.{part}.")), name)
        for path in (*plugins, *core)
        for name in sources.imports(ast.parse(path.read_text()))
        if name.startswith("mocapflow.")
    }
    assert {"series", "geometry", "steady", "storage.checkpoint"} <= imported <= known


@pytest.mark.long
def test_an_edited_plugin_file_changes_the_keys_of_its_components(tmp_path, clip):
    path = write_pipeline(tmp_path, clip)
    copy = tmp_path / "plugin.py"
    found = []
    for old, new in [("", ""), ("Halves the way", "Goes some way"), ("0.1 * np.sin", "0.2 * np.sin")]:
        copy.write_text(PLUGIN.read_text().replace(old, new) if old else PLUGIN.read_text())
        sys.modules.pop("_", None)
        path.write_text(path.read_text().replace(str(PLUGIN), str(copy)))
        found.append({step.label: step.key for step in steps_of(load(path), Digests())})
    assert found[0] == found[1]
    assert changed(found[0], found[2]) == set(TRACK)  # one file, one digest


@pytest.mark.long
def test_where_a_plugin_file_lies_does_not_count(tmp_path, clip):
    path = write_pipeline(tmp_path, clip)
    text, found = path.read_text(), []
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
        copy = shutil.copy(PLUGIN, tmp_path / name)
        path.write_text(text.replace(str(PLUGIN), str(copy)))
        found.append([step.key for step in steps_of(load(path), Digests())])
    assert found[0] == found[1]


def test_explanations_name_the_change():
    component = {"role": "stage", "name": "coupled_loop", "settings": {"steady": {"turns": 2}, "draper": None}}
    draper = {"role": "draper", "name": "kinematic", "settings": {"gap_mm": "2.0"}, "code": "blake2b:12 code of x"}
    old = {
        "component": component | {"settings": component["settings"] | {"draper": draper}},
        "inputs": {"start": {"key": "1"}},
    }

    def new(**settings):
        return old | {"component": component | {"settings": old["component"]["settings"] | settings}}

    assert explain(old, new(draper=draper | {"name": "xpbd"})) == "draper kinematic → xpbd"
    assert explain(old, new(draper=draper | {"settings": {"gap_mm": "3.0"}})) == "draper.gap_mm 2.0 → 3.0"
    assert explain(old, new(draper=draper | {"code": "blake2b:13 code of x"})) == "code of x changed"
    assert explain(old, new(draper=None)) == "draper kinematic → none"
    assert explain(old, new(steady={"turns": 3})) == "steady.turns 2 → 3"
    assert explain(old, old | {"inputs": {"start": {"key": "2"}}}) == "start was made anew"
    assert explain({"frames": 200}, {"frames": 400}) == "frames 200 → 400"
    grown = explain({"inputs": {"track": {"frames": 200}}}, {"inputs": {"track": {"frames": 400}}})
    assert grown == "track grew from 200 to 400 frames"
    assert explain(old, old) == ""
    before, after = (
        {"settings": dict.fromkeys("vwxyz", n), "inputs": {name: {"key": n} for name in "abcde"}} for n in (0, 1)
    )
    told = [*(f"{name} 0 → 1" for name in "vwxyz"), *(f"{name} was made anew" for name in "abcde")]
    assert all_changes(before, after) == told
    assert explain(before, after) == "; ".join(told[:4]) + " and 6 more"


@pytest.mark.parametrize("of", ["format", "core", "components", "reader"])
def test_all_code_is_in_a_key_and_none_in_what_a_stage_is_made_of(tmp_path, clip, monkeypatch, of):
    pipeline, package = load(write_pipeline(tmp_path, clip)), Digests.package
    before = steps_of(pipeline, SHARED)
    if of == "format":
        monkeypatch.setattr(recipes, "FORMAT", 99)
    elif of == "core":
        monkeypatch.setattr(Digests, "core", lambda self: f"{digests.MARK}1 code")
    else:

        def other(self, module):
            edited = (module == "mocapflow.recordings.recording") == (of == "reader")
            return f"{digests.MARK}2 code" if edited else package(self, module)

        monkeypatch.setattr(Digests, "package", other)
    after = steps_of(pipeline, SHARED)
    assert [step.content for step in after] == [step.content for step in before]
    assert not {step.key for step in after} & {step.key for step in before}


def test_what_a_stage_reads_is_part_of_what_it_is_made_of(tmp_path, clip):
    one, other = ({"use": "tiny_start", "angle_rad": angle} for angle in (0.0, 0.5))
    path = write_pipeline(tmp_path, clip, stages={"one": one, "other": other, "track": STAGES["track"]})
    tracks = [steps_of(load(path, f"stages.track.from={{start: {name}}}"), SHARED)[-1] for name in ("one", "other")]
    assert tracks[0].content != tracks[1].content


def test_names_in_digests_are_for_people_only():
    assert key_of({"file": "blake2b:12 body.obj"}) == key_of({"file": "blake2b:12 other.obj"})
    assert key_of({"file": "blake2b:12 body.obj"}) != key_of({"file": "blake2b:13 body.obj"})


def test_file_digests_are_remembered_until_the_file_changes(tmp_path, monkeypatch):
    file, memory = tmp_path / "video.mp4", tmp_path / "memory.json"
    file.write_text("one")
    kept = Digests(memory)
    first = kept.file(file)
    kept.save()
    opened = []
    real = digests.hashlib.file_digest
    monkeypatch.setattr(digests.hashlib, "file_digest", lambda *a: (opened.append(a), real(*a))[1])
    assert Digests(memory).file(file) == first
    assert not opened
    file.write_text("two")
    os.utime(file, ns=(1, 1))
    assert Digests(memory).file(file) != first
    assert opened


def test_a_file_in_the_place_of_another_of_the_same_size_and_time_is_another(tmp_path):
    file, other, kept = tmp_path / "video.mp4", tmp_path / "other.mp4", Digests()
    for path, content in ((file, "one"), (other, "two")):
        path.write_text(content)
        os.utime(path, ns=(1, 1))
    first = kept.file(file)
    other.replace(file)
    assert kept.file(file) != first


def test_files_in_linked_folders_count(tmp_path):
    trial, elsewhere = tmp_path / "static", tmp_path / "drive" / "cam01"
    for folder in (trial / "videos", elsewhere):
        folder.mkdir(parents=True)
    (elsewhere / "000000.png").write_text("one")
    (trial / "videos" / "cam01").symlink_to(elsewhere)
    (trial / "videos" / "back").symlink_to(trial)
    assert list(sources.visible(trial)) == [trial / "videos" / "cam01" / "000000.png"]
    first = Digests().file(trial)
    (elsewhere / "000000.png").write_text("two")
    assert Digests().file(trial) != first


def test_names_of_files_in_a_folder_count(tmp_path):
    folder = tmp_path / "clip"
    folder.mkdir()
    (folder / "000000.png").write_text("one")
    first = Digests().file(folder)
    (folder / "000000.png").rename(folder / "000001.png")
    assert Digests().file(folder) != first


def test_what_was_read_must_not_change(tmp_path):
    file, folder, kept = tmp_path / "a.txt", tmp_path / "clip", Digests()
    folder.mkdir()
    for path in (file, folder / "000000.png"):
        path.write_text("one")
    kept.file(file), kept.file(folder)
    os.utime(file, ns=(1, 1))
    os.utime(folder, ns=(1, 1))
    kept.check_inputs()
    (folder / "000001.png").write_text("one")
    with pytest.raises(RecordingError, match="clip  this has changed since the run began"):
        kept.check_inputs()
    file.write_text("two")
    with pytest.raises(RecordingError, match="a.txt  this has changed since the run began"):
        kept.check_inputs()


def test_arrays_count_by_dtype_shape_and_content():
    values = np.arange(6.0)
    assert digests.digest_array(values) == digests.digest_array(values.copy())
    assert len({digests.digest_array(v) for v in (values, values.reshape(2, 3), values.astype("f4"), values + 1)}) == 4
    assert digests.digest_array(np.zeros(2)) != digests.digest_array(np.zeros(2, int))  # the same bytes
    table = values.reshape(2, 3)
    assert digests.digest_array(np.asfortranarray(table)) == digests.digest_array(table)  # however it lies in memory


def test_code_that_has_not_changed_is_read_once(tmp_path, monkeypatch):
    """A plan must not wait for it. The code is new here: that of mocapflow is known to all tests that remember."""
    (tmp_path / "mocapflow_upper.py").write_text("import numpy")
    monkeypatch.syspath_prepend(tmp_path)
    first = Digests(tmp_path / "memory.json")
    code = first.package("mocapflow_upper")
    first.save()
    monkeypatch.setattr(digests.sources, "meaning", lambda tree: pytest.fail("read again"))
    assert Digests(tmp_path / "memory.json").package("mocapflow_upper") == code
    (tmp_path / "sources.py").write_text("")
    for change in ((digests, "PYTHON", " 3.99"), (digests.sources, "__file__", str(tmp_path / "sources.py"))):
        with monkeypatch.context() as patch, pytest.raises(pytest.fail.Exception, match="read again"):
            patch.setattr(*change)  # who read it then may have found something else
            Digests(tmp_path / "memory.json").package("mocapflow_upper")


@pytest.mark.parametrize("text", ["", "{", "[]", "3"])
def test_a_damaged_memory_is_forgotten(tmp_path, text):
    (tmp_path / "memory.json").write_text(text)
    (tmp_path / "a.txt").write_text("one")
    kept = Digests(tmp_path / "memory.json")
    assert kept.file(tmp_path / "a.txt") == Digests().file(tmp_path / "a.txt")
    kept.save()
    assert json.loads((tmp_path / "memory.json").read_text())


def test_digests_that_can_not_be_kept_are_computed_again(tmp_path):
    (tmp_path / "a.txt").write_text("one")
    kept = Digests(tmp_path / "a.txt" / "memory.json")
    kept.file(tmp_path / "a.txt")
    kept.save()


def test_a_causal_input_of_a_track_need_not_read_the_recording():
    causal = SimpleNamespace(stage=SimpleNamespace(causal=True))
    keys = {
        part: recipes._input(SimpleNamespace(named=causal, recipe={"component": 1} | part_of, key="k"), of_chain=True)
        for part, part_of in {
            "none": {},
            "short": {"recording": {"stop": 5}},
            "long": {"recording": {"stop": 9}},
        }.items()
    }
    assert keys["short"] == keys["long"] and set(keys["none"]) == {"key"}
    whole = SimpleNamespace(named=causal, recipe={}, key="k", chain=False)
    assert recipes._input(whole, of_chain=False) == {"key": "k"}  # who reads it to its end depends on where that is


def test_a_file_that_is_not_there_is_named_once(tmp_path):
    with pytest.raises(RecordingError) as caught:
        Digests().file(tmp_path / "cam01.png")
    assert str(caught.value) == f"{tmp_path / 'cam01.png'}  can't be read: No such file or directory"
