"""Loops by name: a loop is the `Simulation` in which a trial runs, MuJoCo's plant or one of somebody else.

    register_loop("dart", DartLoop)
    walk(robot="g1", mode="torque", loop="dart")
    walk(robot="g1", mode="torque", loop="other_engine.py:DartLoop")

A spec names its loop by text, so that it can be written down and run in another process. A name that is registered in a
program is known to the processes that this program starts; a file, or an entry point of the group "wbc.loops" in a
package, is known to all.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.registry import Registry
from wbc.robots import RobotDescription
from wbc.sim.plant.plant import Plant
from wbc.sim.simulation.machine import Machine
from wbc.sim.simulation.simulation import Simulation

PLANT = "plant"
"""Name of `wbc.Plant`, the loop of trials that name none."""

NEEDED = ("control_period", "timestep", "noise", "seed", "machine")
"""Options that every loop must take."""

MEMBERS = sorted(
    {"description", "robot", "diverged", *(name for name in vars(Simulation) if not name.startswith("_"))}
    - {"hold", "seed", "steps", "timestep"}
)
"""Members of a loop in which trials run: those of a `wbc.sim.Simulation`, but for some that no trial asks for."""

LoopFactory = Callable[..., Any]
"""Class or function that makes a loop of a `RobotDescription` and named options: those of `NEEDED`, and what else it
takes of foot, terrain, scene, eyes, physics, range_sensor and visuals."""


def _check_factory(factory: object) -> None:
    if not callable(factory):
        raise InputError(
            f"a loop is registered by the class or the function that makes it, got {shown(factory)}"
        )
    takes = _options(factory)
    missing = [] if takes is None else [name for name in NEEDED if name not in takes]
    if missing:
        raise InputError(
            f"what makes a loop must take the options {', '.join(NEEDED)} by name; "
            f"{getattr(factory, '__name__', shown(factory))} takes no {', '.join(missing)}"
        )


def _options(factory: Callable[..., Any]) -> frozenset[str] | None:
    """Return the names of the options that a factory takes; None if it takes any."""
    known = inspect.signature(factory).parameters.values()
    if any(each.kind is each.VAR_KEYWORD for each in known):
        # A derived class hands them on to its base.
        above = [base for base in getattr(factory, "__mro__", ())[1:] if base is not object]
        return _options(above[0]) if above else None
    return frozenset(each.name for each in known if each.kind is not each.POSITIONAL_ONLY)


LOOPS: Registry[LoopFactory] = Registry("loop", {PLANT: Plant}, group="wbc.loops", check=_check_factory)
"""Loops by name."""


@checked
def register_loop(name: str, factory: LoopFactory) -> None:
    """Register a loop under a name, for the field `loop` of walks, stands, push tables and studies.

    The factory makes a loop (see `Simulation`) from a description and the keyword arguments of `NEEDED`. Trials in
    this loop can use a further property, such as the terrain, only if the factory has a keyword argument for it.
    """
    LOOPS.add(name, factory)


@dataclass(frozen=True)
class LoopKind:
    """A loop by its name."""

    name: str  # as a spec keeps it: that of a file has the hash of its content behind it
    factory: LoopFactory
    takes: frozenset[str] | None  # names of its options; None for any

    def check(self, machine: Machine, wanted: Mapping[str, object]) -> None:
        """Refuse what a trial wants beyond a robot on its own soles on a floor, if the loop has no option for it."""
        for option, value in wanted.items():
            if self.takes is not None and option not in self.takes:
                raise InputError(
                    f"loop '{self.name}' has a robot on its own soles on a floor, and no option '{option}': it cannot "
                    f"have {shown(value)}; leave that out, or take loop '{PLANT}'"
                )
        if not (isinstance(self.factory, type) and issubclass(self.factory, Plant)):
            machine.check_loop(f"loop '{self.name}'")

    def make(self, description: RobotDescription, **options: Any) -> Any:
        """Return a new loop; options that it does not take are the usual ones and left out."""
        if self.takes is not None:
            options = {name: value for name, value in options.items() if name in self.takes}
        loop = self.factory(description, **options)
        if lacking := [name for name in MEMBERS if not hasattr(loop, name)]:
            raise InputError(
                f"loop '{self.name}' made {shown(loop)}, which lacks {', '.join(lacking)}: derive it from "
                "wbc.sim.EngineLoop, or give it the members of wbc.sim.Simulation"
            )
        return loop


@checked
def trial_loop(name: str) -> LoopKind:
    """Return a loop by its name.

    Args:
        name: A registered name, a name that an installed package offers, or a file and the name of a factory in it,
            such as "other_engine.py:DartLoop". "#" and the hash of the file may follow.

    Raises:
        InputError: The loop is unknown, or the file cannot be run, has changed since the spec was made, or does not
            have the name.
    """
    name, factory = LOOPS.find(name)
    return LoopKind(name, factory, _options(factory))
