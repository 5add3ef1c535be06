"""Whether the files of a subject make sense: mesh, skeleton, weights, first pose."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mocapflow.geometry.angles import unmeasured
from mocapflow.io.findings import Finding, attempt, error, has_errors, warning
from mocapflow.io.json_toml import read_json
from mocapflow.io.subject.first_pose import FILE, odd_pose
from mocapflow.io.subject.meshes import check_winding, read_mesh
from mocapflow.io.subject.skeleton import check_size, odd_scan, read_skeleton
from mocapflow.io.subject.weights import read_weights


def examine_subject(folder: Path) -> list[Finding]:
    """Return what is wrong in subject/ and init.json of a recording folder."""
    findings: list[Finding] = []
    joints = _examine_scan(folder / "subject", findings)
    pose = folder / FILE
    if pose.exists():
        attempt(lambda: findings.extend(odd_pose(pose, read_json(pose), joints)), findings)
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
    if lacking := unmeasured(skeleton.names):
        findings.append(warning(lacking, "angles are measured between joints of these names only", bones))
    if mesh is not None:
        vertices, faces = mesh
        attempt(lambda: check_winding(faces, str(body)), findings)
        attempt(lambda: check_size(vertices, skeleton, str(body)), findings)
        if not has_errors(findings):
            findings.extend(warning(text, where=subject) for text in odd_scan(vertices, skeleton))
        if skin.exists() and not has_errors(findings):  # they would seem wrong, too
            attempt(lambda: read_weights(skin, skeleton, vertices), findings)
    return skeleton.names
