"""What one simulated walk is: everything that decides its result, checked before anything starts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from wbc.core.changes import Changes, as_changes, changed, normal_changes
from wbc.core.errors import (
    Array,
    InputError,
    choose,
    finite_array,
    finite_scalar,
    non_negative,
    positive,
    unknown_name,
)
from wbc.core.robot import Robot
from wbc.feet import Foot
from wbc.feet.soles.catalog import foot as foot_by_name
from wbc.robots import load
from wbc.robots.description import RobotDescription
from wbc.sim.balance.standing import CONTROL_PERIOD, MODES, Mode
from wbc.sim.plant.model import body_frame
from wbc.sim.plant.sensors import noise_preset
from wbc.sim.plant.settings import steps_per_tick
from wbc.sim.plant.shod import shod
from wbc.sim.terrain import Terrain
from wbc.sim.terrain import terrain as terrain_by_name
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.policy import checked_policy
from wbc.sim.walks.push import WalkPush
from wbc.sim.walks.settings import TrialSettings, checked_changes, trial_settings
from wbc.walking.control import WalkingControl
from wbc.walking.planning.footsteps import FootstepPlan
from wbc.walking.planning.gait import Gait
from wbc.walking.planning.reach import check_plan


@dataclass(frozen=True, kw_only=True)
class WalkSpec:
    """One simulated walk. A spec that exists can be walked: whatever is wrong is refused when it is made.

    Equal specs give equal records, bit for bit. A spec is small, hashable and readable as JSON.

    Attributes:
        robot: Robot, one of those that `wbc robots` lists.
        foot: Foot under both ankles: flat is the robot's own sole.
        stiffness: Of the sole hinges of a soft or variable foot, Nm/rad; the foot's own when None.
        foot_changes: Further parameters of the foot, such as "damping" or "contact.row_spacing".
        policy: Who sets soles of variable stiffness while they swing: one of `wbc.tasks.stiffness_policy_names()`; the
            model that comes with the library when None. `stiffness` is then what they start with.
        policy_params: Parameters of the policy. With a file ("path"), the hash of its content is added ("sha256").
        terrain: Family of grounds, one of those that `wbc terrains` lists.
        amplitude: Highest minus lowest point of the ground, m; the family's own when None.
        terrain_params: Parameters of the family, and of the track: length, width, start, strip, rendering.
        seed: Fixes the ground and the errors of the sensors.
        noise: Errors of the sensors, none or realistic.
        noise_seed: Another seed for the errors of the sensors.
        mode: What the drives are given: "position" or "torque".
        control_period: Time between two commands, s; 5 ms in position control and 2 ms in torque control when None.
        timestep: Physics step, s.
        plan: What to do.
        gait: Sizes and timings of steps.
        gains: Settings to begin with: "default" or "legacy".
        changes: Settings that differ from these; see `wbc.sim.walks.settings.TrialSettings`.
        start: Where the robot starts: x (m), y (m) and heading (rad).
        pushes: Pushes on the way.
    """

    kind: ClassVar[str] = "walk"

    robot: str = "hrp4_class"
    foot: str = "flat"
    stiffness: float | None = None
    foot_changes: Changes = ()
    policy: str | None = None
    policy_params: Changes = ()
    terrain: str = "flat"
    amplitude: float | None = None
    terrain_params: Changes = ()
    seed: int = 0
    noise: str = "realistic"
    noise_seed: int | None = None
    mode: Mode = "position"
    control_period: float | None = None
    timestep: float = 0.001
    plan: WalkPlan = field(default_factory=WalkPlan)
    gait: Gait = field(default_factory=Gait)
    gains: str = "default"
    changes: Changes = ()
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pushes: tuple[WalkPush, ...] = ()

    def __post_init__(self) -> None:
        def store(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        for name in ("robot", "foot", "terrain", "noise", "mode", "gains"):
            if not isinstance(getattr(self, name), str):
                raise InputError(f"{name} of a walk must be a name, got {getattr(self, name)!r}")
        load(self.robot)
        if self.stiffness is not None:
            store("stiffness", non_negative("sole stiffness (Nm/rad)", self.stiffness))
        store("foot_changes", _foot_changes(self.foot, as_changes(self.foot_changes)))
        store("terrain_params", as_changes(self.terrain_params))
        ground = self.ground()
        store("amplitude", ground.amplitude)
        store("terrain_params", _as_used(ground, self.terrain_params))
        noise_preset(self.noise)
        _check_seed("seed", self.seed)
        if self.noise_seed is not None:
            _check_seed("noise_seed", self.noise_seed)
        choose("mode", self.mode, MODES)
        if self.control_period is not None:
            store("control_period", positive("control period (s)", self.control_period))
        store("timestep", positive("physics timestep (s)", self.timestep))
        steps_per_tick(self.period, self.timestep)
        for name, kind in (("plan", WalkPlan), ("gait", Gait)):
            if not isinstance(getattr(self, name), kind):
                raise InputError(
                    f"{name} of a walk must be a {kind.__name__}, got {getattr(self, name)!r}; "
                    "WalkSpec.from_json takes plain values"
                )
        store("changes", checked_changes(self.gains, as_changes(self.changes)))
        policy, params = checked_policy(
            self.foot_design(), self.policy, as_changes(self.policy_params), self.settings().stiffness
        )
        store("policy", policy)
        store("policy_params", params)
        place = finite_array("start (x m, y m, heading rad)", self.start, (3,)).tolist()
        store("start", tuple(place))
        store("pushes", tuple(self.pushes))
        for push in self.pushes:
            if not isinstance(push, WalkPush):
                raise InputError(f"a push of a walk must be a WalkPush, got {push!r}")
        prepared = self.prepared()
        steps = len(prepared.plan)
        for push in self.pushes:
            body_frame(push.body, prepared.robot())
            if push.step is not None and push.step > steps:
                raise InputError(f"a push at step {push.step} of a walk of {steps} steps")

    @property
    def period(self) -> float:
        """Control period, s."""
        return CONTROL_PERIOD[self.mode] if self.control_period is None else self.control_period

    def foot_design(self) -> Foot:
        """The foot.

        Raises:
            InputError: A parameter that it does not have, or a value out of range.
        """
        return _foot(self.foot, self.stiffness, self.foot_changes)

    def ground(self) -> Terrain:
        """The ground.

        Raises:
            UnknownNameError: No such family or parameter.
            InputError: A value out of range.
        """
        params: dict[str, Any] = dict(self.terrain_params)
        for name in ("name", "amplitude", "seed"):
            if name in params:
                raise InputError(f"{name} of a terrain is an option of its own, not one of its parameters")
        return terrain_by_name(self.terrain, self.amplitude, self.seed, **params)

    def settings(self) -> TrialSettings:
        """Preset and changes as settings."""
        return trial_settings(self.gains, self.changes, self.mode, self.timestep)

    def prepared(self) -> PreparedWalk:
        """Everything that does not depend on seeds; made once for all specs that differ in seeds alone."""
        ground = self.ground()
        stairs = ground if self.plan.stairs is not None else None
        # The floor around a flat ground has no end.
        extent = None if self.terrain == "flat" else ground.extent
        return _prepare(
            self.robot,
            self.foot_design(),
            self.plan,
            self.gait,
            self.settings(),
            self.period,
            self.start,
            extent,
            stairs,
        )

    def to_json(self) -> dict[str, Any]:
        """The whole spec as plain values, with its kind."""
        data = {f.name: getattr(self, f.name) for f in fields(self)}
        for name in ("foot_changes", "policy_params", "terrain_params", "changes"):
            data[name] = {key: _listed(value) for key, value in data[name]}
        data["plan"] = self.plan.to_json()
        data["gait"] = {name: None if v is None else float(v) for name, v in asdict(self.gait).items()}
        data["start"] = list(self.start)
        data["pushes"] = [push.to_json() for push in self.pushes]
        if self.policy is None:
            del data["policy"], data["policy_params"]
        return {"kind": self.kind, **data}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> WalkSpec:
        """The spec that `to_json` wrote, or a shorter one: what is left out has its default.

        Raises:
            UnknownNameError: A key that a spec does not have.
            InputError: A value that cannot be used.
        """
        values = dict(data)
        choose("kind of trial", values.pop("kind", WalkSpec.kind), (WalkSpec.kind,))
        known = [f.name for f in fields(WalkSpec)]
        for name in values:
            if name not in known:
                unknown_name("part of a walk", name, known)
        for name in ("foot_changes", "policy_params", "terrain_params", "changes", "plan", "gait"):
            if name in values and not isinstance(values[name], Mapping):
                raise InputError(
                    f"{name} of a walk must be an object of names and values, got {values[name]!r}"
                )
        if "plan" in values:
            values["plan"] = WalkPlan.from_json(values["plan"])
        if "gait" in values:
            gait = [f.name for f in fields(Gait)]
            for name in values["gait"]:
                if name not in gait:
                    unknown_name("part of the gait", name, gait)
            values["gait"] = Gait(**values["gait"])
        if "pushes" in values:
            pushes = values["pushes"]
            if not isinstance(pushes, (list, tuple)) or not all(isinstance(push, Mapping) for push in pushes):
                raise InputError(f"pushes of a walk must be a list of objects, got {pushes!r}")
            values["pushes"] = tuple(WalkPush.from_json(push) for push in pushes)
        return WalkSpec(**values)


@dataclass(frozen=True, eq=False)
class PreparedWalk:
    """What follows from a spec without a simulator.

    Attributes:
        own: The robot on its own soles, as the plant wants it.
        description: The robot on the feet of the walk, as the controller knows it.
        foot: The foot.
        settings: Settings.
        configuration: How the controller's robot stands at the start, shape (nq,).
        plan: Footsteps, with timings on the grid of the control period.
        nominal_time: How long the walk takes as planned, s.
        notes: What was changed to make it walkable.
    """

    own: RobotDescription
    description: RobotDescription
    foot: Foot
    settings: TrialSettings
    configuration: Array
    plan: FootstepPlan
    nominal_time: float
    notes: tuple[str, ...]

    def robot(self) -> Robot:
        """A robot of its own for a controller, standing at the start."""
        robot = self.description.robot()
        robot.update(self.configuration, np.zeros(robot.nv))
        return robot


@lru_cache(maxsize=256)
def _prepare(
    robot: str,
    foot: Foot,
    plan: WalkPlan,
    gait: Gait,
    settings: TrialSettings,
    period: float,
    start: tuple[float, float, float],
    extent: tuple[float, float, float, float] | None,
    stairs: Terrain | None,
) -> PreparedWalk:
    """Build all that can be built without a simulator, so that it complains of what it cannot use."""
    own = load(robot)
    description = shod(own, foot)
    model = description.robot()
    q = moved(model.half_sitting, start)
    model.update(q, np.zeros(model.nv))
    gait, notes = gait.on_grid(period)
    ground = stairs if stairs is not None else terrain_by_name("flat")
    steps = plan.build(FootstepPlan.standing(model, gait), ground)
    if stairs is not None:
        _ = stairs.surface  # a stair that does not fit into its track says so here
    walking = WalkingControl(model, steps, period, settings, extent=extent)
    check_plan(steps, model, walking.walk.reach, extent)
    swings = len(steps) * (gait.single_support + gait.double_support) - gait.double_support
    time = gait.initial_double_support + swings + gait.final_double_support
    return PreparedWalk(own, description, foot, settings, q, steps, time, notes)


def moved(configuration: Array, start: tuple[float, float, float]) -> Array:
    """A configuration moved over the ground: by x and y (m), and turned about the vertical by a heading (rad)."""
    x, y, yaw = start
    q = np.array(configuration)
    turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array([x, y, 0.0]))
    base = turn * pin.XYZQUATToSE3(q[:7])
    q[:7] = pin.SE3ToXYZQUAT(base)
    return q


@lru_cache(maxsize=256)
def _foot(name: str, stiffness: float | None, changes: Changes) -> Foot:
    design = foot_by_name(name)
    if stiffness is not None:
        if not hasattr(design, "stiffness"):
            raise InputError(f"a {name} foot has no stiffness; leave it out, or take a soft foot")
        design = changed(design, {"stiffness": finite_scalar("sole stiffness (Nm/rad)", stiffness, low=0.0)})
    return changed(design, changes)


def _foot_changes(name: str, changes: Changes) -> Changes:
    normal = normal_changes(foot_by_name(name), changes)
    if any(path == "stiffness" for path, _ in normal):
        raise InputError("the stiffness of a foot is an option of its own, not one of its further parameters")
    return normal


def _as_used(ground: Terrain, params: Changes) -> Changes:
    """Parameters as the ground has them: 1 and 1.0 are the same length."""
    pairs = ((name, getattr(ground.parameters, name, getattr(ground, name, value))) for name, value in params)
    return as_changes(pairs)


def _check_seed(what: str, seed: Any) -> None:
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0 or seed >= 2**63:
        raise InputError(f"{what} must be an integer of at least 0, got {seed!r}")


def _listed(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def time_limit(prepared: PreparedWalk) -> float:
    """Simulated time after which a walk that has neither ended nor fallen is given up, s.

    Half as long again as planned, and 5 s: late touch-downs and feet that wait for their load take time, too.
    """
    return math.ceil(1.5 * prepared.nominal_time + 5.0)
