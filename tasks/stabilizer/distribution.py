"""Distribution of the desired wrench of the whole robot over its feet.

One QP of fixed size serves double and single support. Its unknowns are both foot wrenches in their sole frames, and a
shortfall s in newtons and newton metres, so that there always is a solution:

    minimise    net |s|² + ankle |ankle torques|² + … + pressure ((1 − r) f_L − r f_R)²
    subject to  wrench_L + wrench_R + s = desired, about the target ZMP
                friction, CoP and yaw torque of a rectangle; least normal force

with r the left-foot ratio: 1 when the left foot carries all weight. Taking moments about the ZMP keeps the numbers
small wherever the robot stands. The wrench of a foot in the air is not in the sum: it only costs, and is zero.

On one foot nothing is distributed: where it can give the desired wrench, that is the result, and no QP is solved.

Source: S. Caron, A. Kheddar, O. Tempier, "Stair climbing stabilization of the HRP-4 humanoid robot using
whole-body admittance control", ICRA 2019, section IV; weights of mc_rtc's stabilizer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive, settings
from wbc.base.vectors import largest
from wbc.core.frames import Sole
from wbc.core.friction import rectangle_wrench_cone
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.solving.solver import QpSolver, SolverSettings, Status
from wbc.core.robot import Robot

ROWS = 17
"""Inequalities of a foot: 16 of its wrench cone, then its normal force."""


LEAST_SHARE = 0.05
"""Least ratio of a foot's load to the sum by which its moments are weighed."""


NET_MOMENT, ANKLE_TORQUE, PRESSURE = 1e2, 1.0, 1e-2
"""Costs of missing moment about the target ZMP and of roll and pitch torque at the ankle, 1/(Nm)²; of a load that is
not shared by the left-foot ratio, 1/N²: mc_rtc's, of which only ratios matter."""


@settings
class DistributionSettings:
    """Limits and costs of the distribution of the wrench to the feet.

    Costs stand beside those of `NET_MOMENT`, `ANKLE_TORQUE` and `PRESSURE`. Missing force costs ten times
    more, because the weight has to be borne whatever the CoP can do. The costs that only pick one of many solutions are
    small, but large enough for the solver.

    Attributes:
        friction: Coulomb coefficient between the soles and the ground.
        min_force: Least normal force of a foot in contact, N; less for a light robot (`Robot.force_scale`).
        margin: Distance of the CoP from the edge of the sole, m.
        net_force: Cost of the force that the feet lack, 1/N².
        ankle_yaw: Cost of yaw torque at the ankle, 1/(Nm)².
        ankle_shear: Cost of horizontal force, 1/N².
        ankle_normal: Cost of normal force, 1/N²; it only picks one of several solutions.
        by_load: Weigh the ankle torque of each of two feet, here and in the QP, by the inverse square of the foot's
            share of the load. Without it both feet get the same ankle torque, and the CoP of the foot with less load
            lies at the edge of its sole. With it that CoP lies closer to the middle. Soles then press evenly, so yaw
            moments are bounded, but the posture hardly holds the legs. Use it for a source that gives the motion of
            all joints.
    """

    friction: Positive = 0.7
    min_force: Annotated[NonNegative, "N"] = 15.0
    margin: Annotated[NonNegative, "m"] = 0.0
    net_force: Annotated[Positive, "1/N²"] = 1e3
    ankle_yaw: Annotated[Positive, "1/(Nm)²"] = 1e-2
    ankle_shear: Annotated[Positive, "1/N²"] = 1e-4
    ankle_normal: Annotated[Positive, "1/N²"] = 1e-5
    by_load: bool = False

    @staticmethod
    def mc_rtc() -> DistributionSettings:
        """Return mc_rtc's costs (10000 net, 100 · diag(1, 1, 1e-4 | 1e-3, 1e-3, 1e-4)², 1), all over 100.

        The smallest, 1e-8 and 1e-6, only pick one of many solutions. They are raised to 1e-5, since no solver resolves
        costs ten orders of magnitude below the rest.
        """
        tiny = 1e-5
        return DistributionSettings(net_force=1e2, ankle_yaw=tiny, ankle_shear=tiny, ankle_normal=tiny)


class FootWrenches(NamedTuple):
    """Desired contact wrench of each foot.

    Attributes:
        shortfall: Desired minus distributed wrench: force, and moment about the target ZMP, in world axes,
            shape (6,), N and Nm.
    """

    wrenches: Array  # [force; moment] of left and right foot in their sole frames, shape (2, 6), N and Nm
    shortfall: Array
    status: Status  # of the QP; solved where one foot alone gives the wrench, without a QP


def left_foot_ratio(zmp: Array, left: Array, right: Array) -> float:
    """Return the left-foot ratio that puts the ZMP on the line between the feet: 1 at the left foot.

    Target ZMP and ankles or sole centres are points in the world, shape (3,), m.
    """
    (zx, zy, zz), (lx, ly, lz), (x, y, z) = zmp.tolist(), left.tolist(), right.tolist()
    lx, ly, lz = lx - x, ly - y, lz - z
    along = (zx - x) * lx + (zy - y) * ly + (zz - z) * lz
    return float(min(max(along / (lx * lx + ly * ly + lz * lz), 0.0), 1.0))


class WrenchDistribution:
    """QP of the distribution for one robot.

    Attributes:
        settings: Limits and costs.
    """

    def __init__(
        self, sizes: Sequence[tuple[float, float]], settings: DistributionSettings | None = None
    ) -> None:
        """Set up the QP for (length, width) of the left and of the right sole, m.

        Raises `InputError` for a margin that leaves nothing of a sole.
        """
        self.settings = s = settings or DistributionSettings()
        self._problem = p = Problem(0, 0, 18, 6, 1, 2 * ROWS)
        for column, row, (length, width) in zip((0, 6), (0, ROWS), sizes, strict=True):
            half_length, half_width = 0.5 * length - s.margin, 0.5 * width - s.margin
            if not (half_length > 0.0 and half_width > 0.0):
                raise InputError(
                    f"a margin of {s.margin:g} m leaves nothing of a sole of {length:g} × {width:g} m"
                )
            p.inequality[row : row + ROWS - 1, column : column + 6] = rectangle_wrench_cone(
                half_length, half_width, s.friction
            )
            p.diagonal[column : column + 3] = (s.ankle_shear, s.ankle_shear, s.ankle_normal)
            p.diagonal[column + 5] = s.ankle_yaw
            p.inequality[row + ROWS - 1, column + 2] = 1.0
        p.diagonal[12:15], p.diagonal[15:] = s.net_force, NET_MOMENT
        p.equality[:, 12:] = np.eye(6)
        self._cones = [np.array(p.inequality[:ROWS, :6]), np.array(p.inequality[ROWS:, 6:12])]
        self._torques = np.array((3, 4, 9, 10))  # roll and pitch torques among the unknowns
        self._bounds: list[tuple[float, float, float] | None] = [None, None]  # of normal forces and cones
        self._both: bool | None = None  # as the costs are written
        self._net = pin.Force.Zero()  # the constructor of an array takes five times as long as to assign it
        # In newtons: a residual of a millinewton is negligible.
        self._solver = QpSolver(p, SolverSettings(tolerance=1e-5, residual_tolerance=1e-3))

    @staticmethod
    def of(robot: Robot, soles: Sequence[Sole], settings: DistributionSettings) -> WrenchDistribution:
        """Return the distribution over the left and the right sole of a robot; a light one has its least force."""
        left, right = ((sole.length, sole.width) for sole in soles)
        least = settings.min_force * robot.force_scale
        return WrenchDistribution((left, right), replace(settings, min_force=least))

    def solve(
        self,
        net: Array,
        soles: Sequence[pin.SE3],
        zmp: Array,
        ratio: float,
        contact: Sequence[bool] = (True, True),
    ) -> FootWrenches:
        """Distribute a wrench over the feet in contact.

        Args:
            net: Desired [force; moment] at the world origin in world axes, shape (6,), N and Nm.
            soles: Placements of the left and of the right sole.
            zmp: Target ZMP in the world, shape (3,), m: moments are taken about it.
            ratio: Left-foot ratio, 0 to 1.
            contact: True for each foot that carries; at least one.
        """
        if not any(contact):
            raise InputError("a wrench can only be distributed over feet in contact; neither is")
        p, s = self._problem, self.settings
        both = all(contact)
        if not both:
            alone = self._on_one_foot(0 if contact[0] else 1, net, soles)
            if alone is not None:
                return alone
        for foot in (0, 1):
            self._bound(foot, bool(contact[foot]))
            if contact[foot]:
                self._write_foot(foot, soles[foot], zmp)
        if both is not self._both:
            self._both = both
            # On one foot there is no choice: its torque follows from the ZMP.
            p.diagonal[self._torques] = ANKLE_TORQUE if both else s.ankle_yaw
            p.soft[0, 2] = p.soft[0, 8] = 0.0
            p.soft_weight[0] = PRESSURE if both else 0.0
        if both:
            p.soft[0, 2], p.soft[0, 8] = 1.0 - ratio, -ratio
            if s.by_load:
                for columns, share in ((slice(3, 5), ratio), (slice(9, 11), 1.0 - ratio)):
                    p.diagonal[columns] = ANKLE_TORQUE * (0.5 / max(share, LEAST_SHARE)) ** 2
        fx, fy, fz, mx, my, mz = net.tolist()
        x, y, z = zmp.tolist()
        about_zmp = (mx - y * fz + z * fy, my - z * fx + x * fz, mz - x * fy + y * fx)
        p.target[:6] = np.array((fx, fy, fz, *about_zmp))
        status = self._solver.solve()
        solution = self._solver.x.copy()
        return FootWrenches(solution[:12].reshape(2, 6), solution[12:], status)

    def _on_one_foot(self, foot: int, net: Array, soles: Sequence[pin.SE3]) -> FootWrenches | None:
        """Return the whole wrench as that of the only foot on the ground; None where the foot cannot give it."""
        self._net.vector = net
        wrench = soles[foot].actInv(self._net).vector
        rows = self._cones[foot].dot(wrench)  # of the cone, then the normal force
        normal, rows[-1] = float(rows[-1]), 0.0
        if not (largest(rows) <= 0.0 and normal >= self.settings.min_force):
            return None
        wrenches = np.zeros((2, 6))
        wrenches[foot] = wrench
        return FootWrenches(wrenches, np.zeros(6), Status.SOLVED)

    def _write_foot(self, foot: int, sole: pin.SE3, zmp: Array) -> None:
        """Write the wrench of a foot on the ground into the sum of wrenches."""
        p, column, rotation = self._problem, 6 * foot, sole.rotation
        force, moment = slice(column, column + 3), slice(column + 3, column + 6)
        p.equality[:3, force] = p.equality[3:6, moment] = rotation
        p.equality[3:6, force] = pin.skew(sole.translation - zmp).dot(rotation)

    def _bound(self, foot: int, contact: bool) -> None:
        """Write the least normal force; a foot in the air gets bounds that do not act."""
        bounds = (self.settings.min_force, np.inf, 0.0) if contact else (-1.0, 1.0, 1.0)
        if bounds == self._bounds[foot]:
            return
        p, row, last = self._problem, ROWS * foot, ROWS * foot + ROWS - 1
        p.lower[last], p.upper[last], p.upper[row:last] = bounds
        self._bounds[foot] = bounds
        if not contact:
            p.equality[:6, 6 * foot : 6 * foot + 6] = 0.0
