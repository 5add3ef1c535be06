"""What a clothed frame costs, step by step and part by part, in ms of one core.

Run `OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/frame.py [RECORDING] [FRAMES] [PATH=VALUE]`. RECORDING
is a folder with a subject, a garment and an init.json (default: the shipped demo clip), FRAMES how many (default 20);
PATH=VALUE changes `pipelines/skirt.yaml` as `--set` does. The first two frames, which load the kernels, do not count.
Steps are medians over frames; parts are means over frames and lie within the steps, some within each other.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np
from mocapflow_draping.kinematic import Kinematic
from mocapflow_levelset import levelset
from mocapflow_matching.containment import Containment
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_twist.problem import Problem
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton

from mocapflow import hookimpl, load_pipeline, load_registry
from mocapflow.data import FrameResult, PoseBatch
from mocapflow.help.shipped import shipped
from mocapflow.model import ClothedModel
from mocapflow.registry import Origin
from mocapflow.running import runner
from mocapflow.scene import Scene
from mocapflow.track import CoupledLoop

WARM_UP = 2  # frames

PARTS: dict[str, tuple[Any, str]] = {
    "surfaces posed": (Scene, "surface"),
    "model outlines for the level set": (levelset, "model_distance"),
    "level set, a view": (levelset, "find"),
    "contour_icp": (ContourIcp, "match"),
    "containment": (Containment, "match"),
    "rows and shares of matches": (TwistGaussNewton, "_data"),
    "quadratic model": (Problem, "quadratic"),
    "motion of the cloth, with its drapes": (ClothedModel, "velocity"),
    "drape": (Kinematic, "drape"),
}


class Meter:
    """Adds up calls and CPU seconds of parts, and keeps the steps of each frame; an onlooker of the run."""

    def __init__(self) -> None:
        self.steps: list[dict[str, float]] = []
        self.turns: list[int] = []
        self.seconds: dict[str, float] = defaultdict(float)
        self.calls: dict[str, int] = defaultdict(int)

    @hookimpl
    def mocapflow_frame_done(self, frame: int, result: FrameResult) -> None:
        """Keep a frame's times; what came before the first frame that counts is forgotten."""
        self.steps.append(dict(result.seconds))
        self.turns.append(result.iterations)
        if len(self.steps) == WARM_UP:
            self.seconds.clear()
            self.calls.clear()

    def around(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return the same call, timed."""

        def timed(*args: Any, **named: Any) -> Any:
            before = time.process_time()
            result = call(*args, **named)
            self.seconds[name] += time.process_time() - before
            self.calls[name] += next((len(a.root) for a in args if isinstance(a, PoseBatch)), 1)
            return result

        return timed


def measure(recording: Path, frames: int, changes: list[str]) -> Meter:
    """Track some frames and return what they cost."""
    meter, registry = Meter(), load_registry()
    registry.add(Origin("meter", "benchmark"), lambda: meter)
    pipeline = load_pipeline(
        shipped("pipelines", "skirt.yaml"), registry, recording=recording, frames=slice(0, frames), changes=changes
    )
    last = next(k for k, named in enumerate(pipeline.stages) if isinstance(named.stage, CoupledLoop))
    pipeline = replace(pipeline, stages=pipeline.stages[: last + 1])
    patches = [patch.object(*part, meter.around(name, getattr(*part))) for name, part in PARTS.items()]
    with tempfile.TemporaryDirectory() as folder:
        for each in patches:
            each.start()
        runner.run(pipeline, store=Path(folder) / "store.zarr", out=Path(folder) / "run")
        for each in patches:
            each.stop()
    return meter


def main(recording: Path, frames: int, changes: list[str]) -> None:
    cv2.setNumThreads(1)
    meter = measure(recording, frames, changes)
    counted = meter.steps[WARM_UP:]
    whole = np.array([sum(steps.values()) for steps in counted]) * 1e3
    print(f"{recording.name}: {len(counted)} frames, {np.mean(meter.turns[WARM_UP:]):.1f} turns a frame")
    print(f"{'whole frame':40}{np.median(whole):9.1f} ms   least {whole.min():.1f}")
    for step in counted[0]:
        print(f"  {step:38}{1e3 * np.median([steps[step] for steps in counted]):9.1f}")
    print(f"{'part':40}{'ms':>9}{'calls a frame':>16}{'ms each':>10}")
    for name in PARTS:
        cost, calls = 1e3 * meter.seconds[name] / len(counted), meter.calls[name] / len(counted)
        print(f"  {name:38}{cost:9.1f}{calls:16.1f}{cost / max(calls, 1e-9):10.3f}")


if __name__ == "__main__":
    paths = [word for word in sys.argv[1:] if "=" not in word]
    main(
        Path(paths[0]) if paths else shipped("examples", "data", "skirt_steps"),
        int(paths[1]) if len(paths) > 1 else 20,
        [word for word in sys.argv[1:] if "=" in word],
    )
