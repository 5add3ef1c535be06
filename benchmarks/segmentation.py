"""Segmentation of one 640x800 view against cv2.grabCut and skimage's Chan-Vese, in one run.

Run `OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/segmentation.py`. The scene is synthetic with a known
mask: a figure on 19 % of the picture, both regions textured with patterns of the same strength and drifting in colour.
Every method starts from the same outline, 3 or 10 px off. The table gives CPU ms of one core, intersection over union
with the true mask and the time as a ratio to grabCut with one iteration; the compile time of the kernels (0 s from the
second run on, they are cached) stands apart. Last, the same figure before an empty scene that is known.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import cv2
import numpy as np
from mocapflow_levelset.evidence import Room
from mocapflow_levelset.grabcut import GrabCut
from mocapflow_levelset.levelset import BORDER_PX, LevelSet
from mocapflow_levelset.masks import counted
from mocapflow_levelset.plates import Plate, Shadow, plate_of
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.view import BAND_PX, View, find
from skimage.segmentation import chan_vese, morphological_chan_vese

from mocapflow.records import F32, U8, Bool

WIDTH, HEIGHT, ROUNDS = 640, 800, 5
TEXTURE = 18.0  # grey levels, standard deviation of each of two patterns


class Task(NamedTuple):
    """A picture with its true outline."""

    image: U8
    plates: Mapping[int, Plate]  # the same without the figure, by how much it is shrunk
    truth: F32  # (H, W) px, signed distance, positive inside


def make_task(seed: int = 0) -> Task:
    rng = np.random.default_rng(seed)
    fine = figure()
    alpha = cv2.GaussianBlur(cv2.resize(fine, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), (0, 0), 0.8)
    person = texture(rng, (95, 100, 150), ((50, 30), (20, 40), (40, -60)))
    room = texture(rng, (135, 125, 115), ((-40, 40), (60, -20), (-30, 30)))
    clean = alpha[..., None] * person + (1 - alpha[..., None]) * room
    image = np.clip(clean + rng.normal(0, 4, clean.shape), 0, 255).astype(np.uint8)
    room = np.clip(room, 0, 255)
    plates = {
        factor: plate_of(room, np.full_like(room, 4.0), ("lab",), factor) for factor in (1, 2, 4)
    }  # once per recording
    return Task(image, plates, redistance(alpha - np.float32(0.5), 40.0))


def figure() -> F32:
    """Return a standing figure at twice the size, 0 or 1."""
    mask = np.zeros((HEIGHT * 2, WIDTH * 2), np.float32)

    def at(x: float, y: float) -> tuple[int, int]:
        return int(((x - 320) * 0.85 + 320) * 2), int(y * 2)

    cv2.ellipse(mask, at(320, 100), (78, 104), 0, 0, 360, 1.0, -1)
    trunk = [at(258, 170), at(382, 170), at(385, 380), at(415, 560), at(225, 560), at(255, 380)]
    cv2.fillPoly(mask, [np.array(trunk)], 1.0)
    limbs = [(260, 190, 170, 330, 72), (170, 330, 150, 450, 60), (380, 190, 470, 310, 72), (470, 310, 520, 410, 60)]
    limbs += [(270, 540, 250, 660, 126), (250, 660, 245, 760, 90), (370, 540, 400, 660, 126), (400, 660, 410, 760, 90)]
    for x0, y0, x1, y1, width in limbs:
        cv2.line(mask, at(x0, y0), at(x1, y1), 1.0, width)
    return mask


def texture(rng: np.random.Generator, colour: tuple[int, ...], drift: tuple[tuple[int, int], ...]) -> F32:
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    planes = []
    for level, (across, down) in zip(colour, drift, strict=True):
        plane = level + across * (columns / WIDTH - 0.5) + down * (rows / HEIGHT - 0.5)
        for scale in (2.0, 8.0):
            pattern = cv2.GaussianBlur(rng.standard_normal((HEIGHT, WIDTH)).astype(np.float32), (0, 0), scale)
            plane = plane + 0.7 * TEXTURE * pattern / pattern.std()
        planes.append(plane)
    return np.stack(planes, axis=2).astype(np.float32)


def shifted(truth: F32, pixels: int) -> F32:
    move = np.array([[1, 0, pixels], [0, 1, 0]], np.float32)
    return np.asarray(cv2.warpAffine(truth, move, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REPLICATE), np.float32)


def levelset(task: Task, start: F32, known: bool = False) -> Bool:
    segmenter = LevelSet(shape_weight=0.0)
    resolutions = segmenter._resolutions(warm=False)
    rooms = {factor: Room(plate, np.zeros_like(plate.spread, bool), Shadow()) for factor, plate in task.plates.items()}
    view = View(task.image, start, start, counted(start.shape, BORDER_PX), rooms if known else None)
    return find(view, resolutions, segmenter._method()).level > 0


def grabcut(task: Task, start: F32, iterations: int) -> Bool:
    return GrabCut(iterations=iterations).find(task.image, start) > 0


def chan_vese_40(task: Task, start: F32) -> Bool:
    grey = cv2.cvtColor(task.image, cv2.COLOR_BGR2GRAY) / 255
    return np.asarray(chan_vese(grey, init_level_set=start, max_num_iter=40), bool)


def morphological(task: Task, start: F32) -> Bool:
    grey = cv2.cvtColor(task.image, cv2.COLOR_BGR2GRAY) / 255
    return np.asarray(morphological_chan_vese(grey, 28, init_level_set=(start > 0).astype(np.int8)), bool)


def milliseconds(call: Callable[[], Bool]) -> float:
    before = time.process_time()
    call()
    return 1e3 * (time.process_time() - before)


def overlap(found: Bool, truth: F32) -> float:
    inside = truth > 0
    return float((found & inside).sum() / (found | inside).sum())


def main() -> None:
    cv2.setNumThreads(1)
    task = make_task()
    print(f"{WIDTH} x {HEIGHT} px, figure on {100 * (task.truth > 0).mean():.0f} % of the picture")
    start = np.clip(shifted(task.truth, 3), -BAND_PX, BAND_PX)
    before = time.perf_counter()
    levelset(task, start)
    levelset(task, start, known=True)
    print(f"compiling or loading the kernels and first call: {time.perf_counter() - before:.1f} s")
    print(f"{'start':>6} {'method':<34} {'CPU ms':>8} {'IoU':>7} {'ratio':>7}")
    for pixels in (3, 10):
        moved = shifted(task.truth, pixels)
        start = np.clip(moved, -BAND_PX, BAND_PX)
        methods: dict[str, Callable[[], Bool]] = {
            "levelset": lambda start=start: levelset(task, start),
            "levelset, empty scene known": lambda start=start: levelset(task, start, known=True),
            "cv2.grabCut, 1 iteration": lambda moved=moved: grabcut(task, moved, 1),
            "cv2.grabCut, 5 iterations": lambda moved=moved: grabcut(task, moved, 5),
            "skimage chan_vese, 40 it": lambda moved=moved: chan_vese_40(task, moved),
            "skimage morphological, 28 it": lambda moved=moved: morphological(task, moved),
        }
        cost: dict[str, list[float]] = {name: [] for name in methods}
        for round_ in range(ROUNDS):  # interleaved, so that a busy machine is busy for all
            for name, call in methods.items():
                if round_ == 0 or "skimage" not in name:
                    cost[name].append(milliseconds(call))
        reference = float(np.median(cost["cv2.grabCut, 1 iteration"]))
        print(f"{pixels:>4}px {'(nothing)':<34} {'':>8} {overlap(start > 0, task.truth):7.3f}")
        for name, call in methods.items():
            ms = float(np.median(cost[name]))
            print(f"{pixels:>4}px {name:<34} {ms:8.1f} {overlap(call(), task.truth):7.3f} {ms / reference:7.3f}")


if __name__ == "__main__":
    main()
