"""Robot, drives, foot and sensors of a simulation: base of the specs of all trials, and of their results.

The command line, files and journals of a trial are made from the fields of its spec.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import BeforeValidator

from wbc.base.errors import choose, former_name
from wbc.base.html import html_table
from wbc.base.registry import reading_data
from wbc.base.settings import Seed, from_json, json_object, settings, to_json, units
from wbc.core.drive.control import Mode
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.core.robot import Robot
from wbc.feet.soles.catalog import foot as foot_by_name
from wbc.robots import RobotDescription, load
from wbc.robots.registry import name_of
from wbc.sim.plant.fitting import with_feet
from wbc.sim.simulation.machine import Machine, Step, steps_per_tick
from wbc.sim.simulation.sensors import NOISE_PRESETS
from wbc.sim.simulation.simulation import Simulation
from wbc.sim.trial.loops import PLANT, trial_loop

CONTROL_PERIOD: dict[Mode, float] = {"position": 0.005, "torque": 0.002, "hybrid": 0.002}
"""Default control period, s: stiff servos hold the robot between ticks, torques and soft servos do not."""

DELAYS = ("measurement_delay", "command_delay")
"""Delays of a machine that its observer knows."""

PLAIN = (str, int, float)
"""Values of a result that a notebook shows."""

RobotName = Annotated[str, BeforeValidator(name_of)]
"""Name of a robot; a description is taken by the name under which this process finds it."""


@settings(kw_only=True, eq=False)
class TrialSpec:
    """Robot, drives, foot and sensors of a simulation. A spec that exists can be run: bad values are refused here.

    A field that is not given stays None, so that `dataclasses.replace` decides it anew; what follows from it is a
    property such as `chosen`. The written spec (`to_json`) holds what was decided. Specs that are written equally are
    equal. `robot` may also be a description; only the process that gave it can read such a spec.

    Attributes:
        robot: Robot: a name that `wbc robots` lists, or a file (MJCF, URDF or TOML).
        mode: Command of the drives: references of position and velocity, torques, or both on soft servos (hybrid).
            Position when not given, hybrid where the description says that the servos are soft.
        foot: Foot under both ankles; flat is the robot's own sole.
        noise: Errors of the sensors, none or realistic.
        seed: Fixes every random draw.
        control_period: Time between two commands, s; 5 ms in position control and 2 ms in torque and hybrid control
            when not given.
        timestep: Physics step, s.
        servo: Gains of the servos in place of the description's, each as pattern=kp,kd, such as `*knee*=100,2`.
        machine: Delays, friction, payload and which sensors there are; the delays are stated to the observer.
        loop: Simulation: plant, or one's own by a registered name or as FILE.py:NAME.
    """

    kind: ClassVar[str] = "trial"

    @staticmethod
    def instead_of(value: object) -> str:
        """Return how to say which robot, where its name or the robot itself was given."""
        name = value if isinstance(value, str) else getattr(value, "name", None)
        return f"robot='{name}' is one of its fields" if isinstance(name, str) else ""

    robot: RobotName = "hrp4_class"
    mode: Mode | None = None
    foot: str = "flat"
    noise: str = "none"
    seed: Seed = 0
    control_period: Step | None = None
    timestep: Step = 0.001
    servo: tuple[str, ...] = ()
    machine: Machine = field(default_factory=Machine)
    loop: str = PLANT

    def __post_init__(self) -> None:
        load(self.robot).needs_feet("standing")
        _ = self.chosen  # refuses a mode that the servos do not allow
        foot_by_name(self.foot)
        NOISE_PRESETS[self.noise]
        steps_per_tick(self.period, self.timestep)
        loop = trial_loop(self.loop)
        object.__setattr__(self, "loop", loop.name)
        loop.check(self.machine, self._wanted())

    def _wanted(self) -> dict[str, object]:
        """Return what the trial wants of its loop beyond a robot on its own soles: option → value."""
        return {} if self.foot == "flat" else {"foot": self.foot}

    def to_json(self) -> dict[str, Any]:
        """Return the spec as plain values, with its kind, and with the control mode that was chosen."""
        return {"kind": self.kind, **to_json(self), "mode": self.chosen}

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(json.dumps(self.to_json(), sort_keys=True, default=repr))

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the spec that `to_json` wrote, or a shorter one: what is left out has its default.

        A file of code that the spec names is run only if a user has named it, too (`wbc.base.registry.allow_code`).
        """
        values = json_object(cls.__name__, data)
        choose("trial kind", values.pop("kind", cls.kind), (cls.kind,))
        with reading_data():
            return from_json(cls, values)

    @cached_property
    def chosen(self) -> Mode:
        """Control mode: the given one, or what follows from the other fields. Too soft servos are an `InputError`."""
        servos, mode = load(self.robot).with_servos(self.servo).servos, self.mode or self._usual_mode()
        if mode is None:
            return "position" if servos.soft_ankle is None else "hybrid"
        if mode == "position":
            servos.check_position_control()
        return mode

    @property
    def period(self) -> float:
        """Control period, s."""
        return CONTROL_PERIOD[self.chosen] if self.control_period is None else self.control_period

    def _usual_mode(self) -> Mode | None:
        """Return the control mode when none is given; None for that of the robot's servos."""
        return None

    def build(self, *, visuals: bool = True) -> tuple[Robot, Simulation, Observer]:
        """Return the controller's robot, the loop, and an observer that knows the delays."""
        foot = foot_by_name(self.foot)
        description = with_feet(load(self.robot).with_servos(self.servo), foot)
        plant = self.simulation(description, foot=foot, seed=self.seed, visuals=visuals)
        robot, settings = description.robot(), self.with_delays(ObserverSettings())
        return robot, plant, Observer(robot, settings, adopt=self.chosen != "position")

    def simulation(self, description: RobotDescription, **options: Any) -> Simulation:
        """Return the simulation of a robot; the options are those that the fields of every trial do not say."""
        plant: Simulation = trial_loop(self.loop).make(
            description,
            noise=self.noise,
            timestep=self.timestep,
            control_period=self.period,
            machine=self.machine,
            **options,
        )
        return plant

    def with_delays(self, observer: ObserverSettings, given: Collection[str] = ()) -> ObserverSettings:
        """Return settings of an observer that knows the delays of the machine, but for those that are given."""
        delays = {name: getattr(self.machine, name) for name in DELAYS if name not in given}
        return replace(observer, **delays)


@dataclass(frozen=True, slots=True)
class WallClock:
    """Wall-clock timings of a trial; they differ from run to run.

    Attributes:
        decision_us: From a complete scan to the stiffness command, median and maximum; None without a decision.
    """

    wall_s: float  # the whole trial: building the model, running, summing up
    real_time_factor: float  # simulated time over wall time of the closed loop
    tick_us: dict[str, float]  # from measurement to command, median and 99th percentile
    decision_us: dict[str, float] | None = None

    def __str__(self) -> str:
        tick = self.tick_us
        return (
            f"{self.real_time_factor:.2f} x real time; a tick takes {tick['median']:.0f} us, "
            f"99 % less than {tick['p99']:.0f} us"
        )


@dataclass(frozen=True, kw_only=True)
class TrialResult:
    """Result of a trial; all but `clock` follows from the spec, and is the same bit for bit in every run.

    Attributes:
        robot: Name of the robot.
        seed: Seed.
        seconds: Simulated time, s.
        failures: Ticks without a solution or with an unusable measurement.
        clock: Wall-clock timings; None in a record that was read back without them.
    """

    robot: str
    seed: int
    seconds: Annotated[float, "s"]
    failures: int
    clock: WallClock | None = None

    RENAMED: ClassVar[Mapping[str, str]] = {}
    """Former names of attributes, and what stands in their place."""

    if not TYPE_CHECKING:
        __getattr__ = former_name

    def record(self) -> dict[str, Any]:
        """Return all that follows from the spec, as plain values."""
        return {name: value for name, value in to_json(self).items() if name != "clock"}

    def timings(self) -> dict[str, Any]:
        """Return the wall-clock timings, as plain values; empty without any."""
        return {} if self.clock is None else to_json(self.clock)

    def to_json(self) -> dict[str, Any]:
        """Return record and timings, as plain values."""
        return self.record() | self.timings()

    def _repr_html_(self) -> str:
        own, lines = units(type(self)), [type(self).__name__]
        for each in fields(self):
            value = getattr(self, each.name)
            if is_dataclass(value):
                parts = [(part.name, getattr(value, part.name)) for part in fields(value)]
                value = ", ".join(f"{name} {_short(part)}" for name, part in parts if isinstance(part, PLAIN))
            if isinstance(value, PLAIN):
                unit = own.get(each.name) or own.get(f"{each.name}.mean", "")
                lines.append(f"{each.name}  {_short(value)} {unit}")
        return html_table("\n".join(lines))


def _short(value: object) -> str:
    """Return a value as text, floats with four digits."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
