"""Balance by the stabilizer, of planned steps and of sources of one's own, with what is known of the pendulum's errors.

    state = balance.correct(state, last)                        DCM less its bias and the shift by hands
    output = balance.update(reference, last, state, outside)    stabilizer, help by hands, lean

In position control the feet yield to the measured wrenches, the QP moves the commanded robot, and the servos get the
torques of the desired wrenches on top. In torque control the desired acceleration of the CoM and the desired wrenches
are tasks of the QP itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from wbc.base.numbers import Array, scalar
from wbc.core.drive.control import DriveControl, State
from wbc.core.robot import Robot
from wbc.tasks.stabilizer.bias import BiasEstimator
from wbc.tasks.stabilizer.distribution import WrenchDistribution
from wbc.tasks.stabilizer.feet import StabilizedFeet
from wbc.tasks.stabilizer.lean import UPRIGHT, Lean, LeanMotion
from wbc.tasks.stabilizer.pendulum import natural_frequency
from wbc.tasks.stabilizer.stabilizer import Stabilizer, StabilizerOutput
from wbc.walking.hands.hands import Hands
from wbc.walking.load import HeldLoad
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Reference


class Balance:
    """Balance of one robot by the stabilizer.

    Attributes:
        stabilizer: Feedback and admittances.
        lean: Lean of the trunk; None keeps it upright.
        bias: Estimator of the error of the measured DCM; None takes it as measured.
        hands: Hands that press on things and hold on to them; None of a robot without.
        load: Load in the hands as estimated; None where none is expected.
        output: Output of the stabilizer in the last tick; None before the first one.
        leaning: Motion of the trunk's lean in that tick.
    """

    output: StabilizerOutput | None = None
    leaning: LeanMotion = UPRIGHT

    def __init__(
        self,
        control: DriveControl,
        feet: StabilizedFeet,
        hands: Hands | None,
        load: HeldLoad | None,
        settings: WalkingControlSettings,
        height: float,
    ) -> None:
        """Make all parts for a robot that stands, with the height of the CoM over the soles while walking, m."""
        s, robot = settings, control.controller.robot
        self._feet, self._robot, self._dt = feet, robot, control.controller.dt
        estimate, soles = control.observer.robot, robot.soles[:2]
        self._soles = [estimate.placement(sole.frame) for sole in soles]
        wrenches = WrenchDistribution.of(robot, soles, s.distribution)
        self.stabilizer = Stabilizer(robot.mass, wrenches, s.gains, yields=not feet.torque)
        omega = natural_frequency(height)
        self._divisor = scalar(omega)  # of velocities in the DCM
        self.lean = None if s.lean is None else Lean(robot.mass, height, s.lean)
        self.bias = None if s.bias is None else BiasEstimator(s.bias.sized(robot.length_scale))
        self.hands, self.load = hands, load
        self._feedforward = s.mode == "position"

    @property
    def wrenches(self) -> Mapping[str, Array] | None:
        """Name of a foot's contact → wrench that the torques are to make in place of the QP's; None for those."""
        output = self.output
        return None if output is None or not self._feedforward else self._feet.wrenches(output)

    def correct(self, state: State, last: Reference | None) -> State:
        """Return the state with the DCM that references are to be compared with; the last ones have driven it.

        While hands grip the state has none: what they hold pulls at the DCM and holds it as well, so that landings stay
        as planned.
        """
        robot, hands = state.robot, self.hands
        dcm = robot.com + robot.com_velocity / self._divisor
        if self.bias is not None:
            dcm[:2] -= self._estimate_bias(self.bias, robot, last)
        if hands is not None and hands.active:
            if hands.gripping:
                return state
            dcm[:2] -= hands.shift  # the plan is that without hands
        return state._replace(dcm=dcm)

    def update(
        self, reference: Reference, last: Reference | None, state: State, outside: Array | None
    ) -> StabilizerOutput:
        """Run stabilizer and lean for one tick, with the wrench on the hands at the world origin, None without one.

        Feet whose contact is another one than in the last references, None in the first tick, begin anew.
        """
        hands, dt, robot, stabilizer = self.hands, self._dt, state.robot, self.stabilizer
        contact = reference.progress.contact
        stabilizer.mass = robot.mass  # with what it carries
        self.output = output = stabilizer.update(
            reference.pendulum,
            robot.com,
            robot.com_velocity,
            state.measurement.wrenches,
            self._soles,
            contact,
            reference.progress.heading,
            dt,
            bias=None if self.bias is None else self.bias.bias,
            outside=outside,
        )
        before = (True, True) if last is None else last.progress.contact
        for side in (0, 1):
            if contact[side] != before[side]:
                stabilizer.feet.reset(side)
        if outside is not None and hands is not None and not output.in_air:
            hands.help(output.feet.shortfall[3:5], output.zmp)
        if self.lean is not None:  # towards the moment that the feet cannot give
            if self.load is not None:
                self.lean.set_mass(self._robot.mass)
            x, y = (0.0, 0.0) if output.in_air else output.feet.shortfall[3:5].tolist()
            self.leaning = self.lean.update((x, y), dt)
        return output

    def _estimate_bias(self, estimator: BiasEstimator, robot: Robot, last: Reference | None) -> Array:
        """Bias of the measured DCM, shape (2,), m; the ZMP is that of the last tick, which has driven the DCM."""
        output = self.output
        if output is None or last is None:
            return estimator.bias
        zmp = output.measured_zmp.tolist()
        in_air = output.in_air or not math.isfinite(zmp[0])
        if in_air or (self.load is not None and self.load.changing):
            estimator.pause()
            return estimator.bias
        omega = last.pendulum.omega
        (x, y, _), (u, v, _) = robot.com.tolist(), robot.com_velocity.tolist()
        return estimator.update((x + u / omega, y + v / omega), zmp, last.progress.heading, omega, self._dt)
