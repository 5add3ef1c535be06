"""What the doctor says."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Literal, TypeVar

from mocapflow.errors import MocapflowError
from mocapflow.records import record

Result = TypeVar("Result")


@record
class Finding:
    """One thing a user should know of a recording, and what to do about it."""

    severity: Literal["error", "warning", "note"]
    message: str
    hint: str = ""
    where: str = ""


def error(message: str, hint: str = "", where: object = "") -> Finding:
    """Return a finding that keeps a run from starting."""
    return Finding(severity="error", message=message, hint=hint, where=str(where))


def warning(message: str, hint: str = "", where: object = "") -> Finding:
    """Return a finding that makes results worse or surprising."""
    return Finding(severity="warning", message=message, hint=hint, where=str(where))


def note(message: str, hint: str = "", where: object = "") -> Finding:
    """Return a finding that is good to know."""
    return Finding(severity="note", message=message, hint=hint, where=str(where))


def has_errors(findings: Iterable[Finding]) -> bool:
    """True where a run can't start."""
    return any(finding.severity == "error" for finding in findings)


def attempt(action: Callable[[], Result], findings: list[Finding]) -> Result | None:
    """Return what an action returns; where it raises, add that to the findings and return None."""
    try:
        return action()
    except MocapflowError as problem:
        findings.append(error(problem.message, problem.hint, problem.where))
        return None
