"""Makes the template body from MakeHuman's mesh and targets (CC0): how adults look, and how they differ.

`python benchmarks/make_template.py FOLDER`; FOLDER holds `3dobjs/base.obj` and `targets/macrodetails`, as MPFB2's data
do. Faces, joint names and weights stay those of the template. Written are the mean woman and the mean man of made-up
people, and the principal directions, by area, in which all of them differ from their mean.
"""

from __future__ import annotations

import gzip
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from mocapflow_bodies.template import FILE, UNIT
from numpy.random import Generator, default_rng

from mocapflow.geometry.skeleton import unsided
from mocapflow.records import F64, I32

PEOPLE, MODES = 1000, 8
SKIN = np.delete(np.arange(13_380), np.r_[1778:1794, 8450:8466])  # vertices of MakeHuman's mesh that the template has
# MakeHuman's scales: how each is spread among the people, and the words of its targets from 0 to 1; None: no target.
SCALES = {
    "muscle": ((0.5, 0.15), ("minmuscle", "averagemuscle", "maxmuscle")),
    "weight": ((0.5, 0.2), ("minweight", "averageweight", "maxweight")),
    "height": ((0.5, 0.06), ("minheight", None, "maxheight")),  # a standard deviation of 7 cm
    "proportions": ((0.5, 0.3), ("uncommonproportions", None, "idealproportions")),
}
OLDEST = 0.6  # of the way from 25 to 90 years
ORIGINS = ("african", "asian", "caucasian")
CENTRES = {
    "pelvis": "pelvis", "hip": "upper-leg", "knee": "knee", "ankle": "ankle", "toe": "toe-3-1", "spine": "spine-4",
    "chest": "spine-1", "neck": "neck", "head": "head", "shoulder": "shoulder", "elbow": "elbow", "wrist": "hand",
}  # fmt: skip
# MakeHuman's hips lie behind the femoral heads and farther apart (Bell 1989: from the front spines of the pelvis, which
# are some 24 cm apart, inward by 14 % of that, back by 22 %, down by 30 %), its knees above the epicondyles: thighs are
# as long as shanks (Winter 2009).
HIPS_APART = 0.1  # of the stature
HIPS_FORWARD_M = 0.04


def main(folder: Path) -> None:
    with np.load(FILE) as content:
        kept = {name: content[name] for name in ("faces", "names", "parents", "skin_joint", "skin_weight")}
    names = tuple(str(name) for name in kept["names"])
    base, groups = base_mesh(folder)
    meshes = base + np.stack(list(people(folder, default_rng(0))))
    centres = joint_centres(meshes, groups, names)
    meshes = meshes[:, SKIN]
    ground = np.stack([np.zeros(len(meshes)), centres[:, 0, 1], meshes[..., 2].min(axis=1)], axis=1)[:, None]
    both = np.concatenate([meshes - ground, centres - ground], axis=1)
    modes = principal(both, areas(both.mean(axis=0), kept["faces"].astype(np.int32)))
    sexes = np.stack([both[0::2].mean(axis=0), both[1::2].mean(axis=0)])
    np.savez_compressed(
        FILE,
        vertices=packed(sexes[:, : len(SKIN)]),
        positions=packed(sexes[:, len(SKIN) :]),
        shape_modes=packed(modes[:, : len(SKIN)]),
        joint_modes=packed(modes[:, len(SKIN) :]),
        **kept,
    )


def people(folder: Path, chance: Generator) -> Iterator[F64]:
    """Yield how far (V, 3) m the meshes of made-up adults are off MakeHuman's, a woman and a man in turn."""
    files = sorted((folder / "targets" / "macrodetails").rglob("*.target.gz"))
    words = {file: set(file.name.removesuffix(".target.gz").split("-")) - {"universal"} for file in files}
    adult = [file for file in files if not words[file] & {"baby", "child"}]
    targets = np.stack([turned(target(file)) for file in adult])
    for number in range(PEOPLE):
        share = person("male" if number % 2 else "female", chance)
        yield np.tensordot([np.prod([share.get(word, 0.0) for word in words[f]]) for f in adult], targets, 1)


def person(sex: str, chance: Generator) -> dict[str, float]:
    """Return how much of each word of MakeHuman's targets a person by chance has."""
    old = chance.uniform(0, OLDEST)
    share = {sex: 1.0, "young": 1 - old, "old": old}
    share |= dict(zip(ORIGINS, chance.dirichlet(np.ones(len(ORIGINS))), strict=True))
    for (mean, spread), (low, middle, high) in SCALES.values():
        x = np.clip(chance.normal(mean, spread), 0, 1)
        share |= {word: max(part, 0.0) for word, part in ((low, 1 - 2 * x), (high, 2 * x - 1)) if word}
        share |= {middle: 1 - abs(2 * x - 1)} if middle else {}
    return share


def base_mesh(folder: Path) -> tuple[F64, dict[str, set[int]]]:
    """Return the vertices (V, 3) m of MakeHuman's mesh, z up and facing -y, and those of each of its groups."""
    vertices: list[list[float]] = []
    groups: dict[str, set[int]] = {}
    for line in (folder / "3dobjs" / "base.obj").read_text().splitlines():
        kind, *rest = line.split() or [""]
        if kind == "v":
            vertices.append([float(x) for x in rest])
        elif kind == "g":
            group = groups.setdefault(rest[0], set())
        elif kind == "f":
            group.update(int(corner.split("/")[0]) - 1 for corner in rest)
    return turned(np.array(vertices)), groups


def target(file: Path) -> F64:
    """Return how far a target moves the vertices of the mesh."""
    moved = np.zeros((19_158, 3))
    with gzip.open(file, "rt") as lines:
        for line in lines:
            if line.strip() and not line.startswith("#"):
                vertex, *by = line.split()
                moved[int(vertex)] = [float(x) for x in by]
    return moved


def turned(vertices: F64) -> F64:
    """Return decimetres with y up as metres with z up."""
    return 0.1 * np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)


def joint_centres(meshes: F64, groups: Mapping[str, set[int]], names: Sequence[str]) -> F64:
    """Return the joints (N, J, 3) m, hips and knees where people have their centres of rotation."""

    def centre(name: str) -> F64:
        side = name[-1] if name.endswith(("_l", "_r")) else ""
        group = "-".join(word for word in ("joint", side, CENTRES[unsided(name)]) if word)
        return np.asarray(meshes[:, sorted(groups[group])].mean(axis=1))

    centres = {name: centre(name) for name in names}
    for side, left in (("l", 1), ("r", -1)):
        hip, knee, ankle = (centres[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle"))
        hip[:, 0] = left * HIPS_APART / 2 * np.ptp(meshes[:, SKIN, 2], axis=1)
        hip[:, 1] -= HIPS_FORWARD_M
        knee[:, 2] -= (np.linalg.norm(knee - ankle, axis=1) - np.linalg.norm(hip - knee, axis=1)) / 2
    return np.stack([centres[name] for name in names], axis=1)


def areas(points: F64, faces: I32) -> F64:
    """Return the share of the surface (N,) that belongs to each vertex; joints, which follow them, have none."""
    corner = points[faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    share = np.bincount(faces.ravel(), np.repeat(area, 3), minlength=len(points))
    return share / share.sum()


def principal(points: F64, weight: F64) -> F64:
    """Return the first principal directions (MODES, N, 3) of points (P, N, 3), m a standard deviation, tall ahead."""
    off = points - points.mean(axis=0)
    who = np.linalg.svd((np.sqrt(weight)[:, None] * off).reshape(len(off), -1), full_matrices=False)[0][:, :MODES]
    modes = np.tensordot(who.T, off, 1) / np.sqrt(len(off))
    return np.asarray(modes * np.sign(modes[..., 2].mean(axis=1))[:, None, None])


def packed(lengths: F64) -> np.ndarray:
    """Return lengths in m as whole multiples of the unit."""
    return np.round(lengths / UNIT).astype(np.int16)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
