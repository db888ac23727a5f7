"""A machine in simulated time that hangs by an elastic band, as users start a humanoid: no force sensors, soft servos.

It stands in for simulators that run by themselves: messages come every millisecond or every five, with jitter, some
twice, and without a clock; commands act when they come. `table()` of `tests/machine/test_takeover.py` runs it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import mujoco
import numpy as np

import wbc
from wbc import Command, Measurement
from wbc.machine import Driver
from wbc.machine.clock import Clock
from wbc.machine.unitree.wire import machine_gains
from wbc.sim import Machine, MujocoLoop, Plant

STIFFNESS, DAMPING = 200.0, 100.0
"""Of the band, N/m and Ns/m."""

HOOK = 3.0
"""Height of the band's upper end, m."""

STEP = 0.001
"""Physics step, s."""


class SimulatedTime(Clock):
    """A clock that waits for nobody."""

    def __init__(self) -> None:
        self.time = 100.0

    def now(self) -> float:
        return self.time

    def sleep_until(self, deadline: float) -> None:
        self.time = max(self.time, deadline)


class HangingMachine(Driver):
    """A G1 at a band, as a driver of `wbc.run`.

    Attributes:
        clock: Its time, also that of the loop.
        length: Length of the band, m; None once it is off.
        speed: Speed with which the band is let out, m/s.
        torso: Body that the band holds.
    """

    def __init__(
        self,
        *,
        message_period: float = 0.001,
        heavier: bool = False,
        seed: int = 0,
        stamped: bool = False,
        busy: float = 0.0006,
        pace: float = 1.0,
    ) -> None:
        """Hang the robot up.

        Args:
            message_period: Time between two messages, s.
            heavier: 5 % more mass than described, ankles of 50 Nm instead of 35, twice the friction.
            seed: Of jitter and repeats.
            stamped: Messages carry the time; zero otherwise.
            busy: Mean time that the controller takes, s.
            pace: Ratio of its time to the clock's, as of a simulator on a busy computer.
        """
        self.description = wbc.load_robot("g1")
        robot = self.description.robot()
        self.gains = machine_gains(robot.joint_names)
        self.clock, self.length, self.speed = SimulatedTime(), 0.0, 0.0
        model, ankles = Plant(self.description, timestep=STEP, visuals=False).model, 50.0 if heavier else 35.0
        self._limit = np.array(robot.torque_limit)
        self._limit[["ankle" in name for name in robot.joint_names]] = ankles
        # Motors for servos: those of the machine act on what is measured, computed here. Contacts of a common file.
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        model.actuator_biastype[:], model.actuator_gainprm[:], model.actuator_biasprm[:] = 0, 0.0, 0.0
        model.actuator_gainprm[:, 0] = 1.0
        model.actuator_ctrllimited[:], model.actuator_forcelimited[:] = 0, 0
        model.jnt_actfrclimited[:] = 0
        model.geom_solref[:], model.geom_solimp[:] = (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)
        model.dof_armature[6:], model.dof_damping[6:] = 0.01, 0.05
        model.dof_frictionloss[6:] = 0.2 if heavier else 0.1
        if heavier:
            model.body_mass *= 1.05
            model.body_inertia *= 1.05
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self.loop = MujocoLoop(
            self.description,
            model,
            control_period=STEP,
            machine=Machine(force_sensors=False, torque_sensors=True),
        )
        q = np.array(robot.half_sitting)
        q[2] += 0.3
        self.loop.reset(q)
        self.torso = model.body("torso_link").id
        self._rng, self._stamped, self._busy, self._pace = np.random.default_rng(seed), stamped, busy, pace
        self._every = round(message_period / STEP)
        self._command: Command = Command(np.zeros(robot.na))
        self._messages: deque[tuple[float, Measurement]] = deque()
        self._last: Measurement | None = None
        self._steps = 0
        self.weight = float(mujoco.mj_getTotalmass(model)) * 9.81
        self.sent: list[Command] = []

    @property
    def time(self) -> float:
        """Time since the beginning, s."""
        return self._steps * STEP

    @property
    def pull(self) -> float:
        """Force of the band, N."""
        return float(np.linalg.norm(self.loop.data.xfrc_applied[self.torso, :3]))

    @property
    def height(self) -> float:
        """Height of the centre of mass, m."""
        return float(self.loop.truth().com[2])

    def _advance(self) -> None:
        """Step the physics up to the present instant."""
        data, end = self.loop.data, self._pace * (self.clock.time - 100.0)
        while self.time < end:
            force = np.zeros(3)
            if self.length is not None:
                self.length += self.speed * STEP
                rope = np.array([0.0, 0.0, HOOK]) - data.xipos[self.torso]
                size = float(np.linalg.norm(rope))
                velocity = np.zeros(6)
                kind = mujoco.mjtObj.mjOBJ_BODY
                mujoco.mj_objectVelocity(self.loop.model, data, kind, self.torso, velocity, 0)
                along = float(rope @ velocity[3:]) / size
                force = max(0.0, STIFFNESS * (size - self.length) - DAMPING * along) * rope / size
            data.xfrc_applied[self.torso, :3] = force
            self.loop.step(self._torques())
            self._steps += 1
            if self._steps % self._every == 0:
                self._publish()

    def _torques(self) -> Command:
        """Torques of the motors now: the feed-forward and the servos, which see every physics step."""
        command, places = self._command, self.loop.places
        torque = np.array(command.joint_torque)
        if command.joint_position is not None and command.kp is not None and command.kd is not None:
            velocity = 0.0 if command.joint_velocity is None else command.joint_velocity
            torque += command.kp * (command.joint_position - self.loop.data.qpos[places.joint_qpos])
            torque += command.kd * (velocity - self.loop.data.qvel[places.joint_dof])
        return Command(np.clip(torque, -self._limit, self._limit))

    def _publish(self) -> None:
        measurement = self.loop.measure()
        if not self._stamped:
            measurement = replace(measurement, time=0.0)
        if self._last is not None and self._rng.random() < 0.07:
            measurement = self._last
        self._last = measurement
        late = 0.0001 + (0.004 * self._rng.random() if self._rng.random() < 0.01 else 0.0)
        self._messages.append((100.0 + self.time / self._pace + late, measurement))

    def read(self, timeout: float) -> Measurement | None:
        end = self.clock.time + timeout
        while True:
            self._advance()
            newest = None
            while self._messages and self._messages[0][0] <= self.clock.time:
                newest = self._messages.popleft()[1]
            if newest is not None:
                self.clock.time += self._busy * self._rng.uniform(0.7, 1.5)
                return newest
            if self.clock.time >= end:
                return None
            self.clock.time = min(end, self.clock.time + 0.0002)

    def write(self, command: Command) -> None:
        self._advance()
        self.sent.append(command)
        kp, kd = self.gains
        if command.joint_position is not None and command.kp is None:
            command = replace(command, kp=kp, kd=kd)
        self._command = command

    def damp(self) -> None:
        self._advance()
        q, zero = np.array(self.loop.data.qpos[self.loop.places.joint_qpos]), np.zeros(len(self.gains[0]))
        self._command = Command(zero, q, zero, kp=zero, kd=self.gains[1])

    def push(self, force: tuple[float, float], duration: float = 0.1) -> None:
        """Push the pelvis from now on, N and s."""
        self.loop.push("pelvis", (*force, 0.0), duration)
