"""Gaits for robots of any size: what their legs carry and reach."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wbc.core.robot import FULL_HEIGHT, Robot
from wbc.robots import RobotDescription, load
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.walking.control import WalkingControl
from wbc.walking.plans.check import check_plan
from wbc.walking.plans.footsteps import FootstepPlan
from wbc.walking.plans.gait import Gait, StepGait
from wbc.walking.plans.leg import CARRIED, ROOM, Leg
from wbc.walking.plans.planners import walk_distance
from wbc.walking.plans.reach import Reach, sized
from wbc.walking.stepping.settings import RobotSize, SteppingSettings

BIPED = (Path(__file__).parents[2] / "examples" / "biped.urdf").read_text(encoding="utf-8")
FEET = {"left_sole": "left_foot", "right_sole": "right_foot"}
BEND = SteppingSettings().bend


LENGTHS = ("step_length", "swing_height", "landing_height", "search_depth")


def small(factor: float) -> Robot:
    """Return the example's biped at another size: lengths times a factor, masses times its cube."""

    def change(match: re.Match[str]) -> str:
        power = {"xyz": 1, "size": 1, "mass value": 3, "effort": 4}.get(match[1], 5)
        numbers = (f"{float(each) * factor**power:.12g}" for each in match[2].split())
        return f'{match[1]}="{" ".join(numbers)}"'

    origins = re.sub(r'<axis xyz="([^"]*)"', r'<axis way="\1"', BIPED)
    scaled = re.sub(r'(xyz|size|mass value|effort|i[xyz]{2})="([^"]*)"', change, origins)
    return RobotDescription.from_urdf(scaled.replace("<axis way=", "<axis xyz="), **FEET).robot()


def bent(robot: Robot, side: str, tilt: float) -> tuple[np.ndarray, float]:
    """Return the robot on flat soles with shanks that tilt forward by an angle, and the height of its CoM, m."""
    leg = Leg(robot)
    thigh = math.asin(leg.shank * math.sin(tilt) / (leg.length - leg.shank))
    joints = {"hip_pitch": -thigh, "knee": thigh + tilt, "ankle_pitch": -tilt}
    q = robot.configuration(
        {f"{s}_{name}": value for s in ("left", "right") for name, value in joints.items()}
    )
    data = robot.model.createData()
    return q, float(pin.centerOfMass(robot.model, data, q)[2])


def test_only_timings_that_are_given_are_told_to_be_rounded(caplog: pytest.LogCaptureFixture) -> None:
    """A small robot's own times are no multiples of the control period, and nobody has asked for them."""
    description = RobotDescription.from_urdf(BIPED, **FEET)
    for gait, told in ((Gait(), 0), (Gait(single_support=0.801, double_support=0.3), 1)):
        plan = WalkPlan(distance=0.1)
        assert len(WalkSpec(robot=description, gait=gait, plan=plan).prepare().notes) == told
        caplog.clear()
        robot = description.robot()
        steps = walk_distance(FootstepPlan.standing(robot, gait), 0.1)
        WalkingControl(robot, steps, 0.003 if told == 0 else 0.005)
        assert len(caplog.records) == told


def test_the_knee_carries_the_robot_on_one_leg_at_the_height_that_is_derived() -> None:
    """Torque of the knee by Pinocchio, the weight under the ankle, for the posture of that height."""
    robot = RobotDescription.from_urdf(
        BIPED, torque_limits={"left_knee": 30.0, "right_knee": 30.0}, **FEET
    ).robot()
    leg = Leg(robot)
    height = leg.carried_height()
    tilts = np.linspace(0.05, 0.8, 200)
    tilt = tilts[np.argmin([abs(bent(robot, "left", each)[1] - height) for each in tilts])]
    q, com = bent(robot, "left", tilt)
    assert com == pytest.approx(height, abs=5e-3)
    robot.update(q, np.zeros(robot.nv))
    ankle = robot.model.getJointId("left_ankle_pitch")
    jacobian = pin.getJointJacobian(robot.model, robot.data, ankle, pin.LOCAL_WORLD_ALIGNED)
    torque = (robot.bias - jacobian[2] * robot.mass * 9.80665)[6 + leg.knee]
    assert abs(torque) == pytest.approx(CARRIED * 30.0, rel=0.15)


def test_the_ankle_keeps_room_at_the_height_that_is_derived() -> None:
    limits = {f"{side}_ankle_pitch": (-0.45, 0.7) for side in ("left", "right")}
    robot = RobotDescription.from_urdf(BIPED, position_limits=limits, **FEET).robot()
    _, height = bent(robot, "left", 0.45 - ROOM)
    assert Leg(robot).carried_height() == pytest.approx(height, abs=5e-3)
    assert RobotSize.of(robot, BEND).height == Leg(robot).carried_height()


@pytest.mark.parametrize("name", ["hrp4_class", "talos", "g1"])
def test_robots_that_the_gaits_were_made_for_walk_as_before(name: str) -> None:
    robot = load(name).robot()
    assert Leg(robot).carried_height() < RobotSize.of(robot, BEND).height
    assert sized(Gait(), robot) == Gait()


@pytest.mark.parametrize("factor", [0.25, 0.4, 0.7])
def test_the_default_gait_has_the_size_of_the_robot(factor: float) -> None:
    """Lengths as the robot, times and speeds as their root; the default walk is within its reach."""
    robot = small(factor)
    scale = Leg(robot).com_height / FULL_HEIGHT
    gait, default = sized(Gait(), robot).full, StepGait()
    for field in dataclasses.fields(default):
        name, power = field.name, 1.0 if field.name in LENGTHS else 0.5
        if name not in ("apex", "feet_spacing"):
            assert getattr(gait, name) == pytest.approx(getattr(default, name) * scale**power, abs=1e-4)
    check_plan(walk_distance(FootstepPlan.standing(robot, gait), 3.0), Reach.of(robot))
    own = Gait(swing_height=default.swing_height, step_length=0.02)
    kept = sized(own, robot)
    assert (kept.swing_height, kept.step_length) == (default.swing_height, 0.02)


def test_a_default_step_is_within_reach_of_straight_legs() -> None:
    """Legs as in half-sitting with knees bent by 28° reach less than the default step."""
    q = dict.fromkeys(("hip_yaw", "hip_roll", "ankle_roll"), 0.0)
    q |= {"hip_pitch": -math.radians(14.0), "knee": math.radians(28.0), "ankle_pitch": -math.radians(14.0)}
    posture = {f"{side}_{name}": value for side in ("left", "right") for name, value in q.items()}
    robot = RobotDescription.from_urdf(BIPED, half_sitting=posture, **FEET).robot()
    gait = sized(Gait(), robot)
    assert gait.full.step_length < 0.14
    check_plan(walk_distance(FootstepPlan.standing(robot, gait), 3.0), Reach.of(robot))
