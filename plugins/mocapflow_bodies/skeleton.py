"""Reading `skeleton.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.errors import RecordingError, alternatives
from mocapflow.geometry.skeleton import Skeleton

FORM = 'expected {"joints": [{"name": "pelvis", "parent": null, "position": [x, y, z] in m}, …]}, parents first'


def read_skeleton(path: Path) -> Skeleton:
    """Read a skeleton.

    Raises:
        RecordingError: the file is missing, malformed, not parents first, has two roots or numbers that are not finite.
    """
    if not path.is_file():
        raise RecordingError(
            "there is no skeleton for the mesh", where=str(path),
            hint=f"{FORM}; or use `body: template` with the stage fit_subject",
        )  # fmt: skip
    try:
        return parse_skeleton(json.loads(path.read_text(encoding="utf-8")), str(path))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise RecordingError(f"this is not a skeleton: {error!r}", where=str(path), hint=FORM) from error


def parse_skeleton(content: Mapping[str, Any], where: str) -> Skeleton:
    """Return the skeleton that the content of a `skeleton.json` describes."""
    joints = content["joints"]
    names = [str(joint["name"]) for joint in joints]
    parents = []
    for row, joint in enumerate(joints):
        parent, earlier = joint["parent"], names[:row]
        if names[row] in earlier:
            raise RecordingError(f"joint '{names[row]}' is listed twice", where=where, hint=FORM)
        if parent is not None and parent not in earlier:
            hint = f"a parent stands before its children; {alternatives(str(parent), earlier)}"
            what = f"parent '{parent}' of joint '{names[row]}' is not listed before it"
            raise RecordingError(what, where=where, hint=hint)
        parents.append(-1 if parent is None else names.index(parent))
    positions = np.array([joint["position"] for joint in joints], np.float64).reshape(len(names), 3)
    if parents.count(-1) != 1 or not np.isfinite(positions).all():
        what = "positions are not all numbers" if not np.isfinite(positions).all() else "one joint must have no parent"
        raise RecordingError(what, where=where, hint=FORM)
    return Skeleton(tuple(names), np.array(parents, np.int32), positions)
