"""Body `template`: an average person to start from where there is no scan; stages fit it to the person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.assets import Body
from mocapflow.dressing.roles import BodyModel
from mocapflow.geometry.skeleton import Skeleton
from mocapflow.records import I32
from mocapflow_bodies.assemble import Part, assemble

FILE = Path(__file__).parent / "data" / "template.npz"  # made by benchmarks/make_template.py, of MakeHuman (CC0)
UNIT = 1e-4  # m, of the lengths in the file


class Template(BodyModel):
    """The mean of adults, standing with the arms 45 degrees out; whole, it knows how they differ from each other."""

    name: ClassVar[str] = "template"
    shape: Annotated[float, Field(ge=0, le=1)] = 0.5  # 0 the mean woman, 1 the mean man
    height_m: Annotated[float, Field(gt=0.5, lt=2.6)] | None = None  # null: that of the mean
    part: Part = "full"  # what is used of it; the rest is cut off. legs: up to the waist, see pipelines/legs.yaml

    def inputs(self, folder: Path) -> Sequence[Path]:
        """Return the files that are read."""
        return [FILE]

    def load(self, folder: Path) -> Body:
        """Return the body at rest; nothing of the recording is read."""
        blend = np.array([1 - self.shape, self.shape]) * UNIT
        with np.load(FILE) as content:
            vertices = np.tensordot(blend, content["vertices"].astype(np.float64), 1)
            positions = np.tensordot(blend, content["positions"].astype(np.float64), 1)
            names, parents = tuple(str(name) for name in content["names"]), content["parents"].astype(np.int32)
            faces: I32 = content["faces"].astype(np.int32)
            weights = np.zeros((len(vertices), len(names)))
            rows = np.arange(len(vertices))[:, None]
            np.add.at(weights, (rows, content["skin_joint"].astype(np.intp)), content["skin_weight"] / 65535)
            scale = 1.0 if self.height_m is None else self.height_m / float(np.ptp(vertices[:, 2]))
            modes = {name: scale * UNIT * content[name].astype(np.float64) for name in ("shape_modes", "joint_modes")}
        body = assemble(scale * vertices, faces, Skeleton(names, parents, scale * positions), weights, self.part)
        return replace(body, **modes) if self.part == "full" else body
