"""The `wbc` command, and its parts for programs: logs, replays, figures and the live view.

A new command is a module in `commands`; a new name for programs is a line in `__init__.pyi`, loaded when it is used.
"""

import lazy_loader

from wbc.base.errors import missing_from

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """Load a public name; another one is an error that names what is meant."""
    try:
        return _load(name)
    except AttributeError:
        if name in __all__:
            raise
        missing_from(__name__)(name)
