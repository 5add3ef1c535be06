"""What holds for every component."""

from __future__ import annotations

import json

import pytest
from pydantic import ValidationError

from mocapflow.data import Turn
from mocapflow.settings import Component

TURN = Turn(index=0)  # the first of a frame


class Conformance:
    """What holds for every component; a subclass has it under the name of its role."""

    role: str

    @property
    def component(self) -> Component:
        """The component under test."""
        component: Component = getattr(self, self.role)
        return component

    def test_it_plays_its_role(self) -> None:
        """It has the name of its role, a name and a description."""
        assert self.component.role == self.role
        assert self.component.name
        assert type(self.component).__doc__, "say in a docstring what it does"

    def test_settings_survive_a_round_trip(self) -> None:
        """Built again from its settings it has the same settings."""
        cls = type(self.component)
        again = cls(**{name: getattr(self.component, name) for name in cls.model_fields})
        assert again.model_dump(serialize_as_any=True) == self.component.model_dump(serialize_as_any=True)

    def test_settings_give_a_stable_text(self) -> None:
        """Its settings as JSON are always the same: they are part of the cache key."""
        cls = type(self.component)
        again = cls(**{name: getattr(self.component, name) for name in reversed(cls.model_fields)})
        text = self.component.model_dump_json(serialize_as_any=True)
        assert again.model_dump_json(serialize_as_any=True) == text
        assert isinstance(json.loads(text), dict)

    def test_settings_are_frozen(self) -> None:
        """No setting can be changed, none added."""
        for name in type(self.component).model_fields:
            with pytest.raises(ValidationError, match="frozen"):
                setattr(self.component, name, getattr(self.component, name))
        with pytest.raises(ValidationError, match="no_such_setting"):
            type(self.component)(**{**dict(self.component), "no_such_setting": 1})
