"""Frozen dataclasses whose array fields declare axes, unit and kind once.

The declaration drives the check on construction and the dimension names in the store.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple, TypeVar, dataclass_transform

import numpy as np
import numpy.typing as npt

from mocapflow.errors import ShapeError
from mocapflow.series import Series

F64 = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I16 = npt.NDArray[np.int16]
I8 = npt.NDArray[np.int8]
U8 = npt.NDArray[np.uint8]
Bool = npt.NDArray[np.bool_]

DTYPES = {"F64": "f8", "Wide": "f8", "F32": "f4", "I32": "i4", "I16": "i2", "I8": "i1", "U8": "u1", "Bool": "?"}

Class = TypeVar("Class", bound=type)
Record = TypeVar("Record")
Watch = Callable[[int, int], None]  # told how many frames are done, of how many


def silent(*_: Any) -> None:
    """Tell nobody."""


class Axes(NamedTuple):
    """What an array field promises: named or fixed axes, unit and dtype; a wide one may be a series."""

    axes: tuple[str | int, ...]
    unit: str
    dtype: np.dtype[Any]
    optional: bool
    wide: bool


def array(*axes: str | int, unit: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare an array field: axes are names (equal names, equal lengths) or fixed lengths."""
    return dataclasses.field(default=default, metadata={"axes": axes, "unit": unit})


def arrays(*axes: str, unit: str) -> Any:
    """Declare a field of several arrays of their own lengths: for the store, which names axes and unit of each."""
    return dataclasses.field(metadata={"each": (axes, unit)})


@cache
def array_fields(record_class: type) -> dict[str, Axes]:
    """Return the declaration of each array field of a record class."""
    fields = dataclasses.fields(record_class)
    return {field.name: _axes(field) for field in fields if "axes" in field.metadata}


def _axes(field: dataclasses.Field[Any]) -> Axes:
    if not isinstance(field.type, str):
        raise ShapeError(f"{field.name}: begin the module of a record with `from __future__ import annotations`")
    name, _, rest = str(field.type).partition(" | ")
    if name not in DTYPES:
        raise ShapeError(f"{field.name}: the type of an array is one of {', '.join(DTYPES)}, not {name}")
    return Axes(field.metadata["axes"], field.metadata["unit"], np.dtype(DTYPES[name]), rest == "None", name == "Wide")


def check_arrays(record: Any) -> None:
    """Check every array field of a record against its declaration and make it read-only in place.

    Raises:
        ShapeError: an array's dtype, number of axes or a length contradicts the declaration.
    """
    lengths: dict[str, int] = {}
    values = vars(record)
    for name, (axes, _, dtype, optional, wide) in array_fields(type(record)).items():  # type: ignore[arg-type]  # classes are hashable
        value = values[name]
        if value is None and optional:
            continue
        if not isinstance(value, (np.ndarray, Series) if wide else np.ndarray):
            raise ShapeError(f"{type(record).__name__}.{name} is {type(value).__name__}, not a numpy array")
        if value.dtype is not dtype and value.dtype != dtype:  # the common dtypes are one object each
            raise ShapeError(f"{type(record).__name__}.{name} has dtype {value.dtype}; expected {dtype}")
        if not _fits(value.shape, axes, lengths):
            _complain(f"{type(record).__name__}.{name}", value.shape, axes, lengths)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)


def _fits(shape: tuple[int, ...], axes: tuple[str | int, ...], lengths: dict[str, int]) -> bool:
    """True where a shape agrees with the declaration and the lengths so far, which it adds to."""
    if len(shape) != len(axes):
        return False
    for have, axis in zip(shape, axes):  # noqa: B905  # of one length, and looked at hundreds of times a frame
        if have != axis and (isinstance(axis, int) or have != lengths.setdefault(axis, have)):
            return False
    return True


def _complain(where: str, shape: tuple[int, ...], axes: tuple[str | int, ...], lengths: dict[str, int]) -> None:
    wanted = ", ".join(f"{axis}={lengths[axis]}" if axis in lengths else str(axis) for axis in axes)
    raise ShapeError(f"{where} has shape {shape}; expected ({wanted})")


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(array, arrays, dataclasses.field))
def record(cls: Class) -> Class:
    """Make a frozen, keyword-only dataclass that checks its arrays when built."""
    own_check: Callable[[Any], None] | None = cls.__dict__.get("__post_init__")

    def check(self: Any) -> None:
        check_arrays(self)
        if own_check is not None:
            own_check(self)

    cls.__post_init__ = check  # type: ignore[attr-defined]
    return dataclasses.dataclass(frozen=True, kw_only=True, eq=False)(cls)  # type: ignore[return-value]


def picked_rows(rows: Record, which: I32 | Bool) -> Record:
    """Return some rows of a record whose arrays have an entry for each row."""
    return _each(rows, lambda name: getattr(rows, name)[which])


def joined_rows(parts: Sequence[Record]) -> Record:
    """Return the rows of several such records as one."""
    return _each(parts[0], lambda name: np.concatenate([getattr(part, name) for part in parts]))


def out_of_range(index: npt.NDArray[np.signedinteger[Any]], count: int, least: int = 0) -> int | None:
    """Return an index that is not in least ... count - 1, None where all are."""
    low, high = int(index.min(initial=least)), int(index.max(initial=-1))
    return low if low < least else high if high >= count else None


def _each(rows: Record, make: Callable[[str], npt.NDArray[Any]]) -> Record:
    changed: dict[str, Any] = {name: make(name) for name in array_fields(type(rows))}  # type: ignore[arg-type]
    return dataclasses.replace(rows, **changed)  # type: ignore[type-var]  # records are dataclasses
