"""Walk up stairs that no plan knows: clouds of points of a sensor of your own go into the walk as they come."""

import numpy as np
from _common import parse, report, upright

import wbc
from wbc.ground import KnownGround, PointCloud
from wbc.sim import make_terrain
from wbc.walking import FootstepPlan, WalkingControl, walk_distance

GRID = np.stack(np.meshgrid(np.arange(0.0, 1.2, 0.02), np.arange(-0.4, 0.4, 0.02)), axis=-1).reshape(-1, 2)


def scan(plant: wbc.Plant, base: str) -> PointCloud:
    """Return the ground ahead in the frame of the base, as a perfect lidar there would; put your sensor here."""
    place, turn = plant.data.xpos[1], plant.data.xmat[1].reshape(3, 3)
    x, y = (GRID + place[:2]).T
    points = np.stack([x, y, plant.terrain.height(x, y)], axis=1)
    return PointCloud((points - place) @ turn, plant.time, base)


def main(arguments: list[str] | None = None) -> dict[str, object]:
    """Run the example."""
    options = parse(__doc__, arguments, distance=1.8, rise=0.08)
    ground = make_terrain("steps", 2 * options.rise, riser=options.rise, direction="up", length=1.0)
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), terrain=ground, noise="realistic")
    robot, start = plant.description.robot(), plant.truth().com[2]
    plan = walk_distance(FootstepPlan.standing(robot), options.distance)
    walking = WalkingControl(robot, plan, plant.control_period, ground=KnownGround(robot))
    with options.watch(plant, walking) as view:
        while not walking.done:
            if round(plant.time / plant.control_period) % 16 == 0:  # 12.5 Hz
                walking.see(scan(plant, robot.base_frame))
            plant.step(walking.command(plant.measure()))
            view.update()
    return report(upright=upright(plant), climbed_mm=1e3 * (plant.truth().com[2] - start))


if __name__ == "__main__":
    main()
