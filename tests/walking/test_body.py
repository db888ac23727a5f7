"""Set-points of the body of a robot that walks: what is set is reached, slowly, and what cannot be is refused."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wbc import load_robot
from wbc.base.errors import InputError
from wbc.core.drive.control import State
from wbc.core.frames import heading
from wbc.core.robot import GRAVITY, Robot
from wbc.robots import RobotDescription
from wbc.sim import Plant
from wbc.sim.trial.falls import TrueFallDetector
from wbc.tasks.stabilizer.lean import LeanMotion
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings, walk_distance
from wbc.walking.body import ACCELERATION, SPEED, TURN_ACCELERATION, TURN_SPEED, lowest_com
from wbc.walking.contact import GaitPhase
from wbc.walking.plans.leg import Leg
from wbc.walking.source import Reference, StandSource, WholeBody
from wbc.walking.stepping.gait import SteppingWalk

DT, ROOT = 0.005, Path(__file__).resolve().parents[2]


def standing(name: str = "hrp4_class", kind: str = "lipm") -> tuple[Plant, WalkingControl]:
    plant = Plant(
        load_robot(name), noise="realistic", control_period=DT if kind == "lipm" else 0.002, visuals=False
    )
    robot = plant.description.robot()
    if kind == "lipm":
        return plant, WalkingControl(robot, FootstepPlan.standing(robot), DT)
    return plant, WalkingControl(robot, None, plant.control_period, WalkingControlSettings(mode="torque"))


def upright(plant: Plant) -> bool:
    return not TrueFallDetector(plant.robot).fallen(plant.truth().q)


@pytest.mark.parametrize("kind", ["lipm", pytest.param("stepping", marks=pytest.mark.slow)])
def test_height_lean_turn_and_gaze_are_reached_with_bounded_speed(kind: str) -> None:
    plant, walking = standing("g1" if kind == "stepping" else "hrp4_class", kind)
    body, real = walking.body, plant.description.robot()
    assert not body.active and body.reached and not body.looking
    start = 0.1 if kind == "lipm" else 1.5  # a stepping walk has bent its legs by then
    while plant.time < start:
        plant.step(walking.command(plant.measure()))
    before = float(plant.truth().com[2])
    down = 0.04 if kind == "lipm" else 0.02
    body.com_height -= down
    body.lean, body.turn = (0.0, 0.1), 0.15
    body.look_at([3.0, 1.5, 1.0])
    assert body.active and not body.reached
    speeds = []
    while plant.time < start + 1.7:
        plant.step(walking.command(plant.measure()))
        speeds.append(abs(float(plant.truth().v[2])))
    assert body.reached and upright(plant) and walking.fallen is None
    truth = plant.truth()
    real.update(truth.q, truth.v)
    turned = pin.rpy.matrixToRpy(real.placement(real.torso_frame).rotation)
    assert float(truth.com[2]) - before == pytest.approx(-down, abs=0.01)
    assert max(speeds) < 0.25
    assert turned[1] == pytest.approx(0.1, abs=0.05)
    assert body.looking
    if kind == "stepping":  # without a neck the waist looks
        assert turned[2] == pytest.approx(np.arctan2(1.5, 3.0), abs=0.06)
    else:
        assert turned[2] == pytest.approx(0.15, abs=0.05)
        eye = real.placement("head")
        ahead = eye.actInv(np.array([3.0, 1.5, 1.0]))
        assert np.hypot(*ahead[1:]) / ahead[0] < 0.08


class WholeBodyStand(StandSource):
    """A stand that gives the motion of all joints: the posture at the start, and an upright trunk."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        still, upright = np.zeros(robot.na), (np.eye(3), np.zeros(3), np.zeros(3))
        self.body = WholeBody(np.zeros(3), [upright, upright], robot.q[7:].copy(), still, still)

    def update(self, state: State) -> Reference:
        return super().update(state)._replace(body=self.body)


def test_a_trunk_turns_and_leans_along_a_source_that_gives_all_joints_too() -> None:
    plant = Plant(load_robot("hrp4_class"), control_period=DT, visuals=False)
    robot = plant.description.robot()
    walking = WalkingControl(robot, WholeBodyStand(robot), DT)
    walking.body.turn, walking.body.lean = 0.2, (0.0, 0.1)
    for _ in range(260):
        plant.step(walking.command(plant.measure()))
    assert walking.body.reached
    turned = pin.rpy.matrixToRpy(robot.placement(robot.torso_frame).rotation)
    np.testing.assert_allclose(turned, [0.0, 0.1, 0.2], atol=0.03)


def test_what_the_body_adds_to_a_reference_moves_as_its_rates_say() -> None:
    """Height, lean in the heading and twist, all on their way at once."""
    _, walking = standing()
    body, heading = walking.body, 0.7
    body.com_height -= 0.02
    body.lean, body.turn = (0.05, -0.12), -0.2
    assert body.lean == (0.05, -0.12) and body.turn == -0.2
    rest, tilted = Pendulum.at_rest(np.array([0.1, 0.2, 0.8])), pin.exp3(np.array([0.0, 0.02, 0.0]))
    leaning, before = LeanMotion(tilted, np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.3, 0.0])), None
    for _ in range(600):
        body.update(heading)
        pendulum, lean, twist = body.raised(rest), body.leaned(leaning, heading), body.twist
        if before is not None:
            height, trunk, angle = before
            rise, turning = pendulum.com_velocity - height.com_velocity, lean.velocity - trunk.velocity
            np.testing.assert_allclose(pendulum.com - height.com, DT * pendulum.com_velocity, atol=1e-7)
            np.testing.assert_allclose(rise, DT * pendulum.com_acceleration, atol=2e-6)
            np.testing.assert_allclose(
                pin.log3(lean.rotation @ trunk.rotation.T) / DT, lean.velocity - leaning.velocity, atol=2e-2
            )
            np.testing.assert_allclose(turning, DT * (lean.acceleration - leaning.acceleration), atol=2e-6)
            assert twist.angle - angle.angle == pytest.approx(DT * twist.rate, abs=1e-7)
            assert twist.rate - angle.rate == pytest.approx(DT * twist.acceleration, abs=2e-6)
        before = pendulum, lean, twist
    assert body.reached and twist == (pytest.approx(-0.2), 0.0, 0.0, True)
    np.testing.assert_allclose(pendulum.com, [0.1, 0.2, 0.78])
    turned = (
        pin.utils.rotate("z", heading)
        @ pin.exp3(np.array([0.05, -0.12, 0.0]))
        @ pin.utils.rotate("z", -heading)
    )
    np.testing.assert_allclose(lean.rotation, tilted @ turned, atol=1e-12)


def test_a_trunk_that_turns_on_its_hips_does_not_bend_the_way() -> None:
    """The pelvis may face aside by what it is to be turned: the heading of the walk is no other than without."""
    description = RobotDescription.from_mjcf(ROOT / "examples" / "biped.xml")
    plant = Plant(description, control_period=0.004, visuals=False)
    robot = description.robot()
    walking = WalkingControl(robot, None, 0.004, WalkingControlSettings(mode="torque"))
    walking.body.turn, walking.velocity = 0.3, (0.2, 0.0, 0.0)
    aside = []
    while plant.time < 2.4:
        plant.step(walking.command(plant.measure()))
        if plant.time > 1.4:
            aside.append(heading(robot.placement(robot.base_frame).rotation))
            assert walking.reference is not None and walking.reference.progress.heading == pytest.approx(
                0.0, abs=1e-9
            )
    assert upright(plant) and max(aside) > 0.3 and np.mean(aside) == pytest.approx(0.3, abs=0.03)


def walk_and_stop(plant: Plant, walking: WalkingControl) -> None:
    """Walk in a curve for six seconds and stop, without a fall."""
    walking.velocity = (0.2, 0.0, 0.1)
    while plant.time < 8.0:
        if plant.time > 6.0:
            walking.velocity = None
        plant.step(walking.command(plant.measure()))
    assert upright(plant) and walking.fallen is None and walking.steps_done >= 4


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hrp4_class", "talos", "g1"])
@pytest.mark.parametrize("where", [(1.0, 3.0, 0.3), (-2.0, 0.5, 2.5), (0.3, 0.0, 0.1)])
def test_a_gaze_anywhere_makes_no_walk_fall(name: str, where: tuple[float, float, float]) -> None:
    plant, walking = standing(name)
    walking.body.look_at(where)
    walk_and_stop(plant, walking)


@pytest.mark.slow
@pytest.mark.parametrize("where", [(-2.0, 0.5, 1.0), (-2.0, -0.5, 1.0), (1.0, 3.0, 0.3)])
def test_a_gaze_anywhere_makes_no_walk_by_steps_fall(where: tuple[float, float, float]) -> None:
    """Without a bound the torso of g1 whirled when the point went past its back, and it fell in six walks of six."""
    plant, walking = standing("g1", "stepping")
    walking.body.look_at(where)
    walking.velocity = (0.3, 0.0, -0.2)
    while plant.time < 7.5:
        plant.step(walking.command(plant.measure()))
    assert upright(plant) and walking.fallen is None and walking.steps_done >= 10
    walking.body.look_at(None)
    while walking.body.active and plant.time < 14.0:
        plant.step(walking.command(plant.measure()))
    assert upright(plant) and walking.body.turn == 0.0 and walking.body.reached


def test_a_walk_leaves_its_legs_the_room_to_lift_a_foot() -> None:
    """The ankle of g1 meets its limit at the top of a swing: lowered by 50 mm it fell when it came to a stand."""
    _, walking = standing("g1")
    body, height = walking.body, walking.body.com_height
    body.com_height = height - 0.08  # a squat of a robot that stands
    walking.velocity = (0.0, 0.0, 0.0)
    too_low = r"com_height \(m\) of 'g1', as far as its legs bend and lift a foot by 60 mm in a walk"
    for order in (
        lambda: setattr(walking, "velocity", (0.2, 0.0, 0.1)),
        lambda: walking.go_to(1.0, 0.0, 0.0),
        lambda: walking.follow(FootstepPlan.standing(walking.controller.robot)),
    ):
        with pytest.raises(InputError, match=too_low):
            order()
    body.com_height = height - 0.03
    walking.velocity = (0.2, 0.0, 0.1)
    with pytest.raises(InputError, match=too_low):
        body.com_height = height - 0.05
    assert body.com_height == pytest.approx(height - 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hrp4_class", "talos", "g1"])
def test_a_walk_as_low_as_may_be_comes_to_a_stand(name: str) -> None:
    plant, walking = standing(name)
    body = walking.body
    robot = walking.controller.robot
    body.com_height = max(lowest_com(robot) + walking.source.lift_room, body.com_height - 0.08)
    walk_and_stop(plant, walking)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hrp4_class", "talos", "g1"])
def test_free_steps_lift_their_feet_from_the_lowest_body(name: str) -> None:
    """Legs need no room over the lowest CoM: the foot in the air tilts a little where its ankle meets its limit."""
    plant, walking = standing(name, "stepping")
    robot, source = walking.controller.robot, walking.source
    assert isinstance(source, SteppingWalk)
    lowest, lifted = lowest_com(robot), 0.0
    with pytest.raises(InputError, match=rf"com_height \(m\) of '{name}', as far as its legs bend, must be"):
        walking.body.com_height = lowest - 1e-3
    walking.body.com_height = lowest
    falls, real = TrueFallDetector(plant.robot, 0.8 * lowest), plant.description.robot()
    while plant.time < 9.0:
        if 3.0 < plant.time < 7.0:
            walking.velocity = (0.3, 0.0, 0.1)
        elif plant.time > 7.0:
            walking.velocity = None
        plant.step(walking.command(plant.measure()))
        truth = plant.truth()
        assert not falls.fallen(truth.q)
        if plant.time < 7.0:
            real.update(truth.q, truth.v)
            left, right = (float(real.placement(sole.frame).translation[2]) for sole in real.soles)
            lifted = max(lifted, abs(left - right))
    assert walking.fallen is None and walking.finished and walking.steps_done >= 4
    assert float(plant.truth().com[2]) < lowest + 0.02
    assert 0.85 * source.settings.swing_height < lifted < 1.2 * source.settings.swing_height


@pytest.mark.slow
def test_a_low_body_walks_a_plan_that_is_given_on_the_way() -> None:
    plant, walking = standing("g1", "stepping")
    body, lowest = walking.body, lowest_com(walking.controller.robot)
    walking.velocity = (0.1, 0.0, 0.0)
    body.com_height = lowest + 0.01
    while walking.progress.phase is not GaitPhase.SINGLE or plant.time < 2.0:
        plant.step(walking.command(plant.measure()))
    walking.follow(walk_distance(FootstepPlan.standing(walking.drives.observer.robot), 0.3))
    while not walking.done and plant.time < 12.0:
        plant.step(walking.command(plant.measure()))
        assert not walking.drives.failing
    assert walking.finished
    assert float(plant.truth().com[2]) < lowest + 0.03


def test_the_lowest_height_is_one_that_the_legs_reach() -> None:
    for name in ("hrp4_class", "talos", "g1"):
        robot = load_robot(name).robot()
        leg = Leg(robot)
        lowest = lowest_com(robot)
        assert lowest < leg.com_height - 0.08
        assert reached_by_the_legs(robot, lowest + 0.005) and not reached_by_the_legs(robot, lowest - 0.005)


def reached_by_the_legs(robot: Robot, com_height: float) -> bool:
    """Return true if legs on standing soles reach a CoM height within their limits less 0.05 rad, by Newton steps."""
    model, data, q = robot.model, robot.model.createData(), robot.half_sitting.copy()
    pin.framesForwardKinematics(model, data, q)
    legs = [
        (robot.frame_id(sole.frame), np.array(robot.joints_between(sole.frame, robot.base_frame)))
        for sole in robot.soles
    ]
    places = [pin.SE3(data.oMf[frame]) for frame, _ in legs]
    for _ in range(200):
        for (frame, joints), place in zip(legs, places, strict=True):
            rows = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)[:, 6 + joints]
            pin.framesForwardKinematics(model, data, q)
            q[7 + joints] += np.linalg.lstsq(rows, pin.log6(data.oMf[frame].actInv(place)).vector)[0]
        height = pin.centerOfMass(model, data, q)[2] - places[0].translation[2]
        q[2] -= np.clip(height - com_height, -0.01, 0.01)
    legs_at = np.concatenate([joints for _, joints in legs])
    low, high = robot.position_lower + 0.05, robot.position_upper - 0.05
    inside = (q[7 + legs_at] > low[legs_at]).all() and (q[7 + legs_at] < high[legs_at]).all()
    return bool(inside and abs(height - com_height) < 1e-4)


def test_a_lowered_pendulum_moves_as_its_height_says() -> None:
    """c̈ = ω² (c − z) with ω² = g/h of the height that is set, and the horizontal motion as planned."""
    _, walking = standing()
    body = walking.body
    body.com_height -= 0.03
    for _ in range(2000):
        body.update(0.0)
    com, zmp = np.array([0.02, -0.05, 0.8]), np.array([0.1, 0.01, 0.0])
    omega = np.sqrt(GRAVITY / 0.8)
    planned = Pendulum(
        com, np.array([0.2, 0.1, 0.0]), np.append(omega**2 * (com - zmp)[:2], 0.0), zmp, np.zeros(3), omega
    )
    lowered = body.raised(planned)
    assert lowered.omega == pytest.approx(np.sqrt(GRAVITY / 0.77))
    np.testing.assert_allclose(lowered.com_acceleration[:2], planned.com_acceleration[:2])
    arm = (lowered.com - lowered.zmp)[:2]
    np.testing.assert_allclose(lowered.com_acceleration[:2], lowered.omega**2 * arm, atol=1e-9)


def test_a_set_point_that_is_taken_back_on_its_way_makes_nothing_jump() -> None:
    """The rate goes through zero there; it changes by no more than its acceleration, at its bounded speed."""
    _, walking = standing()
    body, places = walking.body, []
    before = body.com_height
    for tick in range(900):
        if tick % 300 == 0:
            body.com_height = before - (0.06 if tick == 0 else 0.0)
            body.lean, body.turn = ((0.1, -0.1), 0.2) if tick == 0 else ((0.0, 0.0), 0.0)
        if tick == 60:
            body.com_height, body.lean, body.turn = before, (0.0, 0.0), 0.0
        body.update(0.0)
        rest = Pendulum.at_rest(np.array([0.0, 0.0, 0.8]))
        lean = pin.log3(body.leaned(LeanMotion(np.eye(3), np.zeros(3), np.zeros(3)), 0.0).rotation)
        places.append([body.raised(rest).com[2], *lean[:2], body.twist.angle])
    rates = np.diff(places, axis=0) / DT
    pushes = np.diff(rates, axis=0) / DT
    assert np.abs(rates[:, 0]).max() < SPEED + 1e-9 and np.abs(pushes[:, 0]).max() < ACCELERATION + 1e-6
    assert np.abs(rates[:, 1:]).max() < TURN_SPEED and np.abs(pushes[:, 1:]).max() < 1.01 * TURN_ACCELERATION
    assert np.abs(rates).min(axis=1).max() > 0.0 and not np.any(rates[-50:])


@pytest.mark.parametrize("heading", [0.0, 2.9])
def test_a_trunk_without_a_neck_turns_to_a_point_as_far_as_it_goes(heading: float) -> None:
    """By the direction of the point from the CoM less the heading; behind the robot it stays on its side."""
    plant = load_robot("g1")
    robot = plant.robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), DT)
    body, com = walking.body, np.array(robot.com)
    most = body._most_turn
    far = most + 0.3
    turns = ((0.2, 0.2), (far, most), (-0.3, -0.3), (-far, -most), (far, -most), (0.0, 0.0), (-far, -most))
    for angle, turn in (*turns, (0.0, 0.0)):
        way = heading + angle
        body.look_at(com + 2.0 * np.array([math.cos(way), math.sin(way), 0.3]))
        body.update(heading)
        assert body.turn == pytest.approx(turn)
    body.look_at(com + 0.2 * np.array([math.cos(heading + 0.4), math.sin(heading + 0.4), 0.0]))
    body.update(heading)
    assert body.turn == pytest.approx(0.0), "a point above the robot has no direction"


def test_a_trunk_turns_to_the_end_on_the_side_of_a_point_beside_the_robot() -> None:
    robot = load_robot("g1").robot()
    body, com = WalkingControl(robot, FootstepPlan.standing(robot), DT).body, np.array(robot.com)
    body._most_turn = 0.3
    for turn, angle in itertools.product((0.05, -0.05, 0.3, -0.3), (1.0, -1.0, 1.7, -1.7)):
        body.turn = turn
        body.look_at(com + (2.0 * math.cos(angle), 2.0 * math.sin(angle), 0.0))
        body.update(0.0)
        assert body.turn == math.copysign(0.3, angle)


@pytest.mark.parametrize("told", [1, 400])
def test_a_trunk_without_a_neck_looks_at_a_point_once_it_is_turned_there(told: int) -> None:
    """Told once or in every tick, to a point that moves a little."""
    robot = load_robot("g1").robot()
    body, com = WalkingControl(robot, FootstepPlan.standing(robot), DT).body, np.array(robot.com)
    looking = []
    for tick in range(400):
        if tick < told:
            far = 2.0 + 1e-3 * tick
            body.look_at(com + (far * math.cos(0.4), far * math.sin(0.4), 0.0))
        looking.append(body.looking)
        body.update(0.0)
        twist = body.twist
        assert body.looking == (abs(0.4 - twist.angle) < 0.05 and abs(twist.rate) < 0.2)
    assert looking[-1] and not looking[5]
    assert body.turn == pytest.approx(0.4) and body.reached


def test_a_height_that_is_set_stays_when_a_gait_begins_anew_from_where_the_com_is() -> None:
    _, walking = standing()
    body, own = walking.body, walking.body.com_height
    body.com_height = own - 0.05
    for _ in range(20):
        body.update(0.0)
    body.begin()
    assert body.com_height == pytest.approx(own - 0.05)
    rest = Pendulum.at_rest(np.array([0.0, 0.0, 0.8]))
    assert body.raised(rest).com[2] == pytest.approx(0.8)
