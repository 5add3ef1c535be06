"""What a run folder remembers of its command, so that `status` and `export` can come back to it."""

from __future__ import annotations

import fcntl
import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocapflow.errors import PipelineError, no_run_folder
from mocapflow.io.atomic import atomic_write

if TYPE_CHECKING:
    from mocapflow.config.pipeline import Pipeline

FILE = "command.json"
FINISHED = "finished"  # when the run was, missing until then
NO_ARGUMENTS = ("keys", "contents", FINISHED)  # what the file holds beside an `Invocation`


@dataclass(frozen=True)
class Invocation:
    """The arguments of a run; paths are absolute."""

    pipeline: str
    recording: str | None
    changes: tuple[str, ...]
    frames: str | None
    store: str  # a folder
    url: str | None = None  # where its results are shared
    folder: str = ""  # paths in changes start there; empty: the working directory

    def load(self) -> Pipeline:
        """Return the pipeline."""
        from mocapflow.config.frames import frames_of
        from mocapflow.config.pipeline import load_pipeline

        return load_pipeline(
            Path(self.pipeline),
            recording=Path(self.recording) if self.recording else None,
            changes=self.changes,
            folder=Path(self.folder),
            frames=None if self.frames is None else frames_of(self.frames, f"--frames {self.frames}"),
        )

    def absolute(self) -> Invocation:
        """Return the same for any working directory."""
        return replace(
            self,
            pipeline=str(Path(self.pipeline).absolute()),
            recording=self.recording and str(Path(self.recording).absolute()),
            store=str(Path(self.store).absolute()),
            folder=str(Path(self.folder).absolute()),
        )

    def changed(self, *changes: str) -> Invocation:
        """Return the same with more changes on top."""
        return replace(self, changes=(*self.changes, *changes))


def placed(store: str | None, default: Path) -> tuple[str, str | None]:
    """Return the folder of a store that is named by its folder or its URL, and the URL."""
    return (str(default), store) if store and "://" in store else (store or str(default), None)


@contextmanager
def alone(out: Path) -> Iterator[None]:
    """Keep other runs out of a run folder: they wait, for what one writes must not lie beside what another has."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        folder = os.open(out, os.O_RDONLY)
    except OSError as error:
        raise no_run_folder(out, error) from None
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"{out}: waiting for another run that writes into it", file=sys.stderr, flush=True)
            fcntl.flock(folder, fcntl.LOCK_EX)
        except OSError as error:  # its file system knows no locks
            raise no_run_folder(out, error) from None
        yield
    finally:
        os.close(folder)


def remember(
    invocation: Invocation, out: Path, keys: Mapping[str, str], contents: Mapping[str, str] | None = None
) -> None:
    """Write an invocation into its run folder, with the keys of what its stages make, and those whatever the code."""
    _write(out, {**asdict(invocation.absolute()), "keys": keys, "contents": contents or {}})


def note_finished(out: Path) -> None:
    """Note in a run folder that its run is finished."""
    _write(out, {**_read(out), FINISHED: datetime.now().astimezone().isoformat(" ", "seconds")})


def finished_at(out: Path) -> str:
    """Return when the run of a run folder was finished, "" where it is not."""
    return str(_read(out).get(FINISHED, ""))


def _read(out: Path) -> Any:
    return json.loads((out / FILE).read_text(encoding="utf-8"))


def _write(out: Path, said: Mapping[str, object]) -> None:
    try:
        with atomic_write(out / FILE) as part:
            part.write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise no_run_folder(out, error) from None


def recall(out: Path, recording: Path | None = None) -> Invocation:
    """Return the invocation a run folder was made by, with another recording folder where one is given."""
    try:
        said = _read(out) | ({"recording": str(recording)} if recording else {})
        known = {name: value for name, value in said.items() if name not in NO_ARGUMENTS}
        return Invocation(**{**known, "changes": tuple(said["changes"])})
    except (FileNotFoundError, NotADirectoryError):
        hint = f"a run folder is what `mocapflow run` writes; it holds {FILE}"
        raise PipelineError("this is no run folder", where=str(out), hint=hint) from None
    except (ValueError, TypeError, KeyError, AttributeError, IsADirectoryError):
        raise PipelineError("this file is damaged", where=str(out / FILE), hint="run the pipeline again") from None


def recalled_keys(out: Path, kind: str = "keys") -> dict[str, str] | None:
    """Return the keys of the stages of a run folder's command, {} if unknown; None: it is no run folder.

    Args:
        out: the run folder.
        kind: "keys", or "contents": those of pipeline and recording alone, whatever the code.
    """
    try:
        return dict(_read(out)[kind])
    except FileNotFoundError:
        return None
    except (OSError, ValueError, LookupError, TypeError):
        return {}
