"""Simulated walks: the record follows from the spec alone, and says what happened."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from wbc.base.errors import InputError
from wbc.core.estimation.falls import FallReason
from wbc.core.robot import GRAVITY
from wbc.sim.simulation.machine import Machine
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.threads import one_thread
from wbc.sim.trial.trial import StageError, TrialHook, TrialTick
from wbc.sim.walks.plan import TooFastError, WalkPlan
from wbc.sim.walks.result import WalkResult
from wbc.sim.walks.settings import WalkTrialSettings
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial, walk
from wbc.walking.plans.gait import Gait

TWO_STEPS = WalkPlan(distance=0.1)
EXAMPLE = Path(__file__).parents[2] / "examples" / "biped.xml"
DROP = WalkTrialSettings().falls.drop
QUICK = Gait(single_support=0.65, double_support=0.25, initial_double_support=0.5, final_double_support=0.5)
SPEC = WalkSpec(plan=TWO_STEPS, seed=3, gait=QUICK)
LATE = 0.95 * SPEC.prepare().time_limit


class Notes(TrialHook):
    """Writes down when it is called."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def start(self, trial: WalkTrial) -> None:
        self.calls.append("start")

    def tick(self, tick: TrialTick) -> None:
        assert tick.measurement.time == tick.plant.time
        self.calls.append("tick")

    def end(self, result: WalkResult) -> None:
        self.calls.append("end")


class Stop(TrialHook):
    """Ends a walk after half a second."""

    def before(self, trial: WalkTrial) -> None:
        if trial.plant.time > 0.5:
            trial.stop()


class Work(TrialHook):
    """Adds up the work of the joints: of each, and of all together."""

    work = together = weight = 0.0

    def after(self, trial: WalkTrial) -> None:
        powers = trial.plant.joint_torque * trial.plant.joint_velocity * trial.spec.period
        self.work += float(np.abs(powers).sum())
        self.together += abs(float(powers.sum()))
        self.weight = trial.plant.robot.mass * GRAVITY


@pytest.fixture(scope="module")
def hooked() -> tuple[WalkResult, Notes, Work]:
    """A walk with hooks, and with a weak push and one that comes too late."""
    notes, work = Notes(), Work()
    pushes = tuple(WalkPush(impulse=0.01, time=time) for time in (0.5, LATE))
    return walk(SPEC, pushes=pushes, hooks=[notes, work]), notes, work


def test_equal_specs_give_equal_records_with_any_hooks() -> None:
    """To half a second; one spec was written and read."""
    records = []
    for spec, hooks in (
        (SPEC, []),
        (WalkSpec.from_json(json.loads(json.dumps(SPEC.to_json()))), [Notes(), Work()]),
    ):
        trial = WalkTrial(spec, visuals=False)
        trial.scenario.append(Stop())
        records.append(trial.run(hooks).record())
    assert records[0] == records[1] and records[0]["outcome"] == "stopped"


def test_hooks_are_called_from_the_start_in_every_tick_to_the_end(
    hooked: tuple[WalkResult, Notes, Work],
) -> None:
    result, notes, _ = hooked
    assert notes.calls == ["start", *["tick"] * round(result.seconds / SPEC.period), "end"]


@pytest.fixture
def specs(monkeypatch: pytest.MonkeyPatch) -> list[WalkSpec]:
    """The specs of walks that are told, and not walked."""
    told: list[WalkSpec] = []
    made = lambda spec, **_: SimpleNamespace(run=lambda hooks: told.append(spec))  # noqa: E731
    monkeypatch.setattr("wbc.sim.walks.trial.WalkTrial", made)
    return told


def test_a_walk_takes_fields_of_spec_and_plan_by_name(specs: list[WalkSpec]) -> None:
    walk(WalkSpec(robot="talos", gait=QUICK), robot="hrp4_class", distance=0.1, seed=3)
    assert specs == [SPEC]
    for values, named in (({"distanc": 1.0}, "distance"), ({"plan": TWO_STEPS, "turn": 1.0}, "turn")):
        with pytest.raises(InputError, match=named):
            walk(**values)  # type: ignore[arg-type]


def test_fields_of_a_plan_change_nothing_else_of_it(specs: list[WalkSpec]) -> None:
    """A plan of another kind takes the place of the old one."""
    side = WalkSpec(plan=WalkPlan(velocity=(0.1, 0.0, 0.0), steps=4), noise="none")
    walk(side, velocity=(0.15, 0.0, 0.0))
    walk(side, steps=5)
    walk(side, distance=0.2)
    walk(side, turn=0.2)
    walk(side, seed=8)
    assert [spec.plan for spec in specs] == [
        WalkPlan(velocity=(0.15, 0.0, 0.0), steps=4),
        WalkPlan(velocity=(0.1, 0.0, 0.0), steps=5),
        WalkPlan(distance=0.2),
        WalkPlan(turn=0.2),
        side.plan,
    ]


def test_what_belongs_to_a_value_goes_with_it_in_a_program_as_on_the_command_line(
    specs: list[WalkSpec],
) -> None:
    def spec_of(**values: Any) -> WalkSpec:
        walk(soft, **values)
        return specs[-1]

    soft = WalkSpec(
        foot="soft",
        stiffness=30.0,
        foot_changes={"phalanges": 8},
        terrain="stones",
        amplitude=0.03,
        plan=TWO_STEPS,
    )
    assert spec_of(seed=4) == replace(soft, seed=4) and spec_of(foot="soft") == soft
    flat = spec_of(foot="flat")
    assert flat.stiffness is None and not flat.foot_changes and flat.amplitude == 0.03
    assert spec_of(terrain="random").ground() == WalkSpec(terrain="random", plan=TWO_STEPS).ground()
    kept = spec_of(foot="long_arch", stiffness=4.0)
    assert kept.stiffness == 4.0 and not kept.foot_changes


def test_parameters_of_a_walk_take_the_numbers_of_numpy() -> None:
    def given(number: Callable[[float], Any], several: Callable[[list[float]], Any]) -> WalkSpec:
        return WalkSpec(
            foot="variable",
            policy="fixed",
            policy_params={"stiffness": number(5.0)},
            terrain="stones",
            amplitude=number(0.5),
            terrain_params={"length": number(4.0)},
            changes={"gains.dcm_p": several([4.0, 5.0]), "walk.phases.lift_off": number(0.25)},
            start=several([0.5, 0.25, 0.0]),
        )

    plain = given(float, list)
    for kind in (np.float32, np.float64):
        spec = given(kind, lambda values, kind=kind: np.array(values, dtype=kind))  # type: ignore[misc]
        assert spec == plain and WalkSpec.from_json(json.loads(json.dumps(spec.to_json()))) == plain


def test_a_push_after_the_end_is_refused_or_told(hooked: tuple[WalkResult, Notes, Work]) -> None:
    with pytest.raises(InputError, match="after the walk"):
        replace(SPEC, pushes=(WalkPush(impulse=0.1, time=SPEC.prepare().time_limit),))
    result, _, _ = hooked
    assert result.outcome == "completed" and result.seconds < LATE
    assert len(result.notes) == 1 and f"{LATE:g} s" in result.notes[0]


def test_cost_of_transport_is_the_work_of_every_joint_over_weight_and_way(
    hooked: tuple[WalkResult, Notes, Work],
) -> None:
    """The work of a joint counts whether it drives or brakes: ∑ |τ q̇| T, not the work that all do together."""
    result, _, hook = hooked
    way = math.hypot(result.distance, result.drift)
    assert result.cost_of_transport == pytest.approx(hook.work / (hook.weight * way), rel=1e-9)
    assert hook.work > 1.2 * hook.together


def test_the_drop_of_a_fall_is_in_proportion_to_the_robots_size() -> None:
    for robot, size in (("g1", 1.0), (str(EXAMPLE), 0.922)):
        trial = WalkTrial(WalkSpec(robot=robot, plan=TWO_STEPS, noise="none", foot="flat"), visuals=False)
        plant = trial.plant
        assert plant.robot.length_scale == pytest.approx(size, abs=1e-3)
        height = plant.com_height
        for share, fallen in ((0.96, None), (1.04, FallReason.HEIGHT)):
            plant.data.subtree_com[plant.places.root, 2] = height - share * DROP * plant.robot.length_scale
            assert trial.true_fall() is fallen, (robot, share)


def test_walks_the_plan(hooked: tuple[WalkResult, Notes, Work]) -> None:
    plain = hooked[0]
    assert plain.outcome == "completed" and not plain.fell and plain.fall is None
    assert plain.steps_done == plain.steps_planned == 2 and -1.0 < plain.J < 0.0
    assert plain.distance == pytest.approx(0.1, abs=0.02)
    assert abs(plain.yaw_error) < 0.05 and abs(plain.drift) < 0.03
    assert (
        plain.torque_ratio.mean is not None and plain.torque_ratio.mean < plain.peak_torque_ratio < 1.0 + 1e-9
    )
    assert plain.dcm_error.mean is not None and 0.0 < plain.dcm_error.mean < plain.dcm_error_max < 0.05
    assert plain.contact_area.mean is not None and 0.01 < plain.contact_area.mean < 0.04


# Pushes and falls


@pytest.mark.slow
def test_a_hard_push_is_a_fall() -> None:
    """Step 1 is of the left foot: a push to the left is one to the inside of the stance foot."""
    push = WalkPush(impulse=0.9, direction=math.pi / 2, step=1, phase=0.3)
    result = walk(WalkSpec(plan=TWO_STEPS, noise="none", pushes=(push,)))
    assert result.outcome == "fell" and result.fell and result.fall is not None
    assert result.steps_done < result.steps_planned or result.seconds < 4.0
    assert result.fall_reason == result.fall.reason in {"dcm", "tilt", "height"}
    assert result.fall.cause == "left" and result.fall.dcm_outward < -0.06
    assert result.fall.onset < result.fall.time == result.seconds
    assert result.fall.step == 1 and result.fall.phase == "single support"


def test_who_lies_has_fallen_whatever_the_controller_believes() -> None:
    trial = WalkTrial(WalkSpec(plan=TWO_STEPS, noise="none"), visuals=False)
    plant, look = trial.plant, trial.true_fall
    assert look() is None
    upright = plant.data.qpos[3:7].copy()
    plant.data.qpos[3:7] = [math.cos(0.33), math.sin(0.33), 0.0, 0.0]  # a roll of 0.66 rad
    assert look() is FallReason.TILT
    plant.data.qpos[3:7] = [math.cos(1.5), 0.0, 0.0, math.sin(1.5)]  # a turn is no tilt
    assert look() is None
    plant.data.qpos[3:7] = upright
    plant.data.subtree_com[plant.places.root, 2] -= 0.19  # soles stay where they were
    assert look() is FallReason.HEIGHT


class Poison(TrialHook):
    """Does what no hook should do."""

    def tick(self, tick: TrialTick) -> None:
        if tick.plant.time > 0.1:
            tick.plant.data.qvel[8] = np.nan


def test_a_diverged_simulation_is_neither_a_fall_nor_a_success() -> None:
    result = walk(SPEC, hooks=[Poison()])
    assert result.outcome == "diverged" and result.diverged
    assert not result.fell and result.fall_reason is None and result.steps_done == 0
    assert result.seconds < 0.2
    json.dumps(result.record())


# Specs


def test_specs_are_values() -> None:
    same = WalkSpec(
        foot="soft",
        stiffness=5,
        terrain="stones",
        amplitude=0.02,
        terrain_params={"width": 1, "density": 90},  # type: ignore[arg-type]
        changes={"dcm_p": 5, "walk.phases.lift_off": 0.2},  # type: ignore[arg-type]
        plan=WalkPlan(velocity=(0.1, 0, 0), steps=3),
        pushes=(WalkPush(impulse=0.1, time=1),),
        machine=Machine(friction=2),
    )
    other = WalkSpec(
        foot="soft",
        stiffness=5.0,
        terrain="stones",
        amplitude=0.02,
        terrain_params=(("density", 90.0), ("width", 1.0)),
        changes=(("walk.phases.lift_off", 0.2), ("gains.dcm_p", (5.0, 5.0))),
        plan=WalkPlan(velocity=(0.1, 0.0, 0.0), steps=3),
        pushes=(WalkPush(impulse=0.1, time=1.0),),
        machine=Machine(friction=2.0),
    )
    assert same == other and hash(same) == hash(other)
    assert json.dumps(same.to_json()) == json.dumps(other.to_json())
    assert WalkSpec.from_json(json.loads(json.dumps(same.to_json()))) == same
    assert same != WalkSpec() == WalkSpec.from_json(WalkSpec().to_json())


@pytest.mark.parametrize(
    "given",
    [
        {"terrain": "stones"},
        {"terrain": "steps", "amplitude": 0.01},
        {"mode": "torque"},
        {"robot": "g1"},
        {"foot": "variable"},
        {"foot": "soft", "stiffness": 5.0},
    ],
)
def test_what_was_not_given_is_decided_anew_when_a_spec_is_replaced(given: dict[str, Any]) -> None:
    """Ground, control mode and policy follow from what is given, there and back, in equality and in writing."""
    plain, fresh = WalkSpec(plan=TWO_STEPS), WalkSpec(plan=TWO_STEPS, **given)
    there = replace(plain, **given)
    assert there == fresh and hash(there) == hash(fresh) and there.to_json() == fresh.to_json()
    assert (there.chosen, there.ground(), there.scheduling) == (
        fresh.chosen,
        fresh.ground(),
        fresh.scheduling,
    )
    back = replace(fresh, **{name: getattr(plain, name) for name in given})
    assert back == plain != fresh and WalkSpec.from_json(fresh.to_json()) == fresh
    written = fresh.to_json()
    assert written["mode"] == fresh.chosen and written["amplitude"] == fresh.ground().amplitude


class Closes(TrialHook):
    """Raises at a tick, or writes down with what it is ended."""

    def __init__(self, raises_at: int | None = None) -> None:
        self.left, self.ended = raises_at, list[Any]()

    def tick(self, tick: TrialTick) -> None:
        if self.left is not None:
            self.left -= 1
            if self.left < 0:
                raise RuntimeError("broken")

    def end(self, result: Any) -> None:
        self.ended.append(result)


def test_a_trial_that_raises_ends_its_hooks_and_none_runs_twice() -> None:
    trial, seen = WalkTrial(SPEC, visuals=False), Closes()
    with pytest.raises(RuntimeError, match="broken"):
        trial.run([seen, Closes(raises_at=3)])
    assert seen.ended == [None]
    for again in (trial.run, trial.start):
        with pytest.raises(InputError, match="runs once"):
            again()
    assert seen.ended == [None]


def test_a_stage_that_is_not_over_in_its_time_is_said_and_a_stop_is_no_error() -> None:
    trial = WalkTrial(SPEC, visuals=False)
    with pytest.raises(StageError, match="'waiting' was not over"), trial.running():
        trial.stage = "waiting"
        trial.until(lambda: False, 0.1)
    trial = WalkTrial(SPEC, visuals=False)
    with trial.running():
        trial.advance(0.02)
        trial.stop()
        trial.advance(1.0)
        raise AssertionError("the block ends")
    assert trial.stopped and trial.plant.time < 0.1


def test_the_limit_of_threads_is_taken_away_by_the_last_of_overlapping_trials() -> None:
    def threads() -> set[int]:
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    begun, over, seen = threading.Event(), threading.Event(), list[set[int]]()

    def first() -> None:
        with one_thread():
            begun.set()
            over.wait(10.0)

    with threadpool_limits(2, user_api="blas"):
        before = threads()
        other = threading.Thread(target=first)
        other.start()
        begun.wait(10.0)
        with one_thread():
            over.set()
            other.join()
            seen.append(threads())
        seen.append(threads())
    assert seen == [{1}, before]


def test_changes_reach_the_controller() -> None:
    changes = {"dcm_p": 3, "walk.adjustment": None, "observer.min_load": 25, "physics.impratio": 5}
    trial = WalkTrial(
        WalkSpec(
            plan=TWO_STEPS, foot="soft", stiffness=7, foot_changes={"contact.friction": 0.5}, changes=changes
        ),  # type: ignore[arg-type]
        visuals=False,
    )
    assert trial.control.stabilizer.gains.dcm_p == (3.0, 3.0)
    assert trial.control.settings.walk.adjustment is None
    assert trial.control.drives.observer.settings.min_load == 25.0
    assert trial.plant.model.opt.impratio == 5.0
    assert trial.plant.foot.contact.friction == 0.5
    assert trial.plant.foot.stiffness == 7.0  # type: ignore[attr-defined]


def test_stairs_of_the_ground_are_climbed() -> None:
    params = {"riser": 0.1, "direction": "up", "tread": 0.3, "length": 1.2}
    spec = WalkSpec(
        terrain="steps",
        amplitude=0.2,
        terrain_params=params,
        plan=WalkPlan(stairs="together"),  # type: ignore[arg-type]
    )
    ground, plan = spec.ground(), spec.prepare().plan
    assert plan.final[0].z == pytest.approx(0.2) and plan.final[1].z == pytest.approx(0.2)
    for step in plan.steps:
        assert step.z == pytest.approx(float(ground.height(step.x, step.y)), abs=1e-9)
        for dx in (-0.08, 0.08):  # the whole sole stands on one stair
            assert float(ground.height(step.x + dx, step.y)) == pytest.approx(step.z, abs=1e-9)


@pytest.mark.parametrize(
    ("velocity", "planned"),
    [
        ((0.21, 0.14, 0.0), True),
        ((0.31, 0.0, 0.0), False),
        ((0.25, 0.15, 0.0), False),  # each part is within its limit; together the robot falls
    ],
)
def test_a_velocity_that_planned_steps_do_not_give_is_refused_with_the_way_to_free_ones(
    velocity: tuple[float, float, float], planned: bool
) -> None:
    plan = WalkPlan(velocity=velocity, steps=3)
    if planned:
        assert not WalkSpec(mode="position", plan=plan).free
    else:
        with pytest.raises(TooFastError, match=r"got \(.*free steps walk faster: mode='torque'"):
            WalkSpec(mode="position", plan=plan)
    assert WalkSpec(mode="torque", plan=plan).free


@pytest.mark.parametrize(
    "wrong", [{"gait": {"swing_height": 0.5}}, {"changes": {"com_height": 0.3}}], ids=["swing", "com"]
)
def test_what_is_wrong_with_a_slow_walk_is_no_matter_of_its_speed(wrong: dict[str, Any]) -> None:
    """The walk with another velocity is refused for the same reason: free steps are no way out."""
    for velocity in (0.1, 0.2):
        walk = {"mode": "position", "plan": {"velocity": [velocity, 0.0, 0.0]}}
        with pytest.raises(InputError) as refused:
            WalkSpec.from_json({**walk, **wrong})
        assert not isinstance(refused.value, TooFastError)
