"""A humanoid on its feet whose hands follow handles that you drag in the browser: inverse kinematics, step by step.

With `--view` the page has a handle for each hand; without it the hands go where the example sends them.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from _common import parse, report
from scipy.spatial import ConvexHull

import wbc


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=4.0, robot=("g1", "talos", "hrp4_class"))
    description = wbc.load_robot(options.robot)
    robot = description.robot()
    ik = wbc.InverseKinematics(robot, dt=0.02)
    ik.add(*(wbc.SoleContact(sole.name) for sole in robot.soles), wbc.CoMPolygonLimit(), wbc.JointLimits())
    ik.add(wbc.OrientationTask(robot.torso_frame, weight=0.1), wbc.PostureTask(weight=1e-3))
    hands = [ik.add(wbc.PositionTask(robot.frames[f"{side}_hand"])) for side in ("left", "right")]
    for hand, side in zip(hands, (0.1, -0.1), strict=True):
        hand.target = hand.target + [0.1, side, 0.2]
    page = Page(description, robot, hands, options.port) if options.view else None
    steps = round(options.seconds / ik.dt)
    while steps > 0 or (page is not None and page.server.get_clients()):
        if page is not None:
            page.show(robot, hands)
        ik.step()
        steps -= 1
    return report(hands_mm=1e3 * max(float(np.linalg.norm(hand.error)) for hand in hands))


class Page:
    """The robot's hulls and a handle for each hand, in viser."""

    def __init__(self, description: Any, robot: wbc.Robot, hands: Sequence[Any], port: int | None) -> None:
        """Make the nodes."""
        import viser  # noqa: PLC0415 - an extra

        self.server, self.links = viser.ViserServer("127.0.0.1", port or 7000), {}
        for link, shapes in description.collision_hulls().items():
            self.links[link] = self.server.scene.add_frame(f"/{link}", show_axes=False)
            for number, shape in enumerate(shapes):
                if isinstance(shape, wbc.CollisionHull):
                    hull = ConvexHull(np.array(shape.points))
                    self.server.scene.add_mesh_simple(f"/{link}/{number}", hull.points, hull.simplices)
        add = self.server.scene.add_transform_controls
        self.handles = [
            add(f"/handle of {hand.frame}", scale=0.2, disable_rotations=True, position=hand.target)
            for hand in hands
        ]

    def show(self, robot: wbc.Robot, hands: Sequence[Any]) -> None:
        """Draw the robot, and take the targets of the hands from their handles."""
        for link, node in self.links.items():
            place = robot.placement(link)
            x, y, z, w = pin.Quaternion(place.rotation).coeffs()
            node.position, node.wxyz = place.translation, (w, x, y, z)
        for hand, handle in zip(hands, self.handles, strict=True):
            hand.target = np.array(handle.position)


if __name__ == "__main__":
    main()
