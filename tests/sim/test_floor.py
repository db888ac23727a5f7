"""The floor under the soles of a robot in a model of one's own: found by rays below their centres and corners."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import wbc
from wbc.sim.foreign.floor import floor_under
from wbc.sim.plant.places import RobotPlaces

BIPED = (Path(__file__).parents[2] / "examples" / "biped.xml").read_text(encoding="utf-8")
DESCRIPTION = wbc.RobotDescription.from_mjcf(BIPED)


@pytest.mark.parametrize("corner", [(0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)])
@pytest.mark.parametrize("side", [0, 1])
def test_a_step_under_any_corner_of_a_sole_is_found(side: int, corner: tuple[int, int]) -> None:
    """Of 20 mm, and 10 mm wide: nothing but the ray below this corner meets it."""
    robot = DESCRIPTION.robot()
    sole = robot.soles[side]
    away = 0.5 * np.array(corner) * [sole.length, sole.width]
    place = robot.placement(sole.frame).act(np.array([*away, 0.0]))
    spec = mujoco.MjSpec.from_string(BIPED)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1])
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.005, 0.005, 0.02], pos=[place[0], place[1], 0.0]
    )
    model = spec.compile()
    heights = floor_under(RobotPlaces(model, robot), robot, mujoco.MjData(model))
    assert heights is not None and sorted(heights.round(6).tolist()) == [0.0] * 9 + [0.02]
