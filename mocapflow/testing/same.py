"""Whether two results are the same, to the bit; and whether a function is pure."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np


def same(one: Any, other: Any) -> bool:
    """True where two results are equal to the bit: arrays, records, mappings and sequences of them."""
    if isinstance(one, np.ndarray):
        return (
            isinstance(other, np.ndarray)
            and one.dtype == other.dtype
            and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
        )
    if type(one) is not type(other):
        return False
    if dataclasses.is_dataclass(one):
        fields = [field.name for field in dataclasses.fields(one)]
        return all(same(getattr(one, name), getattr(other, name)) for name in fields)
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(same(value, other[key]) for key, value in one.items())
    if isinstance(one, Sequence) and not isinstance(one, str | bytes):
        return len(one) == len(other) and all(map(same, one, other))
    return same(np.array(one), np.array(other)) if isinstance(one, float) else bool(one == other)


def assert_pure(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a step twice; assert that both results are the same and no argument was changed. Return the result."""
    before = [copy.deepcopy(a) if _is_data(a) else None for a in arguments]
    first = function(*arguments)
    second = function(*arguments)
    assert same(first, second), "the same input gave two different results"
    for position, (old, argument) in enumerate(zip(before, arguments, strict=True)):
        assert old is None or same(old, argument), f"argument {position} was changed"
    return first


def _is_data(argument: Any) -> bool:
    return dataclasses.is_dataclass(argument) or isinstance(argument, np.ndarray)
