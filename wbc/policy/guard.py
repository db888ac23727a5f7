"""Guard of a policy: the library's own walk takes the robot over, in any phase, where the policy fails."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from wbc.base.checked import checked, fixed
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.drive.control import DriveControl, State
from wbc.core.qp.released import ReleasedJoints
from wbc.core.signals import Command, Measurement
from wbc.ground import ElevationMap, PointCloud
from wbc.policy.control import PolicyControl
from wbc.walking.control import WalkingControl
from wbc.walking.plans.sources import Velocity, VelocityLimits
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Progress
from wbc.walking.steered import SteeredControl

logger = logging.getLogger(__name__)

BEYOND = 4.0
"""Torque that a policy asks for over the limit of its joint from which on it is beside itself. Public policies ask for
0.9 as they walk, and for 1.8 after pushes from which they fall."""


class PolicyGuard(SteeredControl):
    """Control by a policy until it fails, and from then on by the library's walk, which brings the robot to a stand.

        guard = PolicyGuard(PolicyControl(robot, "policy.onnx", dt))
        while guard.fallen is None:
            plant.step(guard.command(plant.measure()))

    A policy is relieved in the tick in which its action is not finite, its network raises an error or takes too long,
    or it asks for torques of more than four times the limits. A push or a tilt is no reason: policies recover from
    pushes after which a gait that takes over falls. `take_over` relieves it at any moment.

    Attributes:
        policy: The policy.
        walking: The walk that takes over, in torque or hybrid control. Its drives share estimate, checks of sensors,
            failures, clock and gate with those of the policy (`DriveControl.share`).
        relieved: Reason for which the policy has been relieved; empty while it controls the robot.
    """

    restarts = True
    policy: PolicyControl = fixed("make another guard")
    walking: WalkingControl = fixed("make another guard")

    @checked
    def __init__(self, policy: PolicyControl, walking: WalkingControl | None = None) -> None:
        """Put a walk beside a policy, both for a robot that stands.

        Args:
            policy: The policy.
            walking: Walk that takes over, made with the observer and the period of the policy; a new one in torque
                control when None. Its reactions to failures and falls, and its ranges of measurements, are those of the
                policy from now on.

        Raises:
            InputError: A walk on another observer, with another period, or one that cannot begin on its way; a policy
                that has a guard.
        """
        robot, dt = policy.controller.robot, policy.controller.dt
        if walking is None:
            settings = WalkingControlSettings(mode="torque")
            walking = WalkingControl(
                robot, None, dt, settings, observer=policy.drives.observer, ground=policy.ground
            )
        walking.check_begin()
        if policy.guarded:
            raise InputError("the policy has a guard already: make another policy for this one")
        walking.drives.share(policy.drives)
        policy.guarded = True
        self.policy, self.walking, self.relieved = policy, walking, ""
        self._ordered = ""  # reason to take over in the next tick
        self._steps = 0  # before the policy began last
        self._warm_up()

    def _warm_up(self) -> None:
        """Let the walk make a tick of a robot at rest, and begin anew, so that its first real tick makes nothing."""
        policy, estimate = self.policy, self.walking.drives.observer.robot
        q, m = np.array(estimate.q), Measurement.resting(estimate)
        state = State(estimate, m, m.wrenches[:, 2], m, ok=True)
        self.walking.begin(state)
        self.walking.act(state)
        policy.reset(q)
        self.walking.begin(state)

    def act(self, state: State) -> Command:
        """End a tick by the policy, or by the walk."""
        if self.relieved:
            return self.walking.act(state)
        decided = self.policy.decide(state)
        reason, self._ordered = self._ordered or self._failure(state), ""
        if not reason:
            return self.policy.drives.relay(decided, self.policy.servos)
        logger.error("the policy is relieved: %s", reason)
        self.relieved, contacts = reason, self.policy.contacts
        self.walking.begin(state, contacts.air, contacts.landed)
        return self.walking.act(state)

    def take_over(self, reason: str = "asked for") -> None:
        """Relieve the policy in the next tick, at any moment of its walk."""
        self._ordered = reason

    def hand_back(self) -> None:
        """Let the policy control the robot again, from a stand; `take_over` in the same tick is taken back.

        What is asked for is what the walk was asked for last, a stand as a rule, and not what the policy was before.

        Raises:
            InputError: The robot does not stand.
        """
        self._ordered = ""
        if not self.relieved:
            return
        if self.fallen is not None or not self.walking.stands:
            raise InputError("a robot must stand before a policy controls it again")
        self._steps = self.steps_done
        self.policy.resume()
        self._policy_again()

    def release(self, joints: Sequence[str]) -> ReleasedJoints | None:
        """Leave joints to somebody else, whoever controls the robot; see `PolicyControl.release`.

        The joints that are returned are those of the one who controls the robot now. The other one goes by what is
        measured of them. What one of them refuses is released by neither, and joints released before stay so.
        """
        self.policy.controller.check_release(joints)
        self.walking.release(joints)
        self.policy.release(joints)
        return self.drives.released

    def reset(self, q: Array | None = None) -> None:
        """Let the policy begin anew from a configuration at rest, shape (nq,); half-sitting when None."""
        self.policy.reset(q)
        self._steps = 0
        self._policy_again()

    def _policy_again(self) -> None:
        """Let the policy control the robot, and the QP of the walk be made before it takes over again."""
        if self.relieved:
            self.policy.velocity = self.walking.velocity
        self.walking.controller.reset()
        self.relieved = self._ordered = ""

    def _failure(self, state: State) -> str:
        """Return how the policy fails in this tick; empty if it goes on."""
        policy = self.policy
        if not state.ok or policy.drives.damped:
            return ""
        if policy.network_error is not None:
            return str(policy.network_error)
        if policy.acted:
            robot = policy.controller.robot
            far = np.abs(policy.asked(state.measurement)) > BEYOND * robot.torque_limit
            if far.any():
                return f"it asks for more than {BEYOND:g} times the torque of {robot.joint_names[int(far.argmax())]}"
        return ""

    @property
    def acting(self) -> PolicyControl | WalkingControl:
        """Control that acts now: policy or walk."""
        return self.walking if self.relieved else self.policy

    @property
    def drives(self) -> DriveControl:  # type: ignore[override]  # nobody assigns them
        """Drives of the one who controls the robot now."""
        return self.acting.drives

    @property
    def velocity(self) -> Velocity | None:
        """Velocity that is asked for of the one who controls the robot now; see `WalkingControl.velocity`."""
        return self.acting.velocity

    @velocity.setter
    def velocity(self, value: Sequence[float] | None) -> None:
        self.acting.velocity = value

    @property
    def velocity_limits(self) -> VelocityLimits:
        """Largest velocities of the one who controls the robot now."""
        return self.acting.velocity_limits

    def stop(self) -> None:
        """Come to a stand."""
        self.acting.stop()

    def see(self, seen: PointCloud | ElevationMap) -> None:
        """Take a cloud of points or a map of the ground, for policy and walk."""
        self.policy.see(seen)
        if self.walking.ground is not self.policy.ground:
            self.walking.see(seen)

    @property
    def done(self) -> bool:
        """True once the robot stands, and nothing else is asked of it."""
        return self.acting.done

    @property
    def progress(self) -> Progress:
        """Phase of the feet and number of steps, of the one who controls the robot now."""
        return self.acting.progress

    @property
    def steps_done(self) -> int:
        """Number of steps of the policy and of the walk."""
        return self._steps + self.policy.steps_done + (self.walking.steps_done if self.relieved else 0)

    def status(self) -> str:
        """Return in one line how the control is; see `DriveControl.status`."""
        status = self.acting.status()
        return f"policy relieved ({self.relieved}); {status}" if self.relieved else status
