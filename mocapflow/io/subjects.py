"""Whether the files of a subject make sense: mesh, skeleton, weights, garment, first pose."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.errors import RecordingError, alternatives
from mocapflow.io.cameras import FARTHEST
from mocapflow.io.findings import Finding, attempt, error, warning
from mocapflow.io.meshes import read_mesh
from mocapflow.records import F64

TALLEST, SMALLEST = 3.0, 0.3  # m, of a person from head to toe
MARGIN = 0.1  # m that a joint may lie outside the box about the mesh
GARMENTS = {
    "skirt": ("waist_height", "waist_circumference", "hem_circumference", "length"),
    "shorts": (
        "waist_height", "waist_circumference", "hip_circumference", "leg_opening_circumference", "inseam", "length",
    ),
}  # fmt: skip
POSE = ("root_rotation", "root_translation", "joint_rotations")


def examine_subject(folder: Path) -> Iterator[Finding]:
    """Yield what is wrong in subject/ and init.json of a recording folder."""
    subject, findings = folder / "subject", list[Finding]()
    body, skeleton = subject / "body.obj", subject / "skeleton.json"
    if body.exists() and not skeleton.exists():
        yield error(
            "mesh without skeleton: there is body.obj, but no skeleton.json",
            'add {"joints": [{"name", "parent", "position": [x, y, z]}]}, positions in m in the mesh\'s rest pose',
            subject,
        )
    if skeleton.exists() and not body.exists():
        yield error("skeleton without mesh: there is skeleton.json, but no body.obj", where=subject)
    names, joints = attempt(lambda: _skeleton(skeleton), findings) or ((), np.empty((0, 3)))
    mesh = attempt(lambda: read_mesh(body), findings) if body.exists() else None
    yield from findings
    yield from _sizes(joints, None if mesh is None else mesh[0], subject)
    if mesh is not None and (subject / "weights.npz").exists() and len(names):
        yield from _weights(subject / "weights.npz", len(mesh[0]), names)
    yield from _json(subject / "garment.json", _garment)
    yield from _json(folder / "init.json", lambda content: _first_pose(content, names))


def _skeleton(path: Path) -> tuple[tuple[str, ...], F64]:
    """Return joint names and positions (J, 3) m; none where the file is missing."""
    if not path.exists():
        return (), np.empty((0, 3))
    try:
        joints = json.loads(path.read_text(encoding="utf-8"))["joints"]
        names = tuple(str(joint["name"]) for joint in joints)
        positions = np.array([joint["position"] for joint in joints], np.float64).reshape(-1, 3)
        parents = [joint["parent"] for joint in joints]
    except (ValueError, TypeError, KeyError) as problem:
        hint = '{"joints": [{"name": "pelvis", "parent": null, "position": [x, y, z]}, ...]}'
        raise RecordingError(f"not a skeleton: {problem!r}", where=str(path), hint=hint) from problem
    for name, parent in zip(names, parents, strict=True):
        if parent is not None and parent not in names:
            hint = alternatives(str(parent), names)
            raise RecordingError(f"joint '{name}' hangs on '{parent}', which is no joint", where=str(path), hint=hint)
    if not np.isfinite(positions).all():
        raise RecordingError("a joint's position is not a number", where=str(path))
    return names, positions


def _sizes(joints: F64, vertices: F64 | None, subject: Path) -> Iterator[Finding]:
    for what, points in (("skeleton", joints), ("mesh", vertices)):
        if points is None or not len(points):
            continue
        height = float(np.ptp(points, axis=0).max())
        if height > TALLEST or height < SMALLEST:
            unit = "it looks like millimetres or centimetres" if height > TALLEST else "it may be in another unit"
            yield error(f"the {what} is {height:.4g} m tall: {unit}", "lengths are in metres", subject)
    if vertices is not None and len(joints):
        low, high = vertices.min(axis=0) - MARGIN, vertices.max(axis=0) + MARGIN
        outside = int(((joints < low) | (joints > high)).any(axis=1).sum())
        if outside:
            hint = "both have to be in the same rest pose, in m, z up"
            yield error(f"{outside} of {len(joints)} joints lie outside the mesh", hint, subject)


def _weights(path: Path, vertices: int, names: Sequence[str]) -> Iterator[Finding]:
    try:
        with np.load(path) as content:
            weights = content["weights"]
            columns = [str(name) for name in content["names"]] if "names" in content else list(names)
    except (OSError, ValueError, KeyError) as problem:
        yield error(f"no skin weights: {problem}", "weights.npz holds `weights` (V, J) and, if need be, `names`", path)
        return
    if weights.ndim != 2 or len(weights) != vertices or weights.shape[1] != len(columns):
        expected = f"({vertices} vertices, {len(columns)} joints)"
        yield error(f"the weights have the shape {weights.shape}; expected {expected}", where=path)
    elif not np.isfinite(weights).all() or (weights < 0).any():
        yield error("skin weights have to be numbers of at least 0", where=path)
    for name in columns:
        if name not in names:
            yield error(f"weights for '{name}', which is no joint of the skeleton", alternatives(name, names), path)


def _json(path: Path, check: Callable[[dict[str, Any]], Iterator[Finding]]) -> Iterator[Finding]:
    if not path.exists():
        return
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as problem:
        yield error(f"not JSON: {problem}", where=path)
        return
    if not isinstance(content, dict):
        yield error("expected {...} at the top", where=path)
        return
    for found in check(content):
        yield Finding(severity=found.severity, message=found.message, hint=found.hint, where=str(path))


def _garment(content: dict[str, Any]) -> Iterator[Finding]:
    kind = content.get("type")
    if not isinstance(kind, str) or kind not in GARMENTS:
        yield warning(f"the garment type is {kind!r}", f"built in: {', '.join(GARMENTS)}; others need their plugin")
        return
    known = GARMENTS[kind]
    for key in content.keys() - {"type", *known}:
        yield error(f"unknown measure '{key}' of {kind}", alternatives(key, known))
    for key in known:
        value = content.get(key)
        if value is None:
            yield error(f"the {kind} lacks '{key}'", f"needed, in m: {', '.join(known)}")
        elif not isinstance(value, int | float) or not 0 < value < TALLEST:
            yield error(f"'{key}' is {value!r}", f"expected metres, between 0 and {TALLEST:g}")


def _first_pose(content: dict[str, Any], names: Sequence[str]) -> Iterator[Finding]:
    for key in content.keys() - set(POSE):
        yield error(f"unknown key '{key}'", alternatives(key, POSE))
    turns = content.get("joint_rotations", {})
    if not isinstance(turns, dict):
        yield error("joint_rotations is not {name: rotation vector}")
        return
    vectors = {key: content[key] for key in POSE[:2] if key in content} | turns
    for key in POSE[:2]:
        if key not in content:
            yield error(f"'{key}' is missing", f"needed: {', '.join(POSE)}")
    for key, vector in vectors.items():
        if key in turns and names and key not in names:
            yield error(f"rotation of '{key}', which is no joint of the skeleton", alternatives(key, names))
        if not _is_vector(vector):
            yield error(f"'{key}' is {vector!r}", "expected three numbers")
    place = content.get("root_translation")
    distance = float(np.linalg.norm(np.array(place, np.float64))) if _is_vector(place) else 0.0
    if distance > FARTHEST:
        yield error(f"the pelvis is {distance:.0f} m from the origin: it looks like mm", "lengths are in metres")


def _is_vector(value: Any) -> bool:
    try:
        vector = np.array(value, np.float64)
    except (ValueError, TypeError):
        return False
    return vector.shape == (3,) and bool(np.isfinite(vector).all())
