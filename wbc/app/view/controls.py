"""Controls of a run: what its page, or a program that repeats it, may change.

Pause and speed change only when things happen on the clock. Everything else is an order: orders are queued, carried out
at a tick, and kept as interventions with their simulated time, which results and logs hold and which repeat the run.

    push        a push on the torso, from the robot's front, back or sides
    pull        a force on a link for as long as it is held, as by the mouse
    stop        the walk stops safely, with the present step
    drive       velocity of a robot that is steered: forward, left and turn; a stand when no page is left
    gain        of the stabilizer, where the controller has one, from the next tick on
    stiffness   of variable soles: each foot gets it in its next swing, as if decided by a policy, as far as its
                actuator is sure to reach it before the landing
    task        weight, stiffness, damping, target of a task, or whether it is on

A footstep plan, gait, terrain and seed belong to another run; a run cannot go back in time: `wbc view` replays it.
"""

from __future__ import annotations

import json
import logging
import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from wbc.core.errors import InputError, WbcError, choose, finite_array, finite_scalar
from wbc.core.qp.controller import Controller
from wbc.core.robot import GRAVITY
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.sim.plant.plant import Plant

if TYPE_CHECKING:
    from wbc.sim.plant.robot import SimulatedRobot
    from wbc.walking.control import ReferenceControl

_log = logging.getLogger(__name__)

STABILIZER_GAINS = {
    "dcm_p": "1/s",
    "dcm_i": "1/s",
    "dcm_d": "",
    "cop_admittance": "rad/(Nm·s)",
    "force_difference": "m/(N·s)",
}
"""Gains of the stabilizer that the page offers, with their units; forward and sideways get the same."""

DIRECTIONS = {"forward": 0.0, "left": 0.5 * math.pi, "back": math.pi, "right": -0.5 * math.pi}
"""Directions of a push in the robot's frame, rad to the left of forward."""

TASK_ORDERS = ("weight", "stiffness", "damping", "on", "target")
"""Fields of an order to a task, of which it changes one."""

IMPULSE, MAX_IMPULSE = 0.1, 2.0
"""Impulse of a push per mass, Ns/kg: the page's default (a walk recovers from it), and the largest one."""

MAX_SPEED = 10.0
"""Largest speed that a page may ask for, m/s and rad/s; the robot grants what it can."""

MAX_ORDERS = 16
"""Largest number of orders that wait for a tick; older ones are dropped."""

PUSH_DURATION = 0.1
"""Duration of a push, s; as in `wbc push`."""


class LiveControls:
    """Controls of one run, which carry out orders; without a page they repeat the interventions of a former run.

    Attributes:
        interventions: Changes of the run, each with its simulated time (s); empty if nobody changed it.
        message: Outcome of the last order, for the page.
    """

    def __init__(
        self,
        plant: SimulatedRobot | None,
        walking: ReferenceControl | None,
        controller: Controller | None = None,
        *,
        repeat: Iterable[dict[str, Any]] = (),
    ) -> None:
        """Find the controls that the run has; interventions of a former one are carried out again at their times."""
        self._plant: Any = plant
        self._walking: Any = walking
        self.controller: Any = walking.controller if controller is None and walking else controller
        self.interventions: list[dict[str, Any]] = []
        self.message = ""
        self._orders: deque[dict[str, Any]] = deque(maxlen=MAX_ORDERS)  # of pages, until the next tick
        self._repeat = deque(sorted(repeat, key=lambda entry: float(entry["time"])))
        self._pull: tuple[str, list[float]] | None = None
        self._weights: dict[str, Any] = {}  # of tasks that are off
        self._reported, self._time = 0, 0.0
        self._actions: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {}
        if self.controller is not None:
            self._actions["task"] = self._set_task
        if plant is not None:
            self._actions |= {"push": self._push, "pull": self._hold}
        if walking is not None:
            self._actions["stop"] = self._stop
            if walking.stabilizer is not None:
                self._actions["gain"] = self._set_gain
            if walking.steered:
                self._actions["drive"] = self._drive
            if self.variable_foot is not None:
                self._actions["stiffness"] = self._set_stiffness

    # ---- the tick ---------------------------------------------------------------------------------------------------

    def order(self, request: dict[str, Any]) -> None:
        """Queue an order until the next tick; may be called from any thread."""
        self._orders.append(request)

    def update(self, time: float | None = None) -> None:
        """Run one tick at a time (s), that of the plant when None: do what is due, pull where a link is held."""
        self.carry_out(self._now if time is None else time)
        if self._pull is not None and self._plant is not None:
            self._plant.push(self._pull[0], self._pull[1], self._plant.control_period)

    def carry_out(self, time: float) -> None:
        """Carry out the orders that are due at a time, s."""
        self._time = time
        while self._repeat and self._repeat[0]["time"] <= time:
            entry = dict(self._repeat.popleft())
            self.apply({"do": entry.pop("what"), **entry})
        while self._orders:
            self.apply(self._orders.popleft())

    def news(self) -> str:
        """Return the interventions since the last call, for a log: a JSON list; empty text if there are none."""
        entries = self.interventions[self._reported :]
        self._reported += len(entries)
        return json.dumps(entries) if entries else ""

    @property
    def offered(self) -> set[str]:
        """Kinds of orders that the run takes."""
        return {*self._actions}

    @property
    def variable_foot(self) -> VariableStiffnessFoot | None:
        """The foot of a walk on soles of variable stiffness; None for others."""
        foot = self._plant.foot if isinstance(self._plant, Plant) else None
        return foot if self._walking is not None and isinstance(foot, VariableStiffnessFoot) else None

    def apply(self, request: Any) -> None:
        """Carry out an order, {"do": name, …}, now; `message` says whether it was refused."""
        try:
            if not isinstance(request, dict) or not isinstance(request.get("do"), str):
                raise InputError("a request must say what to do")
            facts = self._actions[choose("request", request["do"], self._actions)](request)
        except Exception as error:  # whatever a page asks for, the control loop goes on
            self.message = f"refused: {error}"
            if not isinstance(error, WbcError):
                _log.warning("a request of the page failed", exc_info=True)
            return
        entry = {"time": self._now, "what": request["do"], **facts}
        last = self.interventions[-1] if self.interventions else None
        if last is not None and last["what"] == "drive" == entry["what"] and last["time"] == entry["time"]:
            self.interventions.pop()  # only the last of several commands to one tick counts
        self.interventions.append(entry)
        self.message = intervention_text(entry)

    @property
    def _now(self) -> float:
        """Simulated time, s."""
        return self._time if self._plant is None else self._plant.time

    def _set_task(self, request: dict[str, Any]) -> dict[str, Any]:
        task: Any = self.controller.task(str(request.get("task")))
        facts: dict[str, Any] = {key: request[key] for key in TASK_ORDERS if key in request}
        if len(facts) != 1:
            raise InputError(f"an order to a task has one of {', '.join(TASK_ORDERS)}")
        ((what, value),) = facts.items()
        if what == "target":
            if task.held_by is not None:
                raise InputError(f"the target of task '{task.name}' is set at every tick: use {task.held_by}")
            task.target = target_of(task, value)
        elif what == "on":
            if task.hard:
                raise InputError(f"task '{task.name}' is hard: it cannot be switched off")
            if value and task.name in self._weights:
                task.weight = self._weights.pop(task.name)
            elif not value and task.name not in self._weights:
                self._weights[task.name], task.weight = np.array(task.weight), 0.0
        elif what == "weight" and task.name in self._weights:
            self._weights[task.name] = finite_array(f"weight of task '{task.name}'", value)
        else:
            setattr(task, what, value)
        return {"task": task.name, **facts}

    def _hold(self, request: dict[str, Any]) -> dict[str, Any]:
        body = str(request.get("body"))
        force = finite_array("force of a pull (N)", request.get("force", math.nan), (3,))
        weight = self._plant.robot.mass * GRAVITY
        size = float(np.linalg.norm(force))
        if size > weight:
            force = force * (weight / size)
        if body not in ("torso", "base"):  # which `Plant.push` takes beside frames
            self._plant.robot.frame_id(body)
        self._pull = (body, force.tolist()) if size > 0.0 else None
        return {"body": body, "force": force.tolist()}

    def _push(self, request: dict[str, Any]) -> dict[str, Any]:
        side = choose("direction of a push", str(request.get("direction")), DIRECTIONS)
        impulse = finite_scalar(
            "impulse of a push (Ns/kg)", request.get("impulse"), low=0.0, high=MAX_IMPULSE
        )
        x, y, z, w = self._plant.truth().q[3:7].tolist()
        heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) + DIRECTIONS[side]
        force = impulse * self._plant.robot.mass / PUSH_DURATION
        along = [force * math.cos(heading), force * math.sin(heading), 0.0]
        self._plant.push("torso", along, PUSH_DURATION)
        return {"direction": side, "impulse": impulse}

    def _stop(self, request: dict[str, Any]) -> dict[str, Any]:
        self._walking.stop()
        return {}

    def _drive(self, request: dict[str, Any]) -> dict[str, Any]:
        velocity = tuple(
            finite_scalar(f"{name} of a velocity", request.get(name), low=-MAX_SPEED, high=MAX_SPEED)
            for name in ("forward", "left", "turn")
        )
        self._walking.velocity = velocity
        forward, left, turn = velocity
        return {"forward": forward, "left": left, "turn": turn}

    def halt(self) -> None:
        """Bring a robot that is driven from a page to a stand, because the last page has been closed."""
        walking = self._walking
        moves = "drive" in self._actions and walking is not None and any(walking.velocity or ())
        if moves and any(entry["what"] == "drive" for entry in self.interventions):
            self.apply({"do": "drive", "forward": 0.0, "left": 0.0, "turn": 0.0})

    def _set_gain(self, request: dict[str, Any]) -> dict[str, Any]:
        name = choose("gain", str(request.get("name")), STABILIZER_GAINS)
        value = finite_scalar(f"gain '{name}'", request.get("value"), low=0.0)
        stabilizer = self._walking.stabilizer
        stabilizer.gains = replace(stabilizer.gains, **{name: value})
        return {"name": name, "value": first(getattr(stabilizer.gains, name))}

    def _set_stiffness(self, request: dict[str, Any]) -> dict[str, Any]:
        from wbc.tasks.scheduling.policies import FixedPolicy  # noqa: PLC0415
        from wbc.tasks.scheduling.stiffness import StiffnessScheduler  # noqa: PLC0415 - few runs need it

        foot = self._plant.foot
        value = foot.actuator.check(finite_scalar("stiffness (Nm/rad)", request.get("value"), low=0.0))
        if self._walking.stiffness is None:
            robot = self._walking.controller.robot
            self._walking.stiffness = StiffnessScheduler(robot, foot, FixedPolicy(value))
        else:
            self._walking.stiffness.policy = FixedPolicy(value)
        return {"value": value}


def target_of(task: Any, value: Any) -> Any:
    """Return numbers as a target of a task: a point, shape (3,), a rotation, (3, 3), or a pose as position and xyzw."""
    if isinstance(task.target, pin.SE3):
        return pin.XYZQUATToSE3(finite_array(f"target of task '{task.name}' (m, xyzw)", value, (7,)))
    return finite_array(f"target of task '{task.name}'", value, np.shape(task.target))


def intervention_text(entry: dict[str, Any]) -> str:
    """Return an intervention as text."""
    what = {
        "push": "pushed {direction} with {impulse:g} Ns/kg",
        "stop": "told to stop",
        "drive": "driven at {forward:.2f} m/s forward, {left:.2f} m/s left, {turn:.2f} rad/s",
        "gain": "gain {name} set to {value:g}",
        "stiffness": "soles told to take {value:g} Nm/rad",
        "pull": "pulled at {body} with ({force}) N",
        "task": "task {task} changed",
        "end": "ended",
    }[entry["what"]]
    force = ", ".join(str(round(part)) for part in entry.get("force", ()))
    return f"{entry['time']:.2f} s: {what.format(**entry | {'force': force})}"


def first(value: Any) -> float:
    """Return a gain, the forward one of two."""
    return float(value[0] if isinstance(value, tuple) else value)
