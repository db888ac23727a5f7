"""Application: the `wbc` command, and logs, replays, figures and live views for programs.

A new command goes into a module in `commands`. A new name for programs needs a line in `__init__.pyi`; it is imported
at its first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
