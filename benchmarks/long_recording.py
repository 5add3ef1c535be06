"""A long recording: is memory flat, the time per frame constant, the store small, and a killed run resumed exactly?

A shipped clip is played forwards and backwards until it has FRAMES frames (in a temporary folder), and tracked by
the command line in a process of its own, which is killed twice on its way. Its first frames have to be those of an
undisturbed short run, bit by bit.

usage: OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/long_recording.py [FRAMES] [PATH=VALUE]
FRAMES is 3000 if not given: half an hour of a core. PATH=VALUE changes `pipelines/skirt.yaml` as `--set` does.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from mocapflow.help.shipped import shipped
from mocapflow.results import Track
from mocapflow.storage.artifacts import Artifact
from mocapflow.storage.store import Store

MOCAPFLOW = Path(sys.executable).with_name("mocapflow")
KILLED_AT = (60, 140)  # frames
COMPARED = 200  # frames, with a run that nothing disturbed
PERIODS = 3  # of the motion in a block that times are told for
EVERY = 1.0  # s between looks at the memory
SAME = ("root", "angles", "covariance", "cloth", "cloth_parameters", "iterations", "steady", "overlap", "energy")


def build(clip: Path, folder: Path, frames: int) -> int:
    """Write a clip, forwards and backwards, into a recording folder; return the period in frames."""
    shutil.copytree(clip, folder, ignore=shutil.ignore_patterns("videos", "truth"))
    (folder / "videos").mkdir()
    period = 0
    for video in sorted((clip / "videos").glob("*.mp4")):
        capture, pictures = cv2.VideoCapture(str(video)), []
        while (read := capture.read())[0]:
            pictures.append(read[1])
        loop = [*pictures, *pictures[-2:0:-1]]
        period, size = len(loop), pictures[0].shape[1::-1]
        writer = cv2.VideoWriter(str(folder / "videos" / video.name), cv2.VideoWriter.fourcc(*"mp4v"), 30, size)
        for frame in range(frames):
            writer.write(loop[frame % period])
        writer.release()
    return period


def track_of(store: Path) -> Artifact | None:
    """Return the track in a store, as far as it is."""
    return next((a for a in Store(store).artifacts() if a.path.name.startswith("track-")), None)


def followed(command: list[str], store: Path, kill_at: int | None = None) -> list[tuple[int, float]]:
    """Run a command, to its end or until a frame is saved; return (frames saved, MB in memory) now and then."""
    seen = []
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None:
            time.sleep(EVERY)
            found = track_of(store)
            done = found.frames if found else 0
            if memory := resident(process.pid):
                seen.append((done, memory))
            if kill_at is not None and done >= kill_at:
                os.kill(process.pid, signal.SIGKILL)
    if kill_at is None and process.returncode:
        sys.exit(f"the run ended with {process.returncode}: {' '.join(command)}")
    return seen


def resident(pid: int) -> float:
    """Return how many MB a process holds in memory, 0 where it has ended."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except (OSError, IndexError):
        return 0.0


def loaded(store: Path, frames: int | None = None) -> Track:
    """Return the finished track of a store, or its first frames."""
    found = track_of(store)
    assert found is not None and found.complete
    track = Store(store).load(found, frames)
    assert isinstance(track, Track)
    return track


def main(frames: int, changes: list[str]) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        period = build(shipped("examples", "data", "skirt_steps"), folder / "recording", frames)
        options = [
            part for change in ["stages.overlay=null", "stages.virtual=null", *changes] for part in ("--set", change)
        ]
        command = [str(MOCAPFLOW), "run", str(shipped("pipelines", "skirt.yaml")), *options]
        command += ["--recording", str(folder / "recording")]
        whole, short = folder / "whole" / "store.zarr", folder / "short" / "store.zarr"
        for kill_at in KILLED_AT:
            followed([*command, "--out", str(whole.parent / "run")], whole, kill_at)
        memory = followed([*command, "--out", str(whole.parent / "run")], whole)
        followed([*command, "--out", str(short.parent / "run"), "--frames", f"0:{COMPARED}"], short)
        report(whole, short, memory, PERIODS * period)


def report(whole: Path, short: Path, memory: list[tuple[int, float]], block: int) -> None:
    """Print what was measured."""
    track, first, reference = loaded(whole), loaded(whole, COMPARED), loaded(short)
    frames = len(track.frame)
    print(f"{'frames':>12}{'MB in memory':>15}{'CPU ms a frame: median':>26}{'mean':>8}")
    cost = 1e3 * track.seconds.sum(axis=1)
    for start in range(0, frames, block):
        part = cost[start : start + block]
        held = [megabytes for done, megabytes in memory if start < done <= start + len(part) and done < frames]
        size = f"{np.median(held):15.0f}" if held else " " * 15
        print(f"{start:6}–{start + len(part) - 1:<5}{size}{np.median(part):26.0f}{part.mean():8.0f}")
    later = [megabytes for done, megabytes in memory if done == frames]
    print(f"at most in the stages after the track: {max(later):.0f} MB")
    files = [file for artifact in Store(whole).artifacts() for file in artifact.path.rglob("*") if file.is_file()]
    print(f"store: {sum(file.stat().st_size for file in files) / 1e6 / frames:.3f} MB a frame, {len(files)} files")
    same = all(np.array_equal(getattr(first, name), getattr(reference, name), equal_nan=True) for name in SAME)
    print(f"killed at {KILLED_AT}; first {COMPARED} frames {'are' if same else 'are NOT'} those of an undisturbed run")
    print(f"not at rest: {np.mean(~track.steady):.1%}, overlap {np.nanmedian(track.overlap):.3f}")


if __name__ == "__main__":
    counts = [word for word in sys.argv[1:] if "=" not in word]
    main(int(counts[0]) if counts else 3000, [word for word in sys.argv[1:] if "=" in word])
