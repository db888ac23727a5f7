"""Sources of references: anything with `update` is followed, steered or not, measured, logged and shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.app.view.stage import SimulatedStage
from wbc.base.errors import InputError
from wbc.base.settings import changed
from wbc.core.drive.control import Mode
from wbc.core.robot import Robot
from wbc.robots import load
from wbc.walking import (
    FootstepPlan,
    GaitPhase,
    Reference,
    StandSource,
    State,
    WalkingControl,
    WalkingControlSettings,
)
from wbc.walking.assembly import planned_walk
from wbc.walking.source import Progress, ReferenceSource, WholeBody
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import SteppingConstants

DESCRIPTION, DT = load("hrp4_class"), 0.005


class Sway(StandSource):
    """CoM that goes from side to side; says nothing of steering, progress or an end."""

    def update(self, state: State) -> Reference:
        stand, rate = super().update(state), 2.0
        rest, far = stand.pendulum, np.array([0.0, 0.03, 0.0])
        com = np.sin(rate * state.time) * far
        speed, push = rate * np.cos(rate * state.time) * far, -rate * rate * com
        zmp = rest.zmp + com - push / rest.omega**2
        pendulum = rest._replace(com=rest.com + com, com_velocity=speed, com_acceleration=push, zmp=zmp)
        return stand._replace(pendulum=pendulum)


class Anywhere(Sway):
    """The same for any robot."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self.made_for = None


class Fails(StandSource):
    def update(self, state: State) -> Reference:
        if state.time > 0.1025:  # from the 21st tick of 5 ms on
            raise RuntimeError("no reference")
        return super().update(state)


def test_a_source_of_ones_own_is_followed_logged_and_shown(tmp_path: Path) -> None:
    plant, robot = wbc.Plant(DESCRIPTION, visuals=False), DESCRIPTION.robot()
    walking = WalkingControl(robot, Sway(robot), plant.control_period)
    assert walking.progress == Progress()
    stage, sides, error = SimulatedStage(plant, walking), [], 0.0
    with Recorder(tmp_path / "own.arrow") as record:
        while plant.time < 1.0:
            measurement = plant.measure()
            command = walking.command(measurement)
            record(plant, walking, measurement, command)
            plant.step(command)
            assert walking.reference is not None and walking.output is not None
            sides.append(float(plant.truth().com[1]))
            error = max(error, abs(sides[-1] - float(walking.reference.pendulum.com[1])))
    assert {"com", "zmp", "dcm", "DCM planned"} <= {mark.name for mark in stage.picture().marks}
    assert walking.fallen is None and not walking.finished and error < 0.01
    assert max(sides) - min(sides) > 0.015
    wanted = Log.open(tmp_path / "own.arrow")["com/reference"]
    assert np.ptp(wanted[:, 1]) == pytest.approx(0.03, abs=2e-3)


@pytest.mark.parametrize(("torso", "trunks"), [("chest", 2), ("pelvis", 1)])
def test_a_robot_that_bows_as_its_source_does_is_upright(torso: str, trunks: int) -> None:
    """Also one whose pelvis is its torso."""
    robot = replace(DESCRIPTION, torso=torso).robot()
    still = np.zeros(robot.na)

    class Bows(StandSource):
        def update(self, state: State) -> Reference:
            bow = pin.rpy.rpyToMatrix(0.0, min(0.2 * state.time, 0.1), 0.0)
            trunk = [(bow, np.zeros(3), np.zeros(3))] * trunks
            whole = WholeBody(np.zeros(3), trunk, robot.half_sitting[7:], still, still)
            return super().update(state)._replace(body=whole)

    plant = wbc.Plant(DESCRIPTION, visuals=False)
    walking = WalkingControl(robot, Bows(robot), plant.control_period)
    while plant.time < 0.75:
        plant.step(walking.command(plant.measure()))
    assert walking.fallen is None and walking.drives.failures == 0
    tilt = pin.rpy.matrixToRpy(walking.drives.observer.robot.placement(torso).rotation)[1]
    assert tilt == pytest.approx(0.1, abs=0.03)


def test_a_source_that_raises_fails_its_ticks_and_the_robot_gets_commands() -> None:
    plant, robot = wbc.Plant(DESCRIPTION, visuals=False), DESCRIPTION.robot()
    walking = WalkingControl(robot, Fails(robot), plant.control_period)
    for _ in range(40):
        command = walking.command(plant.measure())
        assert np.isfinite(command.joint_torque).all()
        plant.step(command)
    assert walking.drives.failures == 20 and "no reference" in walking.drives.reason


def test_a_stop_is_no_error_with_a_source_that_cannot_be_steered() -> None:
    plant, robot = wbc.Plant(DESCRIPTION, visuals=False), DESCRIPTION.robot()
    walking = WalkingControl(robot, Sway(robot), plant.control_period)
    walking.stop()
    assert walking.stopped
    plant.step(walking.command(plant.measure()))
    assert walking.drives.failures == 0


MADE: dict[str, tuple[Callable[[Robot], ReferenceSource], Mode]] = {
    "free steps": (lambda robot: SteppingWalk.of(robot, DT), "torque"),
    "planned steps": (
        lambda robot: planned_walk(robot, FootstepPlan.standing(robot), DT, WalkingControlSettings(), None),
        "position",
    ),
    "a stand": (StandSource, "position"),
    "one's own": (Sway, "torque"),
}


@pytest.mark.parametrize("kind", MADE)
def test_a_used_source_or_one_of_another_robot_or_period_is_refused(kind: str) -> None:
    make, mode = MADE[kind]
    robot, settings = DESCRIPTION.robot(), WalkingControlSettings(mode=mode)
    assert WalkingControl(robot.clone(), Anywhere(robot), DT, settings).source.made_for is None
    source = make(robot)
    with pytest.raises(InputError, match="is made for another robot"):
        WalkingControl(DESCRIPTION.robot(), source, DT, settings)
    if source.made_for is not None and source.made_for[1] is not None:
        with pytest.raises(InputError, match="is made for a period of 0.005 s"):
            WalkingControl(robot, source, 0.002, settings)
    assert WalkingControl(robot, source, DT, settings).source is source, "it is as new"
    with pytest.raises(InputError, match="has had a control: make another one"):
        WalkingControl(robot, source, DT, settings)


def test_free_steps_are_for_a_control_that_takes_them() -> None:
    robot = DESCRIPTION.robot()
    with pytest.raises(InputError, match="free steps"):
        WalkingControl(robot, SteppingWalk.of(robot, DT), DT)


def test_free_steps_of_ones_own_walk_by_their_constants() -> None:
    """The defaults are the control's own; a robot that shifts its weight for longer lifts its foot later."""
    settings = WalkingControlSettings(mode="torque")

    def lifted(constants: SteppingConstants) -> float:
        plant, robot = wbc.Plant(DESCRIPTION, visuals=False), DESCRIPTION.robot()
        dt = plant.control_period
        walking = WalkingControl(robot, SteppingWalk.of(robot, dt, constants=constants), dt, settings)
        walking.velocity = (0.1, 0.0, 0.0)
        while walking.progress.phase is not GaitPhase.SINGLE:
            plant.step(walking.command(plant.measure()))
        return plant.time

    usual = SteppingConstants()
    assert lifted(usual) < lifted(changed(usual, {"shift_time": 1.5 * usual.stand.shift_time}))
    own, robot = WalkingControl(DESCRIPTION.robot(), None, DT, settings).source, DESCRIPTION.robot()
    assert isinstance(own, SteppingWalk)
    assert own.constants == SteppingWalk.of(robot, DT, constants=usual).constants
