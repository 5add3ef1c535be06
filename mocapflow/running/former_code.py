"""Results that older code has made of the same pipeline and recording: as good for an export as on their first day."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from mocapflow.errors import PipelineError
from mocapflow.running.execution import is_hit
from mocapflow.running.recipes import Step
from mocapflow.running.runner import Prepared
from mocapflow.storage.artifacts import Artifact
from mocapflow.storage.rows import Corrupted
from mocapflow.storage.store import Report, Store


def as_made(prepared: Prepared, keys: Mapping[str, str], report: Report) -> Prepared:
    """Return a run with the keys under which an earlier one has made its results, and tell of what code that was.

    Raises:
        PipelineError: a result is not in the store any more, or this code can't read it: nothing is made anew, for
            what is of one code must not lie beside what is of another.
    """
    steps = prepared.steps
    older = {step.label: _artifact(step, keys, prepared.store) for step in steps if step.stored}
    told = [artifact for step in steps if (artifact := older.get(step.label)) and artifact.key != step.key]
    if told:
        last = max(told, key=lambda artifact: str(artifact.attributes.get("created", "")))
        code = f"mocapflow {last.made_with[-1][1].get('mocapflow', '?')} on {last.attributes.get('created', '?')}"
        names = ", ".join(artifact.path.name for artifact in told)
        report(f"warning: code has changed since this run; what it has made by {code} is exported: {names}")
    keyed = [replace(step, key=older[step.label].key) if step.label in older else step for step in steps]
    return replace(prepared, steps=keyed)


def _artifact(step: Step, keys: Mapping[str, str], store: Store) -> Artifact:
    found = store.find(keys.get(step.label, ""))
    hint = "run it again, then export"
    if found is None or not is_hit(step, found):
        raise PipelineError(f"code has changed since this run, and its {step.label} is not in the store", hint=hint)
    try:
        store.load(found, step.frames if step.chain else None)
    except Corrupted as error:
        raise PipelineError(f"the {step.label} of this run can't be read: {error.message}", hint=hint) from None
    return found
