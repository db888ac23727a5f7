"""Task on the centre of pressure of a foot, tracked by turning the foot about its ankle."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError, finite_array
from wbc.core.robot import Robot
from wbc.tasks.force.admittance import DampingTask
from wbc.tasks.options import ComplianceOptions

MIN_FORCE = 1.0
"""Normal force below which a centre of pressure has no meaning, N."""


class CoPTask(DampingTask):
    """Bring the centre of pressure (CoP) of a sole to a point, and its force to a target, by foot damping control.

    The target wrench at the sole centre, in the sole frame, follows from target CoP c and force f,

        [f_x, f_y, f_z, c_y p, −c_x p, 0],   p = max(0, f_z),

    and the foot moves at admittance ∘ (measured − target wrench). Without an admittance of the force only the
    foot's roll and pitch react: on a contact of rotational stiffness K, Nm/rad, the CoP error decays at
    admittance · K, 1/s, so a soft sole needs a greater admittance. A foot in the air gets target force zero: then its
    target moment is zero, too, and it does not turn.

    A contact that holds the foot in all axes leaves this task nothing to move: give it
    `SoleContact(…, free_axes=("roll", "pitch"), free_force=True)`, so that the foot may turn and bear ankle torque.

    Defaults are those of `DampingTask` but for weight 1000: 100 times that of the centre of mass, as in mc_rtc.

    Source: foot damping control of Kajita et al., "Biped walking stabilization based on linear inverted pendulum
    tracking", IROS 2010, as in mc_rtc's CoPTask; with p measured instead of given as an option.
    """

    _kind = "CoP"

    @checked
    def __init__(
        self,
        sole: str,
        target: pin.SE3 | None = None,
        *,
        target_cop: ArrayLike = (0.0, 0.0),
        target_force: ArrayLike = (0.0, 0.0, 0.0),
        admittance: ArrayLike = (0.0, 0.0, 0.0, 0.01, 0.01, 0.0),
        use_measured_pressure: bool = False,
        **options: Unpack[ComplianceOptions],
    ) -> None:
        """Describe the task.

        Args:
            sole: Name of one of the robot's soles, or its frame.
            target: Pose of the sole in the world that the small stiffness pulls to; the present one when None.
            target_cop: CoP in the sole frame, shape (2,), m.
            target_force: Force of the ground on the sole in the sole frame, shape (3,), N.
            admittance: Velocity per wrench error in the sole frame, shape (6,) or a pair (linear, angular), m/(N s)
                and rad/(Nm s). A CoP error along x turns the foot in pitch, one along y in roll. The default,
                0.01 rad/(Nm s), is what mc_rtc users take for rigid soles; 1e-4 m/(N s) along z is usual for the force.
            use_measured_pressure: Take p from the measured normal force instead of the target one.
            **options: See `ComplianceOptions`.
        """
        self._cop, self._force = np.zeros(2), np.zeros(3)
        self._use_measured_pressure = bool(use_measured_pressure)
        options = {"weight": 1000.0, **options}
        super().__init__(sole, target, admittance=admittance, **options)
        self.target_cop = target_cop
        self.target_force = target_force

    @property
    def target_cop(self) -> Array:
        """CoP in the sole frame, shape (2,), m."""
        return self._cop

    @target_cop.setter
    def target_cop(self, value: ArrayLike) -> None:
        self._cop = finite_array(f"target CoP of task '{self.name}' (m)", value, (2,))

    @property
    def target_force(self) -> Array:
        """Force of the ground on the sole in the sole frame, shape (3,), N."""
        return self._force

    @target_force.setter
    def target_force(self, value: ArrayLike) -> None:
        self._force = finite_array(f"target force of task '{self.name}' (N)", value, (3,))

    @property
    def target_wrench(self) -> Array:
        """Wrench that follows from target CoP and force, shape (6,), N and Nm; assign those instead.

        Raises:
            InputError: On assignment.
        """
        return np.array(self.desired_wrench())

    @target_wrench.setter
    def target_wrench(self, value: ArrayLike) -> None:
        raise InputError(
            f"set target_cop and target_force of task '{self.name}', not its wrench; got {value!r}"
        )

    @property
    def measured_cop(self) -> Array:
        """Measured CoP in the sole frame, shape (2,), m; NaN below 1 N of normal force."""
        wrench = self._measured_wrench
        if wrench[2] < MIN_FORCE:
            return np.full(2, np.nan)
        return np.array([-wrench[4] / wrench[2], wrench[3] / wrench[2]])

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        self.frame = robot.sole(self.frame).frame
        super().bind(robot)

    def desired_wrench(self) -> Array:
        """Return the target wrench of this tick; see `ComplianceTask.desired_wrench`."""
        wrench, cop, force = self._target_wrench, self._cop, self._force
        pressure = max(0.0, float(self._measured_wrench[2] if self._use_measured_pressure else force[2]))
        wrench[:3] = force
        wrench[3] = cop[1] * pressure
        wrench[4] = -cop[0] * pressure
        return wrench
