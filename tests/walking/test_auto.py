"""A walk whose law changes while the robot stands: references go on, orders choose the law, steps keep it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import wbc
from wbc.base.errors import InputError
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.trial.falls import TrueFallDetector
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings, walk_distance

DT = 0.002


def control(name: str, plan: FootstepPlan | None = None) -> WalkingControl:
    robot = wbc.load_robot(name).robot()
    plan = plan or FootstepPlan.standing(robot)
    return WalkingControl(robot, plan, DT, WalkingControlSettings(mode="torque"))


def standing(name: str = "g1") -> tuple[wbc.Plant, WalkingControl]:
    plant = wbc.Plant(wbc.load_robot(name), noise="realistic", seed=3, control_period=DT)
    return plant, control(name)


def run(plant: wbc.Plant, walking: WalkingControl, seconds: float) -> None:
    falls, end = TrueFallDetector(plant.robot), plant.time + seconds
    while plant.time < end - 1e-9:
        plant.step(walking.command(plant.measure()))
        assert not falls.fallen(plant.truth().q), f"fallen at {plant.time:.2f} s by {walking.law}"


def test_a_change_of_law_in_a_stand_leaves_references_and_posture_where_they_are() -> None:
    plant, walking = standing()
    assert walking.law == "stepping"
    walking.calm = 60.0
    run(plant, walking, 0.8)
    for law in ("lipm", "stepping"):
        before, posture = walking.reference, walking.tasks.posture.target
        walking.change(law)  # type: ignore[arg-type]
        plant.step(walking.command(plant.measure()))
        after = walking.reference
        assert walking.law == law and before is not None and after is not None
        assert walking.control.failures == 0 and after.contact == (True, True)
        np.testing.assert_allclose(after.pendulum.com, before.pendulum.com, atol=5e-3)
        np.testing.assert_allclose(after.pendulum.com_velocity, before.pendulum.com_velocity, atol=0.05)
        assert after.heading == pytest.approx(before.heading, abs=0.02)
        for foot, same in zip(after.feet, before.feet, strict=True):
            np.testing.assert_allclose(foot.placement.translation, same.placement.translation, atol=2e-3)
        np.testing.assert_allclose(walking.tasks.posture.target, posture)
        run(plant, walking, 0.3)
    assert walking.fallen is None


def test_hand_gaze_and_height_of_a_robot_that_stands_are_where_they_were_set_under_both_laws() -> None:
    plant, walking = standing("hrp4_class")
    walking.calm = 60.0
    run(plant, walking, 0.8)
    hand, body = walking.arms["right_hand"], walking.body
    posture = {law: parts.tasks.posture.weight.copy() for law, parts in walking.laws.items()}
    place = walking.controller.robot.placement(hand.frame).translation + [0.12, 0.0, 0.15]
    body.com_height = height = body.com_height - 0.04
    hand.reach(place, speed=0.3)
    body.look_at([3.0, 1.0, 1.0])
    real = plant.description.robot()
    for law in ("stepping", "lipm"):
        walking.change(law)  # type: ignore[arg-type]
        assert body.com_height == pytest.approx(height)
        run(plant, walking, 2.2)
        assert hand.reached and body.looking and body.reached
        truth = plant.truth()
        real.update(truth.q, truth.v)
        soles = [real.placement(sole.frame).translation[2] for sole in real.soles]
        assert truth.com[2] - np.mean(soles) == pytest.approx(height, abs=0.01)
        np.testing.assert_allclose(real.placement(hand.frame).translation, place, atol=0.02)
    hand.release()
    run(plant, walking, 0.5)
    for law, parts in walking.laws.items():
        np.testing.assert_array_equal(parts.tasks.posture.weight, posture[law])


def test_orders_choose_the_law_of_a_robot_that_stands() -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    flat = walk_distance(FootstepPlan.standing(robot), 0.3)
    stairs = replace(flat, steps=[replace(step, z=0.05 * i) for i, step in enumerate(flat.steps)])
    for plan, law in ((flat, "stepping"), (stairs, "lipm"), (None, "stepping")):
        assert control("hrp4_class", plan).law == law
        walking = control("hrp4_class")
        if plan is not None:
            walking.follow(plan)
            assert walking.law == law and not walking.finished
        walking.velocity = (0.2, 0.0, 0.0)
        assert walking.velocity == (0.2, 0.0, 0.0)


def test_hands_that_are_to_press_choose_the_law_that_counts_their_forces() -> None:
    plant, walking = standing("hrp4_class")
    run(plant, walking, 0.05)
    assert walking.hands.all and walking.law == "stepping"
    place = walking.hands.point("left_hand", 0.6, 0.2)
    walking.hands.press("left_hand", 4.0, (1.0, 0.0, 0.0), at=place, firm=True)
    run(plant, walking, 0.02)
    assert walking.law == "lipm" and walking.hands.wanted
    walking.hands.barred = "the robot steps"
    with pytest.raises(InputError, match="the robot steps"):
        walking.hands.press("left_hand", 4.0, (1.0, 0.0, 0.0), at=place)


def test_a_question_changes_no_law_and_a_posture_move_outlives_a_change() -> None:
    """All that a walk can be asked for between ticks is read; then the law changes in the middle of a move."""
    plant, walking = standing()
    walking.calm = 60.0
    run(plant, walking, 0.1)
    joint = "left_elbow_joint"
    index = plant.robot.joint_index(joint)
    begin = walking.tasks.posture.target[index]
    walking.tasks.posture.move_to({joint: begin + 0.1}, duration=0.3)
    run(plant, walking, 0.1)
    for name in dir(type(walking)):
        if not name.startswith("_") and isinstance(getattr(type(walking), name), property) and name != "walk":
            getattr(walking, name)
    assert walking.law == "stepping" and walking.tasks.posture.moving
    walking.change("lipm")
    assert walking.tasks.posture.moving
    run(plant, walking, 0.1)
    walking.change("stepping")
    run(plant, walking, 0.12)
    assert not walking.tasks.posture.moving
    assert walking.tasks.posture.target[index] == pytest.approx(begin + 0.1, abs=1e-9)


def test_what_a_user_has_set_holds_under_both_laws() -> None:
    """Gains of tasks and of the stabilizer, and time constants of an observer that is given; the rest is the law's."""
    robot = wbc.load_robot("g1").robot()
    given = ObserverSettings(inertial=InertialSettings(velocity_time_constant=0.03, tilt_time_constant=3.0))
    walking = WalkingControl(
        robot,
        FootstepPlan.standing(robot),
        DT,
        WalkingControlSettings(mode="torque"),
        observer=Observer(robot, given, adopt=True),
    )
    own = {law: parts.tasks.posture.stiffness.copy() for law, parts in walking.laws.items()}
    assert not np.array_equal(own["lipm"], own["stepping"])
    walking.controller.task("pelvis").weight = 55.0
    walking.controller.task("posture").damping = 9.0
    assert walking.stabilizer is not None
    walking.stabilizer.gains = replace(walking.stabilizer.gains, dcm_p=3.21)
    for law in ("lipm", "stepping", "lipm"):
        walking.change(law)  # type: ignore[arg-type]
        assert walking.law == law
        np.testing.assert_array_equal(walking.controller.task("pelvis").weight, [55.0] * 3)
        np.testing.assert_array_equal(walking.tasks.posture.damping, np.full(robot.na, 9.0))
        np.testing.assert_array_equal(walking.tasks.posture.stiffness, own[law])
        assert walking.stabilizer.gains.dcm_p == (3.21, 3.21)
        inertial = walking.control.observer.inertial.settings
        assert (inertial.velocity_time_constant, inertial.tilt_time_constant) == (0.03, 3.0)
        assert inertial.yaw_time_constant == (1000.0 if law == "stepping" else 1.0)


def test_an_order_that_is_dropped_is_over_and_not_finished() -> None:
    plant, walking = standing()
    run(plant, walking, 0.05)
    far = walk_distance(FootstepPlan.standing(walking.controller.robot), 0.4)
    walking.follow(replace(far, steps=[replace(step, x=step.x + 2.0) for step in far.steps]))
    assert not walking.finished and not walking.done
    run(plant, walking, 0.6)
    assert "within reach" in walking.source.reason
    assert walking.done and not walking.finished
    walking.change("lipm")
    assert walking.done and not walking.finished
    walking.stop()
    assert walking.finished


@pytest.mark.parametrize(("robot", "foot"), [("hrp4_class", "long_arch"), ("g1", "flat")])
def test_a_distance_is_a_goal_and_footsteps_that_are_given_stay(robot: str, foot: str) -> None:
    spec = WalkSpec(robot=robot, foot=foot, law="auto", plan=WalkPlan(distance=1.0))
    walk = spec.prepare()
    assert not walk.plan.steps and walk.arrival() is not None
    for law in ("auto", "stepping"):
        given = replace(spec, law=law, plan=WalkPlan(footsteps=walk.way.steps[:2])).prepare()
        assert given.plan.steps[:2] == walk.way.steps[:2]


@pytest.mark.slow
def test_a_plan_is_walked_after_a_drive_once_the_robot_stands() -> None:
    plant, walking = standing()
    run(plant, walking, 0.5)
    walking.velocity = (0.3, 0.0, 0.0)
    run(plant, walking, 2.0)
    assert walking.law == "stepping"
    with pytest.raises(InputError, match="law"):
        walking.change("lipm")
    walking.stop()
    run(plant, walking, 2.5)
    assert walking.finished
    walking.follow(walk_distance(FootstepPlan.standing(walking.controller.robot), 0.1))
    assert walking.law == "stepping"
    steps = walking.steps_done
    run(plant, walking, 4.0)
    assert walking.steps_done >= steps + 2 and walking.source.reason == ""
