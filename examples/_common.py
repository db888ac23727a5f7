"""What the examples share: the options `--seconds` and `--view`, and whether the robot is still on its feet."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import wbc
from wbc.app.view import MeshcatView
from wbc.sim.falls import FallDetector

BROWSER_TIME = 20.0
"""How long a run with `--view` waits for somebody to open the page, s."""


class Options(argparse.Namespace):
    """Options of an example."""

    seconds: float
    view: bool
    port: int | None

    @contextlib.contextmanager
    def watch(self, plant: wbc.Plant) -> Iterator[MeshcatView | NoView]:
        """Show the plant in the browser, in real time, if `--view` was given."""
        if not self.view:
            yield NoView()
            return
        with MeshcatView(plant, port=self.port, speed=1.0) as view:
            print(f"open it now: the run begins with it, or in {BROWSER_TIME:.0f} s", file=sys.stderr)
            view.wait(BROWSER_TIME)
            yield view


class NoView:
    """Stands in for a view that nobody asked for."""

    def update(self) -> None:
        """Do nothing."""


def parse(
    doc: str | None,
    arguments: Sequence[str] | None,
    *,
    seconds: float,
    **options: str | Path | tuple[str, ...],
) -> Options:
    """Read the command line.

    Args:
        doc: Docstring of the example, shown by `--help`.
        arguments: What follows the name of the example; that of the process when None.
        seconds: Default of the simulated time, s.
        **options: Further options, each with its default, or with all of its values, the default first.
    """
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=seconds, help="simulated time, default %(default)s")
    parser.add_argument("--view", action="store_true", help="watch it live in the browser")
    parser.add_argument(
        "--port", type=int, help="port of the live view, default the first free one from 7000"
    )
    for name, value in options.items():
        default, values = (value[0], value) if isinstance(value, tuple) else (value, None)
        parser.add_argument(f"--{name}", choices=values, default=default, help="default %(default)s")
    return parser.parse_args(arguments, Options())


def upright(plant: wbc.Plant) -> bool:
    """Tell whether the robot is on its feet."""
    return not FallDetector(plant.robot).fallen(plant.truth().q)


def report(**facts: Any) -> dict[str, Any]:
    """Print a result on one line and return it."""
    print("  ".join(f"{name} {_text(value)}" for name, value in facts.items()))
    return facts


def _text(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
