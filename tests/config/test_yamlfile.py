import textwrap
from pathlib import Path

import pytest

from mocapflow.config.yamlfile import read
from mocapflow.errors import PipelineError

BASE = """\
recording: ../clip
stages:
  track:
    use: coupled_loop
    draper: kinematic
    matchers: [contour_icp, {use: keypoints, share: 0.5}]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("base.yaml").write_text(BASE)
    return tmp_path


def write(name, text):
    Path(name).write_text(textwrap.dedent(text))
    return Path(name)


def test_every_value_knows_its_place(folder):
    document = read(Path("base.yaml"))
    assert document.values["stages"]["track"]["matchers"][1] == {"use": "keypoints", "share": 0.5}
    assert document.place(("recording",)).text == "base.yaml:1:1"
    assert document.place(("stages", "track", "draper")).text == "base.yaml:5:5"
    assert document.place(("stages", "track", "matchers", 1, "share")).text == "base.yaml:6:46"
    assert document.place(("stages", "track", "not", "there")).text == "base.yaml:3:3"


def test_a_file_extends_another(folder):
    Path("variants").mkdir()
    path = write(
        "variants/xpbd.yaml",
        """\
        extends: ../base.yaml
        change:
          stages.track.draper: {use: xpbd, stiffness: 3}
          stages.track.matchers.0.share: 2
          recording: ../other
          stages.smooth: smooth
        """,
    )
    document = read(path)
    assert document.values == {
        "recording": "../other",
        "stages": {
            "track": {
                "use": "coupled_loop",
                "draper": {"use": "xpbd", "stiffness": 3},
                "matchers": [{"use": "contour_icp", "share": 2}, {"use": "keypoints", "share": 0.5}],
            },
            "smooth": "smooth",
        },
    }
    assert document.place(("stages", "track", "draper", "stiffness")).text == "variants/xpbd.yaml:3:36"
    assert document.place(("recording",)).folder == Path("variants")
    assert document.place(("stages", "track", "use")).text == "base.yaml:4:5"


def test_changes_of_the_command_line_come_last(folder):
    document = read(Path("base.yaml"), ["stages.track.draper.gap_mm=1.5", "frames={start: 3}"])
    assert document.values["stages"]["track"]["draper"] == {"use": "kinematic", "gap_mm": 1.5}
    assert document.values["frames"] == {"start": 3}
    steady = read(Path("base.yaml"), ["stages.track.steady.turns=3"]).values["stages"]["track"]["steady"]
    assert steady == {"turns": 3}  # settings that the file leaves out
    assert document.place(("frames", "start")).text == "--set frames={start: 3}"
    assert read(Path("base.yaml"), ["stages.track.draper="]).values["stages"]["track"]["draper"] is None


def test_what_is_in_a_list_has_its_name_or_its_number(folder):
    def matchers(*changes):
        return read(Path("base.yaml"), changes).values["stages"]["track"]["matchers"]

    other = ["contour_icp", {"use": "keypoints", "share": 2}]
    assert matchers("stages.track.matchers.keypoints.share=2") == matchers("stages.track.matchers.1.share=2") == other
    assert matchers("stages.track.matchers.contour_icp.share=2")[0] == {"use": "contour_icp", "share": 2}
    assert matchers("stages.track.matchers.contour_icp=null")[0] is None
    document = read(Path("base.yaml"), ["stages.track.matchers.keypoints.share=2"])
    assert document.place(("stages", "track", "matchers", 1, "share")).text.startswith("--set")


def test_what_a_list_lacks_is_added_by_its_name(folder):
    def matchers(*changes):
        return read(Path("base.yaml"), changes).values["stages"]["track"]["matchers"]

    first = ["contour_icp", {"use": "keypoints", "share": 0.5}]
    assert matchers("stages.track.matchers.mine=mine") == [*first, "mine"]
    own = {"use": "mine", "share": 2}
    assert matchers("stages.track.matchers.mine={use: mine, share: 2}") == [*first, own]
    assert matchers("stages.track.matchers.mine=mine", "stages.track.matchers.mine.share=2") == [*first, own]
    assert matchers("stages.track.matchers.keypoints=keypoints") == ["contour_icp", "keypoints"]
    document = read(Path("base.yaml"), ["stages.track.matchers.mine={use: mine, share: 2}"])
    assert document.place(("stages", "track", "matchers", 2, "share")).text.startswith("--set")


@pytest.mark.parametrize("value", ["other", "{use: other}", "{share: 2}", "2", "null"])
def test_nothing_is_added_to_a_list_under_another_name(folder, value):
    with pytest.raises(PipelineError, match=r"there is no 'stages.track.matchers.mine'"):
        read(Path("base.yaml"), [f"stages.track.matchers.mine={value}"])


def test_no_third_is_added_where_two_are_alike(folder):
    twice = "stages.track.matchers=[contour_icp, {use: contour_icp, share: 2}]"
    with pytest.raises(PipelineError, match=r"no 'stages.track.matchers.contour_icp'\n +available: 0, 1"):
        read(Path("base.yaml"), [twice, "stages.track.matchers.contour_icp=contour_icp"])


def test_of_two_alike_in_a_list_the_number_tells_which(folder):
    twice = "stages.track.matchers=[contour_icp, {use: contour_icp, share: 2}, keypoints]"
    with pytest.raises(PipelineError, match=r"no 'stages.track.matchers.contour_icp'\n +available: 0, 1, keypoints"):
        read(Path("base.yaml"), [twice, "stages.track.matchers.contour_icp.share=3"])
    changed = read(Path("base.yaml"), [twice, "stages.track.matchers.1.share=3"]).values["stages"]["track"]["matchers"]
    assert changed == ["contour_icp", {"use": "contour_icp", "share": 3}, "keypoints"]


def test_aliases_of_aliases_do_not_fill_the_memory(folder):
    lines = ["a0: &a0 [x]", *(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 12))]
    with pytest.raises(PipelineError, match=r"bomb.yaml:\d+:\d+  holds more than 100,000 values"):
        read(write("bomb.yaml", "\n".join(lines)))


def test_what_looks_like_a_date_or_a_time_is_text(folder):
    values = read(write("times.yaml", "recording: 2024-02-30\n2024-02-03: 10:20\npoint: 1:20.5\n")).values
    assert values == {"recording": "2024-02-30", "2024-02-03": "10:20", "point": "1:20.5"}


def test_a_number_with_leading_zeros_is_text_and_no_octal(folder):
    values = read(write("zeros.yaml", "stop: 060\nback: -010\nlong: 0_10\nnone: 0\nhex: 0x10\n"), ["bins=010"]).values
    assert values == {"stop": "060", "back": "-010", "long": "0_10", "none": 0, "hex": 16, "bins": "010"}


def test_paths_of_changes_start_at_a_folder(folder):
    document = read(Path("base.yaml"), ["recording=clip", "stages.track.file=a.npz"], Path("/there"))
    assert document.place(("recording",)).folder == document.place(("stages", "track", "file")).folder == Path("/there")
    assert document.place(("stages", "track", "use")).folder == Path()


def test_a_stage_can_be_put_before_another(folder):
    changes = ["stages.denoise before track=denoise", "stages.corrupt before denoise={use: corrupt}"]
    stages = read(Path("base.yaml"), changes).values["stages"]
    assert list(stages) == ["corrupt", "denoise", "track"]
    assert stages["corrupt"] == {"use": "corrupt"}
    moved = read(Path("base.yaml"), [*changes, "stages.denoise before corrupt=null"]).values["stages"]
    assert list(moved) == ["denoise", "corrupt", "track"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1", "bad.yaml:1:6  not YAML: expected ',' or ']', but got '<stream end>'"
         " (while parsing a flow sequence)"),
        ("a: 1\nb: c: d\n", "bad.yaml:2:5  not YAML: mapping values are not allowed here"),
        ("a:\n\tb: 1", "bad.yaml:2:1  not YAML: found character '\\t' that cannot start any token"
         " (while scanning for the next token)\n       indent with spaces, not with tabs"),
        ('a: "C:\\data"', "bad.yaml:1:8  not YAML: found unknown escape character 'd'"
         " (while scanning a double-quoted scalar)\n"
         "       in double quotes a backslash begins a special character: write paths with / instead"),
        ("extends: base.yaml\nchanges: {}", "bad.yaml:2:1  'changes' has no place in a file that extends another: "
         "only `extends` and `change` do\n       did you mean 'change'?"),
        ("extends: [base.yaml]", "bad.yaml:1:1  extends: name one file\n       extends: skirt.yaml"),
        ("extends: bad.yaml", "bad.yaml:1:1  the file extends itself\n       name the pipeline that it changes"),
        ("extends: back.yaml", "bad.yaml:1:1  back.yaml extends this file, and this file extends it\n"
         "       one of them has to say its stages"),
        ("a: 1\na: 2", "bad.yaml:2:1  'a' is written twice"),
        ("a: &a [*a]", "bad.yaml  not YAML: values inside of values without an end"),
        ("a: 1\nb: 0x_", "bad.yaml:2:4  not YAML: '0x_' is no int"),
        ("a: !!bool abc", "bad.yaml:1:4  not YAML: 'abc' is no bool"),
        ("b: {1: 2}", "bad.yaml:1:5  a name should be text, not 1: put it in quotes"),
        ("- a", "bad.yaml:1:1  the file should hold `name: value` lines"),
        ("a: \x01", "bad.yaml  not YAML: unacceptable character #x0001: special characters are not allowed"),
        ("extends: base.yaml\nrecording: x", "bad.yaml:2:1  'recording' has no place in a file that extends another: "
         "only `extends` and `change` do\n       write it as change: {recording: ...}"),
        ("extends: middle.yaml",
         "bad.yaml:1:1  middle.yaml itself extends another file; `extends` goes one level deep\n"
         "       extend base.yaml and copy what is under `change` in middle.yaml"),
        ("extends: base.yaml\nchange: 3", "bad.yaml:2:1  change: write `path.to.value: new value` lines"),
        ("extends: base.yaml\nchange:\n  stages.trak.draper: x",
         "bad.yaml:3:3  there is no 'stages.trak'\n       available: track — did you mean 'track'?"),
        ("extends: basis.yaml", "bad.yaml:1:1  extends: basis.yaml: there is no such file\n"
         "       available: back.yaml, bad.yaml, base.yaml, middle.yaml — did you mean 'base.yaml'?"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_line_and_column(folder, text, message):
    write("middle.yaml", "extends: base.yaml")
    write("back.yaml", "extends: bad.yaml")
    with pytest.raises(PipelineError) as caught:
        read(write("bad.yaml", text))
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("draper", "--set draper  a change is written PATH=VALUE"),
        ("=3", "--set =3  a change is written PATH=VALUE"),
        ("a=[1", "--set a=[1  not YAML: expected ',' or ']', but got '<stream end>' (while parsing a flow sequence)"),
        ("stages.track.matchers.7=x", "--set stages.track.matchers.7=x  there is no 'stages.track.matchers.7'\n"
         "       available: contour_icp, keypoints"),
        ("stages.corrupt before trak=x", "--set stages.corrupt before trak=x  "
         "there is no 'stages.trak' to put 'corrupt' before\n       available: corrupt, track — did you mean 'track'?"),
        ("stages.trak=null", "--set stages.trak=null  there is no 'stages.trak' to leave out\n"
         "       available: track — did you mean 'track'?"),
        ("stages.trak before track=null", "--set stages.trak before track=null  "
         "there is no 'stages.trak' to leave out\n       available: track — did you mean 'track'?"),
        ("garment.length_m=1", "--set garment.length_m=1  there is no 'garment'\n       available: recording, stages"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_change(folder, change, message):
    with pytest.raises(PipelineError) as caught:
        read(Path("base.yaml"), [change])
    assert str(caught.value) == message


def test_a_file_that_is_no_text(folder):
    Path("picture.yaml").write_bytes(b"\xff\xd8\xff")
    with pytest.raises(PipelineError, match="picture.yaml  is not UTF-8 text"):
        read(Path("picture.yaml"))


def test_a_folder_without_any_file_is_said_to_have_none(tmp_path):
    (tmp_path / ".hidden.yaml").touch()
    with pytest.raises(PipelineError, match=rf"there is no such file\n +{tmp_path} has no YAML file at all"):
        read(tmp_path / "skirt.yaml")
