"""A recording with some of its cameras only: how many does a track need, and where?

`python benchmarks/some_cameras.py RECORDING OUT CAMERAS…` writes a recording OUT/CAMERAS for each of CAMERAS, which are
names joined by commas: cam01,cam03. Its files are links to those of RECORDING, a take of `known_motion.py` or one with
the same files: no frame rate is stated there, no camera late.
"""

from __future__ import annotations

import sys
from pathlib import Path

from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.io.cameras.pose2sim import write_cameras

WHOLE = ("subject", "truth", "init.json")
BY_CAMERA = {"videos": ".mp4", "background": ".png"}


def write(source: Path, folder: Path, names: list[str]) -> None:
    """Write the recording of these cameras."""
    cameras = {camera.name: camera for camera in read_cameras(source)}
    if unknown := set(names) - set(cameras):
        raise SystemExit(f"{source} has no {', '.join(sorted(unknown))}; it has {', '.join(cameras)}")
    folder.mkdir(parents=True)
    write_cameras(folder / "cameras.toml", [cameras[name] for name in names])
    for part in WHOLE:
        (folder / part).symlink_to(source.resolve() / part)
    for part, ending in BY_CAMERA.items():
        (folder / part).mkdir()
        for name in names:
            (folder / part / f"{name}{ending}").symlink_to(source.resolve() / part / f"{name}{ending}")


if __name__ == "__main__":
    for chosen in sys.argv[3:]:
        write(Path(sys.argv[1]), Path(sys.argv[2]) / chosen, chosen.split(","))
