"""A new plugin package from templates: one module, one test, ready to install."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import NamedTuple

from mocapflow.errors import PluginError

TEMPLATES = Path(__file__).parent / "templates"
NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


class Kind(NamedTuple):
    """What the templates of a role are filled with."""

    conformance: str
    usage: str  # a line under `change` of a pipeline
    imports: str = "from mocapflow.testing import $conformance"  # of the test
    body: str = ""  # of the test, after the component


KINDS: Mapping[str, Kind] = {
    "body": Kind(
        "BodyConformance",
        "body: $module",
        "from mocapflow.help.shipped import shipped\nfrom mocapflow.testing import BodyConformance",
        '\n    recording = shipped("examples", "data", "skirt_steps")  # whose person it is',
    ),
    "cloth_fitter": Kind("ClothFitterConformance", "stages.track.cloth_fitter: $module"),
    "draper": Kind("DraperConformance", "stages.track.draper: $module"),
    "garment": Kind(
        "GarmentConformance",
        "garment: $module",
        "from mocapflow.testing import GarmentConformance, template_body",
        "\n    make_body = staticmethod(template_body)  # the usual body for tests has no shoulders",
    ),
    "matcher": Kind("MatcherConformance", "stages.track.matchers.$module: $module"),
    "pose_solver": Kind("PoseSolverConformance", "stages.track.pose_solver: $module"),
    "predictor": Kind("PredictorConformance", "stages.track.predictor: $module"),
    "prior": Kind("PriorConformance", "stages.track.priors.$module: $module"),
    "recovery": Kind("RecoveryConformance", "stages.track.recovery: $module"),
    "segmenter": Kind("SegmenterConformance", "stages.track.segmenter: $module"),
    "stage": Kind("StageConformance", "stages.$module: $module"),
}


def write_plugin(name: str, role: str, folder: Path) -> list[Path]:
    """Write a plugin package into a new folder and return its files.

    Raises:
        UnknownComponent: there is no such role.
        PluginError: the name can't be one, the package, one of this role and name or the folder is there already, or
            the folder can't be written.
    """
    module = name.replace("-", "_")
    _check(name, module, role, folder)
    kind = KINDS[role]
    words = {
        "name": name,
        "module": module,
        "Class": re.sub("[-_]", "", f"{name}-{role}".title()),  # the role: else `residual` would hide what it imports
        "title": name.replace("-", " ").capitalize(),
        "role": role,
        "usage": Template(kind.usage).substitute(module=module),
        "conformance": kind.conformance,
        "imports": Template(kind.imports).substitute(conformance=kind.conformance),
        "body": kind.body,
    }
    files = {
        "pyproject.toml": "pyproject.toml.txt",
        "README.md": "README.md.txt",
        f"mocapflow_{module}.py": f"{role}.py.txt",
        f"tests/test_{module}.py": "test.py.txt",
    }
    return [_write(folder / path, TEMPLATES / template, words) for path, template in files.items()]


def _check(name: str, module: str, role: str, folder: Path) -> None:
    """Raise if such a package can't be written, or could not be used."""
    from mocapflow.registry import load_registry

    provided = load_registry().provided(role)
    if not NAME.fullmatch(name):
        hint = "lower-case letters, digits and single hyphens, a letter first: my-dress"
        raise PluginError(f"'{name}' can't be the name of a package", hint=hint)
    if find_spec(package := f"mocapflow_{module}"):
        raise PluginError(f"there is a package {package} already", hint="plugins of one name hide each other")
    if module in provided:
        hint = "no pipeline could name either of the two; choose another name"
        raise PluginError(f"there is a {role} '{module}' already", hint=hint)
    if folder.exists():
        raise PluginError("there is something already", where=str(folder), hint="name another folder with --out")


def _write(path: Path, template: Path, words: Mapping[str, str]) -> Path:
    text = Template(template.read_text(encoding="utf-8")).substitute(words)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        hint = "name another folder with --out"
        raise PluginError(f"can't be written: {error.strerror}", where=str(path), hint=hint) from None
    return path
