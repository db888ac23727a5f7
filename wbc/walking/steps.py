"""Parts of a walk by the kind of its steps: source of references, tasks, balance, estimate, and the drives under both.

The controller has the tasks of one kind at a time. Each kind is made in a function of its own.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np

from wbc.base.errors import InputError, shown
from wbc.core.drive.control import FEET_AS_PLANNED, FEET_STEP, DriveControl
from wbc.core.drive.hybrid import HybridControl
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.tasks.stabilizer.task import StabilizerTask
from wbc.walking.balance import Balance
from wbc.walking.hands.reaching import Arms
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.footsteps import FootstepPlan, check_start
from wbc.walking.plans.reach import Extent, Leg, Reach, check_plan
from wbc.walking.settings import Kind, WalkingControlSettings
from wbc.walking.source import ReferenceSource
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.table import free_table, planned_table
from wbc.walking.tasks import WalkTasks

ON_POINTS = InertialSettings(velocity_time_constant=0.2, yaw_time_constant=1000.0)
"""Time constants of the estimate while a robot takes free steps, on feet that hold at points: feet that turn on a stone
say little about velocity and nothing about heading."""


class Steps(NamedTuple):
    """Parts that one kind of steps has for itself.

    Attributes:
        source: Source of the references.
        tasks: Tasks and contacts, with weights, gains and boxes.
        balance: Feedback of the stabilizer; None where steps balance the robot.
        estimate: Time constants of the estimate.
        dcm_limit: Distance of the DCM from the soles from which on nothing recovers, over the height of the CoM.
    """

    source: ReferenceSource
    tasks: WalkTasks
    balance: Balance | None
    estimate: InertialSettings
    dcm_limit: float


def drive_of(
    controller: Controller, observer: Observer, settings: WalkingControlSettings
) -> PositionControl | TorqueControl:
    """Return the control of the drives in the mode of the settings."""
    s, safety = settings, settings.safety
    if s.mode == "torque":
        return TorqueControl(controller, observer, safety=safety)
    if s.mode == "hybrid":
        return HybridControl(controller, observer, safety=safety)
    if s.step_kind == "free":
        # References that lag behind the estimate hold ankles and soles against the ground that they stand on.
        period = controller.dt
        return PositionControl(controller, observer, safety=safety, feedback="closed", reference_time=period)
    return PositionControl(controller, observer, safety=safety, feedforward=s.feedforward)


def steps_of(
    control: DriveControl,
    arms: Arms,
    source: FootstepPlan | ReferenceSource | None,
    settings: WalkingControlSettings,
    extent: Extent | None,
) -> dict[Kind, Steps]:
    """Return the parts of all kinds of steps that a robot may take, none of them in the controller yet.

    Raises:
        InputError: Free steps for a source of references that a stabilizer has to hold.
    """
    s, robot, dt = settings, control.controller.robot, control.controller.dt
    if isinstance(source, ReferenceSource):
        if isinstance(source, SteppingWalk) or s.step_kind == "free":
            raise InputError(
                f"a stabilizer balances the robot along {shown(source)}: free steps take a plan, or None"
            )
        return {"planned": _planned(control, arms, source, s)}
    plan, steps = source or FootstepPlan.standing(robot), dict[Kind, Steps]()
    if "free" in s.kinds:
        gait = SteppingWalk.of(robot, dt, s.stepping, s.com_height, extent)
        check_start(robot, plan)
        check_plan(plan, gait.reach or Reach.of(robot), extent)
        steps["free"] = _free(control, gait)
        plan = plan if plan.climbs else replace(plan, steps=())
    if "planned" in s.kinds:
        steps["planned"] = _planned(control, arms, planned_walk(robot, plan, dt, s, extent), s)
    return steps


def planned_walk(
    robot: Robot, plan: FootstepPlan, dt: float, settings: WalkingControlSettings, extent: Extent | None
) -> LipmWalk:
    """Return a walk along a plan, which stands until it is steered where the plan has no steps.

    Raises:
        InputError: A plan that cannot be walked or begins elsewhere.
    """
    check_start(robot, plan)
    s, reach = settings, None
    height = (
        float(robot.com[2]) - 0.5 * (plan.left.z + plan.right.z) if s.com_height is None else s.com_height
    )
    if not plan.steps:
        if s.com_height is None:
            height = min(height, Leg(robot).bent_height(s.drive.stretch))
        # Bent knees reach further ahead; to the side ankles must roll by what the robot sways.
        reach = replace(Reach.of(robot, height), max_spacing=Reach.of(robot).max_spacing)
    com = np.array(robot.com)
    return LipmWalk(robot, plan, height, dt, s.walk, drive=s.drive, reach=reach, extent=extent, com=com)


def _planned(
    control: DriveControl, arms: Arms, source: ReferenceSource, settings: WalkingControlSettings
) -> Steps:
    """Return the parts of planned steps, on which a stabilizer balances the robot."""
    s, controller, observer = settings, control.controller, control.observer
    robot, torque = controller.robot, s.mode != "position"
    tasks = WalkTasks(
        controller, planned_table(robot, s.tasks, s.gains, s.distribution, observer.robot, torque=torque)
    )
    assert isinstance(tasks.com, StabilizerTask)
    balance = Balance(control, tasks.com, arms, s, com_height(robot, source))
    tasks.leave()
    return Steps(source, tasks, balance, observer.inertial.settings, FEET_AS_PLANNED)


def _free(control: DriveControl, source: SteppingWalk) -> Steps:
    """Return the parts of free steps, which balance the robot."""
    controller, given = control.controller, control.observer.inertial.settings
    tasks = WalkTasks(controller, free_table(controller.robot, source))
    tasks.leave()
    return Steps(source, tasks, None, _tuned(ON_POINTS, given), FEET_STEP)


def com_height(robot: Robot, source: ReferenceSource) -> float:
    """Return the height of the CoM over the soles by a source of references, m; that of the robot where it has none."""
    if source.com_height is not None:
        return source.com_height
    left, right = (float(robot.placement(sole.frame).translation[2]) for sole in robot.soles)
    return float(robot.com[2]) - 0.5 * (left + right)


def _tuned(own: InertialSettings, given: InertialSettings) -> InertialSettings:
    """Return time constants of steps, but those that are given and not the defaults."""
    usual = InertialSettings()
    set_ = {
        f.name: value for f in fields(given) if (value := getattr(given, f.name)) != getattr(usual, f.name)
    }
    return replace(own, **set_)
