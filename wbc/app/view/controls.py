"""Controls of the page: what a user can change in a run.

Pause and speed change only when things happen on the clock. The others change the run; each is recorded as an
intervention with its time, and results say that there were any.

    push        a push on the torso, from the robot's front, back or sides
    stop        the walk stops safely, with the present step
    drive       velocity of a robot that is steered: forward, left and turn; a stand when no page that may is left
    gains       of the stabilizer, where the controller has one, from the next tick on
    stiffness   of variable soles: each foot gets it in its next swing, as if decided by a policy, as far as its
                actuator is sure to reach it before the landing

Not offered: a footstep plan, gait, terrain and seed are checked before a walk starts and belong to another run. The
stiffness of a passive sole is fixed by its material. A run cannot go back in time: record and replay it (`wbc view`).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wbc.core.errors import InputError, WbcError, choose, finite_scalar
from wbc.feet.soles.soft import VariableStiffnessFoot

if TYPE_CHECKING:
    from wbc.sim import Plant
    from wbc.walking.control import ReferenceControl

_log = logging.getLogger(__name__)

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
"""Directions of a push in the robot's frame, rad to the left of forward."""

IMPULSE, MAX_IMPULSE = 0.1, 2.0
"""Impulse of a push per mass, Ns/kg: the page's default (a walk recovers from it), and the largest one."""

MAX_SPEED = 10.0
"""Largest speed that a page may ask for, m/s and rad/s; the robot grants what it can."""

PUSH_DURATION = 0.1
"""Duration of a push, s; as in `wbc push`."""


class LiveControls:
    """Controls of one run, which carry out the requests of pages.

    Attributes:
        interventions: Changes of the run, each with its simulated time (s); empty if nobody changed it.
        message: Outcome of the last request, for the page.
    """

    def __init__(self, plant: Plant | None, walking: ReferenceControl | None) -> None:
        """Find the controls that the run has.

        Args:
            plant: The plant; None for no controls.
            walking: The controller of a walk.
        """
        self._plant, self._walking = plant, walking
        self.interventions: list[dict[str, Any]] = []
        self.message = ""
        self._actions: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {}
        if plant is not None:
            self._actions["push"] = self._push
            if walking is not None:
                self._actions["stop"] = self._stop
                if walking.stabilizer is not None:
                    self._actions["gain"] = self._set_gain
                if walking.steered:
                    self._actions["drive"] = self._drive
                if isinstance(plant.foot, VariableStiffnessFoot):
                    self._actions["stiffness"] = self._set_stiffness

    def available(self) -> dict[str, Any]:
        """Return the controls and their present values, for the page."""
        controls: dict[str, Any] = {}
        if "push" in self._actions:
            controls["push"] = {"impulse": IMPULSE, "largest": MAX_IMPULSE, "directions": list(DIRECTIONS)}
        if "stop" in self._actions:
            controls["stop"] = True
        if "drive" in self._actions:
            assert self._walking is not None
            forward, back, aside, turn = self._walking.velocity_limits
            controls["drive"] = {"forward": forward, "back": back, "left": aside, "turn": turn}
        if "gain" in self._actions:
            assert self._walking is not None and self._walking.stabilizer is not None
            gains = self._walking.stabilizer.gains
            controls["gains"] = [
                {"name": name, "unit": unit, "value": _first(getattr(gains, name))}
                for name, unit in GAINS.items()
            ]
        if "stiffness" in self._actions:
            assert self._plant is not None and isinstance(self._plant.foot, VariableStiffnessFoot)
            actuator = self._plant.foot.actuator
            value = float(self._plant.foot.stiffness)
            controls["stiffness"] = {"low": actuator.low, "high": actuator.high, "value": value}
        return controls

    def apply(self, request: Any) -> None:
        """Carry out a request; `message` says whether it was refused.

        Args:
            request: Request of a page: {"do": name, …}.
        """
        try:
            if not isinstance(request, dict) or not isinstance(request.get("do"), str):
                raise InputError("a request must say what to do")
            facts = self._actions[choose("request", request["do"], self._actions)](request)
        except Exception as error:  # whatever a page asks for, the control loop goes on
            self.message = f"refused: {error}"
            if not isinstance(error, WbcError):
                _log.warning("a request of the page failed", exc_info=True)
            return
        assert self._plant is not None
        entry = {"time": self._plant.time, "what": request["do"], **facts}
        last = self.interventions[-1] if self.interventions else None
        if last is not None and last["what"] == "drive" == entry["what"] and last["time"] == entry["time"]:
            self.interventions.pop()  # only the last of several commands to one tick counts
        self.interventions.append(entry)
        self.message = intervention_text(entry)

    def _push(self, request: dict[str, Any]) -> dict[str, Any]:
        assert self._plant is not None
        side = choose("direction of a push", str(request.get("direction")), DIRECTIONS)
        impulse = _number("impulse of a push (Ns/kg)", request.get("impulse"), high=MAX_IMPULSE)
        w, x, y, z = self._plant.data.qpos[3:7].tolist()
        heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) + DIRECTIONS[side]
        force = impulse * self._plant.robot.mass / PUSH_DURATION
        along = [force * math.cos(heading), force * math.sin(heading), 0.0]
        self._plant.push("torso", along, PUSH_DURATION)
        return {"direction": side, "impulse": impulse}

    def _stop(self, request: dict[str, Any]) -> dict[str, Any]:
        del request
        assert self._walking is not None
        self._walking.stop()
        return {}

    def _drive(self, request: dict[str, Any]) -> dict[str, Any]:
        assert self._walking is not None
        velocity = tuple(
            _number(f"{name} of a velocity", request.get(name), low=-MAX_SPEED, high=MAX_SPEED)
            for name in ("forward", "left", "turn")
        )
        self._walking.velocity = velocity
        forward, left, turn = velocity
        return {"forward": forward, "left": left, "turn": turn}

    def halt(self) -> None:
        """Bring a robot that is driven from a page to a stand, because the last page has been closed."""
        walking = self._walking
        if "drive" in self._actions and walking is not None and any(walking.velocity or ()) and self._driven:
            self.apply({"do": "drive", "forward": 0.0, "left": 0.0, "turn": 0.0})

    @property
    def _driven(self) -> bool:
        """True if the last command of a velocity came from a page."""
        return any(entry["what"] == "drive" for entry in self.interventions)

    def _set_gain(self, request: dict[str, Any]) -> dict[str, Any]:
        assert self._walking is not None
        name = choose("gain", str(request.get("name")), GAINS)
        value = _number(f"gain '{name}'", request.get("value"))
        stabilizer = self._walking.stabilizer
        assert stabilizer is not None
        stabilizer.gains = replace(stabilizer.gains, **{name: value})
        return {"name": name, "value": _first(getattr(stabilizer.gains, name))}

    def _set_stiffness(self, request: dict[str, Any]) -> dict[str, Any]:
        from wbc.tasks.scheduling.policies import FixedPolicy  # noqa: PLC0415
        from wbc.tasks.scheduling.stiffness import StiffnessScheduler  # noqa: PLC0415 - few runs need it

        assert self._walking is not None and self._plant is not None
        foot = self._plant.foot
        assert isinstance(foot, VariableStiffnessFoot)
        value = foot.actuator.check(_number("stiffness (Nm/rad)", request.get("value")))
        if self._walking.stiffness is None:
            robot = self._walking.controller.robot
            self._walking.stiffness = StiffnessScheduler(robot, foot, FixedPolicy(value))
        else:
            self._walking.stiffness.policy = FixedPolicy(value)
        return {"value": value}


def intervention_text(entry: dict[str, Any]) -> str:
    """Return an intervention as text."""
    what = {
        "push": "pushed {direction} with {impulse:g} Ns/kg",
        "stop": "told to stop",
        "drive": "driven at {forward:.2f} m/s forward, {left:.2f} m/s left, {turn:.2f} rad/s",
        "gain": "gain {name} set to {value:g}",
        "stiffness": "soles told to take {value:g} Nm/rad",
    }[entry["what"]]
    return f"{entry['time']:.2f} s: {what.format(**entry)}"


def _first(value: Any) -> float:
    """Return a gain, the forward one of two."""
    return float(value[0] if isinstance(value, tuple) else value)


def _number(what: str, value: Any, high: float = math.inf, low: float = 0.0) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{what} must be a number, got {value!r}")
    return finite_scalar(what, value, low=low, high=high)
