"""Training poses from recorded motions: angles.csv, OpenSim MOT, BVH, or joint rotations in an npz."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from mocapflow.assets import Body
from mocapflow.errors import MocapflowError, PipelineError, RecordingError, alternatives
from mocapflow.geometry import angles
from mocapflow.geometry.joints import angles_from_rotations
from mocapflow.geometry.skeleton import unsided
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.io.motion.mot import read_mot
from mocapflow.records import F64
from mocapflow_priors import training_bvh
from mocapflow_priors.density import Density, bandwidth

Angles = Mapping[str, F64]  # by screw: (T,) rad, zero in the rest pose
FREE = ("hip", "knee.flexion", "ankle.dorsiflexion", "shoulder", "elbow.flexion")  # what no other prior holds
BENDS = np.radians(np.linspace(-60, 170, 461))  # of any joint, to look up what they show
BACKWARDS_DEG = -5.0  # of a knee in the middle of a motion: no knee is stretched further for so long
DEGREES = "an angles.csv has degrees; a motion has some angle that bends further"
COLUMNS = {  # of angles.csv: the screw that makes nearly all of each
    "hip_flexion": "hip.flexion",
    "knee_flexion": "knee.flexion",
    "ankle": "ankle.dorsiflexion",
    "elbow": "elbow.flexion",
}
COORDINATES = {  # of OpenSim, as `mocapflow.io.motion.opensim` names them
    "hip_flexion": "hip.flexion",
    "knee_angle": "knee.flexion",
    "ankle_angle": "ankle.dorsiflexion",
    "elbow_flex": "elbow.flexion",
}


def fit(files: Sequence[Path], body: Body, wanted: Sequence[str] = FREE, percentile: float = 100.0) -> Density:
    """Return the density of the angles that all files have.

    Args:
        files: recorded motions.
        body: whose joints and rest pose the angles count from.
        wanted: angles as `joint.angle`, or whole joints; without a side, of both.
        percentile: of the distances between neighbours that the bandwidth is.

    Raises:
        PipelineError: a wanted angle is none of the body.
        RecordingError: a file cannot be read, or the files share no wanted angle.
    """
    check_wanted(wanted, body)
    found = [read_angles(path, body) for path in files]
    takes = [chosen(take, wanted) for take in found]
    names = tuple(name for name in body.screw_names if all(name in take for take in takes))
    if not names:
        hint = "\n".join(f"{path.name}: {', '.join(take) or 'none'}" for path, take in zip(files, found, strict=True))
        raise RecordingError(f"the files share none of the angles {', '.join(wanted)}", hint=hint)
    poses = np.concatenate([np.stack([take[name] for name in names], axis=1) for take in takes])
    poses = np.unique(poses[np.isfinite(poses).all(axis=1)], axis=0)
    if len(poses) < 2:
        raise RecordingError("a density needs two different poses at least", where=", ".join(map(str, files)))
    return Density(names=names, poses=poses, bandwidth=bandwidth(poses, percentile))


def chosen(take: Angles, wanted: Sequence[str]) -> Angles:
    """Return the wanted angles of a take."""
    return {name: values for name, values in take.items() if not calls(name).isdisjoint(wanted)}


def check_wanted(wanted: Sequence[str], body: Body) -> None:
    """Check that each wanted name calls an angle of a body.

    Raises:
        PipelineError: one calls none.
    """
    known = set[str]().union(*map(calls, body.screw_names))
    if strange := [name for name in wanted if name not in known]:
        raise PipelineError(f"no angle is called '{strange[0]}'", hint=alternatives(strange[0], known))


def calls(angle: str) -> set[str]:
    """Return what calls an angle, knee_l.flexion: its name, that of the joint, and both without the side."""
    joint, _, kind = angle.partition(".")
    return {name for side in (joint, unsided(joint)) for name in (side, f"{side}.{kind}")}


def read_angles(path: Path, body: Body) -> Angles:
    """Return the angles of a recorded motion by the names of a body's screws, (T,) rad from its rest pose."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        hint = f"known: {', '.join(sorted(READERS))}"
        raise RecordingError("no kind of file with joint angles", where=str(path), hint=hint)
    if not path.is_file():
        raise RecordingError("there is no such file", where=str(path))
    try:
        return reader(path, body)
    except MocapflowError:
        raise
    except Exception as error:  # of bvhio, numpy, zipfile, zlib and tokenize
        hint = "it is damaged, or of another kind; an .npz holds joint_names (J) and rotation_vectors (T, J, 3)"
        raise RecordingError(f"cannot be read as {path.suffix}: {error}", where=str(path), hint=hint) from error


def from_rotations(path: Path, body: Body) -> Angles:
    """Read joint rotations (T, J, 3) rad relative to the parent, with their joint names."""
    with np.load(path) as file:
        names, turns = [str(name) for name in file["joint_names"]], file["rotation_vectors"]
    known = [k for k, name in enumerate(names) if name in body.joint_names]
    poses = np.stack([angles_from_rotations(body, {names[k]: turn[k] for k in known}) for turn in turns])
    moved = {names[k] for k in known}
    return {n: poses[:, k] for k, n in enumerate(body.screw_names) if n.partition(".")[0] in moved}


def from_table(path: Path, body: Body) -> Angles:
    """Read an angles.csv: degrees between joint centres, as a run writes them."""
    degrees = {name: values for name, values in read_columns(path).items() if name[:-2] in COLUMNS}
    if degrees and all(np.nanmax(np.abs(values), initial=0.0) <= np.pi for values in degrees.values()):
        raise RecordingError("no angle in it is above 3.14: it seems to be in radians", where=str(path), hint=DEGREES)
    return from_columns(possible(degrees, path), body)


def possible(degrees: Mapping[str, F64], path: Path) -> Mapping[str, F64]:
    """Return the columns (T,) of a file, each in degrees; NaN where an angle is not known.

    Raises:
        RecordingError: one of them is infinite or more than half a turn.
    """
    for name, values in degrees.items():
        if (beyond := np.abs(values) > 180).any():
            row = int(np.argmax(beyond))
            hint = "angles are in degrees, from -180 to 180; nan where one is not known"
            raise RecordingError(f"{name} is {values[row]:g} in row {row + 1}", where=str(path), hint=hint)
    return degrees


def from_joints(path: Path, body: Body) -> Angles:
    """Read a BVH motion."""
    return from_columns(training_bvh.columns(path), body)


def from_columns(degrees: Mapping[str, F64], body: Body) -> Angles:
    """Return angles between joint centres, named as in angles.csv, as the bends of a body's joints that show them.

    What a bend shows is looked up on the body, joint by joint: hinges are not quite square to the limbs.
    """
    poses = np.zeros((len(BENDS), len(body.twists)))
    screws = {name: screw for name in degrees if (screw := screw_of(name, COLUMNS)) in body.screw_names}
    poses[:, [body.screw_names.index(screw) for screw in screws.values()]] = BENDS[:, None]
    shown = angles.measure(body, np.tile(np.eye(4), (len(BENDS), 1, 1)), poses)
    found = {}
    for name, screw in screws.items():
        curve = np.degrees(np.unwrap(np.radians(shown.value[:, shown.names.index(name)])))  # a thigh passes straight up
        bent = slice(int(curve.argmin()), int(curve.argmax()) + 1)  # a limb bent backwards shows the same
        round_again = degrees[name] < curve[bent].mean() - 180  # -179 is 181, past straight up
        found[screw] = np.interp(degrees[name] + 360 * round_again, curve[bent], BENDS[bent])
    return found


def from_opensim(path: Path, body: Body) -> Angles:
    """Read an OpenSim motion: degrees from the straight limb."""
    columns, _ = read_mot(path)
    rest = opensim_at_rest(body)
    angles_only = {name: values for name, values in columns.items() if name[:-2] in COORDINATES and name in rest}
    degrees = bent_forwards(possible(angles_only, path), path)
    return {screw_of(name, COORDINATES): np.radians(values - rest[name]) for name, values in degrees.items()}


def bent_forwards(degrees: Mapping[str, F64], path: Path) -> Mapping[str, F64]:
    """Return the columns (T,) of a file, in which knees bend as they do.

    Raises:
        RecordingError: a knee bends backwards.
    """
    for name, values in degrees.items():
        known = values[np.isfinite(values)]
        if name.startswith("knee_angle") and len(known) and np.median(known) < BACKWARDS_DEG:
            message = f"{name} bends backwards: its model counts the knee the other way"
            raise RecordingError(message, where=str(path), hint="turn its sign round in the file, as that of gait2392")
    return degrees


def opensim_at_rest(body: Body) -> Mapping[str, float]:
    """Return what OpenSim calls the angles of the rest pose, in degrees."""
    from mocapflow.io.motion.opensim import coordinates

    found = coordinates(body, np.eye(4)[None], np.zeros((1, len(body.twists))))
    return {name: float(value[0]) for name, value in found.items()}


def screw_of(column: str, table: Mapping[str, str]) -> str:
    """Return the screw that a table without sides gives a column, "" for none: knee_flexion_l → knee_l.flexion."""
    joint, _, angle = table.get(column[:-2], "").partition(".")
    return f"{joint}{column[-2:]}.{angle}" if joint else ""


READERS: Mapping[str, Callable[[Path, Body], Angles]] = {
    ".npz": from_rotations,
    ".bvh": from_joints,
    ".csv": from_table,
    ".mot": from_opensim,
}
