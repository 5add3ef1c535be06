"""Records in zarr groups: arrays with dimension names and units, everything else as attributes.

What goes in comes back: fields are arrays, records, tuples and mappings of these; or text, numbers, paths, tuples and
mappings of those. Two exceptions: lists come back as tuples, and text as paths where the field's type names Path.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mocapflow.errors import ShapeError, StoreError
from mocapflow.records import F64, array_fields
from mocapflow.results import notes_of
from mocapflow.series import BLOCK, Numbers, Series, blocks
from mocapflow.storage.rows import Corrupted

if TYPE_CHECKING:
    import zarr

PLAIN = "plain"  # attribute with the fields that are no arrays


def save_record(group: zarr.Group, value: Any) -> None:
    """Write a record into an empty group.

    Raises:
        ShapeError: a field holds what can't be kept, or numbers or text beside arrays or records.
    """
    cls: type = type(value)
    declared = array_fields(cls)
    plain: dict[str, Any] = {}
    for field in fields(value):
        inner = getattr(value, field.name)
        if isinstance(inner, np.ndarray | Series) and field.name in declared:
            axes, unit, *_ = declared[field.name]
            save_array(group, field.name, inner, axis_names(field.name, axes, len(inner.shape)), unit)
        elif _is_nested(inner):
            _save_nested(group.create_group(field.name), inner, *field.metadata.get("each", ((), "")))
        else:
            plain[field.name] = _plain(inner, f"{cls.__name__}.{field.name}")
    group.update_attributes({"record": f"{cls.__module__}:{cls.__qualname__}", PLAIN: plain})


def load_record(group: zarr.Group, rows: int | None = None) -> Any:
    """Return the record in a group; `rows` shortens every array with an axis T, and leaves the notes on its frames.

    Raises:
        Corrupted: it can't be read back.
    """
    try:
        cls = _record_class(str(group.attrs["record"]))
        values = dict(_field_values(group, cls, rows))
        if rows is not None and "notes" in values:
            values["notes"] = notes_of(values["frame"], values["notes"])
        return cls(**values)
    except StoreError:
        raise
    except Exception as error:  # zarr, json, zstd and the record's own check each raise their own kind
        raise Corrupted(f"{group.path or group.store} can't be read back: {type(error).__name__}: {error}") from error


def _field_values(group: zarr.Group, cls: type, rows: int | None) -> Iterator[tuple[str, Any]]:
    """Yield name and value of the fields that a group has: of others the default holds, or they are missed."""
    attributes: Any = group.attrs.asdict()
    plain = dict(attributes[PLAIN])
    for field in fields(cls):
        if field.name in plain:
            yield field.name, _untyped(plain[field.name], str(field.type))
        elif field.name in group and (declared := array_fields(cls).get(field.name)):
            read = _series if declared.wide else _array
            yield field.name, read(group, field.name, rows if declared.axes[:1] == ("T",) else None)
        elif field.name in group:
            yield field.name, _load_nested(group[field.name])


def save_array(group: zarr.Group, name: str, values: Any, axes: list[str], unit: str) -> None:
    """Write one array, a block at a time; long first axes are cut into chunks."""
    from zarr.codecs import ZstdCodec

    chunks = tuple(max(1, min(BLOCK, n) if axes[:1] == ["T"] and not i else n) for i, n in enumerate(values.shape))
    made = group.create_array(
        name, shape=values.shape, chunks=chunks, dtype=values.dtype, dimension_names=axes,
        compressors=[ZstdCodec(level=1, checksum=True)], attributes={"unit": unit} if unit else {},
        config={"write_empty_chunks": True},  # so that a missing chunk is damage, not zeros
    )  # fmt: skip
    if isinstance(values, Series):
        for part in blocks(len(values)):
            made[part] = values[part]
    elif values.size:
        made[...] = values


def axis_names(field: str, axes: tuple[str | int, ...], ndim: int) -> list[str]:
    """Return dimension names: the declared ones, once each (xarray forbids doubles), made up where there are none."""
    names: list[str] = []
    for index in range(ndim):
        declared = axes[index] if index < len(axes) else index
        name = declared if isinstance(declared, str) else f"{field}_{index}"
        names.append(f"{name}_{index}" if name in names else name)
    return names


def _is_nested(value: Any) -> bool:
    if isinstance(value, Mapping):
        return any(_is_nested(v) or isinstance(v, np.ndarray) for v in value.values())
    if isinstance(value, tuple | list):
        return any(_is_nested(v) or isinstance(v, np.ndarray) for v in value)
    return is_dataclass(value)


def _save_nested(group: zarr.Group, value: Any, axes: tuple[str, ...], unit: str) -> None:
    if is_dataclass(value):
        save_record(group, value)
        return
    items = value.items() if isinstance(value, Mapping) else ((str(i), v) for i, v in enumerate(value))
    order = []
    for name, inner in items:
        _check_key(name, group)
        order.append(name)
        if isinstance(inner, np.ndarray):  # its axes are its own: equal names would have to have equal lengths
            save_array(group.create_group(name), "values", inner, axis_names("axis", axes, inner.ndim), unit)
        elif is_dataclass(inner) or isinstance(inner, Mapping | tuple | list):
            _save_nested(group.create_group(name), inner, axes, unit)
        elif inner is not None:
            what = f"{group.path}: {name!r} is {type(inner).__name__}, beside arrays or records"
            raise ShapeError(what, hint="give it a field of its own")
    group.update_attributes({"kind": "mapping" if isinstance(value, Mapping) else "tuple", "order": order})


def _check_key(name: Any, group: zarr.Group) -> None:
    """Raise if a group can't be called like a key of a mapping, or one is already."""
    if not isinstance(name, str) or {"", ".", ".."} & set(name.split("/")) or name in group:
        what = f"{group.path}: nothing can be kept under the key {name!r}"
        raise ShapeError(what, hint="keys are text that can name a folder, no two the same one")


def _load_nested(group: Any) -> Any:
    if "record" in group.attrs:
        return load_record(group)
    values = {name: _load_item(group, name) for name in group.attrs["order"]}
    return values if group.attrs["kind"] == "mapping" else tuple(values.values())


def _load_item(group: Any, name: str) -> Any:
    if name not in group:
        return None
    inner = group[name]
    return _load_nested(inner) if {"record", "order"} & set(inner.attrs) else _array(inner, "values", None)


def _array(group: Any, name: str, rows: int | None) -> Any:
    _check_rows(group[name], rows)
    values = np.asarray(group[name][:rows] if rows is not None else group[name][...])
    _check_chunks(group[name], range(values.shape[0] if values.ndim else 0))
    return values


def _check_rows(array: Any, wanted: int | None) -> None:
    """Raise if an array has fewer rows than its group says that there are."""
    if wanted is not None and array.shape[0] < wanted:
        raise Corrupted(f"{array.path} has {array.shape[0]} rows of {wanted}")


def _check_chunks(array: Any, rows: range) -> None:
    """Raise if a chunk of these rows is not there, or was removed while they were read: it would read as zeros."""
    if not array.size or not array.ndim:
        return
    folder, inner = Path(array.store_path.store.root) / array.path, (0,) * (array.ndim - 1)
    for number in range(rows.start // array.chunks[0], -(-rows.stop // array.chunks[0])):
        if not (folder / array.metadata.encode_chunk_key((number, *inner))).exists():
            raise FileNotFoundError(f"chunk {number} of {array.path} is missing")


def _series(group: Any, name: str, rows: int | None) -> Series:
    """Return an array whose rows stay in the store until they are asked for; all of them are looked at once."""
    kept = group[name]
    _check_rows(kept, rows)
    wanted = range(kept.shape[0])[:rows]

    def block(number: int) -> F64:
        here = slice(number * BLOCK, (number + 1) * BLOCK)
        try:
            values = np.asarray(kept[here])
            _check_chunks(kept, wanted[here])
            return values
        except Exception as error:  # as in `load_record`
            raise Corrupted(f"{name} of {group.path or group.store} can't be read back: {error}") from error

    latest = lru_cache(maxsize=1)(block)

    def read(numbers: Numbers) -> F64:
        values = np.empty((len(numbers), *kept.shape[1:]))
        for number in np.unique(numbers // BLOCK):
            here = numbers // BLOCK == number
            values[here] = latest(int(number))[numbers[here] % BLOCK]
        return values

    series = Series((len(wanted), *kept.shape[1:]), read)
    for part in blocks(len(series)):
        block(part.start // BLOCK)  # damaged rows are found now, and made anew
    return series


def _record_class(name: str) -> type:
    module, _, qualified = name.partition(":")
    cls = getattr(importlib.import_module(module), qualified)
    if not is_dataclass(cls):
        raise Corrupted(f"{name} is no record")
    return cls  # type: ignore[return-value]


def _plain(value: Any, where: str) -> Any:
    """Return a value as json has it."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, tuple | list):
        return [_plain(inner, where) for inner in value]
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {key: _plain(inner, where) for key, inner in value.items()}
    hint = (
        "what can: arrays declared with `array(...)`, records, text, Python's numbers, paths; "
        "tuples of these, mappings of them whose keys are text"
    )
    raise ShapeError(f"{where} holds {type(value).__name__}, which can't be kept", hint=hint)


def _untyped(value: Any, declared: str) -> Any:
    """Return a value as it was before json: tuples for lists, paths for strings."""
    if isinstance(value, list):
        return tuple(_untyped(inner, declared) for inner in value)
    if isinstance(value, dict):
        return {key: _untyped(inner, declared) for key, inner in value.items()}
    return Path(value) if "Path" in declared and isinstance(value, str) else value
