"""Sources of snapshots: a plant, or a robot model that the caller updates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wbc.app.scene.robot_shapes import robot_parts
from wbc.app.scene.scene import Scene, Snapshot, make_scene
from wbc.app.scene.shapes import Part, Shape, box, cylinder, ellipsoid, sphere
from wbc.core.errors import Array, InputError, finite_array
from wbc.core.robot import GRAVITY, Robot
from wbc.robots import RobotDescription
from wbc.sim.terrain.spec import Terrain
from wbc.tasks.stabilizer.zmp import NoContactForceError, cop, zmp

if TYPE_CHECKING:
    from wbc.sim import Plant

Force = tuple[str, Array, Array]
"""Kind of arrow, point of attack (world, m) and force (world, N)."""

FOOT = "foot/"
"""Prefix of the names of bodies that a plant's feet add, which may equal names of the robot's links."""


class PlantSource:
    """Snapshots of a plant, with its soft soles as they are bent; none but `show` writes to the plant."""

    def __init__(self, plant: Plant) -> None:
        """Make the scene and find the bodies."""
        self.plant = plant
        model = plant.model
        self._soles = [model.site(foot.wrench_site).id for foot in plant.feet]
        self.scene: Scene = make_scene(
            plant.description.name,
            [*robot_parts(plant.description), *_foot_parts(plant)],
            plant.terrain,
            float(plant.truth().com[2] - plant.terrain.surface.floor),
            plant.robot.mass * GRAVITY,
        )
        self._ids = np.array([model.body(body.removeprefix(FOOT)).id for body in self.scene.bodies])

    def poses(self) -> Array:
        """Return the poses of the scene's bodies, homogeneous, shape (number of bodies, 4, 4), m."""
        data = self.plant.data
        poses = np.tile(np.eye(4), (self._ids.size, 1, 1))
        poses[:, :3, :3] = data.xmat[self._ids].reshape(-1, 3, 3)
        poses[:, :3, 3] = data.xpos[self._ids]
        return poses

    def soles(self) -> list[pin.SE3]:
        """Return the sole frames in the world."""
        data = self.plant.data
        return [pin.SE3(data.site_xmat[i].reshape(3, 3), data.site_xpos[i]) for i in self._soles]

    def show(self, q: Array) -> None:
        """Put the robot into positions, the first ones of the plant in MuJoCo's order; for a plant that never steps."""
        import mujoco  # noqa: PLC0415

        self.plant.data.qpos[: len(q)] = q
        mujoco.mj_kinematics(self.plant.model, self.plant.data)

    def snapshot(self) -> Snapshot:
        """Return the present state."""
        plant = self.plant
        truth, data = plant.truth(), plant.data
        position, force, sole = truth.contact_position, truth.contact_force, truth.contact_sole
        forces: list[Force] = []
        for i in range(len(plant.feet)):
            on_sole = sole == i
            load = force[on_sole, 2]
            if load.sum() > 0.0:
                point = load @ position[on_sole] / load.sum()
                forces.append(("ground", point, force[on_sole].sum(axis=0)))
        forces += [("ground", position[i], force[i]) for i in np.flatnonzero(sole < 0)]
        pushed = np.flatnonzero(data.xfrc_applied[:, :3].any(axis=1))
        forces += [("push", data.xipos[i].copy(), data.xfrc_applied[i, :3].copy()) for i in pushed]
        wrench = np.concatenate([force.sum(axis=0), np.cross(position, force).sum(axis=0)])
        level = float(force[:, 2] @ position[:, 2] / max(force[:, 2].sum(), 1e-9)) if force.size else 0.0
        return Snapshot(plant.time, self.poses(), truth.com, _zmp(wrench, level), forces)


class RobotSource:
    """Snapshots of a robot model: an estimate, a plan, a real robot."""

    def __init__(self, description: RobotDescription, terrain: Terrain | None) -> None:
        """Make the scene and find the links; the ground is flat when None."""
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
        """Return a state: a robot of the same model, up to date, or a configuration, shape (nq,), at a time, s.

        Contact wrenches are [force; moment] in the sole frame, shape (soles, 6), N and Nm. Another robot, or a value of
        the wrong shape or not finite, is an `InputError`.
        """
        robot = self._robot
        if isinstance(state, Robot):
            if state.model.nq != robot.nq or state.model.nframes != robot.model.nframes:
                raise InputError(f"the view shows '{robot.name}', not {state!r}")
            robot = state
        else:
            robot.update(finite_array("configuration to show", state, (robot.nq,)), np.zeros(robot.nv))
        forces: list[Force] = []
        total, levels = np.zeros(6), [0.0]
        if sole_wrench is not None:
            wrenches = finite_array("sole wrenches to show", sole_wrench, (len(robot.soles), 6))
            levels = [float(robot.placement(sole.frame).translation[2]) for sole in robot.soles]
            for sole, wrench in zip(robot.soles, wrenches, strict=True):
                place = robot.placement(sole.frame)
                total += place.act(pin.Force(wrench)).vector
                forces += sole_force(place.translation, place.rotation, wrench)
        return Snapshot(time, self.poses(robot), np.array(robot.com), _zmp(total, min(levels)), forces)

    def poses(self, robot: Robot | None = None) -> Array:
        """Return the poses of the scene's bodies, shape (number of bodies, 4, 4), m; of the one shown when None."""
        robot = robot or self._robot
        return np.array([robot.placement(i).homogeneous for i in self._ids])

    def soles(self) -> list[pin.SE3]:
        """Return the sole frames in the world."""
        return [self._robot.placement(sole.frame) for sole in self._robot.soles]

    def show(self, q: Array) -> None:
        """Put the robot into a configuration, shape (nq,)."""
        self._robot.update_kinematics(np.ascontiguousarray(q), np.zeros(self._robot.nv))


def sole_force(position: Array, rotation: Array, wrench: Array) -> list[Force]:
    """Return the contact force of a sole at its centre of pressure; empty without contact.

    Centre (m) and frame of the sole are in the world, the wrench, shape (6,), N and Nm, is in the frame.
    """
    try:
        return [("ground", position + rotation[:, :2] @ cop(wrench), rotation @ wrench[:3])]
    except NoContactForceError:
        return []


def _foot_parts(plant: Plant) -> list[Part]:
    """Return the visual shapes of a plant's feet, the phalanges of a soft sole and its arch, and of its furniture."""
    import mujoco  # noqa: PLC0415

    from wbc.feet.soles.common_mjcf import VISUAL_GROUP  # noqa: PLC0415
    from wbc.sim.plant.hands import SCENE_PREFIX  # noqa: PLC0415

    model, parts = plant.model, []
    names = [str(model.body(body).name) for body in model.geom_bodyid]
    furniture = np.array([name.startswith(SCENE_PREFIX) for name in names])
    for geom in np.flatnonzero((model.geom_group == VISUAL_GROUP) | furniture):
        shape = _geom_shape(int(model.geom_type[geom]), model.geom_size[geom].tolist())
        if shape is None:
            continue
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        placement = np.eye(4)
        placement[:3, :3], placement[:3, 3] = rotation.reshape(3, 3), model.geom_pos[geom]
        red, green, blue, opacity = model.geom_rgba[geom].tolist()
        body = FOOT + names[geom]
        parts.append(Part(body, shape, (red, green, blue, opacity), placement))
    return parts


def _geom_shape(kind: int, size: Sequence[float]) -> Shape | None:
    import mujoco  # noqa: PLC0415

    types = mujoco.mjtGeom
    if kind == types.mjGEOM_BOX:
        return box(2.0 * size[0], 2.0 * size[1], 2.0 * size[2])
    if kind in (types.mjGEOM_CAPSULE, types.mjGEOM_CYLINDER):
        return cylinder(size[0], 2.0 * size[1], round_ends=kind == types.mjGEOM_CAPSULE)
    if kind == types.mjGEOM_SPHERE:
        return sphere(size[0])
    if kind == types.mjGEOM_ELLIPSOID:
        return ellipsoid(size[0], size[1], size[2])
    return None


def _zmp(wrench: Array, level: float) -> Array | None:
    """Return the ZMP of a wrench at the world origin in the horizontal plane at a level, m; None without force."""
    try:
        return zmp(wrench, pin.SE3(np.eye(3), np.array([0.0, 0.0, level])))
    except NoContactForceError:
        return None
