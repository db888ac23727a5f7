"""Looking on while a robot walks: live views, logs, signals of one's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from wbc.core.signals import Command, Measurement
from wbc.sim.plant.plant import Plant
from wbc.walking.control import WalkingControl

if TYPE_CHECKING:
    from wbc.sim.walks.result import WalkResult
    from wbc.sim.walks.run import WalkTrial


@dataclass(frozen=True, slots=True)
class WalkTick:
    """One tick of a walk: what was measured, and what is commanded because of it.

    Attributes:
        plant: The plant in the state that was measured; it moves on after the hooks.
        walking: The controller, with reference and stabilizer output of this tick, or of the last one whose measurement
            was good.
        measurement: What the sensors said.
        command: What the drives will be told.
    """

    plant: Plant
    walking: WalkingControl
    measurement: Measurement
    command: Command


class WalkHook:
    """Looks on and changes nothing: a walk has the same result with any hooks. Override what is needed."""

    def start(self, trial: WalkTrial) -> None:
        """Called once, before the first tick."""

    def tick(self, tick: WalkTick) -> None:
        """Called in every tick, before the plant moves on."""

    def end(self, result: WalkResult) -> None:
        """Called once, after the last tick."""
