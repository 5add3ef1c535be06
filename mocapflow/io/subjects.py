"""Whether the files of a subject make sense: mesh, skeleton, weights, garment, first pose."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from mocapflow.errors import alternatives
from mocapflow.io.findings import Finding, attempt, error, warning
from mocapflow.io.first_pose import odd_pose
from mocapflow.io.meshes import read_mesh
from mocapflow.io.scans import TALLEST, check_size, read_skeleton, read_weights
from mocapflow.io.typed import place, read_json

GARMENTS = {
    "skirt": ("waist_height", "waist_circumference", "hem_circumference", "length"),
    "shorts": (
        "waist_height", "waist_circumference", "hip_circumference", "leg_opening_circumference", "inseam", "length",
    ),
}  # fmt: skip


def examine_subject(folder: Path) -> list[Finding]:
    """Return what is wrong in subject/ and init.json of a recording folder."""
    findings: list[Finding] = []
    joints = _examine_scan(folder / "subject", findings)
    _examine_json(folder / "subject" / "garment.json", _odd_garment, findings)
    _examine_json(folder / "init.json", partial(odd_pose, joints=joints), findings)
    return findings


def _examine_scan(subject: Path, findings: list[Finding]) -> Sequence[str]:
    """Add what is wrong with a scan; return the names of its joints, none where they can't be read."""
    body, bones, skin = subject / "body.obj", subject / "skeleton.json", subject / "weights.npz"
    if not body.exists() and not bones.exists():
        return ()
    if not body.exists():
        findings.append(error("skeleton without mesh: there is skeleton.json, but no body.obj", where=subject))
    mesh = attempt(lambda: read_mesh(body), findings) if body.exists() else None
    skeleton = attempt(lambda: read_skeleton(bones), findings)
    if skeleton is None:
        return ()
    if mesh is not None:
        vertices = mesh[0]
        attempt(lambda: check_size(vertices, skeleton, str(body)), findings)
        if skin.exists():
            attempt(lambda: read_weights(skin, skeleton, len(vertices)), findings)
    return skeleton.names


def _examine_json(path: Path, odd: Callable[[Path, Any], Iterator[Finding]], findings: list[Finding]) -> None:
    if path.exists():
        content = attempt(lambda: read_json(path), findings)
        findings += odd(path, content) if content is not None else []


def _odd_garment(path: Path, content: Any) -> Iterator[Finding]:
    if not isinstance(content, dict):
        yield error("expected {...} at the top", where=path)
        return
    kind = content.get("type")
    if not isinstance(kind, str) or kind not in GARMENTS:
        hint = f"built in: {', '.join(GARMENTS)}; others need their plugin"
        yield warning(f"the garment type is {kind!r}", hint, place(path, "type"))
        return
    known = GARMENTS[kind]
    for key in content.keys() - {"type", *known}:
        yield error(f"unknown measure '{key}' of {kind}", alternatives(key, known), place(path, key))
    for key in known:
        value = content.get(key)
        if value is None:
            yield error(f"the {kind} lacks '{key}'", f"needed, in m: {', '.join(known)}", path)
        elif not isinstance(value, int | float) or not 0 < value < TALLEST:
            yield error(f"'{key}' is {value!r}", f"expected metres, between 0 and {TALLEST:g}", place(path, key))
