"""Forces on the soles of a robot in any MuJoCo model, from the contacts of a physics step."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from wbc.core.conventions import Index
from wbc.core.errors import Array


class SoleContacts:
    """Contacts of the robot with everything else, and the wrench on each sole.

    Everything that touches a foot counts, whichever geom of it: the ground, objects, the other leg.

    Attributes:
        geom_robot: True for geoms of the robot, shape (ngeom,).
        geom_sole: Index of the sole to whose foot a geom belongs, −1 for none, shape (ngeom,).
    """

    def __init__(self, model: mujoco.MjModel, root: int, feet: list[int], placements: list[pin.SE3]) -> None:
        """Find the geoms of the feet.

        Args:
            model: The model.
            root: Body of the floating base.
            feet: Body that carries each sole.
            placements: Sole frame in that body.
        """
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

        Args:
            data: The simulation after `mj_step`; its contacts and frames are those at the begin of that step.
        """
        world = np.zeros((len(self._feet), 6))
        rotation = data.xmat[self._feet].reshape(-1, 3, 3)
        origin = data.xpos[self._feet] + np.einsum("nij,nj->ni", rotation, self._offset)
        for i in range(data.ncon):
            contact = data.contact[i]
            first, second = contact.geom
            if first < 0 or second < 0:  # of a flexible body
                continue
            one, two = self.geom_sole[first], self.geom_sole[second]
            if one == two:
                continue
            force, moment = self._in_world(data, i, contact)
            for sole, sign in ((one, -1.0), (two, 1.0)):
                if sole >= 0:
                    world[sole, :3] += sign * force
                    world[sole, 3:] += sign * (moment + np.cross(contact.pos - origin[sole], force))
        axes = rotation @ self._turn
        world[:, :3] = np.einsum("nji,nj->ni", axes, world[:, :3])
        world[:, 3:] = np.einsum("nji,nj->ni", axes, world[:, 3:])
        return world

    def of_robot(self, data: mujoco.MjData) -> tuple[Array, Array, Index]:
        """Return points, forces on the robot (both in the world) and soles of its contacts with everything else."""
        points: list[Array] = []
        forces: list[Array] = []
        soles: list[int] = []
        for i in range(data.ncon):
            contact = data.contact[i]
            first, second = contact.geom
            if first < 0 or second < 0 or self.geom_robot[first] == self.geom_robot[second]:
                continue
            force, _ = self._in_world(data, i, contact)
            if not force.any():
                continue
            mine, sign = (second, 1.0) if self.geom_robot[second] else (first, -1.0)
            points.append(np.array(contact.pos))
            forces.append(sign * force)
            soles.append(int(self.geom_sole[mine]))
        shape = (len(points), 3)
        return np.reshape(points, shape), np.reshape(forces, shape), np.array(soles, dtype=np.intp)

    def _in_world(self, data: mujoco.MjData, index: int, contact: mujoco.MjContact) -> tuple[Array, Array]:
        """Return force and moment on the second geom of a contact, in the world."""
        mujoco.mj_contactForce(self._model, data, index, self._force)
        frame = contact.frame.reshape(3, 3)  # rows: normal from the first geom to the second, tangents
        return self._force[:3] @ frame, self._force[3:] @ frame
