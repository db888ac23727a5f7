"""A simulated walk: spec in, result out, with hooks that observe.

result = walk(foot="soft", stiffness=5.0, terrain="stones", amplitude=0.02, seed=7)
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, cast

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError, UnknownNameError, choose
from wbc.core.conventions import rotation_of
from wbc.core.estimation.observer import Observer
from wbc.core.frames import heading
from wbc.core.robot import GRAVITY, Robot
from wbc.feet import RangeSensor
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.ground import KnownGround
from wbc.policy.guard import PolicyGuard
from wbc.sim.plant.eyes import DepthCamera, ToeSensors
from wbc.sim.plant.plant import Plant
from wbc.sim.simulation.simulation import Simulation
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.trial.falls import TrueFallDetector
from wbc.sim.trial.push import PushSchedule
from wbc.sim.trial.threads import one_thread
from wbc.sim.trial.trial import Trial, TrialHook
from wbc.sim.walks.arrival import Arrival, feet_middle
from wbc.sim.walks.meter import LEAST_WAY, StiffnessMeter, WalkMeter
from wbc.sim.walks.plan import Drive, WalkPlan
from wbc.sim.walks.prepare import PreparedWalk, moved_configuration
from wbc.sim.walks.presets import over, plan_over
from wbc.sim.walks.result import WalkResult, objective
from wbc.sim.walks.settings import WalkTrialSettings
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.stiffness_policy import make_policy
from wbc.sim.walks.trained import trained_control, turned
from wbc.tasks.scheduling.policies import PolicyLike
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.walking.control import WalkingControl
from wbc.walking.steered import SteeredControl

PLAN_FIELDS = tuple(f.name for f in fields(WalkPlan))
FIELDS = (*(f.name for f in fields(WalkSpec)), *PLAN_FIELDS)


@checked
def walk(
    spec: WalkSpec | None = None,
    *,
    policy: str | PolicyLike | None = None,
    hooks: Sequence[TrialHook] = (),
    **values: Any,
) -> WalkResult:
    """Simulate a walk, given by a spec, or by the values that differ from the default one; return its result.

        walk(robot="talos", distance=1.5)
        walk(foot="soft", terrain="stones", amplitude=0.02, velocity=(0.1, 0.0, 0.0), steps=20)
        walk(spec, seed=8)

    Args:
        spec: The walk; the default one when None: 3 m on a flat ground.
        policy: Stiffness policy of variable soles: a name, or a policy of your own.
        hooks: Hooks that observe every tick; they do not change the result.
        **values: Fields of `WalkSpec` and `WalkPlan` that differ from the spec, such as robot, foot, terrain or
            distance. What belongs to a value goes with it: another foot drops the stiffness of the old one, another
            ground its amplitude.

    Returns:
        The result. The same spec gives the same record, bit for bit, with any hooks and in any process.
    """
    family = terrain_families().get(str(values.get("terrain", "flat" if spec is None else spec.terrain)))
    for name in values:
        if family is not None and name not in FIELDS and name in {each.name for each in fields(family)}:
            raise UnknownNameError(
                f"no field of a walk '{name}'; it is one of the ground: terrain_params={{'{name}': …}}"
            )
        choose("field of a walk", name, FIELDS)
    kind, below = WalkSpec, dict[str, Any]()
    if spec is not None:
        kind, below = type(spec), {each.name: getattr(spec, each.name) for each in fields(spec)}
    if plan := {name: values.pop(name) for name in PLAN_FIELDS if name in values}:
        if "plan" in values:
            raise InputError(f"give either a plan or {' and '.join(plan)}")
        values["plan"] = WalkPlan(**plan_over(plan, {} if spec is None else vars(spec.plan)))
    if isinstance(policy, str):
        values["policy"], policy = policy, None
    spec = kind(**over(values, below))
    result: WalkResult = WalkTrial(spec, policy=policy, visuals=bool(hooks)).run(hooks)
    return result


class WalkTrial(Trial[Any, WalkResult]):
    """Trial of one walk: plant and controller, connected.

    Attributes:
        spec: The walk.
        meter: Hook that measures the figures of the result. `sole_meter` measures those of variable soles; None without
            such soles.
    """

    @checked
    def __init__(self, spec: WalkSpec, *, policy: PolicyLike | None = None, visuals: bool = True) -> None:
        """Build plant and controller, with a stiffness policy of variable soles in place of the spec's unless None.

        `visuals` are the shapes by which views and films draw the robot; they do not change the walk.
        """
        self._made = time.perf_counter()
        self.spec = spec
        own = getattr(policy, "__name__", type(policy).__name__)
        self._policy = spec.scheduling[0] if policy is None else own
        prepared = self._prepared = spec.prepare()
        with one_thread():
            robot = prepared.robot()
            plant = _plant(spec, prepared, robot, visuals)
            scheduler = _scheduler(spec, prepared, robot, policy)
            walking = _walking(spec, prepared, robot, scheduler)
        planned = walking if isinstance(walking, WalkingControl) else None
        standing_com = float(robot.com[2]) - 0.5 * (prepared.plan.left.z + prepared.plan.right.z)
        walked = None if planned is None else planned.source.com_height
        lowering = max(0.0, standing_com - (standing_com if walked is None else walked))
        super().__init__(plant, walking)
        limits, com = prepared.settings.falls, plant.com_height - self.ground - lowering
        self.falls = TrueFallDetector(plant.robot, com - limits.drop * robot.length_scale, limits.tilt)
        self._drive, self._arrival = Drive(prepared.orders, walking), prepared.arrival()
        self._pushes = PushSchedule(spec.pushes)
        self.scenario += [self._drive, self._pushes]
        self.meter = WalkMeter(plant, walking, spec.ground().surface_areas)
        self.sole_meter = None
        if planned is not None and planned.stiffness is not None:
            self.sole_meter = StiffnessMeter(cast(Plant, plant), planned)
        self.meters += [self.meter] if self.sole_meter is None else [self.meter, self.sole_meter]
        self._origin = feet_middle(plant)
        if self._arrival is not None and planned is not None:
            self.scenario.append(self._arrival)
            if not prepared.plan.steps:
                planned.go_to(*self._arrival.goal)

    @property
    def ground(self) -> float:
        """Height of the lower sole, m."""
        (left, _), (right, _) = self.plant.sole_poses
        return min(float(left[2]), float(right[2]))

    def simulate(self) -> None:
        """Walk to the end, a fall, a stop or the time limit."""
        plant, drive, limit = self.plant, self._drive, self._prepared.time_limit
        while not drive.over and plant.time < limit and self.step():
            pass

    def result(self) -> WalkResult:
        """Return the result of the walk."""
        spec, control, arrival, outcome = self.spec, self.control, self._arrival, self._outcome()
        stiffness = getattr(spec.foot_design(), "stiffness", None)
        fall = None if self.fall is None else self.meter.fall(self.fall.name.lower())
        planned = len(self._prepared.plan) or control.steps_done
        figures = self.meter.figures()
        return WalkResult(
            robot=spec.robot,
            foot=spec.foot,
            sole_stiffness=None if stiffness is None else float(stiffness),
            policy=self._policy,
            terrain=spec.terrain,
            amplitude=spec.ground().amplitude,
            seed=spec.seed,
            outcome=outcome,
            steps_planned=planned,
            steps_done=control.steps_done,
            J=objective(planned - control.steps_done, figures["zmp_error"], figures["com_error"]),
            fell=fall is not None,
            fall_reason=None if fall is None else fall.reason,
            fall=fall,
            diverged=self.diverged,
            seconds=self.plant.time,
            **self._travel(arrival),
            track_error=None if arrival is None else arrival.track_error,
            **figures,
            stiffness=None if self.sole_meter is None else tuple(self.sole_meter.steps()),
            failures=self.drives.failures,
            notes=self._notes(outcome),
            clock=self.clock(None if self.sole_meter is None else self.sole_meter.decision_us()),
        )

    def _outcome(self) -> str:
        """Return how the walk has ended; see `WalkResult`."""
        if self.diverged is not None:
            return "diverged"
        if self.fall is not None:
            return "fell"
        if self.stopped:
            return "stopped"
        if not self._drive.over:
            return "unfinished"
        if self._arrival is None or self._arrival.arrived(feet_middle(self.plant), self._heading()):
            return "completed"
        return "stopped" if self.control.stopped else "strayed"

    def _notes(self, outcome: str) -> tuple[str, ...]:
        """Return what made the walk walkable, why a guard relieved its policy, and which pushes have not begun."""
        reason = self.control.relieved if isinstance(self.control, PolicyGuard) else ""
        relieved = [f"the policy was relieved: {reason}"] if reason else []
        pushes = self._pushes.not_begun if outcome == "completed" else ()
        return (*self._prepared.notes, *relieved, *pushes)

    def _heading(self) -> float:
        """Return the true heading of the pelvis, rad."""
        return heading(rotation_of(np.array(self.plant.base_pose[3:])))

    def _travel(self, arrival: Arrival | None) -> dict[str, Any]:
        """Return the true displacement of the feet, the cost of transport, and the true errors of goal and heading."""
        if not np.isfinite(self.plant.base_pose).all():
            found = dict.fromkeys(("distance", "drift", "yaw_error", "goal_error"), math.nan)
            return found | {"cost_of_transport": None}
        yaw = self.spec.start[2]
        c, s = math.cos(yaw), math.sin(yaw)
        dx, dy = (feet_middle(self.plant) - self._origin).tolist()
        way, weight = math.hypot(dx, dy), self.plant.robot.mass * GRAVITY
        reference = self.control.reference if isinstance(self.control, WalkingControl) else None
        desired = yaw if reference is None else reference.progress.heading
        if self.spec.trained is not None:  # which has no reference
            desired += turned(self._prepared.orders or ())
        return {
            "distance": c * dx + s * dy,
            "drift": c * dy - s * dx,
            "yaw_error": math.remainder(self._heading() - desired, math.tau),
            "goal_error": None if arrival is None else arrival.error(feet_middle(self.plant)),
            "cost_of_transport": float(self.meter.work.sum()) / (weight * way) if way >= LEAST_WAY else None,
        }


def _walking(
    spec: WalkSpec, prepared: PreparedWalk, robot: Robot, scheduler: StiffnessScheduler | None
) -> SteeredControl:
    """Return the controller of a robot that stands at the start."""
    settings = prepared.settings
    observer = Observer(robot, settings.observer, adopt=settings.free)
    observer.reset(prepared.configuration)
    robot.update(prepared.configuration, np.zeros(robot.nv))
    ground = None if spec.eyes == "none" else KnownGround(robot, settings.ground)
    if spec.trained is not None:
        return trained_control(spec.trained, robot, observer, spec.period, ground, spec.guarded)
    return WalkingControl(
        robot,
        prepared.plan,
        spec.period,
        settings,
        observer=observer,
        stiffness=scheduler,
        extent=spec.extent,
        ground=ground,
    )


def _plant(spec: WalkSpec, prepared: PreparedWalk, robot: Robot, visuals: bool) -> Simulation:
    """Return the simulation, its robot where the controller's robot is."""
    range_sensor, eyes = _sensors(spec, prepared.settings)
    plant = spec.simulation(
        prepared.plant_description,
        foot=prepared.foot,
        terrain=spec.ground(),
        range_sensor=range_sensor,
        seed=spec.seed if spec.noise_seed is None else spec.noise_seed,
        physics=prepared.settings.physics,
        scene=spec.things(),
        eyes=eyes,
        visuals=visuals,
    )
    # The soles of the walk's feet may lie elsewhere under the ankles than the robot's own.
    plant_q, controller_q = plant.robot.half_sitting, robot.half_sitting
    shift = (controller_q[0] - plant_q[0], controller_q[1] - plant_q[1], 0.0)
    if any(spec.start) or any(shift):
        plant.reset(plant.on_ground(moved_configuration(moved_configuration(plant_q, shift), spec.start)))
    return plant


def _sensors(
    spec: WalkSpec, settings: WalkTrialSettings
) -> tuple[RangeSensor | None, tuple[DepthCamera | ToeSensors, ...]]:
    """Return the range sensor under each toe, None for soles without a policy, and what sees the ground.

    They are perfect with the sensor noise "none".
    """
    sensors: list[Any] = [] if spec.scheduling[0] is None else [settings.range_sensor]
    if spec.eyes != "none":
        sensors.append(settings.camera if spec.eyes == "depth" else settings.toes)
    if spec.noise == "none":
        errors = ("noise", "relative_noise", "resolution", "dropout")
        sensors = [replace(s, **{name: 0.0 for name in errors if hasattr(s, name)}) for s in sensors]
    ranges = None if spec.scheduling[0] is None else sensors.pop(0)
    return ranges, tuple(sensors)


def _scheduler(
    spec: WalkSpec, prepared: PreparedWalk, robot: Robot, policy: PolicyLike | None
) -> StiffnessScheduler | None:
    """Return the scheduler of the soles' stiffness; None for soles without a stiffness to set."""
    foot, settings = prepared.foot, prepared.settings
    name, parameters = spec.scheduling
    if not isinstance(foot, VariableStiffnessFoot) or name is None:
        if policy is not None:
            raise InputError(f"a stiffness policy needs feet of variable stiffness, got foot '{spec.foot}'")
        return None
    chosen = make_policy(name, parameters, spec.ground()) if policy is None else policy
    return StiffnessScheduler(robot, foot, chosen, settings.stiffness)
