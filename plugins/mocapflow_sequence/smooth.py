"""Stage `smooth`: a zero-lag, covariance-weighted smoother of a whole track."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from mocapflow.components import Stage
from mocapflow.geometry import twists
from mocapflow.records import F64, Bool
from mocapflow.results import Track
from mocapflow.scene import Scene
from mocapflow.series import Numbers, changed
from mocapflow_sequence.banded import difference_weights, minimise

TURN_ACCELERATION = np.radians(2000.0)  # rad/s^2, standard deviation for the turning of the root
ROOT_ACCELERATION = 15.0  # m/s^2, for the place of the root joint
ANGLE_ACCELERATION = np.radians(4000.0)  # rad/s^2, for every joint angle
LOST = 100.0  # rad^2 and m^2, the variance of a lost frame: its neighbours decide


class Smooth(Stage):
    """Balances each pose, weighted by its covariance, against accelerations that people do not make.

    The smallest sum of squares over the whole sequence of (correction / its standard deviation) and
    (acceleration / the standard deviation of what people do): a Rauch-Tung-Striebel smoother, solved at once as a
    banded system. With good images hardly anything changes; a frame that was lost is bridged by its neighbours. The
    root turns about its joint, wherever rest has its origin.
    """

    name: ClassVar[str] = "smooth"

    def run(self, track: Track, scene: Scene) -> Track:
        """Return the smoothed track, which keeps the poses it was made from.

        The covariances stay those of the single frames: neighbouring frames err alike, so that averaging them
        does not make the result as much better as their number suggests. Lost frames get that of the bridge.
        """
        if len(track.frame) < 3:
            return replace(track, raw_root=track.root, raw_angles=track.angles)
        lost = track.lost
        joint = np.eye(4)
        joint[:3, 3] = scene.body.positions[0]
        placed = track.root @ joint
        spread = changed(track.covariance, partial(_about_joint, placed, lost))
        change, bridged = minimise(
            spread, _second_differences(placed, track), _limits(track.angles.shape[1]), track.time, lost
        )
        turned = placed.copy()
        turned[:, :3, :3] = twists.exp(np.pad(change[:, :3], ((0, 0), (0, 3))))[:, :3, :3] @ placed[:, :3, :3]
        turned[:, :3, 3] += change[:, 3:6]
        root = turned @ twists.inverse(joint)
        back = np.linalg.inv(_about(turned[lost, :3, 3], spread.shape[1]))
        bridged = back @ bridged @ np.swapaxes(back, 1, 2)
        return replace(
            track, root=root, angles=track.angles + change[:, 6:],
            covariance=changed(track.covariance, partial(_bridged, lost, bridged)),
            cloth=changed(track.cloth, partial(_carried, track.root, root)),
            raw_root=track.root, raw_angles=track.angles,
        )  # fmt: skip


def _limits(angles: int) -> F64:
    """Return the standard deviation of each acceleration (6 + D,) per s^2."""
    return np.repeat([TURN_ACCELERATION, ROOT_ACCELERATION, ANGLE_ACCELERATION], [3, 3, angles])


def _about(points: F64, size: int) -> F64:
    """Return the matrices (T, R, R) from increments (omega, v, angles) to (omega, displacement of a point, angles)."""
    matrices = np.broadcast_to(np.eye(size), (len(points), size, size)).copy()
    matrices[:, 3:6, :3] = -twists.hat(points)
    return matrices


def _second_differences(placed: F64, track: Track) -> F64:
    """Return the accelerations (T - 2, 6 + D) at the inner frames; turns are compared as rotation vectors."""
    weights = difference_weights(track.time)
    rotation = placed[:, :3, :3]
    turns = twists.log_rotation(rotation[1:] @ np.swapaxes(rotation[:-1], 1, 2))
    turning = weights[:, 2, None] * turns[1:] - weights[:, 0, None] * turns[:-1]
    straight = np.concatenate([placed[:, :3, 3], track.angles], axis=1)
    moving = sum(weights[:, k, None] * straight[k : len(straight) - 2 + k] for k in range(3))
    return np.concatenate([turning, moving], axis=1)


def _about_joint(placed: F64, lost: Bool, covariance: F64, rows: Numbers) -> F64:
    """Return covariances of rows (K,) as of increments that turn about the root joint; lost frames are unsure."""
    turned = _about(placed[rows, :3, 3], covariance.shape[1])
    spread = turned @ covariance @ np.swapaxes(turned, 1, 2)
    spread[lost[rows]] = LOST * np.eye(spread.shape[1])
    return spread


def _bridged(lost: Bool, bridged: F64, covariance: F64, rows: Numbers) -> F64:
    """Return the covariances of rows (K,), of lost frames those of the bridge, which are given in their order."""
    place, result = np.cumsum(lost) - 1, covariance.copy()
    result[lost[rows]] = bridged[place[rows[lost[rows]]]]
    return result


def _carried(before: F64, after: F64, cloth: F64, rows: Numbers) -> F64:
    """Return cloth vertices (K, W, 3) of rows (K,) moved along with the root."""
    motion = after[rows] @ twists.inverse(before[rows])
    return cloth @ np.swapaxes(motion[:, :3, :3], 1, 2) + motion[:, None, :3, 3]
