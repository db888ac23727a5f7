"""Measurements of the plant: frames and signs against Pinocchio, forces against contacts, noise, latency."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples

from wbc.base.numbers import Array
from wbc.core.robot import GRAVITY
from wbc.core.signals import Command, Measurement
from wbc.feet import StiffnessActuator, foot
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.rigid import FlatFoot
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.robots import load
from wbc.sim import FootTest, Machine, PhysicsSettings, Plant, SensorNoise, SignalNoise
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.signals import Imu
from wbc.sim.rig.rig import Rig
from wbc.sim.simulation.sensors import REALISTIC, SensorChain, SensorVector

ROBOTS = ("hrp4_class", "talos", "g1")
FEW_SPHERES = FlatFoot(ContactSpheres(row_spacing=0.1))
SIGNALS = ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "sole_wrench")


def flat(measurement: Measurement) -> Array:
    return np.concatenate([getattr(measurement, name).ravel() for name in SIGNALS])


def swaying(plant: Plant, tick: int) -> Command:
    """A posture that keeps moving: all joints a little, at different frequencies."""
    command = plant.hold()
    assert command.joint_position is not None
    phase = np.arange(plant.robot.na)
    position = command.joint_position + 0.02 * np.sin(0.05 * tick * (1.0 + 0.1 * phase) + phase)
    return Command(command.joint_torque, position, command.joint_velocity)


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_an_imu_that_is_computed_reads_as_one_of_the_model_that_turns_fast(name: str) -> None:
    """Beside the origin of its link and, of talos, turned against it: 30 rad/s at 0.1 m are 90 m/s²."""
    model = Plant(load(name), visuals=False).model
    data, rng = mujoco.MjData(model), np.random.default_rng(3)
    robot = load(name).robot()
    places = RobotPlaces(model, robot)
    places.set_configuration(robot.half_sitting, data.qpos)
    data.qpos[places.base_qpos + 2] += 3.0
    data.qvel[places.base_dof : places.base_dof + 6] = rng.normal(0.0, 1.0, 6) * [1, 1, 1, 20, 20, 20]
    mujoco.mj_forward(model, data)
    own = Imu(places, None, None)
    assert np.linalg.norm(places.imu.translation) > 0.08 and own.gyroscope is not None
    assert own.accelerometer is not None
    rates, force = own.rates(data).copy(), own.specific_force(data).copy()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    computed = Imu(RobotPlaces(model, robot), None, None)
    assert computed.gyroscope is None and computed.accelerometer is None
    np.testing.assert_allclose(computed.rates(data), rates, atol=1e-9)
    np.testing.assert_allclose(computed.specific_force(data), force, atol=1e-6)


@pytest.mark.parametrize("name", by_default(ROBOTS, "g1"))
@pytest.mark.parametrize("gravity", [0.0, 9.80665])
def test_imu_and_encoders_agree_with_pinocchio(name: str, gravity: float) -> None:
    """In free flight at a random state, with random torques, against frame velocity and acceleration."""
    plant = Plant(
        load(name),
        timestep=1e-6,
        control_period=1e-6,
        foot=FEW_SPHERES,
        physics=PhysicsSettings(gravity=gravity),
        visuals=False,
    )
    robot, rng = plant.robot, np.random.default_rng(0)
    model, data = robot.model, robot.model.createData()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    imu = robot.frame_id(robot.imu_frame)
    q = np.array(robot.half_sitting)
    q[2] += 3.0
    q[3:7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    v = rng.normal(size=robot.nv)
    torque = 0.2 * robot.torque_limit * rng.uniform(-1.0, 1.0, robot.na)
    plant.reset(q, velocity=v)
    plant.step(Command(torque))
    measured = plant.measure()
    a = pin.aba(model, data, q, v, np.concatenate([np.zeros(6), torque]))
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    rotation = data.oMf[imu].rotation
    omega = pin.getFrameVelocity(model, data, imu, pin.LOCAL).angular
    acceleration = pin.getFrameClassicalAcceleration(model, data, imu, pin.LOCAL).linear
    force = acceleration - rotation.T @ model.gravity.linear
    size = max(1.0, float(np.abs(force).max()))
    np.testing.assert_allclose(measured.angular_velocity, omega, atol=1e-2)
    np.testing.assert_allclose(measured.specific_force, force, atol=1e-4 * size)
    np.testing.assert_allclose(measured.joint_position, q[7:], atol=1e-5)
    np.testing.assert_allclose(measured.joint_velocity, v[6:] + plant.timestep * a[6:], atol=1e-4)


@pytest.mark.parametrize("name", by_default(ROBOTS, "g1"))
def test_sole_wrench_is_that_of_the_contacts(name: str) -> None:
    """The force sensor (internal forces of the tree) against the sum over contact points, while swaying."""
    plant = Plant(load(name), foot=FEW_SPHERES, control_period=0.001, visuals=False)
    loads = []
    for tick in range(60):
        plant.step(swaying(plant, tick))
        measured, truth = plant.measure().sole_wrench, plant.truth()
        np.testing.assert_allclose(measured, truth.sole_wrench, atol=1e-6 * np.abs(measured).max())
        loads.append(measured[:, 2])
    assert np.ptp(loads, axis=0).min() > 5.0


def test_forces_are_means_over_the_control_period() -> None:
    """A plant that samples five times as often, averaged; and impulse is change of momentum with nothing missing."""
    slow = Plant(load("g1"), foot=FEW_SPHERES, visuals=False)
    fast = Plant(load("g1"), foot=FEW_SPHERES, control_period=0.001, visuals=False)
    for tick in range(10):
        command, wrenches, accelerations = swaying(slow, tick), [], []
        slow.step(command)
        for _ in range(5):
            fast.step(command)
            wrenches.append(fast.measure().sole_wrench)
            accelerations.append(fast.measure().specific_force)
        np.testing.assert_allclose(
            slow.measure().sole_wrench, np.mean(wrenches, axis=0), rtol=1e-12, atol=1e-9
        )
        np.testing.assert_allclose(slow.measure().specific_force, np.mean(accelerations, axis=0), rtol=1e-12)
        assert np.ptp(wrenches, axis=0).max() > 1e-3  # there is something to average


def run(plant: Plant, ticks: int, *, look: bool = False) -> Array:
    """A run in which the measurements act on the motion; all of it in one array."""
    rows = []
    for tick in range(ticks):
        measured = plant.measure()
        if look:
            plant.truth()
            assert plant.measure() is measured
        command = swaying(plant, tick)
        feedback = 1e-3 * measured.angular_velocity[1] + 1e-6 * measured.sole_wrench[0, 2]
        if tick == 10:
            plant.push("torso", [20.0, 5.0, 0.0], 0.0333)
        assert command.joint_position is not None
        plant.step(Command(command.joint_torque, command.joint_position + feedback, command.joint_velocity))
        rows.append(np.concatenate([plant.data.qpos, plant.data.qvel, flat(measured)]))
    return np.array(rows)


def test_one_seed_repeats_everything_bit_for_bit() -> None:
    plant = Plant(load("hrp4_class"), noise="realistic", seed=7, visuals=False)
    once = run(plant, 15)
    plant.reset(seed=8)
    other = run(plant, 15, look=True)
    assert not np.array_equal(once[0, -30:], other[0, -30:])
    plant.reset(seed=7)
    assert once.tobytes() == run(plant, 15, look=True).tobytes()
    again = Plant(load("hrp4_class"), noise="realistic", seed=7, visuals=False)
    assert once.tobytes() == run(again, 15).tobytes()


def test_noise_has_the_statistics_it_was_given() -> None:
    noise = SensorNoise(
        joint_position=SignalNoise(quantum=0.01),
        joint_velocity=SignalNoise(std=0.2, bias_std=1.0),
        angular_velocity=SignalNoise(bias_std=0.5),
        sole_force=SignalNoise(std=3.0),
    )
    chain = SensorChain(noise, SensorVector(50, 2, Machine()), timestep=0.001)
    truth = np.random.default_rng(0).normal(size=chain.size)
    chain.reset(truth, seed=1)
    error = np.array([chain.read(truth) for _ in range(2000)]) - truth
    position, velocity = error[:, :50], error[:, 50:100]
    gyro, accelerometer, wrench = error[:, 100:103], error[:, 103:106], error[:, 106:].reshape(-1, 2, 6)
    assert np.abs(position).max() <= 0.005 + 1e-12 and np.ptp(position, axis=0).max() == 0.0
    np.testing.assert_allclose(np.remainder(truth[:50] + position[0] + 1e-9, 0.01), 0.0, atol=1e-8)
    assert velocity.std(axis=0) == pytest.approx(np.full(50, 0.2), rel=0.1)
    assert velocity.mean(axis=0).std() == pytest.approx(1.0, rel=0.4)
    assert np.ptp(gyro, axis=0).max() < 1e-12 and np.abs(gyro[0]).min() > 1e-3
    np.testing.assert_array_equal(accelerometer, 0.0)
    assert wrench[:, :, :3].std(axis=0) == pytest.approx(np.full((2, 3), 3.0), rel=0.1)
    np.testing.assert_array_equal(wrench[:, :, 3:], 0.0)
    # White: one reading says nothing of the next, one channel nothing of another.
    white = velocity - velocity.mean(axis=0)
    assert abs((white[1:] * white[:-1]).mean()) < 0.02 * 0.2**2 * 5
    assert abs((white[:, 0] * white[:, 1]).mean()) < 0.1 * 0.2**2


def test_errors_arise_in_the_order_of_a_real_sensor() -> None:
    """The sum of value, bias and noise is rounded to the resolution: every reading is a multiple of it."""
    noise = SensorNoise(angular_velocity=SignalNoise(std=0.03, bias_std=0.5, quantum=0.01))
    chain = SensorChain(noise, SensorVector(2, 1, Machine()), timestep=0.001)
    truth = np.full(chain.size, 0.1234)
    chain.reset(truth, seed=3)
    read = np.array([chain.read(truth) for _ in range(500)])[:, 4:7]
    np.testing.assert_allclose(read / 0.01, np.round(read / 0.01), atol=1e-6)
    assert read.std(axis=0) == pytest.approx(np.full(3, math.hypot(0.03, 0.01 / math.sqrt(12.0))), rel=0.15)
    assert np.ptp(read.mean(axis=0)) > 0.05  # each channel has a bias of its own


@given(st.lists(st.integers(0, 6), min_size=6, max_size=6), st.integers(1, 16), st.integers(0, 3))
@examples(60)
def test_every_signal_is_read_at_its_own_age(ages: list[int], steps: int, delay: int) -> None:
    """Signals are pushed where the chain asks for them, as a loop does; ages are whole physics steps."""
    names = (
        "joint_position",
        "joint_velocity",
        "angular_velocity",
        "specific_force",
        "sole_force",
        "sole_moment",
    )
    noise = SensorNoise(**{n: SignalNoise(latency=0.001 * age) for n, age in zip(names, ages, strict=True)})
    chain = SensorChain(
        noise, SensorVector(2, 2, Machine()), timestep=0.001, steps=steps, delay=0.001 * delay
    )
    sizes = [2, 2, 3, 3] + [3, 3] * 2
    each = np.repeat([*ages[:4], *ages[4:], *ages[4:]], sizes) + delay

    def truth(step: int) -> Array:
        return 1000.0 * max(step, 0) + np.arange(chain.size)

    chain.reset(truth(0), seed=0)
    for period in range(8):
        now = (period + 1) * steps
        for left in reversed(range(steps)):
            if left in chain.kept:
                chain.push(truth(now - left))
        expected = 1000.0 * np.maximum(now - each, 0) + np.arange(chain.size)
        np.testing.assert_array_equal(chain.read(truth(now)), expected)


def test_realistic_sensors_have_the_numbers_of_their_sources() -> None:
    """Encoders of 18 bits; a motor encoder of 13 bits behind a gear of 25 in 1 ms; data sheets of the IMU."""
    joint, speed = REALISTIC.joint_position, REALISTIC.joint_velocity
    assert joint.quantum == pytest.approx(math.tau / 2**18)
    # The difference of two readings that are rounded evenly has a variance of two twelfths of a quantum squared.
    assert speed.std == pytest.approx(math.tau / 2**13 / 25.0 / 1e-3 * math.sqrt(2.0 / 12.0), rel=0.01)
    gyro = REALISTIC.angular_velocity
    assert gyro.std == pytest.approx(math.radians(0.007) * math.sqrt(255.0), rel=0.05)
    assert gyro.bias_std == pytest.approx(10.0 * math.radians(10.0) / 3600.0, rel=0.05)
    assert REALISTIC.specific_force.bias_std == pytest.approx(5e-3 * GRAVITY, rel=0.05)
    weight = load("hrp4_class").robot().mass * GRAVITY
    assert weight == pytest.approx(390.0, rel=0.03)  # what one of its feet carries, as docs/feet.md says
    half = 0.5 * weight
    assert 1e3 * REALISTIC.sole_moment.std / half == pytest.approx(0.3, abs=0.05)  # mm
    assert 1e3 * REALISTIC.sole_moment.bias_std / half == pytest.approx(0.5, abs=0.05)
    latencies = {getattr(REALISTIC, each.name).latency for each in fields(REALISTIC)}
    assert latencies == {0.001}  # one cycle of a 1 kHz field bus


AGES = {
    "joint_position": 2,
    "joint_velocity": 4,
    "angular_velocity": 3,
    "specific_force": 1,
    "sole_wrench": 2,
}
"""Ages of signals, none of which is fresh, physics steps; a control period has five."""

LATER = AGES | {"joint_velocity": 7, "sole_wrench": 12}


@pytest.mark.parametrize(
    ("ages", "rounded_down"),
    [
        ({"joint_position": 3, "sole_wrench": 3}, 0.0009),
        (LATER, 0.0),
        pytest.param({"joint_position": 0}, 0.0, marks=pytest.mark.slow),
        pytest.param(AGES, 0.0, marks=pytest.mark.slow),  # the youngest readings are not even sampled
    ],
)
def test_latency_shows_the_past(ages: dict[str, int], rounded_down: float) -> None:
    """A slow plant with latencies against a fast one whose history is kept; each signal has its own age.

    Accelerometer and forces are means over the five steps before.
    """
    late_by = {name: SignalNoise(latency=0.001 * age - rounded_down) for name, age in ages.items() if age}
    wrench = late_by.pop("sole_wrench", SignalNoise())
    noise = SensorNoise(**late_by, sole_force=wrench, sole_moment=wrench)
    late = Plant(load("g1"), foot=FEW_SPHERES, noise=noise, visuals=False)
    fresh = Plant(load("g1"), foot=FEW_SPHERES, control_period=0.001, visuals=False)
    past = [fresh.measure()]
    for tick in range(8):
        if tick == 3:
            for plant in (late, fresh):
                plant.push("torso", (40.0, 0.0, 0.0), 0.007)
        command = swaying(late, 10 * tick)
        late.step(command)
        for _ in range(5):
            fresh.step(command)
            past.append(fresh.measure())
        measured = late.measure()
        for name in SIGNALS:
            mean = 5 if name in ("specific_force", "sole_wrench") else 1
            first = len(past) - 1 - ages.get(name, 0)
            then = np.mean([getattr(past[max(0, first - i)], name) for i in range(mean)], axis=0)
            np.testing.assert_allclose(getattr(measured, name), then, rtol=1e-12, atol=1e-9, err_msg=name)
        assert measured.time == pytest.approx(0.005 * (tick + 1))


@pytest.mark.parametrize("delay", [0.005, 0.013])
def test_a_delay_of_commands_delays_the_soles_as_it_delays_the_joints(delay: float) -> None:
    """At ten decades a second the stiffness has gone from 5 to 60 Nm/rad, 1.08 decades, 0.108 s after the delay."""
    foot = VariableStiffnessFoot(stiffness=5.0, actuator=StiffnessActuator(10.0, 0.0))
    plant = Plant(load("hrp4_class"), foot=foot, machine=Machine(command_delay=delay), visuals=False)
    command = replace(plant.hold(), sole_stiffness=np.array([60.0, 5.0]))
    for tick in range(1, 40):
        plant.step(command)
        moved = 5.0 * 10.0 ** (10.0 * max(0.0, 0.005 * tick - delay))
        np.testing.assert_allclose(plant.measure().sole_stiffness, [min(moved, 60.0), 5.0], rtol=1e-9)


def test_hinges_of_another_stiffness_keep_their_damping_in_the_plant_as_in_the_rig() -> None:
    design = foot("soft", stiffness=5.0, front_stiffness=400.0, damping_ratio=0.5)
    rig, plant = Rig(FootTest(design)), Plant(load("hrp4_class"), foot=design, visuals=False)
    for model, parts in ((rig.model, rig.foot), (plant.model, plant.feet[0])):
        found = [model.dof_damping[model.joint(name).dofadr[0]] for name in parts.sole_joints]
        stiff = [model.jnt_stiffness[model.joint(name).id] for name in parts.sole_joints]
        np.testing.assert_allclose(found, [design.damping_at(each) for each in stiff], rtol=1e-12)
        assert max(found) > 8.0 * min(found)


def test_a_new_stiffness_acts_at_once_as_if_compiled_in() -> None:
    """From one bent state: a plant told to be stiff against a plant that was built stiff."""
    actuator = StiffnessActuator.instantaneous()
    told = Plant(
        load("hrp4_class"), foot=VariableStiffnessFoot(stiffness=5.0, actuator=actuator), visuals=False
    )
    built = Plant(
        load("hrp4_class"), foot=VariableStiffnessFoot(stiffness=60.0, actuator=actuator), visuals=False
    )
    for tick in range(30):
        told.step(swaying(told, tick))
    for name in ("qpos", "qvel", "qacc_warmstart"):
        getattr(built.data, name)[:] = getattr(told.data, name)
    mujoco.mj_step1(built.model, built.data)
    soft = built.data.qpos.copy()
    command = swaying(told, 30)
    told.step(replace(command, sole_stiffness=np.array([60.0, 60.0])))
    built.step(command)
    np.testing.assert_allclose(told.data.qpos, built.data.qpos, atol=1e-13)
    np.testing.assert_allclose(told.measure().sole_wrench, built.measure().sole_wrench, atol=1e-9)
    assert np.abs(built.data.qpos - soft).max() > 1e-6
