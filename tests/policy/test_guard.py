"""Guard of a policy: when it is relieved, and what goes on."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_policies import DT, G1, REST, Known, bobbing, control, ticks
from properties import by_default

import wbc
from wbc.app import Log, Recorder
from wbc.base.errors import InputError
from wbc.policy import PolicyControl, PolicyDescription, PolicyGuard, Term
from wbc.walking import WalkingControl, WalkingControlSettings


def guarded(**options: Any) -> tuple[wbc.Plant, PolicyGuard, Known]:
    """Return a guard of a policy that stands."""
    n = len(G1.joint_names)
    servos = G1.robot().servos
    network = Known(3, n)
    description = PolicyDescription(
        joints=tuple(G1.joint_names),
        default=tuple(REST.values()),
        kp=tuple(0.3 * servos.kp),
        kd=tuple(0.3 * servos.kd),
        observation=(Term("gravity"),),
    )
    plant, policy = control(network, description, **options)
    return plant, PolicyGuard(policy), network


def run_guard(plant: wbc.Plant, guard: PolicyGuard, seconds: float) -> None:
    end = plant.time + seconds
    while plant.time < end - 1e-9:
        plant.step(guard.command(plant.measure()))


def break_by_nan(network: Known) -> None:
    network.action[:] = math.nan


def break_by_error(network: Known) -> None:
    network.action = np.zeros(1, np.float32)[:0].reshape(0, 3)  # of no shape that can be taken


def break_by_torques(network: Known) -> None:
    network.action[:] = 20.0 * np.where(np.arange(network.outputs) % 2, 1.0, -1.0)


BREAKS = [(break_by_nan, "nan"), (break_by_error, ""), (break_by_torques, "torque")]


@pytest.mark.parametrize(("breaks", "named"), BREAKS)
def test_a_policy_that_fails_is_relieved_and_the_robot_stands(breaks: Any, named: str) -> None:
    plant, guard, network = guarded()
    run_guard(plant, guard, 0.1)
    assert not guard.relieved and guard.status() == "ok"
    breaks(network)
    run_guard(plant, guard, 0.02)
    assert guard.relieved and named in guard.relieved and guard.drives is guard.walking.drives
    run_guard(plant, guard, 0.3)
    assert guard.fallen is None


@pytest.mark.parametrize("breaks", by_default((breaks for breaks, _ in BREAKS), break_by_torques))
def test_a_robot_whose_policy_fails_stands_and_then_walks_where_it_is_told_to(breaks: Any) -> None:
    plant, guard, network = guarded()
    run_guard(plant, guard, 0.3)
    breaks(network)
    run_guard(plant, guard, 1.22)
    assert guard.fallen is None and np.linalg.norm(plant.truth().com_velocity) < 0.05
    with_walk = guard.progress.steps_done
    guard.velocity = (0.2, 0.0, 0.0)
    run_guard(plant, guard, 1.5)
    assert guard.progress.steps_done > with_walk and guard.fallen is None
    with pytest.raises(InputError, match="stand"):
        guard.hand_back()


def test_a_policy_that_takes_too_long_is_relieved() -> None:
    plant, guard, network = guarded(longest=1e-9)
    run_guard(plant, guard, 2 * DT)
    assert "longer" in guard.relieved


def test_the_estimate_goes_on_over_a_change_and_a_policy_takes_the_robot_back(tmp_path: Path) -> None:
    plant, guard, network = guarded()
    run_guard(plant, guard, 0.5)
    before = np.array(guard.policy.drives.observer.robot.q)
    guard.take_over()
    guard.hand_back()  # it takes the order back
    run_guard(plant, guard, DT)
    assert not guard.relieved
    guard.velocity = (0.4, 0.0, 0.0)
    for load in (0.0,) * len(ticks(0.12)) + (200.0,) * len(ticks(1.0)):
        guard.policy.contacts.update((200.0, load))
    guard.take_over()
    with Recorder(tmp_path / "guard.arrow") as recorder:
        for _ in range(10):
            m = plant.measure()
            command = guard.command(m)
            recorder(plant, guard, m, command)
            plant.step(command)
    assert len(Log.open(tmp_path / "guard.arrow").time) == 10
    assert guard.relieved == "asked for"
    assert np.abs(guard.walking.drives.observer.robot.q - before).max() < 5e-3
    run_guard(plant, guard, 1.0)
    steps = guard.steps_done
    guard.hand_back()
    seen = len(network.seen)
    run_guard(plant, guard, 0.2)
    assert not guard.relieved and len(network.seen) - seen == 10 and guard.fallen is None
    assert guard.steps_done == steps >= 1 and guard.velocity is None, (
        "the robot stands as the walk was told to"
    )
    guard.reset()
    assert guard.steps_done == 0


def test_a_walk_that_takes_over_knows_the_loads_of_feet_without_sensors() -> None:
    """A robot that is pushed aside stands on one foot more than on the other, before and after."""
    plant, guard, _ = guarded()
    plant.push("torso", np.array([0.0, 40.0, 0.0]), 2.0)

    def loads() -> np.ndarray:
        """Normal forces after another tick, N."""
        plant.step(guard.command(dataclasses.replace(plant.measure(), sole_wrench=None)))
        assert guard.drives.sensing.wrenches is not None
        return guard.drives.sensing.wrenches.wrench[:, 2].copy()

    for _ in ticks(0.08):
        before = loads()
    assert before[0] > 1.3 * before[1]
    guard.take_over()
    after = loads()
    assert guard.relieved and after == pytest.approx(before, abs=0.05 * before.sum())


def test_a_guard_that_begins_anew_lets_its_policy_begin() -> None:
    """As a run of a machine asks of it, which warms it up and resets it where the robot stands."""
    plant, guard, network = guarded()
    assert guard.acting is guard.policy and guard.restarts
    run_guard(plant, guard, 0.1)
    break_by_nan(network)
    run_guard(plant, guard, 0.1)
    assert guard.acting is guard.walking and guard.drives is guard.walking.drives
    network.action[:] = 0.0
    plant.reset()
    guard.reset()
    assert guard.acting is guard.policy and guard.drives is guard.policy.drives
    seen = len(network.seen)
    run_guard(plant, guard, 0.1)
    assert not guard.relieved and len(network.seen) == seen + 5


def test_joints_that_somebody_else_moves_are_no_reason_to_relieve_a_policy() -> None:
    """The other one holds an elbow far from where the policy wants it."""
    plant, guard, network = guarded()
    elbow = G1.joint_names.index("left_elbow_joint")
    network.action[elbow] = 50.0
    released = guard.release([G1.joint_names[elbow]])
    assert released is guard.policy.drives.released is not None
    assert guard.walking.drives.released is not None
    run_guard(plant, guard, 0.1)
    assert not guard.relieved
    assert guard.release([]) is guard.walking.drives.released is None
    run_guard(plant, guard, 0.05)
    assert "left_elbow_joint" in guard.relieved


def test_joints_that_policy_or_walk_refuses_are_released_by_neither_and_what_was_told_stays() -> None:
    _, guard, _ = guarded()
    right, left = (f"{side}_elbow_joint" for side in ("right", "left"))
    released, others = guard.release([right]), guard.walking.drives.released
    arm = guard.walking.arms["left_hand"]
    arm.reach(guard.drives.observer.robot.placement(arm.name))
    whole = [G1.joint_names[joint] for joint in arm.joints]
    for names, error in (
        (whole, "at work"),
        ([right, "left_elbow"], "left_elbow"),
        ([left, left], "distinct"),
        (["left_knee_joint"], "legs"),
    ):
        with pytest.raises(InputError, match=error):
            guard.release(names)
        assert guard.drives.released is released and guard.walking.drives.released is others

    shared = PolicyGuard(bobbing(arms=[left])[1])
    shared.walking.release([right])
    mine = shared.walking.drives.released
    for joint in (left, right):
        with pytest.raises(InputError, match="shared"):
            shared.release([joint])
        assert shared.walking.drives.released is mine


@pytest.mark.slow
def test_a_robot_of_a_file_is_taken_over_and_walks_on() -> None:
    description = wbc.RobotDescription.from_mjcf(Path(__file__).parents[2] / "examples" / "biped.xml")
    robot, plant = (
        description.robot(),
        wbc.Plant(description, control_period=DT, noise="realistic", visuals=False),
    )
    about = PolicyDescription(
        joints=tuple(robot.joint_names),
        default=tuple(robot.half_sitting[7:]),
        kp=tuple(robot.servos.kp),
        kd=tuple(robot.servos.kd),
        observation=(Term("gravity"),),
    )
    guard = PolicyGuard(PolicyControl(robot, Known(3, robot.na), DT, description=about))
    run_guard(plant, guard, 0.3)
    guard.take_over()
    run_guard(plant, guard, 0.5)
    guard.velocity = (0.15, 0.0, 0.0)
    run_guard(plant, guard, 2.5)
    assert guard.fallen is None and guard.steps_done >= 2 and plant.truth().com[0] > 0.1


@pytest.mark.parametrize(
    ("period", "own", "options"),
    [
        (DT, False, {}),
        (0.001, True, {}),
        (DT, False, {"mode": "position"}),
    ],
)
def test_walks_that_cannot_take_over_are_refused(period: float, own: bool, options: dict[str, Any]) -> None:
    _, policy = bobbing()
    observer = policy.drives.observer if own else None
    settings = WalkingControlSettings(**{"mode": "torque", **options})
    walking = WalkingControl(policy.controller.robot, None, period, settings, observer=observer)
    with pytest.raises(InputError):
        PolicyGuard(policy, walking)
    PolicyGuard(policy)
    with pytest.raises(InputError, match="has a guard already"):
        PolicyGuard(policy)
    with pytest.raises(InputError):
        bobbing(longest=0.0)


def test_doubts_failures_and_time_go_on_over_a_change() -> None:
    """A force sensor has the other sign from the start, and the network fails once."""
    plant, guard, network = guarded()
    monitor, time, wrong = guard.drives.watch(), 0.0, 0

    def tick() -> None:
        m = plant.measure()
        plant.step(guard.command(dataclasses.replace(m, sole_wrench=-m.wrenches)))

    for _ in ticks(0.3):
        tick()
        assert guard.drives.time == pytest.approx(time := time + DT)
    assert (doubts := monitor.doubts)
    break_by_nan(network)
    while not guard.relieved:
        tick()
        wrong += 1
    assert guard.drives.sensing.monitor is monitor and monitor.doubts == doubts
    assert doubts[0] in guard.status()
    assert guard.drives.failures == 1 and guard.drives.time == pytest.approx(time + wrong * DT)
    tick()
    assert guard.drives.failures == 1 and not guard.drives.failing
    assert guard.policy.drives.failures == guard.walking.drives.failures


def test_a_walk_that_takes_over_finds_its_qp_made() -> None:
    """QP and solver are made before, and again once the policy has the robot back."""
    plant, guard, _ = guarded()
    qp = guard.walking.controller
    for _ in range(2):
        made = qp.problem
        assert qp.solution is None
        guard.take_over()
        run_guard(plant, guard, 2 * DT)
        assert guard.relieved and qp.solution is not None and qp.problem is made
        run_guard(plant, guard, 0.4)
        guard.hand_back()
        run_guard(plant, guard, 2 * DT)


def test_a_robot_that_is_stopped_stays_so_whoever_takes_over() -> None:
    plant, guard, _ = guarded()
    nothing = dataclasses.replace(plant.measure(), joint_position=np.full(len(G1.joint_names), np.nan))
    for _ in ticks(0.2):
        guard.command(nothing)
    assert guard.drives.stopped
    guard.take_over()
    run_guard(plant, guard, 0.05)
    assert guard.fallen is not None and guard.walking.drives.stopped
    plant.reset()
    guard.reset()
    run_guard(plant, guard, 0.05)
    assert guard.fallen is None and guard.status() == "ok"


def test_a_walk_with_a_robot_of_its_own_takes_over_where_the_estimate_is() -> None:
    plant, policy = bobbing()
    settings = WalkingControlSettings(mode="hybrid")
    own = policy.controller.robot.clone()
    guard = PolicyGuard(policy, WalkingControl(own, None, DT, settings, observer=policy.drives.observer))
    plant.push("torso", np.array([60.0, 0.0, 0.0]), 0.1)
    run_guard(plant, guard, 0.2)
    guard.take_over()
    command = guard.command(plant.measure())
    estimate = policy.drives.observer.robot
    assert np.abs(own.q - estimate.q).max() < 1e-12
    assert np.abs(command.joint_position - estimate.q[7:]).max() < 0.01


@pytest.mark.parametrize("breaks", [None, break_by_nan, break_by_torques])
def test_a_tick_has_one_command_whoever_takes_over(breaks: Any) -> None:
    """The estimate over delays and that of wrenches count commands by their time."""
    plant, guard, network = guarded()
    sensing, sent = guard.drives.sensing, []
    sensing.sent = lambda command, acceleration: sent.append(command)  # type: ignore[method-assign]
    for tick in ticks(0.12):
        if tick == len(ticks(0.06)):
            breaks(network) if breaks else guard.take_over()
        command = guard.command(plant.measure())
        assert len(sent) == tick + 1 and sent[-1] is command
        plant.step(command)
    assert guard.relieved
