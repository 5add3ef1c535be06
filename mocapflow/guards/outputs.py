"""What components return, checked where it comes in: who returns it wrong is named, not who uses it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mocapflow.components import ClothFitter, Matcher, PoseSolver, Predictor, Prior, Recovery, Segmenter, Stage
from mocapflow.data import (
    LAYERS,
    Cloth,
    Estimate,
    Frame,
    FrameResult,
    FrameState,
    Matches,
    Past,
    Pose,
    Residual,
    Segmentation,
    Start,
    Surface,
    Turn,
)
from mocapflow.dressing.guards import worn
from mocapflow.output_checks import UNIT, InvalidOutput, Output, array_of, finite, of_kind
from mocapflow.records import F64, out_of_range
from mocapflow.results import Track
from mocapflow.scene import Scene
from mocapflow.settings import Component

if TYPE_CHECKING:
    from mocapflow.model import ClothedModel

SQUARE = 1e-6  # by how much the columns of a rotation may fail to be orthonormal
LARGEST = 1e100  # of a residual: the square is still a number
SLACK = 1e-9  # beyond the bounds of a parameter: rounding


def pose_of(predictor: Predictor, frame: Frame, past: Past, scene: Scene) -> Pose:
    """Return the pose that a predictor begins a frame with.

    Raises:
        InvalidOutput: it is no pose of the body.
    """
    return _checked_pose(predictor, of_kind(predictor, predictor.predict(frame, past, scene), Pose), scene)


def estimate_of(
    solver: PoseSolver,
    match: Callable[[Surface], Matches],
    state: FrameState,
    model: ClothedModel,
    priors: Sequence[Prior],
    past: Past,
    turn: Turn,
) -> Estimate:
    """Return the estimate of a pose solver.

    Raises:
        InvalidOutput: its pose is none of the body, or what it says besides has another shape or is not finite.
    """
    found = of_kind(solver, solver.solve(match, state, model, priors, past, turn), Estimate)
    return _checked_estimate(solver, found, state.estimate, model.scene)


def _checked_estimate(component: Component, found: Estimate, before: Estimate, scene: Scene) -> Estimate:
    _checked_pose(component, found.pose, scene)
    array_of(component, found.parameters, before.parameters.shape, "parameters")
    array_of(component, found.observed, found.pose.angles.shape, "observed shares")
    size = max(len(found.covariance), 6 + len(found.pose.angles))  # unknowns of the cloth may follow
    array_of(component, found.covariance, (size, size), "a covariance")
    if np.diag(found.covariance).min() <= 0:
        raise InvalidOutput(component, "a variance that is not above zero")
    try:
        np.linalg.cholesky(found.covariance)  # which units its rows have is no matter to it
    except np.linalg.LinAlgError:
        raise InvalidOutput(component, "a covariance that is not positive definite") from None
    return found


def _checked_pose(component: Component, pose: Pose, scene: Scene) -> Pose:
    if len(pose.angles) != len(scene.body.twists):
        raise InvalidOutput(component, f"{len(pose.angles)} joint angles; the body has {len(scene.body.twists)}")
    if not (finite(pose.root) and finite(pose.angles)):
        raise InvalidOutput(component, "a pose that is not finite")
    turn = pose.root[:3, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > SQUARE or np.linalg.det(turn) < 0:
        raise InvalidOutput(component, "a root that is no rigid motion")
    return pose


def matches_of(
    matcher: Matcher,
    frame: Frame,
    segmentation: Segmentation,
    surface: Surface,
    past: Past,
    scene: Scene,
    turn: Turn,
) -> Matches:
    """Return the pairs of a matcher.

    Raises:
        InvalidOutput: a pair is of a camera or a vertex that is not there, or not finite.
    """
    found = of_kind(matcher, matcher.match(frame, segmentation, surface, past, scene, turn), Matches)
    if not len(found.camera):
        return found
    for name, index, count in (
        ("camera", found.camera, len(scene.cameras)),
        ("vertex", found.vertex, len(surface.vertices)),
    ):
        if (odd := out_of_range(index, count)) is not None:
            raise InvalidOutput(matcher, f"a pair of {name} {odd}; there are 0 to {count - 1}")
    for name in ("pixel", "direction", "weight"):
        if not finite(getattr(found, name)):
            raise InvalidOutput(matcher, f"a {name} that is not finite")
    if found.weight.min() < 0:
        raise InvalidOutput(matcher, "a weight below zero")
    squared = (found.direction * found.direction).sum(axis=1)
    if ((np.abs(squared - 1) > UNIT) & (squared > 0)).any():
        raise InvalidOutput(matcher, "a direction that is neither a unit vector nor zero")
    return found


def residual_of(prior: Prior, pose: Pose, past: Past, scene: Scene) -> Residual:
    """Return what a prior adds to the pose equations; an infinite energy rules a pose out.

    Raises:
        InvalidOutput: its rows are not finite, or do not have the columns (omega, v, angles).
    """
    said, least = of_kind(prior, prior.residual(pose, past, scene), Residual), 6 + len(pose.angles)
    if said.jacobian.shape[1] < least:
        message = f"a jacobian of {said.jacobian.shape[1]} columns; (omega, v, angles) are {least}"
        raise InvalidOutput(prior, message)
    if not (_squares(said.error) and _squares(said.jacobian)):
        raise InvalidOutput(prior, f"an error or a jacobian that is not finite, or above {LARGEST:g}")
    if not isinstance(said.energy, float | int | np.floating) or np.isnan(said.energy):
        raise InvalidOutput(prior, f"the energy {said.energy!r}")
    return said


def segmentation_of(
    segmenter: Segmenter, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn
) -> Segmentation:
    """Return the silhouettes of a segmenter.

    Raises:
        InvalidOutput: one is of a camera or layer that is not there, or comes twice; is of another size than its
            picture, or not finite.
    """
    found = of_kind(segmenter, segmenter.segment(frame, state, past, scene, turn), Segmentation)
    if not isinstance(found.silhouettes, tuple):
        raise InvalidOutput(segmenter, f"silhouettes as a {type(found.silhouettes).__name__}, not a tuple of them")
    for number, silhouette in enumerate(found.silhouettes):
        kind = silhouette.camera, silhouette.layer
        if silhouette.camera not in range(len(scene.cameras)):
            message = f"a silhouette of camera {silhouette.camera}; there are 0 to {len(scene.cameras) - 1}"
            raise InvalidOutput(segmenter, message)
        if silhouette.layer not in LAYERS:
            raise InvalidOutput(segmenter, f"a silhouette of layer '{silhouette.layer}'; there are {', '.join(LAYERS)}")
        if kind in [(other.camera, other.layer) for other in found.silhouettes[:number]]:
            raise InvalidOutput(segmenter, f"two silhouettes of camera {silhouette.camera}, layer '{silhouette.layer}'")
        width, height = scene.cameras[silhouette.camera].size
        if silhouette.distance.shape != (height, width):
            rows, columns = silhouette.distance.shape
            raise InvalidOutput(segmenter, f"a silhouette of {columns} x {rows} px; the picture is {width} x {height}")
        if not np.isfinite(silhouette.distance.sum()):  # a sum costs a fifth of a look at every pixel
            raise InvalidOutput(segmenter, "a silhouette that is not finite")
    return found


def cloth_of(
    fitter: ClothFitter,
    frame: Frame,
    segmentation: Segmentation,
    estimate: Estimate,
    model: ClothedModel,
    past: Past,
    turn: Turn,
) -> Cloth:
    """Return the cloth that a fitter chooses.

    Raises:
        InvalidOutput: it is not that of the garment, not finite, far away, or a parameter is out of its bounds.
    """
    cloth = of_kind(fitter, fitter.fit(frame, segmentation, estimate, model, past, turn), Cloth)
    garment = model.scene.garment
    vertices, parameters = (0, 0) if garment is None else (len(garment.vertices), len(garment.parameter_names))
    worn(fitter, array_of(fitter, cloth.vertices, (vertices, 3), "cloth"), estimate.pose.root, model.scene.body)
    array_of(fitter, cloth.parameters, (parameters,), "cloth parameters")
    if garment is not None:
        ranges = zip(garment.parameter_names, cloth.parameters, garment.parameter_bounds, strict=True)
        for name, value, (low, high) in ranges:
            if not low - SLACK <= value <= high + SLACK:
                raise InvalidOutput(fitter, f"{value:g} for parameter '{name}', which goes from {low:g} to {high:g}")
    return cloth


def result_of(recovery: Recovery, found: Any, looped: FrameResult, scene: Scene) -> FrameResult:
    """Return what a recovery returned for what the loop had found.

    Raises:
        InvalidOutput: it is no result, its estimate is none, or something in it has another shape than the loop's.
    """
    result = of_kind(recovery, found, FrameResult)
    if result is looped:
        return result
    _checked_estimate(recovery, result.state.estimate, looped.state.estimate, scene)
    cloth, before = result.state.cloth, looped.state.cloth
    array_of(recovery, cloth.vertices, before.vertices.shape, "cloth")
    worn(recovery, cloth.vertices, result.state.estimate.pose.root, scene.body)
    array_of(recovery, cloth.parameters, before.parameters.shape, "cloth parameters")
    for name in ("overlap", "energy"):
        shape, meant = getattr(result, name).shape, getattr(looped, name).shape
        if shape != meant:
            raise InvalidOutput(recovery, f"the {name} of shape {shape}, not {meant}")
    if not isinstance(result.notes, tuple):
        raise InvalidOutput(recovery, f"notes as a {type(result.notes).__name__}, not a tuple of them")
    return result


def made_of(stage: Stage, made: Any, kind: type[Output]) -> Output:
    """Return what a stage has made.

    Raises:
        InvalidOutput: it is of another kind, or a track or a first pose that is not finite.
    """
    found = of_kind(stage, made, kind)
    motions: tuple[Pose | Track, ...] = ()
    if isinstance(found, Start):
        motions = (found.pose, *found.others)
    elif isinstance(found, Track):
        motions = (found,)
    if not all(finite(motion.root) and finite(motion.angles) for motion in motions):
        raise InvalidOutput(stage, "a pose that is not finite")
    return found


def _squares(values: F64) -> bool:
    """Return whether all values are finite, with squares that can be summed."""
    return bool(np.abs(values).max(initial=0.0) <= LARGEST)
