"""What holds for the settings of every component and file."""

from typing import Any, Literal

import pytest
from pydantic import PositiveInt, ValidationError

from mocapflow.settings import PositiveOrInf, Settings


class Some(Settings):
    count: PositiveInt = 1
    length_m: float | None = 1.0
    each: tuple[float, ...] = ()
    version: Literal[1] = 1
    drawn: bool = False
    either: bool | int = 0
    any_: Any = None
    reach_px: PositiveOrInf = 1.0


@pytest.mark.parametrize(
    "wrong", [{"count": True}, {"length_m": False}, {"each": [1.0, True]}, {"each": True}, {"version": True}], ids=str
)
def test_a_truth_value_is_no_number(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="input should be a number, not true or false"):
        Some(**wrong)


@pytest.mark.parametrize("number", [float("inf"), float("-inf"), float("nan"), "1e400", ".nan"], ids=str)
@pytest.mark.parametrize("name", ["length_m", "each"])
def test_a_number_is_finite(name: str, number: Any) -> None:
    with pytest.raises(ValidationError):
        Some(**{name: (number,) if name == "each" else number})


def test_what_is_right_is_taken() -> None:
    some = Some(drawn=True, either=True, any_=True, length_m="1e-3", each=[1, 2.5], count=2)  # type: ignore[arg-type]
    assert (some.drawn, some.either, some.any_) == (True, True, True)
    assert (some.length_m, some.each, some.count) == (0.001, (1.0, 2.5), 2)


def test_a_default_has_to_be_right_too() -> None:
    class Wrong(Settings):
        count: PositiveInt = 0

    with pytest.raises(ValidationError, match="count"):
        Wrong()


def test_infinity_is_taken_where_it_has_a_meaning() -> None:
    assert Some(reach_px=float("inf")).reach_px == float("inf")
    for wrong in (float("nan"), -float("inf"), True):
        with pytest.raises(ValidationError):
            Some(reach_px=wrong)
