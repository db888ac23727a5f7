"""Loads: identified, taken over by the models, carried and let go of, against the plant's own mass."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.base.errors import InputError
from wbc.core.drive.control import Mode
from wbc.core.estimation.outside import OutsideSettings, OutsideWrench
from wbc.core.robot import GRAVITY
from wbc.robots import load as load_robot
from wbc.sim import Plant, Trial
from wbc.walking import FootstepPlan, LoadSettings, WalkingControl, WalkingControlSettings
from wbc.walking.load import STEP, HeldLoad

DESCRIPTION = load_robot("hrp4_class")
DT = 0.005


def handed_over(share: float, noise: str) -> tuple[Trial, float]:
    """A robot with its arms ahead, after a load was put into its hands within a second; and the mass of the load."""
    robot = DESCRIPTION.robot()
    forward = {"shoulder_pitch": -0.78, "elbow_pitch": -0.83}  # hands 0.35 m ahead
    posture = robot.configuration(
        {f"{s}_{joint}": to for s in ("left", "right") for joint, to in forward.items()}
    )
    plant = Plant(DESCRIPTION, noise=noise, initial_configuration=posture, visuals=False)
    robot.update(posture, np.zeros(robot.nv))
    settings = WalkingControlSettings(load=LoadSettings())
    trial = Trial(plant, WalkingControl(robot, FootstepPlan.standing(robot), DT, settings))
    trial.advance(2.0)
    for frame in robot.frames.values():
        plant.load(frame, 0.5 * share * plant.robot.mass, over=1.0)
    trial.advance(4.0)
    return trial, share * plant.robot.mass


@pytest.mark.slow
def test_a_load_in_the_hands_is_found_taken_over_by_both_models_and_let_go_of() -> None:
    """20 % of the weight 0.35 m ahead, handed over in a second, with realistic sensors."""
    trial, mass = handed_over(0.2, "realistic")
    walking, plant, load = trial.control, trial.plant, trial.control.load
    assert walking.drives.failures == 0
    assert load.mass == pytest.approx(mass, rel=0.05)
    assert np.hypot(*(load.place - load.middle)[:2]) < 0.01
    total = walking.controller.robot.mass
    assert total == walking.drives.observer.robot.mass == walking.stabilizer.mass
    assert total == pytest.approx(1.2 * plant.robot.mass, rel=0.01)
    # The CoM of robot and load is over the feet, and the feet bear both.
    assert abs(plant.truth().com[0]) < 0.015
    assert plant.truth().contact_force[:, 2].sum() == pytest.approx(
        1.2 * plant.robot.mass * GRAVITY, rel=0.02
    )
    # It is let go of: the balance has the masses of the models, and the estimate of the bias rests meanwhile.
    assert not load.changing
    for hand in plant.robot.frames.values():
        plant.load(hand, 0.0)
    load.release()
    assert load.changing
    trial.advance(0.1)
    own = plant.robot.mass
    assert walking.stabilizer.mass == walking.controller.robot.mass == pytest.approx(own)
    assert walking.fallen is None


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "mode"), [("hrp4_class", "position"), ("g1", "torque")])
def test_a_load_that_is_there_from_the_start_is_found(robot: str, mode: Mode) -> None:
    """3 kg, with realistic sensors: more than a tare of sensors and model can be."""
    description = load_robot(robot)
    model, dt = description.robot(), 0.005 if mode == "position" else 0.002
    plant = Plant(description, noise="realistic", seed=3, control_period=dt, visuals=False)
    for frame in model.frames.values():
        plant.load(frame, 1.5)
    settings = WalkingControlSettings(mode=mode, load=LoadSettings())
    walking = WalkingControl(model, FootstepPlan.standing(model), dt, settings)
    trial = Trial(plant, walking)
    trial.advance(4.0)
    assert walking.load is not None and walking.load.mass == pytest.approx(3.0, abs=0.3)


@pytest.mark.slow
def test_a_load_that_is_dropped_leaves_the_models() -> None:
    trial, _ = handed_over(0.15, "none")
    for frame in trial.plant.robot.frames.values():
        trial.plant.load(frame, 0.0, over=0.0)
    trial.advance(4.0)
    assert trial.plant.load_mass == 0.0
    assert trial.control.controller.robot.mass == pytest.approx(trial.plant.robot.mass, abs=0.02)


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.05, -0.02, 0.1)])
def test_the_plant_bears_a_load_at_its_place(point: tuple[float, float, float]) -> None:
    """Total mass, CoM and force under the feet; a reset takes it off."""
    plant = Plant(DESCRIPTION, visuals=False)
    mass, com = plant.robot.mass, plant.truth().com
    place = plant.robot.placement("left_hand").act(np.array(point))
    place += plant.data.qpos[:3] - plant.robot.q[:3]
    plant.load("left_hand", 2.0, at=point)
    plant.step(plant.hold())
    assert plant.load_mass == 2.0
    assert plant.truth().com == pytest.approx((mass * com + 2.0 * place) / (mass + 2.0), abs=1e-4)
    plant.reset()
    assert plant.load_mass == 0.0 and plant.truth().com == pytest.approx(com)
    plant.load("left_hand", 2.0, over=0.1)
    for _ in range(10):
        plant.step(plant.hold())
    assert plant.load_mass == pytest.approx(1.0)


def test_a_plant_that_has_carried_starts_again_bit_for_bit() -> None:
    plant, ends = Plant(DESCRIPTION, foot="soft", visuals=False), []
    for _ in range(2):
        plant.reset()
        for _ in range(20):
            plant.step(plant.hold())
        ends.append(plant.data.qpos.copy())
        plant.load("left_hand", 1.0)
        plant.load("torso", 2.0)
        plant.step(plant.hold())
    np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.parametrize(
    ("rpy", "share", "found", "place"),
    [
        ((0.0, 0.0, 0.0), 0.009, 0.0, (0.0, 0.0)),  # an error of sensors
        ((0.0, 0.0, 2.0), 0.02, 0.02, (0.1, -0.04)),
        ((-0.1, 0.4, 2.0), 0.08, 0.08, (0.1, -0.04)),
        ((0.3, -0.2, -1.2), 0.08, 0.08, (0.1, -0.04)),
        ((0.0, 0.0, 2.0), 0.5, 0.1, (0.15, -0.15)),  # more than it may be, and further away
        ((0.0, 0.0, 0.0), -0.1, 0.0, (0.0, 0.0)),  # a pull upwards
    ],
)
def test_a_load_is_counted_from_one_percent_up_to_its_largest_mass_and_distance(
    rpy: tuple[float, float, float], share: float, found: float, place: tuple[float, float]
) -> None:
    """By its weight and its moment about the hands in the heading, whatever roll and pitch of the base."""
    robot = DESCRIPTION.robot()
    q = np.array(robot.q)
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(*rpy)).coeffs()
    robot.update(q, np.zeros(robot.nv))
    own = robot.mass
    outside = OutsideWrench(robot, OutsideSettings(tare=0.0))
    load = HeldLoad(robot, outside, LoadSettings(largest=0.1, offset=0.15))
    mass, turn = share * own, pin.utils.rotate("z", rpy[2])
    at = load.middle + turn @ (0.1, -0.04, 0.0)
    hands = [robot.placement(frame).translation for frame in robot.frames.values()]
    np.testing.assert_allclose(load.middle, np.mean(hands, axis=0))
    for _ in range(500):
        robot.update(q, np.zeros(robot.nv))
        force = np.array([0.0, 0.0, -(mass - load.applied) * GRAVITY])
        moment = np.cross(at - robot.com, [0.0, 0.0, -mass * GRAVITY])
        moment -= np.cross(load.place - robot.com, [0.0, 0.0, -load.applied * GRAVITY])
        outside.wrench = np.concatenate([force, moment])
        load.update(2.0 * DT)
    assert load.applied == pytest.approx(found * own, abs=6e-4 * own)
    assert robot.mass == pytest.approx(own + load.applied)
    assert load.mass == pytest.approx(min(max(mass, 0.0), 0.1 * own), rel=1e-3, abs=1e-6)
    np.testing.assert_allclose(
        (turn.T @ (load.place - load.middle))[:2], place, atol=STEP / found if share == 0.5 else 1e-3
    )
    assert not load.changing or share not in (0.009, 0.02)
    load.release()
    robot.update(q, np.zeros(robot.nv))
    assert load.mass == 0.0 and robot.mass == pytest.approx(own)


def test_a_frame_holds_a_load_once() -> None:
    robot = DESCRIPTION.robot()
    for twice in (("left_hand", "left_hand"), ("left_hand", robot.frames["left_hand"])):
        with pytest.raises(InputError, match="must be different frames"):
            HeldLoad(robot, OutsideWrench(robot), LoadSettings(hands=twice))


@pytest.mark.parametrize("hands", [(), ("left_hand",), ("right_hand",)])
def test_a_load_that_is_put_into_the_models_comes_off_the_wrench_in_the_same_tick(
    hands: tuple[str, ...],
) -> None:
    """Force and moment about the CoM of what the models have gained: in sum they stay what they were."""
    robot = DESCRIPTION.robot()
    outside = OutsideWrench(robot, OutsideSettings(tare=0.0))
    load = HeldLoad(robot, outside, LoadSettings(hands=hands))
    outside.wrench = np.array([0.0, 0.0, -60.0, 2.0, 5.0, 0.0])
    com = np.array(robot.com)
    load.update(0.1)
    robot.update(robot.q, np.zeros(robot.nv))
    weight = np.array([0.0, 0.0, -load.applied * GRAVITY])
    assert load.applied > 0.1
    np.testing.assert_allclose(outside.wrench[:3] + weight, (0.0, 0.0, -60.0), atol=1e-9)
    arm = load.place - com
    moved = np.array(robot.com) - com  # of the whole robot, which takes its own weight with it
    np.testing.assert_allclose(outside.wrench[3:5] + np.cross(arm, weight)[:2], (2.0, 5.0), atol=0.15)
    np.testing.assert_allclose(robot.mass * moved[:2], load.applied * arm[:2], atol=1e-9)


def test_a_load_that_is_let_go_of_on_the_move_leaves_no_outside_wrench_behind() -> None:
    """The mass that the models lose had momentum at 0.5 m/s: no force has taken it."""
    robot = DESCRIPTION.robot()
    outside = OutsideWrench(robot, OutsideSettings(tare=0.0))
    load = HeldLoad(robot, outside)
    velocity, wrenches = np.zeros(robot.nv), np.zeros((2, 6))
    velocity[0] = 0.5

    def tick() -> None:
        robot.update(robot.q, velocity)
        wrenches[:, 2] = 0.5 * robot.total_mass * GRAVITY  # under the CoM of robot and load
        middle = np.mean([robot.placement(sole.frame).translation for sole in robot.soles], axis=0)
        x, y = (robot.com - middle)[:2]
        wrenches[:, 3:5] = wrenches[0, 2] * np.array([y, -x])
        outside.update(wrenches, DT)

    tick()
    outside.explain((0.0, 0.0, 50.0, 0.0, 0.0, 0.0))
    load.update(1.0)
    assert load.applied > 2.0
    outside.explain(outside.wrench)  # what is left of it: the models have the whole load
    load.release()
    tick()
    assert load.applied == 0.0
    np.testing.assert_allclose(outside.wrench, 0.0, atol=1e-9)
