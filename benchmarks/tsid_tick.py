"""Time one tick of TSID on the balance task; prints one JSON object. Runs in TSID's own environment.

Usage: python tsid_tick.py TASK.json

Timed: writing the centre-of-mass reference, `computeProblemData` (Pinocchio terms and all rows), `solve`, and
reading joint torques and accelerations. Not timed: integrating the state.
"""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path
from time import perf_counter_ns

import numpy as np
import pinocchio as pin
from balance_task import BalanceTask, damping, preemptions, record

# The 1.7.1 wheel has its Python files one folder too deep: `import tsid` finds an empty package.
from tsid import tsid_pywrap as tsid

LEAST_NORMAL_FORCE = 1.0
"""Of each sole, N: TSID wants a number above zero."""
GREATEST_NORMAL_FORCE = 3000.0
"""Of each sole, N: three times the robot's weight, so never reached."""
FORCE_WEIGHT = 1e-5
"""Cost of the corner forces; TSID needs it because twelve forces per sole are redundant."""
HARD, SOFT = 0, 1


class Balance:
    """The balance task in TSID's terms."""

    def __init__(self, task: BalanceTask) -> None:
        model = pin.buildModelFromXML(task.urdf, pin.JointModelFreeFlyer())
        self.model = model
        self.q = pin.neutral(model)
        self.q[2] = task.base_height
        for name, angle in task.posture.items():
            self.q[model.joints[model.getJointId(name)].idx_q] = angle
        self.v = np.zeros(model.nv)
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
        x, y = task.sole_length / 2, task.sole_width / 2
        corners = np.array([[-x, -x, x, x], [-y, y, -y, y], [0.0, 0.0, 0.0, 0.0]])
        data = self.formulation.data()
        for frame in task.soles:
            contact = tsid.Contact6d(
                frame,
                robot,
                frame,
                corners,
                np.array([0.0, 0.0, 1.0]),
                task.friction,
                LEAST_NORMAL_FORCE,
                GREATEST_NORMAL_FORCE,
            )
            contact.setKp(np.full(6, task.contact_stiffness))
            contact.setKd(np.full(6, damping(task.contact_stiffness)))
            contact.setReference(robot.framePosition(data, self.model.getFrameId(frame)))
            if not self.formulation.addRigidContact(contact, FORCE_WEIGHT, 1.0, HARD):
                raise RuntimeError(f"TSID refused the contact on {frame}")
            self.objects.append(contact)

    def _add_tasks(self, task: BalanceTask, robot: tsid.RobotWrapper) -> None:
        self.com = tsid.TaskComEquality("com", robot)
        self.com.setKp(np.full(3, task.com_stiffness))
        self.com.setKd(np.full(3, damping(task.com_stiffness)))
        self.com_start = np.array(robot.com(self.formulation.data()))
        self.com_sample = tsid.TrajectorySample(3)
        self.formulation.addMotionTask(self.com, task.com_weight, SOFT, 0.0)

        posture = tsid.TaskJointPosture("posture", robot)
        posture.setKp(np.full(robot.na, task.posture_stiffness))
        posture.setKd(np.full(robot.na, damping(task.posture_stiffness)))
        sample = tsid.TrajectorySample(robot.na)
        sample.value(self.q[7:])
        sample.derivative(np.zeros(robot.na))
        sample.second_derivative(np.zeros(robot.na))
        posture.setReference(sample)
        self.formulation.addMotionTask(posture, task.posture_weight, SOFT, 0.0)
        self.objects += [posture, sample]

    def _add_limits(self, task: BalanceTask, robot: tsid.RobotWrapper) -> None:
        motion = tsid.TaskJointPosVelAccBounds("position and velocity", robot, task.period, False)
        motion.setPositionBounds(self.model.lowerPositionLimit[7:], self.model.upperPositionLimit[7:])
        motion.setVelocityBounds(self.model.velocityLimit[6:])
        # The acceleration bound serves the braking law alone; it is not imposed on the solution.
        motion.setAccelerationBounds(np.full(robot.na, task.braking))
        motion.setImposeBounds(True, True, True, False)
        self.formulation.addMotionTask(motion, 1.0, HARD, 0.0)

        self.effort = self.model.effortLimit[6:]
        torque = tsid.TaskActuationBounds("torque", robot)
        torque.setBounds(-self.effort, self.effort)
        self.formulation.addActuationTask(torque, 1.0, HARD, 0.0)
        self.objects += [motion, torque]


def run(task: BalanceTask) -> str:
    """Run the task and return the record."""
    balance = Balance(task)
    formulation, solver = balance.formulation, balance.solver
    com, sample = balance.com, balance.com_sample
    model, q, v = balance.model, balance.q, balance.v
    data = model.createData()
    durations: list[int] = []
    failures, com_error, torque_use, preempted = 0, 0.0, 0.0, 0

    for tick in range(task.warm_up + task.ticks):
        time = tick * task.period
        offset, velocity, acceleration = (np.array(x) for x in task.sway(time))
        position = balance.com_start + offset
        if tick == task.warm_up:
            preempted = preemptions()

        start = perf_counter_ns()
        sample.value(position)
        sample.derivative(velocity)
        sample.second_derivative(acceleration)
        com.setReference(sample)
        problem = formulation.computeProblemData(time, q, v)
        solution = solver.solve(problem)
        solved = solution.status == 0
        if solved:
            tau = formulation.getActuatorForces(solution)
            dv = formulation.getAccelerations(solution)
        stop = perf_counter_ns()

        if not solved:
            failures += 1
            dv, tau = -v / 0.1, np.zeros(model.nv - 6)  # brake, and go on counting
        if tick >= task.warm_up:
            durations.append(stop - start)
            com_error = max(com_error, np.linalg.norm(pin.centerOfMass(model, data, q) - position))
            torque_use = max(torque_use, np.max(np.abs(tau) / balance.effort))
        v = v + task.period * np.array(dv)
        q = pin.integrate(model, q, task.period * v)

    return record(
        task,
        "TSID",
        f"{version('tsid')} (pin {pin.__version__})",
        nv=model.nv,
        durations=durations,
        failures=failures,
        com_error=float(com_error),
        torque_use=float(torque_use),
        preempted=preemptions() - preempted,
    )


if __name__ == "__main__":
    print(run(BalanceTask.load(Path(sys.argv[1]))))
