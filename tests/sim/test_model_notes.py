"""Figures of the notes on a model of one's own: masses, distances, torques, delays, and the floor under the soles."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import wbc
from wbc.sim import MujocoLoop
from wbc.sim.foreign.notes import floor_of
from wbc.sim.plant.places import RobotPlaces

BIPED = (Path(__file__).parents[2] / "examples" / "biped.xml").read_text(encoding="utf-8")
DESCRIPTION = wbc.RobotDescription.from_mjcf(BIPED)
FLOOR = '<geom type="plane" size="0 0 1"/></worldbody>'


def model_of(xml: str = BIPED, floor: str = FLOOR) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(xml.replace("</worldbody>", floor, 1))


def noted(model: mujoco.MjModel, word: str) -> str:
    """Return the one note with a word."""
    (note,) = (note for note in MujocoLoop(DESCRIPTION, model).notes if word in note)
    return note


def test_masses_and_distances_are_told_in_kilograms_and_millimetres() -> None:
    assert not MujocoLoop(DESCRIPTION, model_of()).notes
    model, mass = model_of(), DESCRIPTION.robot().mass
    root = int(model.body_rootid[model.joint("left_knee").bodyid[0]])
    model.body_subtreemass[root] *= 1.02
    text = f"{1.02 * mass:.2f} kg in the model and {mass:.2f} kg in the description"
    assert text in noted(model, "kg in the model")
    model = model_of()
    shank = model.joint("left_knee").bodyid[0]
    model.body_ipos[shank] += [0.0, 0.05, 0.0]
    off = 50.0 * model.body_mass[shank] / mass
    assert off > 1.0 and f"the centre of mass is {off:.1f} mm off" in noted(model, "centre of mass")


@pytest.mark.parametrize(("share", "told"), [(0.995, False), (0.985, True), (0.5, True)])
def test_controls_that_end_before_the_torque_limits_are_told_with_the_joint_that_lacks_most(
    share: float, told: bool
) -> None:
    model, robot = model_of(), DESCRIPTION.robot()
    names = ("left_knee", "right_hip_roll")
    model.actuator_ctrllimited[:] = 0
    for name, part in zip(names, (share, 1.0 - 0.5 * (1.0 - share)), strict=True):
        (number,) = np.flatnonzero(model.actuator_trnid[:, 0] == model.joint(name).id)
        limit = robot.torque_limit[robot.joint_index(name)] / model.actuator_gear[number, 0]
        model.actuator_ctrllimited[number] = 1
        model.actuator_ctrlrange[number] = [-2.0 * limit, part * limit]
    found = [note for note in MujocoLoop(DESCRIPTION, model).notes if "ctrlrange" in note]
    assert bool(found) == told
    if told:
        limit = float(robot.torque_limit[robot.joint_index("left_knee")])
        count = 1 + (0.5 * (1.0 + share) < 0.99)
        assert f"of {count} joints end" in found[0]
        text = f"first left_knee: {-2.0 * limit:.4g} to {share * limit:.4g} of {-limit:.4g} to {limit:.4g} Nm"
        assert text in found[0]


@pytest.mark.parametrize(
    ("what", "text"),
    [
        ('delay="0.06" nsample="64"', "a delay of 60 ms"),
        ('interval="0.02 0" nsample="2"', "a reading every 20 ms"),
        ('cutoff="9"', "readings up to 9 alone"),
        ('delay="0.004" nsample="8" cutoff="9"', "a delay of 4 ms and readings up to 9 alone"),
    ],
)
def test_a_sensor_is_told_by_how_late_how_seldom_and_how_far_it_reads(what: str, text: str) -> None:
    assert noted(model_of(BIPED.replace("<gyro ", f"<gyro {what} ")), "gyroscope").endswith(
        f"has {text}" + (" (cutoff)" if "alone" in text else "")
    )


@pytest.mark.parametrize(
    ("side", "corner"), [(0, (0, 0)), (0, (1, 1)), (1, (1, -1)), (0, (-1, 1)), (1, (-1, -1))]
)
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
    assert floor_of(RobotPlaces(model, robot), robot) == (pytest.approx(0.02), [])
