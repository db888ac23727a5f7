"""The `wbc` command, and its parts for programs: logs, replays, figures and the live view.

A new command is a module in `commands`; a new name for programs is a line in `__init__.pyi`, loaded when it is used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
