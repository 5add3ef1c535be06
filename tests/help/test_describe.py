"""Settings as people read them: nested ones, units, defaults, and the comments that say what they mean."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, Field

from mocapflow.components import Predictor, Prior
from mocapflow.help.describe import Setting, settings


class Rest(BaseModel):
    angle_deg: float = 0.1  # largest change


class Guess(Predictor):
    name: ClassVar[str] = "guess"
    kept: float = 0.5

    def predict(self, frame, past, scene):
        kept: float = 1.0  # what a method says is no setting
        return kept


class Wall(Prior):
    name: ClassVar[str] = "wall"
    rest: Rest = Rest()
    softer: Rest | None = None  # a second one
    limits_m: tuple[Annotated[float, Field(gt=0)], ...]  # required
    side: Literal["left", "right"] = "left"
    file: Path = Path("/somewhere/poses.npz")
    guess: Predictor = Guess(kept=0.25)
    told: Annotated[int, Field(description="in the field itself")] = 3
    several: tuple[int, ...] = (  # over lines
        1,
        2,
    )  # fmt: skip
    lasting: dict[str, int] = {
        "a": 1,
    }  # behind the last line

    def residual(self, pose, past, scene):
        raise NotImplementedError


def test_settings_are_told_with_type_default_unit_and_meaning():
    assert list(settings(Wall)) == [
        Setting("weight", "float (≥ 0)", "1.0", "", "factor on its energy"),
        Setting("rest.angle_deg", "float", "0.1", "°", "largest change"),
        Setting("softer", "Rest | null", "null", "", "a second one"),
        Setting("softer.angle_deg", "float", "0.1", "°", "largest change"),
        Setting("limits_m", "tuple of float (> 0)", "", "m", "required"),
        Setting("side", "'left' | 'right'", "'left'", "", ""),
        Setting("file", "Path", "poses.npz", "", ""),
        Setting("guess", "predictor", "{use: guess, kept: 0.25}", "", ""),
        Setting("told", "int", "3", "", "in the field itself"),
        Setting("several", "tuple of int", "(1, 2)", "", "over lines"),
        Setting("lasting", "dict of str to int", "{'a': 1}", "", "behind the last line"),
    ]
    assert [one.meaning for one in settings(Guess)] == [""]
