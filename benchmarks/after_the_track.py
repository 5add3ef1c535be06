"""How much memory the stages after the track take, for short and long recordings.

The first frames of a shipped clip are tracked; that track is played forwards and backwards until it has as many frames
as the recording, and smoothed, exported, evaluated and reported by the command line in a process of its own.

usage: OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/after_the_track.py [FRAMES …]
FRAMES are 300 and 3000 if not given: three minutes of a core.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from long_recording import MOCAPFLOW, build, resident

from mocapflow.help.shipped import shipped

TRACKED = 24  # frames
EVERY = 0.02  # s between looks at the memory
PLUGIN = '''
"""Stage `repeated`: the track of another store, forwards and backwards."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from mocapflow import Recording, Stage, hookimpl
from mocapflow.records import array_fields
from mocapflow.results import Track
from mocapflow.storage.store import Store


class Repeated(Stage):
    name = "repeated"
    store: str

    def run(self, recording: Recording) -> Track:
        kept = Store(Path(self.store))
        short = kept.load(next(a for a in kept.artifacts() if a.path.name.startswith("track-")))
        index = np.array(recording.indices, np.int32)
        there = np.arange(len(short.frame))
        rows = np.resize([*there, *there[-2:0:-1]], len(index))
        wanted = [name for name, field in array_fields(Track).items() if field.axes[0] == "T"]
        values = {name: np.asarray(getattr(short, name))[rows] for name in wanted if getattr(short, name) is not None}
        return replace(short, **values | {"frame": index, "time": index / recording.frame_rate})


@hookimpl
def mocapflow_stages():
    return [Repeated]
'''
PIPELINE = """
mocapflow: 1
plugins: [./repeated.py]
recording: .
body: scanned
garment: {use: from_recording, strands: 32, rings: 14}
stages: {track: {use: repeated, store: short.zarr}, smooth: smooth, export: export, evaluate: evaluate, report: report}
"""


def peaks(command: list[str]) -> dict[str, float]:
    """Run a command and return the most MB that it had in memory in each stage."""
    most: dict[str, float] = {}
    running = ["start"]

    def listen(lines: object) -> None:
        for line in lines:
            if found := re.match(r"(\S+): running", line):
                running.append(found[1])

    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        listener = threading.Thread(target=listen, args=(process.stderr,))
        listener.start()
        while process.poll() is None:
            most[running[-1]] = max(most.get(running[-1], 0.0), resident(process.pid))
            time.sleep(EVERY)
        listener.join()
    if process.returncode:
        sys.exit(f"the run ended with {process.returncode}: {' '.join(command)}")
    return most


def main(counts: list[int]) -> None:
    clip = shipped("examples", "data", "skirt_steps")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        quiet = [part for stage in ("overlay", "virtual", "report") for part in ("--set", f"stages.{stage}=null")]
        short = [str(MOCAPFLOW), "run", str(shipped("pipelines", "skirt.yaml")), "--frames", f"0:{TRACKED}", *quiet]
        peaks([*short, "--out", str(folder / "short"), "--store", str(folder / "short.zarr")])
        (folder / "repeated.py").write_text(PLUGIN)
        (folder / "repeated.yaml").write_text(PIPELINE.replace("short.zarr", str(folder / "short.zarr")))
        for count in counts:
            build(clip, folder / f"{count}", count)
            words = [str(MOCAPFLOW), "run", str(folder / "repeated.yaml"), "--recording", str(folder / f"{count}")]
            words += ["--out", str(folder / f"run{count}"), "--store", str(folder / f"{count}.zarr")]
            peaks([*words, "--set", "stages.smooth=null"])  # the track is whole in memory where it is made
            said = ", ".join(f"{stage} {most:.0f}" for stage, most in peaks(words).items())
            print(f"{count} frames, most MB in memory: {said}")


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]] or [300, 3000])
