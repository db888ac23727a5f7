"""Time one tick of PlaCo on the balance task; prints one JSON object. Runs in PlaCo's own environment.

Usage: python placo_tick.py TASK.json

Timed: writing the centre-of-mass reference, `update_kinematics`, `solve` (which builds all rows), and reading
joint torques and accelerations. Not timed: integrating the state.
"""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path
from time import perf_counter_ns

import numpy as np
import pinocchio as pin
import placo
from balance_task import BalanceTask, damping, preemptions, record

TORQUE_WEIGHT = 1e-6
"""Cost of the joint torques; PlaCo always has this term, and it settles how the soles share the load."""


class Balance:
    """The balance task in PlaCo's terms."""

    def __init__(self, task: BalanceTask) -> None:
        robot = placo.RobotWrapper("", placo.Flags.ignore_collisions, task.urdf)
        self.robot = robot
        base = np.eye(4)
        base[2, 3] = task.base_height
        robot.set_T_world_fbase(base)
        for name, angle in task.posture.items():
            robot.set_joint(name, angle)
        robot.update_kinematics()

        solver = placo.DynamicsSolver(robot)
        self.solver = solver
        solver.dt = task.period
        solver.torque_cost = TORQUE_WEIGHT
        self._add_contacts(task)
        self.com_start = np.array(robot.com_world())
        self.com = solver.add_com_task(self.com_start)
        self.com.kp, self.com.kd = task.com_stiffness, damping(task.com_stiffness)
        self.com.configure("com", "soft", task.com_weight)
        posture = solver.add_joints_task()
        posture.set_joints(task.posture)
        posture.kp, posture.kd = task.posture_stiffness, damping(task.posture_stiffness)
        posture.configure("posture", "soft", task.posture_weight)

        for name in task.posture:
            solver.set_qdd_safe(name, task.braking)
        solver.enable_joint_limits(True)
        solver.enable_velocity_limits(True)
        solver.enable_torque_limits(True)

    def _add_contacts(self, task: BalanceTask) -> None:
        for frame in task.soles:
            hold = self.solver.add_frame_task(frame, self.robot.get_T_world_frame(frame))
            hold.configure(frame, "hard")
            for part in (hold.position(), hold.orientation()):
                part.kp, part.kd = task.contact_stiffness, damping(task.contact_stiffness)
            contact = self.solver.add_planar_contact(hold)
            contact.length, contact.width, contact.mu = task.sole_length, task.sole_width, task.friction


def run(task: BalanceTask) -> str:
    """Run the task and return the record."""
    balance = Balance(task)
    robot, solver, com = balance.robot, balance.solver, balance.com
    effort = np.array(robot.model.effortLimit[6:])
    nv = robot.model.nv
    durations: list[int] = []
    failures, com_error, torque_use, preempted = 0, 0.0, 0.0, 0

    for tick in range(task.warm_up + task.ticks):
        offset, velocity, acceleration = (np.array(x) for x in task.sway(tick * task.period))
        position = balance.com_start + offset
        if tick == task.warm_up:
            preempted = preemptions()

        start = perf_counter_ns()
        com.target_world = position
        com.dtarget_world = velocity
        com.ddtarget_world = acceleration
        robot.update_kinematics()
        solution = solver.solve(False)
        solved = solution.success
        if solved:
            tau = solution.tau
            qdd = solution.qdd
        stop = perf_counter_ns()

        if not solved:
            failures += 1
            qdd, tau = -np.array(robot.state.qd) / 0.1, np.zeros(nv)  # brake, and go on counting
        if tick >= task.warm_up:
            durations.append(stop - start)
            com_error = max(com_error, np.linalg.norm(robot.com_world() - position))
            torque_use = max(torque_use, np.max(np.abs(tau[6:]) / effort))
        robot.state.qdd = qdd
        robot.integrate(task.period)

    return record(
        task,
        "PlaCo",
        f"{version('placo')} (pin {pin.__version__})",
        nv=nv,
        durations=durations,
        failures=failures,
        com_error=float(com_error),
        torque_use=float(torque_use),
        preempted=preemptions() - preempted,
    )


if __name__ == "__main__":
    print(run(BalanceTask.load(Path(sys.argv[1]))))
