"""Application: the `wbc` command, and logs, replays, figures and live views for programs.

A new command goes into a module in `commands`. A new name for programs needs a line in `__init__.pyi`; it is imported
at its first use.
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
