"""Figure 12.3 of the chapter: a level set finds the person from a rough contour in 50 iterations, without a model.

Run `python examples/fig_12_03_segmentation.py [PICTURE.png]`: it writes the contour at the start and after 5, 15 and
50 iterations over the first frame of the demo clip. Nothing but the image is used: no empty scene, no shape prior.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from mocapflow_levelset.evidence import from_image
from mocapflow_levelset.evolve import Schedule, Weights, settle
from mocapflow_levelset.masks import counted
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.statistics import Window

from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording
from mocapflow.records import F32, U8

STEPS = (0, 5, 15, 50)
CAMERA = 1
ROUGH = ((120, 22), (158, 22), (212, 170), (198, 375), (100, 375), (88, 180))  # px: drawn by hand around the person
ENLARGED = 2


def rough_contour(shape: tuple[int, int]) -> F32:
    """Return the signed distance (H, W) px to the hand-drawn start contour."""
    mask = np.zeros(shape, np.float32)
    cv2.fillPoly(mask, [np.array(ROUGH, np.int32)], 1.0)
    return redistance(mask - np.float32(0.5), 12.0)


def segment(image: U8, start: F32, steps: int) -> F32:
    """Return the level set (H, W) after some steps of the chapter's descent in CIELAB."""
    evidence = from_image(image, counted(start.shape, 3).astype(np.float32), ("lab",), 1)
    # a poor start: a wide window for the statistics and a soft step, as in coarse-to-fine
    weights = Weights(sigma_px=3.0, length=0.9, shape=0.0, clip=6.0, step=2.0, band_px=14.0)
    return settle(start, start, evidence, Window(24.0, 4, 0.02), weights, Schedule(steps, 1, 2)).level


def drawn(image: U8, level: F32, title: str) -> U8:
    """Return the image, enlarged, with the zero contour and a title."""
    canvas = cv2.resize(image, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
    fine = cv2.resize(level, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_LINEAR)
    contours, _ = cv2.findContours((fine > 0).astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(canvas, contours, -1, (0, 255, 255), 2)
    cv2.putText(canvas, title, (12, 28), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (255, 255, 255), 2, cv2.LINE_AA)
    return np.asarray(canvas, np.uint8)


def main(path: Path) -> None:
    """Write the four panels side by side."""
    image = open_recording(shipped("examples", "data", "skirt_steps")).frame(0).images[CAMERA]
    start = rough_contour(image.shape[:2])
    panels = [drawn(image, segment(image, start, steps) if steps else start, f"{steps} iterations") for steps in STEPS]
    cv2.imwrite(str(path), np.hstack(panels))
    print(path)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "fig_12_03_segmentation.png"))
