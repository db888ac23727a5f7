"""Hands that press and grip: oracles of the offset of the ZMP, forces held, losses noticed, bad input refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from standing_hands import AHEAD, DOWN, feel, held_hand, hold, measure, standing, turned, wrench_at

from wbc.base.errors import InputError
from wbc.core.frames import heading
from wbc.core.limits.joint import TorqueLimits
from wbc.core.robot import GRAVITY, SIDES
from wbc.robots import load
from wbc.sim import (
    Machine,
    Plant,
    SensorNoise,
    SignalNoise,
    Trial,
    TrialHook,
    WalkPlan,
    WalkSpec,
    WalkTrial,
    make_scene,
)
from wbc.tasks.stabilizer.pendulum import Pendulum, zmp_offset
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings, walk_distance
from wbc.walking.contact import GaitPhase
from wbc.walking.hands.arm import LEAD
from wbc.walking.hands.frames import FEET, FOLLOW, TargetFrames, carried
from wbc.walking.hands.hand import THERE, HandState
from wbc.walking.hands.hands import GyroSlip, Hands
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.swing import FootMotion
from wbc.walking.source import Progress, Reference

TABLE = {"distance": 0.18, "height": 0.7}


# ---- the offset of the ZMP -----------------------------------------------------------------------------------------


def test_the_offset_does_not_depend_on_where_the_world_begins() -> None:
    """Form A of the literature, κ z − γ with moments about the origin, says the same wherever the origin is."""
    rng = np.random.default_rng(1)
    weight, z = 382.0, np.array([0.03, -0.02, 0.01])
    place, force, moment = rng.normal(size=3), 40.0 * rng.normal(size=3), rng.normal(size=3)
    delta = zmp_offset(wrench_at(place, force, moment), z, weight)
    for origin in rng.normal(scale=50.0, size=(5, 3)):
        moved = zmp_offset(wrench_at(place + origin, force, moment), z + origin, weight)
        assert moved == pytest.approx(delta, abs=1e-11)
        p, at = place + origin, z + origin
        kappa = 1.0 - force[2] / weight
        gamma = np.array(
            [
                ((p[2] - at[2]) * force[0] - p[0] * force[2] + moment[1]) / weight,
                ((p[2] - at[2]) * force[1] - p[1] * force[2] - moment[0]) / weight,
            ]
        )
        assert at[:2] - moved == pytest.approx(kappa * at[:2] - gamma, abs=1e-10)


# ---- in the plant --------------------------------------------------------------------------------------------------


def pressing(noise: str | SensorNoise = "none") -> tuple[Trial, Hands]:
    """Return a robot whose hands press 25 N each on a table."""
    walking, hands = standing(reach_time=0.6, ramp=0.4)
    trial = Trial(
        Plant(load("hrp4_class"), scene=make_scene("table", **TABLE), noise=noise, visuals=False), walking
    )
    trial.advance(0.1)
    for side, y in (("left", 0.2), ("right", -0.2)):
        hands.press(f"{side}_hand", 25.0, DOWN, at=(0.24, y, TABLE["height"]), firm=True)
    trial.advance(2.4)
    assert [hand.state for hand in hands.all.values()] == 2 * [HandState.HOLD] and hands.there
    return trial, hands


def shift_of(trial: Trial) -> np.ndarray[Any, Any]:
    """Return the shift of the CoM to the point about which feet and hands together turn the pendulum."""
    place = np.mean([trial.plant.data.site(f"{side}_hand site").xpos for side in ("left", "right")], axis=0)
    weight = trial.control.controller.robot.mass * GRAVITY
    return -zmp_offset(wrench_at(place, (0.0, 0.0, 50.0)), np.zeros(3), weight)


@pytest.mark.slow
def test_both_hands_press_on_a_table_and_a_loss_is_noticed_within_50_ms() -> None:
    trial, hands = pressing(SensorNoise(hand_force=SignalNoise(bias_std=1.5)))
    both, plant = hands.all.values(), trial.plant
    assert max(np.linalg.norm(hand.sensor.tare[:3]) for hand in both) > 1.0, "the sensors are off"
    felt: list[list[float]] = []
    trial.advance(0.2, lambda: felt.append([hand.pressed for hand in both]))
    assert np.array(felt) == pytest.approx(25.0, abs=2.5)
    truth, expected = plant.truth(), shift_of(trial)
    assert truth.other_force[2] == pytest.approx(50.0, rel=0.03), "whatever the wrists' offsets"
    assert hands.shift == pytest.approx(expected, abs=4e-3)
    assert truth.com[:2] == pytest.approx(expected, abs=6e-3)

    for _ in range(3):  # the sensors drop out
        measured = replace(plant.measure(), hand_wrenches=np.full((2, 6), np.nan))
        plant.step(trial.control.command(measured))
    assert trial.control.drives.failures == 0
    assert [hand.pressed for hand in both] == pytest.approx(felt[-1], abs=1.0)
    assert hands.shift == pytest.approx(expected, abs=4e-3)

    model = plant.model
    for geom in range(model.ngeom):  # the table vanishes
        if model.body(model.geom_bodyid[geom]).name.startswith("scene/"):
            model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
    lost: list[int] = []
    trial.advance(1.1, lambda: lost.append(len(hands.lost)))
    assert lost[round(0.05 / plant.control_period)] == 2
    assert np.abs(hands.shift).max() < 1e-3, "and the balance is again that of the feet alone"


@pytest.mark.slow
def test_the_qp_gives_a_hand_no_more_force_than_its_arm_has_torque_for() -> None:
    """The asked force within the friction cone; what is left where a shoulder gets weaker, and the balance knows it."""
    trial, hands = pressing()
    controller, hand = trial.control.controller, hands.all["left_hand"]
    given = controller.solution.wrenches["left_hand press"]
    assert given == pytest.approx([0.0, 0.0, 25.0], abs=0.1) and not hand.bounded
    (limits,) = (each for each in controller.limits if isinstance(each, TorqueLimits))
    # The joint that gives most of the force, at rest, can give half of it from now on.
    full, joint = hand.arm.strength(hand.direction, 1.0, hand.tip)
    index = controller.robot.joint_names.index(joint)
    bound = abs(float(controller.solution.torques[index])) - 0.5 * 25.0 * limits.most[index] / full
    limits._most[index], limits._least[index] = bound, -bound
    bounded: list[bool] = []
    trial.advance(1.5, lambda: bounded.append(hand.bounded))
    assert abs(trial.control.controller.solution.torques[index]) <= bound + 1e-6
    assert all(bounded[40:]) and 5.0 < hand.force.total < 0.9 * 25.0
    assert hand.pressed == pytest.approx(hand.force.total, abs=2.0) and hand.state is HandState.HOLD
    assert trial.plant.truth().other_force[2] == pytest.approx(25.0 + hand.force.total, abs=3.0)


class Grip(TrialHook):
    """Lets both hands grip ahead of where they hang, where nothing is, and the robot walk then."""

    def before(self, trial: Any) -> None:
        walking, time = trial.control, trial.plant.time
        if time > 0.5 and not walking.hands.wanted:
            for name, hand in walking.hands.all.items():
                walking.hands.grip(name, hand.arm.place.translation + (0.1, 0.0, 0.05), AHEAD, 10.0)
        if walking.hands.there and walking.source.finished and walking.progress.steps_done == 0:
            walking.follow(walk_distance(FootstepPlan.standing(walking.controller.robot), 0.4))


@pytest.mark.slow
def test_stretched_arms_that_grip_nothing_make_no_robot_fall_in_torque_control() -> None:
    """Their tasks move the arms alone, and the task of the centre of mass counts that motion."""
    stand = WalkPlan(drive=((0.0, 0.0, 0.0, 0.0), (10.0, 0.0, 0.0, 0.0)))
    spec = WalkSpec(machine=Machine(hand_sensors=True), robot="hrp4_class", mode="torque", plan=stand)
    trial = WalkTrial(spec, visuals=False)
    trial.scenario.append(Grip())
    result = trial.run()
    assert result.outcome == "completed" and result.failures == 0 and result.steps_done >= 3
    assert trial.control.hands.gripping


def test_hands_without_orders_have_nothing_in_the_qp() -> None:
    """A hand has its contact and tasks from its first order on, and keeps them."""
    walking, hands = standing()
    controller, before = walking.controller, len(walking.controller.tasks)
    assert [contact.name for contact in controller.contacts] == ["left_foot", "right_foot"]
    hands.press("left_hand", 5.0, DOWN)
    hands.release("left_hand")
    hands.press("left_hand", 5.0, DOWN)
    assert [contact.name for contact in controller.contacts[2:]] == ["left_hand press"]
    assert len(controller.tasks) == before + 2


@pytest.mark.parametrize(
    ("at", "along"),
    [
        ((0.30, 0.25, 0.70), DOWN),  # below the start of its approach: up, then forward
        ((0.30, 0.30, 1.00), AHEAD),  # to the side and up, then forward
        ((0.24, 0.20, 0.90), DOWN),
        ((0.28, 0.30, 0.80), (0.6, 0.0, -0.8)),
    ],
)
def test_a_hand_brushes_nothing_on_its_way_to_a_surface(at: Any, along: Any) -> None:
    """It is never nearer to the surface than at the end, once it moves along it, and it moves from rest to rest."""
    walking, hands = standing(reach_time=1.0)
    hand, tick = hands.all["left_hand"], ticks_of(walking, follows=True)
    start, direction = hand.arm.place.translation.copy(), np.array(along)
    hands.press("left_hand", 5.0, along, at=at, firm=True)
    end, places, rates = hand.arm.target.translation, [start], []
    np.testing.assert_allclose(hand.destination, np.array(at) - 0.05 * direction, atol=1e-9)
    while hand.state is HandState.REACH:
        tick()
        places.append(hand.arm.task.target.translation)
        rates.append(hand.arm.task.target.rotation @ hand.arm.task.feedforward_velocity[:3])
    places, rates = places[:-1], rates[:-1]  # the last tick begins the approach
    way = np.array(places) - end
    nearer = way @ direction
    nearer_at_start = nearer[0]
    moved = np.linalg.norm(way - way[0] - np.outer(nearer - nearer[0], direction), axis=1)
    assert hand.state is HandState.APPROACH and 200 <= len(rates) <= 202
    assert np.abs(moved[nearer > 1e-9]).max(initial=0.0) < 1e-9
    assert nearer.max() <= max(nearer[0], 0.0) + 1e-9 and np.linalg.norm(way[-1]) < 1e-9
    middles = 0.5 * (np.array(rates)[1:] + np.array(rates)[:-1])
    np.testing.assert_allclose(middles, np.diff(places, axis=0)[1:] / 0.005, atol=0.01)
    assert np.linalg.norm(rates[0]) < 0.01 and np.linalg.norm(rates[-1]) < 1e-9
    np.testing.assert_allclose(hand.arm.task.target.rotation @ hand.arm.axis(), direction, atol=1e-9)
    hands.release("left_hand")  # it goes back by the way it came, and to its posture then
    back = []
    while hand.arm.target is not None:
        tick()
        back.append(hand.arm.task.target.translation - end)
    nearer = np.array(back) @ direction
    beside = np.array(back) - np.outer(nearer, direction)
    off = [np.linalg.norm(beside - there, axis=1) for there in (0.0, way[0] - nearer_at_start * direction)]
    assert np.minimum(*off)[nearer > 1e-3].max(initial=0.0) < 1e-3
    np.testing.assert_allclose(back[-1], start - end, atol=2e-3)


def carry(walking: WalkingControl, name: str) -> Callable[..., None]:
    """Return a tick of a hand that is where its reference is: the base carries it there."""
    robot, hand = walking.controller.robot, walking.hands.all[name]
    own = robot.placement(robot.base_frame).actInv(hand.arm.place)

    def tick() -> None:
        feel(hand, np.zeros(3))
        left, right = (FootMotion.at_rest(robot.placement(sole.frame)) for sole in robot.soles)
        walking.arms.update((left, right), 0.0)
        base = hand.arm.task.target * own.inverse()
        robot.update(np.concatenate((pin.SE3ToXYZQUAT(base), robot.half_sitting[7:])), np.zeros(robot.nv))

    return tick


def test_a_hand_whose_sensor_falls_silent_on_its_way_stops_where_it_is() -> None:
    walking, hands = standing(reach_time=1.0)
    hand, tick = hands.all["left_hand"], carry(walking, "left_hand")
    hands.press("left_hand", 5.0, DOWN, at=(0.3, 0.25, 0.7), firm=True)
    for _ in range(60):
        tick()
    assert np.abs(hand.arm.task.feedforward_acceleration).max() > 0.1
    for _ in range(12):
        hand.update(None, None)
        assert hand.force.planned == 0.0, "it has touched nothing"
    assert hand.state is HandState.LOST
    robot, here = walking.controller.robot, pin.SE3(hand.arm.place)
    yaw = heading(robot.placement(robot.base_frame).rotation)
    walking.arms.update(feet_at(walking, np.zeros(3)), yaw)
    assert hand.arm.task.target.isApprox(here) and hands.lost == ("left_hand",)
    for rate in (hand.arm.task.feedforward_velocity, hand.arm.task.feedforward_acceleration):
        np.testing.assert_allclose(rate, np.zeros(6), atol=1e-12)
    step = np.array([0.2, 0.1, 0.0])  # it goes along with the feet
    for _ in range(1000):
        walking.arms.update(feet_at(walking, step), yaw)
    np.testing.assert_allclose(hand.arm.task.target.translation, here.translation + step, atol=1e-6)
    hands.press("left_hand", 5.0, DOWN, at=(0.3, 0.25, 0.7), firm=True)
    assert hand.state is HandState.LOST, "an order that comes in every tick is not tried again"
    hands.release("left_hand")
    begin = hand.arm.target
    assert (
        begin is not None and np.linalg.norm(begin.translation - hand.arm.seen(FEET, here).translation) < 0.3
    )
    with pytest.raises(InputError, match="within"):  # now it is, and the robot stands elsewhere
        hands.press("left_hand", 5.0, DOWN, at=(0.3, 0.25, 0.7), firm=True)


def test_a_target_that_is_refused_leaves_the_frame_of_the_feet_with_the_feet() -> None:
    walking, _ = standing()
    arm, robot = walking.arms["left_hand"], walking.controller.robot
    before = arm.seen(FEET)
    with pytest.raises(InputError):
        arm.reach((0.3, 0.25, 0.7), FEET, speed=-1.0)
    robot.update(robot.q + np.eye(robot.nq)[0], robot.v)
    arm.reach((0.3, 0.25, 0.7), FEET)
    assert arm.seen(FEET).isApprox(before)


def feet_at(walking: WalkingControl, step: np.ndarray[Any, Any]) -> tuple[FootMotion, FootMotion]:
    """Return the motions of both feet at rest, a step from where they are."""
    robot = walking.controller.robot
    places = [robot.placement(sole.frame) for sole in robot.soles]
    left, right = (FootMotion.at_rest(pin.SE3(at.rotation, at.translation + step)) for at in places)
    return left, right


def test_the_reference_waits_for_a_hand_that_cannot_follow_on_its_way() -> None:
    walking, hands = standing(reach_time=1.0)
    hand, feet = hands.all["left_hand"], feet_at(walking, np.zeros(3))
    hands.grip("left_hand", (0.45, 0.25, 0.9), AHEAD, 5.0)
    for _ in range(400):
        feel(hand, np.zeros(3))
        walking.arms.update(feet, 0.0)
    assert hand.state is HandState.REACH and not hands.there
    assert hand.arm.behind == pytest.approx(LEAD, abs=0.01)


def test_a_hand_that_finds_no_surface_stops() -> None:
    walking, hands = standing(approach=0.2)
    trial = Trial(Plant(load("hrp4_class"), scene=make_scene("table", distance=3.0), visuals=False), walking)
    hands.press("left_hand", 10.0, DOWN, firm=True)
    site = trial.plant.data.site("left_hand site")
    start = site.xpos.copy()
    trial.until(lambda: hands.lost == ("left_hand",), 4.0)
    trial.advance(0.2)
    assert np.linalg.norm(site.xpos - start) < 0.6
    hands.release("left_hand")
    assert hands.all["left_hand"].state is HandState.FREE


def test_a_robot_in_torque_control_without_sensors_at_its_wrists_refuses_to_press() -> None:
    walking = WalkingControl(load("g1").robot(), None, 0.005, WalkingControlSettings(mode="torque"))
    Trial(Plant(load("g1"), visuals=False), walking).advance(0.1)
    with pytest.raises(InputError, match="must have a force sensor.* no hand_wrenches; .* none"):
        walking.hands.press("left_hand", 5.0, DOWN)


def test_hands_with_a_reading_are_named_where_another_is_to_press() -> None:
    walking, hands = standing()
    measure(walking, hand_wrenches=np.array([[np.nan] * 6, [0.0] * 6]))
    with pytest.raises(
        InputError, match="left_hand must have .* NaN for it; hands with a reading: right_hand$"
    ):
        hands.press("left_hand", 5.0, DOWN)
    hands.press("right_hand", 5.0, DOWN)


def test_the_bound_is_what_a_sudden_loss_leaves() -> None:
    """M g d / h: with the distance from the middle of the sole to its edge and the height of the tip."""
    walking, hands = standing(margin=0.0)
    robot = walking.controller.robot
    moment = robot.mass * GRAVITY * 0.5 * robot.soles[0].length
    for height in (1.05, 0.9, 0.75):
        bound, at = moment / height, (0.3, 0.2, height)
        with pytest.raises(InputError, match=f"may press with at most {bound:.0f} N"):
            hands.press("left_hand", bound + 1.0, AHEAD, at=at)
        hands.press("left_hand", bound - 1.0, AHEAD, at=at)
    # The tip of the left hand is on its way to 0.75 m, and counts there.
    left = bound - 1.0
    rest = (moment - 0.75 * left) / 1.05
    with pytest.raises(InputError, match=f"right_hand may press with at most {rest:.0f} N"):
        hands.press("right_hand", 20.0, AHEAD, at=(0.3, -0.2, 1.05))


def test_an_arm_that_has_its_force_again_gives_it_again() -> None:
    _, hand, tick = held_hand(25.0, ramp=0.1)
    for most, given, bounded in (
        (50.0, 25.0, False),
        (15.0, 15.0, True),
        (20.0, 20.0, True),
        (50.0, 25.0, False),
    ):
        for _ in range(3):
            tick(most)
            assert (hand.force.total, hand.bounded) == (pytest.approx(given), bounded)


# ---- in a tick: against closed forms -------------------------------------------------------------------------------


def test_a_frame_between_the_feet_says_how_its_points_move() -> None:
    """After a step of 1: 1 − (1 + t/T − t²/T²) exp(−t/T)."""
    dt = 1e-4
    walking, held = standing()[0], pin.SE3.Random()
    frames, step = TargetFrames(walking.controller), np.array((0.4, 0.2, 0.1))
    start, _, _ = frames.now(FEET)
    soles = [walking.controller.robot.placement(sole.frame) for sole in walking.controller.robot.soles]
    middle = 0.5 * (soles[0].translation + soles[1].translation)
    np.testing.assert_allclose(start.translation, middle, atol=1e-12)
    walking.controller.robot.update(turned(walking, 3.0), np.zeros(walking.controller.robot.nv))
    frames.begin(FEET)
    start, feet = frames.now(FEET)[0], feet_at(walking, step)
    for _ in range(3000):
        before = frames.now(FEET)
        frames.follow(True, feet, -3.0, dt)
    after = frames.now(FEET)
    moved = carried(after, held, np.zeros(6), np.zeros(6))
    way = moved[0].translation - (before[0] * held).translation
    np.testing.assert_allclose(moved[1][:3], way / dt, atol=1e-3)
    np.testing.assert_allclose(after[2], (after[1] - before[1]) / dt, atol=1e-6)
    t, decay = 0.3 / FOLLOW, np.exp(-0.3 / FOLLOW)
    part = 1.0 - (1.0 + t - t**2) * decay
    np.testing.assert_allclose(after[0].translation, start.translation + part * step, atol=1e-3)
    part = 1.0 - (1.0 + t) * decay
    turn = pin.log3(after[0].rotation @ start.rotation.T)[2]
    assert turn == pytest.approx(part * (2.0 * np.pi - 6.0), abs=1e-3), "the short way round"


def test_the_frame_of_feet_that_move_at_a_constant_speed_stays_in_their_middle() -> None:
    walking, _ = standing()
    frames, dt, speed = TargetFrames(walking.controller), 2e-3, np.array((0.3, -0.1, 0.0))
    start = frames.now(FEET)[0].translation.copy()
    frames.begin(FEET)
    for tick in range(1, 2001):
        frames.follow(True, feet_at(walking, tick * dt * speed), 0.0, dt)
    place, velocity, _ = frames.now(FEET)
    np.testing.assert_allclose(place.translation, start + 4.0 * speed, atol=1e-3)
    np.testing.assert_allclose(velocity[:3], speed, atol=1e-3)


@pytest.mark.parametrize(("told", "beyond"), [(False, 0.84 * FOLLOW), (True, 0.0)])
def test_the_frame_of_feet_that_stop_at_the_end_of_their_footsteps_does_not_run_on(
    told: bool, beyond: float
) -> None:
    """Feet slide to their places at a constant speed. Untold, the frame runs on by the most of (t + t²/T) exp(−t/T)."""
    walking, _ = standing()
    frames, dt, speed = TargetFrames(walking.controller), 2e-3, 0.3
    frames.begin(FEET)
    start, end = frames.now(FEET)[0].translation[0], feet_at(walking, np.array((1.2, 0.0, 0.0)))
    steps = [Footstep(side, *foot.placement.translation[:2]) for side, foot in zip(SIDES, end, strict=True)]
    ahead, places = np.array((1.0, 0.0, 0.0)), []
    for tick in range(1, 4001):
        feet = feet_at(walking, min(tick * dt * speed, 1.2) * ahead)
        frames.follow(True, feet, 0.0, dt, steps if told else None)
        places.append(frames.now(FEET)[0].translation[0] - start)
    assert max(places) == pytest.approx(1.2 + beyond * speed, abs=1e-3)
    assert places[-1] == pytest.approx(1.2, abs=1e-3)
    np.testing.assert_allclose(places[1250:1700], dt * speed * np.arange(1251, 1701), atol=1e-3)


def test_a_question_for_the_place_of_a_frame_changes_nothing() -> None:
    """The frame of the feet begins with the order of a hand: where the robot is then, not where it was asked for."""
    walking, _ = standing()
    robot, frames = walking.controller.robot, TargetFrames(walking.controller)
    start = frames.now(FEET)[0].copy()
    robot.update(turned(walking, 0.5), np.zeros(robot.nv))
    assert not frames.now(FEET)[0].isApprox(start)
    fresh = TargetFrames(walking.controller)
    for each in (frames, fresh):
        each.begin(FEET)
    for asked, unasked in zip(frames.now(FEET), fresh.now(FEET), strict=True):
        np.testing.assert_array_equal(np.array(asked), np.array(unasked))


def test_a_foot_that_swings_does_not_raise_the_frame_of_the_feet() -> None:
    walking, _ = standing()
    frames = TargetFrames(walking.controller)
    frames.begin(FEET)
    start = frames.now(FEET)[0].translation.copy()
    left, right = (motion.placement.copy() for motion in feet_at(walking, np.zeros(3)))
    left.translation += (0.2, 0.0, 0.15)
    for _ in range(1000):
        frames.follow(True, (FootMotion.at_rest(left), FootMotion.at_rest(right)), 0.0, 0.01)
    np.testing.assert_allclose(frames.now(FEET)[0].translation, start + (0.1, 0.0, 0.0), atol=1e-6)


def test_a_slip_is_integrated_without_the_bias_that_was_averaged_at_rest() -> None:
    """Of a link whose turn the estimate has, the rest remains: the bias at rest, the slip of the feet on the way."""
    slip, vertical = GyroSlip(), np.array([0.0, np.sin(0.1), np.cos(0.1)])  # an IMU that is tilted
    bias, dt = 0.01, 0.005
    for turning in np.linspace(0.2, -0.1, 200):  # a trunk that twists over feet at rest
        slip.update((turning + bias) * vertical, vertical, turning * dt, True, dt)
    assert slip.bias == pytest.approx(bias, abs=1e-12) and slip.angle == 0.0
    for _ in range(400):
        slip.update((0.3 + bias) * vertical, vertical, 0.2 * dt, False, dt)
    assert slip.angle == pytest.approx(0.2, abs=1e-9)
    for _ in range(20):  # a short rest: too short for a new bias
        slip.update(0.05 * vertical, vertical, 0.0, True, dt)
    assert slip.bias == pytest.approx(bias, abs=1e-12) and slip.angle == pytest.approx(0.2, abs=1e-9)


def test_feet_that_slip_are_noticed_while_a_hand_is_used() -> None:
    """The gyroscope turns and the estimate, which holds on to the feet, does not."""
    walking, hands = standing()
    robot = walking.controller.robot
    left, right = (FootMotion.at_rest(robot.placement(sole.frame).copy()) for sole in robot.soles)
    reference = Reference(Pendulum.at_rest(robot.com), (left, right), Progress(GaitPhase.DOUBLE))
    measurement: Any = SimpleNamespace(
        angular_velocity=np.array([0.0, 0.0, 0.2]), hand_wrenches=np.zeros((2, 6))
    )

    def turn() -> float:
        for _ in range(100):
            hands.update(measurement, reference)
        return hands.slip

    assert turn() == 0.0
    hands.press("left_hand", 5.0, DOWN, at=(0.3, 0.25, 0.7), firm=True)
    assert turn() == pytest.approx(0.1)
    hands.release("left_hand")
    assert turn() == turn(), "nothing is counted between two orders"
    first = hands.slip
    hands.press("left_hand", 5.0, DOWN, at=(0.3, 0.25, 0.7), firm=True)
    assert turn() == pytest.approx(first + 0.1)


def test_a_hand_that_holds_presses_another_way_with_another_force() -> None:
    hands, hand, tick = held_hand(20.0, ramp=0.1)
    hands.press("left_hand", 12.0, (3.0, 0.0, -4.0), firm=True)
    angles = []
    for _ in range(25):
        x, y, z = hand.direction
        assert y == 0.0
        angles.append(np.arctan2(-z, x))
        np.testing.assert_allclose(hand.contact.normal, -hand.direction, atol=1e-12)
        tick(np.inf)
    assert hand.state is HandState.HOLD and hand.force.total == pytest.approx(12.0)
    np.testing.assert_allclose(hand.direction, (0.6, 0.0, -0.8))
    turn, fastest = np.arctan2(0.8, 0.6), 15.0 / 8.0 * 0.005 / 0.1  # of a minimum jerk in a tick
    assert angles[0] == 0.0 and np.diff(angles).min() >= 0.0
    assert np.diff(angles).max() == pytest.approx(turn * fastest, rel=0.01), (
        "it turns with the ramp of the force"
    )


def test_a_force_that_another_hand_opposes_is_no_room_for_a_loss() -> None:
    """Two hands at the same height press ahead and back: the loss of each one leaves the other one."""
    walking, hands = standing(margin=0.0)
    robot, height = walking.controller.robot, 1.0
    most = robot.mass * GRAVITY * 0.5 * robot.soles[0].length / height
    hands.press("left_hand", 0.9 * most, AHEAD, at=(0.3, 0.2, height))
    for firm in (False, True):
        order = "right_hand", 1.1 * most, (-1.0, 0.0, 0.0)
        if not firm:
            with pytest.raises(
                InputError, match=f"at most {most:.0f} N .* by {1.1 * 500 * robot.soles[0].length:.0f} mm"
            ):
                hands.press(*order, at=(0.3, -0.2, height))
        else:  # both press on one thing, and lose it together
            hands.press(*order, at=(0.3, -0.2, height), firm=True)
    hands.press("right_hand", 0.99 * most, (-1.0, 0.0, 0.0), at=(0.3, -0.2, height))
    assert hands.all["right_hand"].state is HandState.REACH


def test_a_hand_that_is_told_in_every_tick_to_let_go_lets_go_as_soon_as_one_that_is_told_once() -> None:
    def ticks(*, again: bool) -> int:
        hands, hand, tick = held_hand(20.0, ramp=0.1)
        hands.release("left_hand")
        count = 0
        while hand.state is HandState.HOLD and count < 200:
            tick(np.inf)
            count += 1
            if again and hand.state is HandState.HOLD:
                hands.release("left_hand")
        assert hand.state is HandState.FREE
        return count

    assert ticks(again=True) == ticks(again=False)


ORDERS: dict[str, Callable[[WalkingControl], None]] = {
    "press": lambda w: w.hands.press("left_hand", 10.0, DOWN, at=(0.3, 0.25, 0.7), firm=True),
    "press from here": lambda w: w.hands.press("left_hand", 10.0, DOWN, firm=True),
    "grip": lambda w: w.hands.grip("left_hand", (0.4, 0.25, 0.9), AHEAD, 5.0),
    "release": lambda w: w.hands.release("left_hand"),
    "reach": lambda w: w.arms["left_hand"].reach((0.3, 0.3, 0.9)),
    "reach slowly": lambda w: w.arms["left_hand"].reach((0.3, 0.3, 0.9), "feet", speed=0.2),
    "release of an arm": lambda w: w.arms["left_hand"].release(),
    "another force": lambda w: w.hands.press("left_hand", 20.0, (0.1, 0.0, -1.0), firm=True),
}


def ticks_of(walking: WalkingControl, *, follows: bool = False) -> Callable[[], list[Any]]:
    """Return a tick of the left hand on a surface that gives what is asked of it, and what it does in the tick.

    The hand stays behind as if the arm did not move, or follows its reference.
    """
    hand, feet = walking.hands.all["left_hand"], feet_at(walking, np.zeros(3))

    def tick() -> list[Any]:
        holds, searches = (hand.state is state for state in (HandState.HOLD, HandState.APPROACH))
        feel(hand, -(hand.force.total if holds else 5.0 * searches) * hand.direction)
        walking.arms.update(feet, 0.0)
        target = hand.arm.task.target
        if follows:
            hand.arm.place.translation, hand.arm.place.rotation = target.translation, target.rotation
        places = *target.translation, *target.rotation.ravel(), *hand.direction
        return [hand.state, *places, *hand.arm.task.scale, hand.force.total, hand.ordered]

    return tick


@pytest.mark.parametrize("order", ORDERS)
def test_an_order_does_the_same_told_in_every_tick_and_once_more_after_a_release(order: str) -> None:
    """All that a hand does is the same to the last bit: on a surface that gives what is asked of it."""

    def told(ticks: int, *, again: bool = False) -> list[Any]:
        walking, hands = standing(reach_time=0.3, ramp=0.2)
        hand, tick, done = hands.all["left_hand"], ticks_of(walking), []
        for _ in range(1 + again):
            done.clear()
            if order in ("release", "another force"):
                hold(hands, "left_hand", DOWN, 10.0)
            if order == "release of an arm":
                ORDERS["reach"](walking)
            for count in range(120):
                if count < ticks:
                    ORDERS[order](walking)
                done.append(tick())
            if again:
                seen = done.copy()
                hands.release("left_hand")
                for _ in range(45):
                    tick()
                if hand.arm.target is not None:
                    hand.arm.release()
                for _ in range(65):
                    tick()
        return seen if again else done

    once = told(1)
    assert told(120) == once
    np.testing.assert_allclose(
        [row[1:] for row in told(1, again=True)], [row[1:] for row in once], atol=1e-12
    )


STREAMS: dict[str, Callable[[WalkingControl, float], None]] = {
    "force": lambda w, x: w.hands.press("left_hand", 10.0 + x, DOWN, at=(0.3, 0.25, 0.7), firm=True),
    "place": lambda w, x: w.hands.press("left_hand", 10.0, DOWN, at=(0.3, 0.25, 0.7 + 0.5 * x), firm=True),
    "handle": lambda w, x: w.hands.grip("left_hand", (0.4, 0.25, 0.9 + 0.5 * x), AHEAD, 5.0),
    "limit": lambda w, x: w.hands.grip("left_hand", (0.4, 0.25, 0.9), AHEAD, 5.0 + x),
    "target": lambda w, x: w.arms["left_hand"].reach((0.3, 0.3, 0.9 + 0.1 * x)),
    "force of a hand that presses": lambda w, x: w.hands.press("left_hand", 20.0 + x, DOWN, firm=True),
    "direction": lambda w, x: w.hands.press("left_hand", 10.0, (0.3 + 0.1 * x, 0.0, -1.0), firm=True),
    "limit of a hand that grips": lambda w, x: w.hands.grip("left_hand", (0.4, 0.25, 0.9), AHEAD, 7.0 + x),
}


@pytest.mark.parametrize("order", STREAMS)
def test_the_last_order_of_a_stream_decides_and_a_stream_moves_a_hand_on(order: str) -> None:
    """Orders that change by less and less come in every tick; the hand goes a good part of its way meanwhile."""

    def told(changes: Any, rest: int) -> tuple[Any, Any]:
        walking, hands = standing(reach_time=0.3, ramp=0.2)
        hand, tick = hands.all["left_hand"], ticks_of(walking, follows=True)
        if order in ("force of a hand that presses", "direction"):
            hold(hands, "left_hand", DOWN, 10.0)
        if order == "limit of a hand that grips":
            STREAMS["limit"](walking, 0.0)
            for _ in range(100):
                tick()
            assert hand.state is HandState.GRIP
        for change in changes:
            STREAMS[order](walking, float(change))
            meanwhile = tick()
            assert hand.state is HandState.GRIP or order != "limit of a hand that grips"
        for _ in range(rest):
            after = tick()
        return meanwhile, after

    begin, end = told([0.0], 220)
    meanwhile, last = told(np.linspace(0.1, 0.0, 100), 220)
    assert last[0] is end[0]
    np.testing.assert_allclose(last[1:], end[1:], atol=THERE[0])
    parts = {"force of a hand that presses": slice(15, None), "direction": slice(12, 15)}
    begin, meanwhile, end = (np.array(row[1:])[parts.get(order, slice(3))] for row in (begin, meanwhile, end))
    assert np.linalg.norm(meanwhile - end) <= 0.7 * np.linalg.norm(begin - end) + 1e-9
