"""The garment of a pipeline, its tape measures from the recording where the file gives none, and who wears it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from mocapflow.assets import Body
from mocapflow.config.documents import Document, Place
from mocapflow.config.resolve import Resolver
from mocapflow.dressing.guards import body_of
from mocapflow.dressing.roles import Garment
from mocapflow.errors import MocapflowError, PluginError, RecordingError, UnknownComponent, guess
from mocapflow.io.cameras.calibration import find_calibration
from mocapflow.io.json_toml import place, read_json
from mocapflow.registry import Registry

FILE = Path("subject") / "garment.json"
FROM_RECORDING = "from_recording"


class RecordedGarment(NamedTuple):
    """The garment that a recording describes, with its tape measures."""

    file: Path
    kind: str | None  # None: there is no such file
    written: Mapping[str, tuple[str, Any]]  # by setting: its key and value in the file

    @property
    def measures(self) -> dict[str, Any]:
        """The measures by setting."""
        return {setting: value for setting, (_, value) in self.written.items()}


def garment_of(value: Any, recording: Path, resolver: Resolver) -> Garment | None:
    """Return the garment that a pipeline names, None without one.

    Args:
        value: what the file says: a name, `from_recording`, or {use: name, setting: value}.
        recording: the folder whose subject/garment.json holds the measures.
        resolver: of the file.

    Raises:
        MocapflowError: a measure is missing or wrong, or the recording names no garment, or an unknown one.
    """
    if value is None:
        return None
    recorded = _read_recorded(recording / FILE)
    named = _named(value)
    by_file_alone = named == FROM_RECORDING and not (isinstance(value, dict) and len(value) > 1)
    if named == FROM_RECORDING:
        if recorded.kind is None:
            find_calibration(recording)  # without one it is no recording: that comes first
            raise _no_garment(recorded.file)
        named, value = recorded.kind, {**value, "use": recorded.kind} if isinstance(value, dict) else recorded.kind
    if named != recorded.kind:
        recorded = recorded._replace(written={})  # measures of another garment
    try:
        garment: Garment = resolver.component("garment", value, ("garment",), recorded.measures)
        return garment
    except UnknownComponent as error:
        where = place(recorded.file, str(recorded.kind)) if named == recorded.kind else error.where
        raise UnknownComponent(error.message, where=where, hint=error.hint) from None
    except PluginError:  # two garments have its name, which no measure mends
        raise
    except MocapflowError as error:
        if error.where != resolver.place(("garment",)):
            raise
        raise _wrong_measure(error, recorded, by_file_alone) from None


def recorded_garment(recording: Path, registry: Registry) -> Garment | None:
    """Return the garment that a recording describes, None where it describes none.

    Raises:
        MocapflowError: a measure is missing or wrong, or no plugin has such a garment.
    """
    file = recording / FILE
    resolver = Resolver(Document({}, {(): Place(str(file), recording)}), registry)
    return garment_of(FROM_RECORDING, recording, resolver) if file.exists() else None


def wearer(recording: Path, registry: Registry) -> tuple[Body, bool]:
    """Return the person of a recording, and whether it is a scan: where there is none, the template.

    Raises:
        MocapflowError: the scan can't be used.
    """
    scanned = any((recording / "subject" / file).exists() for file in ("body.obj", "skeleton.json"))
    model: Any = registry.get("body", "scanned" if scanned else "template")
    return body_of(model(), recording), scanned


def place_of(value: Any, recording: Path, resolver: Resolver) -> str:
    """Return where the measures of a garment are written: in the recording, or as file:line:column."""
    return str(recording / FILE) if _named(value) == FROM_RECORDING else resolver.place(("garment",))


def own_places(value: Any, resolver: Resolver) -> dict[str, str]:
    """Return where the pipeline itself says measures of its garment, by setting."""
    said = value if isinstance(value, dict) else {}
    return {setting: resolver.place(("garment", setting)) for setting in said if setting != "use"}


def _named(value: Any) -> Any:
    return value.get("use") if isinstance(value, dict) else value


def _no_garment(file: Path) -> RecordingError:
    hint = (
        'write {"type": "skirt", ...} with tape measures in metres there, or name the garment in the pipeline;\n'
        "tight clothes need none: garment: null"
    )
    message = "the pipeline takes the garment from the recording, which names none"
    return RecordingError(message, where=str(file), hint=hint)


def _wrong_measure(error: MocapflowError, recorded: RecordedGarment, by_file_alone: bool) -> MocapflowError:
    """Return an error of the garment as a whole, with where its tape measures come from, and which of them is wrong."""
    source = f"describes a {recorded.kind}" if recorded.kind else "does not exist"
    note = f"measures, in metres, come from {recorded.file}, which {source}; a value in the pipeline overrides them"
    setting = next((name for name in recorded.written if error.message.startswith(f"garment.{name}: ")), "")
    message, where, hint = error.message, str(recorded.file) if by_file_alone else error.where, error.hint
    if setting:
        key, _ = recorded.written[setting]
        message, where = message.replace(setting, key, 1), place(recorded.file, key)
        if hint == guess(key, [key]):  # a setting of that name, but no measure
            hint = f"no measure: write it in the pipeline, garment: {{use: {FROM_RECORDING}, {key}: …}}"
    return type(error)(message, where=where, hint="\n".join(filter(None, [hint, note])))


def _read_recorded(path: Path) -> RecordedGarment:
    """Return what a recording says of its garment.

    There the unit may be written, as in a pipeline, or left out: `length_m` is `length`.
    """
    if not path.exists():
        return RecordedGarment(path, None, {})
    hint = 'write {"type": "skirt", "waist_height": 1.05, ...}, in metres'
    said = read_json(path, hint)
    if not isinstance(said, dict) or "type" not in said:
        raise RecordingError("it does not say its type", where=str(path), hint=hint)
    written: dict[str, tuple[str, Any]] = {}
    for key, value in said.items():
        setting = f"{key.removesuffix('_m')}_m"
        if setting in written:
            message = f"'{written[setting][0]}' and '{key}' are one measure"
            raise RecordingError(message, where=place(path, key), hint="leave one of them out")
        if key != "type":
            written[setting] = key, value
    return RecordedGarment(path, str(said["type"]), written)
