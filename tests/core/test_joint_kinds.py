"""Joints of all kinds: those that slide, a single one, and those without limits."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

import wbc
from wbc.base.errors import InputError
from wbc.core.limits.joint import JointLimits
from wbc.robots import load
from wbc.tasks import PostureTask

# ---- joints that slide --------------------------------------------------------------------------------------------

FINGER = "panda_finger_joint1"


def gripping(*joints: str, **options: float) -> tuple[wbc.Controller, PostureTask]:
    controller = wbc.Controller(load("panda").robot(), 0.005)
    return controller, controller.add(PostureTask(joints=list(joints) or None, **options))


def test_an_angle_is_a_tenth_of_a_metre_per_rad_for_a_joint_that_slides() -> None:
    robot = load("panda").robot()
    slides = np.array([name == FINGER for name in robot.joint_names])
    np.testing.assert_array_equal(robot.slides, slides)
    np.testing.assert_allclose(robot.per_rad, np.where(slides, 0.1, 1.0))


@pytest.mark.parametrize(
    ("off", "speed", "reached"),
    [(0.038, 0.0, False), (0.006, 0.0, False), (0.003, 0.0, True), (0.0, 0.03, False), (0.0, 0.01, True)],
)
@pytest.mark.parametrize("joints", [(), (FINGER,), ("panda_joint2", FINGER)])
def test_a_finger_has_reached_its_target_within_millimetres(
    joints: tuple[str, ...], off: float, speed: float, reached: bool
) -> None:
    controller, task = gripping(*joints)
    robot = controller.robot
    i = robot.joint_index(FINGER)
    robot.q[i], robot.v[i] = 0.04 - off, speed
    robot.update(robot.q, robot.v)
    task.target = {FINGER: 0.04}
    assert task.reached is reached
    if "panda_joint2" in task.joints:  # the others keep what they had
        task.target = {"panda_joint2": robot.q[1] + 0.04, FINGER: float(robot.q[i])}
        robot.v[i] = 0.0
        assert task.reached
        task.target = {"panda_joint2": robot.q[1] + 0.06}
        assert not task.reached


def test_ranges_speeds_ends_and_errors_of_a_finger_are_those_of_metres() -> None:
    controller, task = gripping(FINGER)
    robot = controller.robot
    i = robot.joint_index(FINGER)
    for beyond in (0.001, 0.003):
        accepted = beyond < 0.002
        for give in (
            lambda at: setattr(task, "target", [at]),
            lambda at: robot.configuration({FINGER: at}),
        ):
            with nullcontext() if accepted else pytest.raises(InputError, match=r"\(m\).*range"):
                give(0.04 + beyond)
    assert task.error_bound == pytest.approx([0.1])
    assert gripping(FINGER, error_bound=0.7)[1].error_bound == pytest.approx([0.7])
    bounds = gripping()[1].error_bound
    np.testing.assert_allclose(bounds, np.where(robot.slides, 0.1, 1.0))
    task.target = [0.04]
    task.move_to([0.0])
    places = [0.04]
    while task.moving:
        controller.solve()
        places.append(float(task.target[0]))
    speeds = np.diff(places) / controller.dt
    assert 0.1 < np.abs(speeds).max() <= 0.2 + 1e-9
    assert np.abs(np.diff(speeds)).max() / controller.dt <= 1.0 + 1e-6  # reached in 0.2 s
    released = wbc.Controller(load("panda").robot(), 0.005).release([FINGER])
    assert released is not None
    assert (robot.position_lower[i] < released._low < released._high < robot.position_upper[i]).all()
    ik = wbc.InverseKinematics(load("panda").robot(), 0.01)
    ik.add(JointLimits())
    ik.add(PostureTask({FINGER: 0.02}, joints=[FINGER], hard=True))
    ik.add(PostureTask({FINGER: 0.01}, joints=[FINGER], hard=True, name="other"))
    assert all(size.endswith(" m") for size in ik.reach().missed.values())
