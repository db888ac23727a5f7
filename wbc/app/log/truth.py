"""Ground truth of a simulation, copied from MuJoCo's state; for logs and pictures alone."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pinocchio as pin

from wbc.app.log.columns import QUATERNION, XY, XYZ, Columns, joint_units, position_signal, torque_units
from wbc.app.log.tick import Source, Tick
from wbc.core.errors import Array
from wbc.core.robot import SIDES, Robot

if TYPE_CHECKING:
    from wbc.sim import Plant


class _StateSource(Source):
    """Columns of a true state, in the order of a configuration and a velocity, and what follows from them."""

    def __init__(
        self, columns: Columns, robot: Robot, joints: Sequence[str], units: Sequence[str], omega: int | None
    ) -> None:
        """Add the columns.

        Args:
            columns: Takes the columns.
            robot: The robot.
            joints: Joints of the configuration, those of soft soles included.
            units: Unit of each.
            omega: Column of the natural frequency, for the DCM; None without a walk.
        """
        names = robot.joint_names
        start = columns.group("truth/base/position", XYZ, "m", "world").start
        self._quaternion = columns.group("truth/base/orientation", QUATERNION, "1", "base frame in the world")
        columns.each([position_signal(joint, robot) for joint in joints], units, "without sensor errors")
        self._linear = columns.group("truth/base/linear_velocity", XYZ, "m/s", "base frame")
        columns.group("truth/base/angular_velocity", XYZ, "rad/s", "base frame")
        self._torque = columns.group(
            "truth/joint/torque", names, torque_units(robot), "last applied by the drives"
        )
        self._com = columns.group("truth/com", XYZ, "m", "of everything, feet included, world")
        self._com_velocity = columns.group("truth/com_velocity", XYZ, "m/s", "world")
        for side in SIDES:
            columns.group(f"truth/foot/{side}/position", XYZ, "m", "sole centre, world")
        self._add_further(columns)
        self._copied = columns.since(start)
        self._ratio = columns.group("truth/joint/torque_ratio", names, "1", "torque over its limit")
        self._limit, self._omega = np.array(robot.torque_limit), omega
        self._dcm = slice(0, 0) if omega is None else columns.group("truth/dcm", XY, "m", "world")

    def _add_further(self, columns: Columns) -> None:
        """Add what else is copied."""

    def finish(self, rows: Array) -> None:
        if self._omega is not None:
            com, velocity = rows[:, self._com][:, :2], rows[:, self._com_velocity][:, :2]
            rows[:, self._dcm] = com + velocity / rows[:, self._omega, None]
        rows[:, self._ratio] = rows[:, self._torque] / self._limit


class TruthSource(_StateSource):
    """Base, joints, soles, centre of mass and pushes of a plant.

    It copies MuJoCo's arrays in a few microseconds; `Plant.truth` takes 0.1 ms, mostly for contacts.
    """

    def __init__(self, columns: Columns, plant: Plant, omega: int | None) -> None:
        """Add the columns.

        Args:
            columns: Takes the columns.
            plant: The plant.
            omega: Column of the natural frequency, for the DCM; None without a walk.
        """
        import mujoco  # noqa: PLC0415 - a plant has imported it

        model = plant.model
        self._velocities = mujoco.mj_subtreeVel
        own = [i for i in range(1, model.njnt) if plant.of_robot[model.jnt_bodyid[i]]]
        joints = [model.joint(i) for i in own]
        units = ["m" if joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE else "rad" for joint in joints]
        super().__init__(columns, plant.robot, [joint.name for joint in joints], units, omega)
        self._qpos = slice(7 + len(joints))  # furniture comes after the robot
        self._base = int(model.jnt_bodyid[0])
        self._sites = [model.site(foot.wrench_site).id for foot in plant.feet]
        self._limit = np.array(plant.description.torque_limit)
        self._no_push = np.array([math.nan] * 3 + [0.0] * 3)

    def _add_further(self, columns: Columns) -> None:
        columns.group("truth/push/point", XYZ, "m", "point of attack of the largest push, world")
        columns.group("truth/push/force", XYZ, "N", "of the largest push, world")

    def write(self, tick: Tick, row: Array) -> None:
        plant = cast("Plant", tick.plant)
        data = plant.data
        self._velocities(plant.model, data)
        left, right = self._sites
        sites, base, pushes = data.site_xpos, self._base, data.xfrc_applied
        # In the order of the columns.
        parts = (
            data.qpos[self._qpos],
            data.qvel[:6],
            plant.joint_torque,
            data.subtree_com[base],
            data.subtree_linvel[base],
            sites[left],
            sites[right],
            self._largest_push(data) if pushes.any() else self._no_push,
        )
        np.concatenate(parts, out=row[self._copied])

    @staticmethod
    def _largest_push(data: Any) -> Array:
        """Return point and force of the largest push, shape (6,)."""
        forces = data.xfrc_applied[:, :3]
        body = int(np.argmax(np.square(forces).sum(axis=1)))
        return np.concatenate([data.xipos[body], forces[body]])

    def finish(self, rows: Array) -> None:
        super().finish(rows)
        rows[:, self._quaternion] = rows[:, self._quaternion][:, [1, 2, 3, 0]]  # from MuJoCo's wxyz
        rows[:, self._linear] = into_frame(rows[:, self._quaternion], rows[:, self._linear])


class GroundTruthSource(_StateSource):
    """Base, joints, soles and centre of mass of a loop that knows its true state, under the names of a plant's."""

    def __init__(self, columns: Columns, tick: Tick, omega: int | None) -> None:
        """Add the columns.

        Args:
            columns: Takes the columns.
            tick: The first tick, with its truth.
            omega: Column of the natural frequency, for the DCM; None without a walk.
        """
        self._robot = tick.robot.clone()
        super().__init__(columns, self._robot, self._robot.joint_names, joint_units(self._robot), omega)

    def write(self, tick: Tick, row: Array) -> None:
        truth, robot = tick.truth, self._robot
        if truth is None:
            row[self._copied] = math.nan
            return
        pin.framesForwardKinematics(robot.model, robot.data, truth.q)
        feet = [robot.placement(sole.frame).translation for sole in robot.soles[:2]]
        parts = (truth.q, truth.v[:6], truth.joint_torque, truth.com, truth.com_velocity, *feet)
        np.concatenate(parts, out=row[self._copied])


def into_frame(quaternions: Array, vectors: Array) -> Array:
    """Return vectors of the world in the axes of frames, shape (n, 3).

    Args:
        quaternions: Orientation of each frame in the world, xyzw, shape (n, 4).
        vectors: Vectors in the world, shape (n, 3).
    """
    axis, w = -quaternions[:, :3], quaternions[:, 3:]
    turn = 2.0 * np.cross(axis, vectors)
    rotated: Array = vectors + w * turn + np.cross(axis, turn)
    return rotated
