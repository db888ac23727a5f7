"""A simulated walk: a pure function from a spec to a result.

result = run_walk(WalkSpec(foot="soft", stiffness=5.0, terrain="stones", amplitude=0.02, seed=7))
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from wbc.core.errors import Array, InputError, MeasurementError
from wbc.core.estimation.observer import Observer
from wbc.core.robot import Robot
from wbc.feet import RangeSensor, VariableStiffnessFoot
from wbc.sim.plant.plant import Plant
from wbc.sim.walks.hooks import WalkHook, WalkTick
from wbc.sim.walks.meter import WalkMeter
from wbc.sim.walks.policy import make_policy
from wbc.sim.walks.push import WalkPush
from wbc.sim.walks.result import Fall, WalkResult, WallClock, identity, objective
from wbc.sim.walks.settings import TrialSettings
from wbc.sim.walks.soles import SoleMeter
from wbc.sim.walks.spec import PreparedWalk, WalkSpec, moved, time_limit
from wbc.tasks.scheduling.policies import PolicyLike
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.walking.control import WalkingControl
from wbc.walking.falls import FallReason, FallSettings
from wbc.walking.planning.phases import Event


def run_walk(spec: WalkSpec, *, hooks: Sequence[WalkHook] = ()) -> WalkResult:
    """Walk, and say what became of it.

    Args:
        spec: Which robot walks where, and how.
        hooks: Look on; they do not change the result.

    Returns:
        The result. The same spec gives the same record, bit for bit, with any hooks and in any process.
    """
    return WalkTrial(spec).run(hooks)


class WalkTrial:
    """One walk that is about to begin: plant and controller, connected.

    Attributes:
        spec: What it is.
        plant: The plant.
        walking: The controller.
    """

    def __init__(self, spec: WalkSpec, *, policy: PolicyLike | None = None) -> None:
        """Build plant and controller.

        Args:
            spec: What it is.
            policy: Sets soles of variable stiffness in place of the policy that the spec names.

        Raises:
            InputError: A policy for soles without a stiffness to set.
        """
        self._begin = time.perf_counter()
        self.spec = spec
        self._policy = spec.policy if policy is None else _name(policy)
        prepared = self._prepared = spec.prepared()
        with threadpool_limits(1):
            robot = prepared.robot()
            self.plant = Plant(
                prepared.own,
                foot=prepared.foot,
                terrain=spec.ground(),
                timestep=spec.timestep,
                control_period=spec.period,
                noise=spec.noise,
                range_sensor=_range_sensor(spec, prepared.settings),
                seed=spec.seed if spec.noise_seed is None else spec.noise_seed,
                physics=prepared.settings.physics,
            )
            # Where the controller takes it to be: other soles lie elsewhere under the ankles.
            own, worn = self.plant.robot.half_sitting, robot.half_sitting
            shift = (worn[0] - own[0], worn[1] - own[1], 0.0)
            if any(spec.start) or any(shift):
                start = moved(moved(own, shift), spec.start)
                self.plant.reset(self.plant.on_ground(start))
            # Only a walk in torque control needs more of the estimate than where its parts are and how they move.
            adopt = spec.mode == "torque"
            observer = Observer(robot, prepared.settings.observer, adopt=adopt, dynamics=False)
            observer.reset(prepared.configuration)
            robot.update(prepared.configuration, np.zeros(robot.nv))
            height, plan = prepared.settings.com_height, prepared.plan
            over = float(robot.com[2]) - 0.5 * (plan.left.z + plan.right.z)
            sinks = 0.0 if height is None else max(0.0, over - height)
            self.walking = WalkingControl(
                robot,
                prepared.plan,
                spec.period,
                prepared.settings,
                observer=observer,
                stiffness=_stiffness_task(spec, prepared, robot, policy),
            )
        self._meter = WalkMeter(self.plant, self.walking)
        self._soles = None if self.walking.stiffness is None else SoleMeter(self.plant, self.walking)
        self._fallen = TrueFall(self.plant, prepared.settings.falls, sinks)
        self._origin = self._middle()
        self._pushes = list(spec.pushes)
        self._lift_off: dict[int, float] = {}

    def run(self, hooks: Sequence[WalkHook] = ()) -> WalkResult:
        """Walk to the end, a fall or the limit of time; once only.

        Args:
            hooks: Look on.
        """
        with threadpool_limits(1):  # sums that several threads make depend on their number
            return self._run(hooks)

    def _run(self, hooks: Sequence[WalkHook]) -> WalkResult:
        plant, walking, meter, soles = self.plant, self.walking, self._meter, self._soles
        limit = time_limit(self._prepared)
        ticks: list[float] = []
        physics = 0.0
        fall: Fall | None = None
        diverged: str | None = None
        for hook in hooks:
            hook.start(self)
        begin = time.perf_counter()
        looking_on = 0.0
        while not walking.finished and plant.time < limit:
            try:
                measurement = plant.measure()
            except MeasurementError as error:
                diverged = str(error)
                break
            start = time.perf_counter()
            command = walking.command(measurement)
            end = time.perf_counter()
            ticks.append(end - start)
            meter.update(measurement)
            if soles is not None:
                soles.update()
            if hooks:
                tick = WalkTick(plant, walking, measurement, command)
                start = time.perf_counter()
                for hook in hooks:
                    hook.tick(tick)
                looking_on += time.perf_counter() - start
            self._push()
            start = time.perf_counter()
            plant.step(command)
            physics += time.perf_counter() - start
            meter.after_step()
            diverged = plant.diverged
            reason = walking.fallen or (None if diverged else self._fallen.look())
            if reason is FallReason.DIVERGED and diverged is None:
                diverged = f"estimated speeds beyond any robot's before {plant.time:.4f} s"
            if diverged is not None:
                break
            if reason is not None:
                fall = meter.fall(reason.name.lower())
                break
        loop = time.perf_counter() - begin - looking_on
        clock = WallClock(
            wall_s=time.perf_counter() - self._begin,
            real_time_factor=plant.time / loop if loop > 0.0 else math.inf,
            tick_us={
                "median": 1e6 * float(np.median(ticks)) if ticks else math.nan,
                "p99": 1e6 * float(np.percentile(ticks, 99)) if ticks else math.nan,
            },
            physics_share=physics / loop if loop > 0.0 else math.nan,
            decision_us=None if soles is None else soles.decision_us(),
        )
        result = self._result(fall, diverged, clock)
        for hook in hooks:
            hook.end(result)
        return result

    def _result(self, fall: Fall | None, diverged: str | None, clock: WallClock) -> WalkResult:
        walking = self.walking
        if diverged is not None:
            outcome = "diverged"
        elif fall is not None:
            outcome = "fell"
        else:
            outcome = "completed" if walking.finished else "unfinished"
        planned, figures = len(self._prepared.plan), self._meter.figures()
        return WalkResult(
            **(identity(self.spec) | {"policy": self._policy}),
            outcome=outcome,
            steps_planned=planned,
            steps_done=walking.steps_done,
            J=objective(planned - walking.steps_done, figures["zmp_error"], figures["com_error"]),
            fell=fall is not None,
            fall_reason=None if fall is None else fall.reason,
            fall=fall,
            diverged=diverged,
            seconds=self.plant.time,
            **self._travel(),
            **figures,
            stiffness=None if self._soles is None else tuple(self._soles.steps()),
            failures=walking.control.failures,
            notes=self._prepared.notes,
            clock=clock,
        )

    def _middle(self) -> Array:
        """Middle between the true soles, shape (2,), m."""
        model, data = self.plant.model, self.plant.data
        soles = [data.site_xpos[model.site(foot.wrench_site).id, :2] for foot in self.plant.feet]
        return np.asarray(np.mean(soles, axis=0))

    def _travel(self) -> dict[str, Any]:
        """Where the feet have come to, and the heading of the pelvis."""
        q = self.plant.data.qpos
        if not np.isfinite(q[:7]).all():
            return {"distance": math.nan, "drift": math.nan, "yaw_error": math.nan}
        yaw = self.spec.start[2]
        c, s = math.cos(yaw), math.sin(yaw)
        dx, dy = (self._middle() - self._origin).tolist()
        w, i, j, k = q[3:7].tolist()
        heading = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))
        reference = self.walking.reference
        believed = yaw if reference is None else reference.heading
        return {
            "distance": c * dx + s * dy,
            "drift": c * dy - s * dx,
            "yaw_error": math.remainder(heading - believed, 2.0 * math.pi),
        }

    def _push(self) -> None:
        """Start the pushes whose time has come."""
        if not self._pushes:
            return
        reference, now, gait = self.walking.reference, self.plant.time, self._prepared.plan.gait
        if reference is not None and any(e in LIFTED for e in reference.events):
            self._lift_off.setdefault(reference.step + 1, now)
        cycle = gait.single_support + gait.double_support
        for push in list(self._pushes):
            due = push.time
            if due is None:
                assert push.step is not None, "a push has a time or a step"
                due = self._lift_off.get(push.step, math.inf) + push.phase * cycle
            if now >= due - 1e-9:
                self._pushes.remove(push)
                self._apply(push)

    def _apply(self, push: WalkPush) -> None:
        force = push.impulse * self.plant.robot.mass / push.duration
        along = np.array([math.cos(push.direction), math.sin(push.direction), 0.0])
        self.plant.push(push.body, force * along, push.duration)


def _name(policy: PolicyLike) -> str:
    """What a policy that has no name is called."""
    return policy.__name__ if hasattr(policy, "__name__") else type(policy).__name__


def _range_sensor(spec: WalkSpec, settings: TrialSettings) -> RangeSensor | None:
    """The range sensor under each toe; None of soles whose stiffness nobody sets."""
    if spec.policy is None:
        return None
    sensor = settings.range_sensor
    if spec.noise == "none":
        sensor = replace(sensor, noise=0.0, relative_noise=0.0, resolution=0.0, dropout=0.0)
    return sensor


def _stiffness_task(
    spec: WalkSpec, prepared: PreparedWalk, robot: Robot, policy: PolicyLike | None
) -> StiffnessScheduler | None:
    """What sets the soles while they swing; None of soles without a stiffness to set."""
    foot, settings = prepared.foot, prepared.settings
    if not isinstance(foot, VariableStiffnessFoot) or spec.policy is None:
        if policy is not None:
            raise InputError(f"a stiffness policy needs feet of variable stiffness, got foot '{spec.foot}'")
        return None
    chosen = make_policy(spec.policy, spec.policy_params) if policy is None else policy
    # The result tells of every swing, and there may be some more than were planned.
    history = max(settings.stiffness.history, 2 * len(prepared.plan))
    timing = replace(settings.stiffness, sensor_rate=settings.range_sensor.rate, history=history)
    return StiffnessScheduler(robot, foot, chosen, timing)


LIFTED = (Event.LIFT_OFF, Event.FORCED_LIFT_OFF)
"""Events with which a step begins."""


class TrueFall:
    """The controller's fall test on the true state: whoever lies on the floor has fallen, whatever he believes."""

    def __init__(self, plant: Plant, settings: FallSettings, sinks: float = 0.0) -> None:
        """Take the robot as it stands as upright.

        Args:
            plant: The plant, robot standing.
            settings: Limits of height and tilt.
            sinks: How much lower it is to walk than it stands, m.
        """
        self._plant = plant
        self._upright = math.cos(settings.tilt)
        self._sites = [plant.model.site(foot.wrench_site).id for foot in plant.feet]
        self._least = self._height() - sinks - settings.drop

    def look(self) -> FallReason | None:
        """Why the robot has fallen; None if it has not."""
        w, i, j, k = self._plant.data.qpos[3:7].tolist()
        if 1.0 - 2.0 * (i * i + j * j) < self._upright * (w * w + i * i + j * j + k * k):
            return FallReason.TILT
        return FallReason.HEIGHT if self._height() < self._least else None

    def _height(self) -> float:
        """Height of the pelvis over the lower sole, m."""
        data, (one, other) = self._plant.data, self._sites
        places = data.site_xpos
        return float(data.qpos[2]) - min(float(places[one, 2]), float(places[other, 2]))
