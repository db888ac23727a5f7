"""The balance task of TSID, for `compare.py`, in TSID's own environment: `python balance_tsid.py TASK.json`.

Timed: writing the centre-of-mass reference, `computeProblemData` (Pinocchio terms and all rows), `solve`, and
reading joint torques and accelerations.
"""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pinocchio as pin
from balance import BRAKE, BalanceTask, damping, run

# The 1.7.1 wheel has its Python files one folder too deep: `import tsid` finds an empty package.
from tsid import tsid_pywrap as tsid

LEAST_NORMAL_FORCE = 1.0
"""Of each sole, N: TSID wants a number above zero."""
GREATEST_NORMAL_FORCE = 3000.0
"""Of each sole, N: three times the robot's weight, so never reached."""
FORCE_WEIGHT = 1e-5
"""Cost of the corner forces; TSID needs it because twelve forces per sole are redundant."""
HARD, SOFT = 0, 1


class Tsid:
    """The balance task in TSID's terms; see `Balance`."""

    def __init__(self, task: BalanceTask) -> None:
        model = pin.buildModelFromXML(task.urdf, pin.JointModelFreeFlyer())
        self.model = model
        self.q = pin.neutral(model)
        self.q[2] = task.base_height
        for name, angle in task.posture.items():
            self.q[model.joints[model.getJointId(name)].idx_q] = angle
        self.v = np.zeros(model.nv)
        self.data, self.nv, self.period = model.createData(), model.nv, task.period
        robot = tsid.RobotWrapper(model, tsid.FLOATING_BASE_SYSTEM, False)
        self.formulation = tsid.InverseDynamicsFormulationAccForce("balance", robot, False)
        self.formulation.computeProblemData(0.0, self.q, self.v)
        self.objects: list[object] = [robot]  # the formulation keeps references that Python does not know of
        self._add_contacts(task, robot)
        self._add_tasks(task, robot)
        self._add_limits(task, robot)
        self.solver = tsid.SolverHQuadProgFast("solver")
        self.solver.resize(self.formulation.nVar, self.formulation.nEq, self.formulation.nIn)

    def _add_contacts(self, task: BalanceTask, robot: tsid.RobotWrapper) -> None:
        n = task.numbers
        x, y = n["sole_length"] / 2, n["sole_width"] / 2
        corners = np.array([[-x, -x, x, x], [-y, y, -y, y], [0.0, 0.0, 0.0, 0.0]])
        data = self.formulation.data()
        for frame in task.soles:
            contact = tsid.Contact6d(
                frame,
                robot,
                frame,
                corners,
                np.array([0.0, 0.0, 1.0]),
                n["friction"],
                LEAST_NORMAL_FORCE,
                GREATEST_NORMAL_FORCE,
            )
            contact.setKp(np.full(6, n["contact_stiffness"]))
            contact.setKd(np.full(6, damping(n["contact_stiffness"])))
            contact.setReference(robot.framePosition(data, self.model.getFrameId(frame)))
            if not self.formulation.addRigidContact(contact, FORCE_WEIGHT, 1.0, HARD):
                raise RuntimeError(f"TSID refused the contact on {frame}")
            self.objects.append(contact)

    def _add_tasks(self, task: BalanceTask, robot: tsid.RobotWrapper) -> None:
        n = task.numbers
        self.target = tsid.TaskComEquality("com", robot)
        self.target.setKp(np.full(3, n["com_stiffness"]))
        self.target.setKd(np.full(3, damping(n["com_stiffness"])))
        self.com_start = np.array(robot.com(self.formulation.data()))
        self.com_sample = tsid.TrajectorySample(3)
        self.formulation.addMotionTask(self.target, n["com_weight"], SOFT, 0.0)

        posture = tsid.TaskJointPosture("posture", robot)
        posture.setKp(np.full(robot.na, n["posture_stiffness"]))
        posture.setKd(np.full(robot.na, damping(n["posture_stiffness"])))
        sample = tsid.TrajectorySample(robot.na)
        sample.value(self.q[7:])
        sample.derivative(np.zeros(robot.na))
        sample.second_derivative(np.zeros(robot.na))
        posture.setReference(sample)
        self.formulation.addMotionTask(posture, n["posture_weight"], SOFT, 0.0)
        self.objects += [posture, sample]

    def _add_limits(self, task: BalanceTask, robot: tsid.RobotWrapper) -> None:
        n = task.numbers
        motion = tsid.TaskJointPosVelAccBounds("position and velocity", robot, task.period, False)
        motion.setPositionBounds(self.model.lowerPositionLimit[7:], self.model.upperPositionLimit[7:])
        motion.setVelocityBounds(self.model.velocityLimit[6:])
        # The acceleration bound serves the braking law alone; it is not imposed on the solution.
        motion.setAccelerationBounds(np.full(robot.na, n["braking"]))
        motion.setImposeBounds(True, True, True, False)
        self.formulation.addMotionTask(motion, 1.0, HARD, 0.0)

        self.effort = self.model.effortLimit[6:]
        torque = tsid.TaskActuationBounds("torque", robot)
        torque.setBounds(-self.effort, self.effort)
        self.formulation.addActuationTask(torque, 1.0, HARD, 0.0)
        self.objects += [motion, torque]

    def tick(self, time: float, com: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> bool:
        """See `Balance`."""
        sample, formulation = self.com_sample, self.formulation
        sample.value(com)
        sample.derivative(velocity)
        sample.second_derivative(acceleration)
        self.target.setReference(sample)
        solution = self.solver.solve(formulation.computeProblemData(time, self.q, self.v))
        if solution.status == 0:
            self.tau, self.dv = (
                formulation.getActuatorForces(solution),
                formulation.getAccelerations(solution),
            )
        return solution.status == 0

    def com(self) -> np.ndarray:
        """See `Balance`."""
        return pin.centerOfMass(self.model, self.data, self.q)

    def move_on(self, *, solved: bool) -> np.ndarray:
        """See `Balance`."""
        self.v = self.v + self.period * (np.array(self.dv) if solved else -self.v / BRAKE)
        self.q = pin.integrate(self.model, self.q, self.period * self.v)
        return np.array(self.tau) if solved else np.zeros(self.nv - 6)


if __name__ == "__main__":
    print(run(BalanceTask.load(Path(sys.argv[1])), f"{version('tsid')} (pin {pin.__version__})", Tsid))
