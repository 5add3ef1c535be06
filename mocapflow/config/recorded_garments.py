"""The garments that a recording describes: subject/garment.json, one of them or a list of those that are worn."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from mocapflow.errors import RecordingError
from mocapflow.io.json_toml import place, read_json
from mocapflow.registry import Registry

FILE = Path("subject") / "garment.json"
OUTFIT = "outfit"  # the garment that several make which are worn at once


class RecordedGarment(NamedTuple):
    """A garment that a recording describes, with its tape measures."""

    file: Path
    entry: int = 0  # of the list that the file may hold
    kind: str | None = None  # None: there is no such file
    settings: Collection[str] = ()  # that such a garment has
    written: Mapping[str, tuple[str, Any]] = {}  # by setting: its key and value in the file

    @property
    def measures(self) -> dict[str, Any]:
        """The measures by setting."""
        return {setting: value for setting, (_, value) in self.written.items()}

    def place(self, name: str) -> str:
        """Return where the file says something of this garment."""
        return place(self.file, name, self.entry)


def read_recorded(path: Path, registry: Registry) -> list[RecordedGarment]:
    """Return what a recording says of each garment that is worn.

    There the unit may be written, as in a pipeline, or left out: `length_m` is `length`.
    """
    if not path.exists():
        return []
    hint = 'write {"type": "skirt", "waist_height": 1.05, ...}, in metres; several garments as a list of them'
    said = read_json(path, hint)
    entries = said if isinstance(said, list) else [said]
    if not entries or not all(isinstance(entry, dict) and "type" in entry for entry in entries):
        raise RecordingError("it does not say its type", where=str(path), hint=hint)
    return [_described(RecordedGarment(path, number), entry, registry) for number, entry in enumerate(entries)]


def _described(empty: RecordedGarment, said: dict[str, Any], registry: Registry) -> RecordedGarment:
    """Return a garment with its kind and measures."""
    kind = str(said["type"])
    if kind == OUTFIT:
        hint = '[{"type": "skirt", ...}, {"type": "cylinder", ...}]'
        raise RecordingError("several garments are written as a list of them", where=empty.place(kind), hint=hint)
    known = {setting for cls in registry.provided("garment").get(kind, []) for setting in cls.model_fields}
    written: dict[str, tuple[str, Any]] = {}
    for key, value in said.items():
        setting = key if key in known else f"{key.removesuffix('_m')}_m"
        if setting in written:
            message = f"'{written[setting][0]}' and '{key}' are one measure"
            raise RecordingError(message, where=empty.place(key), hint="leave one of them out")
        if key != "type":
            written[setting] = key, value
    return empty._replace(kind=kind, settings=known, written=written)
