"""Parzen density of joint angles: a Gaussian about every training pose."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator
from scipy.spatial import KDTree

from mocapflow.errors import PipelineError
from mocapflow.io.atomic import atomic_write
from mocapflow.records import F64, array, record
from mocapflow_priors import density_kernels
from mocapflow_priors.density_kernels import TURN

LARGEST = 2 * TURN  # of an angle: whoever writes degrees has larger ones


@record
class Density:
    """Training poses with one bandwidth for all of them and for all angles."""

    names: tuple[str, ...]  # of the angles, as screws are named: knee_l.flexion
    poses: F64 = array("N", "K", unit="rad, zero in the rest pose")
    bandwidth: float  # rad, standard deviation of each Gaussian

    @property
    def peak(self) -> float:
        """Return the largest value that log p could have: all poses at one place."""
        return float(-0.5 * self.poses.shape[1] * np.log(TURN * self.bandwidth**2))

    @cached_property
    def columns(self) -> F64:
        """The poses angle by angle: (K, N), for compiled code."""
        return np.ascontiguousarray(self.poses.T)

    def of(self, names: Sequence[str]) -> Density:
        """Return the density of some of the angles, whatever the others are."""
        chosen = [self.names.index(name) for name in names]
        return Density(names=tuple(names), poses=self.poses[:, chosen], bandwidth=self.bandwidth)

    def on(self, names: Sequence[str]) -> F64:
        """Return the training poses (N, D) as angles of a body's screws; NaN where nothing was trained."""
        poses = np.full((len(self.poses), len(names)), np.nan)
        for column, name in enumerate(names):
            if name in self.names:
                poses[:, column] = self.poses[:, self.names.index(name)]
        return poses


def log_density(density: Density, angles: F64) -> tuple[float, F64]:
    """Return log p (rad^-K) of a pose (K,) rad and the mean (K,) rad of the training poses, weighted by nearness.

    The gradient of log p is (mean - angles) / bandwidth^2. The largest exponent is taken out first: plain weights
    vanish a few bandwidths away.

    Source: Rosenhahn 2008, section 12.5.1
    """
    mean = np.empty(len(angles))
    log_p: float = density_kernels.log_mean(density.columns, angles, density.bandwidth, mean)
    return log_p + density.peak, mean


def bandwidth(poses: F64, percentile: float = 100.0) -> float:
    """Return the largest distance (rad) from one of N poses (N, K) to its nearest neighbour.

    Neighbours in a smooth motion then overlap within one bandwidth. A lower percentile is proof against odd poses.
    Angles count modulo a turn.

    Source: Rosenhahn 2008, section 12.5.1
    """
    around = np.mod(poses, TURN) % TURN  # of -1e-20 the first leaves a whole turn, which is out of the box
    known = KDTree(around, boxsize=np.full(poses.shape[1], TURN))
    distance = np.asarray(known.query(around, 2)[0])  # to itself and to the nearest other
    return float(np.percentile(distance[:, 1], percentile))


def write(path: Path, density: Density) -> None:
    """Write a density; poses are kept to about 0.001 degrees."""
    content = {"names": np.array(density.names), "poses": density.poses.astype(np.float32)}
    with atomic_write(path) as part, part.open("wb") as file:  # by its name alone numpy would add a suffix
        np.savez_compressed(file, allow_pickle=False, bandwidth=np.array(density.bandwidth), **content)


def read(path: Path) -> Density:
    """Return the density in a file that `mocapflow prior fit` has written.

    Raises:
        PipelineError: there is no such file, or it is another kind of file.
    """
    hint = "`mocapflow prior fit FILES --out PATH` makes one from recorded angles"
    try:
        with path.open("rb") as stream, np.load(stream) as file:
            names, poses = tuple(str(name) for name in file["names"]), file["poses"].astype(np.float64)
            density = Density(names=names, poses=poses, bandwidth=float(file["bandwidth"]))
    except FileNotFoundError:
        raise PipelineError("there is no such file of training poses", where=str(path), hint=hint) from None
    except Exception:  # of numpy, zipfile, zlib and tokenize, which say nothing that would help
        raise PipelineError("this is no file of training poses", where=str(path), hint=hint) from None
    usable = poses.shape[1] == len(names) and poses.size and np.abs(poses).max() <= LARGEST
    if not (usable and 0 < density.bandwidth < np.inf):  # NaN is neither
        what = "these poses are no finite angles in radians, a column for each name, with a bandwidth above zero"
        raise PipelineError(what, where=str(path), hint=hint)
    return density


def _readable(path: Path) -> Path:
    """Return a path that a pipeline gives, if it can be read: it is told there, before anything is computed."""
    try:
        read(path)
    except PipelineError as error:
        raise ValueError(f"{path}: {error.message}; {error.hint}") from None
    return path


Poses = Annotated[Path, AfterValidator(_readable)]  # a setting: a file of training poses
