"""Results that are kept as long as what they are about: many steps of a turn look at the same surface."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

Owner = TypeVar("Owner")
Others = ParamSpec("Others")
Result = TypeVar("Result")


def memoised(compute: Callable[Concatenate[Owner, Others], Result]) -> Callable[Concatenate[Owner, Others], Result]:
    """Make a pure function of a record remember what it returned for the same other arguments.

    Records are told apart by identity, for they don't change; nor may the results. They are forgotten with the first
    argument, which they must not refer to.
    """
    known: WeakKeyDictionary[Owner, dict[tuple[Any, ...], Result]] = WeakKeyDictionary()

    @wraps(compute)
    def remembered(owner: Owner, /, *others: Others.args, **named: Others.kwargs) -> Result:
        results, key = known.setdefault(owner, {}), (*others, *sorted(named.items()))
        if key not in results:
            results[key] = compute(owner, *others, **named)
        return results[key]

    return remembered
