"""A robot that is steered: velocities, goals, plans and planners of one's own, exchanged while it walks."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pendulum import BY_TIME
from properties import by_default, each_once
from steered_walk import steered_steps

from wbc.base.settings import from_json, to_json
from wbc.base.settings import settings as settings_class
from wbc.core.robot import GRAVITY, SIDES
from wbc.robots import load
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking import (
    FootstepPlan,
    Gait,
    StepGait,
    WalkingControlSettings,
    climb_stairs,
    walk_distance,
    walk_path,
)
from wbc.walking.assembly import planned_walk
from wbc.walking.contact import GaitPhase
from wbc.walking.lipm.feet import TURNED
from wbc.walking.lipm.settings import WalkSettings
from wbc.walking.lipm.steered_steps import SteeredSteps
from wbc.walking.plans.check import check_plan
from wbc.walking.plans.leg import Leg
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import (
    AT_REST,
    BESIDE,
    DriveSettings,
    FootstepSource,
    PlanSource,
    Standing,
    next_steps,
)
from wbc.walking.source import Reference

DT = 0.005
ROBOTS = {name: load(name).robot() for name in ("hrp4_class", "talos", "g1")}


class Stage:
    """A walk and its driver without a robot: feet land when and where they should."""

    def __init__(self, name: str = "hrp4_class", plan: FootstepPlan | None = None) -> None:
        robot = ROBOTS[name]
        start = FootstepPlan.standing(robot) if plan is None else plan
        settings = WalkSettings(phases=BY_TIME, adjustment=None)
        control = WalkingControlSettings(walk=settings)
        self.source = self.walk = planned_walk(robot, start, DT, control, None)
        self.time = 0.0
        self.references: list[Reference] = []

    def steer(self, velocity: tuple[float, float, float] | None) -> None:
        self.walk.steering.command(velocity)
        self.walk.take(None)

    def go_to(self, *goal: float) -> None:
        self.walk.steering.go_to(*goal)
        self.walk.take(None)

    def follow(self, source: FootstepPlan | FootstepSource) -> None:
        self.walk.steering.command(None)
        self.walk.take(PlanSource(source) if isinstance(source, FootstepPlan) else source)

    def run(self, seconds: float, turning: float = 0.0) -> None:
        for _ in range(round(seconds / DT)):
            self.time += DT
            self.references.append(self.walk.advance([0.0, 0.0], turned=DT * turning))

    def run_until_it_stands(self, longest: float) -> None:
        begin = self.time
        while self.time < begin + longest and (self.time < begin + 1.0 or not self.walk.finished):
            self.run(0.2)

    @property
    def middle(self) -> tuple[np.ndarray, float]:
        left, right = (motion.placement for motion in self.references[-1].feet)
        turn = left.rotation @ right.rotation.T
        yaw = math.atan2(right.rotation[1, 0], right.rotation[0, 0]) + 0.5 * math.atan2(
            turn[1, 0], turn[0, 0]
        )
        return 0.5 * (left.translation + right.translation)[:2], yaw


def standing(name: str, first: str | None = None) -> Standing:
    start = FootstepPlan.standing(ROBOTS[name])
    return Standing(replace(start, gait=Gait(feet_spacing=start.spacing)), first, 0, False, 0.0)


@pytest.mark.parametrize("kind", by_default(["first plan", "plan", "goal"], "plan", "goal"))
def test_soles_that_turn_on_the_ground_do_not_turn_the_way(kind: str) -> None:
    """By the gyroscope soles turn by 0.03 rad/s: in the world, which turns with them, the way turns back."""
    start = FootstepPlan.standing(ROBOTS["hrp4_class"])
    plan = walk_distance(start, 1.5)
    stage = Stage(plan=plan if kind == "first plan" else None)
    if kind == "plan":
        stage.follow(plan)
    elif kind == "goal":
        stage.go_to(1.5, 0.0, 0.0)
    place, turn, landed = pin.SE3.Identity(), 0.0, 0  # world of the plan in the one that turns
    for _ in range(4000):
        stage.run(DT, 0.03)
        if stage.walk.finished:
            break
        turn += DT * 0.03
        walk = stage.walk
        if walk.steps_done > landed:  # each turn was about the foot that stood
            landed = walk.steps_done
            at = stage.references[-2].feet[1 - walk.phases.stance].placement.translation
            rotation = pin.rpy.rpyToMatrix(0.0, 0.0, -turn)
            place, turn = pin.SE3(rotation, at - rotation @ at) * place, 0.0
    middle, yaw = stage.middle
    goal = place.act(np.array([1.5, 0.0, 0.0]))[:2]
    assert math.hypot(*(middle - goal)) < 0.05 and math.hypot(*(middle - (1.5, 0.0))) > 0.1
    late = TURNED + 0.03 * 1.0  # what is too little to be turned back, and what the last step of 1 s turns
    assert yaw == pytest.approx(math.atan2(place.rotation[1, 0], place.rotation[0, 0]), abs=late)


@pytest.mark.parametrize("name", ROBOTS)
def test_every_velocity_gives_steps_within_reach(name: str) -> None:
    """Also those far beyond the robot, from a stand and in the middle of a walk with another velocity."""
    robot, rng = ROBOTS[name], np.random.default_rng(3)
    reach = Reach.of(robot)
    for _ in range(10):
        source = steered_steps(reach, DriveSettings(acceleration=(99, 99, 99)))
        now = standing(name)
        for begun in range(3):
            x, y, turn = rng.normal(size=3)
            source.steering.command((x, y, turn))
            plan = source.footsteps(now._replace(begun=begun, time=float(begun)))
            check_plan(plan, reach)
            assert len(plan) >= 3
            limits = (0.3, 0.2, 0.5)
            for granted, wish, limit in zip(source.granted, (x, y, turn), limits, strict=True):
                assert abs(granted) <= min(abs(wish), limit) + 1e-9 and granted * wish >= 0.0
            step = plan.steps[0]
            feet = {"left": now.start.left, "right": now.start.right} | {step.side: step}
            now = now._replace(
                start=replace(now.start, left=feet["left"], right=feet["right"]),
                first="right" if step.side == "left" else "left",
            )


def test_a_steered_walk_goes_where_it_is_told_and_its_references_never_jump() -> None:
    stage = Stage()
    for velocity in (
        (0.15, 0.0, 0.0),
        (0.3, 0.0, 0.2),
        (0.0, 0.1, 0.0),
        (-0.15, 0.0, -0.2),
        None,
        (0.0, 0.0, 0.4),
        None,
    ):
        stage.steer(velocity)
        stage.run(5.0 if velocity is not None else 4.0)
        if velocity is not None:
            assert stage.source.granted == pytest.approx(velocity, abs=0.05)
            walk = stage.walk
            assert len(walk.phases.plan) - walk.phases.step >= 3, "two steps ahead and the one that closes up"
    assert stage.walk.finished
    for a, b in zip(stage.references, stage.references[1:], strict=False):
        p, q = a.pendulum, b.pendulum
        assert np.linalg.norm(q.com - p.com - DT * p.com_velocity) < 1e-4
        assert np.linalg.norm(q.zmp - p.zmp) < 0.02, "the ZMP moves at most a foot in a tenth of a second"


@pytest.mark.parametrize("name", by_default(["g1", "hrp4_class", "talos"], "talos"))
@pytest.mark.parametrize("seed", by_default(range(4), 1))
def test_the_com_and_its_velocity_go_on_whatever_is_asked_for_and_wherever_a_push_takes_the_robot(
    name: str, seed: int
) -> None:
    """Where no ZMP within the supports takes the DCM to new steps, and where landings answer pushes, too."""
    rng, robot = random.Random(seed), ROBOTS[name]
    walk = planned_walk(robot, FootstepPlan.standing(robot), DT, WalkingControlSettings(), None)
    weight, due, pushed, off = robot.mass * GRAVITY, 0.5, 0j, 0.0
    before: Pendulum | None = None
    for k in range(round(14.0 / DT)):
        if k * DT > due:
            due += rng.choice([0.05, 0.3, 0.7, 1.5])
            velocity = rng.uniform(-0.4, 0.4), rng.uniform(-0.3, 0.3), rng.uniform(-0.8, 0.8)
            walk.steering.command(None if rng.random() < 0.2 else velocity)
            walk.take(None)
            pushed = complex(rng.gauss(0.0, 0.04), rng.gauss(0.0, 0.04)) if rng.random() < 0.5 else 0j
        loads = [0.5 * weight, 0.5 * weight]
        if walk.phases.phase is GaitPhase.SINGLE:
            lands = walk.phases.duration - walk.phases.elapsed < 1.5 * DT
            loads = [(side == walk.phases.stance or 0.3 * lands) * weight for side in (0, 1)]
        elif walk.phases.phase is GaitPhase.DOUBLE and walk.phases.step < len(walk.phases.plan):
            loads = [0.1 * weight if side == walk.phases.landing.side else 0.9 * weight for side in SIDES]
        now = walk.course.pattern.dcm_at(walk.course.since) + pushed
        pendulum = walk.advance(loads, None, np.array((now.real, now.imag, 0.0))).pendulum
        off = max(off, abs(walk.course._off.value))
        if before is not None:
            mean = 0.5 * (pendulum.com_velocity + before.com_velocity)
            most = max(float(np.linalg.norm(each.com_acceleration)) for each in (before, pendulum))
            assert np.linalg.norm(pendulum.com - before.com - DT * mean) < 1e-4
            assert np.linalg.norm(pendulum.com_velocity - before.com_velocity) < 1.5 * DT * most + 1e-6
        before = pendulum
    assert walk.steps_done > 7 and (seed != 1 or off > 1e-3), "some steps were out of reach of the ZMP"


@pytest.mark.parametrize(("when", "speed"), [(0.3, 0.3), (3.05, 0.15), (4.6, 0.3)])
def test_it_stands_within_two_steps(when: float, speed: float) -> None:
    """Whatever the phase in which the stop comes, the step that has begun included."""
    stage = Stage()
    stage.steer((speed, 0.0, 0.0))
    stage.run(when)
    done = stage.walk.steps_done
    stage.steer(None)
    stage.run_until_it_stands(5.0)
    stage.run(0.5)
    assert stage.walk.finished and stage.walk.steps_done - done <= 2
    assert stage.source.granted == AT_REST
    left, right = (motion.placement.translation for motion in stage.references[-1].feet)
    assert (
        abs(left[0] - right[0]) < 1e-6 and np.linalg.norm(stage.references[-1].pendulum.com_velocity) < 0.02
    )
    stage.steer((0.1, 0.0, 0.0))
    stage.run(4.0)
    assert stage.walk.steps_done > done + 2, "and walks on when told to"


@pytest.mark.parametrize("left", [0.2, 0.02])
def test_a_robot_that_is_told_to_go_on_as_it_closes_up_sets_off_without_a_jump(left: float) -> None:
    """The later the command, the less time is left to take the DCM from where it would have rested."""
    stage = Stage()
    walk = stage.walk
    stage.steer((0.3, 0.0, 0.0))
    stage.run(6.0)
    stage.steer(None)
    while walk.phases.phase is not GaitPhase.SINGLE or walk.phases.step + 1 < len(walk.phases.plan):
        stage.run(DT)
    stage.run(walk.phases.duration - walk.phases.elapsed - left)
    assert walk.phases.phase is GaitPhase.SINGLE
    steps = stage.walk.steps_done
    stage.steer((0.3, 0.0, 0.0))
    stage.run(3.0)
    assert stage.walk.steps_done > steps + 2
    for a, b in zip(stage.references, stage.references[1:], strict=False):
        assert np.linalg.norm(b.pendulum.com - a.pendulum.com - DT * a.pendulum.com_velocity) < 1e-4


@pytest.mark.parametrize(
    "goal",
    [
        (1.0, -1.0, 1.0),
        # One foot stays 0.02 rad off the other: the mean of both is beyond the tolerance.
        (0.029, -0.219, -0.603),
    ],
)
def test_it_goes_to_a_place_and_stands_there(goal: tuple[float, float, float]) -> None:
    stage = Stage()
    stage.go_to(*goal)
    stage.run_until_it_stands(45.0)
    place, yaw = stage.middle
    assert stage.source.finished and stage.walk.finished
    assert np.linalg.norm(place - goal[:2]) < 0.05 and abs(yaw - goal[2]) < 0.1


def test_a_goal_that_changes_a_little_in_every_tick_is_walked_to_as_one_goal() -> None:
    def steps(change: float) -> int:
        stage = Stage("g1")
        while not stage.walk.finished or stage.time < 1.0:
            assert stage.time < 15.0
            if stage.time == 0.0 or change:
                stage.go_to(0.4 + change * math.sin(11.0 * stage.time), 0.0, 0.0)
            stage.run(DT)
        assert stage.middle[0][0] == pytest.approx(0.4, abs=0.03)
        return stage.walk.steps_done

    assert steps(1e-3) == steps(0.0)


@pytest.mark.parametrize("first", [None, "right"])
@pytest.mark.parametrize("goal", [(3.0, 0.4, 2.0), (0.4, -0.2, 0.3)], ids=["far", "near"])
def test_steps_to_a_goal_are_the_same_in_a_world_that_is_moved_and_turned(
    first: str | None, goal: tuple[float, float, float]
) -> None:
    world, now = (
        pin.SE3(pin.utils.rotate("z", 2.5), np.array([5.0, -3.0, 0.2])),
        standing("hrp4_class", first),
    )
    reach = Reach.of(ROBOTS["hrp4_class"])
    there = world * pin.SE3(pin.utils.rotate("z", goal[2]), np.array([*goal[:2], 0.0]))
    x, y, _ = there.translation

    def to(goal: tuple[float, float, float]) -> SteeredSteps:
        source = steered_steps(reach)
        source.steering.go_to(*goal)
        return source

    plans = [
        to(place).footsteps(now._replace(start=start))
        for place, start in ((goal, now.start), ((x, y, goal[2] + 2.5), now.start.moved(world)))
    ]
    assert len(plans[0].steps) > 2 and [s.side for s in plans[0].steps] == [s.side for s in plans[1].steps]
    for here, moved in zip(plans[0].steps, plans[1].steps, strict=True):
        np.testing.assert_allclose(
            (world * here.placement).homogeneous, moved.placement.homogeneous, atol=1e-9
        )


def test_a_plan_from_the_start_is_walked_as_one_that_is_given_later() -> None:
    plan = walk_distance(FootstepPlan.standing(ROBOTS["hrp4_class"]), 0.3)
    first, later = Stage(plan=plan), Stage()
    later.follow(plan)
    for stage in (first, later):
        stage.run(6.0)
        assert stage.source.finished and stage.walk.steps_done == len(plan)
    for a, b in zip(first.references, later.references, strict=True):
        np.testing.assert_allclose(a.pendulum.com, b.pendulum.com, atol=1e-9)
        for one, other in zip(a.feet, b.feet, strict=True):
            np.testing.assert_allclose(one.placement.homogeneous, other.placement.homogeneous, atol=1e-9)


@pytest.mark.parametrize(("first", "when"), each_once((True, False), (6.0, 7.5)))
def test_a_robot_that_is_stopped_on_a_stair_brings_its_feet_together_there(first: bool, when: float) -> None:
    start = FootstepPlan.standing(ROBOTS["hrp4_class"])
    plan = climb_stairs(start, rise=0.1, tread=0.3, count=4, first_edge=0.15)
    stage = Stage(plan=plan if first else None)
    if not first:
        stage.follow(plan)
    stage.run(when)
    stage.steer(None)
    stage.run_until_it_stands(6.0)
    left, right = (motion.placement.translation for motion in stage.references[-1].feet)
    assert stage.source.finished and left[0] == pytest.approx(right[0])
    assert left[2] > 0.05 and left[2] == pytest.approx(right[2], abs=2e-3)
    assert min(abs(left[0] - step.x) for step in plan.steps) < 1e-6, "on a tread"


def test_sources_are_exchanged_while_it_walks() -> None:
    """A plan from the start, a velocity, another plan, a planner of one's own."""
    stage = Stage(plan=walk_distance(FootstepPlan.standing(ROBOTS["hrp4_class"]), 1.0))
    stage.run(4.0)
    stage.steer((0.1, 0.0, 0.0))
    stage.run(4.0)
    left, right = (motion.placement.translation for motion in stage.references[-1].feet)
    ahead = max(left[0], right[0])
    feet = FootstepPlan.standing(ROBOTS["hrp4_class"])
    there = replace(feet, left=replace(feet.left, x=ahead), right=replace(feet.right, x=ahead))
    stage.follow(PlanSource(walk_distance(there, 0.5)))
    stage.run(14.0)
    assert stage.walk.finished and stage.source.reason == ""
    assert stage.middle[0][0] == pytest.approx(ahead + 0.5, abs=0.02)

    def three(now: Standing) -> FootstepPlan:
        more = now.begun < done + 3
        return walk_distance(now.start, 0.2, first=now.first or "right") if more else now.start

    done, own = stage.walk.steps_done, Own(three)
    stage.follow(own)
    stage.run(10.0)
    assert own.asked > 3 and stage.walk.finished and stage.walk.steps_done - done >= 3


class Own(FootstepSource):
    """A planner that is a function."""

    def __init__(self, plan: Callable[[Standing], Any]) -> None:
        self.asked, self._plan = 0, plan

    def footsteps(self, now: Standing) -> FootstepPlan:
        self.asked += 1
        return self._plan(now)  # type: ignore[no-any-return]


def far(now: Standing) -> FootstepPlan:
    return walk_distance(replace(now.start, gait=Gait(step_length=1.0)), 1.0, first=now.first or "left")


def hasty(now: Standing) -> FootstepPlan:
    start = replace(now.start, gait=Gait(double_support=0.006))
    return walk_distance(start, 0.2, first=now.first or "left")


def same_side(now: Standing) -> FootstepPlan:
    return walk_distance(now.start, 0.2, first="right" if now.first == "left" else "left")


@pytest.mark.parametrize(
    ("plan", "reason"),
    [
        (lambda _: {}["map"], "KeyError: 'map'"),
        (far, "within reach"),
        (same_side, "steps next"),
        (hasty, "two control periods"),
        (lambda _: None, "FootstepPlan"),
    ],
)
def test_a_planner_that_fails_brings_the_robot_to_a_stand(
    plan: Callable[[Standing], Any], reason: str
) -> None:
    stage = Stage()
    stage.steer((0.15, 0.0, 0.0))
    stage.run(3.0)
    done = stage.walk.steps_done
    stage.follow(Own(plan))
    stage.run(4.0)
    assert stage.walk.finished and reason in stage.source.reason and stage.walk.steps_done - done <= 3


@given(
    st.sampled_from(["hrp4_class", "talos", "g1"]),
    st.sampled_from([None, "left", "right"]),
    st.integers(0, 6),
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
)
@settings(max_examples=15, deadline=None)
def test_a_plan_is_walked_to_its_end_whatever_foot_begins_and_wherever_a_push_puts_one(
    name: str, first: str | None, pushed: int, x: float, y: float, yaw: float
) -> None:
    """A push puts one landing elsewhere, the next ones go back to the plan within reach; feet do not overlap."""
    robot = ROBOTS[name]
    reach = Reach.of(robot)
    plan = walk_distance(FootstepPlan.standing(robot), 0.8)
    source, now = PlanSource(plan), standing(name)._replace(first=first)
    for begun in range(len(plan) + 9):
        answer = next_steps(source, now._replace(begun=begun, reach=reach))
        if not answer.steps:
            break
        step = answer.steps[0]
        if begun == pushed:  # as far away as a step may go
            stance = now.start.right if step.side == "left" else now.start.left
            far = replace(step, x=step.x + x, y=step.y + y, yaw=step.yaw + yaw)
            step = reach.nearest(stance, far)
        start = replace(now.start, left=step) if step.side == "left" else replace(now.start, right=step)
        now = now._replace(start=start, first="right" if step.side == "left" else "left")
    assert not answer.steps
    for foot, wanted in zip((now.start.left, now.start.right), plan.final, strict=True):
        assert math.hypot(foot.x - wanted.x, foot.y - wanted.y) < BESIDE * reach.max_length


def test_a_plan_that_is_followed_again_begins_anew() -> None:
    stage = Stage()
    source = PlanSource(walk_path(stage.walk.phases.plan, [(0.0, 0.0, 0.0)] * 3))
    for steps in (4, 8):
        stage.follow(source)
        assert not stage.walk.finished
        stage.run(8.0)
        assert (stage.walk.finished, stage.walk.steps_done, stage.source.reason) == (True, steps, "")


@settings_class
class OwnGait(StepGait):
    """Gait with another default, and a value of the swing that others leave as it is."""

    single_support: float = 0.6
    touch: float = 0.5


def test_gait_for_a_speed() -> None:
    """Quicker and lower steps at higher speed; what is given stays, also where it is the default."""
    assert Gait.for_speed((0.0, 0.0, 0.0)) == StepGait()
    for own in (Gait(single_support=0.9), Gait(single_support=0.8), replace(Gait(), single_support=0.8)):
        slow = Gait.for_speed((0.4, 0.0, 0.0), from_json(Gait, to_json(own)))
        assert slow.single_support == own.single_support and slow.double_support < 0.3
    assert Gait.for_speed((0.15, 0.0, 0.0)) == StepGait()
    whole = OwnGait()
    assert Gait.for_speed((0.4, 0.0, 0.0), whole) is whole.full is whole and whole.swing.touch == 0.5
    for own in (Gait(takeoff_time=0.15, landing_time=0.2), Gait(landing_time=0.25), Gait(takeoff_time=0.0)):
        for gait in [Gait.at_speed(speed, own) for speed in (0.0, 0.2, 0.4, 0.6)]:
            assert gait.takeoff_time + gait.landing_time <= 0.5 * gait.single_support + 1e-9
            assert gait.given.items() >= own.given.items()


@pytest.mark.parametrize("name", ["hrp4_class", "talos"])
def test_no_speed_is_granted_that_takes_more_than_the_legs_give(name: str) -> None:
    """Whatever the settings allow: as a plan, too, its steps are accepted."""
    reach = Reach.of(ROBOTS[name])
    source = steered_steps(reach, DriveSettings(fastest=(2.0, 1.0, 1.0), reach=1.0))
    source.steering.command((2.0, 0.0, 0.0))
    now, granted = standing(name), []
    for k in range(60):
        plan = source.footsteps(now._replace(time=0.4 * k))
        check_plan(plan, reach)
        granted.append(source.granted[0])
    assert 0.3 < granted[-1] < 1.0 and max(granted) < 1.0


@pytest.mark.parametrize("name", ["hrp4_class", "talos", "g1"])
def test_the_reach_of_every_robot_grants_its_speed(name: str) -> None:
    """Straight legs get it by bent knees, which robots with bent ones keep."""
    robot = ROBOTS[name]
    height = Leg(robot).bent_height(DriveSettings().stretch)
    assert height <= robot.com[2] + 1e-9 and (height < robot.com[2] - 0.01) == (name == "g1")
    source = steered_steps(Reach.of(robot, height))
    for first, target in ((0, 0.3), (30, 0.2)):
        source.steering.command((target, 0.0, 0.0))
        for i in range(first, first + 30):
            source.footsteps(standing(name)._replace(time=0.1 * i))
        assert source.granted[0] == pytest.approx(target, abs=0.03) and source.pace == target


@pytest.mark.parametrize(
    ("name", "value", "reason"), [("granted", (0.2,), "velocity"), ("pace", math.nan, "pace")]
)
def test_a_planner_without_a_finite_velocity_or_pace_is_refused_and_the_robot_stops(
    name: str, value: object, reason: str
) -> None:
    stage = Stage()
    stage.steer((0.15, 0.0, 0.0))
    stage.run(1.5)
    stage.follow(type("Odd", (Own,), {name: value})(lambda now: now.start))
    stage.run(0.5)
    assert reason in stage.source.reason
    stage.steer(None)
    stage.run(3.0)
    assert stage.walk.finished
