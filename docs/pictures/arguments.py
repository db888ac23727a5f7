"""Command line of the programs of this folder; importing it also puts `tests/support` on the path of modules."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

IMAGES = Path(__file__).parents[1] / "images"
sys.path.append(str(Path(__file__).parents[2] / "tests" / "support"))


def target(about: str | None, usual: Path = IMAGES) -> Path:
    """Return the file or folder that the command line names; it takes nothing else.

    Args:
        about: Docstring of the program, for `--help`.
        usual: File or folder when the command line names none.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("target", nargs="?", type=Path, default=usual, help=f"written, in place of {usual}")
    return parser.parse_args().target
