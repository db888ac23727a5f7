"""Figures of a conformance report: each is that of the fault, and a fault is told from its bound on."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_machines import DESCRIPTION, PERIOD, Light, Wrapped

from wbc.core.robot import GRAVITY
from wbc.core.signals import Command, Measurement
from wbc.machine import conformance
from wbc.machine.conformance import Check
from wbc.machine.conformance.causes import CAUSES
from wbc.machine.conformance.joints import PULSES

NAMES = DESCRIPTION.joint_names
NA = len(NAMES)
REFERENCE = np.array(DESCRIPTION.robot().half_sitting[7:])
FREE = [i for i, name in enumerate(NAMES) if name not in {n for leg in DESCRIPTION.legs for n in leg}]


class Hung(Light):
    """The robot of joints without mass, whose measurements and commands are changed; its loads are its own."""

    def __init__(
        self,
        fault: Callable[[Measurement, int], Measurement] = lambda m, tick: m,
        out: Callable[[Command], Command] = lambda c: c,
    ) -> None:
        super().__init__()
        self._fault, self._out, self._tick = fault, out, 0

    def measure(self) -> Measurement:
        return self._fault(super().measure(), self._tick)

    def step(self, command: Command) -> None:
        self._tick += 1
        super().step(self._out(command))


def checks_of(loop: Any, **options: float) -> dict[str, Check]:
    return {check.name: check for check in conformance(loop, **options).checks}


def numbers(check: Check) -> list[float]:
    return [float(text) for text in re.findall(r"[+-]?\d+\.?\d*", check.found)]


PROMPT = checks_of(Hung())


def test_figures_of_joints_that_hang_are_those_by_which_they_are_scaled() -> None:
    """Measured velocities by 0.8, torques by 1.2, forces by 0.97; commanded torques by 0.7, velocities by 0.6."""

    def fault(m: Measurement, tick: int) -> Measurement:
        assert m.joint_torque is not None
        return replace(
            m,
            joint_velocity=0.8 * m.joint_velocity,
            joint_torque=1.2 * m.joint_torque,
            specific_force=0.97 * m.specific_force,
        )

    def out(c: Command) -> Command:
        velocity = None if c.joint_velocity is None else 0.6 * c.joint_velocity
        return replace(c, joint_torque=0.7 * c.joint_torque, joint_velocity=velocity)

    found = checks_of(Hung(fault, out))
    assert {check.state for check in found.values()} == {"ok", "unknown"}
    assert numbers(found["joint velocity"]) == pytest.approx([0.8], abs=0.01)
    assert numbers(found["measured torque"]) == pytest.approx([1.2], abs=0.01)
    assert numbers(found["accelerometer"])[0] == pytest.approx(0.97 * GRAVITY, abs=0.01)
    assert numbers(found["torque"]) == pytest.approx([0.7], abs=0.02)
    assert numbers(found["velocity reference"]) == pytest.approx([0.6], abs=0.02)


def test_a_machine_that_takes_gains_for_others_acts_with_those() -> None:
    """Halves that act as 0.6 and 0.4: stiffness by 1.2, damping by 0.8; what a machine has of its own is known."""

    def out(c: Command) -> Command:
        return c if c.kp is None or c.kd is None else replace(c, kp=1.2 * c.kp, kd=0.8 * c.kd)

    assert numbers(checks_of(Hung(out=out))["commanded gains"]) == pytest.approx([0.6, 0.4], abs=0.03)

    def soft(c: Command) -> Command:
        own = np.array(DESCRIPTION.kp), np.array(DESCRIPTION.kd)
        return replace(c, kp=0.7 * own[0], kd=0.7 * own[1]) if c.kp is None else c

    found = checks_of(Hung(out=soft))
    assert numbers(found["torque"]) == pytest.approx([1.0 / 0.7], abs=0.03)
    assert found["commanded gains"].state == "ok"
    assert numbers(found["commanded gains"]) == pytest.approx([0.5, 0.5], abs=0.03)


@pytest.mark.parametrize(
    ("clock", "force", "rate", "zero", "gain", "state"),
    [
        (1.049, 1.05, 1.38, 0.049, 1.55, "ok"),
        (1.051, 1.052, 1.42, 0.051, 1.65, "wrong"),
        (0.951, 0.95, 0.62, -0.049, 0.45, "ok"),
        (0.949, 0.948, 0.58, -0.051, 0.35, "wrong"),
    ],
)
def test_figures_are_those_of_the_faults_and_wrong_from_a_bound_on(
    clock: float, force: float, rate: float, zero: float, gain: float, state: str
) -> None:
    """Clock within 5 %, accelerometer within 0.5 m/s², velocity of a joint within 0.4, its zero within 50 mrad."""
    one, off = np.ones(NA), np.zeros(NA)
    one[4], off[7] = rate, zero

    def fault(m: Measurement, tick: int) -> Measurement:
        return replace(
            m,
            time=clock * m.time,
            specific_force=force * m.specific_force,
            joint_velocity=one * m.joint_velocity,
            joint_position=m.joint_position + off,
        )

    def stiff(c: Command) -> Command:
        return c if c.kp is None or c.kd is None else replace(c, kp=gain * c.kp, kd=gain * c.kd)

    found = checks_of(Hung(fault, stiff))
    for name in ("clock", "accelerometer", "joint velocity", "joint zero", "commanded gains"):
        assert found[name].state == state, found[name]
    hertz, stated, period, worst = numbers(found["clock"])
    assert (hertz, stated) == (pytest.approx(200.0 / clock, abs=0.51), 200.0)
    assert period == pytest.approx(5.0 * clock, abs=1e-3)
    assert worst == pytest.approx(abs(clock - 1.0) * 5.0, abs=1e-3)
    assert numbers(found["accelerometer"])[0] == pytest.approx(force * GRAVITY, abs=5e-3)
    assert numbers(found["joint velocity"])[0] == pytest.approx(1.0, abs=0.01)
    assert (NAMES[4] in found["joint velocity"].found) == (state == "wrong")
    assert found["joint zero"].found.startswith(f"{NAMES[7]} {1e3 * zero:+.0f} mrad from half-sitting")


@pytest.mark.parametrize("size", [1.7, 0.6])
def test_the_way_of_the_joints_is_told_as_a_share_of_their_step(size: float) -> None:
    def fault(m: Measurement, tick: int) -> Measurement:
        return replace(m, joint_position=REFERENCE + size * (m.joint_position - REFERENCE))

    found = checks_of(Hung(fault))
    assert numbers(found["joint motion"]) == pytest.approx([size], abs=0.03)
    assert numbers(found["joint velocity"]) == pytest.approx([1.0 / size], abs=0.02)
    # Torques move them by as much more, and velocity references, too.
    for name in ("torque", "velocity reference"):
        assert numbers(found[name]) == pytest.approx([size * numbers(PROMPT[name])[0]], abs=0.02)


@pytest.mark.parametrize(
    ("size", "late", "force", "cause"),
    [
        (2.4, 0.0024, 1.15, "in_g"),
        (2.6, 0.0026, 1.0, "in_g"),
        (0.33, 0.0024, 1.9, "without_gravity"),
        (0.27, 0.0026, 2.1, "unit"),
    ],
)
def test_a_joint_that_goes_too_far_or_too_little_is_named_and_jitter_and_units_are_told(
    size: float, late: float, force: float, cause: str
) -> None:
    """Beyond 2.5 of the step, below 0.3 of it where nothing holds the joint; half a period; g within a fifth."""
    one, joint = np.ones(NA), FREE[2]
    one[joint] = size

    def fault(m: Measurement, tick: int) -> Measurement:
        position = REFERENCE + one * (m.joint_position - REFERENCE)
        moved = replace(m, joint_position=position, joint_velocity=one * m.joint_velocity)
        return replace(
            moved, time=m.time + late * (tick == 50), specific_force=force / GRAVITY * m.specific_force
        )

    found, odd = checks_of(Hung(fault)), not 0.3 < size < 2.5
    assert (found["joint motion"].state == "wrong") == (NAMES[joint] in found["joint motion"].found) == odd
    assert numbers(found["clock"])[3] == pytest.approx(1e3 * late, abs=1e-3)
    assert (found["clock"].state == "wrong") == (late > 0.0025)
    assert found["accelerometer"].cause == CAUSES["accelerometer"][cause]


def test_joints_that_move_each_other_are_named_and_those_that_do_not_move_are_counted() -> None:
    order = np.arange(NA)
    order[[3, 20]] = order[[20, 3]]
    swapped = checks_of(
        Hung(
            lambda m, tick: replace(
                m,
                joint_position=REFERENCE + (m.joint_position - REFERENCE)[order],
                joint_velocity=m.joint_velocity[order],
            )
        )
    )["joint order"]
    assert (
        f"{NAMES[3]} moves {NAMES[20]}" in swapped.found and f"{NAMES[20]} moves {NAMES[3]}" in swapped.found
    )
    for count, lost in ((NA // 2 - 1, False), (NA // 2, True)):
        still = np.arange(NA) < count

        def fault(m: Measurement, tick: int, still: np.ndarray = still) -> Measurement:
            return replace(
                m,
                joint_position=np.where(still, REFERENCE, m.joint_position),
                joint_velocity=np.where(still, 0.0, m.joint_velocity),
            )

        found = checks_of(Hung(fault))
        assert found["joint order"].state == "wrong"
        assert found["joint order"].found.startswith(f"{count} joints do not follow: {NAMES[0]}, {NAMES[1]}")
        assert (found["accelerometer"].state == "unknown") == lost  # of a machine that does not move at all
        assert found["joint velocity"].state == "unknown"


def test_samples_that_repeat_are_counted_from_a_quarter_on() -> None:
    """Of ticks that repeat every n-th sample one in n does; the second half of a motion is at rest and not counted."""
    for every, share in ((3, 33.0), (5, 20.0)):
        kept: list[Measurement] = []

        def fault(
            m: Measurement, tick: int, kept: list[Measurement] = kept, every: int = every
        ) -> Measurement:
            if not kept or tick % every:
                kept[:] = [m]
            return replace(kept[0], time=m.time)

        check = checks_of(Hung(fault))["fresh"]
        assert numbers(check)[0] == pytest.approx(share, abs=12.0)
        assert (check.state == "wrong") == (numbers(check)[0] >= 25.0)


@pytest.mark.parametrize("late", [1, 3])
def test_a_delay_is_that_of_torques_and_of_references(late: int) -> None:
    """Beside it stands what was stated; more than a period longer is wrong."""
    delay = late * PERIOD
    for stated, wrong in ((delay, False), (max(0.0, delay - 1.2 * PERIOD), late > 1)):
        found = checks_of(Wrapped(Light(), late=late), delay=stated)["delay"]
        lag, acts = numbers(found)
        assert lag == pytest.approx(numbers(PROMPT["delay"])[0] + 1e3 * delay, abs=1.0)
        assert acts == pytest.approx(1e3 * delay) and (found.state == "wrong") == wrong


def test_pulses_of_torque_leave_neither_a_velocity_nor_a_drift_of_it() -> None:
    """Their sum and their first moment are zero: what drifts steadily cancels out of the mean answer."""
    assert sum(PULSES) == sum(k * sign for k, sign in enumerate(PULSES)) == 0.0
    assert PULSES[0] > 0.0 and {abs(sign) for sign in PULSES} == {1.0}


def test_shapes_that_are_wrong_are_told_each_and_those_that_are_right_by_their_number() -> None:
    assert PROMPT["shapes"].state == "ok" and PROMPT["shapes"].found == f"{NA} joints, 2 soles"
    bad = np.zeros(NA)
    bad[3] = np.nan
    found = checks_of(
        Hung(
            lambda m, tick: replace(
                m,
                joint_velocity=np.zeros(NA - 1),
                joint_position=bad,
                angular_velocity=np.zeros(3, dtype=int),
                joint_torque=None,
                sole_wrench=None,
            )
        )
    )
    assert found["shapes"].state == "wrong" and found["shapes"].found == (
        f"joint_position is not finite; joint_velocity has shape ({NA - 1},), not ({NA},); "
        "angular_velocity is not made of floats"
    )
    assert {check.state for name, check in found.items() if name != "shapes"} == {"unknown"}
    assert {check.found for name, check in found.items() if name != "shapes"} == {"shapes are wrong"}


@pytest.mark.parametrize(("reversed_", "told"), [(9, True), (12, False), (20, True)])
def test_a_machine_that_follows_torques_alone_is_told_by_two_thirds_of_its_joints(
    reversed_: int, told: bool
) -> None:
    """Of one sign or the other; of the joints beside the legs, which the pulses of torque move."""
    count = round(reversed_ / NA * len(FREE))
    sign = np.ones(NA)
    sign[FREE[:count]] = -1.0
    check = checks_of(Hung(out=lambda c: Command(sign * c.joint_torque)))["joint order"]
    assert check.state == "wrong" and check.found.startswith("position references move no joint")
    share = max(count, len(FREE) - count) / len(FREE)
    assert ("torques do" in check.found) == told == (share > 0.65)


def test_joints_that_go_to_and_fro_are_counted_and_the_fastest_is_named() -> None:
    """More than 1 rad/s in the median, more than 5 mrad in all, and more than twice as far as they come."""
    shaken = {4: 1.2, 7: 1.5, 11: 0.9}

    def fault(m: Measurement, tick: int) -> Measurement:
        rate, position = m.joint_velocity.copy(), m.joint_position.copy()
        for joint, speed in shaken.items():
            rate[joint] = speed * (-1) ** tick
            position[joint] = REFERENCE[joint] + 0.5 * PERIOD * speed * (-1) ** tick
        return replace(m, joint_velocity=rate, joint_position=position)

    found = checks_of(Hung(fault))
    check = found["rest"]
    assert check.state == "wrong" and found["joint order"].state == "unknown"
    assert check.found == (f"{NAMES[7]} at 1.50 rad/s goes nowhere; so do 2 joints: {NAMES[4]}, {NAMES[7]}")
    shaken.clear()
    assert checks_of(Hung(fault))["rest"].found == f"{NAMES[0]} at 0.00 rad/s"


@pytest.mark.parametrize(
    ("angle", "state", "kind"),
    [(0.30, "ok", "ok"), (0.33, "ok", "wrong"), (2.33, "ok", "wrong"), (2.37, "wrong", "unknown")],
)
def test_an_imu_of_a_robot_that_hangs_is_told_by_the_vertical(angle: float, state: str, kind: str) -> None:
    """Its cosine is to be above 0.95; below −0.7 the sign is told, before the frame, of which nothing is known then."""
    turn = pin.rpy.rpyToMatrix(0.0, angle, 0.0)
    up = DESCRIPTION.robot().placement(DESCRIPTION.robot().imu_frame).rotation
    found = checks_of(Hung(lambda m, tick: replace(m, specific_force=up.T @ turn @ up @ m.specific_force)))
    assert (found["accelerometer"].state, found["IMU frame"].state) == (state, kind)
    assert ("reversed" in found["accelerometer"].cause) == (state == "wrong")
    if kind != "unknown":
        assert numbers(found["IMU frame"])[0] == pytest.approx(np.cos(angle), abs=1e-3)
