"""A simulated robot at the end of a wire: whom it obeys, the band it hangs at, and its time, by a clock of the test."""

from __future__ import annotations

import copy
import math
from functools import cache

import mujoco
import numpy as np
import pytest
from hanging import SimulatedTime

from wbc.base.errors import InputError, MeasurementError
from wbc.core.signals import Command, Measurement
from wbc.robots import load
from wbc.sim import DivergedError, MujocoLoop, Plant, RobotServer

DESCRIPTION = load("hrp4_class")
NA = len(DESCRIPTION.joint_names)
COMMAND = Command(np.full(NA, 0.1))


class Wire:
    """The driver's orders, and what it has got."""

    damped = False
    command: Command | None = None

    def __init__(self) -> None:
        self.sent: list[Measurement] = []

    def receive(self) -> tuple[bool, Command | None]:
        return self.damped, self.command

    def send(self, measurement: Measurement) -> None:
        self.sent.append(measurement)


@cache
def plain() -> mujoco.MjModel:
    return Plant(DESCRIPTION, visuals=False).model


@pytest.fixture
def loop() -> MujocoLoop:
    return MujocoLoop(DESCRIPTION, copy.copy(plain()), control_period=0.005)


def test_a_command_acts_until_its_time_is_over_or_damping_is_asked_for(loop: MujocoLoop) -> None:
    clock, wire = SimulatedTime(), Wire()
    server = RobotServer(loop, wire, watchdog=0.012, clock=clock)
    for command, after, damped in (
        (COMMAND, 0.0, False),
        (None, 0.006, False),
        (None, 0.002, True),  # it would end within the period
        (COMMAND, 0.0, False),
        (Command(np.zeros(3)), 0.0, True),
    ):
        wire.command, clock.time = command, clock.time + after
        server.step()
        assert server.damped is damped
    wire.command, wire.damped = COMMAND, True
    server.step()
    assert server.damped


@pytest.mark.parametrize(
    ("time", "lowered", "share"), [(1.0, 0.0, 1.0), (1.5, 0.025, 1.0), (2.5, 0.05, 0.5), (3.01, 0.0, 0.0)]
)
def test_the_band_is_a_damped_spring_that_is_let_down_in_a_second_and_fades_in_another(
    loop: MujocoLoop, monkeypatch: pytest.MonkeyPatch, time: float, lowered: float, share: float
) -> None:
    """400 N/m and 40 Ns/m for each kilogram, from 50 mm above the place at the start, beside all other forces."""
    root = loop.places.root
    server, data = RobotServer(loop, Wire(), band=1.0), loop.data
    top, mass = data.xpos[root].copy() + [0.0, 0.0, 0.05], loop.robot.mass
    server.step()  # it hangs where it is then
    rng = np.random.default_rng(0)
    data.qpos[loop.places.base_qpos : loop.places.base_qpos + 3] += [0.02, -0.03, 0.01]
    lean = np.array([math.cos(0.1), 0.6 * math.sin(0.1), -0.8 * math.sin(0.1), 0.0])  # of 0.2 rad
    data.qpos[loop.places.base_qpos + 3 : loop.places.base_qpos + 7] = lean
    data.qvel[loop.places.base_dof : loop.places.base_dof + 6] = rng.normal(0.0, 0.1, 6)
    mujoco.mj_forward(loop.model, data)
    data.xfrc_applied[root] = own = rng.normal(size=6)
    data.time = time
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(loop.model, data, mujoco.mjtObj.mjOBJ_XBODY, root, velocity, 0)
    pull = 400.0 * mass * (top - [0.0, 0.0, lowered] - data.xpos[root]) - 40.0 * mass * velocity[3:]
    up = data.xmat[root].reshape(3, 3)[:, 2]
    turn = 20.0 * mass * np.cross(up, [0.0, 0.0, 1.0]) - 0.8 * mass * velocity[:3]
    band, applied = server._pull(), []
    np.testing.assert_allclose(band, share * np.concatenate([pull, turn]), atol=1e-9)
    monkeypatch.setattr(loop, "_integrate", lambda: applied.append(data.xfrc_applied[root].copy()))
    server.step()
    np.testing.assert_allclose(applied, [own + band] * loop.steps, atol=1e-9)
    np.testing.assert_allclose(data.xfrc_applied[root], own, atol=1e-9)


@pytest.mark.parametrize("kind", [MujocoLoop, Plant])
def test_nothing_of_the_band_is_left_in_a_robot_that_is_reset_while_it_hangs(
    loop: MujocoLoop, kind: type[MujocoLoop | Plant]
) -> None:
    """By its own reset, and where its state has become one that is not finite, which MuJoCo resets by itself."""
    robot = loop if kind is MujocoLoop else Plant(DESCRIPTION, visuals=False)
    robot.model.opt.disableflags = int(robot.model.opt.disableflags) & ~int(
        mujoco.mjtDisableBit.mjDSBL_AUTORESET
    )
    server, states = RobotServer(robot, Wire(), band=10.0), []
    for end in (lambda: None, lambda: robot.data.qvel.fill(np.nan), lambda: None):
        for _ in range(5):
            server.step()
        states.append(robot.data.qpos.copy())
        robot.push("torso", [30.0, 0.0, 0.0], 1.0)
        server.step()
        end()
        if not np.isfinite(robot.data.qvel).all():
            with pytest.raises(MeasurementError):
                server.step()
            with pytest.raises(DivergedError):
                server.step()
        robot.reset()
        assert not robot.data.xfrc_applied.any()
    for state in states[1:]:
        np.testing.assert_array_equal(state, states[0])


def test_a_server_keeps_its_period_and_counts_those_that_began_late(
    loop: MujocoLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, wire = SimulatedTime(), Wire()
    server = RobotServer(loop, wire, clock=clock)
    works = iter([0.001, 0.004, 0.007, 0.02, 0.001, 0.001])  # s a period; two of them take longer than 5 ms
    begun: list[float] = []

    def step() -> None:
        begun.append(round(clock.time - 100.0, 9))
        clock.time += next(works)

    monkeypatch.setattr(server, "step", step)
    server.run(lambda: len(begun) == 6)
    # The third is made up for; after the fourth, which ends 12 ms late, the periods are counted anew.
    assert begun == pytest.approx([0.0, 0.005, 0.01, 0.017, 0.037, 0.042])
    assert server.late == 1


def test_a_robot_without_commands_is_damped_and_sinks(loop: MujocoLoop) -> None:
    """A tenth of the servos' damping, nothing else; a watchdog must be longer than a period."""
    server = RobotServer(loop, Wire())
    command = server._sinking()
    np.testing.assert_allclose(command.kd, 0.1 * np.array(DESCRIPTION.kd))
    assert not command.kp.any() and not command.joint_torque.any()
    np.testing.assert_array_equal(command.joint_position, loop.joint_position)
    for watchdog in (0.005, 0.004):
        with pytest.raises(InputError):
            RobotServer(loop, Wire(), watchdog=watchdog)
    RobotServer(loop, Wire(), watchdog=0.0051)


def test_a_robot_is_held_until_it_hears_its_first_command_and_says_how_long_it_has_heard_none(
    loop: MujocoLoop, caplog: pytest.LogCaptureFixture
) -> None:
    clock, wire = SimulatedTime(), Wire()
    server = RobotServer(loop, wire, watchdog=0.012, clock=clock)
    assert (server.damped, server.late) == (False, 0)
    for wire.damped in (False, True):  # a rack does not let go, and does not damp
        server.step()
        assert server.silent == math.inf and not server.damped
    wire.command = Command(np.full(loop.robot.na, np.nan))
    server.step()
    assert not server.damped and "rack holds" in caplog.text and "damped" not in caplog.text
    wire.damped, wire.command = False, COMMAND
    server.step()
    assert server.silent == 0.0
    for passed in (0.006, 5.0):
        wire.command, clock.time = None, clock.time + passed
        server.step()
    assert server.silent == pytest.approx(5.006) and server.damped
    assert [m.time for m in wire.sent] == pytest.approx([0.005 * i for i in range(1, 7)])


def test_after_a_reset_a_robot_is_in_the_rack_where_it_is_then(loop: MujocoLoop) -> None:
    """As under a new server: whatever it was ordered before, and in another posture at another place."""
    q, runs, wire = loop.on_ground(loop.robot.half_sitting), [], Wire()
    q[0] += 0.5
    q[7:] += 0.01
    server = RobotServer(loop, wire, band=1.0, clock=SimulatedTime())
    for command in (None, COMMAND):
        wire.command = command
        server.step()
        loop.reset(q)
        wire.command = None
        for _ in range(3):
            server.step()
        runs.append(loop.data.qpos.copy())
        assert not server.damped and server.silent == math.inf
    loop.reset(q)
    fresh = RobotServer(loop, Wire(), band=1.0, clock=SimulatedTime())
    for _ in range(3):
        fresh.step()
    for run in runs:
        np.testing.assert_array_equal(run, loop.data.qpos)


def test_a_plant_is_served_as_a_robot_in_any_model_is() -> None:
    plant, wire = Plant(DESCRIPTION, visuals=False), Wire()
    server, height = RobotServer(plant, wire), plant.com_height
    for _ in range(20):
        server.step()
    assert plant.com_height == pytest.approx(height, abs=2e-3)
    wire.command = plant.hold()
    server.step()
    wire.command, wire.damped = None, True
    for _ in range(40):
        server.step()
    assert plant.com_height < height - 0.02
