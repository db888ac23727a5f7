"""Controls of a run: what its page, or a program that repeats it, may change.

Pause and speed change only when things happen on the clock. Everything else is an order, of one of the `ORDERS`: orders
are queued, carried out at a tick, and kept as interventions with their simulated time, which results and logs hold and
which repeat the run.

A footstep plan, gait, terrain and seed belong to another run; a run cannot go back in time: `wbc view` replays it.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import pinocchio as pin

from wbc.app.arguments import attribute_docs
from wbc.base.errors import InputError, WbcError, choose, shown
from wbc.base.numbers import finite_array, finite_scalar
from wbc.core.conventions import rotation_of
from wbc.core.frames import heading
from wbc.core.qp.controller import Controller
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.sim.plant.plant import Plant
from wbc.sim.trial.push import push_along
from wbc.tasks.scheduling.policies import FixedPolicy
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.tasks.stabilizer.gains import StabilizerGains

if TYPE_CHECKING:
    from wbc.sim.simulation.simulation import Simulation
    from wbc.walking.control import WalkingControl
    from wbc.walking.steered import SteeredControl

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

GAINS = (
    ("stiffness", "1/s²", "acceleration per error; the damping stays critical unless it was set"),
    ("damping", "1/s", "acceleration per velocity error"),
)
"""Gains of a task: name, unit and hint."""

IMPULSE, MAX_IMPULSE = 0.1, 2.0
"""Impulse of a push per mass, Ns/kg: the page's default (a walk recovers from it), and the largest one."""

MAX_SPEED = 10.0
"""Largest speed that a page may ask for, m/s and rad/s; the robot grants what it can."""

MAX_ORDERS = 16
"""Largest number of orders that wait for a tick; older ones are dropped."""


class Setting(NamedTuple):
    """A number of a run that may be changed while it goes on."""

    name: str  # group and name, such as stabilizer/dcm_p
    unit: str
    value: float  # now
    about: str
    take: Callable[[float], object]


class LiveControls:
    """Controls of one run, which carry out orders.

    Attributes:
        plant: Robot that is pushed; None without a simulation.
        walking: Control that is driven and stopped; None for another one.
        controller: Controller whose tasks are set; None without one.
        interventions: Changes of the run, each with its simulated time (s); empty if nobody changed it.
        message: Outcome of the last order, for the page.
        time: Simulated time of the last update, s.
    """

    def __init__(
        self,
        plant: Simulation | None,
        walking: SteeredControl | None,
        controller: Controller | None = None,
    ) -> None:
        self.plant, self.walking = plant, walking
        if controller is None and walking is not None and walking.drives is not None:
            controller = walking.drives.controller
        self.controller = controller
        self.interventions: list[dict[str, Any]] = []
        self.message = ""
        self._orders: deque[dict[str, Any]] = deque(maxlen=MAX_ORDERS)  # of pages, until the next tick
        self._reported, self.time = 0, 0.0
        self._docs = attribute_docs(StabilizerGains)

    @property
    def settings(self) -> dict[str, Setting]:
        """Settings of the run by name; tasks come and go."""
        walking, foot = self.walking, self.plant.foot if isinstance(self.plant, Plant) else None
        found: list[Setting] = []
        stabilizer = getattr(walking, "stabilizer", None)
        if stabilizer is not None:
            gains = stabilizer.gains.for_mass(stabilizer.mass)
            for name, unit in STABILIZER_GAINS.items():
                value = float(np.max(getattr(gains, name)))
                take = partial(_set_gain, stabilizer, name)
                found.append(Setting(f"stabilizer/{name}", unit, value, self._docs[name], take))
        if walking is not None and isinstance(foot, VariableStiffnessFoot):
            about, walk = "each foot takes it in its next swing", cast("WalkingControl", walking)
            value = foot.stiffness if walk.stiffness is None else float(walk.stiffness.command.max())
            take = partial(_set_stiffness, walk, foot)
            found.append(Setting("soles/stiffness", "Nm/rad", value, about, take))
        for task in () if self.controller is None else self.controller.tasks:
            found += _task_settings(task)
        return {each.name: each for each in found}

    # ---- the tick ---------------------------------------------------------------------------------------------------

    def order(self, request: dict[str, Any]) -> None:
        """Queue an order until the next tick; may be called from any thread."""
        self._orders.append(request)

    def update(self, time: float) -> None:
        """Carry out the orders that are due at a simulated time, s."""
        self.time = time
        while self._orders:
            self.apply(self._orders.popleft())

    def news(self) -> list[dict[str, Any]]:
        """Return the interventions since the last call, for a log."""
        entries = self.interventions[self._reported :]
        self._reported += len(entries)
        return entries

    @property
    def offered(self) -> set[str]:
        """Kinds of orders that the run takes."""
        return {name for name, kind in ORDERS.items() if kind.part(self) is not None}

    def apply(self, request: dict[str, Any]) -> None:
        """Carry out an order, {"do": name, …}, now; `message` says whether it was refused."""
        try:
            kind = ORDERS[choose("request", request["do"], self.offered)]
            facts = kind.carry_out(kind.part(self), request)
        except Exception as error:  # whatever a page asks for, the control loop goes on
            self.message = f"refused: {error}"
            if not isinstance(error, WbcError):
                _log.warning("a request of the page failed", exc_info=True)
            return
        entry = {"time": self.time, "what": request["do"], **facts}
        self.interventions.append(entry)
        self.message = intervention_text(entry)

    def halt(self) -> None:
        """Bring a robot that is driven from a page to a stand, because the last page has been closed."""
        moves = self.walking is not None and self.walking.steered and any(self.walking.velocity or ())
        if moves and any(entry["what"] == "drive" for entry in self.interventions):
            self.apply({"do": "drive", "forward": 0.0, "left": 0.0, "turn": 0.0})


# ---- the orders: each takes the part of the run that it changes, and returns what is recorded ----------------------


def _push(plant: Simulation, request: dict[str, Any]) -> dict[str, Any]:
    side = choose("direction of a push", str(request.get("direction")), DIRECTIONS)
    impulse = finite_scalar("impulse of a push (Ns/kg)", request.get("impulse"), low=0.0, high=MAX_IMPULSE)
    push_along(plant, impulse, heading(rotation_of(plant.truth().q[3:7])) + DIRECTIONS[side])
    return {"direction": side, "impulse": impulse}


def _stop(walking: SteeredControl, request: dict[str, Any]) -> dict[str, Any]:
    del request
    walking.stop()
    return {}


def _drive(walking: SteeredControl, request: dict[str, Any]) -> dict[str, Any]:
    velocity = {
        name: finite_scalar(f"{name} of a velocity", request.get(name), low=-MAX_SPEED, high=MAX_SPEED)
        for name in ("forward", "left", "turn")
    }
    walking.velocity = (velocity["forward"], velocity["left"], velocity["turn"])
    return velocity


def _set(settings: dict[str, Setting], request: dict[str, Any]) -> dict[str, Any]:
    name = str(request.get("name"))
    value = finite_scalar(f"value of {name}", request.get("value"), low=0.0)
    settings[choose("setting", name, settings)].take(value)
    return {"name": name, "value": value}


def _aim(controller: Controller, request: dict[str, Any]) -> dict[str, Any]:
    task: Any = controller.task(str(request.get("task")))
    if task.held_by is not None:
        raise InputError(f"the target of task '{task.name}' is set at every tick: use {task.held_by}")
    task.target = target_of(task, request.get("target"))
    return {"task": task.name, "target": np.asarray(request["target"], dtype=float).tolist()}


class Order(NamedTuple):
    """Kind of order, which becomes an intervention.

    Attributes:
        text: Text of an intervention.
        fields: Types of what is recorded of it beside its time.
        part: Function that returns the part of a run that the order changes; None where the run has none.
        carry_out: Function of part and order that carries it out and returns the fields.
    """

    text: str
    fields: dict[str, type]
    part: Callable[[LiveControls], Any]
    carry_out: Callable[[Any, dict[str, Any]], dict[str, Any]]


END = "end"
"""Intervention that ends a run: Ctrl-C."""

ORDERS = {
    # A push on the torso, from the robot's front, back or sides
    "push": Order(
        "pushed {direction} with {impulse:g} Ns/kg",
        {"direction": str, "impulse": float},
        lambda run: run.plant,
        _push,
    ),
    # The walk stops safely, with the present step
    "stop": Order("told to stop", {}, lambda run: run.walking, _stop),
    # Velocity of a robot that is steered; a stand when no page is left
    "drive": Order(
        "driven at {forward:.2f} m/s forward, {left:.2f} m/s left, {turn:.2f} rad/s",
        {"forward": float, "left": float, "turn": float},
        lambda run: run.walking if run.walking is not None and run.walking.steered else None,
        _drive,
    ),
    # One of the `settings`: gains of the stabilizer, stiffness of variable soles, weights and gains of tasks
    "set": Order("{name} set to {value:g}", {"name": str, "value": float}, lambda run: run.settings, _set),
    # Target of a task: a point, a rotation or a pose
    "target": Order(
        "target of task {task} moved", {"task": str, "target": list}, lambda run: run.controller, _aim
    ),
    END: Order("ended", {}, lambda run: None, _stop),
}
"""Kinds of orders by name; a new one is an entry here, and a control of the page that gives it (`workbench`)."""


def checked_interventions(entries: Iterable[Any]) -> list[dict[str, Any]]:
    """Return copies of the interventions of a run; `InputError` for one that cannot be repeated."""
    copies = []
    for entry in entries:
        known = ORDERS.get(str(entry.get("what"))) if isinstance(entry, dict) else None
        if known is None:
            raise InputError(f"a recorded change must be one of {', '.join(ORDERS)}, got {shown(entry)}")
        for name, kind in {"time": float, **known.fields}.items():
            value = entry.get(name)
            number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
            if not (number if kind is float else isinstance(value, kind)):
                raise InputError(f"{name} of a recorded change cannot be {shown(value)}")
        copies.append(dict(entry))
    return copies


def _set_gain(stabilizer: Any, name: str, value: float) -> None:
    stabilizer.gains = replace(stabilizer.gains, **{name: value})


def _set_stiffness(walking: WalkingControl, foot: VariableStiffnessFoot, value: float) -> None:
    policy = FixedPolicy(foot.actuator.check(value))
    if walking.stiffness is None:
        walking.stiffness = StiffnessScheduler(walking.controller.robot, foot, policy)
    else:
        walking.stiffness.policy = policy


def _task_settings(task: Any) -> Iterator[Setting]:
    """Yield weight and gains of a task; all its rows get the same."""
    group = f"task {task.name}"
    if not task.hard:
        about = f"cost per squared residual, ({task.residual_unit})²"
        yield Setting(
            f"{group}/weight", "", float(task.weight.max()), about, partial(setattr, task, "weight")
        )
    for name, unit, about in GAINS:
        if (value := float(getattr(task, name).max())) > 0.0:
            yield Setting(f"{group}/{name}", unit, value, about, partial(setattr, task, name))


def target_of(task: Any, value: Any) -> Any:
    """Return numbers as a target of a task: a point, shape (3,), a rotation, (3, 3), or a pose as position and xyzw."""
    if isinstance(task.target, pin.SE3):
        return pin.XYZQUATToSE3(finite_array(f"target of task '{task.name}' (m, xyzw)", value, (7,)))
    return finite_array(f"target of task '{task.name}'", value, np.shape(task.target))


def intervention_text(entry: dict[str, Any]) -> str:
    """Return an intervention as text."""
    return f"{entry['time']:.2f} s: {ORDERS[entry['what']].text.format(**entry)}"
