"""Checks of what any component returns: its kind, its shape, its numbers."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from mocapflow.errors import PluginError
from mocapflow.records import F32, F64
from mocapflow.settings import Component

Output = TypeVar("Output")
UNIT = 1e-3  # by how much the length of a unit vector, or its square, may fail to be one


class InvalidOutput(PluginError):
    """A component returned what its role can't."""

    def __init__(self, component: Component, message: str) -> None:
        self.component, self.what = component, message
        super().__init__(f"{component.role} '{component.name}' returned {message}")

    def __reduce__(self) -> tuple[type[InvalidOutput], tuple[Component, str]]:
        """Pickle by the arguments: those of exceptions are their text."""
        return type(self), (self.component, self.what)


def of_kind(component: Component, value: Any, kind: type[Output]) -> Output:
    """Return what a component has returned.

    Raises:
        InvalidOutput: it is something else than its role returns.
    """
    if not isinstance(value, kind):
        raise InvalidOutput(component, f"{type(value).__name__}, not {getattr(kind, '__name__', kind)}")
    return value


def array_of(component: Component, values: F64, shape: tuple[int, ...], what: str) -> F64:
    """Return an array that a component has returned.

    Raises:
        InvalidOutput: it has another shape or type, or is not finite.
    """
    if values.dtype != np.float64:
        raise InvalidOutput(component, f"{what} of {values.dtype}, not float64")
    if values.shape != shape:
        raise InvalidOutput(component, f"{what} of shape {values.shape}, not {shape}")
    if not finite(values):
        raise InvalidOutput(component, f"{what} that {'are' if what.endswith('s') else 'is'} not finite")
    return values


def finite(values: F64 | F32) -> bool:
    """Return whether all values are finite."""
    return bool(np.isfinite(values).all())
