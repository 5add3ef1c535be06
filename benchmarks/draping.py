"""CPU ms per drape: event-driven and literal, with and without rings, one by one and in batches.

Run it with one thread: `OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/draping.py [RECORDING]`.
RECORDING is a folder with a skirt (default: the shipped demo clip). Medians of rounds taken in turn, compiled before.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from mocapflow_bodies.scanned import Scanned
from mocapflow_draping.kinematic import Kinematic
from mocapflow_draping.samples import in_all_directions
from mocapflow_garments.skirt import Skirt
from rounds import cpu_ms

from mocapflow.data import Past, Pose, PoseBatch
from mocapflow.dressing.roles import Draper
from mocapflow.help.shipped import shipped
from mocapflow.scene import Scene

ROUNDS = 7
POSES = 40
RATIOS = (("one wind", "25 winds of one pose, all of them"), ("one wind, with rings", "25 winds, with rings"))


def main() -> None:
    recording = Path(sys.argv[1]) if len(sys.argv) > 1 else shipped("examples", "data", "skirt_steps")
    body = Scanned().load(recording)
    tapes = json.loads((recording / "subject" / "garment.json").read_text())
    measures = {f"{key}_m": value for key, value in tapes.items() if key != "type"}
    for strands, rings in ((48, 24), (96, 48)):
        scene = Scene(cameras=(), body=body, garment=Skirt(**measures, strands=strands, rings=rings).sew(body))
        report(scene, f"{strands} x {rings}")


def report(scene: Scene, title: str) -> None:
    poses, one = walking(scene, POSES), walking(scene, 1)
    assert scene.garment is not None
    free = np.zeros((POSES, len(scene.garment.parameter_names)))
    same = PoseBatch(root=np.repeat(one.root, 25, axis=0), angles=np.repeat(one.angles, 25, axis=0))
    winds = np.zeros((25, free.shape[1]))
    winds[:, 2:4] = in_all_directions(2, 8, np.radians([5.0, 10.0, 20.0]))
    fall, closed = Kinematic(sweeps=0), Kinematic()
    steps = Kinematic(rule="literal", sweeps=0)
    asked = Pose(root=one.root[0], angles=one.angles[0]), free[0], np.arange(len(scene.garment.vertices)), Past(), scene
    jobs: dict[str, tuple[Callable[[], object], int]] = {  # and how many drapes each is
        "event-driven, strands alone": (lambda: fall.drape(poses, free, Past(), scene), POSES),
        "event-driven, with rings": (lambda: closed.drape(poses, free, Past(), scene), POSES),
        "literal, 50 x 2 degrees": (lambda: steps.drape(poses, free, Past(), scene), POSES),
        "one wind": (lambda: fall.drape(one, winds[-1:], Past(), scene), 1),
        "25 winds of one pose, all of them": (lambda: fall.drape(same, winds, Past(), scene), 1),
        "one wind, with rings": (lambda: closed.drape(one, winds[-1:], Past(), scene), 1),
        "25 winds, with rings": (lambda: closed.drape(same, winds, Past(), scene), 1),
        "25 winds, literal": (lambda: steps.drape(same, winds, Past(), scene), 1),
        "rates of all unknowns, carried along": (lambda: closed.velocity(*asked), 1),
        "the same by differences": (lambda: Draper.velocity(closed, *asked), 1),
    }
    if find_spec("newton"):  # the extra `physics`
        from mocapflow_physics.xpbd import Xpbd

        simulated, few = Xpbd(), walking(scene, 8)
        jobs["newton XPBD, 0.6 s from rest, one alone"] = (lambda: simulated.drape(one, free[:1], Past(), scene), 1)
        jobs["newton XPBD, eight together"] = (lambda: simulated.drape(few, free[:8], Past(), scene), 8)
    print(f"\n{title}")
    spent = cpu_ms({name: job for name, (job, _) in jobs.items()}, ROUNDS)
    for name, ms in spent.items():
        print(f"  {name:42s} {ms / jobs[name][1]:8.3f} ms")
    for one, many in RATIOS:
        print(f"  {many} / {one}: {spent[many] / spent[one]:.2f}")


def walking(scene: Scene, count: int) -> PoseBatch:
    """Return poses with the legs swinging against each other."""
    angles = np.zeros((count, len(scene.body.twists)))
    phase = np.linspace(0.3, 2 * np.pi, count, endpoint=False)
    for name, amount in (("hip_l.flexion", 0.5), ("hip_r.flexion", -0.5)):
        angles[:, scene.body.screw_names.index(name)] = amount * np.sin(phase)
    for name, shift in (("knee_l.flexion", 0.0), ("knee_r.flexion", np.pi)):
        angles[:, scene.body.screw_names.index(name)] = 0.5 + 0.5 * np.cos(phase + shift)
    return PoseBatch(root=np.tile(np.eye(4), (count, 1, 1)), angles=angles)


if __name__ == "__main__":
    main()
