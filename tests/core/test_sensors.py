"""Plausibility of single readings, and sensors that contradict each other or have frozen."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest, observed

from wbc import TorqueControl, balance_controller
from wbc.base.errors import MeasurementError
from wbc.core.estimation.checks.accelerometer import AccelerometerCheck
from wbc.core.estimation.checks.consistency import FROZEN_AFTER, ConsistencyMonitor
from wbc.core.estimation.checks.plausibility import Plausibility
from wbc.core.estimation.foot import FeetAtRest
from wbc.core.estimation.inertial import Correction
from wbc.core.robot import GRAVITY
from wbc.robots import load
from wbc.sim import Plant

ROBOT, DT = load("hrp4_class").robot(), 0.005
WEIGHT = ROBOT.mass * GRAVITY


def test_a_sensor_is_refused_for_what_it_reads_now() -> None:
    """Wrenches of a wrong shape in a tick that is refused for its stamp are not told of the next tick."""
    plausibility, first = Plausibility(ROBOT, DT), at_rest(ROBOT, 0.0)
    plausibility.check(first)
    with pytest.raises(MeasurementError, match="time"):
        plausibility.check(replace(first, time=50.0, sole_wrench=np.zeros(5)))
    plausibility.check(replace(first, time=DT, sole_wrench=np.full((2, 6), 1e6)))
    assert len(plausibility.reasons) == 2
    assert all("shape" not in str(reason) for reason in plausibility.reasons)


def test_refused_readings_are_predicted_from_those_that_are_good() -> None:
    """An encoder goes on with its joint's speed, a speed is that of its encoder, and all else stays as it was."""
    plausibility, na, tick = Plausibility(ROBOT, DT), ROBOT.na, 1
    rate = np.linspace(-0.4, 0.5, na)
    first = at_rest(ROBOT, 0.0, angular_velocity=np.array([0.1, 0.2, 0.3]), joint_velocity=rate)
    plausibility.check(first)
    good = replace(
        first,
        time=DT,
        joint_position=first.joint_position + DT * (rate + 0.1),
        joint_velocity=rate + 0.2,
        specific_force=first.specific_force + 1.0,
        sole_wrench=first.wrenches + 2.0,
    )
    bad, wrong, expected = good, {}, {}
    for name in ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "sole_wrench"):
        wrong[name], expected[name] = getattr(good, name).copy(), getattr(good, name).copy()
    wrong["joint_position"][[2, 4]] = np.nan, wrong["joint_position"][4] + 1.0
    wrong["joint_velocity"][[4, 5, 6]] = 1e3, np.nan, -np.inf
    wrong["angular_velocity"][1] += plausibility.settings.gyro_jump + 1.0
    wrong["sole_wrench"][1, 5] = np.nan
    expected["joint_position"][2] = first.joint_position[2] + DT * (rate[2] + 0.2)
    expected["joint_position"][4] = first.joint_position[4] + DT * rate[4]
    expected["joint_velocity"][[4, 5, 6]] = rate[[4, 5, 6]] + [0.0, 0.1, 0.1]
    expected["angular_velocity"] = first.angular_velocity
    expected["sole_wrench"][1] = first.wrenches[1]
    bad = replace(good, **wrong)
    used, _ = plausibility.check(bad)
    for name, value in expected.items():
        np.testing.assert_allclose(getattr(used, name), value, rtol=1e-9, err_msg=name)
    names = ROBOT.joint_names
    refused = (
        *(f"encoder of {names[i]}" for i in (2, 4)),
        *(f"velocity of {names[i]}" for i in (4, 5, 6)),
        *("gyroscope", "force sensor of right_foot"),
    )
    assert plausibility.faults == refused
    np.testing.assert_array_equal(
        plausibility.joints(bad)[1], np.where(np.isin(np.arange(na), (4, 5, 6)), np.nan, rate + 0.2)
    )
    assert np.isnan(plausibility.joints(replace(bad, joint_velocity=rate[1:]))[1]).all()
    for tick in range(2, 11):  # 50 ms
        plausibility.check(replace(bad, time=tick * DT))
    with pytest.raises(MeasurementError):
        plausibility.check(replace(bad, time=11 * DT))
    assert tuple(reason.sensor for reason in plausibility.reasons) == refused


@pytest.mark.parametrize(
    ("signal", "place", "reading", "low", "high", "unit"),
    [
        ("sole_wrench", (1, 2), 1e6, -10.0 * WEIGHT, 10.0 * WEIGHT, "N"),
        ("sole_wrench", (0, 4), np.nan, -1.6 * WEIGHT, 1.6 * WEIGHT, "Nm"),
        ("angular_velocity", 2, 15.5, -14.9, 15.1, "rad/s"),
        ("angular_velocity", 0, -40.0, -35.0, 35.0, "rad/s"),
        ("specific_force", 1, 161.0, -160.0, 160.0, "m/s²"),
    ],
)
def test_a_refusal_has_the_reading_and_what_is_accepted(
    signal: str, place: Any, reading: float, low: float, high: float, unit: str
) -> None:
    """Ten weights, and 0.16 m of the sole's length; the range of common units, and the greatest jump of a rate."""
    plausibility = Plausibility(ROBOT, DT)
    still = at_rest(ROBOT, 0.0, angular_velocity=np.full(3, 0.1))
    plausibility.check(still)
    values = getattr(still, signal).copy()
    values[place] = reading
    plausibility.check(replace(still, time=DT, **{signal: values}))
    (reason,) = plausibility.reasons
    np.testing.assert_equal(reason.value, reading)
    np.testing.assert_allclose((reason.low, reason.high), (low, high), rtol=1e-6)
    assert reason.unit == unit and reason.jump == (abs(reading) == 15.5)
    plausibility.check(replace(still, time=2 * DT))
    assert plausibility.reasons == ()


def test_encoders_are_believed_to_a_margin_beyond_the_ends_of_their_ranges_and_no_further() -> None:
    """In the check and for damping, at both ends, which lie anywhere about zero; speeds to a multiple of the limit."""
    low, high, margin = (
        ROBOT.position_lower,
        ROBOT.position_upper,
        Plausibility(ROBOT, DT).settings.position_margin,
    )
    assert np.ptp(low + high) > 1.0
    for end, side in ((high, 1.0), (low, -1.0)):
        for share, good in ((0.99, True), (1.01, False)):
            plausibility = Plausibility(ROBOT, DT)
            position, speed = end + side * share * margin * ROBOT.per_rad, side * share * plausibility._speed
            measured = at_rest(ROBOT, 0.0, joint_position=position, joint_velocity=speed)
            q, v = plausibility.joints(measured)
            assert np.isfinite(q).all() == np.isfinite(v).all() == good
            assert np.isnan(q).all() == np.isnan(v).all() == (not good)
            if good:
                plausibility.check(measured)
                assert plausibility.faults == ()
                continue
            plausibility.check(at_rest(ROBOT, 0.0))
            plausibility.check(replace(measured, time=DT))
            assert len(plausibility.faults) == 2 * ROBOT.na


def test_a_sensor_that_fails_now_and_then_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    """Two sensors in turns for 4 s: each is named at its first failure, and again after it was good for a while."""
    plausibility = Plausibility(ROBOT, DT)
    plausibility.check(at_rest(ROBOT, 0.0))
    wrench = at_rest(ROBOT, 0.0).wrenches
    for tick in range(1, 800):
        bad = wrench.copy()
        if tick % 3 and not 300 < tick < 560:
            bad[tick % 2, 2] = 1e6
        plausibility.check(at_rest(ROBOT, tick * DT, sole_wrench=bad))
    said = [record.getMessage() for record in caplog.records]
    assert [(side, sum(side in text for text in said)) for side in ("left", "right")] == [
        ("left", 2),
        ("right", 2),
    ]


@pytest.mark.parametrize("lost", [1, 4])
def test_predictions_are_over_the_time_that_has_passed_where_measurements_are_lost(lost: int) -> None:
    plausibility, passed, rate = Plausibility(ROBOT, DT), (1 + lost) * DT, np.full(ROBOT.na, 0.3)
    first = at_rest(ROBOT, 0.0, joint_velocity=rate)
    plausibility.check(first)
    position, velocity = first.joint_position + passed * rate, rate.copy()
    position[2], velocity[5] = np.nan, np.nan
    sent = replace(first, time=passed, joint_position=position, joint_velocity=velocity)
    used, _ = plausibility.check(sent)
    np.testing.assert_allclose(used.joint_position, first.joint_position + passed * rate, rtol=1e-9)
    np.testing.assert_allclose(used.joint_velocity, rate, rtol=1e-9)


def standing(rotation: Any, share: float = 0.5) -> Any:
    """Return what the check of the accelerometer sees of a robot of 50 kg at rest; its left foot bears a share."""
    inertial = SimpleNamespace(rotation=rotation, correction=Correction(legs=(0.0, 0.0, 0.0)))
    rest = FeetAtRest([share, 1.0 - share], [], [])
    return SimpleNamespace(
        inertial=inertial, robot=SimpleNamespace(mass=50.0), rest=rest, net_wrench=np.zeros(6)
    )


def test_an_accelerometer_is_left_out_when_neither_legs_nor_ground_move_as_it_shows() -> None:
    """Its lag of 15 ms passes 3.5 of 4 m/s² after 31.2 ms and a period; it falls below 2 from 3.86 after 9.9 ms."""
    turn = pin.rpy.rpyToMatrix(0.2, -0.3, 0.5)

    def run(legs: float = 0.0, ground: float = 0.0, share: float = 0.5) -> list[bool]:
        """Ticks after 0.6 s of rest in which it is left out, for the acceleration of the legs and of the ground."""
        observer, check, found = standing(turn, share), AccelerometerCheck(DT), []
        inertial = observer.inertial
        for tick in range(-120, 20):
            shown = -4.0 if 0 <= tick < 10 else 0.0
            speed = inertial.correction.legs[1] + DT * (legs if tick >= 0 else 0.0)
            inertial.correction = Correction(legs=(0.0, speed, 0.0))
            observer.net_wrench[1] = 50.0 * ground
            measured = at_rest(ROBOT, 0.0, specific_force=turn.T @ [0.0, shown, GRAVITY])
            used = check.check(measured, observer)
            found.append(check.left_out)
            expected = turn.T @ [0.0, 0.0 if check.left_out else shown, GRAVITY]
            np.testing.assert_allclose(used.specific_force, expected, atol=1e-12)
        assert not any(found[:120])
        return found[120:]

    assert run() == [tick in range(7, 11) for tick in range(20)]
    for kept in ({"legs": -4.0}, {"ground": -4.0}, {"share": 0.1}):
        assert not any(run(**kept)), kept
    assert any(run(legs=4.0)) and any(run(ground=4.0)) and any(run(share=0.2))


@pytest.mark.parametrize("lost", [0, 1])
@pytest.mark.parametrize("late", [0, 1])
def test_a_push_that_the_legs_show_a_period_later_leaves_the_accelerometer_in(late: int, lost: int) -> None:
    """A push of 40 m/s² on the pelvis of a robot that stands: of all its speed nothing may be lost."""
    observer, check = standing(np.eye(3)), AccelerometerCheck(DT)
    inertial = observer.inertial
    for tick in range(-120, 16):
        if tick >= late:
            speed = inertial.correction.legs[0] + (1 + lost) * DT * 40.0
            inertial.correction = Correction(legs=(speed, 0.0, 0.0))
        push = 40.0 if tick >= 0 else 0.0
        check.check(at_rest(ROBOT, tick * (1 + lost) * DT, specific_force=[push, 0.0, GRAVITY]), observer)  # type: ignore[arg-type]
        assert not check.left_out, tick


@pytest.mark.parametrize("lifts", [False, True])
def test_feet_that_turn_alike_are_doubted_where_the_robot_stands(lifts: bool) -> None:
    """A walk over boards turns about the edges under both soles."""
    names = Plausibility(ROBOT, DT).names
    monitor, rng = ConsistencyMonitor(ROBOT, DT, names), np.random.default_rng(0)
    seen, told = observed(ROBOT, foot_rotations=2 * [(0.0, 0.6, 0.8)]), []
    for tick in range(400):
        wrench = np.zeros((2, 6))
        left = 0.0 if lifts and tick % 60 > 30 else 0.5
        wrench[:, 2] = np.array((left, 1.0 - left)) * ROBOT.mass * GRAVITY
        measurement = at_rest(ROBOT, tick * DT, sole_wrench=wrench)
        monitor.update(1e-3 * rng.normal(size=len(names)), measurement, seen)
        told.append("encoders and gyroscope disagree" in monitor.doubts)
    assert any(told) == (not lifts)


def drifting(drift: Any, joints: Any = 5, scale: float = 1.0, motion: float = 0.4) -> list[tuple[float, str]]:
    """Return what is doubted of encoders that leave the integrals of their velocities, and when, s.

    All joints swing by `motion`, rad, at 1 Hz and in phases of their own; the velocities are `scale` times as large.
    """
    names, na, rng = Plausibility(ROBOT, DT).names, ROBOT.na, np.random.default_rng(0)
    monitor, phases, found = ConsistencyMonitor(ROBOT, DT, names), rng.uniform(0.0, 6.0, ROBOT.na), []
    for tick in range(600):
        time, values = tick * DT, 1e-3 * rng.normal(size=len(names))
        angle = 2.0 * np.pi * time + phases
        values[:na] += motion * np.sin(angle)
        values[joints] += drift(time)
        values[na : 2 * na] += scale * motion * 2.0 * np.pi * np.cos(angle)
        monitor.update(values, at_rest(ROBOT, time), observed(ROBOT))
        found += [(time, doubt) for doubt in monitor.doubts]
    return found


@pytest.mark.parametrize(("rate", "within"), [(0.1, 1.6), (-0.3, 0.55), (0.9, 0.25)])
def test_an_encoder_that_drifts_from_its_velocity_is_named_and_nothing_else(
    rate: float, within: float
) -> None:
    """Long before the difference of their speeds alone would tell."""
    found = drifting(lambda time: rate * max(time - 1.0, 0.0))
    assert {doubt for _, doubt in found} == {f"velocity of {ROBOT.joint_names[5]} contradicts its encoder"}
    assert 1.0 < found[0][0] < 1.0 + within


@pytest.mark.slow
@pytest.mark.parametrize(
    ("weak", "push", "doubted"),
    [(1.0, 0.0, False), (1.0, 0.3, False), (0.5, 0.0, True)],
    ids=["sound", "pushed", "half a knee"],
)
def test_a_robot_that_sinks_and_tilts_on_weak_drives_is_not_well(
    weak: float, push: float, doubted: bool
) -> None:
    """Encoders, IMU and force sensors agree with each other: what disagrees is the motion that was commanded."""
    description = load("g1")
    plant = Plant(description, control_period=0.002, noise="realistic", visuals=False)
    control, knee = (
        TorqueControl(balance_controller(description.robot(), 0.002)),
        description.robot().joint_index("left_knee_joint"),
    )
    monitor, found = control.watch(), set[str]()
    for tick in range(700):
        command = control.command(plant.measure())
        if tick == 300 and push:
            plant.push(plant.robot.base_frame, [0.0, push * plant.robot.mass / 0.05, 0.0], 0.05)
        if tick >= 300:
            command.joint_torque[knee] *= weak
        plant.step(command)
        found |= {doubt for doubt in monitor.doubts if "commanded" in doubt}
    tilted = np.degrees(np.arccos(pin.Quaternion(plant.truth().q[3:7]).matrix()[2, 2]))
    assert bool(found) == bool(tilted > 10.0) == doubted


@pytest.mark.parametrize(
    ("axis", "acceleration", "least"),
    [(0, 10.0, 1.0), (2, -8.0, 1.0), (4, -40.0, 4.0), (4, 12.0, 4.0), (5, 60.0, np.inf)],
)
def test_a_trunk_that_does_not_follow_is_doubted_unless_it_turns_on_feet_that_slip(
    axis: int, acceleration: float, least: float
) -> None:
    """With T = 0.3 s, a velocity a T (1 − e^(−t/T)) is missing; 0.2 s after it has passed the bound it is told."""
    names = Plausibility(ROBOT, DT).names
    monitor, rng, first = ConsistencyMonitor(ROBOT, DT, names), np.random.default_rng(0), np.inf
    commanded, seen = np.zeros(ROBOT.nv), observed(ROBOT, robot=SimpleNamespace(v=np.zeros(ROBOT.nv)))
    commanded[axis] = acceleration
    for tick in range(300):
        values = 1e-3 * rng.normal(size=len(names))
        monitor.update(values, at_rest(ROBOT, tick * DT), seen, commanded)
        if any("commanded" in doubt for doubt in monitor.doubts):
            first = min(first, tick * DT)
    full = 0.3 * abs(acceleration)
    passed = -0.3 * np.log(1.0 - least / full) if full > least else np.inf
    assert first == pytest.approx(passed + 0.2, abs=0.11)  # it is looked at every 50 ms


@pytest.mark.parametrize("scale", [0.95, 1.05])
def test_an_encoder_with_an_offset_or_a_velocity_with_a_scale_does_not_drift(scale: float) -> None:
    assert not drifting(lambda time: 0.05 * (time > 1.0), scale=scale)


@pytest.mark.parametrize("ratio", [0.6, 1.8])
def test_a_clock_that_does_not_run_as_the_machine_does_is_named(ratio: float) -> None:
    """All joints move more or less than their velocities say, by one ratio."""
    assert {doubt for _, doubt in drifting(lambda time: 0.0, scale=1.0 / ratio)} == {
        f"the machine runs at {ratio:.1f} of real time"
    }


def test_a_force_that_stays_the_same_is_frozen_and_none_at_all_is_a_foot_in_the_air() -> None:
    names = Plausibility(ROBOT, DT).names
    monitor, rng = ConsistencyMonitor(ROBOT, DT, names), np.random.default_rng(0)
    for tick in range(4 * FROZEN_AFTER):
        values = 1e-3 * rng.normal(size=len(names))
        if tick > 2 * FROZEN_AFTER:
            values[-12:] = 0.0  # in the air but for
            values[-10] = 300.0  # a frozen force on the left sole
        monitor.update(values, at_rest(ROBOT, tick * DT), observed(ROBOT))
    assert [doubt for doubt in monitor.doubts if "frozen" in doubt] == ["force sensor of left_foot frozen"]


@pytest.mark.parametrize("kind", ["rounded", "sticks"])
def test_rounded_readings_that_come_to_rest_and_joints_that_stick_are_not_frozen(kind: str) -> None:
    """Those with noise that stand at once are."""
    names, na = Plausibility(ROBOT, DT).names, ROBOT.na
    monitor, rng = ConsistencyMonitor(ROBOT, DT, names), np.random.default_rng(0)
    shape, told = rng.uniform(0.5, 1.0, len(names)), []
    for tick in range(600):
        values = 0.3 * shape * np.exp(-0.02 * tick)
        values[na : 2 * na] = -0.02 / DT * values[:na]  # as the encoders move
        if kind == "rounded":
            values = np.round(values / 0.01) * 0.01
        else:
            values = values + 1e-3 * rng.normal(size=len(names))
            values[:na], values[na : 2 * na] = (
                (0.0, 0.0) if tick > 300 else (values[:na], values[na : 2 * na])
            )
        monitor.update(values, at_rest(ROBOT, tick * DT), observed(ROBOT))
        told += monitor.doubts
    assert not told
    for tick in range(600, 900):
        values = 1e-3 * rng.normal(size=len(names))
        if tick > 800:
            values[[3, na + 5]] = 0.01
        monitor.update(values, at_rest(ROBOT, tick * DT), observed(ROBOT))
    joints = ROBOT.joint_names
    assert monitor.doubts == (f"encoder of {joints[3]} frozen", f"velocity of {joints[5]} frozen")


def test_a_contradiction_that_begins_with_a_push_is_none() -> None:
    """Forces that are too low for the weight, from rest, and from the moment of a push on."""
    names, rng = Plausibility(ROBOT, DT).names, np.random.default_rng(0)
    for pushed in (False, True):
        monitor, told = ConsistencyMonitor(ROBOT, DT, names), []
        for tick in range(300):
            measurement = at_rest(ROBOT, tick * DT)
            if tick >= 100:
                measurement = replace(measurement, sole_wrench=np.zeros((2, 6)))
            if pushed and 97 <= tick < 115:
                aside = measurement.specific_force + np.array([0.0, 12.0, 0.0])
                measurement = replace(measurement, specific_force=aside)
            monitor.update(1e-3 * rng.normal(size=len(names)), measurement, observed(ROBOT))
            told += [measurement.time] * any("too low" in doubt for doubt in monitor.doubts)
        first = told[0] if told else None
        assert first is not None and (first < 100 * DT + 0.2) is not pushed


def told(shares: Any, feet: Any, shown: Any = None, rotations: Any = None) -> list[str]:
    """Return what is doubted within 0.4 s after 0.6 s of rest.

    Given are functions of the time since then: shares of the weight, velocities of the feet against the IMU, m/s,
    horizontal acceleration by the accelerometer, m/s², and the angular velocities that the feet seem to have, rad/s.
    """
    names, rng = Plausibility(ROBOT, DT).names, np.random.default_rng(0)
    monitor, found = ConsistencyMonitor(ROBOT, DT, names), []
    up = ROBOT.placement(ROBOT.imu_frame).rotation
    for tick in range(-120, 80):
        time = tick * DT
        wrench = np.zeros((2, 6))
        wrench[:, 2] = np.array(shares(time) if time >= 0.0 else (0.5, 0.5)) * ROBOT.mass * GRAVITY
        seen = observed(
            ROBOT,
            load_shares=shares(time) if time >= 0.0 else (0.5, 0.5),
            foot_velocities=feet(time) if time >= 0.0 else [(0.0, 0.0, 0.0)] * 2,
            foot_rotations=rotations(time) if rotations and time >= 0.0 else [(0.0, 0.0, 0.0)] * 2,
        )
        force = up.T @ [*(shown(time) if shown and time >= 0.0 else (0.0, 0.0)), GRAVITY]
        measurement = at_rest(ROBOT, time, sole_wrench=wrench, specific_force=force)
        monitor.update(1e-3 * rng.normal(size=len(names)), measurement, seen)
        found += monitor.doubts
    return list(dict.fromkeys(found))


def test_feet_tell_which_force_sensor_is_wrong() -> None:
    """One foot stands and the other one swings forward with 4 m/s², or stands as well."""

    def swings(time: float, axis: int = 0) -> list[tuple[float, ...]]:
        return [(0.0, 0.0, 0.0), tuple(min(4.0 * time, 0.8) * np.eye(3)[axis])]

    def rests(time: float) -> list[tuple[float, ...]]:
        return [(0.0, 0.0, 0.0)] * 2

    assert told(lambda _: (1.0, 0.0), swings) == []
    assert told(lambda _: (0.0, 1.0), swings) == ["force sensors swapped between the feet"]
    assert told(lambda _: (0.6, 0.0), rests) == ["force sensor of right_foot too low for the weight"]
    assert told(lambda _: (0.0, 0.6), rests) == ["force sensor of left_foot too low for the weight"]
    assert told(lambda _: (1.0, 0.0), rests) == []
    assert told(lambda _: (0.7, 0.0), swings) == []
    for axis in (1, 2):
        assert told(lambda _: (0.6, 0.0), lambda time, axis=axis: swings(time, axis)) == []


@pytest.mark.parametrize(
    ("rate", "carrying", "push"),
    [(0.1, (0.5, 0.5), 0.0), (-0.4, (0.5, 0.5), 6.0), (0.1, (1.0, 0.0), 6.0), (3.5, (1.0, 0.0), 0.0)]
    + [(-0.4, (0.0, 1.0), 0.0), (3.5, (0.0, 1.0), 6.0)],
)
def test_a_foot_that_turns_without_the_accelerometer_shows_a_wrong_gyroscope(
    rate: float, carrying: tuple[float, float], push: float
) -> None:
    """The IMU lies at h above the soles: by the gyroscope it moves with h ω, and by the accelerometer it does not.

    So it is while the robot is pushed aside, m/s², which legs and accelerometer both show, and while the other foot
    swings. Feet that turn truly, and speed up the IMU within 0.05 s, are no fault.
    """
    height = float(ROBOT.placement(ROBOT.imu_frame).translation[2])
    swings = [not share for share in carrying]

    def legs(time: float, reached: float) -> list[tuple[float, ...]]:
        own = -height * rate * reached, -push * time, 0.0
        return [(2.0, 0.3, 0.0) if swinging else own for swinging in swings]

    def doubts(rises: float) -> list[str]:
        reached = np.vectorize(lambda time: min(time / rises, 1.0) if rises else 1.0)
        found = told(
            lambda _: carrying,
            lambda time: legs(time, reached(time)),
            lambda time: (height * rate / rises if 0.0 < time <= rises else 0.0, push if time else 0.0),
            lambda time: [(0.0, -1.0 if swinging else rate * reached(time), 0.0) for swinging in swings],
        )
        # Two feet that stand and turn alike by 3.5 rad/s are named by a check of their own.
        return [doubt for doubt in found if doubt != "encoders and gyroscope disagree"]

    assert doubts(0.0) == ["gyroscope contradicts accelerometer and legs"]
    assert doubts(0.05) == []


@pytest.mark.parametrize(("after", "doubted"), [(0.02, False), (0.1, True)])
def test_the_blow_of_a_landing_is_no_fault_of_the_gyroscope(after: float, doubted: bool) -> None:
    """The left foot lands 0.1 s from now; some time later it turns as by a wrong gyroscope."""
    height = float(ROBOT.placement(ROBOT.imu_frame).translation[2])

    def turns(time: float) -> float:
        return 0.4 if time >= 0.1 + after else 0.0  # rad/s

    found = told(
        lambda time: (1.0, 0.0) if time >= 0.1 else (0.0, 1.0),
        lambda time: [(-height * turns(time), 0.0, 0.0), (0.0, 0.0, 0.0)],
        rotations=lambda time: [(0.0, turns(time), 0.0), (0.0, 0.0, 0.0)],
    )
    assert ("gyroscope contradicts accelerometer and legs" in found) is doubted


@pytest.mark.parametrize(("slap", "doubted"), [(-4.0, False), (3.0, False), (-0.6, True)])
def test_a_foot_that_slaps_down_is_no_fault_of_the_gyroscope(slap: float, doubted: bool) -> None:
    """The legs jump by 0.15 m/s as the foot has come down, and it rolls on slowly, as a gyroscope that is off."""
    names, rng, found = Plausibility(ROBOT, DT).names, np.random.default_rng(0), False
    monitor = ConsistencyMonitor(ROBOT, DT, names)
    up = ROBOT.placement(ROBOT.imu_frame).rotation
    for tick in range(-120, 60):
        rolls = 0.0 if tick < 0 else slap if tick < 10 else -0.6  # rad/s
        inertial = SimpleNamespace(
            rotation=up, correction=Correction(unexplained=0.15j if tick == 12 else 0j)
        )
        seen = observed(ROBOT, foot_rotations=[(0.0, 0.0, 0.0), (rolls, 0.0, 0.0)], inertial=inertial)
        monitor.update(1e-3 * rng.normal(size=len(names)), at_rest(ROBOT, tick * DT), seen)
        found |= bool(monitor.doubts)
    assert found is doubted
