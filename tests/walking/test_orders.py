"""Orders of a walk: mode chooses the steps, plans, planners and velocities take each other's place, hands may press."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default

import wbc
from wbc.base.errors import InputError
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.sim import TrialHook, WalkPlan, WalkSpec, WalkTrial
from wbc.sim.trial.falls import TrueFallDetector
from wbc.walking import (
    FootstepPlan,
    LoadSettings,
    WalkingControl,
    WalkingControlSettings,
    climb_stairs,
    walk_distance,
    walk_velocity,
)
from wbc.walking.assembly import height_of
from wbc.walking.contact import GaitPhase
from wbc.walking.plans.sources import FootstepSource, PlanSource, Standing
from wbc.walking.source import StandSource
from wbc.walking.stepping.gait import SteppingWalk

DT = 0.004


def control(name: str, plan: FootstepPlan | None = None) -> WalkingControl:
    robot = wbc.load_robot(name).robot()
    plan = plan or FootstepPlan.standing(robot)
    return WalkingControl(robot, plan, DT, WalkingControlSettings(mode="torque"))


def standing(name: str = "g1") -> tuple[wbc.Plant, WalkingControl]:
    wrists = wbc.sim.Machine(hand_sensors=True)
    plant = wbc.Plant(
        wbc.load_robot(name), noise="realistic", seed=3, control_period=DT, machine=wrists, visuals=False
    )
    return plant, control(name)


def run(plant: wbc.Plant, walking: WalkingControl, seconds: float) -> None:
    falls, end = TrueFallDetector(plant.robot), plant.time + seconds
    while plant.time < end - 1e-9:
        plant.step(walking.command(plant.measure()))
        assert not falls.fallen(plant.truth().q), f"fallen at {plant.time:.2f} s"


def test_a_plan_is_taken_at_the_start_and_on_the_way_alike_and_one_out_of_reach_is_refused() -> None:
    for name in ("hrp4_class", "g1"):
        robot = wbc.load_robot(name).robot()
        start = FootstepPlan.standing(robot)
        flat = walk_distance(start, 0.3)
        stairs = climb_stairs(start, rise=0.05, tread=0.25, count=2, first_edge=0.2)
        for plan in (flat, stairs):
            walking = control(name, plan)
            assert isinstance(walking.source.planner, PlanSource) and not walking.finished
            walking = control(name)
            walking.follow(plan)
            assert isinstance(walking.source.planner, PlanSource) and not walking.finished
            walking.velocity = (0.2, 0.0, 0.0)
            assert walking.velocity == (0.2, 0.0, 0.0)
        far = replace(flat, steps=[replace(step, x=step.x + 2.0) for step in flat.steps])
        with pytest.raises(InputError, match="within reach|out of reach"):
            control(name, far)


class Stands(FootstepSource):
    """A planner that asks for a stand."""

    def footsteps(self, now: Standing) -> FootstepPlan:
        """See `FootstepSource`."""
        return now.start


@pytest.mark.parametrize("mode", ["position", "torque"])
@pytest.mark.parametrize("order", ["velocity", "stand", "goal", "plan", "planner", "stop"])
def test_an_order_to_walk_given_in_every_tick_is_that_given_once(order: str, mode: Any) -> None:
    """The source gets it once, also where the robot is there and the source has left the goal or the plan."""
    robot, stands, given = wbc.load_robot("g1").robot(), Stands(), list[object]()
    walking = WalkingControl(robot, None, DT, WalkingControlSettings(mode=mode))
    plan, source = walk_distance(FootstepPlan.standing(robot), 0.1), walking.source
    orders: dict[str, Callable[[], None]] = {
        "velocity": lambda: setattr(walking, "velocity", (0.1, 0.0, 0.0)),
        "stand": lambda: setattr(walking, "velocity", None),
        "goal": lambda: walking.go_to(0.05, 0.0, 0.0),
        "plan": lambda: walking.follow(plan),
        "planner": lambda: walking.follow(stands),
        "stop": walking.stop,
    }
    take, steering = source.take, walking.source.steering
    assert steering is not None
    source.take = lambda planner: (given.append(planner), take(planner))[1]  # type: ignore[method-assign]
    for _ in range(3):
        orders[order]()
    source.planner = steering.goal = None
    orders[order]()
    assert len(given) == 1 and source.planner is None is steering.goal
    walking.velocity = (0.0, 0.1, 0.0)
    assert len(given) == 2 and walking.velocity == (0.0, 0.1, 0.0)
    orders[order]()
    assert len(given) == 3 and walking.velocity == ((0.1, 0.0, 0.0) if order == "velocity" else None)
    source.reason = "dropped"
    orders[order]()
    assert len(given) == 3 and source.reason
    walking.stop()
    orders[order]()
    assert not source.reason or order in ("stand", "stop")


class Door(FootstepSource):
    """A planner that waits at a door until it opens, and goes three steps then."""

    begun: int | None = None

    def footsteps(self, now: Standing) -> FootstepPlan:
        """See `FootstepSource`."""
        if now.time < 0.6:
            return now.start
        self.begun = now.begun if self.begun is None else self.begun
        left = self.begun + 3 - now.begun
        return walk_velocity(now.start, (0.1, 0.0, 0.0), left, first=now.first) if left > 0 else now.start


@pytest.mark.parametrize("end", by_default([0.8, 6.4], 0.8))
def test_a_planner_that_asks_for_a_stand_is_asked_again(end: float) -> None:
    plant = wbc.Plant(wbc.load_robot("g1"), control_period=DT, visuals=False)
    walking = WalkingControl(plant.description.robot(), None, DT, WalkingControlSettings(mode="torque"))
    door = Door()
    walking.follow(door)
    assert not walking.finished
    run(plant, walking, 0.5)
    assert walking.finished and walking.source.planner is door and walking.steps_done == 0
    run(plant, walking, 0.3)
    assert not walking.finished
    while not walking.finished and plant.time < end:
        run(plant, walking, 0.1)
    assert walking.source.planner is door and walking.source.reason == ""
    assert end == 0.8 or (walking.finished and 3 <= walking.steps_done <= 5), "feet may have to close up"


def test_a_hand_that_has_lost_its_contact_waits_for_an_order() -> None:
    plant, walking = standing()
    run(plant, walking, 0.05)
    hands, order = walking.hands, ("left_hand", 10.0, (1.0, 0.0, 0.0))
    hands.press(*order)
    run(plant, walking, 0.1)
    assert hands.active and not walking.stands
    for _ in range(40):  # the sensor falls silent
        silent = np.full((2, 6), np.nan)
        plant.step(walking.command(replace(plant.measure(), hand_wrenches=silent)))
    assert hands.lost == ("left_hand",)
    run(plant, walking, 0.35)
    assert walking.stands and not (hands.active or hands.wanted)
    hands.press(*order)
    assert hands.lost == ("left_hand",), "it waits for a release: an order may come in every tick"
    hands.release("left_hand")
    hands.press(*order)
    run(plant, walking, 0.02)
    assert hands.wanted


def test_a_question_changes_nothing() -> None:
    """All that a walk can be asked for between ticks is read in the middle of a move of the posture."""
    plant, walking = standing()
    run(plant, walking, 0.1)
    joint = "left_elbow_joint"
    index = plant.robot.joint_index(joint)
    begin = walking.tasks.posture.target[index]
    walking.tasks.posture.move_to({joint: begin + 0.1}, duration=0.3)
    run(plant, walking, 0.1)
    for name in dir(type(walking)):
        refuses = name in ("walk", "control")  # of planned steps alone; the old name of the drives
        if not name.startswith("_") and isinstance(getattr(type(walking), name), property) and not refuses:
            getattr(walking, name)
    assert walking.tasks.posture.moving
    run(plant, walking, 0.22)
    assert not walking.tasks.posture.moving
    assert walking.tasks.posture.target[index] == pytest.approx(begin + 0.1, abs=1e-9)


def test_time_constants_of_an_observer_that_are_given_stay_and_the_others_are_those_of_free_steps() -> None:
    robot = wbc.load_robot("g1").robot()
    given = ObserverSettings(inertial=InertialSettings(velocity_time_constant=0.03, tilt_time_constant=3.0))
    observer = Observer(robot, given, adopt=True)
    walking = WalkingControl(robot, None, DT, WalkingControlSettings(mode="torque"), observer=observer)
    inertial = walking.drives.observer.inertial.settings
    assert (inertial.velocity_time_constant, inertial.tilt_time_constant) == (0.03, 3.0)
    assert inertial.yaw_time_constant == 1000.0
    assert observer.settings.inertial == inertial, "the observer says what it estimates by"


@pytest.mark.parametrize("order", by_default(["velocity", "goal"], "velocity"))
def test_an_order_in_the_middle_of_a_plan_takes_its_place_in_the_next_step(order: str) -> None:
    plant = wbc.Plant(wbc.load_robot("g1"), control_period=0.004, visuals=False)
    robot = plant.description.robot()
    walking = WalkingControl(robot, None, 0.004, WalkingControlSettings(mode="torque"))
    run(plant, walking, 0.1)
    walking.follow(walk_distance(FootstepPlan.standing(robot), 0.7))
    while walking.progress.phase is not GaitPhase.SINGLE:
        run(plant, walking, 0.05)
    assert not walking.finished and walking.velocity is None
    if order == "velocity":
        walking.velocity = (0.5, 0.0, 0.0)
    else:
        walking.go_to(2.0, 0.0, 0.0)
    phases = set()
    for _ in range(14):
        run(plant, walking, 0.05)
        phases.add(walking.progress.phase)
        assert walking.velocity == ((0.5, 0.0, 0.0) if order == "velocity" else None) and not walking.done
    assert phases == {GaitPhase.SINGLE} and walking.granted_velocity[0] > 0.2, "without a stand between"
    with pytest.raises(InputError):
        walking.velocity = (np.nan, 0.0, 0.0)


def test_an_extent_binds_steps_of_both_kinds() -> None:
    plant, extent = (
        wbc.Plant(wbc.load_robot("g1"), control_period=0.004, visuals=False),
        (-0.6, 0.6, -0.6, 0.6),
    )
    robot = plant.description.robot()
    for mode in ("torque", "position"):
        settings = WalkingControlSettings(mode=mode)  # type: ignore[arg-type]
        walking = WalkingControl(robot, None, 0.004, settings, extent=extent)
        with pytest.raises(InputError, match=re.escape("from -0.6 to 0.6")):
            walking.go_to(0.7, 0.0, 0.0)
        walking.go_to(0.3, 0.0, 0.0)
        walking.follow(walk_distance(FootstepPlan.standing(robot), 1.0))
        run(plant, walking, 0.5)
        assert walking.steps_done == 0 and walking.done and not walking.finished
        assert "leaves the ground" in walking.source.reason
        walking.stop()
        run(plant, walking, 0.004)
        assert walking.finished


GAINS = ("weight", "stiffness", "damping")


def gains_of(walking: WalkingControl) -> dict[str, list[Any]]:
    return {task.name: [getattr(task, gain).copy() for gain in GAINS] for task in walking.controller.tasks}


@pytest.mark.parametrize("mode", by_default(["torque", "position"], "torque"))
def test_gains_of_tasks_stay_as_they_are_set_whatever_the_robot_does(mode: Any) -> None:
    """The walk lets them act by ratios of its own: nothing is assigned at changes of phases, hands and gaze."""
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), control_period=0.004, visuals=False)
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


@pytest.mark.parametrize(("robot", "foot"), [("hrp4_class", "long_arch"), ("g1", "flat")])
def test_a_distance_is_a_goal_and_footsteps_that_are_given_stay(robot: str, foot: str) -> None:
    spec = WalkSpec(robot=robot, foot=foot, mode="torque", plan=WalkPlan(distance=1.0))
    walk = spec.prepare()
    assert not walk.plan.steps and walk.arrival() is not None
    given = replace(spec, plan=WalkPlan(footsteps=walk.way.steps[:2])).prepare()
    assert given.plan.steps[:2] == walk.way.steps[:2]


@pytest.mark.slow
def test_a_plan_is_walked_after_a_drive() -> None:
    plant, walking = standing()
    run(plant, walking, 0.5)
    walking.velocity = (0.3, 0.0, 0.0)
    run(plant, walking, 2.0)
    assert not walking.stands
    walking.stop()
    run(plant, walking, 2.5)
    assert walking.finished
    walking.follow(walk_distance(FootstepPlan.standing(walking.controller.robot), 0.1))
    assert not walking.finished
    steps = walking.steps_done
    run(plant, walking, 5.5)
    assert walking.steps_done >= steps + 2 and walking.source.reason == ""
    assert walking.finished


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["g1", "hrp4_class", "talos"])
def test_footsteps_are_met_while_nothing_pushes(robot: str) -> None:
    """A plan is a promise: each sole lands within 10 mm of its footstep in the estimated world."""
    plant = wbc.Plant(wbc.load_robot(robot), noise="realistic", seed=3, control_period=DT, visuals=False)
    plan = walk_velocity(FootstepPlan.standing(plant.description.robot()), (0.08, 0.0, 0.15), 3)
    walking = control(robot, plan)
    landed, estimate = 0, walking.drives.observer.robot
    while not walking.done:
        plant.step(walking.command(plant.measure()))
        if walking.steps_done > landed:
            step, landed = plan.steps[landed], landed + 1
            place = estimate.placement(estimate.soles[("left", "right").index(step.side)].frame).translation
            assert np.hypot(place[0] - step.x, place[1] - step.y) < 0.01
    assert landed == len(plan.steps) and walking.finished


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "direction", "way"),
    [("hrp4_class", "down", "together"), ("g1", "up", "together"), ("hrp4_class", "up", "alternate")],
)
def test_soles_land_on_the_treads_of_stairs_that_are_told(robot: str, direction: str, way: Any) -> None:
    """Blind, along the stairs within 10 mm of the middle of each tread, which has 15 to 25 mm left about a sole."""
    stairs = {"riser": 0.1, "tread": 0.25, "direction": direction}
    plan = WalkPlan(stairs=way)
    spec = WalkSpec(
        robot=robot, foot="flat", mode="torque", seed=30000, terrain="steps", amplitude=0.2,
        terrain_params=stairs, plan=plan, noise="realistic",
    )  # fmt: skip
    trial = WalkTrial(spec, visuals=False)
    steps, off = spec.prepare().way.steps, list[float]()

    class Landings(TrialHook):
        def after(self, trial: Any) -> None:
            done = len(off)
            if done < min(trial.control.steps_done, len(steps)):
                side = ("left", "right").index(steps[done].side)
                estimate = trial.control.drives.observer.robot
                place = estimate.placement(estimate.soles[side].frame).translation
                off.append(abs(place[0] - steps[done].x))

    result = trial.run([Landings()])
    assert result.outcome == "completed" and len(off) == len(steps) and max(off) < 0.01


@pytest.mark.parametrize("load", [None, LoadSettings()])
@pytest.mark.parametrize("mode", ["position", "torque", "hybrid"])
def test_the_mode_chooses_the_steps(mode: Any, load: LoadSettings | None) -> None:
    settings = WalkingControlSettings(mode=mode, load=load)
    walking = WalkingControl(wbc.load_robot("g1").robot(), None, DT, settings)
    assert settings.free == (mode != "position") == isinstance(walking.source, SteppingWalk)
    assert (walking.stabilizer is None) == (walking.balance is None) == settings.free
    assert walking.steered and walking.hands.all and (walking.load is None) == (load is None)


@pytest.mark.parametrize("mode", by_default(["torque", "hybrid"], "torque"))
def test_a_gait_begins_in_the_step_that_the_feet_are_in(mode: str) -> None:
    """Another walk on the same estimate takes over in the middle of a swing: the foot swings on, the robot stops."""
    plant, first = standing()
    robot, observer = first.controller.robot, first.drives.observer
    other = WalkingControl(robot, None, DT, WalkingControlSettings(mode=mode), observer=observer)  # type: ignore[arg-type]
    first.velocity = (0.25, 0.0, 0.0)
    air, landed = [0.0, 0.0], [9.0, 9.0]
    while not (plant.time > 1.0 and air[0] > 0.15):
        state = first.drives.estimate(plant.measure())
        for foot, load in enumerate(state.measurement.wrenches[:, 2]):
            air[foot], landed[foot] = (air[foot] + DT, 0.0) if load < 20.0 else (0.0, landed[foot] + DT)
        plant.step(first.act(state))
    state = first.drives.estimate(plant.measure())
    other.begin(state, air, landed)
    command = other.act(state)
    reference, sole = other.reference, robot.soles[0].frame
    assert reference is not None and reference.progress.air == 0 and reference.progress.stance == 1
    assert reference.progress.elapsed == pytest.approx(
        min(air[0], reference.progress.duration / 2.0), abs=0.02
    )
    moved = pin.getFrameVelocity(
        robot.model, robot.data, robot.frame_id(sole), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    foot = reference.feet[0]
    np.testing.assert_allclose(foot.placement.translation, robot.placement(sole).translation, atol=3e-3)
    np.testing.assert_allclose(foot.velocity[:3], moved.linear, atol=0.05)
    assert np.linalg.norm(moved.linear) > 0.2  # it does move
    plant.step(command)
    end = plant.time + 3.0
    while not other.done and plant.time < end:
        run(plant, other, 0.1)
    assert other.done and other.progress.phase is GaitPhase.STANDING and other.steps_done >= 1


@pytest.mark.parametrize("side", [0, 1])
def test_a_gait_that_begins_swings_the_foot_that_is_in_the_air_whatever_load_is_measured(side: int) -> None:
    """Without force sensors the estimate of a load is wrong for a while after an impact."""
    plant, walking = standing()
    run(plant, walking, 0.2)
    state = walking.drives.estimate(plant.measure())
    assert min(state.measurement.wrenches[:, 2]) > 100.0
    air, landed = [0.0, 0.0], [9.0, 9.0]
    air[side], landed[side] = 0.1, 0.0
    walking.begin(state, air, landed)
    walking.act(state)
    assert walking.reference is not None
    assert walking.reference.progress.air == side and walking.reference.progress.stance == 1 - side


def test_a_gait_that_begins_on_feet_that_have_stood_stands_and_one_in_position_control_is_refused() -> None:
    plant, walking = standing()
    run(plant, walking, 0.2)
    state = walking.drives.estimate(plant.measure())
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


@pytest.mark.parametrize("mode", ["position", "torque"])
def test_a_robot_can_be_steered_whether_a_plan_gives_its_steps_or_not(mode: Any) -> None:
    robot, stands = (wbc.load_robot("hrp4_class").robot() for _ in range(2))
    plan, settings = walk_distance(FootstepPlan.standing(robot), 0.3), WalkingControlSettings(mode=mode)
    walking = WalkingControl(robot, plan, 0.005, settings)
    assert walking.steered and not walking.finished and not walking.done
    assert isinstance(walking.source.planner, PlanSource)
    walking.velocity = (0.1, 0.0, 0.0)
    assert walking.velocity == (0.1, 0.0, 0.0) and not isinstance(walking.source.planner, PlanSource)
    assert not WalkingControl(stands, StandSource(stands), 0.005, settings).steered


@pytest.mark.parametrize("height", [0.0, 0.4])
def test_the_height_of_the_com_is_that_over_the_ground_on_which_the_robot_stands(height: float) -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    q = np.array(robot.q)
    q[2] += height
    robot.update(q, np.zeros(robot.nv))
    walking = WalkingControl(robot, walk_distance(FootstepPlan.standing(robot), 0.3), 0.005)
    soles = [float(robot.placement(sole.frame).translation[2]) for sole in robot.soles]
    over = pytest.approx(float(robot.com[2]) - 0.5 * sum(soles))
    assert walking.source.com_height == over and walking.body.com_height == over
    assert height_of(robot, StandSource(robot)) == over, "a source without a height has that of the robot"
