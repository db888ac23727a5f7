"""Signals of a log against the objects that they are read from, in ticks with and without each part."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest

import wbc
from wbc.app.log import sources
from wbc.app.log.signals import Signals, Tick
from wbc.app.log.truth import add_plant
from wbc.core.estimation.falls import FallReason
from wbc.core.robot import GRAVITY
from wbc.robots import load
from wbc.sim import Plant
from wbc.walking import FootstepPlan, WalkingControl, walk_distance
from wbc.walking.contact import Event

DT = 0.005


class Columns:
    """Values of signals by name, read of ticks."""

    def __init__(self, add: Any, *parts: Any) -> None:
        self.signals = Signals()
        add(self.signals, *parts)
        self.row = np.zeros(self.signals.width)
        self.texts: list[Any] = []

    def read(self, tick: Any) -> Columns:
        self.texts = self.signals.read(tick, self.row)
        return self

    def __getitem__(self, name: str) -> Any:
        for signal, place in self.signals.columns:
            if signal.name == name:
                return self.texts[place] if signal.kind in ("text", "list") else float(self.row[place])
        raise KeyError(name)

    def group(self, name: str) -> np.ndarray:
        found = [place for signal, place in self.signals.columns if signal.name.rpartition("/")[0] == name]
        return self.row[found]


def walked(ticks: int = 3) -> tuple[WalkingControl, Tick]:
    robot = load("hrp4_class").robot()
    walking = WalkingControl(robot, walk_distance(FootstepPlan.standing(robot), 0.3), DT)
    for tick in range(ticks):
        measured = at_rest(robot, tick * DT)
        command = walking.command(measured)
    estimate = walking.drives.observer.robot
    return walking, Tick(
        None, walking, measured, command, solution=walking.drives.solution, estimate=estimate
    )


def test_references_of_a_walk_are_those_of_its_tick() -> None:
    walking, tick = walked()
    reference, robot = tick.reference, tick.robot
    assert reference is not None
    found = Columns(sources._add_walk, tick).read(tick)
    assert found["walk/phase"] == reference.progress.phase.value
    assert (
        found["walk/step"] == reference.progress.steps_done and found["walk/steps_done"] == walking.steps_done
    )
    assert found["walk/heading"] == reference.progress.heading
    landing = walking.progress.upcoming[0]
    assert found["step/side"] == landing.side
    np.testing.assert_allclose(found.group("step/landing"), [landing.x, landing.y, landing.z, landing.yaw])
    pendulum = reference.pendulum
    assert found["pendulum/omega"] == pendulum.omega
    for name, value in (
        ("com/reference", pendulum.com),
        ("com/reference_velocity", pendulum.com_velocity),
        ("com/reference_acceleration", pendulum.com_acceleration),
        ("zmp/reference", pendulum.zmp),
        ("dcm/reference", pendulum.dcm[:2]),
        ("drive/granted", walking.granted_velocity),
    ):
        np.testing.assert_array_equal(found.group(name), value)
    assert tick.estimate is not None
    xi = tick.estimate.com[:2] + tick.estimate.com_velocity[:2] / pendulum.omega
    np.testing.assert_allclose(found.group("dcm/estimated"), xi)
    assert np.isnan(found.group("drive/commanded")).all(), "nobody steers"
    for side, motion, on in zip(("left", "right"), reference.feet, reference.progress.contact, strict=True):
        assert found[f"foot/{side}/contact"] == on
        pose = pin.SE3ToXYZQUAT(motion.placement)
        np.testing.assert_allclose(found.group(f"foot/{side}/reference/position"), pose[:3])
        np.testing.assert_allclose(found.group(f"foot/{side}/reference/orientation"), pose[3:])
        np.testing.assert_allclose(found.group(f"foot/{side}/reference/linear_velocity"), motion.velocity[:3])
    none = replace(tick)
    none.reference = None
    found.read(none)
    assert np.isnan(found.row).all() and found["walk/phase"] is None and found["walk/event"] is None
    assert robot.na


def test_a_fall_is_an_event_once_beside_those_of_its_tick() -> None:
    walking, tick = walked()
    found = Columns(sources._add_walk, tick)
    assert tick.reference is not None

    def events(*given: Event) -> Any:
        assert tick.reference is not None
        progress = tick.reference.progress._replace(events=given)
        walking.reference = tick.reference = tick.reference._replace(progress=progress)
        return found.read(tick)["walk/event"]

    assert events() is None
    assert events(Event.LIFT_OFF, Event.STARTED) == f"{Event.LIFT_OFF.value}; {Event.STARTED.value}"
    walking.drives.sensing.falls.reason = FallReason.DOWN
    assert events(Event.LIFT_OFF) == f"{Event.LIFT_OFF.value}; fallen: {FallReason.DOWN.value}"
    assert events() is None and events(Event.STOPPED) == Event.STOPPED.value


def test_a_stabilizer_is_logged_where_it_has_an_output_and_a_walk() -> None:
    walking, tick = walked()
    output, balance = tick.output, walking.balance
    assert (
        output is not None and balance is not None and balance.bias is not None and balance.lean is not None
    )
    found = Columns(sources._add_stabilizer, tick).read(tick)
    for name, value in (
        ("walk/lean", balance.lean.angle),
        ("stabilizer/bias", balance.bias.bias),
        ("zmp/desired", output.zmp),
        ("stabilizer/dcm_error", output.errors.dcm),
        ("stabilizer/dcm_error_average", output.errors.average),
        ("stabilizer/dcm_error_rate", output.errors.rate),
        ("stabilizer/com_acceleration", output.com_acceleration),
        ("stabilizer/net_wrench", output.net_wrench),
        ("foot/left/wrench_desired", output.feet.wrenches[0]),
        ("foot/right/wrench_desired", output.feet.wrenches[1]),
    ):
        np.testing.assert_allclose(found.group(name), value, atol=1e-12)
    for side, correction in zip(("left", "right"), output.corrections, strict=True):
        expected = [correction.roll, correction.pitch, correction.height]
        np.testing.assert_allclose(found.group(f"foot/{side}/correction"), expected)
    assert found["stabilizer/in_air"] == output.in_air
    for gone in ("output", "walking"):
        other = replace(tick)
        setattr(other, gone, None)
        found.read(other)
        assert np.isnan(found.group("walk/lean")).all() and np.isnan(found.group("stabilizer/bias")).all()
        assert np.isnan(found.group("zmp/desired")).all() == (gone == "output")
    balance.lean = balance.bias = None
    found.read(tick)
    assert not found.group("walk/lean").any() and not found.group("stabilizer/bias").any()


def test_the_estimate_of_a_stand_has_its_zmp_and_its_dcm_over_the_lower_sole() -> None:
    robot = load("hrp4_class").robot()
    control = wbc.TorqueControl(wbc.balance_controller(robot, DT))
    measured = at_rest(robot, 0.0)
    wrenches = measured.wrenches.copy()
    wrenches[0, 4] = -6.0
    measured = replace(measured, sole_wrench=wrenches)
    command = control.command(measured)
    estimate = control.observer.robot
    q, v = np.array(estimate.q), np.zeros(estimate.nv)
    v[:3] = 0.1, -0.2, 0.3
    estimate.update(q, v)
    tick = Tick(None, control, measured, command, solution=control.solution, estimate=estimate)
    found = Columns(sources._add_estimate, tick).read(tick)
    np.testing.assert_allclose(found.group("com/estimated"), estimate.com)
    np.testing.assert_allclose(found.group("com/estimated_velocity"), estimate.com_velocity)
    np.testing.assert_allclose(found.group("base/estimated/position"), estimate.q[:3])
    np.testing.assert_allclose(found.group("base/estimated/angular_velocity"), estimate.v[3:6])
    low = min(float(estimate.placement(sole.frame).translation[2]) for sole in estimate.soles)
    omega = math.sqrt(GRAVITY / (float(estimate.com[2]) - low))
    np.testing.assert_allclose(
        found.group("dcm/estimated"), estimate.com[:2] + estimate.com_velocity[:2] / omega
    )
    total = np.zeros(6)
    for sole, wrench in zip(estimate.soles, wrenches, strict=True):
        total += estimate.placement(sole.frame).act(pin.Force(wrench)).vector
    zmp = (-total[4] + low * total[0]) / total[2], (total[3] + low * total[1]) / total[2], low
    np.testing.assert_allclose(found.group("zmp/measured"), zmp, atol=1e-9)
    blind = replace(tick)
    blind.measurement = replace(measured, sole_wrench=None)
    assert np.isnan(found.read(blind).group("zmp/measured")).all()
    assert not np.isnan(found.group("dcm/estimated")).any()
    blind.estimate = None


def test_measurements_and_commands_are_logged_in_their_order_with_their_units() -> None:
    plant = Plant(load("hrp4_class"))
    robot, rng = plant.robot, np.random.default_rng(2)
    na = robot.na
    measured = replace(
        at_rest(robot, 1.0),
        joint_position=rng.normal(size=na), joint_velocity=rng.normal(size=na), joint_torque=rng.normal(size=na),
        angular_velocity=rng.normal(size=3), specific_force=rng.normal(size=3), sole_wrench=rng.normal(size=(2, 6)),
        hand_wrenches=rng.normal(size=(2, 6)), sole_range=rng.normal(size=2), sole_stiffness=rng.normal(size=2),
    )  # fmt: skip
    hold = plant.hold()
    command = replace(
        hold,
        joint_position=rng.normal(size=na), joint_velocity=rng.normal(size=na), joint_torque=rng.normal(size=na),
        kp=rng.normal(size=na), kd=rng.normal(size=na), sole_stiffness=rng.normal(size=2),
    )  # fmt: skip
    tick = Tick(None, None, measured, command, model=robot)
    found = Columns(sources._add_measurement, tick).read(tick)
    for name, value in (
        ("joint/position", measured.joint_position),
        ("joint/velocity", measured.joint_velocity),
        ("joint/torque_measured", measured.joint_torque),
        ("imu/angular_velocity", measured.angular_velocity),
        ("imu/specific_force", measured.specific_force),
        ("foot/left/wrench_measured", measured.wrenches[0]),
        ("foot/right/wrench_measured", measured.wrenches[1]),
        ("hand/left_hand/wrench_measured", measured.hand_wrenches[0]),  # type: ignore[index]
        ("hand/right_hand/wrench_measured", measured.hand_wrenches[1]),  # type: ignore[index]
    ):
        np.testing.assert_array_equal(found.group(name), value)
    assert found["foot/left/range"] == measured.sole_range[0]
    assert found["foot/right/stiffness"] == measured.sole_stiffness[1]
    sent = Columns(sources._add_command, tick).read(tick)
    for name in ("position_reference", "velocity_reference", "torque_command", "kp_command", "kd_command"):
        value = {"torque_command": "joint_torque", "kp_command": "kp", "kd_command": "kd"}.get(name)
        of = getattr(command, value or f"joint_{name.partition('_')[0]}")
        np.testing.assert_array_equal(sent.group(f"joint/{name}"), of)
    units = {signal.name: signal.unit for signal, _ in sent.signals.columns}
    joint = robot.joint_names[0]
    assert units[f"joint/kp_command/{joint}"] == "Nm/rad" and units[f"joint/kd_command/{joint}"] == "Nms/rad"
    assert units[f"joint/velocity_reference/{joint}"] == "rad/s"
    plain = Tick(None, None, replace(measured, joint_torque=None, hand_wrenches=None), hold, model=robot)
    names = {signal.name for signal, _ in Columns(sources._add_measurement, plain).signals.columns}
    assert not [name for name in names if "torque_measured" in name or name.startswith("hand/")]


def test_a_solution_is_logged_by_its_names_with_norms_of_residuals() -> None:
    _, tick = walked()
    solution = tick.solution
    assert solution is not None
    found = Columns(sources._add_solver, tick).read(tick)
    assert (
        found["solver/status"] == solution.status.value and found["solver/iterations"] == solution.iterations
    )
    np.testing.assert_array_equal(found.group("tick"), solution.timings)
    for name, rows in solution.residuals.items():
        assert found[f"solver/residual/{name}"] == pytest.approx(float(np.linalg.norm(rows)))
    feet = dict(zip([sole.name for sole in tick.robot.soles], ("left", "right"), strict=True))
    for name, wrench in solution.wrenches.items():
        np.testing.assert_array_equal(found.group(f"foot/{feet[name]}/wrench_solved"), wrench)
    assert found["solver/active_limits"] == ("; ".join(solution.active_limits) or None)
    solution.multipliers = np.zeros(len(solution.multipliers))
    solution.multipliers[[1, 3]] = -2.0, 1e-7
    assert found.read(tick)["solver/active_limits"] == solution.layout.limits[1]
    solution.multipliers[3] = 1e-5
    both = f"{solution.layout.limits[1]}; {solution.layout.limits[3]}"
    assert found.read(tick)["solver/active_limits"] == both
    other = replace(tick)
    other.solution = None
    assert np.isnan(found.read(other).group("tick")).all() and found["solver/status"] is None


def test_the_truth_of_a_plant_is_that_of_its_simulation() -> None:
    plant = Plant(load("hrp4_class"), seed=1)
    tick = Tick(plant, None, plant.measure(), plant.hold(), plant.description, model=plant.robot)
    plant.push(plant.robot.torso_frame, [3.0, -4.0, 5.0], 0.1)
    for _ in range(3):
        plant.step(plant.hold())
    truth = plant.truth()
    found = Columns(add_plant, tick).read(tick)
    np.testing.assert_allclose(found.group("truth/com"), truth.com, atol=1e-9)
    np.testing.assert_allclose(found.group("truth/com_velocity"), truth.com_velocity, atol=1e-6)
    np.testing.assert_allclose(found.group("truth/base/position"), truth.q[:3], atol=1e-9)
    np.testing.assert_allclose(found.group("truth/push/force"), [3.0, -4.0, 5.0], atol=1e-9)
    assert np.isfinite(found.group("truth/push/point")).all()
    torque = np.array(plant.joint_torque)
    np.testing.assert_allclose(found.group("truth/joint/torque"), torque)
    limit = np.where(torque > 0.0, plant.robot.torque_upper, -plant.robot.torque_lower)
    np.testing.assert_allclose(found.group("truth/joint/torque_ratio"), torque / limit)
    while plant.time < 0.2:
        plant.step(plant.hold())
    found.read(tick)
    assert np.isnan(found.group("truth/push/point")).all() and not found.group("truth/push/force").any()


def test_states_of_a_program_that_have_ended_are_told_once() -> None:
    program: Any = SimpleNamespace(path="walk/stand", history=[(0.0, "a", "done")])
    found = Columns(sources._add_program, program)
    assert found.read(SimpleNamespace())["program/event"] == "a: done"
    assert found["program/state"] == "walk/stand"
    assert found.read(SimpleNamespace())["program/event"] is None
    program.history += [(1.0, "b", "failed"), (1.0, "c", "done")]
    assert found.read(SimpleNamespace())["program/event"] == "b: failed; c: done"
