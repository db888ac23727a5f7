"""Common parts of the examples: options such as `--seconds` and `--view`, and a check that the robot is upright."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import wbc
from wbc.app import MeshcatView
from wbc.sim import MujocoLoop, TrueFallDetector
from wbc.tasks import Program

BROWSER_TIME = 20.0
"""Longest time that a run with `--view` waits for a page to be opened, s."""


class Options(argparse.Namespace):
    """Options of an example."""

    seconds: float
    view: bool
    port: int | None

    @contextlib.contextmanager
    def watch(
        self,
        plant: wbc.Plant | MujocoLoop | wbc.RobotDescription,
        walking: wbc.WalkingControl | None = None,
        program: Program | None = None,
    ) -> Iterator[MeshcatView | NoView]:
        """Show the plant (walk, program), or the robot that `update` is given, live in the browser with `--view`."""
        if not self.view:
            yield NoView()
            return
        with MeshcatView(plant, walking, program=program, port=self.port, speed=1.0) as view:
            view.wait_for_page(BROWSER_TIME)
            yield view

    def hooks(self) -> list[MeshcatView]:
        """The same for walks that `walk` runs."""
        return [MeshcatView(port=self.port, speed=1.0, wait=BROWSER_TIME)] if self.view else []


class NoView:
    """Placeholder for a view without `--view`."""

    def update(self, *_: wbc.Robot) -> None:
        """Do nothing."""


def parse(
    doc: str | None,
    arguments: Sequence[str] | None,
    *,
    seconds: float | None = None,
    **options: float | str | Path | tuple[str, ...],
) -> Options:
    """Read the command line.

    Args:
        doc: Docstring of the example, shown by `--help`.
        arguments: Arguments of the example; those of the process when None.
        seconds: Default of the simulated time, s; None for a run that ends by itself.
        **options: Further options, each with its default, or with all of its values, the default first.
    """
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    if seconds is not None:
        parser.add_argument(
            "--seconds", type=float, default=seconds, help="simulated time (s), default %(default)s"
        )
    parser.add_argument("--view", action="store_true", help="watch it live in the browser")
    parser.add_argument(
        "--port", type=int, help="port of the live view, default the first free one from 7000"
    )
    for name, value in options.items():
        default, values = (value[0], value) if isinstance(value, tuple) else (value, None)
        kind = type(default) if isinstance(default, (int, float)) else str
        parser.add_argument(
            f"--{name}", type=kind, choices=values, default=default, help="default %(default)s"
        )
    return parser.parse_args(arguments, Options())


def upright(plant: wbc.Plant) -> bool:
    """Return true if the robot is on its feet."""
    return not TrueFallDetector(plant.robot).fallen(plant.truth().q)


def report(**facts: Any) -> dict[str, Any]:
    """Print a result on one line and return it."""
    print("  ".join(f"{name} {_text(value)}" for name, value in facts.items()))
    return facts


def _text(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
