"""One run through the command line in every format, each file read back by a library that did not write it."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import readers
from mocapflow_export.formats import FILES

from mocapflow.geometry import angles
from mocapflow.help.shipped import shipped

MOCAPFLOW = Path(sys.executable).with_name("mocapflow")
FRAMES = 3
FORMATS = ["csv", "mot", "trc", *(name for name in FILES if name != "usd" or find_spec("pxr"))]
NEAR = 1e-4  # m
pytestmark = [
    pytest.mark.long,
    pytest.mark.filterwarnings("ignore::PendingDeprecationWarning", "ignore:No analog data"),  # of the readers
]


def call(*words: object, cwd: Path) -> str:
    done = subprocess.run([MOCAPFLOW, *map(str, words)], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stderr


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the run folder of a few frames under a skirt, exported in every format."""
    home = tmp_path_factory.mktemp("exports")
    silent = [part for stage in ("overlay", "virtual", "report") for part in ("--set", f"stages.{stage}=null")]
    wanted = ("--set", f"stages.export.formats=[{','.join(FORMATS)}]")
    call(
        "run", shipped("pipelines", "skirt.yaml"), "--frames", f"0:{FRAMES}", "--out", "run", *silent, *wanted, cwd=home
    )
    return home / "run"


def table(path: Path, heading: int = 0, separator: str = ",") -> dict[str, np.ndarray]:
    """Return the columns of a table whose names stand in line `heading`."""
    found = np.genfromtxt(path, delimiter=separator, names=True, skip_header=heading, deletechars="")
    return {name: found[name] for name in found.dtype.names}


def joints(run: Path, name: str) -> tuple[list[str], np.ndarray]:
    return readers.JOINTS[name](run / "results" / FILES.get(name, "joints.trc"))


@pytest.mark.parametrize("name", sorted({"trc", *FILES} - {"movement", "parquet"}))
def test_joint_centres_agree_to_a_tenth_of_a_millimetre(run: Path, name: str) -> None:
    if name not in FORMATS:
        pytest.skip("the extra usd is not installed")
    known, expected = joints(run, "movement")
    names, places = joints(run, name)
    assert places.shape == expected.shape == (FRAMES, len(known), 3)
    np.testing.assert_allclose(places[:, [names.index(joint) for joint in known]], expected, atol=NEAR)


def test_tables_hold_the_angles_between_these_joints(run: Path) -> None:
    known, places = joints(run, "movement")
    csv = table(run / "results/angles.csv")
    parquet = readers.parquet(run / "results/angles.parquet")
    for wish in angles.definitions(tuple(known)):
        np.testing.assert_allclose(parquet[wish.name], csv[wish.name], atol=1e-4)
        if len(wish.points) == 3:
            between = angles.three_point(places[:, [known.index(joint) for joint in wish.points]]) + wish.offset
            np.testing.assert_allclose(csv[wish.name], between, atol=1e-3)


def test_the_motion_file_places_the_pelvis_and_bends_the_elbows(run: Path) -> None:
    known, places = joints(run, "movement")
    path = run / "results/angles.mot"
    heading = path.read_text().splitlines().index("endheader") + 1
    motion, csv = table(path, heading, "\t"), table(run / "results/angles.csv")
    pelvis = np.stack(
        [motion[f"pelvis_t{axis}"] for axis in "zxy"], axis=-1
    )  # OpenSim's z, x, y are the world's x, y, z
    np.testing.assert_allclose(pelvis, places[:, known.index("pelvis")], atol=NEAR)
    np.testing.assert_allclose(motion["elbow_flex_l"], csv["elbow_l"], atol=1e-3)


def test_view_writes_the_timeline_again(run: Path) -> None:
    before = readers.rerun_entities(run / "results/scene.rrd")
    (run / "results/scene.rrd").unlink()
    said = call("view", "run", "--no-show", cwd=run.parent)
    assert "track: from the store" in said
    after = readers.rerun_entities(run / "results/scene.rrd")
    assert after["/world/joints"]["frame"] == list(range(FRAMES))
    assert set(after) == set(before) >= {"/world/garment", "/world/cam01/image", "/world/cam04/outline"}
