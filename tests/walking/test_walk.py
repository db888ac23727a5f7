"""A whole walk in a pendulum world: the parts together, without robot dynamics; and step adjustment on its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin
import pytest
from pendulum import analytic_pattern, com_after, support_area
from properties import by_default

from wbc.core.robot import GRAVITY, SIDES
from wbc.robots import load
from wbc.tasks.stabilizer.distribution import WrenchDistribution
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.pendulum import Pendulum, natural_frequency
from wbc.tasks.stabilizer.stabilizer import Stabilizer
from wbc.walking.contact import TOUCHED, Event, GaitPhase
from wbc.walking.lipm.adjustment import FREEZE, AdjustmentSettings, PlannedSwing, StepAdjuster
from wbc.walking.lipm.schedule import ZmpTarget, schedule
from wbc.walking.lipm.settings import CLIMBING_INWARD, WalkSettings
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.planners import climb_stairs, walk_distance, walk_velocity
from wbc.walking.plans.reach import Reach
from wbc.walking.source import Reference

ROBOT = load("hrp4_class").robot()
START = FootstepPlan.standing(ROBOT)
SIZES = ((0.16, 0.076), (0.16, 0.076))
HEIGHT = 0.76
DT = 0.005
WEIGHT = ROBOT.mass * GRAVITY
TOUCH_DOWNS = {*TOUCHED, Event.NO_TOUCH_DOWN}
STEADY = WalkSettings(adjustment=None)


@dataclass
class Result:
    walk: LipmWalk
    fell: bool = False
    references: list[Reference] = field(default_factory=list)
    dcm_error: list[np.ndarray] = field(default_factory=list)
    events: list[tuple[float, Event]] = field(default_factory=list)
    landed: list[Footstep] = field(default_factory=list)


def run(
    plan: FootstepPlan,
    settings: WalkSettings | None = STEADY,
    *,
    dt: float = DT,
    lag: float = 20.0,
    ground: Callable[[float, float], float] | None = None,
    push: tuple[float, tuple[float, float]] | None = None,
    gains: StabilizerGains | None = None,
    act: Callable[[LipmWalk, float], None] | None = None,
    seconds: float = 60.0,
) -> Result:
    """Feet go where they are told and stop on the ground; the ZMP follows with a lag, inside the loaded feet."""
    walk = LipmWalk(ROBOT, plan, HEIGHT, dt, settings, reach=Reach.of(ROBOT, 0.74))
    stabilizer = Stabilizer(ROBOT.mass, WrenchDistribution(SIZES), gains)
    result = Result(walk)
    reference = walk.advance((WEIGHT / 2, WEIGHT / 2))
    result.events += [(0.0, e) for e in reference.progress.events]
    com, velocity, zmp = reference.pendulum.com.copy(), np.zeros(3), reference.pendulum.zmp[:2].copy()
    wrenches = np.zeros((2, 6))
    wrenches[:, 2] = WEIGHT / 2
    for k in range(round(seconds / dt)):
        if act is not None:
            act(walk, k * dt)
        dcm = (com + velocity / walk.course.pattern.omega)[:2]
        reference = walk.advance(wrenches[:, 2], None, dcm)
        soles = [motion.placement for motion in reference.feet]
        output = stabilizer.update(
            reference.pendulum,
            com,
            velocity,
            wrenches,
            soles,
            reference.progress.contact,
            reference.progress.heading,
            dt,
        )
        result.references.append(reference)
        result.events += [(k * dt, e) for e in reference.progress.events]
        result.dcm_error.append(reference.pendulum.dcm[:2] - dcm)
        if any(event in TOUCH_DOWNS for event in reference.progress.events):
            result.landed.append(walk.phases.plan.steps[walk.phases.step - 1])
        touching = []
        for side in (0, 1):
            x, y, z = soles[side].translation
            level = (
                ground(x, y)
                if ground is not None
                else walk.phases.plan.steps[min(walk.phases.step, len(walk.phases.plan) - 1)].z
                if not reference.progress.contact[side]
                else z
            )
            touching.append(bool(reference.progress.contact[side] or z <= level + 1e-4))
        zmp = zmp + (1 - np.exp(-lag * dt)) * (output.zmp[:2] - zmp)
        feet = tuple(
            replace(Footstep.of(SIDES[i], soles[i]), z=0.0, roll=0.0, pitch=0.0)
            for i in (0, 1)
            if touching[i]
        )
        zmp = project(zmp, *support_area(feet, SIZES))
        flat, speed = com_after(com[:2], velocity[:2], zmp, walk.course.pattern.omega, dt)
        com = np.array([*flat, reference.pendulum.com[2]])
        velocity = np.array([*speed, reference.pendulum.com_velocity[2]])
        if push is not None and push[0] <= k * dt < push[0] + dt:
            velocity[:2] += push[1]
        wrenches = loads(reference, soles, touching, zmp)
        if np.hypot(*result.dcm_error[-1]) > 0.4:
            result.fell = True
            return result
        if walk.finished and not reference.progress.events:
            return result
    return result


def project(point: np.ndarray, normals: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    for _ in range(50):
        excess = normals @ point - offsets
        worst = int(excess.argmax())
        if excess[worst] <= 1e-9:
            break
        point = point - excess[worst] * normals[worst]
    return point


def loads(reference: Reference, soles: list[pin.SE3], touching: list[bool], zmp: np.ndarray) -> np.ndarray:
    if all(touching):
        left, right = (X.translation[:2] for X in soles)
        share = float(
            np.clip(np.dot(zmp - right, left - right) / np.dot(left - right, left - right), 0.0, 1.0)
        )
        if not all(reference.progress.contact):  # just met the ground: 10 % of the weight
            share = max(share, 0.1) if not reference.progress.contact[0] else min(share, 0.9)
    else:
        share = float(touching[0])
    wrenches = np.zeros((2, 6))
    for side, part in enumerate((share, 1.0 - share)):
        force = part * WEIGHT
        wrenches[side, 2] = force
        if part > 0.99:
            x, y, _ = soles[side].actInv(np.array([*zmp, soles[side].translation[2]]))
            wrenches[side, 3:5] = y * force, -x * force
    return wrenches


# The walk


@pytest.fixture(scope="module")
def metre() -> Result:
    return run(walk_distance(START, 0.45))


def test_it_walks_its_plan_and_stands(metre: Result) -> None:
    walk = metre.walk
    assert walk.finished and walk.steps_done == len(metre.landed) == 5
    kinds = [e for _, e in metre.events]
    assert kinds == [Event.STARTED] + [Event.LIFT_OFF, Event.TOUCH_DOWN] * 5 + [Event.STOPPED]
    for reference, motion in zip(walk.phases.plan.final, metre.references[-1].feet, strict=True):
        np.testing.assert_allclose(motion.placement.translation, reference.position, atol=1e-9)
        assert abs(reference.x - 0.45 - START.left.x) < 1e-3
        # The foot sinks on while its landing is being noticed.
        assert abs(reference.z - START.left.z) < 0.03 * walk.phases.plan.gait.landing_speed


def test_references_are_continuous_and_consistent(metre: Result) -> None:
    pendulums = [r.pendulum for r in metre.references]
    com = np.array([p.com for p in pendulums])
    velocity = np.array([p.com_velocity for p in pendulums])
    zmp = np.array([p.zmp for p in pendulums])
    slope = np.diff(com, axis=0) / DT
    assert np.abs(slope - 0.5 * (velocity[1:] + velocity[:-1])).max() < 1e-3
    assert (
        np.abs(np.diff(zmp[:, :2], axis=0)).max() < 0.01
    )  # 2 m/s: no jump of the ZMP, so none of the acceleration
    for side in (0, 1):
        places = np.array([r.feet[side].placement.translation for r in metre.references])
        speeds = np.array([r.feet[side].velocity[:3] for r in metre.references])
        # A foot that lands stops at once.
        stop = 0.5 * metre.walk.phases.plan.gait.landing_speed
        assert np.abs(np.diff(places, axis=0) / DT - 0.5 * (speeds[1:] + speeds[:-1])).max() < stop + 5e-3


@pytest.mark.parametrize("climbing", [False, True])
def test_the_zmp_is_inward_and_less_so_on_stairs(climbing: bool, metre: Result) -> None:
    plan, walked = walk_distance(START, 0.45), metre
    if climbing:
        steps = tuple(replace(step, z=0.03 * (i // 2 + 1)) for i, step in enumerate(plan.steps))
        walked = run(replace(plan, steps=steps), STEADY)
    settings, inward = STEADY, []
    for reference in walked.references[::10]:
        if reference.progress.phase is GaitPhase.SINGLE:
            side = 0 if reference.progress.contact[0] else 1
            y = reference.feet[side].placement.actInv(np.array([*reference.pendulum.zmp[:2], 0.0]))[1]
            inward.append(-y if side == 0 else y)
    expected = CLIMBING_INWARD if climbing else settings.preview.target.inward
    assert np.median(inward) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize(
    "plan",
    [
        walk_velocity(START, (0.1, 0.0, 0.1), 3),
        pytest.param(
            climb_stairs(START, rise=0.1, tread=0.3, count=2, first_edge=0.3), marks=pytest.mark.slow
        ),
    ],
    ids=["curve", "stairs"],
)
def test_it_walks_every_kind_of_plan(plan: FootstepPlan) -> None:
    result = run(plan, replace(STEADY, ground_memory=0.0, rise_memory=0.0))
    assert not result.fell and result.walk.finished and result.walk.steps_done == len(plan)
    for end, wanted in zip(result.walk.phases.plan.final, plan.final, strict=True):
        np.testing.assert_allclose(end.position, wanted.position, atol=3e-3)
        assert end.yaw == pytest.approx(wanted.yaw, abs=1e-6)
    assert result.references[-1].progress.heading == pytest.approx(plan.final[0].yaw, abs=1e-6)


@pytest.mark.slow
def test_stones_bring_early_and_late_landings_and_the_walk_goes_on() -> None:
    rng = np.random.default_rng(3)
    heights = rng.uniform(-0.01, 0.01, (100, 2))

    def ground(x: float, y: float) -> float:
        return 0.0 if x < 0.1 else float(heights[int(x / 0.05) % 100, int(y > 0)])

    result = run(walk_distance(START, 1.0), ground=ground)
    kinds = [e for _, e in result.events]
    assert not result.fell and result.walk.steps_done == 8
    assert Event.EARLY_TOUCH_DOWN in kinds and Event.LATE_TOUCH_DOWN in kinds
    for step in result.landed[2:]:  # each step knows the ground that it has found
        assert step.z == pytest.approx(ground(step.x, step.y), abs=2e-3)


@pytest.mark.slow
def test_feet_land_in_time_on_ground_that_keeps_falling() -> None:
    wanted: dict[int, tuple[float, float]] = {}

    def note(walk: LipmWalk, time: float) -> None:
        if walk.phases.phase is GaitPhase.SINGLE and walk.phases.elapsed <= 2 * DT:
            step = walk.phases.landing
            wanted[walk.steps_done] = step.x, step.z

    def ground(x: float, y: float) -> float:
        return -0.03 * x  # 4 mm a step

    result = run(walk_distance(START, 1.8), STEADY, ground=ground, act=note)
    assert not result.fell
    errors = [z - ground(x, 0.0) for x, z in list(wanted.values())[-6:-1]]
    assert np.abs(errors).max() < 0.001


def test_a_foot_that_stands_is_wanted_where_it_landed_wherever_its_corrections_take_it() -> None:
    """The placements may be the model's own, as a robot hands them out: they go on moving with the foot."""
    walk = LipmWalk(ROBOT, walk_distance(START, 0.6), HEIGHT, DT, STEADY)
    soles = [pin.SE3(START.left.placement), pin.SE3(START.right.placement)]
    landed: tuple[int, pin.SE3] | None = None
    while not walk.finished:
        step = walk.phases.plan.steps[min(walk.phases.step, len(walk.phases.plan) - 1)]
        swing = SIDES.index(step.side)
        share = 0.1 if walk.phases.phase is GaitPhase.SINGLE and walk.phases.remaining <= DT else 0.0
        weight = [WEIGHT * (1.0 - share)] * 2
        weight[swing] = WEIGHT * share
        reference = walk.advance(weight, soles)
        if landed is not None and reference.progress.contact[landed[0]]:
            assert reference.feet[landed[0]].placement.isApprox(landed[1])
        for side in (0, 1):
            if any(event in TOUCH_DOWNS for event in reference.progress.events) and side == swing:
                landed = side, pin.SE3(soles[side])
            turn = pin.SE3(pin.rpy.rpyToMatrix(0.001, 0.0, 0.0), np.zeros(3))
            moved = (
                soles[side] * turn
                if reference.progress.contact[side]
                else pin.SE3(reference.feet[side].placement)
            )
            soles[side].rotation, soles[side].translation = moved.rotation, moved.translation
    assert landed is not None and walk.steps_done == 6


@pytest.mark.slow
def test_step_adjustment_survives_greater_pushes() -> None:
    plan = walk_distance(START, 0.4)
    survived = {}
    for name, settings in (("with", WalkSettings()), ("without", STEADY)):
        survived[name] = [
            not run(plan, settings, push=(time, velocity), seconds=4.0).fell
            for time, velocity in ((2.4, (0.0, -0.25)), (2.4, (0.15, -0.15)))
        ]
    assert all(survived["with"])
    assert sum(survived["without"]) <= 1


def test_without_a_push_no_step_is_moved() -> None:
    result = run(walk_distance(START, 0.3), WalkSettings(), gains=StabilizerGains(zmp_d=0.05))
    for step, wanted in zip(result.landed, walk_distance(START, 0.3).steps, strict=True):
        np.testing.assert_allclose([step.x, step.y], [wanted.x, wanted.y], atol=1e-3)


@pytest.mark.parametrize("width", by_default([1.0, 0.7], 0.7))
@pytest.mark.parametrize("robot", by_default(["hrp4_class", "talos", "g1"], "g1"))
def test_the_constant_error_of_sensors_moves_no_step(robot: str, width: float) -> None:
    """An accelerometer that is off by 0.05 m/s² shifts the DCM by 4 mm; soles of any width have room for it."""
    description = load(robot)
    description = replace(
        description,
        soles=[replace(sole, width=width * sole.width) for sole in description.soles],
    )
    model = description.robot()
    plan, height = walk_distance(FootstepPlan.standing(model), 0.5), 0.97 * float(model.com[2])
    for error in (0.004, -0.004):
        walk = LipmWalk(model, plan, height, DT)
        shares, landed = [0.5, 0.5], []
        dcm = walk.advance([0.5 * model.mass * GRAVITY] * 2).pendulum.dcm[:2]
        for _ in range(6000):
            loads = [share * model.mass * GRAVITY for share in shares]
            reference = walk.advance(loads, None, dcm + (0.0, error))
            dcm, shares = reference.pendulum.dcm[:2], [0.5, 0.5]
            if any(event in TOUCH_DOWNS for event in reference.progress.events):
                landed.append(walk.phases.plan.steps[walk.phases.step - 1])
            if walk.finished:
                break
            step = walk.phases.plan.steps[min(walk.phases.step, len(walk.phases.plan) - 1)]
            side = SIDES.index(step.side)
            height_left = reference.feet[side].placement.translation[2] - step.z
            if not (
                height_left <= 1e-5
                and walk.feet.swing is not None
                and walk.phases.elapsed > 0.6 * walk.phases.duration
            ):
                shares[side], shares[1 - side] = 0.0, 1.0
        assert walk.finished
        for step, wanted in zip(landed, plan.steps, strict=True):
            np.testing.assert_allclose([step.x, step.y], [wanted.x, wanted.y], atol=2e-3)


# Step adjustment on its own


OMEGA = natural_frequency(HEIGHT)
PLAN = walk_distance(START, 1.0)
SECOND_SWING = 0.8 + 0.8 + 0.3


def swing_of(plan: FootstepPlan) -> PlannedSwing:
    """Return the second swing of a plan from rest."""
    middle = 0.5 * (plan.left.position + plan.right.position)
    pattern = analytic_pattern(schedule(plan), HEIGHT, Pendulum.at_rest(middle + [0.0, 0.0, HEIGHT]))
    return PlannedSwing(pattern, -SECOND_SWING, plan.steps[1], plan.stance(1), 0.8, 0.15)


SWING = swing_of(PLAN)


def adjust(
    error: tuple[float, float],
    elapsed: float = 0.4,
    swing: PlannedSwing = SWING,
    settings: AdjustmentSettings | None = None,
) -> tuple[Footstep, float]:
    """Adjust that swing, with an error of the DCM in the axes of the stance foot, m."""
    adjuster = StepAdjuster(HEIGHT, Reach.of(ROBOT, HEIGHT), ZmpTarget(), settings or AdjustmentSettings())
    turn = complex(np.cos(swing.stance.yaw), np.sin(swing.stance.yaw))
    return adjuster.adjust(swing, elapsed, swing.dcm(elapsed) + turn * complex(*error))


def test_small_errors_are_left_to_the_stance_foot() -> None:
    for error in ((0.0, 0.0), (0.02, 0.01), (-0.01, 0.0)):
        assert adjust(error) == (PLAN.steps[1], pytest.approx(0.4))


def test_the_heel_is_counted_on_only_so_far() -> None:
    """The stance foot makes up for a lag of the DCM, or else a shorter or later step does."""
    assert adjust((-0.03, 0.0), settings=AdjustmentSettings(backward=0.1))[0] is PLAN.steps[1]
    landing, remaining = adjust((-0.03, 0.0))
    assert landing.x < PLAN.steps[1].x - 0.005 or remaining > 0.41
    assert adjust((0.03, 0.0))[0] is PLAN.steps[1]  # towards the toes the whole sole is


def test_the_dcm_ends_where_the_plan_has_it_over_the_new_foot() -> None:
    """The law is exact for the pendulum over the ZMP that the QP assumes, when no bound is reached."""
    error = (0.05, -0.05)
    landing, remaining = adjust(error, 0.5)
    # Right foot swings: it lands further right and sooner; what feedback does within the sole is ±28 mm sideways.
    assert landing.y < PLAN.steps[1].y - 0.01 and remaining < 0.3
    grow = np.exp(OMEGA * (0.3 + 0.15))
    now, then = (np.array([xi.real, xi.imag]) for xi in (SWING.dcm(0.5), SWING.dcm(0.95)))
    zmp = (now * grow - then) / (grow - 1)
    taken = np.exp(OMEGA * (remaining + 0.15))
    shift = np.array([0.05, -0.028])  # ahead the sole takes all of it, sideways what it can
    landed = zmp + (now + error - zmp) * taken + shift * (1 - grow)
    offset = then - [PLAN.steps[1].x, PLAN.steps[1].y]
    achieved = landed - [landing.x, landing.y]
    np.testing.assert_allclose(achieved[1], offset[1], atol=2e-3)


def test_it_keeps_within_reach_and_time() -> None:
    reach, settings = Reach.of(ROBOT, HEIGHT), AdjustmentSettings()
    rng = np.random.default_rng(0)
    for _ in range(100):
        landing, remaining = adjust(tuple(rng.uniform(-0.15, 0.15, 2)), rng.uniform(0.0, 0.69))
        forward, left, _, _ = landing.seen_from(PLAN.stance(1))
        assert (
            -reach.max_spacing - 1e-6 <= left <= -reach.min_spacing + 1e-6
            and abs(forward) <= reach.max_length
        )
        assert abs(landing.x - PLAN.steps[1].x) <= settings.max_shift[0] + 1e-6
        assert abs(landing.y - PLAN.steps[1].y) <= settings.max_shift[1] + 1e-6
        assert remaining >= FREEZE - 1e-6
    assert adjust((0.1, 0.1), 0.76)[0] is PLAN.steps[1]


def test_adjustment_moves_and_mirrors_with_the_world() -> None:
    world = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.5), np.array([100.0, -100.0, 0.0]))
    mirrored = walk_distance(START, 1.0, first="right")
    for error in ((0.08, 0.05), (-0.06, -0.07)):
        (here, time), (there, same) = adjust(error), adjust(error, swing=swing_of(PLAN.moved(world)))
        np.testing.assert_allclose(world.act(here.position), there.position, atol=1e-4)
        flipped, again = adjust((error[0], -error[1]), swing=swing_of(mirrored))
        np.testing.assert_allclose(here.position * [1, -1, 1], flipped.position, atol=1e-5)
        assert time == pytest.approx(same, abs=1e-5) == pytest.approx(again, abs=1e-5)


def test_a_step_comes_as_early_as_it_may_and_lands_no_further_away_than_it_may() -> None:
    """50 ms from now; 0.15 m ahead and 0.12 m aside, within the reach of the legs."""
    reach = Reach.of(ROBOT, HEIGHT)
    adjuster = StepAdjuster(HEIGHT, reach, ZmpTarget(), AdjustmentSettings())
    for push in (-0.3j, 0.4j, -0.12, 0.3):
        assert adjuster.adjust(SWING, 0.4, SWING.dcm(0.4) + push)[1] == pytest.approx(FREEZE)
    (low_x, low_y), (high_x, high_y) = adjuster._box((0.1, 0.18))
    assert (low_x, high_x) == pytest.approx((max(-0.05, -reach.max_length), min(0.25, reach.max_length)))
    assert (low_y, high_y) == pytest.approx((max(0.06, reach.min_spacing), min(0.30, reach.max_spacing)))
    for x, y in ((9.0, 0.18), (-9.0, 0.18), (0.1, 9.0), (0.1, 0.0)):
        low, high = adjuster._box((x, y))
        assert low[0] <= x <= high[0] and low[1] <= y <= high[1], "a plan beyond the reach stays possible"


def test_the_room_of_the_zmp_is_that_of_the_sole_less_its_margin_from_the_planned_point() -> None:
    """Ahead 80 mm less 10 mm less 30 mm; to the heel no more than 30 mm, whatever the sole leaves."""
    length, width = 0.5 * ROBOT.soles[0].length - 0.01, 0.5 * ROBOT.soles[0].width - 0.01
    for forward, inward in ((0.03, 0.005), (-0.06, -0.01)):
        target = ZmpTarget(forward=forward, inward=inward)
        low, high = StepAdjuster(HEIGHT, Reach.of(ROBOT, HEIGHT), target, AdjustmentSettings())._shifts[
            "left"
        ]
        assert low == pytest.approx((-min(0.03, length + forward), -width - inward))
        assert high == pytest.approx((length - forward, width - inward))
    for margin in (0.05, 0.5):  # nothing is left of the sole
        settings = AdjustmentSettings(margin=margin)
        low, high = StepAdjuster(HEIGHT, Reach.of(ROBOT, HEIGHT), ZmpTarget(), settings)._shifts["right"]
        assert high[1] == pytest.approx(1e-3) == -low[1]


def test_errors_that_cost_less_than_a_change_of_the_step_need_no_program() -> None:
    """The program would leave the step as it is, too; with twice the error it may not."""
    settings = AdjustmentSettings(backward=0.2, margin=0.0)
    adjuster = StepAdjuster(HEIGHT, Reach.of(ROBOT, HEIGHT), ZmpTarget(), settings)
    grow = np.exp(OMEGA * 0.55)
    idle = adjuster._idle
    assert idle > 0.02
    for angle in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        shift = 0.99 * idle * np.exp(1j * angle)
        if abs(shift.imag) > 0.5 * ROBOT.soles[0].width or abs(shift.real) > 0.5 * ROBOT.soles[0].length:
            continue
        dcm = SWING.dcm(0.4) + shift * (grow - 1.0) / grow
        adjuster._idle = 0.0
        assert adjuster.adjust(SWING, 0.4, dcm)[0] is SWING.landing
        adjuster._idle, adjuster._program.solve = idle, None  # type: ignore[method-assign, assignment]
        assert adjuster.adjust(SWING, 0.4, dcm) == (SWING.landing, pytest.approx(0.4))
        del adjuster._program.solve
