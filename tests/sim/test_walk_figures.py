"""Figures of walks without a simulation: ways, times and grounds of plans, pushes, falls, the objective."""

from __future__ import annotations

import math
import re
from collections import deque
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples
from scipy.spatial.transform import Rotation

from wbc.base.errors import InputError
from wbc.base.files import file_hash
from wbc.core.robot import GRAVITY
from wbc.feet.stiffness.model import DEFAULT_MODEL
from wbc.sim.plant.eyes import DepthCamera, ToeSensors
from wbc.sim.terrain.spec import terrain
from wbc.sim.trial.push import PushSchedule, WalkPush
from wbc.sim.walks.meter import EXCURSION, StiffnessMeter, WalkMeter, _Moment, spread
from wbc.sim.walks.plan import ROOM_ASIDE, WalkPlan, check_drive, check_velocity, fitted, stair_of
from wbc.sim.walks.prepare import moved_configuration
from wbc.sim.walks.presets import plan_over
from wbc.sim.walks.result import Spread, objective
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial, _sensors
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.sources import VelocityLimits
from wbc.walking.source import Progress
from wbc.walking.steered import SteeredControl

EXACT = {"noise": 0.0, "relative_noise": 0.0, "resolution": 0.0, "dropout": 0.0}

# --- pushes ----------------------------------------------------------------------------------------------------------


@SteeredControl.register
class Pushed:
    """A plant, its controller and their tick, for a schedule of pushes."""

    def __init__(self, mass: float) -> None:
        self.time, self.robot, self.pushes = 0.0, SimpleNamespace(mass=mass), []
        self.progress = SimpleNamespace(steps_done=0, cycle=0.8, events=())
        self.plant = self.control = self

    def push(self, body: str, force: np.ndarray, duration: float) -> None:
        self.pushes.append((self.time, body, force, duration))


@given(st.floats(0.01, 2.0), st.floats(-3.0, 3.0), st.floats(0.01, 0.5), st.floats(1.0, 90.0))
@examples(20)
def test_a_push_has_its_impulse_per_mass_in_its_direction(
    impulse: float, direction: float, duration: float, mass: float
) -> None:
    """Force times duration is the impulse times the robot's mass, along the direction in the world."""
    tick: Any = Pushed(mass)
    push = WalkPush(impulse=impulse, direction=direction, duration=duration, body="pelvis", time=0.3)
    schedule = PushSchedule([push])
    for tick.time in np.arange(0.0, 0.6, 0.005):
        schedule.tick(tick)
    ((begin, body, force, lasts),) = tick.pushes
    assert (begin, body, lasts) == (pytest.approx(0.3), "pelvis", duration)
    along = [math.cos(direction), math.sin(direction), 0.0]
    np.testing.assert_allclose(force * lasts, impulse * mass * np.array(along), atol=1e-9)
    assert schedule.not_begun == []


def test_a_push_at_a_step_begins_at_its_phase_after_the_lift_off() -> None:
    """Step n begins with its first lift-off; a phase is a share of the step's cycle; another event begins nothing."""
    tick: Any = Pushed(50.0)
    pushes = [
        WalkPush(impulse=0.1, step=n, phase=phase) for n, phase in ((1, 0.0), (2, 0.25), (2, 1.0), (5, 0.0))
    ]
    schedule = PushSchedule([*pushes, WalkPush(impulse=0.1, time=9.0)])
    lift_offs = {0.5: 0, 1.4: 1}  # time → steps done
    for now in np.arange(0.0, 3.0, 0.05).round(9).tolist():
        tick.time = now
        tick.progress.events = (Event.TOUCH_DOWN,) if now == 0.2 else ()
        if now in lift_offs:
            tick.progress.events, tick.progress.steps_done = (Event.LIFT_OFF,), lift_offs[now]
        if now == 1.6:
            tick.progress.events = (Event.LIFT_OFF,)  # again, of the same step
        schedule.tick(tick)
    assert [begin for begin, *_ in tick.pushes] == pytest.approx([0.5, 1.6, 2.2])
    assert (
        len(schedule.not_begun) == 2 and "step 5" in schedule.not_begun[0] and "9 s" in schedule.not_begun[1]
    )
    unable: Any = Pushed(50.0)
    unable.control, unable.time = SimpleNamespace(), 9.0
    schedule.tick(unable)
    assert len(unable.pushes) == 1
    for times in ({}, {"time": 1.0, "step": 1}):
        with pytest.raises(InputError):
            WalkPush(impulse=0.1, **times)


# --- plans -----------------------------------------------------------------------------------------------------------


def test_the_way_of_a_plan_is_that_of_its_velocities() -> None:
    gait, start = Gait(), (1.0, 2.0, 0.5 * math.pi)
    assert WalkPlan(distance=-0.7).way(start, gait, planned=True) == [(1.0, 2.0), pytest.approx((1.0, 1.3))]
    step = Gait.for_speed((0.2, 0.0, 0.0), gait).full.cycle
    for planned, time in ((True, step), (False, 0.8)):
        way = WalkPlan(velocity=(0.2, 0.0, 0.0), steps=5).way(start, gait, planned=planned)
        assert len(way) == 6
        np.testing.assert_allclose(way[-1], [1.0, 2.0 + 5 * 0.2 * time], atol=1e-9)
    turning = WalkPlan(velocity=(0.1, 0.05, 0.3), steps=2).way((0.0, 0.0, 0.0), gait, planned=False)
    c, s_ = math.cos(0.3 * 0.8), math.sin(0.3 * 0.8)
    np.testing.assert_allclose(turning[1], [0.08, 0.04], atol=0.006)
    first, second = np.array(turning[1]), np.subtract(turning[2], turning[1])
    np.testing.assert_allclose(
        second, [c * first[0] - s_ * first[1], s_ * first[0] + c * first[1]], atol=1e-9
    )
    # A circle of radius v / ω, in pieces of at most 0.25 s; a stand goes nowhere.
    rows = ((0.0, 0.3, 0.0, 0.5), (2.0, 0.0, 0.0, 0.0), (3.0, 0.0, 0.1, 0.0), (4.0, 0.0, 0.0, 0.0))
    way = WalkPlan(drive=rows).way((0.0, 0.0, 0.0), gait, planned=False)
    assert len(way) == 1 + 8 + 4
    angle = 1.0
    np.testing.assert_allclose(way[8], [0.6 * math.sin(angle), 0.6 * (1.0 - math.cos(angle))], atol=0.04)
    np.testing.assert_allclose(
        np.subtract(way[-1], way[8]), [-0.1 * math.sin(angle), 0.1 * math.cos(angle)], atol=1e-9
    )
    assert (
        len(WalkPlan(drive=((0.0, 0.1, 0.0, 0.0), (0.24, 0.0, 0.0, 0.0))).way(start, gait, planned=True)) == 2
    )


@pytest.mark.parametrize(
    ("way", "sizes"),
    [
        ([(0.0, 0.0), (3.0, 0.0)], {}),
        ([(0.0, 0.0), (3.8, 0.0)], {}),  # 4.3 m of ground, less the room of 0.45 m
        ([(0.0, 0.0), (3.9, 0.0)], {"length": 4.0}),
        ([(0.0, 0.0), (7.4, 0.0)], {"length": 8.0}),
        ([(0.0, 0.0), (-0.2, 0.0)], {}),
        ([(0.0, 0.0), (-0.3, 0.0)], {"strip": 2.0}),
        ([(0.0, 0.0), (1.0, 0.04)], {}),
        ([(0.0, 0.0), (1.0, 0.06)], {"width": 2.0}),
        ([(0.0, 0.0), (1.0, -0.7)], {"width": 4.0}),
        ([(0.0, 0.3), (5.0, -1.0)], {"length": 5.0, "width": 4.0}),
    ],
)
def test_a_ground_grows_by_whole_metres_to_hold_a_way_with_room_beside_it(
    way: list[tuple[float, float]], sizes: dict[str, float]
) -> None:
    ground = terrain("stones")
    larger = fitted(ground, way, ())
    assert larger == replace(ground, **sizes)
    x0, x1, y0, y1 = larger.extent
    for x, y in way:
        assert (
            x0 <= x - ROOM_ASIDE
            and y0 <= y - ROOM_ASIDE <= y + ROOM_ASIDE <= y1
            and x <= x1 - ROOM_ASIDE + 1e-9
        )
    assert fitted(ground, way, ("length", "strip", "width")) == ground


def test_times_of_a_drive_increase_from_zero_and_end_with_a_stand() -> None:
    go, stand = (0.1, 0.0, 0.0), (0.0, 0.0, 0.0)
    for times in ((0.0, 1.0), (0.5, 0.6)):
        check_drive([(times[0], *go), (times[1], *stand)])
    bad = [[], [(-0.1, *stand)], [(0.0, *go), (0.0, *stand)], [(1.0, *go), (0.5, *stand)], [(0.0, *go)]]
    bad += [[(0.0, 0.0, 0.0, 0.1)], [(0.0, 0.0, 0.1, 0.0)]]
    for rows in bad:
        with pytest.raises(InputError):
            check_drive(rows)


@pytest.mark.parametrize("axis", range(4))
def test_a_velocity_is_within_its_limits_each_or_together(axis: int) -> None:
    limits = VelocityLimits(forward=0.4, back=0.2, aside=0.1, turn=0.5)
    most = ((0.4, 0.0, 0.0), (-0.2, 0.0, 0.0), (0.0, -0.1, 0.0), (0.0, 0.0, 0.5))[axis]

    def fits(velocity: tuple[float, ...], *, together: bool) -> bool:
        try:
            check_velocity(velocity, limits, "steps", together=together)  # type: ignore[arg-type]
        except InputError:
            return False
        return True

    for together in (False, True):
        assert fits(most, together=together)
        assert not fits(tuple(1.001 * v for v in most), together=together)
    other = (0.0, 0.0, 0.5) if axis < 3 else (0.4, 0.0, 0.0)
    both = np.add(most, other)
    assert fits(tuple(both), together=False) and not fits(tuple(both), together=True)
    assert fits(tuple(both / math.sqrt(2.0) * 0.999), together=True)  # shares of 0.71 each: squares add to 1
    with pytest.raises(InputError):
        check_velocity((0.0, 1e-6, 0.0), limits._replace(aside=0.0), "steps")
    check_velocity((0.1, 0.0, 0.0), limits._replace(aside=0.0), "steps")
    uneven = VelocityLimits(0.80496, 0.5999, 0.2345678, 1.0 / 3.0)
    with pytest.raises(InputError) as refused:
        check_velocity((9.0, 0.0, 0.0), uneven, "steps")
    told = [float(number) for number in re.findall(r"[0-9]+\.[0-9]+", str(refused.value))]
    for each, (x, y, turn) in zip(told, ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, 0, 1)), strict=True):
        check_velocity((x * each, y * each, turn * each), uneven, "steps")


@pytest.mark.parametrize(("direction", "sign"), [("up", 1.0), ("down", -1.0)])
def test_the_stair_of_a_ground_is_where_its_height_changes(direction: str, sign: float) -> None:
    ground = terrain("steps", 0.3, riser=0.12, tread=0.25, direction=direction, length=2.0)
    rise, tread, count, edge = stair_of(ground)
    assert (rise, tread, count) == pytest.approx((sign * 0.1, 0.25, 3))
    for i in range(count):
        before, after = ground.height(edge + i * tread + np.array([-1e-6, 1e-6]), 0.0)
        assert after - before == pytest.approx(rise)
    for none in (terrain("flat"), terrain("steps", 0.0), terrain("steps", 0.1)):
        with pytest.raises(InputError):
            stair_of(none)


def test_a_plan_keeps_of_a_lower_one_what_belongs_to_its_kind() -> None:
    assert plan_over({"distance": 1.0}, {"distance": 2.0}) == {"distance": 1.0}
    assert plan_over({"distance": 1.0}, {"turn": 2.0, "steps": None}) == {"distance": 1.0}
    assert plan_over({"steps": 3}, {"velocity": (0.1, 0.0, 0.0), "steps": 2})["steps"] == 3
    assert WalkPlan().distance == 3.0 and WalkPlan(velocity=(0.1, 0.0, 0.0)).steps == 22
    for bad in (
        {"distance": 1.0, "turn": 1.0},
        {"distance": 1.0, "steps": 3},
        {"drive": ((0.0, 0.0, 0.0, 0.0),), "first": "left"},
        {"turn": 0.5, "first": "left"},
        {"footsteps": (Footstep("left", 0.1, 0.09),), "first": "left"},
        {"footsteps": ()},
    ):
        with pytest.raises(InputError):
            WalkPlan(**bad)  # type: ignore[arg-type]


def test_a_planned_walk_takes_the_time_of_its_phases() -> None:
    """Shift, n swings with n − 1 double supports between them, rest; a walk is given half as long again and 5 s."""
    gait = Gait(single_support=0.7, double_support=0.2, initial_double_support=0.6, final_double_support=0.8)
    for plan in (WalkPlan(distance=0.5), WalkPlan(turn=0.4)):
        prepared = WalkSpec(plan=plan, gait=gait, mode="position").prepare()
        n = len(prepared.plan)
        assert n >= 2 and prepared.nominal_time == pytest.approx(0.6 + 0.7 * n + 0.2 * (n - 1) + 0.8)
        assert prepared.time_limit == math.ceil(1.5 * prepared.nominal_time + 5.0)
    rows = ((0.0, 0.1, 0.0, 0.0), (3.0, 0.0, 0.0, 0.0))
    driven = WalkSpec(plan=WalkPlan(drive=rows), gait=gait, mode="position").prepare()
    assert driven.nominal_time == pytest.approx(3.0 + 2.0 * 0.9 + 0.8) and driven.arrival() is None


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
@examples(20)
def test_a_configuration_is_moved_over_the_ground_and_turned_about_the_vertical(
    x: float, y: float, yaw: float
) -> None:
    q = np.array([0.3, -0.2, 0.8, *Rotation.from_euler("xyz", [0.1, 0.2, 0.4]).as_quat(), 0.5, -0.6])
    there = moved_configuration(q, (x, y, yaw))
    turn = Rotation.from_euler("z", yaw)
    np.testing.assert_allclose(there[:3], turn.apply(q[:3]) + [x, y, 0.0], atol=1e-9)
    expected = turn * Rotation.from_quat(q[3:7])
    assert (Rotation.from_quat(there[3:7]).inv() * expected).magnitude() == pytest.approx(0.0, abs=1e-7)
    np.testing.assert_array_equal(there[7:], q[7:])


@pytest.mark.parametrize(("eyes", "kind"), [("none", None), ("depth", DepthCamera), ("toes", ToeSensors)])
@pytest.mark.parametrize("noise", ["none", "realistic"])
def test_sensors_of_a_walk_are_exact_if_its_noise_is_none(noise: str, eyes: str, kind: type | None) -> None:
    spec = WalkSpec(noise=noise, eyes=eyes, foot="variable")  # type: ignore[arg-type]
    settings = spec.prepare().settings
    ranges, seeing = _sensors(spec, settings)
    assert ranges is not None and _sensors(replace(spec, foot="soft"), settings) == (None, seeing)
    assert [type(each) for each in seeing] == ([] if kind is None else [kind])
    errors = [getattr(each, name) for each in seeing for name in ("noise", "dropout")]
    errors += [ranges.noise, ranges.relative_noise, ranges.resolution, ranges.dropout]
    assert not any(errors) if noise == "none" else seeing == () or any(errors[:2])
    assert ranges == (settings.range_sensor if noise != "none" else replace(settings.range_sensor, **EXACT))
    for each, own in zip(seeing, (settings.camera if eyes == "depth" else settings.toes,), strict=False):
        assert (each == own) == (noise == "realistic") and each.rate == own.rate


def test_a_spec_that_names_a_file_of_a_policy_has_the_hash_of_its_content(tmp_path: Path) -> None:
    """One that leaves the file to the library has none, so that it follows the library; numbers are numbers."""
    file = tmp_path / "model.json"
    file.write_bytes(DEFAULT_MODEL.read_bytes())
    named = (("path", f"{file}#{file_hash(file)}"),)
    for fields, stored in (
        ({}, ()),
        ({"policy": "model"}, ()),
        ({"policy_params": {"path": None}}, ()),
        ({"policy_params": {"path": str(file)}}, named),
        ({"policy_params": dict(named)}, named),
        ({"policy": "fixed", "policy_params": {"stiffness": 7}}, (("stiffness", 7.0),)),
    ):
        spec = WalkSpec(foot="variable", **fields)  # type: ignore[arg-type]
        assert spec.policy_params == stored
        assert spec.scheduling == (spec.policy or "model", stored)
    spec = WalkSpec(foot="variable", policy_params=dict(named))  # type: ignore[arg-type]
    file.write_text("another", encoding="utf-8")
    with pytest.raises(InputError, match="has changed"):
        WalkTrial(spec, visuals=False)
    timing = WalkSpec(foot="variable").prepare().settings.stiffness
    assert (timing.decide_at, timing.early_landing) == (0.55, 0.25)  # as docs/feet.md says


# --- figures ---------------------------------------------------------------------------------------------------------


def test_the_objective_is_that_of_the_paper() -> None:
    """J = −(10 n + 3 μ_zmp + 9 σ_zmp + 3 μ_com + 9 σ_com), errors in m; what was not measured counts nothing."""
    assert objective(0, Spread(None, None), Spread(None, None)) == 0.0
    found = objective(3, Spread(0.01, 0.002), Spread(0.03, 0.004))
    assert found == pytest.approx(-(30.0 + 0.03 + 0.018 + 0.09 + 0.036))
    assert spread([]) == Spread(None, None)
    assert spread([1.0, 3.0]) == Spread(2.0, 1.0)  # of all values: the deviation of a population


def moment(
    stance: int, rotation: Rotation, dcm_error: list[float] | None = None, elapsed: float = 0.3
) -> _Moment:
    matrix = rotation.as_matrix()
    progress = Progress(GaitPhase.SINGLE, stance, steps_done=1, elapsed=elapsed, duration=0.6)
    return _Moment(elapsed, progress, matrix, dcm_error)


@given(st.floats(-3.0, 3.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.sampled_from([0, 1]))
@examples(20)
def test_an_excursion_is_seen_from_the_stance_foot(
    yaw: float, roll: float, pitch: float, stance: int
) -> None:
    """Measured minus reference, forward along the foot and outward: to the left of a left foot."""
    rotation = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    left = np.array([-math.sin(yaw), math.cos(yaw)])
    excursion = 0.03 * np.array([math.cos(yaw), math.sin(yaw)]) + 0.07 * left
    found = moment(stance, rotation, (-excursion).tolist())
    assert found.dcm == pytest.approx((0.03, 0.07 if stance == 0 else -0.07))
    assert found.tilt == pytest.approx((roll, pitch), abs=1e-9)
    assert found.share == 0.5 and moment(0, rotation, elapsed=2.0).share == 1.0
    assert moment(stance, rotation).dcm is None
    assert found._replace(progress=found.progress._replace(duration=0.0)).share == 0.0


LEVEL = Rotation.identity()


def fall(moments: list[_Moment], reason: str = "tilt", velocity: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Any:
    """Return the fall of a meter that has seen some moments, at 9 s."""
    meter: Any = object.__new__(WalkMeter)
    meter._moments = deque(moments)
    meter._walking = SimpleNamespace(progress=Progress(steps_done=4))
    truth = SimpleNamespace(com_velocity=np.array(velocity))
    turned = Rotation.from_euler("ZYX", [2.0, 0.3, 0.2]).as_quat().tolist()
    meter._plant = SimpleNamespace(time=9.0, truth=lambda: truth, base_pose=[0.0, 0.0, 0.5, *turned])
    return meter.fall(reason)


def test_the_onset_of_a_fall_is_the_last_time_that_the_dcm_left_its_reference() -> None:
    """Moments 0.1 s apart with excursions forward, m: it left by 60 mm at 0.2 s, came back, and left at 0.5 s."""
    aways = (0.0, 0.0, 0.07, 0.05, 0.059, 0.061, 0.1, 0.2)
    moments = [moment(0, LEVEL, [-away, 0.0], 0.1 * i) for i, away in enumerate(aways)]
    found = fall(moments)
    assert (found.onset, found.time, found.step, found.reason) == (pytest.approx(0.5), 9.0, 2, "tilt")
    assert found.dcm_forward == pytest.approx(0.061) and found.dcm_outward == pytest.approx(0.0)
    assert pytest.approx(0.06) == EXCURSION and found.share == pytest.approx(0.5 / 0.6)
    assert fall(moments[:2]).onset == pytest.approx(
        0.1
    )  # a fall without an excursion begins where it is seen
    bare = fall([])
    assert (bare.onset, bare.step, bare.phase) == (9.0, 5, "standing")


def test_a_fall_without_a_stance_foot_goes_where_the_com_moves_from_the_pelvis() -> None:
    """A policy has no references; the heading of the pelvis is 2 rad."""
    for way, cause in enumerate(("forward", "left", "backward", "right")):
        angle = 2.0 + 0.5 * math.pi * way
        found = fall([], velocity=(math.cos(angle), math.sin(angle), -1.0))
        assert found.cause == cause and found.dcm_forward is None and found.dcm_outward is None
        assert found.sole_roll == found.sole_pitch == 0.0


@pytest.mark.parametrize("stance", [0, 1])
def test_a_fall_goes_where_the_larger_excursion_is(stance: int) -> None:
    side = 1.0 if stance == 0 else -1.0
    for forward, left, cause in (
        (0.1, 0.05, "forward"),
        (-0.1, 0.05, "backward"),
        (0.05, 0.1, "left"),
        (0.05, -0.1, "right"),
    ):
        found = fall([moment(stance, LEVEL, [-forward, -left])])
        assert found.cause == cause
        assert (found.dcm_forward, found.dcm_outward) == pytest.approx((forward, side * left))
        unseen = fall([moment(stance, LEVEL)], velocity=(forward, left, -1.0))
        assert unseen.cause == cause and unseen.dcm_forward is None and unseen.dcm_outward is None
        assert fall([moment(stance, LEVEL, [-forward, -left])], "height").cause == "dropped"


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_the_way_of_a_walk_is_that_of_its_true_feet_from_where_they_began(yaw: float) -> None:
    """Forward and left of the first heading; work over weight and way; the pelvis against its first heading."""
    trial = WalkTrial(
        WalkSpec(plan=WalkPlan(distance=0.5), noise="none", start=(1.0, -2.0, yaw)), visuals=False
    )
    plant, q = trial.plant, trial.plant.truth().q
    c, s, away = math.cos(yaw), math.sin(yaw), np.array([0.4, 0.1])
    there = q.copy()
    there[:2] += [c * away[0] - s * away[1], s * away[0] + c * away[1]]
    trial.meter.work[:] = 50.0 / plant.robot.na
    plant.reset(there)
    arrival = trial._prepared.arrival()
    found = trial._travel(arrival)
    assert (found["distance"], found["drift"]) == pytest.approx((0.4, 0.1), abs=1e-9)
    assert found["yaw_error"] == pytest.approx(0.0, abs=1e-9)
    assert found["cost_of_transport"] == pytest.approx(
        50.0 / (plant.robot.mass * GRAVITY * math.hypot(0.4, 0.1))
    )
    assert arrival is not None and found["goal_error"] == pytest.approx(math.hypot(0.1, 0.1), abs=0.02)
    for by in (0.3, -0.2):
        turned = there.copy()
        turned[3:7] = (Rotation.from_euler("z", by) * Rotation.from_quat(there[3:7])).as_quat()
        plant.reset(turned)
        assert (
            trial._travel(None)["yaw_error"] == pytest.approx(by)
            and trial._travel(None)["goal_error"] is None
        )
    for way, counted in ((0.049, False), (0.051, True)):
        near = q.copy()
        near[0] += way
        plant.reset(near)
        assert (trial._travel(None)["cost_of_transport"] is not None) == counted
    result = trial.result()
    assert (result.outcome, result.steps_done, result.impact) == ("unfinished", 0, None)
    assert (
        pytest.approx(-10.0 * result.steps_planned) == result.J
    )  # all steps are left, and nothing was measured
    lowest = min(plant.sole_pose(side)[0][2] for side in (0, 1))
    assert trial.ground == pytest.approx(lowest)


@pytest.mark.parametrize("drift", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.02), (0.04, -0.03, 0.01)])
def test_a_scan_is_compared_with_the_ground_under_the_true_foot(
    drift: tuple[float, float, float],
) -> None:
    """The drift of the estimate is no error of the shape."""
    ground, move = terrain("slope", 0.3, direction="up"), np.array(drift)
    true = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.3), np.array([1.0, 0.1, 0.2]))
    seen = pin.SE3(true.rotation, true.translation + move)
    meter: Any = object.__new__(StiffnessMeter)
    robot = SimpleNamespace(placement=lambda frame: seen)
    meter._walking = SimpleNamespace(drives=SimpleNamespace(observer=SimpleNamespace(robot=robot)))
    data = SimpleNamespace(site_xpos=[true.translation], site_xmat=[true.rotation.ravel()])
    meter._plant, meter._soles = SimpleNamespace(data=data, sole_sites=[0], terrain=ground), ["left"]
    x = np.linspace(0.9, 1.3, 20)
    hits = np.stack([x, 0.0 * x + 0.1, ground.height(x, 0.1)], axis=1) + move  # where the estimate puts them
    wave = 0.003 * np.sin(30.0 * x)
    hits[:, 2] += wave
    size = np.abs(wave - wave.mean())
    found = meter._error(0, SimpleNamespace(points=hits))
    assert found == pytest.approx({"mean": size.mean(), "p95": np.percentile(size, 95)})


def test_each_decision_of_a_stiffness_is_recorded_once() -> None:
    task = SimpleNamespace(decided=None)
    meter: Any = object.__new__(StiffnessMeter)
    meter._task, meter._last, meter._times, meter._errors, compared = task, None, [], {}, []
    meter._error = lambda side, profile: compared.append((side, profile))
    decisions = [
        SimpleNamespace(computing=1e-6 * (k + 1), profile=profile, step=k, side=side)
        for k, (profile, side) in enumerate([("first", "left"), (None, "right"), ("third", "right")])
    ]
    assert meter.decision_us() is None
    for decided in (None, decisions[0], decisions[0], None, decisions[1], decisions[2], decisions[2]):
        task.decided = decided
        meter.tick(None)
    assert compared == [(0, "first"), (1, "third")] and sorted(meter._errors) == [0, 2]
    assert meter.decision_us() == pytest.approx({"median": 2.0, "max": 3.0})
