"""Where the live view takes its poses and forces from: a plant, or a robot model that somebody updates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wbc.app.view.scene import Scene, Snapshot, make_scene
from wbc.app.view.shapes import Part, Shape, VisualBox, VisualCylinder, VisualEllipsoid, robot_parts
from wbc.core.errors import Array, InputError, finite_array
from wbc.core.robot import GRAVITY, Robot
from wbc.robots import RobotDescription
from wbc.sim.terrain import Terrain
from wbc.walking.stabilizer.zmp import NoContactForceError, cop, zmp

if TYPE_CHECKING:
    from wbc.sim import Plant

Force = tuple[str, Array, Array]


class PlantSource:
    """Reads a plant, and never writes to it; soles of its feet that bend are drawn as they are bent."""

    def __init__(self, plant: Plant) -> None:
        """Find the bodies.

        Args:
            plant: The plant.
        """
        import mujoco  # noqa: PLC0415 (there is a plant, so it is there)

        self.plant = plant
        model = plant.model
        parts = robot_parts(plant.description)
        feet = _foot_parts(plant)
        self.scene: Scene = make_scene(
            plant.description.name,
            [*parts, *feet],
            plant.terrain,
            float(plant.truth().com[2] - plant.terrain.surface.floor),
            plant.robot.mass * GRAVITY,
        )
        kind = mujoco.mjtObj.mjOBJ_BODY
        names = [body.removeprefix(FOOT) for body in self.scene.bodies]
        self._ids = np.array([mujoco.mj_name2id(model, kind, name) for name in names])

    def snapshot(self) -> Snapshot:
        """Take the present state down."""
        plant = self.plant
        truth, data = plant.truth(), plant.data
        poses = np.tile(np.eye(4), (self._ids.size, 1, 1))
        poses[:, :3, :3] = data.xmat[self._ids].reshape(-1, 3, 3)
        poses[:, :3, 3] = data.xpos[self._ids]
        position, force, sole = truth.contact_position, truth.contact_force, truth.contact_sole
        forces: list[Force] = []
        for i in range(len(plant.feet)):
            mine = sole == i
            load = force[mine, 2]
            if load.sum() > 0.0:
                point = load @ position[mine] / load.sum()
                forces.append(("ground", point, force[mine].sum(axis=0)))
        forces += [("ground", position[i], force[i]) for i in np.flatnonzero(sole < 0)]
        pushed = np.flatnonzero(data.xfrc_applied[:, :3].any(axis=1))
        forces += [("push", data.xipos[i].copy(), data.xfrc_applied[i, :3].copy()) for i in pushed]
        wrench = np.concatenate([force.sum(axis=0), np.cross(position, force).sum(axis=0)])
        level = float(force[:, 2] @ position[:, 2] / max(force[:, 2].sum(), 1e-9)) if force.size else 0.0
        return Snapshot(plant.time, poses, truth.com, _zmp(wrench, level), forces)


class RobotSource:
    """Draws a robot model: an estimate, a plan, a robot in the laboratory."""

    def __init__(self, description: RobotDescription, terrain: Terrain | None) -> None:
        """Find the links.

        Args:
            description: The robot.
            terrain: The ground; flat when None.
        """
        self._robot = description.robot()
        self.scene: Scene = make_scene(
            description.name,
            robot_parts(description),
            terrain,
            float(self._robot.com[2]),
            self._robot.mass * GRAVITY,
        )
        self._ids = [self._robot.frame_id(body) for body in self.scene.bodies]

    def snapshot(self, state: Robot | Array, sole_wrench: Array | None, time: float) -> Snapshot:
        """Take a state down.

        Args:
            state: A robot of the same model, up to date, or a configuration of shape (nq,).
            sole_wrench: What the ground does to each sole, [force; moment] in the sole frame, shape (number of
                soles, 6), N and Nm.
            time: s.

        Raises:
            InputError: Another robot, or a value of the wrong shape or not finite.
        """
        robot = self._robot
        if isinstance(state, Robot):
            if state.model.nq != robot.nq or state.model.nframes != robot.model.nframes:
                raise InputError(f"the view shows '{robot.name}', not {state!r}")
            robot = state
        else:
            robot.update(finite_array("configuration to show", state, (robot.nq,)), np.zeros(robot.nv))
        poses = np.array([robot.placement(i).homogeneous for i in self._ids])
        forces: list[Force] = []
        total, levels = np.zeros(6), [0.0]
        if sole_wrench is not None:
            wrenches = finite_array("sole wrenches to show", sole_wrench, (len(robot.soles), 6))
            levels = [float(robot.placement(sole.frame).translation[2]) for sole in robot.soles]
            for sole, wrench in zip(robot.soles, wrenches, strict=True):
                place = robot.placement(sole.frame)
                total += place.act(pin.Force(wrench)).vector
                try:
                    point = place.act(np.array([*cop(wrench), 0.0]))
                except NoContactForceError:
                    continue
                forces.append(("ground", point, place.rotation @ wrench[:3]))
        return Snapshot(time, poses, np.array(robot.com), _zmp(total, min(levels)), forces)


FOOT = "foot/"
"""Put before the names of bodies that a plant's feet add, which may be called like links of the robot."""


def _foot_parts(plant: Plant) -> list[Part]:
    """What the feet of a plant add to be looked at: the phalanges of a soft sole, its arch."""
    import mujoco  # noqa: PLC0415

    from wbc.feet.soles.common_mjcf import VISUAL_GROUP  # noqa: PLC0415

    model, parts = plant.model, []
    for geom in np.flatnonzero(model.geom_group == VISUAL_GROUP):
        shape = _geom_shape(int(model.geom_type[geom]), model.geom_size[geom].tolist())
        if shape is None:
            continue
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        placement = np.eye(4)
        placement[:3, :3], placement[:3, 3] = rotation.reshape(3, 3), model.geom_pos[geom]
        red, green, blue, opacity = model.geom_rgba[geom].tolist()
        body = FOOT + str(model.body(model.geom_bodyid[geom]).name)
        parts.append(Part(body, shape, (red, green, blue, opacity), placement))
    return parts


def _geom_shape(kind: int, size: Sequence[float]) -> Shape | None:
    import mujoco  # noqa: PLC0415

    types = mujoco.mjtGeom
    if kind == types.mjGEOM_BOX:
        return VisualBox((2.0 * size[0], 2.0 * size[1], 2.0 * size[2]))
    if kind in (types.mjGEOM_CAPSULE, types.mjGEOM_CYLINDER):
        return VisualCylinder(size[0], 2.0 * size[1], round_ends=kind == types.mjGEOM_CAPSULE)
    if kind == types.mjGEOM_SPHERE:
        return VisualEllipsoid((size[0], size[0], size[0]))
    if kind == types.mjGEOM_ELLIPSOID:
        return VisualEllipsoid((size[0], size[1], size[2]))
    return None


def _zmp(wrench: Array, level: float) -> Array | None:
    """ZMP of a wrench at the world origin in the horizontal plane at a level, m; None without force."""
    try:
        return zmp(wrench, pin.SE3(np.eye(3), np.array([0.0, 0.0, level])))
    except NoContactForceError:
        return None
