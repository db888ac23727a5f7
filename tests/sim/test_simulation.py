"""Behaviour of every simulation: MuJoCo with our feet, a user's model, another engine; a new one joins `KINDS`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign import KINDS as ACTUATORS
from foreign import foreign_model
from in_air import InAir

import wbc
from wbc.base.errors import InputError, MeasurementError
from wbc.core.signals import Command
from wbc.sim import DivergedError, Machine, MujocoLoop, Plant, SharedPlant
from wbc.sim.simulation.machine import steps_per_tick, whole_steps
from wbc.sim.simulation.simulation import Simulation
from wbc.sim.trial.loops import MEMBERS, trial_loop

DESCRIPTION = wbc.load_robot("hrp4_class")
NA = len(DESCRIPTION.joint_names)
LIMP = Command(np.zeros(NA))
LATE = Machine(command_delay=0.004, measurement_delay=0.003, torque_sensors=True)


def own(**options: Any) -> MujocoLoop:
    return MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, "motor"), prefix="mine/", **options)


def dart(**options: Any) -> Simulation:
    pytest.importorskip("dartpy")
    place = Path(__file__).parents[2] / "examples" / "other_engine.py"
    made: Simulation = trial_loop(f"{place}:DartLoop").factory(DESCRIPTION, **options)
    return made


KINDS: dict[str, Callable[..., Simulation]] = {
    "plant": lambda **options: Plant(DESCRIPTION, control_period=0.002, visuals=False, **options),
    "mujoco": own,
    "engine": lambda **options: InAir(DESCRIPTION, **options),
    "dart": dart,
}


@pytest.fixture(params=KINDS)
def make(request: pytest.FixtureRequest) -> Callable[..., Simulation]:
    return KINDS[request.param]


def aloft(simulation: Simulation, height: float = 0.3) -> np.ndarray:
    """A configuration in the air, where nothing but pushes moves the centre of mass aside."""
    q = simulation.on_ground(simulation.robot.half_sitting)
    q[2] += height
    return q


def test_hold_and_reset_mean_the_same_in_every_simulation(make: Callable[..., Simulation]) -> None:
    """`hold` is the posture of the last reset wherever the joints are; `reset` restarts time, motion and pushes."""
    simulation = make()
    q = aloft(simulation)
    np.testing.assert_allclose(simulation.hold().joint_position, q[7:], atol=1e-12)
    q[7:] += 0.05
    q[3:7] *= 1.0 + 1e-7  # within what counts as a unit quaternion
    simulation.reset(q)
    np.testing.assert_array_equal(simulation.hold().joint_position, q[7:])
    simulation.push("torso", [300.0, 0.0, 0.0], 1.0)
    for _ in range(30):
        simulation.step(LIMP)
    assert simulation.time == pytest.approx(0.06) and np.abs(simulation.joint_position - q[7:]).max() > 1e-3
    np.testing.assert_array_equal(simulation.hold().joint_position, q[7:])
    simulation.hold().joint_position[0] = 9.0
    np.testing.assert_array_equal(simulation.hold().joint_position, q[7:])
    simulation.reset(q)
    assert simulation.time == simulation.measure().time == simulation.truth().time == 0.0
    first = simulation.truth()
    assert not first.v.any() and np.linalg.norm(first.q[3:7]) == pytest.approx(1.0, abs=1e-12)
    simulation.step(simulation.hold())
    assert simulation.time == pytest.approx(0.002)
    assert abs(simulation.truth().com_velocity[0]) < 1e-4, "the push is over: it would give 0.015 m/s"


@pytest.mark.parametrize("kind", ["plant", "mujoco"])
def test_a_robot_starts_with_the_velocity_that_it_is_given(kind: str) -> None:
    simulation = KINDS[kind]()
    v = np.random.default_rng(0).normal(size=simulation.robot.nv)
    simulation.reset(aloft(simulation), velocity=v)
    np.testing.assert_allclose(simulation.truth().v, v, atol=1e-9)
    np.testing.assert_allclose(simulation.measure().joint_velocity, v[6:], atol=1e-12)
    simulation.reset()
    assert not simulation.truth().v.any()


def test_an_engine_that_places_robots_at_rest_refuses_a_velocity() -> None:
    simulation = InAir(DESCRIPTION)
    simulation.step(LIMP)
    with pytest.raises(InputError, match="at rest"):
        simulation.reset(velocity=np.ones(simulation.robot.nv))
    assert simulation.time > 0.0


BAD_STARTS: dict[str, Callable[[np.ndarray], Any]] = {
    "shape": lambda q: q[1:],
    "finite": lambda q: np.where(np.arange(q.size) == 9, np.nan, q),
    "quaternion": lambda q: np.where(np.arange(q.size) == 3, 0.5, q),
    "joint": lambda q: np.where(np.arange(q.size) == 9, 40.0, q),
}
BAD_PERIODS: tuple[Any, ...] = (float("nan"), float("inf"), 0.0, -0.002, "x", 0.003)
BAD_COMMANDS: tuple[Any, ...] = (
    LIMP.joint_torque,
    Command(np.zeros(3)),
    Command(np.full(NA, np.nan)),
    replace(LIMP, kd=-np.ones(NA)),
    replace(LIMP, kp=np.ones(NA)),
    replace(LIMP, sole_stiffness=np.ones(2)),
    replace(LIMP, released=np.ones(3, dtype=bool)),
    replace(LIMP, released=np.ones(NA)),
    replace(LIMP, released="all"),
)


def test_starts_and_commands_that_are_none_are_refused_and_nothing_changes(
    make: Callable[..., Simulation],
) -> None:
    simulation = make(seed=3)
    simulation.step(LIMP)
    before, seen = simulation.truth(), simulation.measure()
    for what, spoil in BAD_STARTS.items():
        with pytest.raises(InputError, match=what):
            simulation.reset(spoil(aloft(simulation)), seed=4)
    for period in BAD_PERIODS:  # also one for another period
        with pytest.raises(InputError, match="period"):
            simulation.step(replace(simulation.hold(), period=period))
    for command in BAD_COMMANDS:
        with pytest.raises(InputError):
            simulation.step(command)
    assert simulation.seed == 3 and simulation.truth() is before and simulation.measure() is seen


def test_a_simulation_that_has_diverged_goes_on_after_a_reset_alone(make: Callable[..., Simulation]) -> None:
    simulation = make()
    simulation.diverged = "made up"
    with pytest.raises(DivergedError, match="made up"):
        simulation.step(simulation.hold())
    with pytest.raises(MeasurementError, match="made up"):
        simulation.measure()
    simulation.reset()
    simulation.step(simulation.hold())
    assert simulation.diverged is None and simulation.measure().time == pytest.approx(0.002)


def test_gains_of_zero_without_a_reference_are_torque_control(make: Callable[..., Simulation]) -> None:
    zero = np.zeros(NA)
    states, simulation = [], make()
    for command in (LIMP, Command(zero, joint_velocity=zero, kp=zero, kd=zero)):
        simulation.reset()
        simulation.step(command)
        states.append(simulation.truth().q)
    np.testing.assert_array_equal(*states)


def test_a_push_gives_its_impulse_wherever_it_acts(make: Callable[..., Simulation]) -> None:
    simulation, force, duration = make(), np.array([200.0, -300.0, 0.0]), 0.0173
    simulation.reset(aloft(simulation))
    simulation.push("torso", force, duration)
    simulation.push("right_foot", force, duration, at=[0.1, 0.0, 0.0])
    for _ in range(10):
        simulation.step(LIMP)
    gained = simulation.truth().com_velocity
    mass = simulation.robot.mass
    np.testing.assert_allclose(gained[:2], 2.0 * duration * force[:2] / mass, rtol=5e-3, atol=2e-3)
    simulation.step(LIMP)
    np.testing.assert_allclose(simulation.truth().com_velocity[:2], gained[:2], atol=2e-3)  # it is over


def test_readings_are_late_by_the_delay_and_commands_by_theirs(make: Callable[..., Simulation]) -> None:
    """Joints and gyroscope of a late machine are those of a prompt one, 3 ms ago: between two ticks of 2 ms."""
    prompt, late = make(machine=replace(LATE, measurement_delay=0.0)), make(machine=LATE)
    readings, times = [], []
    for simulation in (prompt, late):
        simulation.reset(aloft(simulation))
    for tick in range(10):
        command = Command(np.full(NA, 1.0 if tick >= 3 else 0.0))
        prompt.step(command)
        late.step(command)
        command.joint_torque[:] = 9.0  # of a controller that uses its array again
        readings.append(prompt.measure())
        times.append(late.measure())
    for tick in range(4, 10):
        assert times[tick].time == pytest.approx(readings[tick].time - 0.003, abs=1e-12)
        between = 0.5 * (readings[tick - 2].joint_position + readings[tick - 1].joint_position)
        np.testing.assert_allclose(times[tick].joint_position, between, atol=2e-5)
    torques = [reading.joint_torque for reading in readings]
    assert all(abs(torque).max() < 1e-9 for torque in torques[2:5])
    assert all(torque == pytest.approx(1.0, abs=1e-6) for torque in torques[5:])


def readings(simulation: Simulation) -> np.ndarray:
    found = []
    for _ in range(3):
        simulation.step(simulation.hold())
        measured = simulation.measure()
        imu = measured.angular_velocity, measured.specific_force
        found.append(np.concatenate([measured.joint_position, *imu, [measured.time]]))
    return np.array(found)


def test_sensor_errors_follow_from_the_seed(make: Callable[..., Simulation]) -> None:
    one, other = make(noise="realistic", seed=5), make(noise="realistic", seed=6)
    first = readings(one)
    assert not np.array_equal(first, readings(other)) and np.ptp(first[:, :NA] - one.joint_position) > 0.0
    other.reset(seed=5)
    assert one.seed == other.seed == 5
    np.testing.assert_allclose(first, readings(other), atol=1e-9)  # those of the other seed are off by 1e-4


@pytest.mark.parametrize("kind", [*KINDS, *(f"own {kind}" for kind in ACTUATORS), "late position"])
def test_a_reset_simulation_runs_as_a_new_one(kind: str) -> None:
    """Bit for bit: nothing is left of commands, pushes, loads, speeds or time, in models with actuators of any kind.

    Nor is anything left after a divergence, nor of what actuators and sensors with a delay remember.
    """
    if kind in KINDS:
        simulation = KINDS[kind]()
    else:
        which, _, actuators = kind.partition(" ")
        model = foreign_model(DESCRIPTION, actuators, delay=0.004 if which == "late" else 0.0)
        simulation = MujocoLoop(DESCRIPTION, model, prefix="mine/")
    data = getattr(simulation, "data", None)
    things = None if data is None else (data.qpos.copy(), data.qvel.copy())
    first = readings(simulation)
    for diverges in (False, True):
        simulation.push("torso", [50.0, 0.0, 0.0], 1.0)
        for _ in range(7):
            simulation.step(LIMP)
        if diverges and data is not None:
            data.qvel[:] = np.nan
            simulation.step(LIMP)
            assert simulation.diverged
        if things is not None:  # those of somebody else's model stay where they are
            data.qpos[:], data.qvel[:] = things
        simulation.reset()
        np.testing.assert_array_equal(readings(simulation), first)


def test_readings_and_truth_are_of_one_instant_and_nobody_writes_into_them(
    make: Callable[..., Simulation],
) -> None:
    simulation = make()
    assert [name for name in MEMBERS if not hasattr(simulation, name)] == []
    simulation.reset(aloft(simulation))
    for _ in range(5):
        simulation.step(simulation.hold())
    measured, truth = simulation.measure(), simulation.truth()
    assert simulation.measure() is measured and simulation.truth() is truth
    assert measured.time == truth.time == simulation.time == pytest.approx(0.01)
    for handed in (measured.joint_position, truth.q, truth.sole_wrench, truth.contact_force):
        with pytest.raises(ValueError, match="read-only"):
            handed[...] = 1.0
    for part in simulation.sole_poses[0]:
        with suppress(ValueError):  # a copy, or read-only
            part[...] = 7.0
    np.testing.assert_array_equal(simulation.joint_position, truth.q[7:])
    np.testing.assert_array_equal(measured.joint_position, truth.q[7:])
    np.testing.assert_array_equal(simulation.joint_velocity, truth.v[6:])
    np.testing.assert_array_equal(simulation.joint_torque, truth.joint_torque)
    assert simulation.base_pose == pytest.approx(truth.q[:7], abs=1e-12)
    assert simulation.com_height == pytest.approx(truth.com[2], abs=1e-12)
    robot = simulation.robot.clone()
    robot.update(truth.q, truth.v)
    np.testing.assert_allclose(robot.com, truth.com, atol=2e-3)  # the plant's feet have a mass of their own
    for side, sole in enumerate(robot.soles):
        centre, rotation = simulation.sole_pose(side)
        np.testing.assert_allclose(centre, robot.placement(sole.frame).translation, atol=1e-6)
        np.testing.assert_allclose(rotation, robot.placement(sole.frame).rotation, atol=1e-6)


def test_a_configuration_on_the_ground_has_its_lowest_sole_there(make: Callable[..., Simulation]) -> None:
    simulation = make()
    simulation.reset(simulation.on_ground(aloft(simulation)))
    lowest = min(float(simulation.sole_pose(side)[0][2]) for side in (0, 1))
    assert abs(lowest) < 1e-5 and simulation.base_pose[:3] == pytest.approx(simulation.truth().q[:3])


@pytest.mark.parametrize("kind", ["plant", "mujoco"])
def test_a_model_whose_physics_step_is_changed_later_is_refused(kind: str) -> None:
    simulation: Any = KINDS[kind]()
    simulation.model.opt.timestep *= 2.0
    with pytest.raises(InputError, match=r"is 0.001 s, and that of its model has become 0.002 s"):
        simulation.step(simulation.hold())
    assert simulation.time == simulation.data.time == 0.0


def test_pushes_of_several_robots_end_with_a_reset() -> None:
    shared = SharedPlant({"one": DESCRIPTION}, control_period=0.002)
    robot = shared.loops["one"]
    robot.push("torso", [100.0, 0.0, 0.0], 1.0)
    shared.step({"one": robot.hold()})
    assert np.abs(shared.data.xfrc_applied).max() == pytest.approx(100.0)
    shared.reset()
    shared.step({"one": robot.hold()})
    assert not shared.data.xfrc_applied.any()


def test_a_push_acts_for_its_time_and_with_a_share_of_its_force_in_its_last_step() -> None:
    """For 2.5 steps of 2 ms: twice in full, then by half; its point is that of the frame, seen from the body."""
    loop, force, acted = InAir("hrp4_class", timestep=0.002), np.array([10.0, -4.0, 2.0]), []
    loop.advance = lambda torque, pushes: acted.append(pushes)  # type: ignore[method-assign, func-returns-value]
    link, place = loop.description.attachment("left_sole")
    loop.push("left_sole", force, 0.005, [0.01, 0.0, 0.0])
    loop.push("torso", 2.0 * force, 0.002)
    for _ in range(4):
        loop.step(loop.hold())
    assert [len(pushes) for pushes in acted] == [2, 1, 1, 0]
    for (push, *_), share in zip(acted[:3], (1.0, 1.0, 0.5), strict=True):
        assert push.link == link and push.point == pytest.approx(place.act(np.array([0.01, 0.0, 0.0])))
        np.testing.assert_allclose(push.force, share * force)
    np.testing.assert_allclose(acted[0][1].force, 2.0 * force)
    acted.clear()
    loop.push("torso", force, 0.006)  # three steps, but for rounding
    for _ in range(4):
        loop.step(loop.hold())
    assert [len(pushes) for pushes in acted] == [1, 1, 1, 0]


def test_a_time_is_as_many_steps_as_cover_it() -> None:
    times = ((0.0, 0.001), (0.003, 0.001), (0.0031, 0.001), (0.0029, 0.001), (0.1, 0.002), (0.0001, 0.002))
    assert [whole_steps(time, step) for time, step in times] == [0, 3, 4, 3, 50, 1]


def test_a_control_period_is_a_whole_multiple_of_the_step() -> None:
    periods = ((0.005, 0.001), (0.002, 0.002), (0.006, 0.0015), (0.1, 0.0001))
    assert [steps_per_tick(period, step) for period, step in periods] == [5, 1, 4, 1000]
    for period, step, near in ((0.005, 0.002, "0.004"), (0.001, 0.002, "0.002"), (0.0049, 0.001, "0.005")):
        with pytest.raises(InputError, match=f"nearest is {near} s"):
            steps_per_tick(period, step)


def test_a_command_is_for_the_period_of_its_simulation_or_a_multiple_of_it() -> None:
    plant = Plant("hrp4_class", control_period=0.004, visuals=False)
    zero = np.zeros(plant.robot.na)
    for period in (None, 0.004, 0.008, 0.02):
        plant.step(Command(zero, period=period))
    before = plant.time
    for period in (0.002, 0.005, 0.006, 0.003, 0.0041):
        with pytest.raises(InputError, match=f"period of {1e3 * period:g} ms.* by 4 ms"):
            plant.step(Command(zero, period=period))
    assert plant.time == before == pytest.approx(0.016)
