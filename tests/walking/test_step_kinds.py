"""Kinds of steps, which change while the robot stands: references go on, mode and orders choose, steps keep them."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest

import wbc
from wbc.base.errors import InputError
from wbc.core.drive.control import State
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.trial.falls import TrueFallDetector
from wbc.sim.walks.settings import without_law
from wbc.walking import (
    FootstepPlan,
    Gait,
    LoadSettings,
    WalkingControl,
    WalkingControlSettings,
    walk_distance,
    walk_velocity,
)
from wbc.walking.contact import GaitPhase
from wbc.walking.plans.sources import FootstepSource, PlanSource, Standing
from wbc.walking.source import StandSource
from wbc.walking.steps import com_height

DT = 0.002


def control(name: str, plan: FootstepPlan | None = None) -> WalkingControl:
    robot = wbc.load_robot(name).robot()
    plan = plan or FootstepPlan.standing(robot)
    return WalkingControl(robot, plan, DT, WalkingControlSettings(mode="torque"))


def standing(name: str = "g1") -> tuple[wbc.Plant, WalkingControl]:
    wrists = wbc.sim.Machine(hand_sensors=True)
    plant = wbc.Plant(wbc.load_robot(name), noise="realistic", seed=3, control_period=DT, machine=wrists)
    return plant, control(name)


class Staying(WalkingControl):
    """Control whose kind of steps stays as it is set, whatever the robot does."""

    __slots__ = ()

    def _choose(self, state: State) -> None: ...


def stay(walking: WalkingControl) -> None:
    walking.__class__ = Staying


def run(plant: wbc.Plant, walking: WalkingControl, seconds: float) -> None:
    falls, end = TrueFallDetector(plant.robot), plant.time + seconds
    while plant.time < end - 1e-9:
        plant.step(walking.command(plant.measure()))
        assert not falls.fallen(plant.truth().q), f"fallen at {plant.time:.2f} s in {walking.step_kind} steps"


def test_a_change_of_steps_in_a_stand_leaves_references_and_posture_where_they_are() -> None:
    plant, walking = standing()
    assert walking.step_kind == "free"
    run(plant, walking, 0.8)
    stay(walking)
    for kind in ("planned", "free"):
        before, posture = walking.reference, walking.tasks.posture.target
        walking._change(kind)  # type: ignore[arg-type]
        plant.step(walking.command(plant.measure()))
        after = walking.reference
        assert walking.step_kind == kind and before is not None and after is not None
        assert walking.control.failures == 0 and after.contact == (True, True)
        np.testing.assert_allclose(after.pendulum.com, before.pendulum.com, atol=5e-3)
        np.testing.assert_allclose(after.pendulum.com_velocity, before.pendulum.com_velocity, atol=0.05)
        assert after.heading == pytest.approx(before.heading, abs=0.02)
        for foot, same in zip(after.feet, before.feet, strict=True):
            np.testing.assert_allclose(foot.placement.translation, same.placement.translation, atol=2e-3)
        np.testing.assert_allclose(walking.tasks.posture.target, posture)
        run(plant, walking, 0.2)
    assert walking.fallen is None


@pytest.mark.slow  # 7 s; test_arms and test_body show the same in one kind of steps
def test_hand_gaze_and_height_of_a_robot_that_stands_are_where_they_were_set_in_both_kinds_of_steps() -> None:
    plant, walking = standing("hrp4_class")
    run(plant, walking, 0.3)
    stay(walking)
    hand, body = walking.arms["right_hand"], walking.body
    posture = {kind: parts.tasks.posture.weight.copy() for kind, parts in walking._kinds.items()}
    place = walking.controller.robot.placement(hand.frame).translation + [0.12, 0.0, 0.15]
    body.com_height = height = body.com_height - 0.04
    hand.reach(place, speed=0.3)
    body.look_at([3.0, 1.0, 1.0])
    real = plant.description.robot()
    for kind in ("free", "planned"):
        walking._change(kind)  # type: ignore[arg-type]
        assert body.com_height == pytest.approx(height)
        end = plant.time + 2.2
        while plant.time < end and not (hand.reached and body.looking and body.reached):
            run(plant, walking, 0.05)
        run(plant, walking, 0.4)
        assert hand.reached and body.looking and body.reached
        truth = plant.truth()
        real.update(truth.q, truth.v)
        soles = [real.placement(sole.frame).translation[2] for sole in real.soles]
        assert truth.com[2] - np.mean(soles) == pytest.approx(height, abs=0.01)
        np.testing.assert_allclose(real.placement(hand.frame).translation, place, atol=0.02)
    hand.release()
    run(plant, walking, 0.4)
    for kind, parts in walking._kinds.items():
        np.testing.assert_array_equal(parts.tasks.posture.weight, posture[kind])


def test_orders_choose_the_steps_of_a_robot_that_stands() -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    flat = walk_distance(FootstepPlan.standing(robot), 0.3)
    stairs = replace(flat, steps=[replace(step, z=0.05 * i) for i, step in enumerate(flat.steps)])
    for plan, kind in ((flat, "free"), (stairs, "planned"), (None, "free")):
        assert control("hrp4_class", plan).step_kind == kind
        walking = control("hrp4_class")
        if plan is not None:
            walking.follow(plan)
            assert walking.step_kind == kind and not walking.finished
        walking.velocity = (0.2, 0.0, 0.0)
        assert walking.velocity == (0.2, 0.0, 0.0)
    far = replace(flat, steps=[replace(step, x=step.x + 2.0) for step in flat.steps])
    with pytest.raises(InputError, match="within reach|out of reach"):
        control("hrp4_class", far)


def test_hands_that_are_to_press_choose_the_steps_that_count_their_forces() -> None:
    plant, walking = standing("hrp4_class")
    run(plant, walking, 0.05)
    assert walking.hands.all and walking.step_kind == "free"
    place = walking.hands.point("left_hand", 0.6, 0.2)
    walking.hands.press("left_hand", 4.0, (1.0, 0.0, 0.0), at=place, firm=True)
    run(plant, walking, 0.02)
    assert walking.step_kind == "planned" and walking.hands.wanted
    walking.hands.barred = "the robot steps"
    with pytest.raises(InputError, match="the robot steps"):
        walking.hands.press("left_hand", 4.0, (1.0, 0.0, 0.0), at=place)


class Door(FootstepSource):
    """A planner that waits at a door until it opens, and goes three steps then."""

    begun: int | None = None

    def footsteps(self, now: Standing) -> FootstepPlan:
        """See `FootstepSource`."""
        if now.time < 1.5:
            return now.start
        self.begun = now.begun if self.begun is None else self.begun
        left = self.begun + 3 - now.begun
        return walk_velocity(now.start, (0.1, 0.0, 0.0), left, first=now.first) if left > 0 else now.start


@pytest.mark.parametrize("kind", [None, "free"])
def test_a_planner_that_asks_for_a_stand_is_asked_again(kind: Any) -> None:
    plant = wbc.Plant(wbc.load_robot("g1"), control_period=DT)
    walking = WalkingControl(
        plant.description.robot(), None, DT, WalkingControlSettings(mode="torque", step_kind=kind)
    )
    door = Door()
    walking.follow(door)
    assert not walking.finished
    run(plant, walking, 1.4)
    assert walking.finished and walking.source.planner is door and walking.steps_done == 0
    run(plant, walking, 0.3)
    assert not walking.finished
    run(plant, walking, 5.5)
    assert walking.finished and walking.source.planner is door and walking.source.reason == ""
    assert 3 <= walking.steps_done <= 5, "feet may have to close up"


def test_a_hand_that_has_lost_its_contact_leaves_the_robot_its_free_steps() -> None:
    plant, walking = standing()
    run(plant, walking, 0.05)
    hands, order = walking.hands, ("left_hand", 10.0, (1.0, 0.0, 0.0))
    hands.press(*order)
    run(plant, walking, 0.1)
    assert walking.step_kind == "planned" and hands.active and not walking.stands
    for _ in range(40):  # the sensor falls silent
        silent = np.full((2, 6), np.nan)
        plant.step(walking.command(replace(plant.measure(), hand_wrenches=silent)))
    assert hands.lost == ("left_hand",)
    run(plant, walking, 0.5)
    assert walking.step_kind == "free" and walking.stands and not (hands.active or hands.wanted)
    assert hands.lost == ("left_hand",), "it waits for an order"
    hands.press(*order)
    run(plant, walking, 0.02)
    assert walking.step_kind == "planned" and hands.wanted


def test_a_question_changes_no_steps_and_a_posture_move_outlives_a_change() -> None:
    """All that a walk can be asked for between ticks is read; then the steps change in the middle of a move."""
    plant, walking = standing()
    run(plant, walking, 0.1)
    stay(walking)
    joint = "left_elbow_joint"
    index = plant.robot.joint_index(joint)
    begin = walking.tasks.posture.target[index]
    walking.tasks.posture.move_to({joint: begin + 0.1}, duration=0.3)
    run(plant, walking, 0.1)
    for name in dir(type(walking)):
        if not name.startswith("_") and isinstance(getattr(type(walking), name), property) and name != "walk":
            getattr(walking, name)
    assert walking.step_kind == "free" and walking.tasks.posture.moving
    walking._change("planned")
    assert walking.tasks.posture.moving
    run(plant, walking, 0.1)
    walking._change("free")
    run(plant, walking, 0.12)
    assert not walking.tasks.posture.moving
    assert walking.tasks.posture.target[index] == pytest.approx(begin + 0.1, abs=1e-9)


def test_what_a_user_has_set_holds_in_both_kinds_of_steps() -> None:
    """Gains of tasks and of the stabilizer, and time constants of an observer that is given; the rest is the kind's."""
    robot = wbc.load_robot("g1").robot()
    given = ObserverSettings(inertial=InertialSettings(velocity_time_constant=0.03, tilt_time_constant=3.0))
    walking = WalkingControl(
        robot,
        FootstepPlan.standing(robot),
        DT,
        WalkingControlSettings(mode="torque"),
        observer=Observer(robot, given, adopt=True),
    )
    own = {kind: parts.tasks.posture.stiffness.copy() for kind, parts in walking._kinds.items()}
    assert not np.array_equal(own["planned"], own["free"])
    walking.controller.task("pelvis").weight = 55.0
    walking.controller.task("posture").damping = 9.0
    walking.controller.task("left_foot swing").weight = 7.0
    walking.controller.task("com").weight = (0.0, 0.0, 500.0)
    stabilizer = walking.stabilizer
    assert stabilizer is not None
    stabilizer.gains = replace(stabilizer.gains, dcm_p=3.21)
    gains = stabilizer.gains
    for kind in ("planned", "free", "planned"):
        walking._change(kind)  # type: ignore[arg-type]
        assert walking.step_kind == kind
        np.testing.assert_array_equal(walking.controller.task("pelvis").weight, [55.0] * 3)
        np.testing.assert_array_equal(walking.tasks.posture.damping, np.full(robot.na, 9.0))
        np.testing.assert_array_equal(walking.controller.task("left_foot swing").weight, np.full(6, 7.0))
        np.testing.assert_array_equal(walking.controller.task("com").weight, (0.0, 0.0, 500.0))
        np.testing.assert_array_equal(walking.tasks.posture.stiffness, own[kind])
        assert walking.stabilizer is stabilizer and stabilizer.gains == gains
        inertial = walking.control.observer.inertial.settings
        assert (inertial.velocity_time_constant, inertial.tilt_time_constant) == (0.03, 3.0)
        assert inertial.yaw_time_constant == (1000.0 if kind == "free" else 1.0)


@pytest.mark.parametrize("order", ["velocity", "goal"])
def test_an_order_in_the_middle_of_a_plan_takes_its_place_in_the_next_step(order: str) -> None:
    plant = wbc.Plant(wbc.load_robot("g1"), control_period=0.004)
    robot = plant.description.robot()
    walking = WalkingControl(robot, None, 0.004, WalkingControlSettings(mode="torque"))
    run(plant, walking, 0.1)
    walking.follow(walk_distance(FootstepPlan.standing(robot), 0.7))
    run(plant, walking, 1.9)
    assert walking.progress.phase is GaitPhase.SINGLE and not walking.finished and walking.velocity is None
    if order == "velocity":
        walking.velocity = (0.5, 0.0, 0.0)
    else:
        walking.go_to(2.0, 0.0, 0.0)
    phases = set()
    for _ in range(30):
        run(plant, walking, 0.05)
        phases.add(walking.progress.phase)
        assert walking.velocity == ((0.5, 0.0, 0.0) if order == "velocity" else None) and not walking.done
    assert phases == {GaitPhase.SINGLE} and walking.granted_velocity[0] > 0.2, "without a stand between"
    with pytest.raises(InputError):
        walking.velocity = (np.nan, 0.0, 0.0)


def test_an_extent_binds_steps_of_both_kinds() -> None:
    plant, extent = wbc.Plant(wbc.load_robot("g1"), control_period=0.004), (-0.6, 0.6, -0.6, 0.6)
    robot = plant.description.robot()
    for kind in ("free", "planned"):
        settings = WalkingControlSettings(mode="torque", step_kind=kind)  # type: ignore[arg-type]
        walking = WalkingControl(robot, None, 0.004, settings, extent=extent)
        with pytest.raises(InputError, match=re.escape("from -0.6 to 0.6")):
            walking.go_to(0.7, 0.0, 0.0)
        walking.go_to(0.3, 0.0, 0.0)
        walking.follow(walk_distance(FootstepPlan.standing(robot), 1.0))
        run(plant, walking, 0.5)
        assert walking.steps_done == 0 and walking.done and not walking.finished
        assert "leaves the ground" in walking.source.reason


GAINS = ("weight", "stiffness", "damping")


def gains_of(walking: WalkingControl) -> dict[str, list[Any]]:
    return {task.name: [getattr(task, gain).copy() for gain in GAINS] for task in walking.controller.tasks}


@pytest.mark.parametrize("mode", ["torque", "position"])
def test_gains_of_tasks_stay_as_they_are_set_whatever_the_robot_does(mode: Any) -> None:
    """The walk lets them act by ratios of its own: nothing is assigned at changes of phases, hands and gaze."""
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), control_period=0.004)
    walking = WalkingControl(plant.description.robot(), None, 0.004, WalkingControlSettings(mode=mode))
    hand = walking.arms["left_hand"]
    hand.reach([0.2, 0.3, 0.0], "pelvis")
    walking.body.look_at([2.0, 1.0, 1.0])
    run(plant, walking, 0.1)
    for task in walking.controller.tasks:
        for gain in GAINS:
            setattr(task, gain, 1.1 * getattr(task, gain))
    asked, scales = gains_of(walking), set()
    walking.velocity = (0.1, 0.0, 0.0)
    for seconds in (0.4, 1.6):
        end = plant.time + seconds
        while plant.time < end:
            plant.step(walking.command(plant.measure()))
            scales.add(tuple(walking.controller.task("left_foot swing").scale.tolist()))
        hand.release()
        walking.body.look_at(None)
        walking.body.turn = 0.1
    assert walking.steps_done >= 1 and len(scales) > 1 and walking.fallen is None
    for name, gains in gains_of(walking).items():
        np.testing.assert_equal(gains, asked[name], name)
    assert walking.controller.task("left_hand").idle


@pytest.mark.slow
def test_an_order_that_is_dropped_is_over_and_not_finished() -> None:
    plant, walking = standing()
    run(plant, walking, 0.05)
    far = walk_distance(FootstepPlan.standing(walking.controller.robot), 0.4)
    walking.follow(replace(far, steps=[replace(step, x=step.x + 2.0) for step in far.steps]))
    assert not walking.finished and not walking.done
    run(plant, walking, 0.6)
    assert "within reach" in walking.source.reason
    assert walking.done and not walking.finished
    walking._change("planned")
    assert walking.done and not walking.finished
    walking.stop()
    run(plant, walking, DT)
    assert walking.finished


@pytest.mark.parametrize(("robot", "foot"), [("hrp4_class", "long_arch"), ("g1", "flat")])
def test_a_distance_is_a_goal_and_footsteps_that_are_given_stay(robot: str, foot: str) -> None:
    spec = WalkSpec(robot=robot, foot=foot, mode="torque", plan=WalkPlan(distance=1.0))
    walk = spec.prepare()
    assert not walk.plan.steps and walk.arrival() is not None
    for changes in ((), (("step_kind", "free"),)):
        given = replace(spec, changes=changes, plan=WalkPlan(footsteps=walk.way.steps[:2])).prepare()
        assert given.plan.steps[:2] == walk.way.steps[:2]


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"changes": {"stepping.width": 0.4}}, "'stepping.width' is a setting of free steps.*mode='torque'"),
        ({"mode": "torque", "changes": {"step_kind": "free", "gains.dcm_p": 5.0}}, "'gains.dcm_p'.*planned"),
        ({"mode": "torque", "changes": {"step_kind": "free"}, "gait": Gait(apex=0.5)}, "no gait, got apex"),
        ({"mode": "torque", "gains": "frizza", "changes": {"stepping.width": 0.4}}, "'stepping.width'"),
    ],
)
def test_settings_of_steps_that_are_not_taken_are_refused(given: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        WalkSpec(plan=WalkPlan(distance=0.5), **given)


@pytest.mark.slow
def test_a_plan_is_walked_after_a_drive() -> None:
    plant, walking = standing()
    run(plant, walking, 0.5)
    walking.velocity = (0.3, 0.0, 0.0)
    run(plant, walking, 2.0)
    assert walking.step_kind == "free"
    assert not walking.stands
    walking.stop()
    run(plant, walking, 2.5)
    assert walking.finished
    walking.follow(walk_distance(FootstepPlan.standing(walking.controller.robot), 0.1))
    assert walking.step_kind == "free" and not walking.finished
    steps = walking.steps_done
    run(plant, walking, 5.5)
    assert walking.steps_done >= steps + 2 and walking.source.reason == ""
    assert walking.finished and walking.step_kind == "free"


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["g1", "hrp4_class"])
def test_footsteps_are_met_while_nothing_pushes(robot: str) -> None:
    """A plan is a promise: each sole lands within 10 mm of its footstep in the estimated world."""
    plant = wbc.Plant(wbc.load_robot(robot), noise="realistic", seed=3, control_period=DT)
    plan = walk_velocity(FootstepPlan.standing(plant.description.robot()), (0.08, 0.0, 0.15), 3)
    walking = control(robot, plan)
    landed, estimate = 0, walking.control.observer.robot
    while not walking.done:
        plant.step(walking.command(plant.measure()))
        if walking.steps_done > landed:
            step, landed = plan.steps[landed], landed + 1
            place = estimate.placement(estimate.soles[("left", "right").index(step.side)].frame).translation
            assert np.hypot(place[0] - step.x, place[1] - step.y) < 0.01
    assert landed == len(plan.steps) and walking.finished


def test_mode_and_load_choose_the_kinds_that_a_robot_may_take() -> None:
    robot = wbc.load_robot("g1").robot()
    for settings, kinds in (
        (WalkingControlSettings(), {"planned"}),
        (WalkingControlSettings(mode="hybrid"), {"planned", "free"}),
        (WalkingControlSettings(mode="torque", load=LoadSettings()), {"planned"}),
        (WalkingControlSettings(mode="torque", step_kind="planned"), {"planned"}),
        (WalkingControlSettings(step_kind="free"), {"free"}),
    ):
        assert set(settings.kinds) == kinds
        walking = WalkingControl(robot.clone(), None, DT, settings)
        assert walking.step_kind == ("free" if "free" in kinds else "planned")
        assert (walking.stabilizer is None) == (kinds == {"free"}) and walking.steered
        assert (walking.balance is None) == (walking.step_kind == "free")


@pytest.mark.parametrize(
    ("old", "mode", "changes"),
    [
        ({"law": "lipm"}, "position", {}),
        ({"law": "lipm", "mode": "torque"}, "torque", {"step_kind": "planned"}),
        ({"law": "lipm", "mode": "torque", "gains": "frizza"}, "torque", {}),
        ({"law": "stepping", "changes": {"gait.width": 0.4}}, "torque", {"stepping.width": 0.4}),
        ({"law": "stepping", "mode": "position"}, "position", {"step_kind": "free"}),
        ({"law": "stepping", "plan": {"footsteps": []}}, "torque", {"step_kind": "free"}),
        (
            {"law": "auto", "mode": "hybrid", "changes": {"lipm.gains.com_p": 1.0}},
            "hybrid",
            {"gains.com_p": 1.0},
        ),
        ({"law": "auto", "changes": {"stepping.gait.width": 0.4}}, "torque", {"stepping.width": 0.4}),
    ],
)
def test_a_spec_of_a_version_with_laws_is_the_same_walk(
    old: dict[str, object], mode: str, changes: dict[str, object]
) -> None:
    assert "gait" not in without_law({"law": "stepping", "gait": {"apex": 0.5}})
    assert without_law({"seed": 3, **old}).get("mode", "position") == mode
    assert without_law({"seed": 3, **old}).get("changes", {}) == changes


@pytest.mark.parametrize("mode", ["torque", "hybrid"])
def test_a_gait_begins_in_the_step_that_the_feet_are_in(mode: str) -> None:
    """Another walk on the same estimate takes over in the middle of a swing: the foot swings on, the robot stops."""
    plant, first = standing()
    robot, observer = first.controller.robot, first.control.observer
    other = WalkingControl(robot, None, DT, WalkingControlSettings(mode=mode), observer=observer)  # type: ignore[arg-type]
    first.velocity = (0.25, 0.0, 0.0)
    air, landed = [0.0, 0.0], [9.0, 9.0]
    while not (plant.time > 2.0 and air[0] > 0.15):
        state = first.control.estimate(plant.measure())
        for foot, load in enumerate(state.measurement.wrenches[:, 2]):
            air[foot], landed[foot] = (air[foot] + DT, 0.0) if load < 20.0 else (0.0, landed[foot] + DT)
        plant.step(first.act(state))
    state = first.control.estimate(plant.measure())
    other.begin(state, air, landed)
    command = other.act(state)
    reference, sole = other.reference, robot.soles[0].frame
    assert reference is not None and reference.swing == 0 and reference.stance == 1
    assert reference.elapsed == pytest.approx(min(air[0], reference.duration / 2.0), abs=0.02)
    moved = pin.getFrameVelocity(
        robot.model, robot.data, robot.frame_id(sole), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    foot = reference.feet[0]
    np.testing.assert_allclose(foot.placement.translation, robot.placement(sole).translation, atol=3e-3)
    np.testing.assert_allclose(foot.velocity[:3], moved.linear, atol=0.05)
    assert np.linalg.norm(moved.linear) > 0.2  # it does move
    plant.step(command)
    run(plant, other, 3.0)
    assert other.done and other.progress.phase is GaitPhase.STANDING and other.steps_done >= 1


@pytest.mark.parametrize("side", [0, 1])
def test_a_gait_that_begins_swings_the_foot_that_is_in_the_air_whatever_load_is_measured(side: int) -> None:
    """Without force sensors the estimate of a load is wrong for a while after an impact."""
    plant, walking = standing()
    run(plant, walking, 0.2)
    state = walking.control.estimate(plant.measure())
    assert min(state.measurement.wrenches[:, 2]) > 100.0
    air, landed = [0.0, 0.0], [9.0, 9.0]
    air[side], landed[side] = 0.1, 0.0
    walking.begin(state, air, landed)
    walking.act(state)
    assert walking.reference is not None
    assert walking.reference.swing == side and walking.reference.stance == 1 - side


def test_a_gait_that_begins_on_feet_that_have_stood_stands_and_one_in_position_control_is_refused() -> None:
    plant, walking = standing()
    run(plant, walking, 0.2)
    state = walking.control.estimate(plant.measure())
    walking.begin(state)
    plant.step(walking.act(state))
    run(plant, walking, 0.5)
    assert walking.steps_done == 0 and walking.progress.phase is GaitPhase.STANDING
    robot = wbc.load_robot("hrp4_class").robot()
    planned = WalkingControl(robot, None, 0.005, WalkingControlSettings(mode="position"))
    with pytest.raises(InputError, match="free"):
        planned.begin(state)
    for times in ((0.1,), (0.1, math.nan), (-0.1, 0.0), "ab"):
        with pytest.raises(InputError, match="times of the feet"):
            walking.begin(state, times)
    assert walking.progress.phase is GaitPhase.STANDING


def test_a_robot_takes_free_steps_again_once_it_stands_without_a_hand_at_work() -> None:
    """A plan that is not walked yet, and a planner of one's own, go on in them."""
    walking = control("g1", None)
    robot = walking.controller.robot
    state = walking.control.estimate(at_rest(robot, 0.0))
    plan = walk_distance(FootstepPlan.standing(robot), 0.3)
    for order in (None, plan, Door()):
        walking._change("planned")
        if order is not None:
            walking.source.take(order if isinstance(order, FootstepSource) else PlanSource(order))
        walking._choose(state)
        assert walking.step_kind == ("free" if order is None else "planned"), "it is asked first"
        assert (walking.source.planner is None) == (order is None)
        walking._change("free")
        assert (walking.source.planner is None) == (order is None), "it is carried over"


def test_a_first_plan_is_no_order_and_a_later_one_is() -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    plan = walk_distance(FootstepPlan.standing(robot), 0.3)
    walking = WalkingControl(wbc.load_robot("hrp4_class").robot(), plan, 0.005)
    assert not walking.steered and not walking.finished and not walking.done
    walking.follow(plan)
    assert walking.steered
    free = WalkingControlSettings(mode="torque", step_kind="free")
    walking = WalkingControl(wbc.load_robot("hrp4_class").robot(), plan, DT, free)
    assert walking.source.planner is not None and walking.step_kind == "free"


@pytest.mark.parametrize("height", [0.0, 0.4])
def test_the_height_of_the_com_is_that_over_the_ground_on_which_the_robot_stands(height: float) -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    q = np.array(robot.q)
    q[2] += height
    robot.update(q, np.zeros(robot.nv))
    plan = walk_distance(FootstepPlan.standing(robot), 0.3)
    walking = WalkingControl(robot, plan, 0.005)
    over = float(robot.com[2]) - 0.5 * sum(
        float(robot.placement(sole.frame).translation[2]) for sole in robot.soles
    )
    assert walking.source.com_height == pytest.approx(over)
    assert walking.body.com_height == pytest.approx(over)


@pytest.mark.parametrize("leaves", [True, False])
def test_a_push_of_a_stand_on_planned_steps_is_stepped_out_of(leaves: bool) -> None:
    walking = control("g1")
    walking._change("planned")
    walking.hands.press("left_hand", 4.0, (1.0, 0.0, 0.0), firm=True)  # it would stay in them
    walking._kinds["free"].source.leaves = lambda *_: leaves  # type: ignore[method-assign]
    walking._choose(walking.control.estimate(at_rest(walking.controller.robot, 0.0)))
    assert walking.step_kind == ("free" if leaves else "planned")


def test_a_source_without_a_height_has_that_of_the_robot_over_its_soles() -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    height, q = com_height(robot, StandSource(robot)), np.array(robot.q)
    q[2] += 0.4
    robot.update(q, np.zeros(robot.nv))
    assert com_height(robot, StandSource(robot)) == pytest.approx(height)
    soles = [float(robot.placement(sole.frame).translation[2]) for sole in robot.soles]
    assert height == pytest.approx(float(robot.com[2]) - 0.5 * sum(soles))
