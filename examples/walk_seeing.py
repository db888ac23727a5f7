"""Walk over stairs that no plan knows, seen by a sensor of your own.

Rays of MuJoCo are the sensor here; a recorded cloud and a ROS 2 topic are read as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from _common import parse, report, upright

import wbc
from wbc.ground import KnownGround, PointCloud
from wbc.sim import make_terrain
from wbc.walking import FootstepPlan, WalkingControl, walk_distance

AHEAD, ASIDE = np.meshgrid(np.linspace(0.2, 1.2, 40), np.linspace(-0.4, 0.4, 24))
RAYS = np.stack([AHEAD.ravel(), ASIDE.ravel(), np.full(AHEAD.size, -0.8)], axis=1)
GROUND = np.array([0, 0, 1, 0, 0, 0], np.uint8)  # group of the ground's geoms in the plant


def cast(plant: wbc.Plant, base: str) -> PointCloud:
    """Return what rays from the base see of the ground in MuJoCo's own model."""
    place, rotation = plant.data.xpos[1], plant.data.xmat[1].reshape(3, 3)
    distance, hit, rays = np.zeros(len(RAYS)), np.zeros(len(RAYS), np.int32), (RAYS @ rotation.T).ravel()
    mujoco.mj_multiRay(
        plant.model, plant.data, place, rays, GROUND, True, -1, hit, distance, None, len(RAYS), 9.0
    )
    return PointCloud(RAYS[hit >= 0] * distance[hit >= 0, None], plant.time, base)


def recorded(file: str) -> PointCloud:
    """Return a cloud of a file that `np.savez(file, points=…, time=…, frame=…)` has written."""
    data = np.load(file)
    return PointCloud(data["points"], float(data["time"]), str(data["frame"]))


def listen(walking: WalkingControl, node: Any, topic: str = "/camera/points") -> None:
    """Give each cloud of a ROS 2 topic to a walk; clocks and names of frames must be the robot's."""
    from sensor_msgs.msg import PointCloud2  # noqa: PLC0415 - comes with ROS 2
    from sensor_msgs_py.point_cloud2 import read_points_numpy  # noqa: PLC0415

    def see(message: Any) -> None:
        stamp = message.header.stamp
        points = read_points_numpy(message, ("x", "y", "z"))
        walking.see(PointCloud(points, stamp.sec + 1e-9 * stamp.nanosec, message.header.frame_id))

    node.create_subscription(PointCloud2, topic, see, 1)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, distance=1.8, rise=0.08)
    ground = make_terrain(
        "steps", 2.0 * options.rise, riser=options.rise, tread=0.3, direction="up", length=1.0
    )
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), terrain=ground, noise="realistic")
    robot = plant.description.robot()
    plan = walk_distance(FootstepPlan.standing(robot), options.distance)
    walking = WalkingControl(robot, plan, plant.control_period, ground=KnownGround(robot))
    began, due = plant.truth(), 0.0
    with options.watch(plant, walking) as view:
        while not walking.done:
            if plant.time >= due:
                walking.see(cast(plant, robot.base_frame))
                due += 0.08
            plant.step(walking.command(plant.measure()))
            view.update()
    climbed = float(plant.truth().com[2] - began.com[2])
    return report(upright=upright(plant), steps=walking.steps_done, climbed_mm=1e3 * climbed)


if __name__ == "__main__":
    main()
