"""Objects whose public attributes are fixed once they are made: a misspelt one is an error, not a new attribute."""

from __future__ import annotations

import inspect
from abc import ABCMeta
from typing import Any, cast

from wbc.core.errors import unknown_name


class _Fixing(ABCMeta):
    """Fixes the attributes of an object when its constructor, that of the last subclass, has returned."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        made = super().__call__(*args, **kwargs)
        made.fix_attributes()
        return made

    @property
    def __signature__(cls) -> inspect.Signature:
        """Signature of the constructor, which `__call__` would hide."""
        signature = inspect.signature(cast(Any, cls).__init__)
        return signature.replace(parameters=[*signature.parameters.values()][1:])


_set = object.__setattr__


class FixedAttributes(metaclass=_Fixing):
    """Base of objects that take no public attribute which they did not have after construction.

    Names that begin with an underscore stay free.
    """

    _names: frozenset[str] = frozenset()
    _fixed = False

    def fix_attributes(self) -> None:
        """Take no other public attributes than the present ones from now on."""
        self.__dict__["_names"] = frozenset(self.__dict__).union(dir(type(self)))
        self.__dict__["_fixed"] = True

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self._names or not self._fixed or name[0] == "_":
            _set(self, name, value)
            return
        kind = type(self)
        unknown_name(
            f"attribute of {kind.__name__}",
            name,
            {each for each in self._names if each[0] != "_" and not callable(getattr(kind, each, None))},
        )
