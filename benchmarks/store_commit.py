"""What a committed frame costs: CPU ms and MB, against npz of the same content, where the time goes, what is waited.

Four views of the demo clip, brought to 640x800 px: signed distances to the outline of the difference from the clean
plate, clipped to a band of 12 px as the segmenter does; 1,200 matches; 33 angles; 1,152 cloth vertices.

usage: OMP_NUM_THREADS=1 python benchmarks/store_commit.py [FRAMES]
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from mocapflow.data import (
    Change,
    Cloth,
    Estimate,
    Frame,
    FrameResult,
    FrameState,
    Matches,
    Past,
    Pose,
    Segmentation,
    Silhouette,
)
from mocapflow.geometry.silhouettes import mask_distance
from mocapflow.recordings.recording import open_recording
from mocapflow.storage import packing, rows
from mocapflow.storage.checkpoint import Checkpoint
from mocapflow.storage.rows import Rows
from mocapflow.storage.store import Store

T = TypeVar("T")

SIZE = (640, 800)  # px, width and height
CLIP = Path(__file__).parents[1] / "examples" / "data" / "skirt_steps"
ANGLES, CLOTH, MATCHES, BAND = 33, 1152, 1200, 12.0
TERMS = tuple(f"term {k}" for k in range(20))  # of the functional
STEPS = ("decode", "predict", "drape", "segment", "solve", "cloth", "energy")


def main(count: int = 40) -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    frames = list(scenes(count))
    with tempfile.TemporaryDirectory() as folder:
        spent: dict[str, list[float]] = {"commit": [], "npz compressed": [], "npz": []}
        store = Store(Path(folder) / "store.zarr")
        store.create()
        checkpoint = Checkpoint(store, store.begin("track", "0" * 32, {}), range(count), [f"cam{c}" for c in range(4)])
        past, parts = Past(), Parts()
        for index, (frame, result) in enumerate(frames):  # interleaved, so that a busy machine is fair to all
            name = f"{folder}/{index}"
            with parts:
                past = timed(spent["commit"], lambda f=frame, r=result, p=past: checkpoint.commit(f, p, r))
            content = arrays(result)
            timed(spent["npz compressed"], lambda n=name, c=content: np.savez_compressed(n + "z", **c))
            timed(spent["npz"], lambda n=name, c=content: np.savez(n, **c))
        sealing: list[float] = []
        track = timed(sealing, checkpoint.track)
        assert len(track.frame) == count
        size = {
            "commit": sum(f.stat().st_size for f in store.path.rglob("c.*")) / count,
            "npz compressed": np.mean([f.stat().st_size for f in Path(folder).glob("*z.npz")]),
            "npz": np.mean([f.stat().st_size for f in Path(folder).glob("*[0-9].npz")]),
        }
    best = np.median(spent["commit"][1:])
    print(f"{'per frame':<18}{'CPU ms':>8}{'min':>8}{'ratio':>8}{'MB':>8}")
    for name, values in spent.items():
        middle = np.median(values[1:])
        print(f"{name:<18}{middle:8.2f}{min(values[1:]):8.2f}{middle / best:8.2f}{size[name] / 1e6:8.3f}")
    print(f"first commit (makes the arrays) {spent['commit'][0]:.1f} ms; sealing {sealing[0] / count:.2f} ms a frame;")
    print(f"waiting until the drive has it {np.median(parts.waited[1:]):.1f} ms a frame")
    print("of the commit:", ", ".join(f"{name} {np.median(ms[1:]):.2f} ms" for name, ms in parts.spent.items()))


def timed(spent: list[float], call: Callable[[], T]) -> T:
    start = time.process_time()
    value = call()
    spent.append(1000 * (time.process_time() - start))
    return value


class Parts:
    """Splits a commit: quantising, packing, each kind of array; and how long it waits for the drive."""

    def __init__(self) -> None:
        self.spent: dict[str, list[float]] = {}  # ms of CPU
        self.waited: list[float] = []  # ms

    def __enter__(self) -> None:
        self._now: dict[str, float] = {}
        self.waited.append(0.0)
        self._real = (packing.quantised, packing.match_row, packing.row_of, Rows.write, rows.flush)
        rows.flush = self._wait
        packing.quantised = self._watch("quantise", packing.quantised)
        packing.match_row = self._watch("pack", packing.match_row)
        packing.row_of = self._watch("pack", packing.row_of)
        write = Rows.write
        Rows.write = lambda rows, *a, **k: self._watch(f"write {rows._path.parent.name}", write)(rows, *a, **k)

    def __exit__(self, *_: object) -> None:
        packing.quantised, packing.match_row, packing.row_of, Rows.write, rows.flush = self._real
        for name, ms in self._now.items():
            kind = (
                "write silhouettes"
                if name == "write person"
                else name.replace("write track-000000000000", "write cloth")
            )
            self.spent.setdefault(kind, []).append(ms)

    def _wait(self, path: Path) -> None:
        start = time.perf_counter()
        self._real[-1](path)
        self.waited[-1] += 1000 * (time.perf_counter() - start)

    def _watch(self, name: str, call: Callable) -> Callable:
        def watched(*args, **named):
            start = time.process_time()
            value = call(*args, **named)
            self._now[name] = self._now.get(name, 0.0) + 1000 * (time.process_time() - start)
            return value

        return watched


def scenes(count: int):
    """Yield frames with results like those of a real run."""
    recording, dice = open_recording(CLIP), np.random.default_rng(0)
    plates = [cv2.imread(str(CLIP / "background" / f"{camera.name}.png")) for camera in recording.cameras]
    images = [frame for frame, _ in zip(recording.frames(), range(min(count, 20)), strict=False)]
    for index in range(count):
        frame = images[index % len(images)]
        silhouettes = tuple(
            Silhouette(camera=c, layer="person", distance=outline(image, plate))
            for c, (image, plate) in enumerate(zip(frame.images, plates, strict=True))
        )
        yield Frame(index=index, time=index / 30, images=(), usable=np.ones(4, bool)), result_of(silhouettes, dice)


def outline(image, plate):
    """Return the signed distance (H, W) px to the outline of what differs from the clean plate."""
    plate = cv2.resize(plate, image.shape[1::-1])
    away = cv2.GaussianBlur(np.abs(image.astype(np.float32) - plate).max(axis=2), (0, 0), 1.5) > 18
    mask = cv2.resize(away.astype(np.uint8), SIZE, interpolation=cv2.INTER_NEAREST)
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    return np.clip(cv2.GaussianBlur(mask_distance(mask > 0), (0, 0), 1), -BAND, BAND)  # sub-pixel, as a level set is


def result_of(silhouettes, dice):
    """Return a frame result with random numbers of the real sizes."""
    unknowns = 6 + ANGLES + 2
    spread = dice.normal(size=(unknowns, unknowns))
    pose = Pose(root=np.eye(4), angles=dice.normal(size=ANGLES))
    parameters = dice.normal(size=2)
    matches = Matches(
        camera=np.repeat(np.arange(4, dtype=np.int16), MATCHES // 4), pixel=dice.uniform(0, 640, (MATCHES, 2)),
        direction=dice.normal(size=(MATCHES, 2)), vertex=dice.integers(0, 13_000, MATCHES, np.int32),
        weight=dice.uniform(size=MATCHES),
    )  # fmt: skip
    state = FrameState(
        estimate=Estimate(pose=pose, parameters=parameters, covariance=spread @ spread.T, observed=np.ones(ANGLES)),
        cloth=Cloth(vertices=dice.normal(size=(CLOTH, 3)), parameters=parameters),
        segmentation=Segmentation(silhouettes=silhouettes, appearance={"regions": dice.normal(size=(4, 2, 6))}),
        matches=matches,
    )
    return FrameResult(
        state=state, iterations=3, steady=True, oscillating=False,
        change=Change(body=0.0, cloth=0.0, angles=0.0, sigmas=0.0),
        overlap=np.ones(4), energy=dice.normal(size=(8, len(TERMS))), energy_terms=TERMS,
        seconds=dict.fromkeys(STEPS, 0.001),
    )  # fmt: skip


def arrays(result: FrameResult) -> dict[str, np.ndarray]:
    """Return the same content as arrays for npz: silhouettes already as int8."""
    state = result.state
    named = {f"silhouette_{s.camera}": packing.quantised(s) for s in state.segmentation.silhouettes}
    return named | {
        "root": state.estimate.pose.root, "angles": state.estimate.pose.angles, "parameters": state.cloth.parameters,
        "covariance": state.estimate.covariance, "cloth": state.cloth.vertices,
        "matches": packing.match_row(state.matches), "regions": state.segmentation.appearance["regions"],
        "numbers": np.array([*result.seconds.values(), *result.overlap, result.iterations, result.steady]),
    }  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
