"""Rig: one foot under a loaded carriage on a ground, as data (`FootTest`) and as a simulation (`Rig`)."""

from __future__ import annotations

import copy
import math
from dataclasses import field, replace
from typing import Annotated, Any

import mujoco
import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.base.errors import InputError, ModelError
from wbc.base.numbers import Array
from wbc.base.settings import Angle, NonNegative, Number, Positive, settings, to_json
from wbc.feet import Foot, foot
from wbc.feet.soles.build_mjcf import quaternion_wxyz
from wbc.feet.soles.catalog import foot_name
from wbc.feet.soles.foot import AnkleSole
from wbc.sim.plant.contacts import Contacts
from wbc.sim.plant.mujoco_robot import BAD_STATE, divergence
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.simulation.simulation import DivergedError
from wbc.sim.terrain.giving import surfaces
from wbc.sim.terrain.render import add_to_spec
from wbc.sim.terrain.spec import Terrain, terrain

HRP4C_SOLE = AnkleSole.under_ankle(0.093, 0.160, 0.076)
"""Sole and ankle height of HRP-4C, whose contact rectangle HRP-4J shares (hrp4c_description, BSD-3)."""

ANKLE_INERTIA = 0.1
"""Inertia of the carriage about roll and pitch, kg m²: of the order of a shin about its ankle."""

GUIDE_STIFFNESS = 2000.0
"""Stiffness of the springs that keep the carriage over its place, N/m, critically damped. A rigid guide would drag the
foot over the ground whenever it tilts, and the contacts would stick and slip."""

MIN_CONTACT_SHARE = 0.005
"""Contacts that carry less than this share of the weight are not counted as support: 1 N of 200 N."""

GROUND_GRID = 0.002
"""Grid for the highest point of the ground under a foot, m."""


@settings
class FootTest:
    """Test of one foot under a loaded ankle, over the middle of a ground.

    The ankle slides freely up and down and carries a mass. A servo about roll and pitch holds it level.

    Attributes:
        foot: The foot.
        ground: The ground under it.
        load: Weight of the mass on the ankle, without the weight of the foot, N.
        x: Position of the sole centre relative to the middle of the rough part, m; positive forward.
        y: Position of the sole centre relative to the middle of the track, m; positive to the left.
        yaw: Heading of the foot, rad.
        ankle_stiffness: Stiffness of the servo that holds the ankle level, Nm/rad; 0 leaves roll and pitch free.
        robot_sole: Ankle and sole of the robot that the foot is fitted to.
        drop: Height of the sole over the highest point of the ground below it at the start, m.
        settle: Time from the start until the hold is measured, s.
        hold: Time over which the hold is measured, s.
        physics: Integrator settings.

    Source: the load of 200 N and the drop of 10 mm are those of the stability measurements of the soft foot; 2000
        Nm/rad is the stiffness of the ankle servo in the public walking example of its authors.
    """

    foot: Foot = field(default_factory=lambda: foot("soft"))
    ground: Terrain = field(default_factory=lambda: terrain("flat"))
    load: Annotated[Positive, "N"] = 200.0
    x: Annotated[Number, "m"] = 0.0
    y: Annotated[Number, "m"] = 0.0
    yaw: Angle = 0.0
    ankle_stiffness: Annotated[NonNegative, "Nm/rad"] = 2000.0
    robot_sole: AnkleSole = HRP4C_SOLE
    drop: Annotated[NonNegative, Field(le=1.0), "m"] = 0.01
    settle: Annotated[Positive, "s"] = 1.4
    hold: Annotated[Positive, "s"] = 0.5
    physics: PhysicsSettings = field(default_factory=PhysicsSettings)

    def __post_init__(self) -> None:
        if self.hold < self.physics.timestep or self.settle < self.physics.timestep:
            raise InputError(
                f"settling and hold times must be at least one physics step of {self.physics.timestep:g} s, "
                f"got {self.settle:g} s and {self.hold:g} s"
            )
        if self.physics.gravity == 0.0:
            raise InputError("gravity (m/s²) must be above 0 for a foot test, whose load is a weight; got 0")
        self.foot.fit(self.robot_sole)
        # A height field has to be as fine as this sole's spheres; a coarser one is refused here.
        if self.ground.sole_radius != self.foot.contact.radius:
            object.__setattr__(self, "ground", replace(self.ground, sole_radius=self.foot.contact.radius))

    def describe(self) -> dict[str, Any]:
        """Return foot (with its fit), ground, load and place as JSON values; the names contain the units."""
        return {
            "foot": foot_name(self.foot),
            "foot_parameters": to_json(self.foot),
            **fit_facts(self.foot, self.robot_sole),
            "terrain": self.ground.name,
            "amplitude_m": self.ground.amplitude,
            "seed": self.ground.seed,
            "load_n": self.load,
            "place_m": [self.x, self.y],
            "yaw_rad": self.yaw,
            "ankle_stiffness_nm_per_rad": self.ankle_stiffness,
            "drop_m": self.drop,
            "settle_s": self.settle,
            "hold_s": self.hold,
            "timestep_s": self.physics.timestep,
        }


def fit_facts(design: Foot, own: AnkleSole) -> dict[str, Any]:
    """Return footprint, ankle, added mass and height over a robot's own sole as JSON values; names carry the units."""
    fit = design.fit(own)
    return {
        "footprint_m": [fit.sole.length, fit.sole.width],
        "ankle_in_sole_m": fit.sole.ankle.tolist(),
        "added_mass_kg": fit.added_inertia.mass,
        "height_change_m": float(fit.sole.ankle[2] - own.ankle[2]),
    }


class Rig:
    """Simulation of a foot test, with the names of the foot's parts (`foot`)."""

    def __init__(self, test: FootTest) -> None:
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
        self._surfaces = surfaces(self.model, [self.foot], test.ground)
        body = self.model.body(self.foot.body)
        of_carriage = self.model.body_rootid == body.rootid
        self._contacts = Contacts(self.model, of_carriage, [int(body.id)], [pin.SE3.Identity()])
        self.mass = float(self.model.body_mass.sum())
        self._lift = int(self.model.joint("lift").dofadr[0])
        arch = () if self.foot.arch_joint is None else (self.foot.arch_joint,)
        self._joints = [
            np.array([self.model.joint(name).id for name in names], dtype=int)
            for names in (self.foot.sole_joints, arch)
        ]
        mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """Advance by one physics step; `DivergedError` if the state is no longer finite, or is about to be."""
        mujoco.mj_step(self.model, self.data)
        for surface in self._surfaces:
            surface.adapt(self.model, self.data)
        if why := divergence(self.data, BAD_STATE):
            raise DivergedError(f"the rig has diverged after {self.data.time:.3f} s ({why})")

    def steps(self, duration: float) -> int:
        """Return the number of physics steps in a time (s), at least one."""
        return max(1, round(duration / self.test.physics.timestep))

    def fork(self) -> Rig:
        """Return an independent rig in the same state; its floor, too, gives and slides on its own."""
        twin = copy.copy(self)
        twin.model, twin.data = copy.copy(self.model), copy.copy(self.data)
        twin._surfaces = [copy.copy(surface) for surface in self._surfaces]
        return twin

    @property
    def weight(self) -> float:
        """Weight of carriage and foot together, N."""
        return self.mass * self.test.physics.gravity

    @property
    def vertical_force(self) -> float:
        """Sum of the vertical contact forces, N: the constraint force on the free vertical slide."""
        return float(self.data.qfrc_constraint[self._lift])

    @property
    def ankle(self) -> Array:
        """Place of the ankle in the world, shape (3,), m."""
        return np.asarray(self.data.body(self.test.robot_sole.ankle_link).xpos)

    @property
    def ankle_speed(self) -> float:
        """Upward speed of the ankle, m/s."""
        return float(self.data.qvel[self._lift])

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch of the ankle, rad."""
        return float(self.data.joint("roll").qpos[0]), float(self.data.joint("pitch").qpos[0])

    def set_tilt(self, roll: float, pitch: float) -> None:
        """Command the roll and pitch of the ankle servo, rad."""
        self.data.ctrl[:] = (roll, pitch)

    @property
    def powers(self) -> Array:
        """Power that the dampers of the sole and that of the frontal arch turn into heat, shape (2,), W."""
        dofs = [self.model.jnt_dofadr[joints] for joints in self._joints]
        return np.array([self.model.dof_damping[dof] @ self.data.qvel[dof] ** 2 for dof in dofs])

    @property
    def mean_square_rate(self) -> float:
        """Mean square of the rates of all sole hinges, (rad/s)²; 0 for a rigid sole."""
        rates = self.data.qvel[self.model.jnt_dofadr[self._joints[0]]]
        return float(np.mean(rates**2)) if rates.size else 0.0

    @property
    def spring_energy(self) -> float:
        """Energy stored in the springs of sole and arch, J."""
        model, q = self.model, self.data.qpos
        return float(sum(0.5 * model.jnt_stiffness[j] @ q[model.jnt_qposadr[j]] ** 2 for j in self._joints))

    @property
    def depth(self) -> float:
        """Deepest penetration now, m."""
        return -float(self.data.contact.dist.min()) if self.data.ncon else 0.0

    @property
    def angles(self) -> Array:
        """Angles of the sole hinges from the toe to the heel, shape (phalanges,), rad."""
        return np.asarray(self.data.qpos[self.model.jnt_qposadr[self._joints[0]]])

    @property
    def loop_gap(self) -> float:
        """Distance between the two sides of the loop closure, m; 0 without a loop."""
        if self.foot.loop_sites is None:
            return 0.0
        arch, sole = (self.data.site(name).xpos for name in self.foot.loop_sites)
        return float(np.linalg.norm(arch - sole))

    def contacts(self, share: float = 0.0) -> tuple[Array, Array]:
        """Return points, m, and forces on the foot, N, of the contacts that carry more than a share of the weight.

        Both are in the world and have the shape (n, 3).
        """
        self._contacts.capture(self.data)
        points, forces, _ = self._contacts.of_robot()
        carry = np.linalg.norm(forces, axis=1) > share * self.weight
        return points[carry], forces[carry]

    def in_plan(self, points: Array) -> Array:
        """Return world points as seen from above: forward and left of the sole centre under the ankle, (n, 2), m."""
        return np.asarray((points[:, :2] - self.ankle[:2]) @ self._heading + self.foot.fit.sole.ankle[:2])

    def centre_of_pressure(self, share: float = -math.inf, least: float = 0.0) -> Array:
        """Return the centre of pressure in plan, shape (2,), m, of contacts that push up with a share of the weight.

        A contact on the flank of a stone may push sideways and down: with a negative weight it would move the centre
        out of the sole. It is NaN where these contacts together bear nothing, or less than the `least` share.
        """
        points, forces = self.contacts()
        lift = np.where(forces[:, 2] >= share * self.weight, forces[:, 2], 0.0)
        total = float(lift.sum())
        if total <= 0.0 or total < least * self.weight:
            return np.full(2, np.nan)
        return np.asarray(self.in_plan(lift @ points[:, :2][None] / total)[0])

    def sole_line(self) -> Array:
        """Return the contact spheres' lowest points in plan and world z, row by row from the toe, (n, 3), m."""
        ids = [self.model.geom(name).id for name in self.foot.contact_geoms]
        lowest = self.data.geom_xpos[ids] - np.array([0.0, 0.0, self.test.foot.contact.radius])
        return np.column_stack([self.in_plan(lowest), lowest[:, 2]])

    def skeleton(self) -> Array:
        """Return heel hinge, ankle and arch tip (rigid foot: sole centre, ankle) in plan and world z, (n, 3), m."""
        foot, data = self.foot, self.data
        points = [data.site(foot.wrench_site).xpos, self.ankle]
        if foot.sole_joints:
            points[0] = data.joint(foot.sole_joints[-1]).xanchor
        if foot.loop_sites is not None:
            points.append(data.site(foot.loop_sites[0]).xpos)
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
