"""Inverse kinematics: the state that it starts from, targets that move, and ticks without a solution."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default, each_once

import wbc
from wbc.base.errors import InputError, NoSolutionError
from wbc.base.numbers import Array
from wbc.core.qp.solving.solver import Status
from wbc.tasks import LowAccelerationTask, MomentumTask

DT = 0.01
NAN, INF = float("nan"), float("inf")


class Broken(wbc.Task):
    """A task on the first joint, whose numbers can be spoilt."""

    def __init__(self) -> None:
        super().__init__("mine", 1)
        self.numbers = {"jacobian": 1.0, "error": 0.5}

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        jacobian[0, 0], error[:], drift[:] = self.numbers["jacobian"], self.numbers["error"], 0.0


def arm(*items: wbc.Task | wbc.Limit) -> wbc.InverseKinematics:
    ik = wbc.InverseKinematics(wbc.load_robot("panda").robot(), DT)
    if items:
        ik.add(*items)
    return ik


# ---- state --------------------------------------------------------------------------------------------------------


def reaching(acceleration: float = 5.0) -> tuple[wbc.InverseKinematics, wbc.Task]:
    ik = arm(wbc.JointLimits(acceleration=acceleration), wbc.PostureTask(weight=1e-4))
    hand = ik.add(wbc.PoseTask("panda_hand"))
    hand.target = pin.SE3(hand.target.rotation, hand.target.translation + [0.0, 0.3, 0.0])
    return ik, hand


def test_who_moves_the_robot_gets_the_same_motion() -> None:
    """Solve and update, with the velocity, are steps."""
    (stepped, _), (ik, _) = reaching(), reaching()
    for _ in range(60):
        v, asked = stepped.step(), ik.solve()
        ik.update(pin.integrate(ik.robot.model, ik.robot.q, DT * asked), asked)
        assert asked == pytest.approx(v, abs=1e-12) and ik.robot.v == pytest.approx(v, abs=1e-12)
    assert abs(stepped.robot.v).max() > 0.5


def test_a_robot_that_is_put_somewhere_is_at_rest_there() -> None:
    ik, hand = reaching()
    for _ in range(20):
        ik.step()
    assert abs(ik.robot.v).max() > 0.5
    ik.update(ik.robot.half_sitting)
    hand.target = pin.SE3(ik.robot.placement("panda_hand"))
    assert (ik.robot.v == 0.0).all() and abs(ik.solve()).max() < 1e-9
    ik.update(ik.robot.half_sitting, np.full(ik.robot.nv, 0.5))
    assert abs(ik.solve() - 0.5) == pytest.approx(
        np.full(ik.robot.nv, 0.05), abs=1e-9
    )  # by 5 rad/s², all of them
    for wrong in (np.zeros(3), np.full(ik.robot.nv, NAN)):
        with pytest.raises(InputError, match="velocity"):
            ik.update(ik.robot.half_sitting, wrong)


@pytest.mark.parametrize("hard", by_default([False, True], True))
def test_a_search_knows_nothing_of_velocities(hard: bool) -> None:
    """Neither of those that the robot has nor of those that tasks ask for; afterwards the robot has them again."""
    found = []
    for moving, extra in ((False, False), (True, False), (True, True)):
        ik, _ = reaching()
        if moving:
            for _ in range(5):
                ik.step()
        if extra:
            ik.add(MomentumTask(weight=10.0, hard=hard), LowAccelerationTask(weight=10.0))
        ik.update(ik.robot.half_sitting, np.full(ik.robot.nv, 2.0 * moving))
        before = ik.robot.q.copy(), ik.robot.v.copy()
        result = ik.reach(1e-3)
        assert result.reached and "momentum" not in result.errors
        assert (ik.robot.q == before[0]).all() and (ik.robot.v == before[1]).all()
        found.append(result.configuration)
        ik.solve()
        assert ik.solution is not None and (not extra or "momentum" in ik.solution.residuals)
    assert found[1] == pytest.approx(found[0], abs=1e-9) and found[2] == pytest.approx(found[0], abs=1e-9)


# ---- targets that move --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["lag", "velocity", "whole step"])
def test_a_hand_on_a_circle_lags_as_a_first_order_system_does(way: str) -> None:
    """By r ω / √(ω² + λ²); not with the velocity of the target, nor at a rate of one per step."""
    radius, turns, rate = 0.1, np.pi, 1.0 / DT if way == "whole step" else 10.0
    ik = arm(wbc.JointLimits(), wbc.PostureTask(weight=1e-6))
    hand = ik.add(wbc.PositionTask("panda_hand", rate=rate))
    middle = hand.target - [0.0, radius, 0.0]

    def circle(time: float) -> tuple[Array, Array]:
        along = np.array([0.0, np.cos(turns * time), np.sin(turns * time)])
        return middle + radius * along, radius * turns * np.array([0.0, -along[2], along[1]])

    for step in range(300):
        hand.target, velocity = circle((step + (way == "whole step")) * DT)
        if way == "velocity":
            hand.feedforward_velocity = velocity
        ik.step()
        error = np.linalg.norm(ik.robot.placement("panda_hand").translation - circle((step + 1) * DT)[0])
        if step < 100:
            continue
        if way == "lag":
            assert error == pytest.approx(radius * turns / np.hypot(turns, rate), rel=0.03)
        else:  # what is left are terms of the second order in the step
            assert error < (1e-3 if way == "velocity" else 1e-4)


# ---- no solution --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("limits", "level", "what", "value"),
    each_once(["none", "joints", "joints and posture"], [0, 1, 2], ["jacobian", "error"], [NAN, INF, -INF]),
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_numbers_that_are_none_move_nothing_and_are_named(
    limits: str, level: int, what: str, value: float
) -> None:
    ik = arm(*([] if limits == "none" else [wbc.JointLimits()]))
    if limits == "joints and posture":
        ik.add(wbc.PostureTask())
    task = Broken()
    ik.add(task, level=level)
    ik.step()
    task.numbers[what] = value
    q = ik.robot.q.copy()
    for _ in range(2):
        with pytest.raises(NoSolutionError, match="'mine'"):
            ik.step()
        assert (ik.robot.q == q).all()
    assert (ik.solve() == 0.0).all() and ik.solution is not None
    assert ik.solution.status is Status.REFUSED
    assert all(np.isnan(size) for size in ik.diagnose().values())
    assert (ik.step(hold=True) == 0.0).all() and (ik.robot.q == q).all()
    found = ik.reach(starts=2)
    assert not found.reached and found.held_by == ("task 'mine'",)
    task.numbers = {"jacobian": 1.0, "error": 0.5}
    free = (
        level == 0 or limits != "joints and posture"
    )  # a posture of all joints leaves nothing to later levels
    assert bool(abs(ik.step()[0]) > 0.5) is free and ik.solution.ok


def test_a_search_from_a_configuration_that_is_none_reaches_nothing() -> None:
    ik = arm(wbc.JointLimits())
    ik.add(wbc.PoseTask("panda_hand"))
    ik.robot.q[0] = NAN
    found = ik.reach()
    assert not found.reached and set(found.missed) == {"panda_hand pose"}
