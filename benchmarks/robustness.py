"""Random wrong frames, and whether the pose is right again a few frames later: Fig. 12.16 of the chapter.

`OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/robustness.py PIPELINE RECORDING [TRIALS]`, for a recording
with truth/angles.csv. The clean recording is tracked once. In each trial two to four consecutive pictures of one view,
or of all, are of another moment, of another camera, torn or black; the track goes on from the clean pose before them.
The error of a frame is the root mean square over the angles of the truth, before smoothing. A trial is passed if five
frames after the last wrong one it is under the larger of 1.5 times the median of the 20 frames before and that plus 1°.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mocapflow_fitting.start_from_file import StartFromFile
from mocapflow_robustness.check_views import CheckViews
from mocapflow_robustness.corrupt import Corrupt
from mocapflow_robustness.events import Event

from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import Moment, Past, Pose
from mocapflow.geometry.angles import measure
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import Recording, open_recording
from mocapflow.records import F64
from mocapflow.results import ViewChecks
from mocapflow.scene import Scene
from mocapflow.timing import Stopwatch
from mocapflow.track import TIMED, CoupledLoop

BEFORE, AFTER = 20, 5  # frames
KINDS = ("other_time", "other_camera", "torn", "black")


@dataclass(frozen=True)
class Tracker:
    """A pipeline's track stage with what it needs, run from any past."""

    stage: CoupledLoop
    model: ClothedModel
    recording: Recording
    truth: dict[int, dict[str, float]]

    def follow(self, recording: Recording, checks: ViewChecks, past: Past, since: int) -> Iterator[tuple[Past, float]]:
        """Yield, frame by frame, the past of the next one and the error in degrees."""
        start = StartFromFile().run(recording, self.model.scene)
        for picture in recording.frames(since):
            frame = checks.passed(picture)
            found = self.stage.fit(frame, past, start, self.model, lambda *_: None, Stopwatch(TIMED)).state
            estimate = found.estimate
            moment = Moment(time=frame.time, pose=estimate.pose, cloth=found.cloth, observed=estimate.observed)
            past = past.after(moment, found.segmentation.appearance or past.appearance)
            yield past, self.error(frame.index, moment.pose)

    def error(self, index: int, pose: Pose) -> float:
        """Return the root mean square error (degrees) over the true angles of a frame."""
        found = measure(self.model.scene.body, pose.root[None], pose.angles[None])
        names, values = found.names, found.value[0]
        off = [value - self.truth[index][name] for name, value in zip(names, values, strict=True)]
        return float(np.sqrt(np.mean(np.square(off))))


def tracker(pipeline_file: Path, folder: Path) -> Tracker:
    """Return the tracker of a pipeline on a recording."""
    pipeline = load_pipeline(pipeline_file, recording=folder)
    recording = open_recording(folder)
    body = pipeline.body.load(folder)
    garment = pipeline.garment.sew(body) if pipeline.garment else None
    scene = Scene(cameras=recording.cameras, body=body, garment=garment, background=recording.background())
    stage = next(named.stage for named in pipeline.stages if isinstance(named.stage, CoupledLoop))
    with (folder / "truth" / "angles.csv").open() as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    truth = {int(row["frame"]): row for row in rows}
    return Tracker(stage, ClothedModel(scene=scene, draper=stage.draper), recording, truth)


def random_event(rng: np.random.Generator, names: list[str], length: int) -> Event:
    """Return wrong pictures at random, early enough to see what comes after."""
    count = int(rng.integers(2, 5))
    return Event(
        what=KINDS[rng.integers(len(KINDS))],
        first=int(rng.integers(BEFORE, length - count - AFTER)),
        count=count,
        views=() if rng.random() < 0.5 else (names[rng.integers(len(names))],),
        by=int(rng.integers(8, 20)),
    )


def main(pipeline: Path, folder: Path, trials: int) -> None:
    """Track the clean recording, then every trial from the clean pose before it."""
    track = tracker(pipeline, folder)
    none = ViewChecks(frame=np.empty(0, np.int32), camera=np.empty(0, np.int16), reasons=())
    clean = list(track.follow(track.recording, none, Past(), 0))
    pasts, errors = [Past(), *(past for past, _ in clean)], np.array([error for _, error in clean])
    names = [camera.name for camera in track.recording.cameras]
    rng, passed = np.random.default_rng(0), 0
    print(f"clean: median error {np.median(errors):.2f}°; limit, errors from the first wrong frame on")
    for _ in range(trials):
        event = random_event(rng, names, track.recording.length)
        spoiled = Corrupt(events=(event,)).run(track.recording)
        checks = CheckViews().run(spoiled, track.model.scene.background)
        there = errors_of(track, spoiled, checks, pasts[event.first], event)
        before = float(np.median(errors[event.first - BEFORE : event.first]))
        limit = max(1.5 * before, before + 1)
        good = there[-1] <= limit
        passed += good
        wrong = (event.count or 0) * (len(event.views) or len(names))
        print(
            f"{event.what:13} {event.first:3}+{event.count} {','.join(event.views) or 'all':6} "
            f"found {len(checks.frame):2} of {wrong:2}  {limit:.2f} | {np.round(there, 1)} {'' if good else 'LOST'}",
            flush=True,
        )
    print(f"{passed} of {trials} passed")


def errors_of(track: Tracker, spoiled: Recording, checks: ViewChecks, past: Past, event: Event) -> F64:
    """Return the errors from the first wrong frame to the fifth after the last."""
    wanted = (event.count or 0) + AFTER
    following = track.follow(spoiled, checks, past, event.first)
    return np.array([error for (_, error), _ in zip(following, range(wanted), strict=False)])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 20)
