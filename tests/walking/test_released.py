"""Joints that somebody else moves: their motion is known, nothing of them is commanded, and bad orders are refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from properties import each_once

import wbc
from wbc.base.errors import InputError, UnknownNameError
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings

G1 = wbc.load_robot("g1")
ARM = [
    name for name in G1.joint_names if name.startswith("left_") and ("shoulder" in name or "elbow" in name)
]
DT = 0.002


def walking() -> WalkingControl:
    robot = G1.robot()
    return WalkingControl(robot, FootstepPlan.standing(robot), DT)


def reaching() -> WalkingControl:
    walk = walking()
    walk.arms["left_hand"].reach([0.1, 0.0, 0.1], "pelvis")
    return walk


def released_reach() -> None:
    walk = walking()
    robot = walk.controller.robot
    arm = walk.arms["left_hand"].joints
    walk.release([robot.joint_names[joint] for joint in arm])
    walk.arms["left_hand"].reach([0.1, 0.0, 0.1], "pelvis")


def whole_arm(walk: WalkingControl) -> list[str]:
    return [walk.controller.robot.joint_names[joint] for joint in walk.arms["left_hand"].joints]


REFUSED: list[tuple[Callable[[], object], str]] = [
    (lambda: walking().release(["left_elbow"]), "left_elbow"),
    (lambda: walking().release(["left_elbow_joint", "right_knee_joint"]), "right_knee_joint"),
    (lambda: walking().release(["left_elbow_joint", "left_elbow_joint"]), "distinct"),
    (lambda: walking().release([3]), "joints to release"),  # type: ignore[list-item]
    (lambda: (walk := reaching()).release(whole_arm(walk)), "left_hand"),
    (released_reach, "somebody else"),
    (lambda: walking().release(ARM).tell([0.0]), "position"),  # type: ignore[union-attr]
    (lambda: walking().release(ARM).tell(np.full(4, np.nan)), "position"),  # type: ignore[union-attr]
]


@pytest.mark.parametrize(("call", "named"), REFUSED)
def test_orders_that_cannot_be_had_are_refused_by_name(call: Callable[[], object], named: str) -> None:
    with pytest.raises((InputError, UnknownNameError), match=named):
        call()


def test_hands_that_keep_a_joint_may_go_on() -> None:
    walk = reaching()
    released = walk.release(whole_arm(walk)[:-1])
    assert released is not None and walk.release([]) is None and walk.drives.released is None


@pytest.mark.parametrize("mode", ["torque", "hybrid", "position"])
def test_nothing_of_released_joints_is_commanded_and_they_come_back(mode: str) -> None:
    plant = wbc.Plant(G1, control_period=DT, visuals=False)
    robot = G1.robot()
    walk = WalkingControl(
        robot,
        FootstepPlan.standing(robot),
        DT,
        WalkingControlSettings(mode=mode),  # type: ignore[arg-type]
    )
    released = walk.release(ARM)
    assert released is not None
    index = released.index
    # It takes more than the limits of their torques, which are not ours to keep.
    released.tell(
        robot.q[7 + index], 0.0, 10.0 * robot.torque_limit[index] / np.diag(robot.mass_matrix)[6 + index]
    )
    for _ in range(3):
        command = walk.command(plant.measure())
        assert command.released is not None and set(np.flatnonzero(command.released)) == set(index)
        assert not command.joint_torque[index].any()
        assert command.kp is None or not (command.kp[index].any() or command.kd[index].any())  # type: ignore[index]
        assert np.abs(command.joint_torque[robot.leg_joints]).max() > 1.0
    assert not walk.drives.gate.faults and walk.drives.status() == "ok"
    walk.release([])
    command = walk.command(plant.measure())
    assert command.released is None and walk.drives.status() == "ok"


@pytest.mark.parametrize(
    ("kind", "door"),
    each_once(
        (wbc.TorqueControl, wbc.HybridControl, wbc.PositionControl),
        ("control", "controller", "controller before the control"),
    ),
)
def test_it_is_all_one_where_joints_are_released_and_taken_back(
    door: str, kind: type[wbc.TorqueControl | wbc.HybridControl | wbc.PositionControl]
) -> None:
    """Somebody else turns them beyond their ranges, which is no failure; taken back, it is one."""
    plant = wbc.Plant(G1, control_period=DT, visuals=False)
    controller = wbc.balance_controller(G1.robot(), DT)
    released = controller.release(ARM) if "before" in door else None
    control = kind(controller)
    if released is None:
        released = (control if door == "control" else controller).release(ARM)
    assert released is not None and control.released is released is controller.released
    assert control.release(ARM) is released, "the same order once more changes nothing"
    for tick in range(100):
        measured = plant.measure()
        position = measured.joint_position.copy()
        position[released.index] = 9.0 if tick > 2 else position[released.index]
        command = control.command(replace(measured, joint_position=position))
        assert command.released is released.mask and not command.joint_torque[released.index].any()
        plant.step(command)
    assert control.failures == 0
    controller.remove(released)
    for _ in range(100):
        measured = plant.measure()
        position = measured.joint_position.copy()
        position[released.index] = 9.0
        command = control.command(replace(measured, joint_position=position))
        assert command.released is None
        plant.step(command)
    assert control.failures > 0 and control.released is None is controller.released


def test_the_qp_moves_them_as_they_are_known_to_move_whatever_it_costs() -> None:
    """Told accelerations are met, beyond torque limits too; the CoM and the soles stay as they were asked to."""
    robot = G1.robot()
    controller = wbc.balance_controller(robot, DT)
    released = controller.release(ARM)
    assert released is not None
    push = np.array([60.0, -40.0, 20.0, 80.0])
    released.tell(robot.q[7 + released.index], 0.0, push)
    released.update(robot.q, robot.v, DT)
    solution = controller.solve()
    assert solution.ok
    assert solution.accelerations[6 + released.index] == pytest.approx(push, abs=1e-2)
    com = controller.task("com")
    assert np.abs(solution.residuals[com.name]).max() < 0.05
    assert np.abs(robot.com_jacobian @ solution.accelerations).max() < 0.05  # the arm is made up for


def test_measured_accelerations_are_low_passed_differences() -> None:
    robot = G1.robot()
    released = wbc.balance_controller(robot, DT).release(ARM)
    assert released is not None
    v = np.array(robot.v)
    for tick in range(50):
        v[6 + released.index] = 5.0 * DT * tick
        released.update(robot.q, v, DT)
    assert released.feedforward_acceleration == pytest.approx(np.full(4, 5.0), rel=1e-3)


def test_measured_accelerations_are_over_the_time_that_has_passed_where_measurements_are_lost() -> None:
    measured = wbc.Plant(G1, control_period=DT, visuals=False).measure()
    control = wbc.TorqueControl(wbc.balance_controller(G1.robot(), DT))
    released = control.release(ARM)
    assert released is not None
    for passed in (1, 1, 2, 4, 1, 2, 1, 3, 1, 6) * 4:  # periods
        measured = replace(measured, time=measured.time + passed * DT)
        velocity = measured.joint_velocity.copy()
        velocity[released.index] += 5.0 * passed * DT
        measured = replace(measured, joint_velocity=velocity)
        control.estimate(measured)
    assert released._measured == pytest.approx(np.full(4, 5.0), rel=1e-3)


def test_an_arm_that_is_hit_is_known_by_its_torques_and_not_by_its_reaction() -> None:
    """The rest of its acceleration is somebody else's; at the end of a joint what is measured counts."""
    robot = G1.robot()
    controller = wbc.balance_controller(robot, DT)
    released = controller.release(ARM)
    assert released is not None
    torque, solved = np.array(robot.bias[6:]), np.zeros(robot.nv)
    v = np.array(robot.v)
    for _ in range(100):  # 100 rad/s² that no torque makes
        v[6 + released.index] += 100.0 * DT
        released.update(robot.q, v, DT, torque, solved)
    assert np.abs(released.feedforward_acceleration).max() < 1.0
    torque[released.index] += 2.0
    released.update(robot.q, v, DT, torque, solved)
    rows = robot.mass_matrix[released.columns][:, released.columns]
    assert rows @ released.feedforward_acceleration == pytest.approx(np.full(4, 2.0), rel=1e-6)
    q = np.array(robot.q)
    q[7 + released.index[0]] = robot.position_upper[released.index[0]]
    released.update(q, v, DT, torque, solved)
    assert released.feedforward_acceleration[0] > 30.0
    assert rows[1:, 1:] @ released.feedforward_acceleration[1:] == pytest.approx(
        np.full(3, 2.0) - rows[1:, 0] * released.feedforward_acceleration[0], rel=1e-6
    )


def test_an_encoder_of_theirs_beyond_its_range_is_named_and_stops_nothing() -> None:
    plant, robot = wbc.Plant(G1, control_period=DT, visuals=False), G1.robot()
    walk = WalkingControl(robot, None, DT, WalkingControlSettings(mode="torque"))
    released = walk.release(ARM)
    assert released is not None
    joint = int(released.index[0])
    for tick in range(60):
        measurement = plant.measure()
        if tick > 10:
            position = np.array(measurement.joint_position)
            position[joint] = robot.position_upper[joint] + (1.0 if tick < 35 else np.nan)
            measurement = replace(measurement, joint_position=position)
        command = walk.command(measurement)
        command.joint_torque[released.index] = 0.0
        plant.step(replace(command, released=None))
        if tick > 12:
            assert f"encoder of {ARM[0]}" in walk.drives.status()
    assert walk.drives.failures == 0
    walk.release([])  # from now on it is the walk's own, and a fault again
    for _ in range(40):
        walk.command(replace(plant.measure(), joint_position=position))
        plant.step(command)
    assert walk.drives.failures > 0


@pytest.mark.slow
@pytest.mark.parametrize("told", [True, False])
def test_the_centre_of_mass_stays_though_an_arm_swings(told: bool) -> None:
    """An arm that somebody else swings at 1.5 Hz by ± 0.6 rad moves the CoM less than one that the QP does not know."""
    moved = {}
    for known in (True, False):
        plant, robot = wbc.Plant(G1, control_period=DT, visuals=False), G1.robot()
        walk = WalkingControl(robot, None, DT, WalkingControlSettings(mode="torque"))
        released = walk.release(ARM) if known else None
        index = np.array([robot.joint_index(name) for name in ARM])
        start, errors = plant.measure().joint_position[index], []
        for tick in range(1000):
            measurement, angle = plant.measure(), 2.0 * np.pi * 1.5 * DT * tick
            ways = np.array([0.6, 0.0, 0.0, 0.6]) * min(DT * tick, 1.0)
            target, speed = start + ways * np.sin(angle), ways * 3.0 * np.pi * np.cos(angle)
            if released is not None and told:
                released.tell(target, speed, -((3.0 * np.pi) ** 2) * (target - start))
            command = walk.command(measurement)
            torque = np.array(command.joint_torque)
            torque[index] = 100.0 * (target - measurement.joint_position[index])
            torque[index] += 4.0 * (speed - measurement.joint_velocity[index])
            plant.step(replace(command, joint_torque=torque, released=None))
            if tick > 500:
                errors.append(plant.truth().com[:2])
        moved[known] = float(np.ptp(np.array(errors), axis=0).max())
    assert moved[True] < 0.6 * moved[False]
