"""A recording whose keypoints are known: the landmarks of a posed body, projected, with a bystander."""

import json
import shutil
from functools import cache
from pathlib import Path

import numpy as np
from mocapflow_bodies.template import Template
from mocapflow_fitting.keypoint_layouts import LAYOUTS
from mocapflow_fitting.landmarks import landmarks

from mocapflow.data import Pose
from mocapflow.geometry import kinematics
from mocapflow.geometry.cameras import project

DEMO = Path(__file__).parents[2] / "examples" / "data" / "skirt_steps"
NAMES = LAYOUTS["body_25b"]


@cache
def template():
    """Return the person of the demo as the template makes it."""
    return Template().load(DEMO)


def length(body, a, b):
    """Return how far (m) apart two joints of a body are."""
    return np.linalg.norm(body.positions[body.joint(a)] - body.positions[body.joint(b)])


def keypoints(body, pose, camera, rng, noise_px, confidence=0.8):
    """Return (25, 3): the landmarks the body has, the others unseen."""
    marks = landmarks(body)
    return seen(marks, places(marks, pose), camera, rng, noise_px, confidence)


def places(marks, pose):
    """Return where (L, 3) m the landmarks of a body are at a pose."""
    return kinematics.skin(marks.body, kinematics.chain(marks.body, pose)[0], pose.angles)


def seen(marks, points, camera, rng, noise_px, confidence):
    """Return (25, 3): what a camera sees of landmarks (L, 3) m."""
    pixels = project(points, camera) + rng.normal(scale=noise_px, size=(len(points), 2))
    rows = np.zeros((len(NAMES), 3))
    for name, pixel in zip(marks.names, pixels, strict=True):
        rows[NAMES.index(name)] = (*pixel, confidence)
    return rows


def bystander_of(pose):
    root = pose.root.copy()
    root[:3, 3] += (0.5, 0.9, 0.0)
    return Pose(root=root, angles=0.3 * pose.angles)


def write(folder, body, poses, cameras, seed=0, noise_px=0.5, bystander=(0, 2)):
    """Write keypoints of one person in all cameras and of a bystander, listed first, in some."""
    rng, marks = np.random.default_rng(seed), landmarks(body)
    for index, pose in enumerate(poses):
        points, others = places(marks, pose), places(marks, bystander_of(pose))
        for c, camera in enumerate(cameras):
            people = [seen(marks, points, camera, rng, noise_px, 0.8)]
            if c in bystander:
                people.insert(0, seen(marks, others, camera, rng, noise_px, 0.7))
            path = folder / "keypoints" / f"{camera.name}_json" / f"{camera.name}.{index:04d}.json"
            path.parent.mkdir(parents=True, exist_ok=True)
            content = {"people": [{"pose_keypoints_2d": person.ravel().tolist()} for person in people]}
            path.write_text(json.dumps(content))


def copy_demo(folder):
    """Copy what a recording needs, without its start pose."""
    shutil.copytree(DEMO, folder, ignore=shutil.ignore_patterns("init.json", "truth", "background", "subject"))
    return folder
