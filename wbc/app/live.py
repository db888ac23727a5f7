"""What every command that runs a robot offers: watching it live."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from wbc.sim.plant import Plant

BROWSER_TIME = 20.0
"""How long a run waits for somebody to open the page, s."""


@dataclass(frozen=True, kw_only=True)
class Live:
    """Whether a run is shown in a browser.

    Attributes:
        view: Show the run live in the browser, in real time.
        port: Port of the page; the first free one from 7000 on when not given.
    """

    view: bool = False
    port: int | None = None

    @contextmanager
    def show(self, plant: Plant) -> Iterator[Callable[[], None] | None]:
        """Give what is to be called after every tick; None if nobody watches.

        Args:
            plant: The plant that is shown.

        Raises:
            InputError: A port that is none.
            ViewError: The page cannot be served there.
        """
        if not self.view:
            yield None
            return
        from wbc.app.view import MeshcatView  # noqa: PLC0415 - most runs are not watched

        with MeshcatView(plant, port=self.port, speed=1.0) as view:
            print(f"open it now: the run begins with it, or in {BROWSER_TIME:.0f} s", file=sys.stderr)
            view.wait(BROWSER_TIME)
            yield view.update


LiveOptions = Annotated[Live, Parameter(name="*")]
"""A command that can be watched takes it as `live`."""
