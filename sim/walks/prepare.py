"""Everything that follows from a walk's spec without a simulator: robot descriptions, footsteps, settings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.frames import yaw_rotation
from wbc.core.robot import Robot
from wbc.feet import Foot
from wbc.robots.description import RobotDescription
from wbc.sim.plant.fitting import with_feet
from wbc.sim.terrain.spec import Terrain
from wbc.sim.terrain.spec import terrain as terrain_by_name
from wbc.sim.walks.arrival import Arrival
from wbc.sim.walks.plan import TooFastError, WalkPlan, check_velocity
from wbc.sim.walks.settings import WalkTrialSettings
from wbc.walking.control import WalkingControl
from wbc.walking.plans.check import OutOfReachError
from wbc.walking.plans.footsteps import FootstepPlan, mean_heading
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.reach import sized
from wbc.walking.stepping.gait import SteppingWalk


@dataclass(frozen=True, eq=False)
class PreparedWalk:
    """Everything that follows from a spec without a simulator.

    Attributes:
        way: Footsteps that lead to the goal: those of the plan; a walk with free steps takes the last ones as its goal,
            unless footsteps or stairs are given.
        orders: Velocities over time, as rows of `WalkPlan.drive`; None for a walk along a plan or to a goal.
    """

    plant_description: RobotDescription  # the robot on its own soles, for the plant
    controller_description: RobotDescription  # the robot on the feet of the walk, for the controller
    foot: Foot
    settings: WalkTrialSettings
    configuration: Array  # configuration of the controller's robot at the start, shape (nq,)
    plan: FootstepPlan  # footsteps, with timings on the grid of the control period; none of free steps to a goal
    way: FootstepPlan
    orders: tuple[tuple[float, float, float, float], ...] | None
    nominal_time: float  # duration of the walk as planned, s
    notes: tuple[str, ...]  # changes that made it walkable

    def robot(self) -> Robot:
        """Return a new robot for a controller, standing at the start."""
        robot = self.controller_description.robot()
        robot.update(self.configuration, np.zeros(robot.nv))
        return robot

    def arrival(self) -> Arrival | None:
        """Return the goal and the track of the plan; None for a walk that is driven, which has neither."""
        plan = self.way
        if self.orders is not None or not plan.steps:
            return None
        left, right = plan.final
        x, y, _ = (0.5 * (left.position + right.position)).tolist()
        stands = [(plan.left, plan.right), *((plan.stance(i), step) for i, step in enumerate(plan.steps))]
        track = [(0.5 * (a.x + b.x), 0.5 * (a.y + b.y)) for a, b in stands]
        return Arrival((x, y, mean_heading(left.yaw, right.yaw)), track)

    @property
    def time_limit(self) -> float:
        """Simulated time after which a walk that has neither ended nor fallen is stopped, s.

        Half as long again as planned, and 5 s: late touch-downs and feet that wait for their load take time, too.
        """
        return math.ceil(1.5 * self.nominal_time + 5.0)


@lru_cache(maxsize=256)
def prepare(
    *,
    robot: RobotDescription,
    servo: tuple[str, ...],
    foot: Foot,
    plan: WalkPlan,
    gait: Gait,
    settings: WalkTrialSettings,
    period: float,
    start: tuple[float, float, float],
    extent: tuple[float, float, float, float] | None,
    stairs: Terrain | None,
) -> PreparedWalk:
    """Build and check all that needs no simulator; see `WalkSpec.prepare`."""
    plant_description = robot.with_servos(servo)
    description = with_feet(plant_description, foot)
    model = description.robot()
    q = moved_configuration(model.half_sitting, start)
    model.update(q, np.zeros(model.nv))
    ground = stairs if stairs is not None else terrain_by_name("flat")
    _, notes = gait.on_grid(period)  # what follows from the robot's size is rounded silently
    gait, _ = sized(gait, model).on_grid(period)
    steps = plan.build(FootstepPlan.standing(model, gait), ground)
    step_gait, _ = steps.gait.full.on_grid(period)  # that of a velocity, and defaults
    if stairs is not None:
        _ = stairs.surface  # raises if a stair does not fit into its track
    given = plan.footsteps is not None or plan.stairs is not None
    free = settings.free
    walked = steps if given or not free else replace(steps, steps=())
    try:
        if plan.velocity is not None and not free:
            check_velocity(plan.velocity, settings.drive.limits, "planned steps", together=True)
        walking = WalkingControl(model, walked, period, settings, extent=extent)
    except OutOfReachError as error:
        if plan.velocity is None or free:
            raise
        advice = "free steps walk faster: mode='torque', or wbc walk --mode torque"
        raise TooFastError(f"{error}; {advice}") from None
    if isinstance(walking.source, SteppingWalk):
        if plan.velocity is not None:
            check_velocity(plan.velocity, walking.velocity_limits, f"steps of '{model.name}'")
        orders, time = _orders(plan, steps, walking.source)
    else:
        cycle = step_gait.cycle
        swings = len(steps) * cycle - step_gait.double_support
        orders, time = plan.drive, swings + step_gait.initial_double_support + step_gait.final_double_support
        if plan.drive is not None:
            time = plan.drive[-1][0] + 2.0 * cycle + step_gait.final_double_support
    return PreparedWalk(plant_description, description, foot, settings, q, walked, steps, orders, time, notes)


def _orders(
    plan: WalkPlan, way: FootstepPlan, source: SteppingWalk
) -> tuple[tuple[tuple[float, float, float, float], ...] | None, float]:
    """Return the velocities of a walk with free steps, None for the goal at the end of `way`, and its time, s."""
    s, shift = source.settings, source.constants.stand.shift_time
    pause = shift + 8.0 * s.slow_time  # to set off and to stop
    orders = plan.drive
    if plan.velocity is not None and plan.steps is not None:
        end = shift + plan.steps * s.slow_time
        orders = ((0.0, *plan.velocity), (end, 0.0, 0.0, 0.0))
    if orders is not None:
        return orders, orders[-1][0] + pause
    if plan.footsteps is not None or plan.stairs is not None:
        return None, len(way) * s.slow_time + pause
    left, right = way.final
    length = math.dist(0.5 * (left.position + right.position), 0.5 * (way.left.position + way.right.position))
    turn = abs(math.remainder(mean_heading(left.yaw, right.yaw) - way.left.yaw, math.tau))
    return None, length / (0.7 * s.cruise) + 2.0 * turn / s.fastest_turn + pause


def moved_configuration(configuration: Array, start: tuple[float, float, float]) -> Array:
    """Return a configuration moved over the ground by x and y (m), and turned about the vertical by a heading (rad)."""
    x, y, yaw = start
    q = np.array(configuration)
    turn = pin.SE3(yaw_rotation(yaw), np.array([x, y, 0.0]))
    base = turn * pin.XYZQUATToSE3(q[:7])
    q[:7] = pin.SE3ToXYZQUAT(base)
    return q
