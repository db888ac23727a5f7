"""Streams of random control problems: robots that sway widely, switch feet and reach for targets out of reach.

A stream starts from a random state and continues in closed loop: the accelerations of each solution lead to the next
state, as on a robot. Task targets are random and soft, so they never make a problem infeasible; states do, when a robot
has tipped over or its torques do not suffice. Feasibility is judged apart from the solver under test: see
`least_violation`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

from wbc.base.numbers import Array
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.solving.solution import Solution
from wbc.core.qp.solving.solver import SolverSettings
from wbc.core.robot import BASE_DOF
from wbc.robots.description import RobotDescription
from wbc.sim.trial.falls import TrueFallDetector
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask, PositionTask
from wbc.tasks.motion.posture import PostureTask

LIMIT_ROOM = 0.01
"""Distance of random starting postures from the position limits, rad."""


class ProblemStream:
    """One robot with random tasks, limits and contact switches, in closed loop with itself.

    Attributes:
        controller: Its controller; `step` has written the present problem into it.
        scattered: True if every tick has a random state of its own, so that no tick is like the one before.
        switches: Number of contacts made or broken so far.
    """

    def __init__(
        self,
        description: RobotDescription,
        rng: np.random.Generator,
        *,
        scattered: bool,
        solver: SolverSettings | None = None,
    ) -> None:
        """Draw everything that is constant over the stream; a scattered one draws a new state for every tick."""
        self._rng, self.scattered = rng, scattered
        self._robot = robot = description.robot()
        self._falls = TrueFallDetector(robot)
        self._dt = float(rng.choice([0.001, 0.002, 0.005]))
        self.controller = Controller(robot, self._dt, settings=solver)
        self._feet = [
            SoleContact(
                sole.name, friction=float(rng.choice([0.25, 0.25, 0.5])), ramp=float(rng.uniform(0.02, 0.2))
            )
            for sole in robot.soles
        ]
        self._q, self._v = self._state()
        robot.update(self._q, self._v)
        self._com = self.controller.add(
            CoMTask(weight=10.0 ** rng.uniform(0.0, 3.0), stiffness=rng.uniform(20.0, 100.0))
        )
        self._posture = self.controller.add(PostureTask(weight=0.1, stiffness=rng.uniform(10.0, 100.0)))
        self.controller.add(OrientationTask(robot.base_frame, name="base"))
        self._swing = [
            self.controller.add(PoseTask(s.frame, name=f"swing {s.name}", weight=0.0)) for s in robot.soles
        ]
        self._hands = [
            self.controller.add(
                PositionTask(frame, name=role, weight=rng.uniform(0.1, 5.0), stiffness=50.0, error_bound=10.0)
            )
            for role, frame in robot.frames.items()
        ]
        for foot in self._feet:
            self.controller.add(foot)
        self.controller.add(
            JointLimits(velocity_ratio=rng.uniform(0.2, 1.0)), TorqueLimits(ratio=rng.uniform(0.6, 1.0))
        )
        self._start = np.array(robot.com)
        self._sway = np.array([rng.uniform(0.0, 0.06), rng.uniform(0.0, 0.12), rng.uniform(0.0, 0.03)])
        self._frequency = rng.uniform(0.2, 1.0, 3)
        self._offset = rng.uniform(0.0, math.tau, 3)
        self._plan = self._phases()
        self._phase = next(self._plan)
        self._time = 0.0
        self.switches = 0
        self._draw_targets()

    def step(self) -> Solution:
        """Set the targets of this tick, solve, and move on to the next state."""
        rng, robot = self._rng, self._robot
        if self.scattered:
            self._q, self._v = self._state()
            for foot in self._feet:
                self._switch(foot, active=bool(rng.random() < 0.85))
        if rng.random() < self._dt / 0.3:
            self._draw_targets()
        self._follow_plan()
        self.controller.update(self._q, self._v)
        if self.scattered:
            for foot in self._feet:
                foot.reset()
        solution = self.controller.solve()
        if solution.ok:
            a = solution.accelerations
            self._q = pin.integrate(robot.model, self._q, self._v * self._dt + 0.5 * self._dt**2 * a)
            self._v = self._v + self._dt * a
        self._time += self._dt
        return solution

    @property
    def fallen(self) -> bool:
        """True once the robot lies rather than stands."""
        return self._falls.fallen(self._q) or not np.isfinite(self._v).all()

    def _state(self) -> tuple[Array, Array]:
        """Draw a posture around half-sitting, and a velocity at which the feet do not move."""
        rng, robot = self._rng, self._robot
        q = np.array(robot.half_sitting)
        q[7:] += rng.normal(0.0, 0.15, robot.na)
        room = np.minimum(LIMIT_ROOM, 0.25 * (robot.position_upper - robot.position_lower))
        q[7:] = np.clip(q[7:], robot.position_lower + room, robot.position_upper - room)
        q = pin.integrate(
            robot.model, q, np.concatenate([np.zeros(3), rng.normal(0.0, 0.05, 3), np.zeros(robot.na)])
        )
        v = rng.normal(0.0, rng.choice([0.0, 0.1, 0.3]), robot.nv)
        data = robot.model.createData()
        pin.computeJointJacobians(robot.model, data, q)
        pin.updateFramePlacements(robot.model, data)
        held = np.vstack(
            [pin.getFrameJacobian(robot.model, data, robot.frame_id(s.frame), pin.LOCAL) for s in robot.soles]
        )
        v -= np.linalg.pinv(held) @ (held @ v)
        v *= min(1.0, float((0.2 * robot.velocity_limit / np.maximum(np.abs(v[BASE_DOF:]), 1e-9)).min()))
        return q, v

    def _switch(self, foot: SoleContact, *, active: bool) -> None:
        self.switches += foot.active != active
        foot.active = active

    def _draw_targets(self) -> None:
        """Draw other targets: a posture that may lie beyond the limits, hands out of reach."""
        rng, robot = self._rng, self._robot
        reach = rng.choice([0.1, 0.5, 2.0])
        posture = robot.half_sitting[7:] + rng.normal(0.0, reach, robot.na) * (rng.random(robot.na) < 0.2)
        self._posture.follow(posture)  # unchecked: it may be out of the joints' range
        for hand in self._hands:
            hand.target = self._start + rng.uniform(-0.8, 0.8, 3)

    def _phases(self) -> Iterator[tuple[float, int | None, bool]]:
        """Yield phases: end (s), stance foot if the weight goes to one, True if the other foot is in the air."""
        rng, end = self._rng, 0.0
        stance = int(rng.integers(2))
        while True:
            for duration, foot, lift in (
                (rng.uniform(0.1, 0.6), None, False),
                (rng.uniform(0.4, 0.8), stance, False),
                (rng.uniform(0.2, 0.6), stance, True),
            ):
                end += duration
                yield end, foot, lift
            stance = 1 - stance

    def _follow_plan(self) -> None:
        if self._time >= self._phase[0]:
            self._phase = next(self._plan)
        _, stance, lift = self._phase
        robot, rng = self._robot, self._rng
        w = math.tau * self._frequency
        angle = w * self._time + self._offset
        target = self._start + self._sway * np.sin(angle)
        acceleration = -self._sway * w * w * np.sin(angle)
        if stance is not None:
            target[:2] = robot.placement(robot.soles[stance].frame).translation[:2]
            acceleration[:2] = 0.0
        self._com.target, self._com.feedforward_acceleration = target, acceleration
        if self.scattered:
            return
        for i, (foot, swing) in enumerate(zip(self._feet, self._swing, strict=True)):
            up = lift and i != stance
            if up and foot.active:
                goal = pin.SE3(robot.placement(robot.soles[i].frame))
                goal.translation = goal.translation + rng.uniform([-0.1, -0.05, 0.02], [0.1, 0.05, 0.1])
                swing.target = goal
            self._switch(foot, active=not up)
            swing.weight = 1.0 if up else 0.0


def least_violation(problem: Problem) -> float:
    """Return the smallest violation of the inequalities under the equalities; zero for feasible problems.

    A linear program, solved by HiGHS: another algorithm and another code than any in the controller. In units of the
    rows; infinite if the equalities contradict each other.
    """
    p = problem
    n = p.diagonal.size
    above, below = np.isfinite(p.upper), np.isfinite(p.lower)
    rows = np.vstack([p.inequality[above], -p.inequality[below]])
    result = linprog(
        np.concatenate([np.zeros(n), [1.0]]),
        A_ub=np.hstack([rows, -np.ones((rows.shape[0], 1))]),
        b_ub=np.concatenate([p.upper[above], -p.lower[below]]),
        A_eq=np.hstack([p.equality, np.zeros((p.n_eq, 1))]),
        b_eq=p.equality_target,
        bounds=[(None, None)] * n + [(0.0, None)],
        method="highs",
    )
    return float(result.fun) if result.status == 0 else math.inf
