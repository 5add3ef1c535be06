"""A recording whose parts a pipeline names one by one: a folder of links to them, laid out as every recording is.

What reads a recording, plugins included, reads a folder; so nothing else has to know where the parts lie, and keys are
those of a folder with the same content. The links stay in the user's cache: messages name them, and they show where
each part is. The same paths are always the same folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from mocapflow.config.documents import KeyPath
from mocapflow.config.resolve import Resolver
from mocapflow.errors import PipelineError, RecordingError, alternatives
from mocapflow.io.cameras.calibration import YAML, calibration_files, find_calibration
from mocapflow.io.video.lateness import TIMING

FILES = {"cameras": "cameras.toml", "init": "init.json", "late_frames": TIMING}
SUBJECT = {"body": "body.obj", "skeleton": "skeleton.json", "weights": "weights.npz", "garment": "garment.json"}
TRUTH = {"angles": "angles.csv", "joints": "joints.npz", "cloth": "cloth.npz", "body": "body.npz"}
FREE: Mapping[str, str] = {}  # any name: those of cameras, or of files
FOLDERS = {
    **dict.fromkeys(("videos", "background", "occluders", "keypoints", "reference"), FREE),
    "subject": SUBJECT,
    "truth": TRUTH,
}
WHOLE = "static"  # is a recording of its own
ALONE = {"truth": "angles", "reference": "reference"}  # what a single file in place of such a folder is
REQUIRED = ("cameras", "videos")
LATER_START = re.compile(r"init_\d{6}")  # of a part that begins at that frame
AT = ("recording",)


def folder_of(said: Mapping[str, Any], name: str, resolver: Resolver) -> Path:
    """Return the folder of the recording whose parts a pipeline file names.

    Args:
        said: part: path, or part: {name: path}; parts are called as in a recording folder, without their endings.
        name: what the recording is called.
        resolver: of the file.

    Raises:
        MocapflowError: a part is unknown, missing or no file or folder as it should be; with its line.
    """
    if missing := [part for part in REQUIRED if part not in said]:
        raise resolver.located(PipelineError(f"a recording needs {' and '.join(missing)}"), AT)
    links = {link: Path(os.path.abspath(path)) for part in said for link, path in _links(part, said[part], resolver)}
    written = json.dumps({link: str(path) for link, path in links.items()}, sort_keys=True)
    folder = home() / f"{name}-{hashlib.blake2b(written.encode(), digest_size=4).hexdigest()}"
    try:
        for link, path in links.items():
            (folder / link).parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileExistsError):  # it leads there: the name of the folder says so
                (folder / link).symlink_to(path)
    except OSError as error:
        hint = "links to the parts of the recording belong there; XDG_CACHE_HOME names another place"
        raise RecordingError(f"can't be written: {error.strerror}", where=str(folder), hint=hint) from None
    return folder


def home() -> Path:
    """Return where the folders of links lie.

    Raises:
        RecordingError: nobody has said, and the user has no home.
    """
    try:
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        hint = "XDG_CACHE_HOME names a place"
        raise RecordingError("there is no home folder for links to the parts of a recording", hint=hint) from None
    return cache / "mocapflow" / "recordings"


def whereabouts(recording: Path) -> str | dict[str, str]:
    """Return where a recording is, for people: its folder, or the path of each part where they are named."""
    with suppress(RecordingError):  # no home: no links
        if recording.parent == home():
            links = sorted(path for path in recording.rglob("*") if path.is_symlink())
            return {link.relative_to(recording).as_posix(): str(link.readlink()) for link in links}
    return str(recording)


def _links(part: str, value: Any, resolver: Resolver) -> Iterator[tuple[str, Path]]:
    """Yield where in a recording folder a part belongs, and where it is."""
    steps = (*AT, part)
    if part == "cameras":
        yield from _calibration(_existing(value, steps, resolver))
    elif part in FILES or LATER_START.fullmatch(part):
        yield FILES.get(part, f"{part}.json"), _existing(value, steps, resolver, folder=False)
    elif part == WHOLE:
        yield part, _existing(value, steps, resolver, folder=True)
    elif part in FOLDERS:
        yield from _inside(part, value, steps, resolver)
    else:
        known = [*FILES, *FOLDERS, WHOLE]
        raise resolver.located(PipelineError("no part of a recording", hint=alternatives(part, known)), steps)


def _inside(part: str, value: Any, steps: KeyPath, resolver: Resolver) -> Iterator[tuple[str, Path]]:
    """Yield a folder as a whole, or what it is to hold."""
    if not isinstance(value, dict):
        path = _existing(value, steps, resolver, folder=None if part in ALONE else True)
        yield (part, path) if path.is_dir() else _entry(part, ALONE[part], path)
        return
    for name, inner in value.items():
        if FOLDERS[part] and name not in FOLDERS[part]:
            hint = f"{alternatives(str(name), FOLDERS[part])}\nfor other files name the folder: {part}: DIR"
            raise resolver.located(PipelineError(f"no part of {part}", hint=hint), (*steps, name))
        yield _entry(part, str(name), _existing(inner, (*steps, name), resolver))


def _entry(part: str, name: str, path: Path) -> tuple[str, Path]:
    return f"{part}/{FOLDERS[part].get(name) or name + ('' if path.is_dir() else path.suffix)}", path


def _calibration(path: Path) -> Iterator[tuple[str, Path]]:
    path = find_calibration(path) if path.is_dir() else path
    if path.suffix in YAML:
        yield from ((file.name, file) for file in calibration_files(path))
    else:
        yield "cameras.toml" if path.suffix == ".toml" else "cameras.qca.txt", path


def _existing(value: Any, steps: KeyPath, resolver: Resolver, folder: bool | None = None) -> Path:
    """Return a path that the file names, after a look; `folder` says what it has to be, None: either."""
    if not isinstance(value, str):
        raise resolver.located(PipelineError(f"a path is expected, not {value!r}"), steps)
    path = resolver.file(value, steps)
    if path.exists() and folder in {None, path.is_dir()}:
        return path
    kind = {None: "file or folder", False: "file", True: "folder"}[folder]
    near = next(place for place in path.parents if place.is_dir())
    names = [p.name for p in near.iterdir() if folder is None or p.is_dir() == folder]
    hint = f"in {near}: {alternatives(path.name, names).removeprefix('available: ')}"
    raise resolver.located(RecordingError(f"there is no {kind} {path}", hint=hint), steps)
