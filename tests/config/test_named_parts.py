"""A recording whose parts a pipeline names one by one."""

from pathlib import Path

import pytest
import yaml

from mocapflow.config.named_parts import folder_of, home, whereabouts
from mocapflow.config.pipeline import load_pipeline
from mocapflow.config.resolve import Resolver
from mocapflow.config.yamlfile import read
from mocapflow.errors import MocapflowError, PipelineError
from mocapflow.registry import Registry
from mocapflow.running.runner import prepare, run
from tests.fixtures.stores import actions, load, write_pipeline, write_recording

PARTS = {"cameras": "lab/rig.toml", "videos": {"cam01": "a.mp4", "cam02": "b.mp4"}}


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def spread(tmp_path):
    """Lay the parts of a recording where no folder has them, and return a pipeline that names them."""
    clip = write_recording(tmp_path / "clip", video=True)
    (tmp_path / "lab").mkdir()
    (clip / "cameras.toml").rename(tmp_path / "lab/rig.toml")
    (clip / "videos/cam01.mp4").rename(tmp_path / "a.mp4")
    (clip / "videos/cam02.mp4").rename(tmp_path / "b.mp4")
    return write_pipeline(tmp_path, PARTS)


def laid_out(folder, **parts):
    """Return what the folder of links holds that a pipeline with these parts gets."""
    file = folder / "mine.yaml"
    file.write_text(yaml.safe_dump({"recording": PARTS | parts}, sort_keys=False))
    document = read(file)
    found = whereabouts(folder_of(document.values["recording"], "mine", Resolver(document, Registry())))
    return {link: Path(path).relative_to(folder).as_posix() for link, path in found.items() if link not in BASE}


BASE = ("cameras.toml", "videos/cam01.mp4", "videos/cam02.mp4")


def touched(folder, *names):
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).touch()


def refused(folder, **parts):
    with pytest.raises(MocapflowError) as caught:
        laid_out(folder, **parts)
    return str(caught.value).replace(str(folder), "HERE")


def keys(pipeline, store):
    return {step.label: step.key for step in prepare(pipeline, store=store).steps}


def test_named_parts_run_with_the_keys_of_a_folder(tmp_path, spread):
    store, whole = tmp_path / "store.zarr", write_recording(tmp_path / "whole", video=True)
    (whole / "subject.txt").unlink()
    expected = keys(load(spread, f"recording={whole}"), store)
    assert keys(load(spread), store) == expected
    summary = run(load(spread, frames=3), store=store, out=tmp_path / "out")
    assert actions(summary)["track"] == "run"
    again = run(load(spread, f"recording={whole}", frames=3), store=store, out=tmp_path / "other")
    assert actions(again)["track"] == "hit"
    (tmp_path / "b.mp4").write_bytes((tmp_path / "a.mp4").read_bytes())
    assert keys(load(spread), store)["track"] != expected["track"]


def test_the_option_replaces_all_parts(tmp_path, spread):
    other = write_recording(tmp_path / "other")
    assert load_pipeline(spread, recording=other).recording == other


def test_a_change_names_one_part_from_where_it_is_written(tmp_path, spread, monkeypatch):
    touched(tmp_path, "start.json")
    monkeypatch.chdir(tmp_path)
    found = whereabouts(load(Path("tiny.yaml"), "recording.init=start.json").recording)
    assert found == {
        "cameras.toml": f"{tmp_path}/lab/rig.toml", "init.json": f"{tmp_path}/start.json",
        "videos/cam01.mp4": f"{tmp_path}/a.mp4", "videos/cam02.mp4": f"{tmp_path}/b.mp4",
    }  # fmt: skip


def test_each_part_goes_where_a_recording_folder_has_it(tmp_path, spread):
    touched(tmp_path, "p/one.png", "kp/0.json", "p.json", "p2.json", "late.json", "scan.obj", "walk.c3d", "known.csv")
    assert laid_out(
        tmp_path, background={"cam01": "p/one.png", "cam02": "p"}, keypoints={"cam01": "kp"}, init="p.json",
        init_001200="p2.json", late_frames="late.json", subject={"body": "scan.obj"}, static="clip",
        truth="known.csv", reference="walk.c3d",
    ) == {
        "background/cam01.png": "p/one.png", "background/cam02": "p", "keypoints/cam01": "kp", "init.json": "p.json",
        "init_001200.json": "p2.json", "recording.json": "late.json", "subject/body.obj": "scan.obj", "static": "clip",
        "truth/angles.csv": "known.csv", "reference/reference.c3d": "walk.c3d",
    }  # fmt: skip
    assert laid_out(tmp_path, subject="clip", reference={"markers": "late.json"}) == {
        "subject": "clip", "reference/markers.json": "late.json",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("files", "named", "links"),
    [
        (["lab/x.qca.txt"], "lab/x.qca.txt", {"cameras.qca.txt": "lab/x.qca.txt"}),
        (["e/intri.yml", "e/extri.yml"], "e", {"intri.yml": "e/intri.yml", "extri.yml": "e/extri.yml"}),
        (["e/intri.yml", "e/extri.yml"], "e/intri.yml", {"intri.yml": "e/intri.yml", "extri.yml": "e/extri.yml"}),
    ],
)
def test_cameras_are_of_any_known_format(tmp_path, spread, files, named, links):
    touched(tmp_path, *files)
    assert laid_out(tmp_path, cameras=named) == links


def test_what_is_wrong_is_told_by_its_line(tmp_path, spread):
    parts = "background, cameras, init, keypoints, late_frames, occluders, reference, static, subject, truth, videos"
    assert refused(tmp_path, vidoes="clip") == (
        "HERE/mine.yaml:6:3  recording.vidoes: no part of a recording\n"
        f"       available: {parts} — did you mean 'videos'?"
    )
    assert refused(tmp_path, init="lab/rig.tml") == (
        "HERE/mine.yaml:6:3  recording.init: there is no file HERE/lab/rig.tml\n"
        "       in HERE/lab: rig.toml — did you mean 'rig.toml'?"
    )
    assert refused(tmp_path, videos="a.mp4") == (
        "HERE/mine.yaml:3:3  recording.videos: there is no folder HERE/a.mp4\n       in HERE: clip, lab"
    )
    assert refused(tmp_path, subject={"bdoy": "a.mp4"}) == (
        "HERE/mine.yaml:7:5  recording.subject.bdoy: no part of subject\n"
        "       available: body, garment, skeleton, weights — did you mean 'body'?\n"
        "       for other files name the folder: subject: DIR"
    )
    touched(tmp_path, *(f"poses/{number:02}.json" for number in range(40)))
    assert refused(tmp_path, init="poses/39.jsn").endswith("28.json, 29.json and 10 more — did you mean '39.json'?")
    assert refused(tmp_path, init=3) == "HERE/mine.yaml:6:3  recording.init: a path is expected, not 3"
    (tmp_path / "few.yaml").write_text("recording: {cameras: lab/rig.toml}\n")
    with pytest.raises(PipelineError, match=r"few.yaml:1:1  recording: a recording needs videos"):
        folder_of({"cameras": "lab/rig.toml"}, "few", Resolver(read(tmp_path / "few.yaml"), Registry()))


@pytest.mark.parametrize("named", ["clip/videos", "{cam01: clip/videos, cam02: b.mp4}"])
def test_a_run_among_the_named_parts_is_refused(tmp_path, spread, named):
    pipeline = load_pipeline(spread, changes=[f"recording.videos={named}"], folder=tmp_path)
    with pytest.raises(PipelineError, match="among the files of the recording"):
        run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "clip/videos/out")


def test_a_cache_that_cant_be_written_is_told(spread):
    home().parent.mkdir(parents=True)
    home().touch()
    with pytest.raises(MocapflowError, match="XDG_CACHE_HOME names another place"):
        load(spread)


def test_a_user_without_a_home_can_run_a_folder_and_is_told_where_links_could_lie(tmp_path, spread, monkeypatch):
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", nowhere)
    assert whereabouts(tmp_path / "clip") == str(tmp_path / "clip")
    with pytest.raises(MocapflowError, match="XDG_CACHE_HOME names a place"):
        load(spread)
