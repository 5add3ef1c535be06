"""The garment of a pipeline, its tape measures from the recording where the file gives none, and who wears it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mocapflow.assets import Body
from mocapflow.config.documents import Document, Place
from mocapflow.config.recorded_garments import FILE, OUTFIT, RecordedGarment, read_recorded
from mocapflow.config.resolve import Resolver
from mocapflow.dressing.guards import body_of
from mocapflow.dressing.roles import Garment
from mocapflow.errors import MocapflowError, PipelineError, PluginError, RecordingError, UnknownComponent
from mocapflow.io.cameras.calibration import find_calibration
from mocapflow.registry import Registry

FROM_RECORDING = "from_recording"


def garment_of(value: Any, recording: Path, resolver: Resolver) -> Garment | None:
    """Return the garment that a pipeline names, None without one; several that are worn at once are an outfit.

    Args:
        value: what the file says: a name, `from_recording`, or {use: name, setting: value}. An `outfit` that does not
            say its `garments` is from the recording, too.
        recording: the folder whose subject/garment.json holds the measures.
        resolver: of the file.

    Raises:
        MocapflowError: a measure is missing or wrong, or the recording names no garment, or an unknown one.
    """
    if value is None:
        return None
    if _named(value) == OUTFIT and not _is_recorded(value):  # says all measures itself
        return resolver.component("garment", value, ("garment",))  # type: ignore[no-any-return]
    worn = _worn(value, recording, resolver.registry)
    settings = {key: given for key, given in value.items() if key != "use"} if isinstance(value, dict) else {}
    _refuse_shared_measures(settings, worn, resolver)
    garments = []
    for one in worn:
        said = {"use": one.kind if _is_recorded(value) else _named(value), **_meant(settings, one, worn)}
        garments.append(_garment(said, one, resolver, by_file_alone=_is_recorded(value) and not settings))
    if len(garments) == 1:
        return garments[0]
    outfit: Any = resolver.registry.get("garment", OUTFIT)
    return outfit(garments=tuple(garments))  # type: ignore[no-any-return]


def _worn(value: Any, recording: Path, registry: Registry) -> list[RecordedGarment]:
    """Return what the recording says of the garments that a pipeline names: of all it describes, or of those so named.

    Raises:
        RecordingError: it describes none, or not as it should be.
    """
    file = recording / FILE
    recorded = read_recorded(file, registry)
    if not _is_recorded(value):
        other = recorded[0]._replace(written={}) if recorded else RecordedGarment(file)
        return [one for one in recorded if one.kind == _named(value)] or [other]
    if not recorded:
        find_calibration(recording)  # without one it is no recording: that comes first
        raise _no_garment(file)
    return recorded


def _refuse_shared_measures(settings: dict[str, Any], worn: list[RecordedGarment], resolver: Resolver) -> None:
    """Raise if the pipeline says a measure, in metres, that more than one of the garments worn has."""
    for key in settings:
        if key.endswith("_m") and sum(key in one.settings for one in worn) > 1:
            message, hint = "more than one garment that is worn has it", f"write that of each in {worn[0].file}"
            raise resolver.located(PipelineError(message, hint=hint), ("garment", key))


def _meant(settings: dict[str, Any], one: RecordedGarment, worn: list[RecordedGarment]) -> dict[str, Any]:
    """Return the settings that are meant for one of the garments worn: those it has, and those that none has."""
    known = set().union(*(each.settings for each in worn))
    return {key: given for key, given in settings.items() if key in one.settings or key not in known}


def _garment(value: Any, recorded: RecordedGarment, resolver: Resolver, by_file_alone: bool = False) -> Garment:
    """Return a garment by what a pipeline says of it, and by its measures."""
    try:
        garment: Garment = resolver.component("garment", value, ("garment",), recorded.measures)
        return garment
    except UnknownComponent as error:
        where = recorded.place(str(recorded.kind)) if _named(value) == recorded.kind else error.where
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
    return str(recording / FILE) if _is_recorded(value) else resolver.place(("garment",))


def own_places(value: Any, resolver: Resolver) -> dict[str, str]:
    """Return where the pipeline itself says measures of its garment, by setting."""
    said = value if isinstance(value, dict) else {}
    return {setting: resolver.place(("garment", setting)) for setting in said if setting != "use"}


def _named(value: Any) -> Any:
    return value.get("use") if isinstance(value, dict) else value


def _is_recorded(value: Any) -> bool:
    """Return whether the recording says what is worn."""
    says_garments = isinstance(value, dict) and "garments" in value
    return _named(value) == FROM_RECORDING or (_named(value) == OUTFIT and not says_garments)


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
    message, where = error.message, recorded.place(str(recorded.kind)) if by_file_alone else error.where
    if setting:
        key, _ = recorded.written[setting]
        message, where = message.replace(setting, key, 1), recorded.place(key)
    return type(error)(message, where=where, hint="\n".join(filter(None, [error.hint, note])))
