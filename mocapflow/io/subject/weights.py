"""The skin weights of a scan, `weights.npz`, and whether they belong to its mesh and skeleton."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError, alternatives
from mocapflow.geometry.skeleton import Skeleton, to_segment
from mocapflow.records import F64

WEIGHTS = "expected arrays `weights` (V, J) and, if need be, `names` (J); without the file weights are computed"
ELSEWHERE = 0.1  # m that what a joint moves may lie nearer to another joint's bones


def read_weights(path: Path, skeleton: Skeleton, vertices: F64) -> F64:
    """Return the weights (V, J) of a `weights.npz` in the order of the skeleton; without names they have it.

    Raises:
        RecordingError: the file can't be read, or contradicts the mesh (V, 3) or the skeleton.
    """
    try:
        with np.load(path) as content:
            weights = np.asarray(content["weights"], np.float64)
            names = [str(name) for name in content["names"]] if "names" in content else list(skeleton.names)
    except KeyError:
        raise RecordingError("there are no skin weights in it", where=str(path), hint=WEIGHTS) from None
    except Exception:  # of numpy, zipfile, zlib and tokenize, which say nothing that would help
        raise RecordingError("this is no .npz file of numbers and names", where=str(path), hint=WEIGHTS) from None
    if weights.shape != (len(vertices), len(names)):
        expected = f"({len(vertices)} vertices, {len(names)} joints)"
        raise RecordingError(f"the weights have the shape {weights.shape}; expected {expected}", where=str(path))
    if not np.isfinite(weights).all() or (weights < 0).any() or (weights.sum(axis=1) == 0).any():
        what = "skin weights have to be numbers of at least 0, one of each vertex above"
        raise RecordingError(what, where=str(path), hint=WEIGHTS)
    _check_names(names, skeleton, path)
    ordered = np.zeros((len(vertices), len(skeleton.names)))
    ordered[:, [skeleton.names.index(name) for name in names]] = weights
    _check_places(vertices, ordered, skeleton, path)
    return ordered


def _check_names(names: Sequence[str], skeleton: Skeleton, path: Path) -> None:
    """Check that each joint of the skeleton is named once, and no other."""
    for name, count in Counter(names).items():
        if count > 1:
            raise RecordingError(f"weights for '{name}' are there more than once", where=str(path), hint=WEIGHTS)
        if name not in skeleton.names:
            what = f"weights for '{name}', which is no joint of the skeleton"
            raise RecordingError(what, where=str(path), hint=alternatives(name, skeleton.names))
    if missing := [name for name in skeleton.names if name not in names]:
        hint = "add them to `names` and `weights`; a joint that moves no skin has a column of zeros"
        raise RecordingError(f"no weights for {', '.join(missing)}", where=str(path), hint=hint)


def _check_places(vertices: F64, weights: F64, skeleton: Skeleton, path: Path) -> None:
    """Check that the vertices (V, 3) that each joint moves, by the weights (V, J), lie about its own bones.

    Raises:
        RecordingError: they lie about those of another joint, as where columns or names are in another order.
    """
    middles = (weights.T @ vertices) / np.maximum(weights.sum(axis=0), 1e-9)[:, None]
    for joint in np.flatnonzero(weights.sum(axis=0) > 0):
        away = np.array([_from_bones(middles[joint], bone, skeleton) for bone in range(len(skeleton.names))])
        if away[joint] > away.min() + ELSEWHERE:
            own, other = skeleton.names[joint], skeleton.names[int(away.argmin())]
            hint = (
                "the columns of `weights` are in another order than `names`, or than the joints of skeleton.json; or\n"
                "its rows than the vertices of body.obj, which a program has sorted: without the file they are computed"
            )
            raise RecordingError(f"what '{own}' moves lies at '{other}'", where=str(path), hint=hint)


def _from_bones(point: F64, joint: int, skeleton: Skeleton) -> float:
    """Return how far (m) a point (3,) is from the bones that begin at a joint; from the joint where none does."""
    begin = skeleton.positions[joint]
    ends = skeleton.positions[np.append(np.flatnonzero(skeleton.parents == joint), joint)]
    return min(float(to_segment(point[None], begin, end)[0]) for end in ends)
