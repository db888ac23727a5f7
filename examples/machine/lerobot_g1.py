"""A controller for the G1 of LeRobot: any ONNX policy moves legs and waist, on this library's estimate.

LeRobot asks a controller for `control_dt`, `kp`, `kd`, `reset()` and `run_step(action, lowstate)`, which returns the
targets of motors by name. In a program with LeRobot: robot.controller = PolicyController("walk.onnx"). Names, gains and
observations of the policy are checked when it is made, before the first step. LeRobot moves the arms meanwhile.

python examples/machine/lerobot_g1.py walk.onnx  # in the simulator of this library, with messages as LeRobot's
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

import wbc
from wbc.policy import PolicyControl

LOWER = 15
"""Motors of legs and waist, which come before those of the arms."""

FASTEST = {"remote.ly": (0.5, 0.0, 0.0), "remote.lx": (0.0, -0.3, 0.0), "remote.rx": (0.0, 0.0, -0.8)}
"""Stick of the remote control → velocity at its end: ahead and to the left, m/s, and turn, rad/s."""

PLAY = 0.1
"""Deflection of a stick up to which it rests."""


class PolicyController:
    """Controller of the G1 of LeRobot by a policy.

    Attributes:
        control_dt: Time between two steps, s.
        kp: Stiffness of all motors, Nm/rad.
        kd: Damping of all motors, Nms/rad.
    """

    def __init__(self, policy: Any, *, control_dt: float = 0.005, **options: Any) -> None:
        """Take the file of a policy, or what else a `PolicyControl` takes."""
        description = wbc.load_robot("g1")
        self.control_dt, self._names = control_dt, list(description.joint_names)
        self.control = PolicyControl(description.robot(), policy, control_dt, **options)
        self.kp, self.kd = self.control.gains
        self.control.release(self._names[LOWER:])  # LeRobot moves the arms; the policy sees them at rest
        self._time = 0.0

    def reset(self) -> None:
        """Begin anew with a robot that stands."""
        self.control.reset()

    def run_step(self, action: Mapping[str, float], lowstate: Any) -> dict[str, float]:
        """Return the targets of legs and waist by the names of their motors, rad, from a message of the machine."""
        if lowstate is None:
            return {}
        self._time += self.control_dt
        motors, imu = lowstate.motor_state[: len(self._names)], lowstate.imu_state
        measurement = wbc.Measurement(
            time=self._time,
            joint_position=np.array([motor.q for motor in motors]),
            joint_velocity=np.array([motor.dq for motor in motors]),
            angular_velocity=np.array(imu.gyroscope),
            specific_force=np.array(imu.accelerometer),
            sole_wrench=None,  # estimated from the torques
            joint_torque=np.array([motor.tau_est for motor in motors]),
        )
        sticks = {axis: float(action.get(axis, 0.0)) for axis in FASTEST}
        moved = [value * np.array(FASTEST[axis]) for axis, value in sticks.items() if abs(value) > PLAY]
        self.control.velocity = tuple(sum(moved, np.zeros(3)).tolist())
        command = self.control.command(measurement)
        # A robot that has fallen is damped: its motors stay where they are.
        target = measurement.joint_position if command.kp is None else command.joint_position
        assert target is not None
        return {f"{motor(name)}.q": float(target[i]) for i, name in enumerate(self._names[:LOWER])}


def motor(joint: str) -> str:
    """Return LeRobot's name of the motor of a joint: left_hip_pitch_joint is kLeftHipPitch."""
    return "k" + "".join(part.capitalize() for part in joint.removesuffix("_joint").split("_"))


def message(measurement: wbc.Measurement) -> SimpleNamespace:
    """Return a measurement as a message of the machine."""
    torque = measurement.joint_torque
    assert torque is not None
    rows = zip(measurement.joint_position, measurement.joint_velocity, torque, strict=True)
    motors = [SimpleNamespace(q=q, dq=v, tau_est=tau) for q, v, tau in rows]
    imu = SimpleNamespace(gyroscope=measurement.angular_velocity, accelerometer=measurement.specific_force)
    return SimpleNamespace(motor_state=motors, imu_state=imu)


def simulate(controller: PolicyController, seconds: float, action: Mapping[str, float]) -> dict[str, float]:
    """Run the controller in the simulator, whose servos go to the targets; return how far the robot has come."""
    machine = wbc.sim.Machine(force_sensors=False, torque_sensors=True)
    plant = wbc.Plant("g1", control_period=controller.control_dt, machine=machine)
    names = list(plant.description.joint_names)
    position, still = np.array(plant.robot.half_sitting[7:]), np.zeros(len(names))
    begin, index = plant.truth().com[0], {motor(name): i for i, name in enumerate(names)}
    while plant.time < seconds:
        for name, target in controller.run_step(action, message(plant.measure())).items():
            position[index[name.removesuffix(".q")]] = target
        plant.step(
            wbc.Command(
                still, position, still, kp=controller.kp, kd=controller.kd, period=controller.control_dt
            )
        )
    state = plant.truth()
    return {"forward": float(state.com[0] - begin), "height": float(state.com[2])}


def main(arguments: list[str] | None = None) -> dict[str, float]:
    """Walk in the simulator for a time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("policy", help="ONNX file, with a description in its metadata or beside it")
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--ahead", type=float, default=0.8, help="deflection of the left stick, from -1 to 1")
    options = parser.parse_args(arguments)
    result = simulate(PolicyController(options.policy), options.seconds, {"remote.ly": options.ahead})
    print(f"{result['forward']:.2f} m ahead, the centre of mass {result['height']:.2f} m high")
    return result


if __name__ == "__main__":
    main()
