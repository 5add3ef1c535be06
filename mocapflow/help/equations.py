"""The table of equations: which function implements which equation of the paper."""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path


@dataclass(frozen=True)
class Row:
    """One equation of `EQUATIONS.md`."""

    number: str
    what: str
    function: str  # dotted name
    test: str

    def place(self) -> str:
        """Return `file:line function` of the code; the module is not imported."""
        module, _, name = self.function.rpartition(".")
        owner = ""
        if module.rpartition(".")[2][:1].isupper():  # a method
            module, _, owner = module.rpartition(".")
        spec = importlib.util.find_spec(module)
        if spec is None or spec.origin is None:
            return self.function
        wanted = f"{owner}.{name}".lstrip(".")
        lines = dict(definitions(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))))
        return f"{_short(spec.origin)}:{lines[wanted].lineno} {wanted}" if wanted in lines else self.function


def table() -> list[Row]:
    """Return the rows of `EQUATIONS.md`."""
    text = (files("mocapflow") / "EQUATIONS.md").read_text(encoding="utf-8")
    rows = [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in text.splitlines() if "|" in line]
    return [Row(*cells) for cells in rows[2:]]


def definitions(tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
    """Yield the functions, classes and methods of a module with their names; methods as `Class.method`."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, node
        if isinstance(node, ast.ClassDef):
            methods = (inner for inner in node.body if isinstance(inner, ast.FunctionDef))
            yield from ((f"{node.name}.{method.name}", method) for method in methods)


def _short(path: str) -> str:
    here = Path.cwd()
    return str(Path(path).relative_to(here)) if Path(path).is_relative_to(here) else path
