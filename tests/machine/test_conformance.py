"""Conformance: a good loop passes, and every deliberate fault of a bad one is named."""
# ruff: noqa: E501 - one fault a line

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from foreign import foreign_model
from made_machines import DESCRIPTION, PERIOD, Light, Recorded, Wrapped, healthy, plant
from properties import by_default

import wbc
from wbc import Command, Measurement
from wbc.feet import foot
from wbc.machine import conformance
from wbc.machine.conformance import CHECKS
from wbc.sim import Machine, MujocoLoop, Plant, with_feet

ONE, NONE = (1.0, 0.05), (0.0, 0.1)
IDEAL = {
    "gyroscope": [ONE],
    "IMU frame": [ONE, (1.0, 0.15), (0.0, 1.0)],
    "weight": [ONE],
    "sides": [(3.5, 0.3)],  # half of 8.3 mm over a stance of 119 mm: the other half is in feet that roll
    "wrench frame": [ONE, ONE, NONE, NONE],
    "soles": [NONE, NONE],
}
"""Check of a body that stands → figures that a perfect loop has, and how far a simulated robot may be from them."""


def test_a_good_loop_passes_all_checks() -> None:
    _, report = healthy()
    assert {check.state for check in report.checks} == {"ok"} and report.ok, str(report)
    assert [check.name for check in report.checks] == [name for _, names in CHECKS for name in names]
    for name, ideal in IDEAL.items():
        found = next(check.found for check in report.checks if check.name == name)
        figures = [float(text) for text in re.findall(r"[+-]?\d+\.?\d*", found)]
        assert len(figures) == len(ideal), found
        for figure, (value, tolerance) in zip(figures, ideal, strict=True):
            assert figure == pytest.approx(value, abs=tolerance), found


HRP4 = wbc.load_robot("hrp4_class")
GOOD: dict[str, tuple[Callable[[], Any], set[str] | None]] = {
    "softer ankles": (lambda: plant(DESCRIPTION.with_servos(["*ankle*=500,20"])), {"measured torque"}),
    "soft soles": (lambda: plant(with_feet(DESCRIPTION, foot("soft")), foot="soft"), None),
    "soft arches": (lambda: plant(with_feet(DESCRIPTION, foot("long_arch")), foot="long_arch"), None),
    **{f"noise, {name}": (lambda name=name: plant(wbc.load_robot(name), control_period=0.002, noise="realistic"), None) for name in ("hrp4_class", "talos", "g1")},
    **{f"of {kind}": (lambda kind=kind: MujocoLoop(HRP4, foreign_model(HRP4, kind), prefix="mine/"), set()) for kind in ("motor", "position", "none")},
    "stated delay": (lambda: Wrapped(plant(), late=2), None),
    "without force sensors": (lambda: MujocoLoop(DESCRIPTION, Plant(DESCRIPTION, visuals=False).model, control_period=PERIOD, machine=Machine(force_sensors=False, torque_sensors=True)), {"weight", "sides", "wrench frame"}),
}  # fmt: skip
"""Name → loop without a fault, and what is unknown of it, where that is known."""


@pytest.mark.slow
@pytest.mark.parametrize("name", GOOD)
def test_other_good_loops_pass(name: str) -> None:
    make, unknown = GOOD[name]
    report = conformance(make(), delay=0.01 if "delay" in name else 0.0)
    assert report.ok, str(report)
    if unknown is not None:
        assert {check.name for check in report.checks if check.state == "unknown"} == unknown, str(report)


NA = DESCRIPTION.robot().na
SWAP = np.arange(NA)
SWAP[[3, 20]] = SWAP[[20, 3]]
YAW = pin.rpy.rpyToMatrix(0.0, 0.0, np.pi / 2)
FOURTH = np.where(np.arange(NA) == 4, -1.0, 1.0)


def turned(m: Measurement, rotation: np.ndarray) -> Measurement:
    return replace(
        m, angular_velocity=rotation @ m.angular_velocity, specific_force=rotation @ m.specific_force
    )


FAULTS: dict[str, tuple[Callable[[Measurement, int], Measurement], str, str]] = {
    "two joints swapped": (lambda m, _: replace(m, joint_position=m.joint_position[SWAP], joint_velocity=m.joint_velocity[SWAP]), "joint order", "another order"),
    "one joint reversed": (lambda m, _: replace(m, joint_position=m.joint_position * FOURTH, joint_velocity=m.joint_velocity * FOURTH), "joint motion", "other way round"),
    "degrees": (lambda m, _: replace(m, joint_position=np.degrees(m.joint_position), joint_velocity=np.degrees(m.joint_velocity)), "joint motion", "degrees"),
    "motor side": (lambda m, _: replace(m, joint_position=20.0 * m.joint_position, joint_velocity=20.0 * m.joint_velocity), "joint motion", "motor's side"),
    "velocity reversed": (lambda m, _: replace(m, joint_velocity=-m.joint_velocity), "joint velocity", "reversed"),
    "velocity in degrees": (lambda m, _: replace(m, joint_velocity=np.degrees(m.joint_velocity)), "joint velocity", "degrees per second"),
    "no velocity": (lambda m, _: replace(m, joint_velocity=0.0 * m.joint_velocity), "joint velocity", "frozen"),
    "zero of an encoder": (lambda m, _: replace(m, joint_position=m.joint_position + 0.1 * (FOURTH < 0)), "joint zero", "zero of an encoder"),
    "torque reversed": (lambda m, _: replace(m, joint_torque=-m.joint_torque), "measured torque", "reversed"),  # type: ignore[operator]
    "torque of the motor": (lambda m, _: replace(m, joint_torque=m.joint_torque / 20.0), "measured torque", "another unit"),  # type: ignore[operator]
    "accelerometer in g": (lambda m, _: replace(m, specific_force=m.specific_force / 9.81), "accelerometer", "units of g"),
    "without gravity": (lambda m, _: replace(m, specific_force=m.specific_force - [0.0, 0.0, 9.80665]), "accelerometer", "gravity has been removed"),
    "accelerometer reversed": (lambda m, _: replace(m, specific_force=-m.specific_force), "accelerometer", "reversed"),
    "gyroscope in degrees": (lambda m, _: replace(m, angular_velocity=np.degrees(m.angular_velocity)), "gyroscope", "degrees per second"),
    "gyroscope dead": (lambda m, _: replace(m, angular_velocity=np.zeros(3)), "gyroscope", "does not turn"),
    "gyroscope reversed": (lambda m, _: replace(m, angular_velocity=-m.angular_velocity), "IMU frame", "gyroscope has the reversed sign"),
    "gyroscope in another frame": (lambda m, _: replace(m, angular_velocity=YAW @ m.angular_velocity), "IMU frame", "gyroscope is in another frame"),
    "IMU turned": (lambda m, _: turned(m, YAW), "IMU frame", "turned by 90°"),
    "wrench on the ground": (lambda m, _: replace(m, sole_wrench=-m.sole_wrench), "weight", "foot on the ground"),
    "wrench in kp": (lambda m, _: replace(m, sole_wrench=m.sole_wrench / 9.81), "weight", "another unit"),
    "feet swapped": (lambda m, _: replace(m, sole_wrench=m.sole_wrench[::-1]), "sides", "swapped"),
    "moments reversed": (lambda m, _: replace(m, sole_wrench=m.sole_wrench * [1, 1, 1, -1, -1, -1]), "wrench frame", "reversed sign"),
    "moments elsewhere": (lambda m, _: replace(m, sole_wrench=m.sole_wrench + np.outer(m.sole_wrench[:, 2], [0, 0, 0, 0, 0.05, 0])), "wrench frame", "another point"),
    "moments beside it": (lambda m, _: replace(m, sole_wrench=m.sole_wrench + np.outer(m.sole_wrench[:, 2], [0, 0, 0, 0.02, 0, 0])), "wrench frame", "another point"),
    "moments outside of it": (lambda m, _: replace(m, sole_wrench=m.sole_wrench + np.outer([0.1, -0.1] * m.sole_wrench[:, 2], [0, 0, 0, 1, 0, 0])), "wrench frame", "83 mm beyond the edge of a sole: moments are about another point"),
    "clock in milliseconds": (lambda m, _: replace(m, time=1e3 * m.time), "clock", "milliseconds"),
    "clock of 100 Hz": (lambda m, _: replace(m, time=2.0 * m.time), "clock", "100 Hz"),
    "clock stands still": (lambda m, _: replace(m, time=1.0), "clock", "stands still"),
    "jitter": (lambda m, tick: replace(m, time=m.time + 0.003 * (tick % 2)), "clock", "jitter"),
    "shape": (lambda m, _: replace(m, joint_position=m.joint_position[:-1]), "shapes", "has not"),
    "shape of the torques": (lambda m, _: replace(m, joint_torque=m.joint_torque[:-1]), "shapes", "has not"),  # type: ignore[index]
    "hands": (lambda m, _: replace(m, hand_wrenches=np.zeros((5, 6))), "shapes", "has not"),
    "time": (lambda m, _: replace(m, time=np.nan), "shapes", "first tick fails"),
    "torque is no number": (lambda m, _: replace(m, joint_torque=np.nan * m.joint_position), "shapes", "first tick fails"),
    "not a number": (lambda m, _: replace(m, specific_force=np.full(3, np.nan)), "shapes", "first tick fails"),
}  # fmt: skip
"""Name → fault of a measurement, the check that names it and words of the cause."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_measurement_is_named(fault: str) -> None:
    make, name, words = FAULTS[fault]
    report = conformance(Recorded(make))
    wrong = {check.name: check for check in report.wrong}
    assert name in wrong, f"{fault}: {report}"
    told = f"{wrong[name].found}: {wrong[name].cause}"
    assert words in told, f"{fault}: {told}"
    if name == "joint motion":
        assert DESCRIPTION.joint_names[4 if "one joint" in fault else 0] in told, told
    beside = set(wrong) - {name, "joint zero", "soles"}  # what follows from encoders that are off
    assert not beside, f"{fault}: {report}"


def test_measurements_that_come_every_other_tick_are_named() -> None:
    rows, _ = healthy()
    report = conformance(Recorded(lambda m, tick: replace(rows[2 * (tick // 2)], time=m.time)))
    assert [check.name for check in report.wrong] == ["fresh"], str(report)


ZERO, ROLLED = np.zeros(NA), np.roll(np.arange(NA), 7)
ELBOWS = np.arange(NA)
_left, _right = (DESCRIPTION.joint_names.index(f"{side}_elbow_joint") for side in ("left", "right"))
ELBOWS[[_left, _right]] = [_right, _left]
COMMANDS: dict[str, tuple[Callable[[Command], Any] | int, str, str]] = {
    "torque reversed": (lambda c: replace(c, joint_torque=-c.joint_torque), "torque", "doubles the sag"),
    "torque ignored": (lambda c: replace(c, joint_torque=ZERO), "torque", "ignored"),
    "torque of the motor": (lambda c: replace(c, joint_torque=5.0 * c.joint_torque), "torque", "another unit"),
    "velocity ignored": (lambda c: replace(c, joint_velocity=ZERO), "velocity reference", "ignored"),
    "commands to other joints": (lambda c: Command(c.joint_torque[ELBOWS], c.joint_position[ELBOWS], c.joint_velocity[ELBOWS]), "joint order", "another order"),  # type: ignore[index]
    "gains ignored": (lambda c: replace(c, kp=None, kd=None), "commanded gains", "wrong: kp and kd"),
    "damping ignored": (lambda c: replace(c, kd=None), "commanded gains", "wrong: kd"),
    "gains a degree": (lambda c: c if c.kp is None else replace(c, kp=c.kp / 57.3, kd=c.kd / 57.3), "commanded gains", "another unit"),  # type: ignore[operator]
    "all joints in another order": (lambda c: Command(c.joint_torque[ROLLED], c.joint_position[ROLLED]), "joint order", "another order"),  # type: ignore[index]
    "torque alone": (lambda c: Command(c.joint_torque), "joint order", "drives of torque alone"),
    "drives off": (lambda c: Command(ZERO), "joint order", "does not reach"),
    "10 ms late": (2, "delay", "10 ms"),
    "20 ms late": (4, "delay", "20 ms"),
}  # fmt: skip


@pytest.mark.parametrize("loop", by_default((Light, plant), Light))
@pytest.mark.parametrize("fault", COMMANDS)
def test_a_fault_of_the_command_is_named(fault: str, loop: Callable[[], Any]) -> None:
    out, name, words = COMMANDS[fault]
    report = conformance(Wrapped(loop(), late=out) if isinstance(out, int) else Wrapped(loop(), out))
    wrong = {check.name: check for check in report.wrong}
    assert name in wrong and words in f"{wrong[name].found}: {wrong[name].cause}", f"{fault}: {report}"
    if name == "torque":
        gains = next(check for check in report.checks if check.name == "commanded gains")
        assert (gains.state, gains.found) == ("unknown", "own gains are not as they should")
    if "gains" in name or "alone" in words:
        assert set(wrong) <= {name, "velocity reference"}, f"{fault}: {report}"


def test_the_pressure_of_a_foot_that_hardly_carries_is_not_judged() -> None:
    """On a foot with less than a tenth of the weight a centre of pressure 0.3 m away is noise."""

    def shifted(share: float) -> Callable[[Measurement, int], Measurement]:
        def fault(m: Measurement, tick: int) -> Measurement:
            wrench = np.array(m.sole_wrench)
            moved = share * wrench[1] - wrench[1]
            wrench[1] += moved
            wrench[0, 2] -= moved[2]
            wrench[1, 4] = 0.3 * wrench[1, 2]
            return replace(m, sole_wrench=wrench)

        return fault

    for share, beyond in ((0.1, False), (0.4, True)):
        (check,) = (c for c in conformance(Recorded(shifted(share))).checks if c.name == "wrench frame")
        assert ("beyond the edge" in check.found) is beyond, check.found


class Buzzing:
    """A loop whose servos are computed outside of the physics, explicitly, at joints with little rotor inertia."""

    description, control_period = DESCRIPTION, PERIOD

    def __init__(self, step: float, armature: float) -> None:
        model = Plant(DESCRIPTION, timestep=step, visuals=False).model
        model.actuator_biastype[:], model.actuator_biasprm[:], model.actuator_ctrllimited[:] = 0, 0.0, 0
        model.actuator_gainprm[:, 0] = 1.0
        model.opt.integrator, model.dof_armature[6:] = mujoco.mjtIntegrator.mjINT_EULER, armature
        self._loop, self._steps = MujocoLoop(DESCRIPTION, model, control_period=step), round(PERIOD / step)
        self.measure = self._loop.measure

    def step(self, command: Command) -> None:
        kp, kd = command.kp, command.kd
        kp, kd = DESCRIPTION.kp if kp is None else kp, DESCRIPTION.kd if kd is None else kd
        data, places, limit = self._loop.data, self._loop.places, self._loop.robot.torque_limit
        for _ in range(self._steps):
            off = command.joint_position - data.qpos[places.joint_qpos]
            rate = command.joint_velocity - data.qvel[places.joint_dof]
            self._loop.step(Command(np.clip(command.joint_torque + kp * off + kd * rate, -limit, limit)))


@pytest.mark.parametrize("armature", [0.003, pytest.param(0.0, marks=pytest.mark.slow)])
def test_drives_that_buzz_are_named_first_and_nothing_is_judged_by_them(armature: float) -> None:
    report = conformance(Buzzing(0.0005, armature))
    assert [check.name for check in report.wrong] == ["rest"] and "buzzes" in report.wrong[0].cause
    assert {check.name for check in report.checks if check.state == "ok"} == {"shapes", "clock"}
    assert "ankle" in report.wrong[0].found


@pytest.mark.slow
def test_the_same_drives_at_joints_with_rotors_are_at_rest() -> None:
    assert conformance(Buzzing(0.0005, 0.03)).ok


def test_joints_without_mass_are_found_as_they_are() -> None:
    prompt = {check.name: check for check in conformance(Light()).checks}
    states = {name: check.state for name, check in prompt.items()}
    unknown = {"gyroscope", "weight", "sides", "wrench frame", "soles"}  # it does not stand
    assert {name for name, state in states.items() if state == "unknown"} == unknown
    assert {state for name, state in states.items() if name not in unknown} == {"ok"}
