"""Arms and quadrupeds: the QP works without soles, and what needs two feet says so."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.app import Log, Recorder
from wbc.base.errors import InputError, ModelError
from wbc.tasks import check_rows

BIPED = Path(__file__).parents[2] / "examples" / "biped.xml"
QUADRUPED = """<mujoco><worldbody><body name="trunk" pos="0 0 0.3"><freejoint/><geom size=".2 .1 .05" type="box"/>
{legs}</body></worldbody></mujoco>"""
LEG = """<body name="{name}" pos="{x} {y} 0">
<joint name="{name}_hip" axis="0 1 0" range="-90 90" actuatorfrcrange="-20 20"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/><body name="{name}_calf" pos="0 0 -.2">
<joint name="{name}_knee" axis="0 1 0" range="-90 90" actuatorfrcrange="-20 20"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/></body></body>"""


def quadruped() -> str:
    places = {"FL": (0.2, 0.1), "FR": (0.2, -0.1), "RL": (-0.2, 0.1), "RR": (-0.2, -0.1)}
    return QUADRUPED.format(legs="".join(LEG.format(name=n, x=x, y=y) for n, (x, y) in places.items()))


def test_a_bolted_base_bears_weight_and_moment_and_does_not_move() -> None:
    robot = wbc.RobotDescription.from_urdf(wbc.load_robot("panda").urdf).robot()  # floating
    controller = wbc.Controller(robot, 0.002)
    base = controller.add(wbc.FixedContact(robot.base_frame))
    hand = controller.add(wbc.PoseTask("panda_hand", hard=True))
    controller.add(wbc.PostureTask(weight=0.01), wbc.JointLimits(), wbc.TorqueLimits())
    still = controller.solve()
    force, moment = np.split(still.wrenches[base.name], 2)
    weight = robot.mass * 9.80665
    np.testing.assert_allclose(force, [0.0, 0.0, weight], atol=1e-3 * weight)
    np.testing.assert_allclose(moment, np.cross(robot.com, [0.0, 0.0, weight]), atol=1e-3 * weight)
    hand.target = hand.target * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.05]))
    moving = controller.solve()
    assert moving.ok
    np.testing.assert_allclose(moving.accelerations[:6], 0.0, atol=1e-6)
    np.testing.assert_allclose(moving.residuals[hand.name], 0.0, atol=1e-5)
    residual = robot.mass_matrix @ moving.accelerations + robot.bias
    residual[6:] -= moving.torques
    residual[:6] -= moving.wrenches[base.name]  # the base frame is the root's
    np.testing.assert_allclose(residual, 0.0, atol=1e-4)
    base.active, base.ramp = False, 0.0
    check_rows(wbc.PoseTask("panda_hand"), robot)


@pytest.mark.parametrize("name", ["panda", "go1"])
def test_a_robot_without_soles_rests_without_wrenches_and_its_ticks_are_recorded(
    name: str, tmp_path: Path
) -> None:
    description = wbc.load_robot(name)
    robot = description.robot()
    still = wbc.Measurement.resting(robot)
    assert still.wrenches.shape == (0, 6) and still.sole_range.shape == still.sole_stiffness.shape == (0,)
    np.testing.assert_allclose(still.specific_force, [0.0, 0.0, 9.80665], atol=1e-9)
    with Recorder(tmp_path / "run.arrow") as recorder:
        recorder.write(description, still, wbc.Command(np.zeros(robot.na)))
        for time in (None, "now", np.nan):
            with pytest.raises(wbc.WbcError, match="time of|log of one run"):
                recorder.write(description, replace(still, time=time), wbc.Command(np.zeros(robot.na)))
    assert len(Log.open(tmp_path / "run.arrow")) == 1


@pytest.mark.parametrize("feet", [4, 3])
def test_any_number_of_points_carries_the_weight(feet: int) -> None:
    robot = wbc.load_robot("go1").robot()
    controller = wbc.Controller(robot, 0.002)
    names = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
    contacts = controller.add(*(wbc.PointContact(name) for name in names))
    com = controller.add(wbc.CoMTask(weight=1e3))
    controller.add(
        wbc.OrientationTask(robot.base_frame), wbc.PostureTask(), wbc.JointLimits(), wbc.TorqueLimits()
    )
    if feet == 3:  # the centre of mass over the triangle of the others
        contacts[0].ramp, contacts[0].active = 0.0, False  # type: ignore[union-attr]
        com.target = com.target + [-0.05, -0.03, 0.0]
        for _ in range(1500):
            robot.update(
                pin.integrate(robot.model, robot.q, 0.002 * robot.v),
                robot.v + 0.002 * controller.solve().accelerations,
            )
    solution = controller.solve()
    assert solution.ok
    forces = np.array([solution.wrenches[name] for name in names])
    np.testing.assert_allclose(forces.sum(axis=0), [0.0, 0.0, robot.mass * 9.80665], atol=0.5)
    loaded = forces[4 - feet :]
    assert (loaded[:, 2] > 5.0).all() and np.allclose(forces[: 4 - feet], 0.0, atol=1e-6)
    assert (np.abs(loaded[:, :2]).max(axis=1) <= 0.7 * loaded[:, 2] + 1e-6).all()


def test_a_quadruped_by_mjcf_is_described_without_feet_when_asked() -> None:
    with pytest.raises(ModelError, match=re.escape("feet=False describes a robot without")):
        wbc.RobotDescription.from_mjcf(quadruped())
    robot = wbc.RobotDescription.from_mjcf(quadruped(), feet=False)
    assert robot.soles == () and robot.legs == ((), ()) and robot.robot().na == 8
    assert any("no feet" in line for line in robot.doubts())
    with pytest.raises(InputError, match="left_sole and right_sole"):
        wbc.RobotDescription.from_urdf(robot.urdf, left_sole="FL_calf")


@pytest.mark.parametrize(
    ("options", "said"), [({"base": "fixed"}, "not bolted to the world"), ({"feet": False}, "feet=False")]
)
def test_soles_of_a_robot_without_feet_are_refused_however_it_is_read(
    options: dict[str, Any], said: str
) -> None:
    for soles in ({"left_sole": "nonsense"}, {"left_sole": "left_foot", "right_sole": "right_foot"}):
        with pytest.raises(InputError, match=said):
            wbc.RobotDescription.from_mjcf(BIPED, **options, **soles)
    assert wbc.RobotDescription.from_mjcf(BIPED, **options).soles == ()
    given = wbc.RobotDescription.from_mjcf(BIPED, feet=False, passive=["left_knee"])
    assert given.passive == ("left_knee",)
