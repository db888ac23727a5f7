"""Control by a trained policy: measurements in, references of the servos out, with the library's own estimate."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np

from wbc.base.checked import checked, fixed
from wbc.base.errors import InputError, names_in
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Period, Positive
from wbc.core.drive.control import State
from wbc.core.drive.failures import FailurePolicy
from wbc.core.drive.sensing import SafetySettings
from wbc.core.drive.torque import TorqueControl
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.qp.released import ReleasedJoints
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.ground import KnownGround
from wbc.motion import MotionClip
from wbc.policy.arms import MovedArms, PolicyArms
from wbc.policy.contacts import FootContacts
from wbc.policy.description import PolicyDescription
from wbc.policy.filter import PolicyFilter, TasklessController
from wbc.policy.joints import PolicyJoints
from wbc.policy.network import Network, OnnxNetwork
from wbc.policy.period import PolicyPeriod
from wbc.policy.references import ScannedGround, Tracked, clip_frames
from wbc.policy.steering import PolicySteering
from wbc.policy.terms import Observed
from wbc.walking.plans.sources import Velocity, VelocityLimits
from wbc.walking.source import Progress
from wbc.walking.steered import SteeredControl

logger = logging.getLogger(__name__)

ANOTHER = "make another control"
"""Advice in place of the assignment of a part."""


class PolicyControl(SteeredControl):
    """Control of a robot by a policy that walks, as it is steered.

        policy = PolicyControl(robot, "policy.onnx", plant.control_period)
        policy.velocity = (0.5, 0.0, 0.0)  # at any tick; None for a stand
        while policy.fallen is None:
            plant.step(policy.command(plant.measure()))

    The QP moves the arms, if they are given, beside the policy:

        policy = PolicyControl(robot, "policy.onnx", dt, arms=robot.joint_names[15:])
        hand = policy.controller.add(RelativeFrameTask("left_rubber_hand", "pelvis", axes=("x", "y", "z"), weight=10.0))

    A command has the targets and the gains of the policy for its joints, within the torque limits. The servos of the
    robot hold its other joints in half-sitting. In between two actions the targets stay. The policy sees the estimate
    of the `Observer`, never the truth of a simulation.

    Attributes:
        drives: Torque control with controller and observer. It estimates, looks for faults and falls, and passes the
            commands of the policy on; its QP runs for the arms alone.
        description: Joints, gains, action and observation of the policy.
        network: The network.
        observed: What the terms of the observation read.
        contacts: Contacts of the feet, by their measured loads.
        ground: Known ground, for a policy that sees it; None for a blind one.
        controller: The controller; tasks and limits on the arms are added to it.
        network_error: Error of the last action; None if it was good.
        acted: True if the policy has acted in the last tick.
        guarded: True once a `PolicyGuard` has the policy.
        posture: Task on the posture of the arms; None without arms of the QP.
    """

    restarts = True
    drives: TorqueControl = fixed(ANOTHER)
    description: PolicyDescription = fixed(ANOTHER)
    network: Network = fixed(ANOTHER)
    contacts: FootContacts = fixed(ANOTHER)
    ground: KnownGround | None = fixed(ANOTHER)
    controller: Controller = fixed(ANOTHER)

    @checked
    def __init__(
        self,
        robot: Robot,
        policy: str | Path | Network,
        dt: Period,
        *,
        description: PolicyDescription | None = None,
        arms: Sequence[str] = (),
        filter: PolicyFilter | None = None,
        clip: MotionClip | None = None,
        ground: KnownGround | None = None,
        sees_arms: bool | None = None,
        regain: Annotated[NonNegative, "1/s"] = 0.0,
        longest: Annotated[Positive, "s"] | None = None,
        observer: Observer | None = None,
        failure_policy: FailurePolicy | None = None,
        safety: SafetySettings | None = None,
    ) -> None:
        """Check that the policy fits the robot; it begins with the first tick.

        Args:
            robot: The robot, which stands; it becomes the estimated robot.
            policy: File of an ONNX network, or a network of your own, for which a description is needed.
            dt: Control period, s; the policy's is a multiple of it.
            description: Description; from the file and the TOML file beside it when None.
            arms: Names of joints that the QP of the controller moves, such as those of both arms; not of a leg. The
                policy moves the others.
            filter: Filter that keeps the policy's torques within limits; none when None.
            clip: Motion that the policy tracks; that in its network when None.
            ground: Known ground, made with the robot, for a policy that sees it; clouds and maps are added to it.
            sees_arms: Let the policy see the arms where they are. When None it is shown the arms that the QP moves at
                rest in its default posture, and the arms that it moves where they are. A policy that has trained with
                other arms walks elsewhere than it is asked to.
            regain: Share of the missing velocity that is asked for as well after 1 s, 1/s, as for a load in the hands,
                which makes a policy drift; 0.5 is a good value. The velocity is the estimated one of the CoM. Nothing
                is asked for as well in a stand.
            longest: Longest time that the network may take, s; on a machine at most the period of the policy. None
                for any time. A longer one fails the tick, and a guard takes over.
            observer: Observer of the robot's state; a new one when None.
            failure_policy: Reaction to ticks without a usable measurement or action.
            safety: Ranges of measurements, and the reaction to a fall.

        Raises:
            InputError: A file that cannot be read, a joint that the robot has not, an observation or an action of
                another width than that of the network, a motion or a ground that lacks or that nothing observes, or a
                period of the policy that is no multiple of the control period.
        """
        if arms and filter is not None:
            raise InputError("arms of a policy are those of the QP, or filtered: give arms or filter")
        if isinstance(policy, Network):
            self.network = policy
            if description is None:
                raise InputError("a network of your own needs a description: PolicyDescription(joints=…, …)")
        else:
            self.network = network = OnnxNetwork(policy)
            description = description or PolicyDescription.of(policy, network.metadata)
        self.description = description
        self.controller = Controller(robot, dt) if arms else TasklessController(robot, dt)
        self.drives = TorqueControl(self.controller, observer, failure_policy, safety=safety)
        self.contacts, self.ground = FootContacts(robot, dt), ground
        self._steering, self.guarded = PolicySteering(description, regain), False
        self._rest = np.zeros(robot.na)
        self._rest.setflags(write=False)

        self._joints = joints = PolicyJoints(robot, description)
        n = len(joints.columns)
        self._arms = self._shared(names_in("arms", arms), filter)
        self.posture = self._arms.posture if isinstance(self._arms, MovedArms) else None
        self._sees_arms = bool(sees_arms)
        seen = filter is not None if sees_arms is None else sees_arms
        masked = np.zeros(0) if seen or self._arms is None else self._arms.index
        self._masked = np.isin(joints.columns, masked).nonzero()[0]

        position, velocity, action = np.zeros((3, n))
        self.observed = Observed(
            robot=self.drives.observer.robot,
            position=position,
            velocity=velocity,
            action=action,
            command=self._steering.command,
            phase=self._steering.phase,
            motion=self._tracked(clip),
            ground=self._scanned(ground),
        )
        self._period = PolicyPeriod(self.network, description, self.observed, dt, longest)
        for doubt in self.doubts():
            logger.warning("policy: %s", doubt)
        self._begin_policy()

    def doubts(self) -> tuple[str, ...]:
        """Return parts of the policy that hardly fit the robot, one line each; the control logs it when it is made.

        They are gains that differ from those that the description of the robot states by more than a tenth, joints
        whose default position is beyond their stops, and a network that takes longer than its period.
        """
        found, period = self._joints.doubts(), self.description.period
        if (took := self.network.took) > period:
            found.append(
                f"the network takes {1e3 * took:.1f} ms, longer than its period of {1e3 * period:g} ms"
            )
        return tuple(found)

    def _shared(self, arms: Sequence[str], safe: PolicyFilter | None) -> PolicyArms | None:
        """Let the controller move arms, or filter the policy's; return them."""
        controller, joints = self.controller, self._joints
        if safe is not None:
            return safe.bind(controller)
        if not arms:
            return None
        moved = MovedArms(controller, arms, joints.posture, joints.kd)
        joints.give_up(moved.index)
        return moved

    def _tracked(self, clip: MotionClip | None) -> Tracked | None:
        """Return the motion that the policy tracks: a clip, or that in its network; None without one."""
        robot, about = self.drives.observer.robot, self.description
        if not any(term.name.startswith("motion") for term in about.observation):
            if clip is not None:
                raise InputError("the policy observes no motion: leave it out")
            return None
        anchor = about.anchor or robot.torso_frame
        if clip is None:
            frames = self.network.motion(anchor)
        else:
            frames = clip_frames(robot, clip, self._joints.columns, anchor, about.period)
        return None if frames is None else Tracked(robot, anchor, frames)

    def _scanned(self, ground: KnownGround | None) -> ScannedGround | None:
        """Return the ground that the policy sees; None of a blind policy."""
        if ground is None:
            return None
        if all(term.name != "height_scan" for term in self.description.observation):
            raise InputError("the policy observes no ground: leave it out")
        ground.check_robot(self.drives.observer.robot)
        return ScannedGround(self.drives.observer.robot, self.description.scan, ground)

    @property
    def motion(self) -> Tracked | None:
        """Motion that the policy tracks; None without one."""
        return self.observed.motion

    def release(self, joints: Sequence[str]) -> ReleasedJoints | None:
        """Leave joints to somebody else from the next tick on; the policy sees them at rest in its default posture.

        With `sees_arms=True` it sees them where they are. It is an `InputError` where the QP moves arms or filters
        them: it shares the joints with the policy.
        """
        return self.drives.release(joints)

    @property
    def gains(self) -> tuple[Array, Array]:
        """Stiffness, Nm/rad, and damping, Nms/rad, of the servos in the commands, shape (na,) each."""
        return self._joints.kp.copy(), self._joints.kd.copy()

    def _begin_policy(self) -> None:
        self.network_error: Exception | None = None
        self.acted = False
        self.contacts.reset()
        if self._arms is not None:
            self._arms.reset()
        self._joints.begin()
        self._period.begin()
        self._steering.begin()

    def reset(self, q: Array | None = None) -> None:
        """Restart from a configuration at rest, shape (nq,); half-sitting when None."""
        self.drives.reset(q)
        self._begin_policy()

    def resume(self) -> None:
        """See `TorqueControl.resume`; the policy begins anew."""
        self.drives.resume()
        self._begin_policy()

    @property
    def velocity(self) -> Velocity | None:
        """Velocity that is asked for: ahead and aside, m/s, and turn, rad/s; None for a stand. Assign it at any tick.

        The policy is asked for what is within `PolicyDescription.slowest` and `fastest`.
        """
        return self._steering.velocity

    @velocity.setter
    def velocity(self, value: Sequence[float] | None) -> None:
        self._steering.velocity = value

    @property
    def velocity_limits(self) -> VelocityLimits:
        """Largest velocities that the policy is made for, aside and in turns to either side."""
        return self._steering.limits

    @property
    def progress(self) -> Progress:
        """Phase of the feet and number of steps, by the measured loads."""
        return self.contacts.progress

    @property
    def done(self) -> bool:
        """True when no velocity has been asked for during the last 2 s, and after a fall."""
        return self._steering.done or self.fallen is not None

    def act(self, state: State) -> Command:
        """End a tick: let the policy act once in its period, and return the command of the drives."""
        return self.drives.relay(self.decide(state), self.servos)

    def decide(self, state: State) -> State:
        """Begin to end a tick: let the policy act once in its period; return the state for `DriveControl.relay`.

        The tick has failed in it where the policy has no action that can be used.
        """
        self.acted = False
        if not self.drives.damped:
            self._steering.wait(self.controller.dt)
            if state.ok:
                self.contacts.update(state.measurement.wrenches[:, 2].tolist())
                if self.ground is not None:
                    self.ground.update(state.robot, state.measurement.time)
            if self._period.tick() and state.ok:
                self.acted = True
                try:
                    self.observe(state)
                    self._steering.tick(state.robot)
                    self._period.act()
                    self.aim()
                    self.network_error = None
                except Exception as error:  # of a network of the user's own
                    self.network_error = error
            if state.ok and self.network_error is not None:  # until the next action
                state = self.drives.refuse(state, self.network_error)
        return state

    def observe(self, state: State) -> None:
        """Take the joints of a state into `observed`, before an action; a subclass may change what the policy sees."""
        observed, joints, columns = self.observed, self._joints, self._joints.columns
        observed.position[:] = state.robot.q[7:][columns] - joints.default
        observed.velocity[:] = state.robot.v[6:][columns]
        hidden = self._masked
        if (released := self.drives.released) is not None and not self._sees_arms:
            hidden = released.mask[columns].nonzero()[0]
        observed.position[hidden] = observed.velocity[hidden] = 0.0

    def aim(self) -> Array:
        """Return the targets of all servos after an action, shape (na,), rad; a subclass may change them in place."""
        self._joints.aim(self.observed.action)
        return self._joints.target

    def servos(self, state: State) -> Command:
        """Return the targets with the policy's gains, within the torque limits where the joints are now.

        A joint whose encoder is refused gets the torque of its servo at the predicted position, and no stiffness.
        """
        m, joints, torque, velocity = state.measurement, self._joints, self._rest, self._rest
        target, gains = joints.target, (joints.kp, joints.kd)
        if self._arms is not None:
            if self.drives.failing:
                self._arms.forget_rate()
            torque, target, velocity = self._arms.servos(m, target, self.asked(m))
        measured = self.drives.joints(state)
        if (lost := np.isnan(measured[0])).any():
            torque = torque + np.where(lost, joints.kp * (target - m.joint_position), 0.0)
        return self.drives.gate.pass_on_with_gains(torque, target, velocity, gains, measured)

    @property
    def changed(self) -> Array:
        """Commanded torques minus those that the policy asked for, in the last tick, shape (na,), Nm."""
        return (self._rest if self._arms is None else self._arms.changed).copy()

    def asked(self, measurement: Measurement) -> Array:
        """Return the torques that the policy asks for where its joints are now, shape (na,), Nm; zeros for others."""
        torque = self._joints.torques(measurement)
        if (released := self.drives.released) is not None:
            torque[released.index] = 0.0
        return torque

    def status(self) -> str:
        """See `DriveControl.status`; the arms have a failure of their own."""
        status, arms = super().status(), self._arms
        if arms is None or not (arms.failure or arms.remark):
            return status
        said = f"arms {arms.otherwise}: {arms.failure}" if arms.failure else arms.remark
        return said if status == "ok" else f"{said}; {status}"
