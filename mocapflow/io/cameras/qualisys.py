"""Qualisys calibration, as QTM exports it: XML, lengths in mm, pixels in 1/64."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.cameras.from_numbers import make_camera

FRACTION = 64.0  # steps per pixel
METRE = 1000.0  # mm


def cameras(path: Path) -> tuple[Camera, ...]:
    """Read the active cameras of a `.qca.txt`; a camera's name is its serial number.

    Raises:
        RecordingError: the file is no Qualisys calibration, or a camera lacks a number.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise RecordingError(f"not a Qualisys calibration: {error}", where=str(path)) from error
    found = [node for node in root.iter("camera") if node.get("active", "1") != "0"]
    return tuple(_camera(node, path) for node in found)


def _camera(node: ElementTree.Element, path: Path) -> Camera:
    name = node.get("serial", "?")
    view, place, lens = (_child(node, tag, name, path) for tag in ("fov_video", "transform", "intrinsic"))
    left, top, right, bottom = (_number(view, key, name, path) for key in ("left", "top", "right", "bottom"))
    fx, fy, cx, cy = (
        _number(lens, key, name, path) / FRACTION
        for key in ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV")
    )
    k1, k2, k3 = (_number(lens, f"radialDistortion{i}", name, path) for i in (1, 2, 3))
    p1, p2 = (_number(lens, f"tangentalDistortion{i}", name, path) for i in (1, 2))
    turn = np.array([[_number(place, f"r{i}{j}", name, path) for j in (1, 2, 3)] for i in (1, 2, 3)])
    rotation = np.diag([1.0, -1.0, -1.0]) @ turn  # Qualisys cameras look along -z, with y up
    position = np.array([_number(place, key, name, path) for key in "xyz"]) / METRE
    skew = _number(lens, "skew", name, path) / FRACTION if "skew" in lens.attrib else 0.0
    matrix = [[fx, skew, cx - left], [0, fy, cy - top], [0, 0, 1]]
    size = [right - left + 1, bottom - top + 1]
    return make_camera(name, size, matrix, [k1, k2, p1, p2, k3], rotation, -rotation @ position, where=path)


def _child(node: ElementTree.Element, tag: str, name: str, path: Path) -> ElementTree.Element:
    child = node.find(tag)
    if child is None:
        raise RecordingError(f"camera '{name}' lacks <{tag}>", where=str(path))
    return child


def _number(node: ElementTree.Element, key: str, name: str, path: Path) -> float:
    try:
        return float(node.attrib[key])
    except KeyError:
        raise RecordingError(f"camera '{name}' lacks {key} in <{node.tag}>", where=str(path)) from None
    except ValueError:
        wrong = f"camera '{name}' has {key}='{node.attrib[key]}' in <{node.tag}>, not a number"
        raise RecordingError(wrong, where=str(path)) from None
