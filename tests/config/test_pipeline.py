import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from mocapflow.assets import Body
from mocapflow.config.experiment import load_experiment
from mocapflow.config.pipeline import load_pipeline
from mocapflow.errors import MocapflowError, PluginError
from mocapflow.help.shipped import shipped
from mocapflow.hookspecs import hookimpl
from mocapflow.registry import Origin, load_registry
from mocapflow.running.wiring import Itself, latest, wire
from tests.fixtures import small_plugins

TEXT = """\
recording: clip
garment: skirt
stages:
  start: start
  track:
    use: coupled_loop
    draper: kinematic
    matchers: [contour_icp, {use: contour_icp, share: 0.5}]
    steady: {turns: 3}
  smooth: smooth
  export: export
"""
MEASURES = {"type": "skirt", "waist_height": 1.05, "waist_circumference": 0.75, "hem_circumference": 1.5, "length": 0.7}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("clip/subject").mkdir(parents=True)
    Path("clip/subject/garment.json").write_text(json.dumps(MEASURES))
    Path("skirt.yaml").write_text(TEXT)
    return tmp_path


def load(*changes, **options):
    return load_pipeline(Path("skirt.yaml"), small_plugins.registry(), changes=changes, **options)


def test_names_become_components(folder):
    pipeline = load()
    assert pipeline.name == "skirt"
    assert pipeline.recording == Path("clip")
    assert pipeline.body == small_plugins.Scanned()
    assert [named.label for named in pipeline.stages] == ["start", "track", "smooth", "export"]
    track = pipeline.stages[1].stage
    assert track.draper == small_plugins.Kinematic()
    assert [matcher.share for matcher in track.matchers] == [1.0, 0.5]
    assert load("stages.track.matchers=contour_icp").stages[1].stage.matchers == (small_plugins.Contours(),)
    assert track.steady.turns == 3
    assert pipeline.stages[1].where == "skirt.yaml:5:3"
    assert (pipeline.start, pipeline.stop, pipeline.step, pipeline.scale) == (0, None, 1, 1.0)


def test_measures_come_from_the_recording_and_the_file_overrides_them(folder):
    assert load().garment.length_m == 0.7
    assert load("garment.length_m=0.9").garment.length_m == 0.9
    assert load("garment=from_recording").garment == load().garment
    assert load("garment={use: from_recording, length_m: 0.9}").garment.length_m == 0.9
    assert load("garment=null").garment is None


def test_relative_paths_start_at_the_file_they_stand_in(folder, monkeypatch):
    Path("elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    Path("here").mkdir()
    registry = small_plugins.registry()
    pipeline = load_pipeline(Path("../skirt.yaml"), registry, changes=["stages.track.file=a.npz"])
    assert pipeline.recording == Path("../clip")
    assert pipeline.stages[1].stage.file == Path("a.npz").absolute()
    changed = load_pipeline(Path("../skirt.yaml"), registry, recording=Path("here"), changes=["garment=null"])
    assert changed.recording == Path("here")


def test_frames(folder):
    pipeline = load("frames={start: 2, stop: 9}")
    assert (pipeline.start, pipeline.stop, pipeline.step) == (2, 9, 1)
    pipeline = load("frames={start: 2, stop: 9}", frames=slice(None, 60, 2))
    assert (pipeline.start, pipeline.stop, pipeline.step) == (0, 60, 2)
    assert load("frames.stop=010").stop == 10
    Path("skirt.yaml").write_text(TEXT + "frames: 1:30\n")
    assert (load().start, load().stop, load().step) == (1, 30, 1)
    with pytest.raises(MocapflowError, match=r"frames: frames are written A:B or A:B:STEP"):
        load("frames=some")
    with pytest.raises(MocapflowError, match=r"frames: frames are written A:B or A:B:STEP"):
        load("frames=20")


@pytest.mark.parametrize("frames", ["{start: 2, step: 3}", "2::3"])
def test_frames_that_are_given_keep_the_step_of_the_file(folder, frames):
    Path("skirt.yaml").write_text(TEXT + f"frames: {frames}\n")
    kept, given = load(frames=slice(0, 6)), load(frames=slice(None, 6, 1))
    assert (kept.start, kept.stop, kept.step) == (0, 6, 3)
    assert (given.start, given.stop, given.step) == (0, 6, 1)


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        (slice(5, 5), "--frames 5:5  frames: 5:5 holds no frame"),
        (slice(None, 0), "--frames :0  frames: 0:0 holds no frame"),
        (slice(0, 6, 0), "--frames 0:6:0  frames.step: input should be greater than 0, not 0"),
    ],
)
def test_frames_that_are_given_are_told_as_such(folder, frames, message):
    Path("skirt.yaml").write_text(TEXT + "frames: {start: 2, step: 2}\n")
    with pytest.raises(MocapflowError) as caught:
        load(frames=frames)
    assert str(caught.value) == message


def test_the_version_of_a_file_that_extends_another_counts(folder):
    Path("other.yaml").write_text("mocapflow: 99\nextends: skirt.yaml\n")
    with pytest.raises(MocapflowError, match="other.yaml:1:1  mocapflow: input should be 1, not 99"):
        load_pipeline(Path("other.yaml"), small_plugins.registry())


def test_a_plugin_file_is_named_once(folder):
    Path("dress.py").write_text("")
    Path("skirt.yaml").write_text("plugins: [dress.py, ./dress.py]\n" + TEXT)
    with pytest.raises(MocapflowError) as caught:
        load_pipeline(Path("skirt.yaml"))
    assert str(caught.value) == "skirt.yaml:1:21  plugins.1: this file is named twice"


def test_what_starts_parts_is_looked_up_though_there_are_none(folder):
    with pytest.raises(MocapflowError, match=r"parts\.start: no stage named 'nothing'\n       available: "):
        load("parts.start=nothing")


def test_an_entry_of_a_list_is_left_out_by_null(folder):
    matchers = load("stages.track.matchers=[contour_icp, {use: contour_icp, share: 2}]", "stages.track.matchers.0=null")
    assert matchers.stages[1].stage.matchers == (small_plugins.Contours(share=2),)


def test_a_stage_is_left_out_by_null(folder):
    assert [named.label for named in load("stages.smooth=null").stages] == ["start", "track", "export"]


def test_a_plugin_file_named_by_the_pipeline(folder):
    Path("dress.py").write_text(
        "from mocapflow import Garment, hookimpl\n"
        "class Dress(Garment):\n    name = 'dress'\n    length_m: float = 1.2\n    def sew(self, body): ...\n"
        "@hookimpl\ndef mocapflow_garments():\n    return [Dress]\n"
    )
    Path("dress.yaml").write_text(
        "recording: clip\nplugins: [dress.py]\ngarment: dress\nstages: {start: start_from_file}\n"
    )
    assert load_pipeline(Path("dress.yaml")).garment.length_m == 1.2
    Path("dress.py").write_text("import nothing_like_it\n")
    with pytest.raises(MocapflowError) as caught:
        load_pipeline(Path("dress.yaml"))
    assert str(caught.value) == (
        "dress.yaml:2:11  plugins.0: plugin 'dress' (dress.py) did not load: "
        "ModuleNotFoundError: No module named 'nothing_like_it'"
    )


@pytest.mark.parametrize(
    ("written", "instead", "message"),
    [
        ("draper: kinematic", "draper: kinematik",
         "skirt.yaml:7:5  stages.track.draper: no draper named 'kinematik'\n"
         "       available: kinematic — did you mean 'kinematic'?"),
        ("garment: skirt", "garment: {use: skirt, lenght_m: 0.7}",
         "skirt.yaml:2:23  garment.lenght_m: unknown setting of skirt (hem_circumference_m, length_m, "
         "waist_circumference_m, waist_height_m)\n       did you mean 'length_m'?"),
        ("share: 0.5", "share: -1, shares: 2",  # what is wrong comes first, but for what is missing
         "skirt.yaml:8:48  stages.track.matchers.1.share: input should be greater than 0, not -1"),
        ("share: 0.5", "share: -1",
         "skirt.yaml:8:48  stages.track.matchers.1.share: input should be greater than 0, not -1"),
        ("share: 0.5", "share: yes",
         "skirt.yaml:8:48  stages.track.matchers.1.share: input should be a number, not true or false"),
        ("share: 0.5", "share: .inf",
         "skirt.yaml:8:48  stages.track.matchers.1.share: input should be a finite number, not inf"),
        ("turns: 3", "turns: many",
         "skirt.yaml:9:14  stages.track.steady.turns: input should be a valid integer, unable to parse string as an "
         "integer, not 'many'"),
        ("turns: 3", "turn: 3",
         "skirt.yaml:9:14  stages.track.steady.turn: unknown setting of steady (turns)\n       did you mean 'turns'?"),
        ("    matchers: [contour_icp, {use: contour_icp, share: 0.5}]\n", "",
         "skirt.yaml:5:3  stages.track: coupled_loop needs matchers"),
        ("draper: kinematic", "draper: [kinematic]",
         "skirt.yaml:7:5  stages.track.draper: name a draper, as `name` or as {use: name, setting: value}\n"
         "       available: kinematic"),
        ("draper: kinematic", "draper: {sweeps: 4}",
         "skirt.yaml:7:5  stages.track.draper: name a draper, as `name` or as {use: name, setting: value}\n"
         "       available: kinematic\n       to change a part of it alone, write stages.track.draper.sweeps: ..."),
        ("smooth: smooth", "smooth: {from: 3, use: smooth}",
         "skirt.yaml:10:12  stages.smooth.from: write {parameter: label of an earlier stage}"),
        ("recording: clip", "recording: clap",
         "skirt.yaml:1:1  there is no such folder: clap\n"
         "       --recording DIR names another"),
        ("recording: clip", "recording: ~nobody-here/clip",
         "skirt.yaml:1:1  there is no such folder: ~nobody-here/clip\n"
         "       --recording DIR names another"),
        ("matchers: [contour_icp, {use: contour_icp, share: 0.5}]", "matchers: []",
         "skirt.yaml:8:5  stages.track.matchers: needs at least 1 entry"),
        ("recording: clip\n", "",
         "skirt.yaml:1:1  no recording: write `recording: DIR`, or give --recording DIR"),
        ("recording: clip", "recording: clip\nspeed: 3",
         "skirt.yaml:2:1  speed: unknown setting of a pipeline (body, frames, garment, mocapflow, parts, plugins, "
         "recording, scale, stages)"),
        ("stages:", "stagess:",
         "skirt.yaml:3:1  stagess: unknown setting of a pipeline (body, frames, garment, mocapflow, parts, plugins, "
         "recording, scale, stages)\n       did you mean 'stages'?"),
        ("smooth: smooth", "a/b: smooth", "skirt.yaml:10:3  no stage can be called 'a/b'\n"
         "       its name is that of files: letters, digits, _ and -"),
        ("smooth: smooth", "../x: smooth", "skirt.yaml:10:3  no stage can be called '../x'\n"
         "       its name is that of files: letters, digits, _ and -"),
        ("recording: clip", "recording: clip\nframes: {start: 9, stop: 2}",
         "skirt.yaml:2:1  frames: 9:2 holds no frame"),
        ("matchers: [contour_icp, {use: contour_icp, share: 0.5}]", "matchers: null",
         "skirt.yaml:8:5  stages.track.matchers: name a matcher, as `name` or as {use: name, setting: value}\n"
         "       available: contour_icp"),
        ("recording: clip", "recording: clip\nparts: 3",
         "skirt.yaml:2:1  parts: input should be `name: value` lines, not 3"),
        ("recording: clip", "recording: clip\nplugins: mine.py",
         "skirt.yaml:2:1  plugins: input should be a list, not 'mine.py'"),
        ("recording: clip", "recording: clip\nfactors: {}",
         "skirt.yaml:2:1  this is an experiment, no pipeline\n       `mocapflow compare` runs one"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(folder, written, instead, message):
    Path("skirt.yaml").write_text(TEXT.replace(written, instead))
    with pytest.raises(MocapflowError) as caught:
        load()
    assert str(caught.value) == message
    assert caught.value.exit_status == 2


@pytest.mark.parametrize(
    "error, said",
    [
        (RuntimeError("no GPU here"), "can't be made: RuntimeError: no GPU here"),
        (SystemExit(0), "can't be made: it left with status 0"),
        (RuntimeError(), "can't be made: RuntimeError"),
        (PluginError("no GPU here", hint="rent one"), "no GPU here\n       rent one"),
    ],
)
def test_whatever_the_validator_of_a_plugin_raises_is_told_with_its_line(folder, error, said):
    class Picky(small_plugins.Kinematic):
        name = "picky"

        def model_post_init(self, context):
            raise error

    registry = small_plugins.registry()
    registry.add(Origin("p", "p", "1"), lambda: SimpleNamespace(mocapflow_drapers=hookimpl(lambda: [Picky])))
    Path("skirt.yaml").write_text(TEXT.replace("draper: kinematic", "draper: picky"))
    with pytest.raises(MocapflowError) as caught:
        load_pipeline(Path("skirt.yaml"), registry)
    picky = "" if isinstance(error, MocapflowError) else "picky "
    assert str(caught.value) == f"skirt.yaml:7:5  stages.track.draper: {picky}{said}"


def test_a_change_of_what_is_not_there_is_told_as_such(folder):
    with pytest.raises(
        MocapflowError, match=r"^--set stages.track.nope.x=3  stages.track.nope: unknown setting of cou"
    ):
        load("stages.track.nope.x=3")


def test_a_recording_without_measures(folder):
    Path("clip/subject/garment.json").unlink()
    with pytest.raises(MocapflowError) as caught:
        load()
    file = Path("clip/subject/garment.json")
    assert str(caught.value) == (
        "skirt.yaml:2:1  garment: skirt needs waist_height_m, waist_circumference_m, hem_circumference_m, length_m\n"
        f"       measures, in metres, come from {file}, which does not exist; a value in the pipeline overrides them"
    )
    with pytest.raises(MocapflowError, match="^clip  no calibration file"):  # a wrong folder is told as such
        load("garment=from_recording")
    Path("clip/cameras.toml").touch()
    with pytest.raises(MocapflowError, match=r"garment.json  the pipeline takes the garment(.|\n)*garment: null"):
        load("garment=from_recording")


def test_measures_of_another_garment_are_not_used(folder):
    Path("clip/subject/garment.json").write_text(json.dumps({**MEASURES, "type": "shorts"}))
    with pytest.raises(MocapflowError, match=r"garment: skirt needs waist_height_m, .*\n.*which describes a shorts"):
        load()


def test_of_two_garments_of_one_name_no_measures_are_told(folder):
    registry = small_plugins.registry()
    other = SimpleNamespace(mocapflow_garments=hookimpl(lambda: [small_plugins.Skirt]))
    registry.add(Origin("other", "other", "1.0"), lambda: other)
    with pytest.raises(PluginError, match="two plugins provide a garment named 'skirt'") as caught:
        load_pipeline(Path("skirt.yaml"), registry)
    assert caught.value.hint == "uninstall one of them, or give its component another name"


def test_a_wrong_measure_is_told_with_the_file_it_comes_from(folder):
    Path("clip/subject/garment.json").write_text(json.dumps({**MEASURES, "length": "69 cm"}))
    said = r"^clip/subject/garment.json:1:\d+  garment.length: .* not '69 cm'\n.*in metres, come from clip"
    with pytest.raises(MocapflowError, match=said):
        load()


def test_measures_may_carry_their_unit_and_are_told_as_they_are_written(folder):
    file = Path("clip/subject/garment.json")
    with_units = {key if key == "type" else f"{key}_m": value for key, value in MEASURES.items()}
    file.write_text(json.dumps(with_units))
    assert load("garment=from_recording").garment == load().garment
    file.write_text(json.dumps({**MEASURES, "length_m": 0.8}))
    with pytest.raises(
        MocapflowError, match=r"^clip/subject/garment.json:1:\d+  'length' and 'length_m' are one measure"
    ):
        load("garment=from_recording")
    file.write_text(json.dumps({**MEASURES, "colour": 3}))
    with pytest.raises(MocapflowError, match=r"^clip/subject/garment.json:1:\d+  garment.colour: unknown setting"):
        load("garment=from_recording")
    file.write_text(json.dumps({key: value for key, value in MEASURES.items() if key != "length"}))
    with pytest.raises(MocapflowError, match=r"^clip/subject/garment.json:1:11  garment: skirt needs length_m\n"):
        load("garment=from_recording")
    file.write_text(file.read_text().replace("waist_height", "waist_hieght"))
    with pytest.raises(
        MocapflowError, match=r"^clip/subject/garment.json:1:\d+  garment.waist_hieght: .*\n.*height_m'"
    ):
        load("garment=from_recording")
    file.write_text(json.dumps({key: value for key, value in MEASURES.items() if key != "length"}))
    with pytest.raises(MocapflowError, match=r"^--set .*  garment: skirt needs length_m\n"):  # it has a say, too
        load("garment={use: from_recording, waist_height_m: 1.1}")


@pytest.mark.parametrize("stages", ["{}", "{start: null}"])
def test_a_pipeline_without_stages_is_refused(folder, stages):
    Path("empty.yaml").write_text(f"recording: clip\nstages: {stages}\n")
    with pytest.raises(MocapflowError, match=r"^empty.yaml:2:\d+  a pipeline needs stages$"):
        load_pipeline(Path("empty.yaml"), small_plugins.registry())


def test_an_unknown_garment_is_told_where_it_is_named(folder):
    assert load().garment_where == "skirt.yaml:2:1"
    Path("clip/subject/garment.json").write_text(json.dumps({**MEASURES, "type": "skrit"}))
    with pytest.raises(MocapflowError, match=r"^clip/subject/garment.json:1:11  .*no garment named 'skrit'\n.*'skirt'"):
        load("garment=from_recording")


@pytest.mark.parametrize(
    ("text", "said"),
    [("{", ":1:2  not JSON: "), ("[]", "  it does not say its type"), ('{"length": 3}', "  it does not say its type")],
)
def test_measures_that_can_not_be_read(folder, text, said):
    Path("clip/subject/garment.json").write_text(text)
    with pytest.raises(MocapflowError, match=f"clip/subject/garment.json{said}"):
        load()


def test_stages_are_wired_by_type(folder):
    assert wire(load()) == {
        "start": {"scene": "scene"},
        "track": {"scene": "scene", "start": "start", "background": None},
        "smooth": {"track": "track"},
        "export": {"track": "smooth", "folder": "run folder"},
    }


def test_what_would_make_an_input_is_named(folder):
    Path("skirt.yaml").write_text(TEXT.replace("  start: start\n", ""))
    with pytest.raises(MocapflowError, match=r"needs a Start but no earlier stage makes one\n       available: start"):
        wire(load())


def test_from_overrides_the_nearest(folder):
    assert wire(load("stages.export.from={track: track}"))["export"]["track"] == "track"


def test_a_stage_may_be_handed_another_one_itself(folder):
    Path("skirt.yaml").write_text(
        TEXT.replace("  track:\n", "  first: {use: coupled_loop, matchers: contour_icp}\n  track:\n").replace(
            "  export:", "  again: again\n  export:"
        )
    )
    again = wire(load())["again"]
    assert again == {"track": "smooth", "loop": Itself("track")} and isinstance(again["loop"], Itself)
    named = wire(load("stages.again.from={loop: first, track: track}"))["again"]
    assert named == {"track": "track", "loop": Itself("first")}


def test_a_stage_that_makes_a_body_replaces_it_for_later_stages(folder):
    Path("skirt.yaml").write_text(TEXT.replace("  start: start\n", "  start: start\n  fit: fit\n"))
    pipeline = load()
    labels = [named.label for named in pipeline.stages]
    assert latest(Body, pipeline.stages[: labels.index("fit")]) is None
    assert latest(Body, pipeline.stages[: labels.index("track")]) == "fit"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("stages.start=start_late",
         "--set stages.start=start_late  stage 'start' needs a Background but no earlier stage makes one\n"
         "       available: none"),
        ("stages.export.from={track: start}",
         "--set stages.export.from={track: start}  "
         "stage 'export' wants its track from 'start', but no earlier 'start' makes one\n"
         "       available: smooth, track"),
        ("stages.export.from={trak: track}",
         "--set stages.export.from={trak: track}  stage 'export' has no input 'trak'\n"
         "       available: folder, track — did you mean 'track'?"),
        ("stages.start=again",
         "--set stages.start=again  stage 'start' needs a stage coupled_loop before it\n"
         "       available: none"),
        ("stages.export={use: again, from: {loop: start}}",
         "--set stages.export={use: again, from: {loop: start}}  "
         "stage 'export' needs a stage coupled_loop before it\n"
         "       available: track"),
        ("stages.export=untyped", "--set stages.export=untyped  stage 'export': untyped: run needs a type for track"),
        ("stages.export=listed",
         "--set stages.export=listed  "
         "stage 'export': listed: run takes tracks as list[mocapflow.results.Track], which no stage makes\n"
         "       it takes X, `X | None`, or `tuple[X, ...]` for all of that type, where X is the type of a result"),
        ("stages.export=either",
         "--set stages.export=either  "
         "stage 'export': either: run takes found as mocapflow.results.Track | mocapflow.data.Start, "
         "which no stage makes\n"
         "       it takes X, `X | None`, or `tuple[X, ...]` for all of that type, where X is the type of a result"),
        ("stages.export=unkept",
         "--set stages.export=unkept  "
         "stage 'export': unkept: run returns dict[str, float], which the store can't keep\n"
         "       put what it makes into a dataclass of its own; return Files, with their paths, if it writes files"),
    ],
)  # fmt: skip
def test_wiring_that_does_not_work(folder, change, message):
    with pytest.raises(MocapflowError) as caught:
        wire(load(change))
    assert str(caught.value) == message


def test_a_source_that_is_wrong_is_told_where_it_is_written(folder):
    Path("skirt.yaml").write_text(
        TEXT.replace("export: export", "export:\n    use: export\n    from:\n      track: start")
    )
    with pytest.raises(MocapflowError, match=r"^skirt.yaml:14:7  stage 'export' wants its track from 'start'"):
        wire(load())


def test_a_stage_is_not_called_like_an_input(folder):
    Path("skirt.yaml").write_text(TEXT.replace("  start: start", "  scene: start"))
    with pytest.raises(MocapflowError, match="skirt.yaml:4:3  no stage can be called 'scene': inputs have that name"):
        wire(load())


EXTRAS = {"skirt_xpbd": "newton"}  # what a pipeline needs beyond the base install


def shipped_files(experiments):
    files = sorted(shipped("pipelines").glob("*.yaml"))
    return [file for file in files if ("\nfactors:" in file.read_text()) == experiments]


@pytest.mark.parametrize("file", shipped_files(experiments=True), ids=lambda file: file.name)
@pytest.mark.long
def test_every_cell_of_a_shipped_experiment_loads(file):
    for cell in load_experiment(file):
        options = {"recording": cell.recording, "changes": cell.changes, "folder": cell.folder}
        assert wire(load_pipeline(cell.pipeline, load_registry(), **options))


@pytest.mark.parametrize("file", shipped_files(experiments=False), ids=lambda file: file.name)
def test_every_shipped_pipeline_loads_and_is_wired(file):
    if file.stem in EXTRAS:
        pytest.importorskip(EXTRAS[file.stem])
    pipeline = load_pipeline(file, load_registry(), recording=shipped("examples", "data", "skirt_steps"))
    assert wire(pipeline)


CHAPTER = {  # what the chapter, or the specification of it where it is silent, says of each step
    "segmenter": dict(
        name="levelset", use_background=False, decorrelate=False, rho_px=12.0, sigma_px=1.5, length_weight=0.5,
        shape_weight=0.05, variance_floor=0.02, steps=50, later_steps=20, cell_px=1, stride_px=1, statistics_every=1,
        coarse_steps=0, half_steps=0, contact_steps=0, keep_px=0.0,
    ),
    "matchers": dict(
        name="contour_icp", direction="both", residual="point", first_loss="zhang", later_loss="zhang", scale=6.0,
        spacing_px=4.0, first_reach_px=40.0, later_reach_px=10.0, cloth_sigma_px_per_m=0.0, hem_guard_px=0.0,
    ),
    "pose_solver": dict(
        residual="line", steps_per_match=4, iterations=10, damping=1e-4, correlation_px=0.0, cloth_unknowns=False,
        balance_views=False, cap_deg=10.0, cap_mm=100.0,
    ),
    "draper": dict(
        rule="literal", skin_m=0.004, step_deg=2.0, iterations=50, limited=False, pivot="strand", sweeps=40,
        longest=1.1, stiff=0.0, bending_m=0.0,
    ),
    "cloth_fitter": dict(name="sampled_forces", directions=8, amounts_deg=(5.0, 10.0, 20.0), least_gain=0.01),
    "steady": dict(surface_mm=0.5, angle_deg=0.1, energy_share=0.001, turns=2, max_turns=8, sigmas=(), far_turns=0),
}  # fmt: skip


@pytest.mark.parametrize("step", CHAPTER)
def test_the_chapters_pipeline_is_the_chapters(step):
    pipeline = load_pipeline(shipped("pipelines", "paper.yaml"), load_registry())
    track = next(named.stage for named in pipeline.stages if named.label == "track")
    component = track.matchers[0] if step == "matchers" else getattr(track, step)
    assert {name: getattr(component, name) for name in CHAPTER[step]} == CHAPTER[step]
    assert len(track.matchers) == 1 and not track.priors and track.recovery is None
