"""Hands that press and grip: oracles of the offset of the ZMP, forces held, losses noticed, bad input refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wbc.core.errors import InputError, UnknownNameError
from wbc.core.limits.rows import TorqueLimits
from wbc.core.robot import GRAVITY
from wbc.robots import load
from wbc.sim import Plant, SensorNoise, SignalNoise, Trial, make_scene
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.tasks.stabilizer.zmp import zmp_offset
from wbc.walking import (
    FootstepPlan,
    HandSettings,
    SteppingControl,
    WalkingControl,
    WalkingControlSettings,
)
from wbc.walking.hands.hand import GAP, Hand, HandState
from wbc.walking.hands.hands import FILTER_TIME, HELP_FROM, HELP_LEAK, HELP_TIME, RELAX, SLOW_TIME, Hands
from wbc.walking.hands.motion import FOLLOW, Follower, MovingFrame
from wbc.walking.pattern.swing import FootMotion
from wbc.walking.planning.phases import Phase
from wbc.walking.source import Reference

TABLE = {"distance": 0.18, "height": 0.7}
DOWN, AHEAD = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)


def standing(robot: str = "hrp4_class", **settings: Any) -> tuple[WalkingControl, Hands]:
    """Return the controller of a robot that stands, and its hands."""
    model = load(robot).robot()
    given = WalkingControlSettings(hands=HandSettings(**settings))
    walking = WalkingControl(model, FootstepPlan.standing(model), 0.005, given)
    return walking, walking.hands


def wrench_at(place: np.ndarray[Any, Any], force: Any, moment: Any = (0.0, 0.0, 0.0)) -> np.ndarray[Any, Any]:
    return np.concatenate([force, np.cross(place, force) + moment])


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
    walking, hands = standing(reach=0.6, ramp=0.4)
    trial = Trial(Plant(load("hrp4_class"), scene=make_scene("table", **TABLE), noise=noise), walking)
    trial.advance(0.1)
    for side, y in (("left", 0.2), ("right", -0.2)):
        hands.press(f"{side}_hand", 25.0, DOWN, at=(0.24, y, TABLE["height"]), firm=True)
    trial.advance(1.9)
    assert [hand.state for hand in hands.all.values()] == 2 * [HandState.HOLD] and hands.there
    return trial, hands


def shift_of(trial: Trial) -> np.ndarray[Any, Any]:
    """Return the shift of the CoM to the point about which feet and hands together turn the pendulum."""
    place = np.mean([trial.plant.data.site(f"{side}_hand site").xpos for side in ("left", "right")], axis=0)
    weight = trial.walking.controller.robot.mass * GRAVITY
    return -zmp_offset(wrench_at(place, (0.0, 0.0, 50.0)), np.zeros(3), weight)


def test_both_hands_press_on_a_table_and_a_loss_is_noticed_within_50_ms() -> None:
    trial, hands = pressing(SensorNoise(hand_force=SignalNoise(bias_std=1.5)))
    both, plant = hands.all.values(), trial.plant
    assert max(np.linalg.norm(hand.tare[:3]) for hand in both) > 1.0, "the sensors are off"
    felt: list[list[float]] = []
    trial.advance(0.5, lambda: felt.append([hand.pressed for hand in both]))
    assert np.array(felt) == pytest.approx(25.0, abs=2.5)
    truth, expected = plant.truth(), shift_of(trial)
    assert truth.other_force[2] == pytest.approx(50.0, rel=0.03), "whatever the wrists' offsets"
    assert hands.shift == pytest.approx(expected, abs=4e-3)
    assert truth.com[:2] == pytest.approx(expected, abs=6e-3)

    for _ in range(3):  # the sensors drop out
        measured = replace(plant.measure(), hand_wrenches=np.full((2, 6), np.nan))
        plant.step(trial.walking.command(measured))
    assert trial.walking.control.failures == 0
    assert [hand.pressed for hand in both] == pytest.approx(felt[-1], abs=1.0)
    assert hands.shift == pytest.approx(expected, abs=4e-3)

    model = plant.model
    for geom in range(model.ngeom):  # the table vanishes
        if model.body(model.geom_bodyid[geom]).name.startswith("scene/"):
            model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
    lost: list[int] = []
    trial.advance(1.4, lambda: lost.append(len(hands.lost)))
    assert lost[round(0.05 / plant.control_period)] == 2
    assert np.abs(hands.shift).max() < 1e-3, "and the balance is again that of the feet alone"


def test_the_qp_gives_a_hand_no_more_force_than_its_arm_has_torque_for() -> None:
    """The asked force within the friction cone; what is left where a shoulder gets weaker, and the balance knows it."""
    trial, hands = pressing()
    controller, hand = trial.walking.controller, hands.all["left_hand"]
    given = controller.solution.wrenches["left_hand press"]
    assert given == pytest.approx([0.0, 0.0, 25.0], abs=0.1) and not hand.bounded
    (limits,) = (each for each in controller.limits if isinstance(each, TorqueLimits))
    # The joint that gives most of the force, at rest, can give half of it from now on.
    full, joint = hand.arm.strength(hand.direction, 1.0)
    index = controller.robot.joint_names.index(joint)
    limits.limit[index] = (
        abs(float(controller.solution.torques[index])) - 0.5 * 25.0 * limits.limit[index] / full
    )
    bounded: list[bool] = []
    trial.advance(1.5, lambda: bounded.append(hand.bounded))
    assert abs(trial.walking.controller.solution.torques[index]) <= limits.limit[index] + 1e-6
    assert all(bounded[40:]) and 5.0 < hand.target < 20.0
    assert hand.pressed == pytest.approx(hand.target, abs=2.0) and hand.state is HandState.HOLD
    assert trial.plant.truth().other_force[2] == pytest.approx(25.0 + hand.target, abs=3.0)


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


@pytest.mark.parametrize("offset", [1.0, 5.0, 12.0])
def test_any_offset_of_a_wrist_is_tared_on_the_way_to_a_surface(offset: float) -> None:
    """The mean of the readings, also of one that is more than a touch; a touch on the way does not count."""
    hands = standing()[1]
    hand, middle = hands.all["left_hand"], MovingFrame([np.zeros(3)] * 2, 0.0)
    place = hands._place("left_hand")
    hand.press(np.array(AHEAD), 20.0, place.translation + 0.3 * np.array(AHEAD))
    for more in (0.0, 0.1, -0.4, 0.7, 50.0, 0.1, 0.1):
        reading = np.array([0.0, 0.0, offset + more, 0.0, 0.0, 0.0])
        hand.update(reading - hand.tare, place.rotation, None, middle, 0.005)
    assert hand.state is HandState.REACH
    np.testing.assert_allclose(hand.tare, [0.0, 0.0, offset + 0.1, 0.0, 0.0, 0.0], atol=1e-9)


def test_hands_whose_force_is_not_measured_neither_press_nor_grip() -> None:
    plant, (walking, hands) = Plant(load("hrp4_class")), standing()
    hands.press("left_hand", 10.0, DOWN, firm=True)  # before the first measurement nobody knows
    for _ in range(15):
        plant.step(walking.command(plant.measure()))
    assert hands.lost == ("left_hand",), "nothing measured for 50 ms"
    with pytest.raises(InputError, match="force sensor at its wrist.*no hand_wrenches"):
        hands.press("right_hand", 10.0, DOWN, firm=True)
    one = np.array([[np.nan] * 6, [0.0] * 6])
    plant.step(walking.command(replace(plant.measure(), hand_wrenches=one)))
    hands.press("right_hand", 10.0, DOWN, firm=True)
    with pytest.raises(InputError, match="NaN for it"):
        hands.grip("left_hand", hands.point("left_hand", 0.5, 0.5), AHEAD, 10.0)


def test_a_hand_that_finds_no_surface_stops() -> None:
    walking, hands = standing(approach=0.2)
    trial = Trial(Plant(load("hrp4_class"), scene=make_scene("table", distance=3.0)), walking)
    hands.press("left_hand", 10.0, DOWN, firm=True)
    site = trial.plant.data.site("left_hand site")
    start = site.xpos.copy()
    trial.until(lambda: hands.lost == ("left_hand",), 4.0)
    trial.advance(0.2)
    assert np.linalg.norm(site.xpos - start) < 0.6
    hands.release("left_hand")
    assert hands.all["left_hand"].state is HandState.FREE


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda h: h.press("left_hnd", 5.0, DOWN), UnknownNameError, "left_hand"),
        (lambda h: h.release("hand"), UnknownNameError, "left_hand"),
        (lambda h: h.press("left_hand", -5.0, DOWN), InputError, "force of left_hand"),
        (lambda h: h.press("left_hand", 5.0, (0.0, 0.0, 0.0)), InputError, "must have a length"),
        (
            lambda h: h.press("left_hand", 5.0, AHEAD, at=(2.0, 0.2, 0.9)),
            InputError,
            "must be within 0.60 m of its shoulder",
        ),
        (lambda h: h.grip("left_hand", None, AHEAD, limit=5.0), InputError, "point for left_hand (m)"),
        (lambda h: h.press("left_hand", 500.0, DOWN, firm=True), InputError, "has no more torque"),
        (lambda h: h.press("left_hand", 60.0, AHEAD, at=(0.4, 0.2, 0.9)), InputError, "may press with"),
        (
            lambda h: h.grip("left_hand", (0.4, 0.2, 0.9), AHEAD, limit=60.0),
            InputError,
            "a sudden loss of 60 N",
        ),
    ],
)
def test_bad_orders_are_refused_before_anything_moves(
    call: Callable[[Any], None], error: type[Exception], message: str
) -> None:
    hands = standing()[1]
    with pytest.raises(error, match=re.escape(message)):
        call(hands)
    assert not hands.active and all(hand.state is HandState.FREE for hand in hands.all.values())


def test_a_robot_that_balances_by_its_steps_says_which_control_counts_forces_on_hands() -> None:
    walking = SteppingControl(load("g1").robot(), 0.005)
    with pytest.raises(InputError, match=re.escape("whose forces a WalkingControl counts")):
        walking.hands.press("left_hand", 5.0, DOWN)


def test_a_hand_has_a_target_or_something_to_press_on_not_both() -> None:
    walking, hands = standing()
    arm = walking.arms["left_hand"]
    at = (0.35, 0.2, 0.9)
    arm.reach(at)
    for order in (hands.press, hands.grip):
        with pytest.raises(InputError, match=re.escape("arms['left_hand'].release()")):
            order("left_hand", *((5.0, AHEAD) if order == hands.press else (at, AHEAD, 5.0)))
    assert hands.all["left_hand"].state is HandState.FREE
    hands.press("right_hand", 5.0, AHEAD)
    arm.release()
    hands.grip("left_hand", at, AHEAD, 5.0)
    with pytest.raises(InputError, match=re.escape("got [0.35, 0.2, 0.9]")):
        arm.reach(at)
    assert arm.target is None
    hands.release("left_hand")
    arm.reach(at)
    assert arm.target is not None


def test_the_bound_is_what_a_sudden_loss_leaves() -> None:
    """M g d / h: with the distance from the middle of the sole to its edge and the height of the hand."""
    walking, hands = standing(margin=0.0)
    robot = walking.controller.robot
    moment = robot.mass * GRAVITY * 0.5 * robot.soles[0].length
    here = float(robot.placement(robot.frames["left_hand"]).translation[2])
    hands.press("left_hand", moment / here - 1.0, AHEAD)
    for height in (1.05, 0.9, 0.75):
        bound, at = moment / height, (0.3, 0.2, height)
        with pytest.raises(InputError, match=f"may press with {bound:.0f} N"):
            hands.press("left_hand", bound + 1.0, AHEAD, at=at)
        hands.press("left_hand", bound - 1.0, AHEAD, at=at)
    # The left hand is on its way to 0.75 m, and counts there.
    left = bound - 1.0
    rest = (moment - 0.75 * left) / 1.05
    with pytest.raises(InputError, match=f"right_hand may press with {rest:.0f} N"):
        hands.press("right_hand", 20.0, AHEAD, at=(0.3, -0.2, 1.05))


@pytest.mark.parametrize("yaw", [0.5 * np.pi, -2.3])
def test_the_bound_goes_with_the_heading_of_the_robot(yaw: float) -> None:
    """Before the hands have ever moved, too: soles are longer than wide wherever the robot looks."""
    robot, words = load("hrp4_class").robot(), []
    for turn in (0.0, yaw):
        q = np.array(robot.half_sitting)
        q[:7] = pin.SE3ToXYZQUAT(pin.SE3(pin.utils.rotate("z", turn), np.zeros(3)) * pin.XYZQUATToSE3(q[:7]))
        robot.update(q, np.zeros(robot.nv))
        settings = WalkingControlSettings(hands=HandSettings())
        hands = WalkingControl(robot, FootstepPlan.standing(robot), 0.005, settings).hands
        assert hands is not None
        assert hands.heading == pytest.approx(turn)
        hands.slip = 0.1
        assert hands.heading == pytest.approx(turn + 0.1)
        for along in (AHEAD, (0.0, 1.0, 0.0), (0.8, -0.6, 0.0)):
            with pytest.raises(InputError) as refused:
                hands.press("left_hand", 60.0, pin.utils.rotate("z", turn) @ along, at=(0.1, 0.1, 0.9))
            words.append(str(refused.value))
    assert words[:3] == words[3:]


def held_hand(force: float, **settings: Any) -> tuple[Hands, Hand, Callable[[float], None]]:
    """Return hands of which the left one holds with a force, and a tick of it with what the QP gives at most."""
    hands = standing(**settings)[1]
    return hands, *hold(hands, "left_hand", AHEAD, force)


def hold(hands: Hands, name: str, along: Any, force: float) -> tuple[Hand, Callable[[float], None]]:
    hand, middle = hands.all[name], MovingFrame([np.zeros(3)] * 2, 0.0)

    def tick(most: float) -> None:
        felt = max(hand.target, 2.0 * hands.settings.touch)
        chosen = np.minimum((0.0, 0.0, most), hand._force.target)
        wrench = np.concatenate((-felt * hand.direction, np.zeros(3)))
        hand.update(wrench, np.eye(3), chosen, middle, 0.005)

    hands.press(name, force, along, firm=True)
    while hand.state is not HandState.HOLD or hand.target < force:
        tick(np.inf)
    return hand, tick


def test_an_arm_that_has_its_force_again_gives_it_again() -> None:
    _, hand, tick = held_hand(30.0, ramp=0.1)
    for most, given, bounded in (
        (50.0, 30.0, False),
        (20.0, 20.0, True),
        (25.0, 25.0, True),
        (50.0, 30.0, False),
    ):
        for _ in range(3):
            tick(most)
            assert (hand.target, hand.bounded) == (pytest.approx(given), bounded)


@pytest.mark.parametrize("extra", [12.0, -12.0])
def test_a_hand_that_is_let_go_gives_its_part_of_the_balance_back_with_its_force(extra: float) -> None:
    hands, hand, tick = held_hand(30.0, help=1.0, ramp=1.0)
    hand.extra = extra
    tick(np.inf)
    hands.release("left_hand")
    targets = [hand.target]
    while hand.state is HandState.HOLD:
        hands.help(np.array((0.0, 20.0)), np.zeros(3), 0.005)
        tick(np.inf)
        targets.append(hand.target)
    assert targets[0] == pytest.approx(30.0 + extra) and targets[-1] == 0.0
    assert np.abs(np.diff(targets)).max() < 2.0 * 42.0 * 0.005, "twice the mean slope of the ramp"
    assert not hands._missing.any(), "the next hand that presses begins with no moment of this one"


def test_a_hand_that_presses_lets_go_before_it_grips() -> None:
    hands, hand, tick = held_hand(20.0)
    with pytest.raises(InputError, match=re.escape("release('left_hand') and wait until it is free")):
        hands.grip("left_hand", (0.35, 0.2, 0.9), AHEAD, 10.0)
    assert hand.state is HandState.HOLD and hand.target == pytest.approx(20.0)
    hands.release("left_hand")
    while hand.state is not HandState.FREE:
        tick(np.inf)
    hands.grip("left_hand", (0.35, 0.2, 0.9), AHEAD, 10.0)
    assert hand.state is HandState.REACH


# ---- in a tick: against closed forms -------------------------------------------------------------------------------


def test_a_follower_is_critically_damped_and_a_frame_between_the_feet_says_how_its_points_move() -> None:
    """After a step of 1: 1 − (1 + t/T) exp(−t/T)."""
    dt, follower = 1e-4, Follower(0.3, 0.0)
    for _ in range(5000):
        follower.follow(1.0 - follower.value, dt)
    s, decay = 0.5 / 0.3, np.exp(-0.5 / 0.3)
    assert follower.value == pytest.approx(1.0 - (1.0 + s) * decay, abs=1e-3)
    assert follower.velocity == pytest.approx(s * decay / 0.3, abs=1e-3)
    assert follower.acceleration == pytest.approx((1.0 - s) * decay / 0.09, abs=1e-2)
    feet = np.array([(0.0, 0.1, 0.0), (0.1, -0.1, 0.02)])
    frame, held = MovingFrame(feet, 3.0), pin.SE3.Random()
    np.testing.assert_allclose(frame.placement.translation, (0.05, 0.0, 0.01))
    for _ in range(3000):
        before = frame.placement.act(held.translation)
        frame.update([feet[0] + (0.4, 0.2, 0.1), feet[1] + (0.4, 0.2, 0.1)], -3.0, dt)
    after = frame.placement.act(held.translation)
    np.testing.assert_allclose(frame.velocity(after), (after - before) / dt, atol=1e-3)
    part = 1.0 - (1.0 + 0.3 / FOLLOW) * np.exp(-0.3 / FOLLOW)
    np.testing.assert_allclose(
        frame.placement.translation, np.array((0.05, 0.0, 0.01)) + part * np.array((0.4, 0.2, 0.1)), atol=1e-3
    )
    turned = pin.log3(frame.placement.rotation @ pin.utils.rotate("z", 3.0).T)[2]
    assert turned == pytest.approx(part * (2.0 * np.pi - 6.0), abs=1e-3), "the short way round"


class Felt:
    """Hands of a robot that stands, with readings of any wrenches of the surroundings, in world axes at each hand."""

    def __init__(self, **settings: Any) -> None:
        self.walking, self.hands = standing(**settings)
        self.robot, self.measured = self.walking.controller.robot, Plant(load("hrp4_class")).measure()
        self.tare = np.array([(3.0, -2.0, 1.0, 0.1, 0.2, -0.3), (-1.0, 2.0, 4.0, 0.3, -0.1, 0.2)])
        self.wrenches, self.yaw = np.zeros((2, 6)), 0.0
        self.feet = [self.robot.placement(sole.frame).translation.copy() for sole in self.robot.soles]
        self.pendulum = Pendulum.at_rest(self.robot.com)
        for hand, place in zip(self.hands.all.values(), self.places, strict=True):
            ahead = place.rotation @ hand.arm.axis()
            self.hands.grip(hand.name, place.translation + (0.14 + GAP) * ahead, ahead, 8.0)
        for _ in range(2):  # hands arrive where they are, and take their readings for those of no contact
            self.tick(0.5 * self.hands.settings.reach, Phase.STANDING)
        assert [hand.state for hand in self.hands.all.values()] == 2 * [HandState.GRIP] and self.hands.there

    @property
    def places(self) -> list[pin.SE3]:
        return [self.robot.placement(self.robot.frames[name]) for name in self.hands.all]

    def tick(self, dt: float, phase: Phase = Phase.DOUBLE) -> Any:
        readings = [
            np.concatenate((place.rotation.T @ wrench[:3], place.rotation.T @ wrench[3:]))
            for place, wrench in zip(self.places, self.wrenches, strict=True)
        ]
        measured = replace(self.measured, hand_wrenches=np.array(readings) + self.tare)
        feet = [FootMotion.at_rest(pin.SE3(np.eye(3), foot)) for foot in self.feet]
        reference = Reference(self.pendulum, (feet[0], feet[1]), heading=self.yaw, phase=phase)
        return self.hands.update(measured, reference, dt)


def test_measured_wrenches_are_filtered_for_the_balance_the_servos_and_the_lean() -> None:
    felt = Felt()
    hands, dt = felt.hands, 0.05
    felt.robot.carry(felt.robot.torso_frame, 0.2 * felt.robot.mass)  # a known load
    felt.wrenches = np.array([(-8.0, 3.0, 5.0, 0.7, -0.2, 0.4), (-4.0, -2.0, 3.0, -0.3, 0.6, 0.1)])
    place = [each.translation for each in felt.places]
    moments = felt.wrenches[:, 3:] + np.cross(place, felt.wrenches[:, :3])
    whole = np.concatenate((felt.wrenches[:, :3].sum(axis=0), moments.sum(axis=0)))
    outside = [felt.tick(dt) for _ in range(10)][-1]
    np.testing.assert_allclose(outside, -np.expm1(-10 * dt / FILTER_TIME) * whole, rtol=1e-9)
    slow = -np.expm1(-10 * dt / SLOW_TIME)
    for hand, there, wrench in zip(hands.all.values(), felt.places, felt.wrenches, strict=True):
        turned = np.concatenate((there.rotation.T @ wrench[:3], there.rotation.T @ wrench[3:]))
        np.testing.assert_allclose(hand._wrench.target, slow * turned, rtol=1e-9, atol=1e-12)
    for _ in range(150):
        felt.tick(0.1)
    zmp = felt.pendulum.zmp
    weight = felt.robot.mass * GRAVITY
    # Moments about the ZMP over the weight, against which the CoM leans.
    moment = whole[3:] - np.cross(zmp, whole[:3])
    lean = np.array([-moment[1], moment[0]]) / weight
    np.testing.assert_allclose(hands.shift, lean, atol=1e-5)
    shifted = hands.shifted(felt.pendulum)
    np.testing.assert_allclose(shifted.com[:2] - felt.pendulum.com[:2], lean, atol=1e-5)
    felt.wrenches[:] = 0.0
    for name in hands.all:
        hands.release(name)
    while hands.active:
        assert felt.tick(0.1) is not None
    assert felt.tick(dt) is None and not hands.shift.any() and not hands.outside.any()


@pytest.mark.parametrize("angle", [0.3, 1.2, -2.0])
def test_the_feet_bear_a_force_as_far_as_the_edge_lets_their_zmp_go(angle: float) -> None:
    free, bound = Felt(), Felt(edge=0.2)
    for felt in (free, bound):
        felt.yaw = 0.7
        felt.wrenches[:, :2] = 12.0 * np.array((np.cos(angle), np.sin(angle)))
        for _ in range(150):
            felt.tick(0.1)
    goal = free.hands.shift
    size = np.linalg.norm(goal)
    ahead, aside = pin.utils.rotate("z", -0.7)[:2, :2] @ goal / size
    sole = free.robot.soles[0]
    to_edge = 0.5 / max(abs(ahead) / sole.length, abs(aside) / sole.width)
    np.testing.assert_allclose(bound.hands.shift, goal * (1.0 - 0.2 * to_edge / size), rtol=1e-3)


@pytest.mark.parametrize("rests", [False, True])
def test_hands_that_grip_yield_to_a_squeeze_to_the_vertical_and_to_more_than_their_limits(
    rests: bool,
) -> None:
    """Not to a couple, which turns what they hold; at rest to a part of everything."""
    felt = Felt()
    part = -np.expm1(-0.2 / FILTER_TIME)  # of the low-pass
    common, couple, squeeze, up = (30.0, -6.0, 0.0), (9.0, 0.0, 0.0), (0.0, 7.0, 0.0), (0.0, 0.0, 5.0)
    forces = np.array([np.add(common, couple) + squeeze + up, np.subtract(common, couple) - squeeze - up])
    felt.wrenches[:, :3] = forces / part
    for _ in range(4):
        felt.tick(0.05, Phase.STANDING if rests else Phase.DOUBLE)
    size = 2.0 * np.linalg.norm(common)
    more = (size - 16.0) / size * np.array(common)
    expected = np.array([more + squeeze, more - np.array(squeeze)])
    expected += (RELAX if rests else 0.0) * (forces - expected)
    expected[:, 2] = 5.0, -5.0
    for hand, excess in zip(felt.hands.all.values(), expected, strict=True):
        np.testing.assert_allclose(hand.excess, excess, atol=1e-9)
    felt.wrenches[:, :3] *= 0.2
    for _ in range(20):
        felt.tick(0.05)
    np.testing.assert_allclose(felt.hands.all["left_hand"].excess, (0.0, 1.4 / part, 1.0 / part), atol=1e-6)


def test_a_hand_that_grips_goes_with_the_feet_and_yields_by_its_excess() -> None:
    felt = Felt()
    hand, place = felt.hands.all["left_hand"], felt.places[0].copy()
    felt.wrenches[:, 2] = 6.0, -2.0
    felt.wrenches[:, 1] = 9.0, -9.0
    before = pin.SE3.Identity()
    middle = 0.5 * (felt.feet[0] + felt.feet[1])
    felt.feet, felt.yaw = [foot + (0.2, 0.1, 0.05) for foot in felt.feet], 0.4
    for _ in range(300):
        before = hand.task.target
        felt.tick(0.001)
    speed = (hand.task.target.translation - before.translation) / 0.001
    np.testing.assert_allclose(
        hand.task.target.rotation @ hand.task.feedforward_velocity[:3], speed, atol=5e-3
    )
    for _ in range(60):
        felt.tick(0.1)
    move = pin.SE3(pin.utils.rotate("z", 0.4), middle + (0.2, 0.1, 0.05)) * pin.SE3(np.eye(3), -middle)
    np.testing.assert_allclose(hand.task.target.homogeneous, (move * place).homogeneous, atol=1e-6)
    np.testing.assert_allclose(hand.excess, (0.0, 9.0, 6.0), atol=1e-6)
    yields = hand.task.measured_wrench
    np.testing.assert_allclose(place.rotation @ yields[:3], hand.excess, atol=1e-9)
    assert not yields[3:].any() and not hand.task.target_wrench.any() and hand.bounded
    felt.wrenches[:, 1] = 3.5, -3.5
    for _ in range(40):
        felt.tick(0.05)
    assert not hand.bounded, "less than a touch; the vertical does not count"


def test_hands_that_press_take_over_a_moment_that_the_feet_cannot_give() -> None:
    hands, left, tick = held_hand(30.0, help=0.6, ramp=0.1)
    right = hold(hands, "right_hand", (0.0, 0.8, -0.6), 20.0)[0]
    zmp, missing, dt = np.array((0.02, -0.01, 0.03)), np.array((7.0, -4.0)), 0.002
    lacks = missing * (1.0 - HELP_FROM / np.linalg.norm(missing))

    def moment() -> np.ndarray[Any, Any]:
        """Of the forces for the balance, about the horizontal axes through the ZMP."""
        forces = [-hand.extra * hand.direction for hand in (left, right)]
        arms = [hands._place(hand.name).translation - zmp for hand in (left, right)]
        return np.asarray(np.cross(arms, forces).sum(axis=0)[:2])

    hands.help(missing, zmp, dt)
    first = -np.expm1(-dt / HELP_TIME) * dt / HELP_TIME
    np.testing.assert_allclose(moment(), 0.6 * first * lacks, rtol=0.01)
    for _ in range(800):
        hands.help(missing, zmp, 0.01)
    np.testing.assert_allclose(moment(), 0.6 / HELP_LEAK * lacks, rtol=0.01)
    for _ in range(800):
        hands.help(0.9 * HELP_FROM * missing / np.linalg.norm(missing), zmp, 0.01)
    np.testing.assert_allclose(moment(), 0.0, atol=1e-3)


def test_a_hand_that_holds_presses_another_way_with_another_force() -> None:
    hands, hand, tick = held_hand(20.0, ramp=0.1)
    hands.press("left_hand", 12.0, (3.0, 0.0, -4.0), firm=True)
    np.testing.assert_allclose(hand.direction, (0.6, 0.0, -0.8))
    np.testing.assert_allclose(hand.contact.normal, (-0.6, 0.0, 0.8))
    for _ in range(25):
        tick(np.inf)
    assert hand.state is HandState.HOLD and hand.target == pytest.approx(12.0)
