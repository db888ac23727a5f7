"""Parts of a walk by its drives: control of the drives, source of references, and tasks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.base.errors import InputError, shown
from wbc.core.drive.control import DriveControl
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import HybridControl, TorqueControl
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.check import Extent, check_plan
from wbc.walking.plans.footsteps import FootstepPlan, check_start
from wbc.walking.plans.leg import Leg
from wbc.walking.plans.reach import Reach
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import ReferenceSource
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.table import free_table, planned_table
from wbc.walking.tasks import WalkTasks

PLANNED, FREE = 0.3, 0.55
"""Distance of the DCM from the nearest sole that no step recovers, as a multiple of the CoM height: by planned steps,
which are adjusted (healthy walks come to 0.25), and by free ones (0.36; 0.48 after a push that was survived)."""

ON_POINTS = InertialSettings(velocity_time_constant=0.2, yaw_time_constant=1000.0)
"""Time constants of the estimate while a robot takes free steps, on feet that hold at points: feet that turn on a stone
say little about velocity and nothing about heading."""


def drive_of(
    controller: Controller, observer: Observer, settings: WalkingControlSettings
) -> PositionControl | TorqueControl:
    """Return the control of the drives in the mode of the settings."""
    s, safety = settings, settings.safety
    if s.mode == "torque":
        return TorqueControl(controller, observer, safety=safety)
    if s.mode == "hybrid":
        return HybridControl(controller, observer, safety=safety)
    return PositionControl(controller, observer, safety=safety, feedforward=s.feedforward)


def source_of(
    robot: Robot,
    source: FootstepPlan | ReferenceSource | None,
    dt: float,
    settings: WalkingControlSettings,
    extent: Extent | None,
) -> ReferenceSource:
    """Return the source of the references: that of the steps of the mode, or the user's own.

    Raises:
        InputError: Free steps in position control; a source that refuses its use; an extent of the ground for a source
            of one's own; a plan that cannot be walked.
    """
    s = settings
    if isinstance(source, ReferenceSource):
        if extent is not None:
            raise InputError(
                f"an extent of the ground is for footsteps, not for {shown(source)}: leave it out"
            )
        if isinstance(source, SteppingWalk) and not s.free:
            raise InputError(f"free steps need torque or hybrid control, got {s.mode} control")
        source.check_use(robot, dt)
        return source
    plan = FootstepPlan.standing(robot) if source is None else source
    if not s.free:
        return planned_walk(robot, plan, dt, s, extent)
    gait = SteppingWalk.of(robot, dt, s.stepping, s.com_height, extent)
    check_start(robot, plan)
    check_plan(plan, gait.reach or Reach.of(robot), extent)
    return gait


def planned_walk(
    robot: Robot, plan: FootstepPlan, dt: float, settings: WalkingControlSettings, extent: Extent | None
) -> LipmWalk:
    """Return a walk along a plan, which stands until it is steered where the plan has no steps.

    Raises:
        InputError: A plan that cannot be walked or begins elsewhere.
    """
    check_start(robot, plan)
    s, reach, height = settings, None, settings.com_height
    if height is None:
        height = float(robot.com[2]) - 0.5 * (plan.left.z + plan.right.z)
        height = height if plan.steps else min(height, Leg(robot).bent_height(s.drive.stretch))
    if not plan.steps:
        # Bent knees reach further ahead; to the side ankles must roll by what the robot sways.
        reach = replace(Reach.of(robot, height), max_spacing=Reach.of(robot).max_spacing)
    com = np.array(robot.com)
    return LipmWalk(robot, plan, height, dt, s.walk, drive=s.drive, reach=reach, extent=extent, com=com)


def tune(control: DriveControl, source: ReferenceSource) -> None:
    """Tune the detector of falls to the steps of a source, and time constants that are the defaults."""
    control.dcm_limit = PLANNED
    if isinstance(source, SteppingWalk):
        control.dcm_limit = FREE
        given, usual = vars(control.observer.inertial.settings), vars(InertialSettings())
        own = {name: value for name, value in given.items() if value != usual[name]}
        control.observer.retune(replace(ON_POINTS, **own))


def tasks_of(controller: Controller, source: ReferenceSource, settings: WalkingControlSettings) -> WalkTasks:
    """Return the tasks for a source, in the controller."""
    s, robot = settings, controller.robot
    if isinstance(source, SteppingWalk):
        return WalkTasks(controller, free_table(robot, source))
    return WalkTasks(controller, planned_table(robot, s.tasks, s.distribution, torque=s.mode != "position"))


def height_of(robot: Robot, source: ReferenceSource) -> float:
    """Return the height of the CoM over the soles by a source of references, m; that of the robot where it has none."""
    if source.com_height is not None:
        return source.com_height
    left, right = (float(robot.placement(sole.frame).translation[2]) for sole in robot.soles)
    return float(robot.com[2]) - 0.5 * (left + right)
