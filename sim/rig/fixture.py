"""Rig: simulation of one foot under a loaded carriage in MuJoCo."""

from __future__ import annotations

import copy
import math
from typing import Any

import mujoco
import numpy as np

from wbc.core.errors import Array, ModelError
from wbc.core.hull import hull_and_area
from wbc.feet.soles.common_mjcf import quaternion_wxyz
from wbc.feet.soles.runtime_mjcf import GroundContacts, SoleProbe
from wbc.sim.rig.spec import FootTest
from wbc.sim.terrain.render import add_to_spec

ANKLE_INERTIA = 0.1
"""Inertia of the carriage about roll and pitch, kg m²: of the order of a shin about its ankle."""

GUIDE_STIFFNESS = 2000.0
"""Stiffness of the springs that keep the carriage over its place, N/m, critically damped. A rigid guide would drag the
foot over the ground whenever it tilts, and the contacts would stick and slip."""

MIN_CONTACT_SHARE = 0.005
"""Contacts that carry less than this share of the weight are not counted as support: 1 N of 200 N."""

GROUND_GRID = 0.002
"""Grid for the highest point of the ground under a foot, m."""


class Rig:
    """Simulation of a foot test.

    Attributes:
        test: Foot, ground and load.
        model: Compiled MuJoCo model.
        data: Its MuJoCo state.
        foot: Names of the foot's parts.
        probe: Ground truth of the foot.
        mass: Mass of carriage and foot together, kg.
        centre: World x and y of the sole centre at the start, m.
    """

    def __init__(self, test: FootTest) -> None:
        """Build the rig and put the foot over the ground."""
        self.test = test
        fitted = test.foot.fit(test.robot_sole).sole
        cos, sin = math.cos(test.yaw), math.sin(test.yaw)
        self._heading = np.array([[cos, -sin], [sin, cos]])
        self.centre = np.array([(test.ground.start + test.ground.stop) / 2.0 + test.x, test.y])
        ankle_place = self.centre + self._heading @ fitted.ankle[:2]
        margin = test.foot.contact.radius
        top = self._highest(fitted.length / 2.0 + margin, fitted.width / 2.0 + margin)

        spec = mujoco.MjSpec()
        test.physics.apply(spec)
        add_to_spec(spec, test.ground)
        carriage = spec.worldbody.add_body(
            name="carriage",
            pos=[*ankle_place, top + float(fitted.ankle[2]) + test.drop],
            quat=[math.cos(test.yaw / 2.0), 0.0, 0.0, math.sin(test.yaw / 2.0)],
            mass=test.load / test.physics.gravity,
            inertia=[ANKLE_INERTIA] * 3,
            ipos=[0.0, 0.0, 0.0],  # left out, MuJoCo puts the centre of mass elsewhere
            explicitinertial=True,
        )
        slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
        for name, axis in (("forward", [1.0, 0.0, 0.0]), ("left", [0.0, 1.0, 0.0])):
            joint = carriage.add_joint(name=name, type=slide, axis=axis)
            joint.stiffness[0] = GUIDE_STIFFNESS
            joint.damping[0] = 2.0 * math.sqrt(GUIDE_STIFFNESS * carriage.mass)
        carriage.add_joint(name="lift", type=slide, axis=[0.0, 0.0, 1.0])
        for name, axis in (("roll", [1.0, 0.0, 0.0]), ("pitch", [0.0, 1.0, 0.0])):
            carriage.add_joint(name=name, type=hinge, axis=axis)
            if test.ankle_stiffness > 0.0:
                _add_servo(spec, name, test.ankle_stiffness)
        x, y, z, w = test.robot_sole.rotation
        ankle = carriage.add_body(name=test.robot_sole.ankle_link, quat=quaternion_wxyz((-x, -y, -z, w)))
        self.foot = test.foot.build(spec, ankle, "left", test.robot_sole)
        try:
            self.model: mujoco.MjModel = spec.compile()
        except ValueError as error:
            raise ModelError(f"MuJoCo cannot compile the foot: {error}") from error
        self.data = mujoco.MjData(self.model)
        self.probe = SoleProbe(self.model, self.foot)
        self.mass = float(self.model.body_mass.sum())
        self._dof = {name: int(self.model.joint(name).dofadr[0]) for name in ("lift", "pitch")}
        arch = () if self.foot.arch_joint is None else (self.foot.arch_joint,)
        self._sole_joints, self._arch_joint = (
            np.array([self.model.joint(name).id for name in names], dtype=int)
            for names in (self.foot.sole_joints, arch)
        )
        mujoco.mj_forward(self.model, self.data)

    def step(self, count: int = 1) -> None:
        """Advance by physics steps."""
        mujoco.mj_step(self.model, self.data, nstep=count)

    def steps(self, duration: float) -> int:
        """Return the number of physics steps in a time (s), at least one."""
        return max(1, round(duration / self.test.physics.timestep))

    def fork(self) -> Rig:
        """Return an independent rig in the same state."""
        twin = copy.copy(self)
        twin.data = copy.copy(self.data)
        return twin

    @property
    def diverged(self) -> bool:
        """True once the state is no longer finite, or MuJoCo has warned that it is about to be."""
        kinds = mujoco.mjtWarning
        bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
        finite = np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all()
        return not finite or any(self.data.warning[int(kind)].number > 0 for kind in bad)

    @property
    def vertical_force(self) -> float:
        """Sum of the vertical contact forces, N: the constraint force on the free vertical slide."""
        return float(self.data.qfrc_constraint[self._dof["lift"]])

    @property
    def ankle_height(self) -> float:
        """World z of the ankle, m."""
        return float(self.data.body(self.test.robot_sole.ankle_link).xpos[2])

    @property
    def ankle_position(self) -> tuple[float, float]:
        """World x and y of the ankle, m."""
        x, y, _ = self.data.body(self.test.robot_sole.ankle_link).xpos.tolist()
        return x, y

    @property
    def ankle_speed(self) -> float:
        """Upward speed of the ankle, m/s."""
        return float(self.data.qvel[self._dof["lift"]])

    @property
    def pitch_moment(self) -> float:
        """Moment of the contact forces about the ankle's pitch axis, Nm."""
        return float(self.data.qfrc_constraint[self._dof["pitch"]])

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch of the ankle, rad."""
        return float(self.data.joint("roll").qpos[0]), float(self.data.joint("pitch").qpos[0])

    def set_tilt(self, roll: float, pitch: float) -> None:
        """Command the roll and pitch of the ankle servo, rad."""
        self.data.ctrl[:] = (roll, pitch)

    @property
    def sole_rates(self) -> Array:
        """Rates of all sole hinges, rad/s."""
        return np.asarray(self.data.qvel[self.model.jnt_dofadr[self._sole_joints]])

    @property
    def sole_power(self) -> float:
        """Power that the dampers of the sole turn into heat, W."""
        return self._heat(self._sole_joints)

    @property
    def arch_power(self) -> float:
        """Power that the damper of the frontal arch turns into heat, W."""
        return self._heat(self._arch_joint)

    def _heat(self, joints: np.ndarray[Any, Any]) -> float:
        dof = self.model.jnt_dofadr[joints]
        return float(self.model.dof_damping[dof] @ self.data.qvel[dof] ** 2)

    @property
    def spring_energy(self) -> float:
        """Energy stored in the springs of sole and arch, J."""
        model, q = self.model, self.data.qpos
        parts = (self._sole_joints, self._arch_joint)
        return float(sum(0.5 * model.jnt_stiffness[j] @ q[model.jnt_qposadr[j]] ** 2 for j in parts))

    def contacts(self, min_force: float = 0.0) -> GroundContacts:
        """Return the contacts that carry more than a normal force (N), in the world."""
        return self.probe.contacts(self.model, self.data, min_force)

    @property
    def min_contact_force(self) -> float:
        """Smallest normal force of a contact that counts as support, N."""
        return MIN_CONTACT_SHARE * self.mass * self.test.physics.gravity

    def contact_area(self) -> float:
        """Return the area of the convex hull of the supporting contact points in plan, m²."""
        return hull_and_area(self.in_plan(self.contacts(self.min_contact_force).points))[1]

    def in_plan(self, points: Array) -> Array:
        """Return world points as seen from above: forward and left of the sole centre under the ankle, (n, 2), m."""
        ankle = self.data.body(self.test.robot_sole.ankle_link).xpos[:2]
        return np.asarray((points[:, :2] - ankle) @ self._heading + self.foot.fit.sole.ankle[:2])

    def centre_of_pressure(self) -> Array:
        """Return the centre of pressure in plan, shape (2,), m; NaN without load."""
        return np.asarray(self.in_plan(self.contacts().centre_of_pressure[None, :])[0])

    def supporting_centre(self, least: float) -> Array:
        """Return the centre of pressure of the contacts that push up enough to count as support, in plan, (2,), m.

        A contact on the flank of a stone may push sideways and down: with a negative weight it would move the centre
        out of the sole. It is NaN where these contacts together bear less than a share of the weight.
        """
        contacts = self.contacts()
        lift = np.where(contacts.forces[:, 2] >= self.min_contact_force, contacts.forces[:, 2], 0.0)
        total = float(lift.sum())
        if total < least * self.mass * self.test.physics.gravity:
            return np.full(2, np.nan)
        return np.asarray(self.in_plan(lift @ contacts.points[:, :2][None] / total)[0])

    def sole_line(self) -> Array:
        """Return the contact spheres' lowest points in plan and world z, row by row from the toe, (n, 3), m."""
        ids = [self.model.geom(name).id for name in self.foot.contact_geoms]
        lowest = self.data.geom_xpos[ids] - np.array([0.0, 0.0, self.test.foot.contact.radius])
        return np.column_stack([self.in_plan(lowest), lowest[:, 2]])

    def skeleton(self) -> Array:
        """Return heel hinge, ankle and arch tip (rigid foot: sole centre, ankle) in plan and world z, (n, 3), m."""
        points = [self.data.body(self.test.robot_sole.ankle_link).xpos]
        if self.foot.sole_joints:
            points.insert(0, self.data.joint(self.foot.sole_joints[-1]).xanchor)
            if self.foot.loop_sites is not None:
                points.append(self.data.site(self.foot.loop_sites[0]).xpos)
        else:
            points.insert(0, self.data.site(self.foot.wrench_site).xpos)
        place = np.array(points)
        return np.column_stack([self.in_plan(place), place[:, 2]])

    def _highest(self, half_length: float, half_width: float) -> float:
        """Return the highest point of the ground under a rectangle around the sole, m."""
        x = np.linspace(-half_length, half_length, math.ceil(2.0 * half_length / GROUND_GRID) + 1)
        y = np.linspace(-half_width, half_width, math.ceil(2.0 * half_width / GROUND_GRID) + 1)
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) @ self._heading.T + self.centre
        return float(self.test.ground.height(grid[:, 0], grid[:, 1]).max())


def _add_servo(spec: mujoco.MjSpec, joint: str, stiffness: float) -> None:
    """Hold a joint of the carriage at its control value, critically damped."""
    damping = 2.0 * math.sqrt(stiffness * ANKLE_INERTIA)
    servo = spec.add_actuator(
        name=f"{joint}_servo",
        target=joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
    )
    servo.gainprm[0] = stiffness
    servo.biasprm[:3] = (0.0, -stiffness, -damping)
