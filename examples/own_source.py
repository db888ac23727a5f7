"""References of your own: one method returns the pendulum and the motion of the feet, and the controller tracks them.

The robot marches in place: a foot lifts when the ZMP is under the other sole.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from _common import parse, report, upright

import wbc
from wbc.walking import (
    FootMotion,
    GaitPhase,
    Progress,
    Reference,
    StandSource,
    State,
    WalkingControl,
    WalkingControlSettings,
)


class March(StandSource):
    """Weight on one foot, the other foot up and down again, and so on."""

    def __init__(self, robot: wbc.Robot, period: float = 4.0, height: float = 0.03) -> None:
        super().__init__(robot)
        left, right = self.places
        self.aside = 0.5 * (left.translation - right.translation)  # from the middle to the left sole
        self.rate, self.height = 2.0 * math.pi / period, height

    def update(self, state: State) -> Reference:
        """Return the references of this tick."""
        stand, w, t = super().update(state), self.rate, state.time
        rest, sway = stand.pendulum, math.sin(w * t)
        share = self.aside / (1.0 + (w / rest.omega) ** 2)  # of the CoM: the ZMP is at c - c̈ / ω²
        com, speed, push = sway * share, w * math.cos(w * t) * share, -w * w * sway * share
        zmp = rest.zmp + sway * self.aside
        pendulum = rest._replace(com=rest.com + com, com_velocity=speed, com_acceleration=push, zmp=zmp)
        lifted, up = max(0.0, 5.0 * abs(sway) - 4.0), 1 if sway > 0.0 else 0
        if lifted > 0.0:
            feet, place = list(stand.feet), self.places[up].copy()
            place.translation += (0.0, 0.0, self.height * lifted**2 * (3.0 - 2.0 * lifted))
            feet[up] = FootMotion.at_rest(place)
            single = Progress(GaitPhase.SINGLE, 1 - up, up, (up != 0, up != 1), self.heading)
            stand = stand._replace(feet=tuple(feet), progress=single)
        return stand._replace(pendulum=pendulum)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=9.0, robot="hrp4_class", mode=("torque", "position"))
    plant = wbc.Plant(wbc.load_robot(options.robot), control_period=0.002)
    robot, settings = plant.description.robot(), WalkingControlSettings(mode=options.mode)
    walking = WalkingControl(robot, March(robot), plant.control_period, settings)
    estimate, high = walking.drives.observer.robot, 0.0
    with options.watch(plant, walking) as view:
        while plant.time < options.seconds and walking.fallen is None:
            plant.step(walking.command(plant.measure()))
            view.update()
            high = max(high, float(estimate.placement(robot.soles[0].frame).translation[2]))
    return report(upright=upright(plant) and walking.fallen is None, lifted_mm=1e3 * high)


if __name__ == "__main__":
    main()
