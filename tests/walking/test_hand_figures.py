"""Figures of hands in closed form: ways, touches, forces, tares, low-passes, help and yielding."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest
from standing_hands import AHEAD, DOWN, feel, held_hand, hold, standing, turned, wrench_at

from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY, Robot
from wbc.core.trajectories import Follower
from wbc.robots import load
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.tasks.stabilizer.stabilizer import Stabilizer
from wbc.walking import FootstepPlan, HandSettings, WalkingControl, WalkingControlSettings
from wbc.walking.hands.frames import PELVIS, TargetFrames, carried
from wbc.walking.hands.hand import HandState
from wbc.walking.hands.hands import Hands
from wbc.walking.plans.swing import FootMotion
from wbc.walking.source import Reference


def test_a_frame_that_moves_and_turns_carries_what_moves_in_it() -> None:
    """Velocity and acceleration are the differences of the pose, of motions with constant second derivatives."""
    rng = np.random.default_rng(3)
    start, inner = pin.SE3.Random(), pin.SE3.Random()
    moving, pushed, own, rate = (rng.normal(size=6) for _ in range(4))

    def pose(time: float) -> pin.SE3:
        def at(place: pin.SE3, velocity: Any, acceleration: Any) -> pin.SE3:
            turn = _turned(place.rotation, velocity[3:], acceleration[3:], time)
            return pin.SE3(turn, place.translation + time * velocity[:3] + 0.5 * time**2 * acceleration[:3])

        return at(start, moving, pushed) * at(inner, own, rate)

    there, speed, push = carried((start, moving, pushed), inner, own, rate)
    h = 1e-3
    before, now, after = pose(-h), pose(0.0), pose(h)
    np.testing.assert_allclose(there.homogeneous, now.homogeneous, atol=1e-12)
    way = after.translation - before.translation
    np.testing.assert_allclose(speed[:3], way / (2.0 * h), atol=1e-4)
    bend = after.translation - 2.0 * now.translation + before.translation
    np.testing.assert_allclose(push[:3], bend / h**2, atol=1e-3)
    spins = [pin.log3(b.rotation @ a.rotation.T) / h for a, b in ((before, now), (now, after))]
    np.testing.assert_allclose(speed[3:], 0.5 * (spins[0] + spins[1]), atol=1e-4)
    np.testing.assert_allclose(push[3:], (spins[1] - spins[0]) / h, atol=1e-3)


@pytest.mark.parametrize("solved", [True, False])
def test_the_pelvis_accelerates_as_the_last_solution_says(solved: bool) -> None:
    """By differences of its velocity along q̈ of the solution, zero without one."""
    robot, rng = load("hrp4_class").robot(), np.random.default_rng(5)
    q = pin.integrate(robot.model, robot.half_sitting, 0.3 * rng.normal(size=robot.nv))
    v, acceleration, h = rng.normal(size=robot.nv), 3.0 * rng.normal(size=robot.nv) * solved, 1e-4
    solution = SimpleNamespace(accelerations=acceleration) if solved else None
    frames = TargetFrames(SimpleNamespace(robot=robot, solution=solution))  # type: ignore[arg-type]

    def moving(time: float) -> Any:
        step = time * v + 0.5 * time**2 * acceleration
        robot.update(pin.integrate(robot.model, q, step), v + time * acceleration)
        return frames.now(PELVIS)

    before, after, now = (moving(time) for time in (-h, h, 0.0))
    np.testing.assert_allclose(now[2], (after[1] - before[1]) / (2.0 * h), atol=1e-3)


def _turned(rotation: Any, velocity: Any, acceleration: Any, time: float) -> Any:
    """Rotation after a time, s, with an angular velocity that changes at a constant rate, by fine steps."""
    steps = 200
    for k in range(steps):
        middle = velocity + acceleration * time * (k + 0.5) / steps
        rotation = pin.exp3(middle * time / steps) @ rotation
    return rotation


@pytest.mark.parametrize("yaw", [0.0, 1.9])
def test_a_point_for_a_hand_is_in_lengths_of_its_arm_in_the_heading(yaw: float) -> None:
    walking, hands = standing()
    robot = walking.controller.robot
    robot.update(turned(walking, yaw), np.zeros(robot.nv))
    for name, side in (("left_hand", 1.0), ("right_hand", -1.0)):
        arm = hands.all[name].arm
        way = pin.utils.rotate("z", yaw).T @ (hands.point(name, 0.5, 0.4, 0.1) - arm.shoulder)
        np.testing.assert_allclose(way / (arm.length + 0.14), (0.5, side * 0.1, -0.4), atol=1e-9)


def test_wrench_and_shift_of_hands_cannot_be_written() -> None:
    _, hands = standing()
    for given in (hands.outside, hands.shift):
        with pytest.raises(ValueError, match="read-only"):
            given[0] = 5.0


def test_hands_help_with_the_moment_that_feet_lack_by_their_levers() -> None:
    """The least forces that make it nearly, by least squares, less 1 Nm that always lacks; low-passed and leaking."""
    hands, hand, _ = held_hand(25.0, help=0.5, ramp=0.1)
    other, _ = hold(hands, "right_hand", AHEAD, 25.0)
    zmp, missing, dt = np.array([0.02, 0.0, 0.0]), np.array([1.5, 6.0]), hands._dt
    levers = np.array([
        np.cross(tip_of(hands, each.name) - zmp, -each.direction)[:2] for each in (hand, other)
    ]).T  # fmt: skip
    least = 1.0 * hands._robot.force_scale
    lacks = missing * (1.0 - least / np.linalg.norm(missing))
    ridge = np.vstack((levers, math.sqrt(1e-3) * np.eye(2)))
    wanted = 0.5 * np.linalg.lstsq(ridge, np.append(lacks, np.zeros(2)))[0]
    for _ in range(4):
        hands.help(missing, zmp)
    time = np.arange(4) * dt
    grown = 1.0 - np.exp(-(time + dt) / 0.02)
    np.testing.assert_allclose(
        [hand.force.extra, other.force.extra], wanted * grown.sum() * dt / 0.02, rtol=0.05
    )
    for _ in range(1000):
        hands.help(missing, zmp)
    np.testing.assert_allclose([hand.force.extra, other.force.extra], wanted / 0.05, rtol=1e-4)
    hand.force.extra = other.force.extra = 10.0
    for _ in range(500):
        hands.help(0.9 * least * missing / np.linalg.norm(missing), zmp)
    assert abs(hand.force.extra) < 0.2, "the help ends once the feet give all moment"
    hands.settings = HandSettings(help=0.0)
    hands.help(missing, zmp)
    assert not hands._missing.any()


def test_hands_that_grip_yield_to_squeezes_and_to_a_sum_beyond_their_limits() -> None:
    """All that is over the sum of the limits, the difference along their line, and all that is vertical."""
    _, hands = standing()
    pair = [hands.all[name] for name in ("left_hand", "right_hand")]
    for hand in pair:
        hand.state, hand.ordered = HandState.GRIP, 10.0
    first, second = (hand.measured.translation for hand in pair)
    line = (second - first) / np.linalg.norm(second - first)
    mean, squeeze = np.array([12.0, 5.0, 0.0]), 7.0
    mean -= (mean @ line) * line
    pair[0].felt, pair[1].felt = mean + squeeze * line + (0, 0, 3.0), mean - squeeze * line - (0, 0, 3.0)
    excess = hands._yielded(False)
    over = mean * (1.0 - 10.0 / np.linalg.norm(mean))
    for hand, sign in zip(pair, (1.0, -1.0), strict=True):
        np.testing.assert_allclose(excess[hand.name][:2], (over + sign * squeeze * line)[:2], atol=1e-6)
        assert excess[hand.name][2] == pytest.approx(hand.felt[2])
    excess = hands._yielded(True)
    for hand, sign in zip(pair, (1.0, -1.0), strict=True):
        rest = hand.felt - over - sign * squeeze * line
        np.testing.assert_allclose(
            excess[hand.name][:2], (over + sign * squeeze * line + 0.1 * rest)[:2], atol=1e-6
        )
    pair[0].felt = pair[1].felt = 0.9 * 10.0 * mean / np.linalg.norm(mean)
    excess = hands._yielded(False)
    np.testing.assert_allclose(list(excess.values()), 0.0, atol=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 2.2])
def test_the_zmp_takes_its_share_of_the_way_to_the_edge_before_the_com_moves(yaw: float) -> None:
    walking, hands = standing(edge=0.5)
    sole = walking.controller.robot.soles[0]
    toes, side = 0.5 * sole.length, 0.5 * sole.width
    c, s = np.cos(yaw), np.sin(yaw)
    for parts, share in (
        ((2.0 * toes, 0.0), 1.0 - 0.5 / 2.0),
        ((0.0, -4.0 * side), 1.0 - 0.5 / 4.0),
        ((toes, 2.0 * side), 1.0 - 0.5 / 2.0),
        ((0.4 * toes, 0.0), 0.0),
    ):
        goal = np.array([c * parts[0] - s * parts[1], s * parts[0] + c * parts[1]])
        np.testing.assert_allclose(hands._beyond_zmp(goal, yaw), share * goal, atol=1e-12)


def test_a_line_between_the_hands_has_the_heading_of_a_cart_that_they_hold() -> None:
    walking, hands = standing()
    robot = walking.drives.observer.robot
    assert hands.heading == pytest.approx(0.0, abs=1e-6)
    for yaw in (1.2, -2.0):
        robot.update(turned(walking, yaw), np.zeros(robot.nv))
        hands._slip.angle = 0.1
        assert hands.heading == pytest.approx(yaw + 0.1)


def test_a_tare_is_the_mean_of_what_a_free_hand_feels_and_a_force_is_low_passed_once_it_grips() -> None:
    _, hands = standing()
    hand = hands.all["left_hand"]
    hands.grip("left_hand", hand.arm.place.translation + (0.1, 0.0, 0.05), AHEAD, 10.0)
    readings, dt = np.random.default_rng(1).normal(size=(40, 6)), 0.005
    for reading in readings:
        hand.update(0.5 * reading, None)
    np.testing.assert_allclose(hand.sensor.tare, 0.5 * readings.mean(axis=0), atol=1e-12)
    assert hand.state is HandState.REACH
    feel(hand, (9.0, 0.0, 0.0))
    np.testing.assert_allclose(hand.sensor.tare, 0.5 * readings.mean(axis=0), atol=1e-12)  # a touch is none
    hand.state = HandState.GRIP
    turn = pin.utils.rotate("z", 0.7)
    for _ in range(20):
        feel(hand, turn @ (4.0, 0.0, 1.0), turn @ (0.0, 0.3, 0.0))
    share = 1.0 - np.exp(-20 * dt / 0.05)
    np.testing.assert_allclose(hand.felt, share * turn @ (4.0, 0.0, 1.0), atol=1e-9)
    slow = 1.0 - np.exp(-20 * dt / 1.0)
    np.testing.assert_allclose(hand._borne[3:], slow * turn @ (0.0, 0.3, 0.0), atol=1e-9)


def test_a_reading_that_is_missing_is_no_part_of_the_tare() -> None:
    _, hands = standing()
    hand, offset = hands.all["left_hand"], np.array((10.0, 6.0, -8.0, 0.1, 0.2, 0.3))
    hands.grip("left_hand", hand.arm.place.translation + (0.1, 0.0, 0.05), AHEAD, 10.0)
    for reading in (None, offset, np.full(6, np.nan), offset, None, offset):
        hand.update(reading, None)
    np.testing.assert_allclose(hand.sensor.tare, offset, atol=1e-12)


def test_a_silent_sensor_is_bridged_for_fifty_milliseconds_and_told_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    hands, hand, _ = held_hand(20.0, ramp=0.1)
    feel(hand, -20.0 * hand.direction)
    for _ in range(10):
        hand.update(None, None)
        assert hand.state is HandState.HOLD and hand.pressed == pytest.approx(20.0)
    hand.update(np.full(6, np.nan), None)
    hand.update(None, None)
    assert hand.state is HandState.LOST and hand.pressed == 0.0 and hands.lost == ("left_hand",)
    for _ in range(5):
        hand.update(None, None)
    assert len(caplog.records) == 1


def test_the_com_comes_back_without_a_jump_once_no_hand_presses_any_more() -> None:
    """From 20 mm by (1 + t/T) e^{−t/T}; then the hands are done."""
    walking, hands = standing()
    robot, dt = walking.controller.robot, 0.005
    left, right = (FootMotion.at_rest(robot.placement(sole.frame).copy()) for sole in robot.soles)
    reference = Reference(Pendulum.at_rest(robot.com), (left, right))
    measurement: Any = SimpleNamespace(angular_velocity=np.zeros(3), hand_wrenches=np.zeros((2, 6)))
    hands.active, hands._shift = True, Follower(0.15, np.array([0.02, 0.0]))
    found = []
    while hands.active and len(found) < 1000:
        hands.update(measurement, reference)
        found.append(float(hands.shift[0]))
    times = dt * np.arange(1, len(found) + 1) / 0.15
    np.testing.assert_allclose(found, 0.02 * (1.0 + times) * np.exp(-times), atol=5e-4)
    assert 0.9 < dt * len(found) < 2.5 and found[-2] < 1e-4


def test_a_hand_goes_along_a_surface_and_then_towards_it_in_times_by_their_lengths() -> None:
    """From above a table in 3 s, of which each part has the share of its length; back from a wall first."""
    for along in ((0.06, 0.08, -0.05), (0.06, 0.08, 0.05)):
        _, hands = standing(reach_time=3.0)
        hand = hands.all["left_hand"]
        start = np.array(hand.arm.place.translation)
        goal = start + along  # before the last 50 mm
        hand.take(HandState.HOLD, np.array(DOWN), 5.0, goal - (0.0, 0.0, 0.05 + 0.14))
        back = along[2] > 0.0
        first = np.array((0.0, 0.0, along[2])) if back else np.array((*along[:2], 0.0))
        times = [3.0 * np.linalg.norm(part) / (0.1 + abs(along[2])) for part in (first, along - first)]
        assert sum(times) == pytest.approx(3.0) and len(hand.arm._way.moves) == 2
        for move, end, time in zip(hand.arm._way.moves, (start + first, goal), times, strict=True):
            move.advance(time - 1e-6)
            assert not move.arrived
            move.advance(2e-6)
            assert move.arrived
            np.testing.assert_allclose(move.now()[0].translation, end, atol=1e-9)


@pytest.mark.parametrize(("force", "ticks"), [(0.29, 5), (0.31, None)])
def test_a_contact_is_lost_after_20_ms_with_less_than_three_tenths_of_its_force(
    force: float, ticks: int | None
) -> None:
    _, hand, _ = held_hand(20.0, ramp=0.1)
    found = None
    for tick in range(1, 20):
        feel(hand, -force * 20.0 * hand.direction)
        if hand.state is HandState.LOST:
            found = tick
            break
    assert found == ticks
    if ticks is not None:
        assert hand.force.planned == pytest.approx(20.0) and hand.force.extra == 0.0 and hand.at_work
        fading = [hand.force.planned]
        for _ in range(30):
            feel(hand, np.zeros(3))
            fading.append(hand.force.planned)
        assert fading[15] == pytest.approx(10.0, abs=0.01) and fading[30] == pytest.approx(0.0, abs=1e-9)
        assert not hand.at_work and hand.state is HandState.LOST


def test_a_hand_that_has_lost_its_contact_yields_to_nothing() -> None:
    _, hand, _ = held_hand(20.0, ramp=0.1)
    while hand.state is HandState.HOLD:
        feel(hand, np.zeros(3))
    task = hand.arm.task
    assert hand.state is HandState.LOST and not task.measured_wrench.any() and not task.target_wrench.any()


def test_a_hand_that_presses_already_is_no_stronger_where_a_point_is_given() -> None:
    hands, hand, _ = held_hand(20.0, ramp=0.1)
    for at in (None, hand.arm.place.act(hand.tip)):
        with pytest.raises(InputError, match="left_hand can press with"):
            hands.press("left_hand", 5000.0, AHEAD, at=at, firm=True)


@pytest.mark.parametrize("scale", [None, 0.25])
def test_a_touch_lasts_two_ticks_and_the_force_begins_with_it(
    scale: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A light robot takes a smaller force for a touch."""
    if scale is not None:
        monkeypatch.setattr(Robot, "force_scale", scale)
    _, hands = standing(touch=4.0, ramp=0.1)
    hand, touch = hands.all["left_hand"], 4.0 * hands._robot.force_scale
    hands.press("left_hand", 20.0, AHEAD, firm=True)
    for force, state in ((1.1, "approach"), (0.9, "approach"), (1.1, "approach"), (1.1, "hold")):
        feel(hand, -force * touch * hand.direction)
        assert hand.state.value == state
        assert hand.pressed == pytest.approx(force * touch)
    assert hand.force.total == pytest.approx(touch) and hand.helps
    np.testing.assert_allclose(hand.contact.normal, (-1.0, 0.0, 0.0), atol=1e-12)


def test_the_force_for_the_balance_fades_with_the_one_that_is_asked_for_and_stays_within_bounds() -> None:
    _, hand, tick = held_hand(20.0, ramp=0.2)
    for extra, held in ((-50.0, hand._touch - 20.0), (50.0, 50.0), (-5.0, -5.0)):
        hand.force.extra = extra
        feel(hand, -20.0 * hand.direction)
        assert hand.force.extra == pytest.approx(held), "a hand that helps stays in contact"
        assert hand.force.total == pytest.approx(20.0 + held)
    hand.force.extra = 6.0
    hand.release()
    while hand.state is HandState.HOLD and hand.force.ramp.value > 0.5:
        tick(np.inf)
        assert hand.force.extra / 6.0 == pytest.approx(hand.force.ramp.value / 20.0)
    assert not hand.helps


@pytest.mark.parametrize("state", [HandState.HOLD, HandState.GRIP])
def test_the_wrench_on_hands_is_low_passed_at_the_origin_of_the_world(state: HandState) -> None:
    """(1 − e^{−t/τ}) of force and moment, of 50 ms; of hands that grip also of 1 s, for the shift of the CoM."""
    walking, hands = standing(ramp=0.1)
    assert not hands.there and not hands.gripping
    hand, _ = hold(hands, "left_hand", AHEAD, 20.0)
    hand.state = state
    assert hands.there and hands.gripping == (state is HandState.GRIP)
    robot = walking.controller.robot
    left, right = (FootMotion.at_rest(robot.placement(sole.frame).copy()) for sole in robot.soles)
    reference = Reference(Pendulum.at_rest(robot.com), (left, right))
    place = hands.all["left_hand"].measured
    force = np.array([-20.0, 1.0, 2.0])
    readings = np.zeros((2, 6))
    readings[hand.index, :3] = place.rotation.T @ force
    measurement: Any = SimpleNamespace(angular_velocity=np.zeros(3), hand_wrenches=readings)
    for _ in range(12):
        outside = hands.update(measurement, reference)
    assert outside is not None and hands.active
    share = 1.0 - np.exp(-12 * 0.005 / 0.05)
    expected = wrench_at(np.array(place.translation), force)
    np.testing.assert_allclose(outside, share * expected, atol=1e-9)
    slow = 1.0 - np.exp(-12 * 0.005 / 1.0) if state is HandState.GRIP else 0.0
    np.testing.assert_allclose(hands._slow, slow * expected, atol=1e-9)


def test_the_com_goes_towards_what_a_hand_presses_by_the_moment_over_the_weight() -> None:
    """F h / (m g) ahead, of the height of the tip over the ZMP, while the force grows and then."""
    walking, hands = standing(ramp=2.0)
    hold(hands, "left_hand", AHEAD, 12.0)
    robot = walking.controller.robot
    left, right = (FootMotion.at_rest(robot.placement(sole.frame).copy()) for sole in robot.soles)
    reference = Reference(Pendulum.at_rest(robot.com), (left, right))
    place, readings = hands.all["left_hand"].measured, np.zeros((2, 6))
    readings[0, :3] = readings[1, :3] = place.rotation.T @ (-12.0, 0.0, 0.0)
    measurement: Any = SimpleNamespace(angular_velocity=np.zeros(3), hand_wrenches=readings)
    height = float(tip_of(hands, "left_hand")[2] - reference.pendulum.zmp[2])
    lever, hand, off = height / (robot.mass * GRAVITY), hands.all["left_hand"], []
    for force in (12.0, 24.0):
        hands.press("left_hand", force, AHEAD, firm=True)
        for _ in range(600):
            hands.update(measurement, reference)
            off.append(hands.shift[0] / lever - hand.force.planned)
        assert hands.shift[0] == pytest.approx(force * lever, rel=1e-3)
    assert max(np.abs(off[600:])) < 0.42, "N; with a lag of 0.3 s it would be 3 N"


def test_nothing_turns_a_robot_about_its_zmp_while_its_hands_press_at_their_tips() -> None:
    """Weight at the shifted CoM and forces at the tips have no horizontal moment about the ZMP that was planned."""
    walking, hands = standing(ramp=0.1)
    robot, estimate = walking.controller.robot, walking.drives.observer.robot
    for name, along, force in (("left_hand", AHEAD, 20.0), ("right_hand", (0.0, -0.6, -0.8), 35.0)):
        hold(hands, name, along, force)
    posture = turned(walking, 0.7)
    posture[7:] += np.random.default_rng(4).normal(scale=0.4, size=robot.na)
    estimate.update(posture, np.zeros(robot.nv))
    left, right = (FootMotion.at_rest(robot.placement(sole.frame).copy()) for sole in robot.soles)
    reference = Reference(Pendulum.at_rest(robot.com), (left, right))
    pushes = {name: -hand.force.planned * hand.direction for name, hand in hands.all.items()}
    readings = [estimate.placement(robot.frames[name]).rotation.T @ pushes[name] for name in robot.frames]
    measurement: Any = SimpleNamespace(
        angular_velocity=np.zeros(3), hand_wrenches=np.hstack((readings, np.zeros((2, 3))))
    )
    for _ in range(800):
        hands.update(measurement, reference)
    zmp, com = reference.pendulum.zmp, hands.shifted(reference.pendulum).com
    turning = np.cross(com - zmp, (0.0, 0.0, -robot.mass * GRAVITY))
    turning += sum(np.cross(tip_of(hands, name) - zmp, push) for name, push in pushes.items())
    np.testing.assert_allclose(turning[:2], 0.0, atol=1e-2)


def tip_of(hands: Hands, name: str) -> np.ndarray[Any, Any]:
    """Return the place 0.14 m from the frame of a hand towards its mass, in the world of the estimate, m."""
    place, axis = hands.all[name].measured, hands.all[name].arm.axis()
    return np.asarray(place.translation + 0.14 * place.rotation @ axis)


def test_the_force_of_a_hand_is_the_one_that_the_qp_has_chosen_for_its_contact() -> None:
    hands, hand, _ = held_hand(20.0, ramp=0.1)
    layout = SimpleNamespace(contacts={hand.contact.name: slice(2, 5)})
    solution: Any = SimpleNamespace(layout=layout, variables=np.arange(8.0))
    assert hand.contact.active
    np.testing.assert_array_equal(hand.chosen(solution), (2.0, 3.0, 4.0))
    assert hands.all["right_hand"].chosen(solution) is None, "it does not press"
    layout.contacts.clear()
    assert hand.chosen(solution) is None, "the last QP was without it"
    assert hand.chosen(None) is None


@pytest.mark.parametrize("yaw", [0.0, 2.2])
@pytest.mark.parametrize("direction", [(0.6, 0.0, -0.8), (0.0, 0.8, 0.6), (-0.48, 0.6, -0.64)])
def test_the_greatest_force_is_the_one_whose_loss_moves_the_zmp_to_an_edge_of_the_soles_anywhere(
    yaw: float, direction: tuple[float, float, float]
) -> None:
    """The moment of the force about the ground below the CoM, over the weight, ahead and to the side in the heading."""
    walking, hands = standing(margin=0.01)
    place, robot = np.array([3.0, -2.0, 0.7]), walking.controller.robot
    q = turned(walking, yaw)
    q[:3] += place
    for each in (robot, walking.drives.observer.robot):
        each.update(q, np.zeros(robot.nv))
    turn, sole = pin.utils.rotate("z", yaw), robot.soles[0]
    ahead, hand = turn @ direction, hands.all["left_hand"]
    com = np.array(robot.com)
    below = np.array([com[0], com[1], com[2] - hands._height])
    for at in (None, hand.arm.shoulder + turn @ (0.3, 0.1, -0.2)):
        point = tip_of(hands, "left_hand") if at is None else at
        moment = turn.T @ np.cross(point - below, -ahead) / (robot.mass * GRAVITY)
        off = np.abs((moment[1], moment[0]))
        room = np.array([0.5 * sole.length - 0.01, 0.5 * sole.width - 0.01])
        most = float((room / np.maximum(off, 1e-12)).min())
        hands._check_loss("left_hand", ahead, 0.999 * most, at)
        with pytest.raises(InputError, match=rf"at most {most:.0f} N there.* move the ZMP by") as error:
            hands._check_loss("left_hand", ahead, 1.001 * most, at)
        moved = 1e3 * 1.001 * most * math.hypot(*off)
        assert f"by {moved:.0f} mm" in str(error.value)


def test_a_tick_of_the_stabilizer_that_has_failed_is_followed_by_good_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a tick without an output no bias is estimated."""
    walking, _ = standing()
    balance = walking.balance
    assert balance is not None and balance.bias is not None
    update, calls = Stabilizer.update, []

    def fails_first(*arguments: Any, **options: Any) -> Any:
        calls.append(len(calls))
        if len(calls) == 1:
            raise RuntimeError("no forces yet")
        return update(*arguments, **options)

    monkeypatch.setattr(Stabilizer, "update", fails_first)
    for tick in range(4):
        walking.command(at_rest(walking.controller.robot, 0.005 * tick))
        assert walking.drives.failing == (tick == 0)
    assert balance.output is not None


def test_a_small_robot_has_its_share_of_the_bias_that_is_believed() -> None:
    usual = standing()[0].balance
    robot = load("hrp4_class").robot()
    robot.length_scale = 0.5
    small = WalkingControl(robot, FootstepPlan.standing(robot), 0.005).balance
    assert usual is not None and small is not None and usual.bias is not None and small.bias is not None
    settings = WalkingControlSettings().bias
    assert settings is not None
    assert small.bias.settings == settings.sized(0.5) != usual.bias.settings


def test_an_arm_that_a_hand_leads_is_let_go_by_that_hand_alone() -> None:
    """A hand whose arm was let go under it would press on with no task that leads it."""
    walking, hands = standing()
    arm = walking.arms["left_hand"]
    hands.press("left_hand", 5.0, DOWN)
    with pytest.raises(InputError, match=r"hands\.release\('left_hand'\)"):
        arm.release()
    with pytest.raises(InputError, match=r"hands\.release\('left_hand'\)"):
        arm.reach(arm.place.translation)
    assert arm.target is not None
    hands.release("left_hand")
    assert arm.target is None
    arm.reach(arm.place.translation)
    with pytest.raises(InputError, match=r"arms\['left_hand'\]\.release"):
        hands.press("left_hand", 5.0, DOWN)
    arm.release()
    hands.press("left_hand", 5.0, DOWN)
