"""What the page of the live view can change in a run.

Pause and speed change when things happen on the clock, never what happens. The others change the run; each is written
down with its time, and results say that there were any.

    push        a push on the torso, from the robot's front, back or sides
    stop        the walk comes to a stand safely, with the step that it takes
    gains       of the stabilizer, from the next tick on
    stiffness   of variable soles: each foot gets it in its next swing, as if a policy had decided so, or as much of it
                as its actuator is sure to set before the landing

Not offered: footsteps, velocity, gait, terrain and seed are checked before a walk starts and belong to another run. The
stiffness of a passive sole is what it is made of, so it is fixed. There is no way back in time; record the run and
replay it with `wbc view`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wbc.core.errors import InputError, WbcError, choose, finite_scalar
from wbc.feet import VariableStiffnessFoot

if TYPE_CHECKING:
    from wbc.sim import Plant
    from wbc.walking.control import WalkingControl

GAINS = {
    "dcm_p": "1/s",
    "dcm_i": "1/s",
    "dcm_d": "",
    "cop_admittance": "rad/(Nm·s)",
    "force_difference": "m/(N·s)",
    "com_admittance": "1/s",
}
"""Gains of the stabilizer that the page offers, with their units; forward and sideways get the same."""

DIRECTIONS = {"forward": 0.0, "left": 0.5 * math.pi, "back": math.pi, "right": -0.5 * math.pi}
"""Where a push goes, seen from the robot, rad to the left of forward."""

IMPULSE, LARGEST_IMPULSE = 0.1, 2.0
"""Of a push, per mass, Ns/kg: what the page begins with (a walk recovers from it), and the largest one."""

PUSH_DURATION = 0.1
"""s; as in `wbc push`."""


class LiveControls:
    """Does what the page asks for.

    Attributes:
        interventions: What was done, each with its simulated time (s): empty as long as nobody has changed the run.
        message: What became of the last wish, for the page.
    """

    def __init__(self, plant: Plant | None, walking: WalkingControl | None) -> None:
        """Find out what can be changed.

        Args:
            plant: The plant; None offers nothing.
            walking: The controller, if it is a walk.
        """
        self._plant, self._walking = plant, walking
        self.interventions: list[dict[str, Any]] = []
        self.message = ""
        self._orders: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {}
        if plant is not None:
            self._orders["push"] = self._push
            if walking is not None:
                self._orders |= {"stop": self._stop, "gain": self._set_gain}
                if isinstance(plant.foot, VariableStiffnessFoot):
                    self._orders["stiffness"] = self._set_stiffness

    def offer(self) -> dict[str, Any]:
        """What there is to change, and how it is now, for the page."""
        offer: dict[str, Any] = {}
        if "push" in self._orders:
            offer["push"] = {"impulse": IMPULSE, "largest": LARGEST_IMPULSE, "directions": list(DIRECTIONS)}
        if "stop" in self._orders:
            offer["stop"] = True
        if "gain" in self._orders:
            assert self._walking is not None
            gains = self._walking.stabilizer.gains
            offer["gains"] = [
                {"name": name, "unit": unit, "value": _first(getattr(gains, name))}
                for name, unit in GAINS.items()
            ]
        if "stiffness" in self._orders:
            assert self._plant is not None and isinstance(self._plant.foot, VariableStiffnessFoot)
            actuator = self._plant.foot.actuator
            value = float(self._plant.foot.stiffness)
            offer["stiffness"] = {"low": actuator.low, "high": actuator.high, "value": value}
        return offer

    def obey(self, order: Any) -> None:
        """Do what is asked for; what cannot be done is refused in `message`.

        Args:
            order: What a page has sent: {"do": name, …}.
        """
        try:
            if not isinstance(order, dict) or not isinstance(order.get("do"), str):
                raise InputError("a wish must say what to do")
            done = self._orders[choose("wish", order["do"], tuple(self._orders))](order)
        except (WbcError, OverflowError) as error:
            self.message = f"refused: {error}"
            return
        assert self._plant is not None
        entry = {"time": self._plant.time, "what": order["do"], **done}
        self.interventions.append(entry)
        self.message = intervention_text(entry)

    def _push(self, order: dict[str, Any]) -> dict[str, Any]:
        assert self._plant is not None
        side = choose("direction of a push", str(order.get("direction")), tuple(DIRECTIONS))
        impulse = _number("impulse of a push (Ns/kg)", order.get("impulse"), high=LARGEST_IMPULSE)
        w, x, y, z = self._plant.data.qpos[3:7].tolist()
        heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) + DIRECTIONS[side]
        force = impulse * self._plant.robot.mass / PUSH_DURATION
        along = [force * math.cos(heading), force * math.sin(heading), 0.0]
        self._plant.push("torso", along, PUSH_DURATION)
        return {"direction": side, "impulse": impulse}

    def _stop(self, order: dict[str, Any]) -> dict[str, Any]:
        del order
        assert self._walking is not None
        self._walking.stop()
        return {}

    def _set_gain(self, order: dict[str, Any]) -> dict[str, Any]:
        assert self._walking is not None
        name = choose("gain", str(order.get("name")), tuple(GAINS))
        value = _number(f"gain '{name}'", order.get("value"))
        stabilizer = self._walking.stabilizer
        stabilizer.gains = replace(stabilizer.gains, **{name: value})
        return {"name": name, "value": _first(getattr(stabilizer.gains, name))}

    def _set_stiffness(self, order: dict[str, Any]) -> dict[str, Any]:
        from wbc.tasks.scheduling.policies import FixedPolicy  # noqa: PLC0415
        from wbc.tasks.scheduling.stiffness import StiffnessScheduler  # noqa: PLC0415 - most runs need none

        assert self._walking is not None and self._plant is not None
        foot = self._plant.foot
        assert isinstance(foot, VariableStiffnessFoot)
        value = foot.actuator.check(_number("stiffness (Nm/rad)", order.get("value")))
        if self._walking.stiffness is None:
            robot = self._walking.controller.robot
            self._walking.stiffness = StiffnessScheduler(robot, foot, FixedPolicy(value))
        else:
            self._walking.stiffness.policy = FixedPolicy(value)
        return {"value": value}


def intervention_text(entry: dict[str, Any]) -> str:
    """An intervention for people."""
    what = {
        "push": "pushed {direction} with {impulse:g} Ns/kg",
        "stop": "told to stop",
        "gain": "gain {name} set to {value:g}",
        "stiffness": "soles told to take {value:g} Nm/rad",
    }[entry["what"]]
    return f"{entry['time']:.2f} s: {what.format(**entry)}"


class Wishes:
    """What all pages together wish for: the latest pause and speed, and orders with consecutive numbers.

    Attributes:
        paused: The run waits.
        speed: Multiple of real time; None for as fast as it goes, as at the start.
        orders: The last ones, each with its number.
    """

    MOST_ORDERS = 16
    """Orders that wait at a time; more are dropped."""

    def __init__(self, speed: float | None) -> None:
        """Wish for nothing.

        Args:
            speed: Speed at the start.
        """
        self.paused = False
        self.speed = speed
        self.orders: list[tuple[int, Any]] = []
        self._count = 0

    def take(self, said: Any) -> None:
        """Take over what a page has said; what makes no sense is dropped."""
        if not isinstance(said, dict):
            return
        if isinstance(said.get("paused"), bool):
            self.paused = said["paused"]
        if "speed" in said:
            speed = said["speed"]
            good = isinstance(speed, (int, float)) and not isinstance(speed, bool) and 1e-3 <= speed <= 1e3
            if good or speed is None:
                self.speed = None if speed is None else float(speed)
        if isinstance(said.get("order"), dict):
            self._count += 1
            self.orders = [*self.orders, (self._count, said["order"])][-self.MOST_ORDERS :]

    def pack(self) -> bytes:
        """Return them as JSON; without the oldest orders if it gets long."""
        while True:
            text = json.dumps({"paused": self.paused, "speed": self.speed, "orders": self.orders}).encode()
            if len(text) < 4000 or not self.orders:
                return text
            self.orders = self.orders[1:]


def _first(value: Any) -> float:
    """A gain, or its forward one."""
    return float(value[0] if isinstance(value, tuple) else value)


def _number(what: str, value: Any, high: float = math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{what} must be a number, got {value!r}")
    return finite_scalar(what, value, low=0.0, high=high)
