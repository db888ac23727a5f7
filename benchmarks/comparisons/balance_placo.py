"""The balance task of PlaCo, for `compare.py`, in PlaCo's own environment: `python balance_placo.py TASK.json`.

Timed: writing the centre-of-mass reference, `update_kinematics`, `solve` (which builds all rows), and reading
joint torques and accelerations.
"""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pinocchio as pin
import placo
from balance import BRAKE, BalanceTask, damping, run

TORQUE_WEIGHT = 1e-6
"""Cost of the joint torques; PlaCo always has this term, and it settles how the soles share the load."""


class PlaCo:
    """The balance task in PlaCo's terms; see `Balance`."""

    def __init__(self, task: BalanceTask) -> None:
        n = task.numbers
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
        self.target = solver.add_com_task(self.com_start)
        self.target.kp, self.target.kd = n["com_stiffness"], damping(n["com_stiffness"])
        self.target.configure("com", "soft", n["com_weight"])
        posture = solver.add_joints_task()
        posture.set_joints(task.posture)
        posture.kp, posture.kd = n["posture_stiffness"], damping(n["posture_stiffness"])
        posture.configure("posture", "soft", n["posture_weight"])

        for name in task.posture:
            solver.set_qdd_safe(name, n["braking"])
        solver.enable_joint_limits(True)
        solver.enable_velocity_limits(True)
        solver.enable_torque_limits(True)
        self.period, self.nv, self.effort = task.period, robot.model.nv, np.array(robot.model.effortLimit[6:])

    def _add_contacts(self, task: BalanceTask) -> None:
        n = task.numbers
        for frame in task.soles:
            hold = self.solver.add_frame_task(frame, self.robot.get_T_world_frame(frame))
            hold.configure(frame, "hard")
            for part in (hold.position(), hold.orientation()):
                part.kp, part.kd = n["contact_stiffness"], damping(n["contact_stiffness"])
            contact = self.solver.add_planar_contact(hold)
            contact.length, contact.width, contact.mu = n["sole_length"], n["sole_width"], n["friction"]

    def tick(self, time: float, com: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> bool:
        """See `Balance`."""
        target = self.target
        target.target_world = com
        target.dtarget_world = velocity
        target.ddtarget_world = acceleration
        self.robot.update_kinematics()
        solution = self.solver.solve(False)
        if solution.success:
            self.tau, self.qdd = solution.tau, solution.qdd
        return bool(solution.success)

    def com(self) -> np.ndarray:
        """See `Balance`."""
        return np.array(self.robot.com_world())

    def move_on(self, *, solved: bool) -> np.ndarray:
        """See `Balance`."""
        state = self.robot.state
        state.qdd = self.qdd if solved else -np.array(state.qd) / BRAKE
        self.robot.integrate(self.period)
        return np.array(self.tau[6:]) if solved else np.zeros(self.nv - 6)


if __name__ == "__main__":
    print(run(BalanceTask.load(Path(sys.argv[1])), f"{version('placo')} (pin {pin.__version__})", PlaCo))
