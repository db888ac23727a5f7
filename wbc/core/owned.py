"""Base of what a solver has: tasks, contacts and limits."""

from __future__ import annotations

import weakref
from typing import Any, ClassVar

from wbc.base.errors import InputError, shown


class Owned:
    """Base of tasks, contacts and limits: a name, and the solver that has them."""

    __slots__ = ("_name", "_owner")

    _kind: ClassVar[str]
    _name: str
    _owner: weakref.ref[Any] | None

    @property
    def owner(self) -> Any:
        """Controller or solver of inverse kinematics; None while none has it."""
        return None if self._owner is None else self._owner()

    @property
    def name(self) -> str:
        """Name in status tables and solutions, unique within a controller, in which it is fixed."""
        return self._name

    @name.setter
    def name(self, value: str) -> None:
        if not isinstance(value, str) or not value.strip():
            raise InputError(f"the name of a {self._kind} must be text that is not empty, got {shown(value)}")
        if self.owner is not None and value != self._name:
            raise InputError(
                f"{self._kind} '{self._name}' is in a controller, where its name is fixed: remove it, assign the name, "
                "and add it again"
            )
        self._name = value
