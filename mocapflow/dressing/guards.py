"""What bodies, garments and drapers return, checked where it comes in: who returns it wrong is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.assets import Body, GarmentMesh
from mocapflow.data import Past, Pose, PoseBatch
from mocapflow.dressing.pieces import pieces_of
from mocapflow.dressing.roles import BodyModel, Draper, Garment
from mocapflow.geometry.skeleton import skeleton_of
from mocapflow.io.subject.skeleton import check_size
from mocapflow.output_checks import UNIT, InvalidOutput, array_of, of_kind
from mocapflow.records import F64, I32, out_of_range
from mocapflow.scene import Scene
from mocapflow.settings import Component

REACH = 1.0  # m from the skin that holds it: a pin farther off is surely wrong
FARTHEST = 10.0  # m from the body's first joint: cloth farther off is no longer worn


def body_of(model: BodyModel, recording: Path) -> Body:
    """Return the body that is loaded for a recording.

    Raises:
        InvalidOutput: it is not finite, or its skin or joints would not move as a body does.
        RecordingError: it is not in metres, not upright along z, or its joints lie outside.
    """
    body = of_kind(model, model.load(recording), Body)
    array_of(model, body.vertices, body.vertices.shape, "vertices")
    for what, values in (
        ("skin weights that do not sum to one", body.skin_weight.sum(axis=1)),
        ("a twist about an axis that is no unit vector", np.linalg.norm(body.twists[:, :3], axis=1)),
    ):
        if not np.allclose(values, 1, rtol=0, atol=UNIT):
            raise InvalidOutput(model, what)
    check_size(body.vertices, skeleton_of(body), f"body '{model.name}'")
    return body


def mesh_of(garment: Garment, body: Body) -> GarmentMesh:
    """Return what a garment sews on a body.

    Raises:
        InvalidOutput: it hangs from what the body lacks or from nothing near, or its parameters have no bounds.
    """
    mesh = of_kind(garment, garment.sew(body), GarmentMesh)
    for what, index, count in (
        ("pinned to vertex", mesh.pinned_to, len(body.vertices)),
        ("carried by joint", mesh.carried_by, len(body.parents)),
    ):
        if (odd := out_of_range(index, count)) is not None:
            raise InvalidOutput(garment, f"cloth {what} {odd}; the body has 0 to {count - 1}")
    if not len(mesh.pinned):
        raise InvalidOutput(garment, "cloth that is pinned nowhere")
    away = np.linalg.norm(mesh.vertices[mesh.pinned] - body.vertices[mesh.pinned_to], axis=1).max()
    if away > REACH:
        raise InvalidOutput(garment, f"a pin {away:.3g} m from the skin that holds it; are its measures in metres?")
    names, bounds = mesh.parameter_names, mesh.parameter_bounds
    if not len(set(names)) == len(names) == len(bounds):
        raise InvalidOutput(garment, f"{len(bounds)} bounds of parameters for the names {', '.join(names) or 'none'}")
    for name, (low, high) in zip(names, bounds, strict=True):
        if not (np.isfinite([low, high]).all() and low <= high):
            raise InvalidOutput(garment, f"the bounds {low:g} to {high:g} of parameter '{name}'")
    return mesh


def drape_of(draper: Draper, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
    """Return cloth vertices (B, W, 3) as a draper lays them.

    Raises:
        InvalidOutput: they are of another shape, not finite, or far away from the body.
    """
    laid = []
    for piece in pieces_of(scene):
        own = parameters[:, piece.parameters]
        laid.append(_laid(draper, poses, own, piece.past(past), piece.scene))
    return laid[0] if len(laid) == 1 else np.concatenate(laid, axis=1)


def _laid(draper: Draper, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
    assert scene.garment is not None
    laid = of_kind(draper, draper.drape(poses, parameters, past, scene), np.ndarray)
    array_of(draper, laid, (len(parameters), *scene.garment.vertices.shape), "cloth")
    return worn(draper, laid, poses.root, scene.body)


def worn(component: Component, laid: F64, root: F64, body: Body) -> F64:
    """Return cloth (..., W, 3) m that a component returned for poses with roots (..., 4, 4).

    Raises:
        InvalidOutput: it lies far away from the body.
    """
    middle = root[..., :3, :3] @ body.positions[0] + root[..., :3, 3]
    away = float(np.abs(laid - middle[..., None, :]).max(initial=0.0))  # along an axis: enough to tell, and quick
    if away > FARTHEST:
        raise InvalidOutput(component, f"cloth {away:.3g} m from the body; is it in metres, and posed as the body is?")
    return laid


def velocity_of(draper: Draper, pose: Pose, parameters: F64, vertices: I32, past: Past, scene: Scene) -> F64:
    """Return the velocities (M, 3, 6 + D + Q) of cloth vertices (M,) as a draper tells them.

    Raises:
        InvalidOutput: they are of another shape, or not finite.
    """
    if len(scene.pieces) == 1:  # as mostly, and without a copy
        return _told(draper, pose, parameters, vertices, past, scene.pieces[0])
    unknowns = np.arange(6 + len(pose.angles) + len(parameters))
    pose_columns, cloth_columns = np.split(unknowns, [6 + len(pose.angles)])
    velocity = np.zeros((len(vertices), 3, len(unknowns)))
    for piece in pieces_of(scene):
        first, stop = piece.vertices.start, piece.vertices.stop
        rows = np.flatnonzero((vertices >= first) & (vertices < stop))
        told = _told(draper, pose, parameters[piece.parameters], vertices[rows] - first, piece.past(past), piece.scene)
        columns = np.concatenate([pose_columns, cloth_columns[piece.parameters]])
        velocity[np.ix_(rows, np.arange(3), columns)] = told
    return velocity


def _told(draper: Draper, pose: Pose, parameters: F64, vertices: I32, past: Past, scene: Scene) -> F64:
    told = of_kind(draper, draper.velocity(pose, parameters, vertices, past, scene), np.ndarray)
    return array_of(draper, told, (len(vertices), 3, 6 + len(pose.angles) + len(parameters)), "velocities")
