"""Sources of pictures: a robot in a simulation, or the description of one whose states the caller gives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import mujoco
import numpy as np
import pinocchio as pin

from wbc.app.view.live_marks import RunMarks
from wbc.app.view.marks import Force, Picture, Scale, balance_marks
from wbc.core.conventions import configuration_to_mujoco
from wbc.core.errors import Array, InputError, finite_array
from wbc.core.robot import GRAVITY, Robot
from wbc.sim.plant.model import drawing_model
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.plant import Plant
from wbc.sim.plant.robot import SimulatedRobot
from wbc.sim.terrain.spec import Terrain
from wbc.sim.terrain.spec import terrain as terrain_by_name
from wbc.tasks.stabilizer.zmp import NoContactForceError, cop, zmp

if TYPE_CHECKING:
    from wbc.core.signals import Measurement
    from wbc.robots import RobotDescription
    from wbc.walking.control import ReferenceControl

MIN_LOAD = 1.0
"""Smallest contact force of a sole that is drawn, N."""


class Stage(Protocol):
    """Scene of a view or film: bodies of a model in the state of its data, and sizes for marks and camera.

    Attributes:
        title: Name of the robot.
        model: MuJoCo's model.
        data: Its state: places of the bodies.
        floor: Height of the endless plane, m.
        scale: Sizes of the robot.
    """

    title: str
    model: mujoco.MjModel
    data: mujoco.MjData
    floor: float
    scale: Scale


class SimulatedStage:
    """Robot in a simulation, to which nothing is written; see `Stage`."""

    def __init__(self, robot: SimulatedRobot, walking: ReferenceControl | None) -> None:
        self.robot = robot
        self.title, self.model, self.data = robot.description.name, robot.model, robot.data
        self.floor = float(robot.terrain.surface.floor) if isinstance(robot, Plant) else 0.0
        height = float(robot.truth().com[2]) - self.floor
        self.scale = Scale(height, robot.robot.mass * GRAVITY)
        self._marks = RunMarks(robot, walking, self.scale)

    def picture(self, measurement: Measurement | None) -> Picture:
        """Return the present picture; the latest measurement has the rays of range sensors."""
        robot, truth, data = self.robot, self.robot.truth(), self.robot.data
        position, force, sole = truth.contact_position, truth.contact_force, truth.contact_sole
        forces = []
        for i in range(len(robot.places.feet)):
            on_sole = sole == i
            load = force[on_sole, 2]
            if load.sum() > 0.0:
                point = load @ position[on_sole] / load.sum()
                forces.append(Force("ground", point, force[on_sole].sum(axis=0)))
        forces += [Force("ground", position[i], force[i]) for i in np.flatnonzero(sole < 0)]
        pushed = np.flatnonzero(data.xfrc_applied[:, :3].any(axis=1) & robot.places.of_robot)
        forces += [Force("push", data.xipos[i].copy(), data.xfrc_applied[i, :3].copy()) for i in pushed]
        wrench = np.concatenate([force.sum(axis=0), np.cross(position, force).sum(axis=0)])
        total = float(force[:, 2].sum())
        level = float(force[:, 2] @ position[:, 2]) / total if total > 0.0 else self.floor
        marks = balance_marks(self.scale, truth.com, zmp_of(wrench, level), forces, level)
        picture = Picture(robot.time, marks, target=truth.com)
        self._marks.draw(picture, measurement)
        return picture


class DescribedStage:
    """Robot whose states are given: an estimate, a plan, a real robot; see `Stage`."""

    def __init__(self, description: RobotDescription, terrain: Terrain | None) -> None:
        self.robot, self.title = description.robot(), description.name
        ground = terrain_by_name("flat") if terrain is None else terrain
        self.model = drawing_model(description, self.robot, ground)
        self.data = mujoco.MjData(self.model)
        self.places = RobotPlaces(self.model, self.robot)
        self.floor = float(ground.surface.floor)
        self.scale = Scale(float(self.robot.com[2]), self.robot.mass * GRAVITY)

    def show(self, q: Array) -> None:
        """Put the bodies where they are in a configuration, shape (nq,)."""
        configuration_to_mujoco(q, self.places.joint_qpos, out=self.data.qpos)
        mujoco.mj_kinematics(self.model, self.data)

    def picture(self, state: Robot | Array, read: Measurement | None) -> Picture:
        """Return the picture of a robot of this model, up to date, or of a configuration, and of a measurement."""
        robot = self.robot
        if isinstance(state, Robot):
            if state.model.nq != robot.nq or state.model.nframes != robot.model.nframes:
                raise InputError(f"the view shows '{robot.name}', not {state!r}")
            robot = state
        else:
            robot.update(finite_array("configuration to show", state, (robot.nq,)), np.zeros(robot.nv))
        self.show(robot.q)
        total, level, forces = np.zeros(6), self.floor, []
        if read is not None and read.sole_wrench is not None:
            places = [robot.placement(sole.frame) for sole in robot.soles]
            for place, wrench in zip(places, read.sole_wrench, strict=True):
                total += place.act(pin.Force(wrench)).vector
                forces += sole_force(place.translation, place.rotation, wrench)
            level = min(float(place.translation[2]) for place in places)
        marks = balance_marks(self.scale, np.array(robot.com), zmp_of(total, level), forces, level)
        return Picture(0.0 if read is None else read.time, marks, target=np.array(robot.com))


def sole_force(position: Array, rotation: Array, wrench: Array) -> list[Force]:
    """Return the contact force of a sole by the wrench in its frame, at its centre of pressure; empty without one."""
    if not (np.isfinite(wrench).all() and wrench[2] >= MIN_LOAD):
        return []
    return [Force("ground", position + rotation[:, :2] @ cop(wrench), rotation @ wrench[:3])]


def zmp_of(wrench: Array, level: float) -> Array | None:
    """Return the ZMP of a wrench at the world origin in the horizontal plane at a level, m; None without force."""
    try:
        return zmp(wrench, pin.SE3(np.eye(3), np.array([0.0, 0.0, level])))
    except NoContactForceError:
        return None
