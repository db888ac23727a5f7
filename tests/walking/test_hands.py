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
from wbc.tasks.motion.direction import least_turn
from wbc.tasks.stabilizer.zmp import zmp_offset
from wbc.walking import (
    FootstepPlan,
    HandSettings,
    SteppingControl,
    WalkingControl,
    WalkingControlSettings,
    walk_distance,
)
from wbc.walking.hands.hand import Hand, HandState
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.motion import MovingFrame

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


@pytest.mark.parametrize(
    ("above", "force", "moment", "offset"),
    [
        (0.9, (0.0, 0.0, 60.0), (0.0, 0.0, 0.0), (0.0, 0.0)),
        (0.9, (-30.0, 0.0, 0.0), (0.0, 0.0, 0.0), (-0.9 * 30.0 / 400.0, 0.0)),
        (0.9, (0.0, 20.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.9 * 20.0 / 400.0)),
        (0.0, (0.0, 0.0, 0.0), (0.0, 8.0, 0.0), (0.02, 0.0)),
    ],
)
def test_offsets_that_are_known_exactly(above: float, force: Any, moment: Any, offset: Any) -> None:
    z = np.array([0.1, 0.05, 0.0])
    wrench = wrench_at(z + (0.0, 0.0, above), force, moment)
    assert zmp_offset(wrench, z, 400.0) == pytest.approx(offset)


# ---- in the plant --------------------------------------------------------------------------------------------------


def pressing(noise: str | SensorNoise = "none", extra: float = 0.0) -> tuple[Trial, Hands]:
    """Return a robot whose hands press 25 N each on a table, with a known load on its trunk."""
    walking, hands = standing(reach=1.2, ramp=0.8)
    trial = Trial(Plant(load("hrp4_class"), scene=make_scene("table", **TABLE), noise=noise), walking)
    robot = walking.controller.robot
    robot.carry(robot.torso_frame, extra * robot.mass)
    trial.plant.load(robot.torso_frame, robot.mass - trial.plant.robot.mass)
    walking.stabilizer.mass, walking.walk.phases.weight = robot.mass, robot.mass * GRAVITY
    trial.advance(0.1)
    for side, y in (("left", 0.2), ("right", -0.2)):
        hands.press(f"{side}_hand", 25.0, DOWN, at=(0.24, y, TABLE["height"]), firm=True)
    trial.advance(2.8)
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


@pytest.mark.slow
def test_a_heavier_robot_shifts_its_com_less_for_the_same_force() -> None:
    """A fifth of the weight on the trunk, known to the models."""
    trial, hands = pressing(extra=0.2)
    expected = shift_of(trial)
    assert abs(expected[0]) > 0.02 and hands.shift == pytest.approx(expected, abs=2e-3)


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


@pytest.mark.parametrize("turned", [0.0, 1e-9, 0.3, 2.0, np.pi - 1e-9, np.pi])
def test_the_least_turn_brings_an_axis_to_a_direction(turned: float) -> None:
    for axis, across in ((AHEAD, (0.0, 1.0, 0.0)), (DOWN, AHEAD), ((0.0, 0.6, 0.8), AHEAD)):
        direction = np.cos(turned) * np.array(axis) + np.sin(turned) * np.array(across)
        turn = least_turn(np.array(axis), direction)
        np.testing.assert_allclose(pin.exp3(turn) @ axis, direction, atol=1e-6)
        assert np.linalg.norm(turn) == pytest.approx(turned, abs=1e-6)


@pytest.mark.parametrize("offset", [1.0, 5.0, 12.0])
def test_any_offset_of_a_wrist_is_tared_on_the_way_to_a_surface(offset: float) -> None:
    """Also one that is more than a touch; a touch on the way counts to the tare no more than before."""
    hands = standing()[1]
    hand, middle = hands.all["left_hand"], MovingFrame([np.zeros(3)] * 2, 0.0)
    place = hands._place("left_hand")
    hand.press(np.array(AHEAD), 20.0, place.translation + 0.3 * np.array(AHEAD))
    for tick in range(20):
        reading = np.array([0.0, 0.0, offset + (50.0 if tick == 10 else 0.0), 0.0, 0.0, 0.0])
        hand.update(reading - hand.tare, place.rotation, None, middle, 0.005)
    assert hand.state is HandState.REACH
    np.testing.assert_allclose(hand.tare, [0.0, 0.0, offset, 0.0, 0.0, 0.0], atol=1e-9)


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


@pytest.mark.slow
def test_impossible_readings_of_a_wrist_are_refused_and_a_dead_sensor_lets_go() -> None:
    trial, hands = pressing()
    control, plant = trial.walking.control, trial.plant
    shift, felt = hands.shift.copy(), hands.outside.copy()

    def tick(value: float, ticks: int) -> None:
        for _ in range(ticks):
            measured = plant.measure()
            wrenches = np.array(measured.hand_wrenches)
            wrenches[0, 2] = value
            plant.step(trial.walking.command(replace(measured, hand_wrenches=wrenches)))

    for value in (1e5, np.inf, -1e9):
        tick(value, 3)
        assert control.status() == "refused: force sensor of left_hand"
        trial.advance(0.02)
        assert control.status() == "ok"
    assert hands.there
    assert hands.shift == pytest.approx(shift, abs=1e-3) and hands.outside == pytest.approx(felt, abs=3.0)
    tick(1e5, 15)
    assert hands.lost == ("left_hand",) and control.failures == 0
    trial.advance(1.0)
    assert hands.all["right_hand"].state is HandState.HOLD


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


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "height"), [("hrp4_class", 0.9), ("g1", 0.85)])
def test_a_cart_is_pushed_and_no_force_on_the_hands_moves_a_landing(robot: str, height: float) -> None:
    walking, hands = standing(robot)
    scene = make_scene("cart", distance=0.37, handle=height, resistance=15.0)
    trial = Trial(Plant(load(robot), scene=scene, noise="realistic"), walking)
    cart, model = trial.plant.data.body("scene/cart").xpos, walking.controller.robot
    for side, y in (("left", 0.2), ("right", -0.2)):
        hands.grip(f"{side}_hand", (0.37, y, height), AHEAD, limit=13.0)
    trial.until(lambda: hands.there, 4.0)
    for side in ("left", "right"):
        trial.plant.grip(f"{side}_hand", f"{side} handle")
    trial.advance(1.0)
    before, plan, pushed = cart.copy(), walk_distance(FootstepPlan.standing(model), 0.4), []
    trial.follow(plan, 4.0, lambda: pushed.append(float(np.linalg.norm(hands.outside[:2]))))
    assert cart - before == pytest.approx([0.4, 0.0, 0.0], abs=0.03)
    for foot, planned in zip(model.soles, plan.steps[-2:], strict=True):
        assert abs(model.placement(foot.frame).translation[1]) == pytest.approx(abs(planned.y), abs=0.01)
    assert np.linalg.norm(hands.outside[:2]) < 0.5 * max(pushed), "and it fades at rest"


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
        for along in (AHEAD, (0.0, 1.0, 0.0), (0.8, -0.6, 0.0)):
            with pytest.raises(InputError) as refused:
                hands.press("left_hand", 60.0, pin.utils.rotate("z", turn) @ along, at=(0.1, 0.1, 0.9))
            words.append(str(refused.value))
    assert words[:3] == words[3:]


def held_hand(force: float, **settings: Any) -> tuple[Hands, Hand, Callable[[float], None]]:
    """Return hands of which the left one holds with a force, and a tick of it with what the QP gives at most."""
    hands = standing(**settings)[1]
    hand, middle = hands.all["left_hand"], MovingFrame([np.zeros(3)] * 2, 0.0)

    def tick(most: float) -> None:
        felt = max(hand.target, 2.0 * hands.settings.touch)
        chosen = np.minimum((0.0, 0.0, most), hand._force.target)
        hand.update(np.array([-felt, 0.0, 0.0, 0.0, 0.0, 0.0]), np.eye(3), chosen, middle, 0.005)

    hands.press("left_hand", force, AHEAD, firm=True)
    while hand.state is not HandState.HOLD or hand.target < force:
        tick(np.inf)
    return hands, hand, tick


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
