"""The table of settings: what pipeline files, experiment files and every installed component can be told."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator

from pydantic import BaseModel

from mocapflow.config.experiment import ExperimentFile
from mocapflow.config.pipeline import PipelineFile
from mocapflow.errors import UnknownComponent, alternatives
from mocapflow.help.describe import Setting, settings
from mocapflow.registry import PROVIDERS, Registry

INTRODUCTION = """# Settings

Written by `mocapflow settings` from the code; do not edit. What has no default has to be given. A component is named
in a pipeline file, with its settings where they differ from the defaults: `draper: kinematic`, or
`draper: {use: kinematic, sweeps: 4}`; a dotted name is a setting of a group: `steady: {turns: 3}`. On the command line:
`--set stages.track.steady.turns=3`. What is in a list goes by its name, or its number from 0, and null leaves it out;
what is not in it yet is added by its name: `--set stages.track.priors.smooth_motion.angle_sd_deg=5
--set stages.track.priors.parzen=null --set stages.track.priors.ground_plane=ground_plane`.
"""


def manual(registry: Registry, distribution: str) -> str:
    """Return all settings as a Markdown document.

    Args:
        registry: whose components.
        distribution: only those of this package; empty: all.

    Raises:
        UnknownComponent: no component comes from such a package.
    """
    provided = {role: [c for _, found in sorted(registry.provided(role).items()) for c in found] for role in PROVIDERS}
    packages = {registry.origin(cls).distribution for classes in provided.values() for cls in classes}
    if distribution not in {"", *packages}:
        hint = alternatives(distribution, packages)
        raise UnknownComponent(f"no component comes from a package '{distribution}'", hint=hint)
    lines = [INTRODUCTION]
    for file in (PipelineFile, ExperimentFile):
        lines += _entry(f"## {file.name}", file)
    for role, classes in provided.items():
        chosen = [cls for cls in classes if distribution in {"", registry.origin(cls).distribution}]
        if chosen:
            lines += [f"## {role}", "", _first_paragraph(PROVIDERS[role][1]), ""]
        for cls in chosen:
            lines += _entry(f"### {cls.name}", cls, f" From {registry.origin(cls)}.")
    return "\n".join(lines)


def _entry(title: str, cls: type[BaseModel], origin: str = "") -> Iterator[str]:
    yield from (title, "", _first_paragraph(cls) + origin, "")
    found = list(settings(cls))
    if found:
        yield from (*_table(found), "")


def _first_paragraph(cls: type[BaseModel]) -> str:
    return " ".join((inspect.getdoc(cls) or "").partition("\n\n")[0].split())


def _table(found: Iterable[Setting]) -> Iterator[str]:
    yield "| setting | type | default | unit | meaning |"
    yield "|---|---|---|---|---|"
    for one in found:
        kind, default = (f"`{text}`".replace("|", "\\|") if text else "" for text in (one.type, one.default))
        yield f"| `{one.name}` | {kind} | {default} | {one.unit} | {one.meaning} |".replace("  ", " ")
