"""Examines a recording folder and says everything that is wrong with it, and what to do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from mocapflow.config import measures, recorded_garments
from mocapflow.dressing.guards import mesh_of
from mocapflow.dressing.roles import Garment
from mocapflow.errors import MocapflowError, RecordingError, UnknownComponent, raised
from mocapflow.io.cameras.calibration import find_calibration, read_cameras
from mocapflow.io.cameras.rigs import examine_size, examine_view
from mocapflow.io.findings import Finding, attempt, error, has_errors, note, warning
from mocapflow.io.subject import first_pose
from mocapflow.io.video.lateness import TIMING, late_frames, timing_text, write_late_frames
from mocapflow.recordings.first_look import examine_first_frame
from mocapflow.recordings.recording import open_recording
from mocapflow.recordings.subject import examine_subject
from mocapflow.recordings.synchrony import Lateness, measure
from mocapflow.recordings.trial import copies, examine_trial
from mocapflow.registry import Registry, load_registry


def examine(folder: Path) -> list[Finding]:
    """Return everything that is odd about a recording folder, errors first; every video is decoded.

    Args:
        folder: the recording; nothing is written there.
    """
    folder, registry = Path(folder), load_registry()
    findings: list[Finding] = []
    if not folder.is_dir():
        what = "this is a file; a recording is a folder" if folder.exists() else "no such recording folder"
        return [error(what, where=folder)]
    calibration = attempt(lambda: find_calibration(folder), findings)
    if calibration is not None:
        findings += examine_trial(folder, calibration)
        if (folder / "static" / "videos").is_dir():
            static = folder / "static"
            own = static / "cameras.toml"
            findings += [
                replace(f, message=f"static trial: {f.message}")
                for f in examine_trial(static, own if own.exists() else calibration, rig=False)
            ]
    findings += examine_subject(folder)
    findings += [] if calibration is None else _start(folder, calibration)
    if not has_errors(findings):
        findings += examine_first_frame(folder, registry)
        findings += _compared(folder, registry)
    findings += _garment(folder, registry)
    findings += _missing(folder)
    return sorted(findings, key=lambda finding: ("error", "warning", "note").index(finding.severity))


def examine_timing(folder: Path, write: bool = False) -> list[Finding]:
    """Return which cameras are late against the others; every video is decoded.

    Args:
        folder: the recording, without errors.
        write: put it into recording.json, which every run then heeds.
    """
    findings: list[Finding] = []
    measured = attempt(lambda: _measured(folder), findings)
    if measured is None:
        return findings
    findings.append(note(", ".join(f"{m.camera} {m.frames:+.1f} ± {m.sd:.1f}" for m in measured) + " frames late"))
    known = late_frames(folder, [m.camera for m in measured])
    total = [before + m.frames * m.sure for m, before in zip(measured, known, strict=True)]
    least = min(total, key=abs) if min(total) > 0 or max(total) < 0 else 0  # not every camera can be late
    late = {m.camera: frames - least for m, frames in zip(measured, total, strict=True) if frames != least}
    if not any(m.sure for m in measured):
        return findings
    if write:
        path = attempt(lambda: write_late_frames(folder, late), findings)
        return findings if path is None else [*findings, note("written; from now on runs heed it", where=path)]
    found = [(m.camera, abs(m.frames), "late" if m.frames > 0 else "early") for m in measured if m.sure]
    said = ", ".join(f"{camera} is {frames:.1f} frames {which}" for camera, frames, which in found)
    hint = f"write {timing_text(late)} there, or let --write do so: each frame is then taken at the same moment"
    return [*findings, warning(said, hint, folder / TIMING)]


def _measured(folder: Path) -> list[Lateness]:
    """Return how late each camera is.

    Raises:
        RecordingError: two have the same video, in which any lag would be found, or too little is seen by two at once.
    """
    recording = open_recording(folder)
    for same in copies(recording.lenses, recording.videos):
        raise RecordingError(f"no lateness is measured: {same.message}", where=same.where, hint=same.hint)
    return measure(recording)


def _garment(folder: Path, registry: Registry) -> list[Finding]:
    """Return what keeps the garment that the recording describes from being sewn, or what was mended at it."""
    try:
        garment = measures.recorded_garment(folder, registry)
        return [] if garment is None else _sewn(garment, folder, registry)
    except UnknownComponent as problem:  # its plugin may be on another machine
        return [warning(problem.message, problem.hint, problem.where)]
    except MocapflowError as problem:
        return [error(problem.message, problem.hint, problem.where or folder / recorded_garments.FILE)]


def _compared(folder: Path, registry: Registry) -> list[Finding]:
    """Return why what a run would be compared with can't be read; the evaluation alone opens it."""
    try:
        evaluate: Any = registry.get("stage", "evaluate")
        evaluate().need(open_recording(folder))
    except MocapflowError as problem:
        hint = "\n".join(filter(None, [problem.hint, "a run with the stage `evaluate` does not begin"]))
        return [warning(problem.message, hint, problem.where)]
    return []


def _sewn(garment: Garment, folder: Path, registry: Registry) -> list[Finding]:
    """Return what was mended when a garment was sewn to the scanned person; to the template, whether it can be.

    Raises:
        GarmentError: it can't be sewn to the scanned person.
        InvalidOutput: what is sewn is no garment of this body.
    """
    try:
        body, scanned = measures.wearer(folder, registry)
    except MocapflowError:  # told of with the subject
        return []
    try:
        mesh = mesh_of(garment, body)
    except MocapflowError as problem:
        if scanned:
            raise
        return [warning(f"on the template: {problem.message}", problem.hint, folder / recorded_garments.FILE)]
    except (Exception, SystemExit) as problem:  # a garment of somebody else's may raise anything
        return [error(f"{garment.name} can't be sewn: {raised(problem)}", where=folder / recorded_garments.FILE)]
    mended = mesh.repairs if scanned else ()  # a template is not as wide as the person
    return [warning(f"{mesh.name}: {said}", where=folder / recorded_garments.FILE) for said in mended]


def _start(folder: Path, calibration: Path) -> list[Finding]:
    """Return which cameras don't see where the person is said to begin, or show too much of it.

    What can't be read is told elsewhere.
    """
    pose = folder / first_pose.FILE
    try:
        cameras = [camera for camera in read_cameras(calibration) if camera.size.all()]
        root = first_pose.read_first_pose(pose, ()).position if pose.exists() else None
    except MocapflowError:
        return []
    if root is None or not cameras:
        return []
    found = list(examine_view(cameras, root, "the root joint of the first pose"))
    return [replace(finding, where=str(pose)) for finding in found] or list(examine_size(cameras, root))


def _missing(folder: Path) -> Iterator[Finding]:
    """Yield what a run will ask for, or do without."""
    if not (folder / "subject" / "body.obj").exists() and not (folder / "static").is_dir():
        yield note(
            "there is neither subject/body.obj nor a static trial",
            "a template has to be fitted: pipelines/unscanned.yaml does it by silhouettes, fit_subject to keypoints, "
            "and more exactly with a standing trial",
        )
    if (folder / first_pose.FILE).exists() or (folder / "keypoints").is_dir():
        return
    if (folder / "background").is_dir():
        yield note(
            "there is neither init.json nor keypoints/: silhouettes have to tell the pose of the first frame",
            "use the stage start_from_silhouettes, as pipelines/unscanned.yaml does, or write init.json",
        )
    else:
        yield note(
            "nothing tells the pose of the first frame: there is no init.json, no keypoints/, no background/",
            "put a picture of the empty room per camera into background/, or write init.json",
        )
