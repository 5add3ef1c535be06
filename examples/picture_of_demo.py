"""The picture of the README: two views with the model, the virtual room, and the knees beside the truth.

Run `mocapflow demo --out runs/demo`, then `python examples/picture_of_demo.py runs/demo [PICTURE.png]`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mocapflow_export import layout

from mocapflow.help.shipped import shipped
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.records import F64, U8

HEIGHT = 480  # px
VIEWS = ("cam01", "cam04")
KNEES = {"knee_flexion_l": ("left knee", "#1f5fbf"), "knee_flexion_r": ("right knee", "#c63232")}


def still(video: Path, frame: int) -> U8:
    """Return a frame of a video, scaled to the height of the picture."""
    capture = cv2.VideoCapture(str(video))
    capture.set(cv2.CAP_PROP_POS_FRAMES, frame)
    read, image = capture.read()
    assert read, f"{video} has no frame {frame}"
    width = round(image.shape[1] * HEIGHT / image.shape[0])
    return np.asarray(cv2.resize(image, (width, HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)


def curves(ours: dict[str, F64], truth: dict[str, F64]) -> U8:
    """Return the knees over the frames as an image, BGR."""
    figure = Figure(figsize=(4.2, HEIGHT / 100), dpi=100, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    panel = figure.subplots()
    for name, (title, colour) in KNEES.items():
        rms = np.sqrt(np.mean((ours[name] - truth[name][: len(ours[name])]) ** 2))
        panel.plot(ours["frame"], ours[name], color=colour, linewidth=1.6, label=f"{title}, RMS {rms:.1f}°")
        panel.plot(ours["frame"], truth[name][: len(ours[name])], color="black", linewidth=0.9, linestyle="--")
    panel.plot([], [], color="black", linewidth=0.9, linestyle="--", label="truth")
    panel.set(xlabel="frame", ylabel="knee flexion / °")
    panel.legend(frameon=False, fontsize=9)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., 2::-1])


def main(run: Path, picture: Path) -> None:
    """Write the picture of a run of the demo, at the frame in which the left knee is bent the most."""
    ours = read_columns(run / layout.ANGLES)
    truth = read_columns(shipped("examples", "data", "skirt_steps") / "truth" / "angles.csv")
    frame = int(ours["knee_flexion_l"].argmax())
    views = [still(run / layout.overlay(view), frame) for view in VIEWS]
    room = still(run / layout.VIRTUAL, frame)
    room = room[:, : room.shape[1] * 3 // 4]  # the rest is floor
    cv2.imwrite(str(picture), np.hstack([*views, room, curves(ours, truth)]))
    print(picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "demo.png"))
