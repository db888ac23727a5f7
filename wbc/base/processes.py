"""Child processes of this program, which run Python."""

from __future__ import annotations

import json
import os
import sys

PROGRAM = (
    "import json, sys; from importlib import import_module; "
    "sys.path[:] = json.loads(sys.argv.pop(1)); import_module(sys.argv.pop(1)).main()"
)
"""Program of a child: it takes over the places that its parent imports from, and calls the `main` of a module."""


def child_command(module: str, *words: str) -> list[str]:
    """Return the command of a child process that calls `main()` of a module, with words in its `sys.argv[1:]`.

    The child imports modules from where this process imports them, and from nowhere else. By itself `python -m` and
    `python -c` look into the current folder first, where a file named like a library would be run.
    """
    places = json.dumps([os.path.abspath(place) for place in sys.path if isinstance(place, str)])
    return [sys.executable, "-P", "-c", PROGRAM, places, module, *words]
