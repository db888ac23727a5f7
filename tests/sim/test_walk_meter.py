"""Figures of a walk from ticks that are made up: errors, impacts, touch-downs, torques, soles."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wbc.core.robot import GRAVITY
from wbc.sim.terrain.spec import terrain
from wbc.sim.walks.meter import IMPACT_TIME, MIN_FORCE, NOTICE_TIME, WalkMeter
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.control import WalkingControl

PERIOD, MASS = 0.01, 20.0


@WalkingControl.register
class Made:
    """A plant and a controller whose state a test sets."""

    control_period = PERIOD

    def __init__(self) -> None:
        limits = np.array([10.0, 4.0])
        self.robot = SimpleNamespace(
            na=2,
            mass=MASS,
            joint_names=("hip", "knee"),
            torque_share=lambda torque: np.abs(torque) / limits,
            leg_joints=[1],
        )
        self.time, self.joint_torque, self.joint_velocity = 0.0, np.zeros(2), np.zeros(2)
        self.rotation, self.slid, self.base_pose = np.eye(3), np.zeros(3), (0.0, 0.0)
        self.contacts: list[tuple[tuple[float, float, float], float, int]] = []
        self.progress: Any = SimpleNamespace(
            swing=None, stance=0, steps_done=0, phase=GaitPhase.DOUBLE, elapsed=0.0, duration=1.0
        )
        self.output: Any = None
        self.reference: Any = None
        self.drives = SimpleNamespace(measurement=None)
        self.meter = WalkMeter(self, self)  # type: ignore[arg-type]

    @property
    def sole_poses(self) -> list[tuple[np.ndarray, np.ndarray]]:
        return [(np.array([1.0, y, 0.3]) + self.slid, self.rotation) for y in (0.5, -0.5)]

    def truth(self) -> Any:
        return SimpleNamespace(
            contact_position=np.array([place for place, *_ in self.contacts]).reshape(-1, 3),
            contact_force=np.array([(0.0, 0.0, force) for _, force, _ in self.contacts]).reshape(-1, 3),
            contact_sole=np.array([sole for *_, sole in self.contacts]),
        )

    def tick(
        self,
        forces: tuple[float, float] = (0.0, 0.0),
        *events: Event,
        zmp: Any = (0.0, 0.0),
        moments: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Tell the meter of a tick with normal forces, N, and moments, Nm, and what the controller has seen."""
        wrenches = np.zeros((2, 6))
        wrenches[:, 2], wrenches[:, 3:5] = forces, moments
        self.progress.events = events
        self.reference = SimpleNamespace(
            progress=self.progress, pendulum=SimpleNamespace(zmp=np.array([*zmp, 0.0]))
        )
        measurement = SimpleNamespace(time=self.time, sole_wrench=wrenches, wrenches=wrenches)
        self.meter.tick(SimpleNamespace(measurement=measurement))  # type: ignore[arg-type]
        self.time = round(self.time + PERIOD, 9)

    def figures(self) -> dict[str, Any]:
        return self.meter.figures()


def test_the_impact_is_the_greatest_force_on_a_landing_foot_from_before_it_was_noticed() -> None:
    """From 0.05 s before a touch-down is detected to 0.1 s after it; forces on the other foot do not count."""
    assert (NOTICE_TIME, IMPACT_TIME) == (0.05, 0.1)
    weight = MASS * GRAVITY
    for spike, counted in ((15, False), (16, True), (20, True), (25, True), (30, True), (31, False)):
        made = Made()
        made.progress.swing = 1
        for k in range(40):
            forces = (900.0, 300.0 if k == spike else 100.0)
            made.tick(forces, *((Event.TOUCH_DOWN,) if k == 20 else ()))
            made.progress.swing = None if k >= 20 else 1
        assert made.figures()["impact"] == pytest.approx((300.0 if counted else 100.0) / weight), spike
    never = Made()
    never.tick((100.0, 900.0), Event.NO_TOUCH_DOWN)
    assert never.figures()["impact"] is None  # a foot that found no ground has no impact
    left = Made()
    left.progress.swing = 0
    left.tick((50.0, 700.0))
    left.tick((70.0, 700.0), Event.EARLY_TOUCH_DOWN)
    assert left.figures()["impact"] == pytest.approx(70.0 / weight)


def test_forces_of_a_robot_without_force_sensors_are_those_that_its_control_has_found() -> None:
    made, wrenches = Made(), np.zeros((2, 6))
    made.progress.swing, wrenches[1, 2] = 1, 80.0
    made.drives.measurement = SimpleNamespace(wrenches=wrenches)
    for events in ((), (Event.LATE_TOUCH_DOWN,)):
        made.progress.events = events
        made.reference = SimpleNamespace(progress=made.progress, pendulum=None)
        made.meter.tick(
            SimpleNamespace(measurement=SimpleNamespace(time=0.0, sole_wrench=None), control=made)
        )  # type: ignore[arg-type]
    assert made.figures()["impact"] == pytest.approx(80.0 / (MASS * GRAVITY))


def test_touch_downs_are_counted_by_their_kind_and_a_tick_once() -> None:
    made = Made()
    kinds = (
        Event.EARLY_TOUCH_DOWN,
        Event.TOUCH_DOWN,
        Event.LATE_TOUCH_DOWN,
        Event.NO_TOUCH_DOWN,
        Event.FORCED_LIFT_OFF,
    )
    for number, kind in enumerate(kinds, 1):
        for _ in range(number):
            made.tick((1.0, 1.0), kind)
    again = SimpleNamespace(measurement=None, control=made)
    made.meter.tick(again)  # type: ignore[arg-type] - the same reference: the controller has had no measurement
    found = made.figures()["touchdowns"]
    assert (found.early, found.on_time, found.late, found.missed, found.forced_lift_offs) == (1, 2, 3, 4, 5)
    made.reference = None
    made.meter.tick(again)  # type: ignore[arg-type]


def test_errors_are_horizontal_distances_of_every_tick() -> None:
    """ZMP: reference less measured, none in the air; CoM and DCM: their errors; mean, deviation, greatest."""
    made = Made()
    for zmp, com, dcm in (
        ((0.03, 0.04), (0.006, 0.008, 9.0), (0.0, 0.01)),
        ((math.nan, math.nan), (0.0, 0.0, 9.0), (0.03, 0.04)),
        ((-0.05, 0.12), (-0.012, 0.005, 9.0), (0.0, 0.0)),
    ):
        made.output = SimpleNamespace(
            measured_zmp=np.array([zmp[0] + 1.0, zmp[1] - 2.0, 0.0]),
            errors=SimpleNamespace(com=np.array(com), dcm=np.array(dcm)),
        )
        made.tick(zmp=(1.0, -2.0))
    found = made.figures()
    assert (found["zmp_error"].mean, found["zmp_error"].std) == pytest.approx((0.09, 0.04))
    distances = np.array([0.01, 0.0, 0.013])
    assert (found["com_error"].mean, found["com_error"].std) == pytest.approx(
        (distances.mean(), distances.std())
    )
    assert found["dcm_error"].mean == pytest.approx(0.02) and found["dcm_error_max"] == pytest.approx(0.05)
    assert Made().figures()["dcm_error_max"] is None


def test_tilt_is_that_of_the_stance_sole_in_single_support_alone() -> None:
    made = Made()
    for phase, roll, pitch in (
        (GaitPhase.SINGLE, 0.1, -0.2),
        (GaitPhase.DOUBLE, 0.9, 0.9),
        (GaitPhase.SINGLE, -0.3, 0.4),
    ):
        made.progress.phase = phase
        made.rotation = Rotation.from_euler("ZYX", [0.7, pitch, roll]).as_matrix()
        made.tick()
    found = made.figures()
    assert (found["sole_roll"].mean, found["sole_roll"].std) == pytest.approx((0.2, 0.1))
    assert (found["sole_pitch"].mean, found["sole_pitch"].std) == pytest.approx((0.3, 0.1))


def test_the_contact_area_is_taken_once_in_the_middle_of_each_single_support() -> None:
    """The hull of the contacts of the stance sole, in its plane, that carry more than 1 N."""
    assert MIN_FORCE == 1.0
    made = Made()
    made.rotation = Rotation.from_euler("ZYX", [0.4, 0.3, -0.2]).as_matrix()
    centre = {side: made.sole_poses[side][0] for side in (0, 1)}

    def rectangle(side: int, length: float, width: float, force: float) -> None:
        for x in (-0.5, 0.5):
            for y in (-0.5, 0.5):
                place = centre[side] + made.rotation @ np.array([x * length, y * width, 0.0])
                made.contacts.append((tuple(place), force, side))

    sizes = []
    for steps, stance in ((0, 0), (1, 1)):
        made.progress.steps_done, made.progress.stance = steps, stance
        for phase, elapsed in (
            (GaitPhase.DOUBLE, 0.9),
            (GaitPhase.SINGLE, 0.0),
            (GaitPhase.SINGLE, 0.49),
            (GaitPhase.SINGLE, 0.5),
            (GaitPhase.SINGLE, 0.51),
            (GaitPhase.SINGLE, 0.9),
        ):
            made.progress.phase, made.progress.elapsed, made.contacts = phase, elapsed, []
            length = 0.1 + 0.1 * elapsed + 0.05 * steps
            rectangle(stance, length, 0.1, 5.0)
            rectangle(stance, 2.0, 2.0, 0.99)  # hardly touches
            rectangle(1 - stance, 3.0, 3.0, 50.0)  # the other sole
            made.tick()
        sizes.append((0.1 + 0.1 * 0.5 + 0.05 * steps) * 0.1)
    found = made.figures()["contact_area"]
    assert (found.mean, found.std) == pytest.approx((np.mean(sizes), np.std(sizes)))


def test_torques_are_over_their_limits_and_work_counts_driving_and_braking() -> None:
    """Shares of 10 and 4 Nm; ∑ |τ q̇| T over the joints and periods, the negative counted as positive."""
    made = Made()
    for torque, velocity in (((5.0, 1.0), (2.0, -1.0)), ((-8.0, -3.6), (1.0, 0.5)), ((0.0, 2.0), (9.0, 3.0))):
        made.joint_torque, made.joint_velocity = np.array(torque), np.array(velocity)
        made.meter.after(None)  # type: ignore[arg-type]
    found = made.figures()
    assert found["peak_torque_ratio"] == pytest.approx(0.9) and found["peak_torque_joint"] == "knee"
    shares = np.array([0.5, 0.9, 0.5])
    assert (found["torque_ratio"].mean, found["torque_ratio"].std) == pytest.approx(
        (shares.mean(), shares.std())
    )
    energy = found["energy"]
    assert (energy.legs, energy.upper_body) == pytest.approx(
        ((1.0 + 1.8 + 6.0) * PERIOD, (10.0 + 8.0) * PERIOD)
    )
    np.testing.assert_allclose(made.meter.work, [energy.upper_body, energy.legs])


def test_vibration_is_the_sum_of_the_changes_of_accelerations_in_samples_of_20_ms() -> None:
    made, velocities = Made(), np.random.default_rng(3).normal(size=(21, 2))
    for velocity in velocities:
        made.joint_velocity = velocity
        made.meter.after(None)  # type: ignore[arg-type]
    samples = velocities[::2]  # of periods of 10 ms
    changes = np.diff(np.diff(samples, axis=0) / 0.02, axis=0)
    assert made.figures()["vibration"] == pytest.approx(np.abs(changes).sum())


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_the_speed_is_that_over_the_middle_half_of_the_distance_from_the_start(turn: float) -> None:
    """Setting off and stopping, each a quarter of the way, do not count, nor does the time that the robot stands."""
    made, way = Made(), 0.0
    assert made.figures()["speed"] is None
    for speed, seconds in ((0.0, 0.3), (0.5, 1.0), (1.0, 1.0), (0.25, 2.0), (0.0, 0.5)):
        for _ in range(round(seconds / PERIOD)):
            way += speed * PERIOD
            made.base_pose = (3.0 + way * math.cos(turn), way * math.sin(turn) - 1.0)
            made.meter.after(None)  # type: ignore[arg-type]
    assert made.figures()["speed"] == pytest.approx(1.0, rel=0.03)  # samples of 20 ms
    still = Made()
    for _ in range(10):
        still.meter.after(None)  # type: ignore[arg-type]
    assert still.figures()["speed"] is None


def test_slip_is_the_way_of_the_point_of_a_loaded_sole_at_its_centre_of_pressure() -> None:
    """A turn about that point is none, nor the way of a sole that carries little, or less than 0.05 m/s."""
    weight, step = MASS * GRAVITY, 2.0 * 0.05 * PERIOD
    for share, way, counted in ((0.06, step, 2.0), (0.04, step, 0.0), (0.06, 0.2 * step, 0.0)):
        made = Made()
        for _ in range(11):
            made.tick((share * weight, share * weight))
            made.slid = made.slid + [0.6 * way, -0.8 * way, 0.1]
        assert made.figures()["slip"] == pytest.approx(10.0 * counted * way)
    made = Made()
    point = np.array([0.1, 0.02, 0.0])
    for k in range(11):
        turned = Rotation.from_euler("zyx", [0.03 * k, 0.02 * k, 0.0]).as_matrix()
        made.rotation, made.slid = turned, point - turned @ point
        made.tick((weight, 0.0), moments=(weight * point[1], -weight * point[0]))
    assert made.figures()["slip"] == pytest.approx(0.0, abs=1e-9)


def test_a_sole_that_a_walkway_carries_does_not_slip() -> None:
    """Only the way over the walkway counts."""
    areas = terrain("flat", areas=(0.0, 5.0, None, None, "speed", 0.5)).surface_areas
    for speed, slip in ((0.5, 0.0), (0.7, 0.2)):
        made = Made()
        made.meter = WalkMeter(made, made, areas)  # type: ignore[arg-type]
        for _ in range(11):
            made.tick((MASS * GRAVITY, 0.0))
            made.slid = made.slid + [speed * PERIOD, 0.0, 0.0]
        assert made.figures()["slip"] == pytest.approx(10.0 * slip * PERIOD)


def test_the_onset_of_a_fall_is_looked_for_in_its_last_five_seconds() -> None:
    """Moments are those of the ticks: time, the number of the step, phase, its share, and the DCM."""
    made = Made()
    made.truth = lambda: SimpleNamespace(com_velocity=np.zeros(3))  # type: ignore[method-assign]
    made.progress = SimpleNamespace(
        swing=1, stance=0, steps_done=3, phase=GaitPhase.SINGLE, elapsed=0.2, duration=0.8
    )
    for _ in range(600):
        made.output = SimpleNamespace(
            measured_zmp=np.zeros(3), errors=SimpleNamespace(com=np.zeros(3), dcm=np.array([-0.1, 0.0]))
        )
        made.tick()
    found = made.meter.fall("tilt")
    assert found.time == pytest.approx(6.0) and found.onset == pytest.approx(1.0)
    assert (found.step, found.phase, found.share, found.cause) == (4, "single support", 0.25, "forward")
    assert found.dcm_forward == pytest.approx(0.1)
