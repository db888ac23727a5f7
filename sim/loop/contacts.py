"""Forces on the soles of a robot in any MuJoCo model, from the contacts of a physics step."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from wbc.core.conventions import Index
from wbc.core.errors import Array
from wbc.core.vectors import add_cross


class SoleContacts:
    """Contacts of the robot with everything else, and the wrench on each sole.

    Everything that touches a foot counts, whichever geom of it: the ground, objects, the other leg.

    Attributes:
        geom_robot: True for geoms of the robot, shape (ngeom,).
        geom_sole: Index of the sole to whose foot a geom belongs, −1 for none, shape (ngeom,).
    """

    def __init__(self, model: mujoco.MjModel, root: int, feet: list[int], placements: list[pin.SE3]) -> None:
        """Find the geoms of the feet: body of the base, bodies that carry the soles, sole frames in these."""
        self._model, self._feet = model, np.array(feet, dtype=np.intp)
        self._offset = np.array([place.translation for place in placements])
        self._turn = np.array([place.rotation for place in placements])
        sole = np.full(model.nbody, -1, dtype=np.intp)
        for i, body in enumerate(feet):
            sole[body] = i
        for body in range(1, model.nbody):  # a parent's number is below its children's
            if sole[body] < 0:
                sole[body] = sole[model.body_parentid[body]]
        self.geom_sole: Index = sole[model.geom_bodyid]
        self.geom_robot = model.body_rootid[model.geom_bodyid] == model.body_rootid[root]
        self._force = np.zeros(6)

    def wrenches(self, data: mujoco.MjData) -> Array:
        """Return the wrench on each sole in the last physics step, in the sole frame, shape (n, 6), N and Nm.

        After `mj_step` contacts and frames are those at the begin of that step.
        """
        world = np.zeros((len(self._feet), 6))
        rotation = data.xmat[self._feet].reshape(-1, 3, 3)
        origin = data.xpos[self._feet] + np.einsum("nij,nj->ni", rotation, self._offset)
        first, second = self._geoms(data)
        one, two = self.geom_sole[first], self.geom_sole[second]
        counted = np.flatnonzero((one != two) & (first >= 0) & (second >= 0))  # below 0: of a flexible body
        if counted.size:
            force, moment = self._in_world(data, counted)
            moment += _cross(data.contact.pos[counted], force)
            for sole, place in enumerate(origin.tolist()):
                sign = np.subtract(two[counted] == sole, one[counted] == sole, dtype=float)
                pull = sign.dot(force)
                world[sole, :3] = pull
                world[sole, 3:] = sign.dot(moment) - add_cross((0.0, 0.0, 0.0), place, pull.tolist())
        axes = rotation @ self._turn
        world[:, :3] = np.einsum("nji,nj->ni", axes, world[:, :3])
        world[:, 3:] = np.einsum("nji,nj->ni", axes, world[:, 3:])
        return world

    def of_robot(self, data: mujoco.MjData) -> tuple[Array, Array, Index]:
        """Return points, forces on the robot (both in the world) and soles of its contacts with everything else."""
        first, second = self._geoms(data)
        mine, theirs = self.geom_robot[first], self.geom_robot[second]
        counted = np.flatnonzero((mine != theirs) & (first >= 0) & (second >= 0))
        force, _ = self._in_world(data, counted)
        touching = force.any(axis=1)
        counted, force = counted[touching], force[touching]
        ours = theirs[counted]  # the second geom is the robot's
        geom = np.where(ours, second[counted], first[counted])
        return data.contact.pos[counted], np.where(ours, 1.0, -1.0)[:, None] * force, self.geom_sole[geom]

    def _geoms(self, data: mujoco.MjData) -> tuple[Index, Index]:
        """Return the first and the second geom of every contact, −1 for a flexible body's."""
        pairs = data.contact.geom.astype(np.intp).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def _in_world(self, data: mujoco.MjData, contacts: Index) -> tuple[Array, Array]:
        """Return force and moment on the second geom of each of some contacts, in the world, each of shape (n, 3)."""
        local = np.empty((contacts.size, 6))
        for row, index in zip(local, contacts.tolist(), strict=True):
            mujoco.mj_contactForce(self._model, data, index, self._force)
            row[:] = self._force
        axes = data.contact.frame[contacts].reshape(-1, 3, 3)
        return np.einsum("nij,ni->nj", axes, local[:, :3]), np.einsum("nij,ni->nj", axes, local[:, 3:])


def _cross(a: Array, b: Array) -> Array:
    """Return a × b of rows: `np.cross` takes three times as long for so few."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.column_stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))
