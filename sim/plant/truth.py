"""Ground truth: the true state of the simulation, for logs, tests and pictures, never for a controller."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from wbc.core.conventions import Index, configuration_from_mujoco, velocity_from_mujoco
from wbc.core.errors import Array
from wbc.sim.plant.model import PlantModel


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """The state of the simulation at one instant.

    Attributes:
        time: s.
        q: Configuration, shape (nq,), in Pinocchio's convention.
        v: Velocity, shape (nv,), base in the base frame.
        com: Centre of mass of everything, feet included, in the world, shape (3,), m.
        com_velocity: Its velocity in the world, shape (3,), m/s.
        joint_torque: Torque of the servos in the physics step that ended now, after the torque limit, shape (na,), Nm.
        contact_position: Points of contact with the ground in that step, in the world, shape (n, 3), m.
        contact_force: Force of the ground on the robot at each of them, in the world, shape (n, 3), N.
        contact_sole: Index of the sole that each contact belongs to, −1 for other parts, shape (n,).
        sole_wrench: Sum of the contacts of each sole, [force; moment] in the sole frame at the sole centre,
            shape (number of soles, 6), N and Nm; without the weight of the foot, which the sensor includes.
    """

    time: float
    q: Array
    v: Array
    com: Array
    com_velocity: Array
    joint_torque: Array
    contact_position: Array
    contact_force: Array
    contact_sole: Index
    sole_wrench: Array


class TruthReader:
    """Reader of the ground truth of a simulation.

    Forces exist only during a physics step: `capture` copies those of the step that has just ended, before the next one
    begins.
    """

    def __init__(self, plant: PlantModel) -> None:
        """Find the soles in the model."""
        self._plant = plant
        self._sites = np.array(plant.sole_sites, dtype=np.intp)

    def capture(self, data: mujoco.MjData) -> None:
        """Copy the contacts of the physics step that has just ended, before the next `mj_step1`."""
        contact = data.contact
        self._address = contact.efc_address.copy()
        self._position = contact.pos.copy()
        self._frame = contact.frame.copy()
        self._geom = contact.geom.copy()
        self._dim = contact.dim.copy()
        self._force = data.efc_force.copy()
        self._sole_position = data.site_xpos.take(self._sites, axis=0)
        self._sole_rotation = data.site_xmat.take(self._sites, axis=0)

    def read(self, data: mujoco.MjData, joint_torque: Array) -> GroundTruth:
        """Return the ground truth in new arrays, with the torques in the last step, shape (na,), Nm."""
        plant = self._plant
        q = configuration_from_mujoco(data.qpos, plant.joint_qpos)
        v = velocity_from_mujoco(q, data.qvel, plant.joint_dof)
        mujoco.mj_subtreeVel(plant.model, data)
        position, force, moment, sole = self._contacts()
        return GroundTruth(
            time=data.time,
            q=q,
            v=v,
            com=data.subtree_com[plant.base].copy(),
            com_velocity=data.subtree_linvel[plant.base].copy(),
            joint_torque=joint_torque.copy(),
            contact_position=position,
            contact_force=force,
            contact_sole=sole,
            sole_wrench=self._wrenches(position, force, moment, sole),
        )

    def _contacts(self) -> tuple[Array, Array, Array, Index]:
        """Return positions, forces, moments (both in the world, on the robot) and soles of the loaded contacts."""
        active = np.flatnonzero(self._address >= 0)
        if self._plant.furnished:  # things may touch each other
            robot = self._plant.geom_robot[self._geom[active]]
            active = active[robot[:, 0] != robot[:, 1]]
        if not active.size:
            return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.intp)
        frame = self._frame[active].reshape(-1, 3, 3)
        geom = self._geom[active]
        # Elliptic cones: the rows of a contact are its force in the contact frame, normal first, then its moment.
        rows = np.arange(6)
        place = np.minimum(self._address[active, None] + rows, self._force.size - 1)
        local = np.where(rows < self._dim[active, None], self._force[place], 0.0)
        # The normal points from the first geom to the second, and the force is what the second one feels.
        second = self._plant.geom_robot[geom[:, 1]]
        local *= np.where(second, 1.0, -1.0)[:, None]
        force, moment = (np.matmul(part[:, None, :], frame)[:, 0] for part in (local[:, :3], local[:, 3:]))
        mine = np.where(second, geom[:, 1], geom[:, 0])
        return self._position[active], force, moment, self._plant.geom_sole[mine]

    def _wrenches(self, position: Array, force: Array, moment: Array, sole: Index) -> Array:
        wrench = np.zeros((self._sites.size, 6))
        for i in range(self._sites.size):
            mine = np.flatnonzero(sole == i)
            f, rotation = force[mine], self._sole_rotation[i].reshape(3, 3)
            s = (position[mine] - self._sole_position[i]).T @ f  # Σ r × f is its antisymmetric part
            turning = np.array([s[1, 2] - s[2, 1], s[2, 0] - s[0, 2], s[0, 1] - s[1, 0]])
            wrench[i, :3] = f.sum(axis=0) @ rotation
            wrench[i, 3:] = (turning + moment[mine].sum(axis=0)) @ rotation
        return wrench
