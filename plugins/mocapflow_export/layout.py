"""Where everything lies in a run folder; one place to look it up."""

from __future__ import annotations

from pathlib import Path

RESULTS = Path("results")
ANGLES = RESULTS / "angles.csv"
RAW_ANGLES = RESULTS / "angles_raw.csv"
MOTION = RESULTS / "angles.mot"
JOINTS = RESULTS / "joints.trc"
ENERGY = RESULTS / "energy.csv"
EVALUATION = RESULTS / "evaluation.csv"
ERRORS = RESULTS / "errors.csv"
CYCLES = RESULTS / "cycles.csv"
FINDINGS = RESULTS / "evaluation.json"
KEYPOINTS = RESULTS / "keypoints.trc"
DISTANCES = RESULTS / "joint_distances.csv"
STICK = RESULTS / "stick_model.trc"
STICK_PLOT = RESULTS / "stick_model.png"
AGREEMENT_PLOT = RESULTS / "agreement.png"
CYCLES_PLOT = RESULTS / "cycles.png"
COMPARISON = (
    EVALUATION, ERRORS, CYCLES, FINDINGS, KEYPOINTS, DISTANCES, STICK, STICK_PLOT, AGREEMENT_PLOT, CYCLES_PLOT,
)  # fmt: skip
PLOT = RESULTS / "angles.png"
OVERLAP = RESULTS / "overlap.png"
RUN = Path("run.json")
REPORT = Path("report.html")
VIRTUAL = Path("virtual/virtual.mp4")
WRITTEN = (RESULTS, RUN, REPORT, VIRTUAL.parent, Path("overlay"))


def overlay(camera: str) -> Path:
    """Return the overlay video of a camera."""
    return Path("overlay") / f"{camera}.mp4"


def forget_comparison(run_folder: Path, but: Path | None = None) -> None:
    """Remove what a comparison has written, but one part: of another reference, it is none of this run."""
    for part in COMPARISON:
        if part != but:
            (run_folder / part).unlink(missing_ok=True)


def place(run_folder: Path, part: Path) -> Path:
    """Return the path of a part, its folder made."""
    path = run_folder / part
    path.parent.mkdir(parents=True, exist_ok=True)
    return path
