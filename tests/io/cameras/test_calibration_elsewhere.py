"""Calibration files read by somebody else: the same points land on the same pixels, to a millionth.

Each reader here shares nothing with ours but the file: another parser, and its format's own projection, written out.
"""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from mocapflow.geometry.cameras import distort, project
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.io.cameras.pose2sim import write_cameras
from tests.fixtures.recordings import ring
from tests.io.cameras.test_calibration import write_easymocap

LENS = (-0.05, 0.14, 0.0006, 0.0007)
POINTS = np.random.default_rng(0).uniform([-0.6, -0.6, 0.4], [0.6, 0.6, 1.6], (200, 3))  # m, before every camera
QUALISYS = """<?xml version='1.0' encoding='ASCII'?>
<calibration created="2024"><results/><cameras>
<camera active="1" model="Miqus Video" serial="26578">
 <fov_video bottom="1939" left="16" right="1103" top="20"/>
 <transform r11="0.5536380477336265" r12="0.8046719867383512" r13="0.2144479094331626"
  r21="-0.4345300743838753" r22="0.05946489349975602" r23="0.8986921279821063"
  r31="0.7104002579937896" r32="-0.5907342212870501" r33="0.3825762057979294"
  x="1460.2323709212087" y="-1909.1590482454608" z="1896.5058524092062"/>
 <intrinsic centerPointU="35134.316" centerPointV="61960.793" focalLengthU="107599.672" focalLengthV="107588.828"
  radialDistortion1="-0.046183" radialDistortion2="0.139983" radialDistortion3="0.01" tangentalDistortion1="0.000608"
  tangentalDistortion2="0.00069" skew="0"/>
</camera></cameras></calibration>
"""


def seen(camera):
    """Where we say that a camera shows the points."""
    return distort(project(POINTS, camera), camera)


def lens(x, y, k1, k2, p1, p2, k3=0.0):
    """Brown's lens as OpenCV, Qualisys and EasyMocap write it: normalised coordinates as they are seen."""
    r = np.hypot(x, y)
    radial = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
    return (
        x * radial + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2),
        y * radial + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y,
    )


def anipose(path):
    """Where anipose and Pose2Sim see the points: `cv2.projectPoints` of what stands in the file."""
    tables = tomllib.loads(path.read_text())
    for table in (tables[name] for name in tables if name != "metadata"):
        numbers = [np.array(table[name], float) for name in ("rotation", "translation", "matrix", "distortions")]
        projected = cv2.fisheye.projectPoints if table["fisheye"] else cv2.projectPoints
        yield projected(POINTS[:, None], *numbers)[0][:, 0]


def easymocap(folder):
    """Where EasyMocap sees the points: K [R | T] and the lens, from the text of the files."""
    text = "".join((folder / name).read_text() for name in ("intri.yml", "extri.yml"))
    matrix = r"^(\w+): !!opencv-matrix\s+rows: (\d+)\s+cols: (\d+)\s+dt: d\s+data: \[(.*?)\]"
    found = re.findall(matrix, text, re.MULTILINE | re.DOTALL)
    matrices = {
        name: np.array([float(x) for x in data.split(",")]).reshape(int(rows), int(columns))
        for name, rows, columns, data in found
    }
    for name in (key.removeprefix("K_") for key in matrices if key.startswith("K_")):
        x, y, z = matrices[f"Rot_{name}"] @ POINTS.T + matrices[f"T_{name}"]
        u, v = lens(x / z, y / z, *matrices[f"dist_{name}"].ravel())
        yield (matrices[f"K_{name}"] @ [u, v, np.ones(len(u))])[:2].T


def qualisys(text):
    """Where Qualisys sees the points: the camera looks along -z with y up; mm, 1/64 px, from the sensor's corner."""
    n = {name: float(value) for name, value in re.findall(r'(\w+)="([-\d.]+)"', text)}
    axes = np.array([[n[f"r{i}{j}"] for j in (1, 2, 3)] for i in (1, 2, 3)])
    x, y, z = axes @ (1000 * POINTS - [n["x"], n["y"], n["z"]]).T
    coefficients = [n[f"{kind}Distortion{k}"] for kind, k in (("radial", 1), ("radial", 2))]
    coefficients += [n["tangentalDistortion1"], n["tangentalDistortion2"], n["radialDistortion3"]]
    u, v = lens(x / -z, -y / -z, *coefficients)
    yield np.column_stack(
        [
            (n["focalLengthU"] * u + n["centerPointU"]) / 64 - n["left"],
            (n["focalLengthV"] * v + n["centerPointV"]) / 64 - n["top"],
        ]
    )


def assert_same_pixels(cameras, others):
    for camera, other in zip(cameras, others, strict=True):
        assert np.abs(seen(camera) - other).max() < 1e-6


def test_what_we_write_and_read_as_toml_is_what_anipose_sees(tmp_path):
    cameras = list(ring(distortion=LENS))
    cameras[1] = replace(cameras[1], distortion=np.array([-0.1, 0.2, 0.003, -0.004, -0.05]))
    cameras[2] = replace(cameras[2], fisheye=True)
    write_cameras(tmp_path / "cameras.toml", cameras)
    assert_same_pixels(read_cameras(tmp_path), anipose(tmp_path / "cameras.toml"))


@pytest.mark.parametrize("vectors", [True, False])
def test_easymocap(tmp_path, vectors):
    write_easymocap(tmp_path, ring(distortion=(*LENS, 0.02)), vectors=vectors)
    assert_same_pixels(read_cameras(tmp_path), easymocap(tmp_path))


def test_qualisys(tmp_path):
    (tmp_path / "trial.qca.txt").write_text(QUALISYS)
    assert_same_pixels(read_cameras(tmp_path), qualisys(QUALISYS))


@pytest.mark.parametrize("clip", ["skirt_steps", "shorts_steps"])
def test_the_shipped_recordings(clip):
    path = Path(__file__).parents[3] / "examples" / "data" / clip / "cameras.toml"
    assert_same_pixels(read_cameras(path), anipose(path))
