"""Figures of a walk by hand: onset and cause of a fall, impact, effort, support; goal and travel; orders of a walk."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wbc.sim.walks.meter import WalkMeter
from wbc.walking.contact import Event, GaitPhase


class MadeUpWalk:
    """Plant and controller of a walk whose ticks, of 10 ms, are made up."""

    def __init__(self) -> None:
        truth = SimpleNamespace(
            contact_sole=np.zeros(0, dtype=int),
            contact_force=np.zeros((0, 3)),
            contact_position=np.zeros((0, 3)),
        )
        self.data = SimpleNamespace(
            site_xmat=np.tile(np.eye(3).ravel(), (2, 1)), site_xpos=np.zeros((2, 3)), qvel=np.zeros(6)
        )
        self.plant: Any = SimpleNamespace(
            control_period=0.01,
            time=0.0,
            description=SimpleNamespace(torque_limit=(10.0, 40.0)),
            robot=SimpleNamespace(na=2, joint_names=("hip", "knee"), mass=50.0),
            joint_torque=np.zeros(2),
            joint_velocity=np.zeros(2),
            data=self.data,
            sole_sites=(0, 1),
            truth=lambda: truth,
        )
        self.truth = truth
        progress = SimpleNamespace(phase=GaitPhase.DOUBLE, steps_done=2)
        self.walking: Any = SimpleNamespace(reference=None, output=None, progress=progress)
        self.meter = WalkMeter(self.plant, self.walking)

    def tick(
        self,
        dcm: tuple[float, float] | None = (0.0, 0.0),
        *,
        phase: GaitPhase = GaitPhase.SINGLE,
        stance: int = 0,
        elapsed: float = 0.0,
        step: int = 0,
        events: tuple[Event, ...] = (),
        forces: tuple[float, float] = (0.0, 0.0),
        swing: int | None = None,
        zmp: tuple[float, float] = (0.0, 0.0),
        com: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """A tick with a DCM, measured minus reference, whose step takes 0.8 s."""
        wrench = np.zeros((2, 6))
        wrench[:, 2] = forces
        measurement = SimpleNamespace(time=self.plant.time, sole_wrench=wrench, wrenches=wrench)
        pendulum = SimpleNamespace(zmp=np.array([0.1, 0.2, 0.0]))
        self.walking.reference = SimpleNamespace(events=events, pendulum=pendulum)
        self.walking.output = dcm and SimpleNamespace(
            measured_zmp=np.array([0.1 + zmp[0], 0.2 + zmp[1], 0.0]),
            errors=SimpleNamespace(com=np.array([*com, 9.0]), dcm=-np.array(dcm)),
        )
        self.walking.progress = SimpleNamespace(
            phase=phase, stance=stance, elapsed=elapsed, duration=0.8, steps_done=step, swing=swing
        )
        self.meter.tick(SimpleNamespace(measurement=measurement))  # type: ignore[arg-type]
        self.meter.after(None)  # type: ignore[arg-type]
        self.plant.time += 0.01


@pytest.mark.parametrize("stance", [0, 1])
@pytest.mark.parametrize(
    ("forward", "left", "cause"),
    [(0.08, 0.03, "forward"), (-0.08, 0.03, "backward"), (0.03, 0.08, "left"), (-0.03, -0.08, "right")],
)
def test_a_fall_begins_where_the_dcm_left_for_good_and_is_told_from_the_stance_foot(
    stance: int, forward: float, left: float, cause: str
) -> None:
    walk, yaw, roll, pitch = MadeUpWalk(), 0.7, 0.03, -0.05
    (c, s), ways = (math.cos(yaw), math.sin(yaw)), []
    walk.data.site_xmat[stance] = pin.rpy.rpyToMatrix(roll, pitch, yaw).ravel()
    for i, share in enumerate((0.2, 1.0, 0.5, 0.9, 1.2)):  # over 60 mm, back, and over for good
        f, a = share * forward, share * left
        ways.append((c * f - s * a, s * f + c * a))
        walk.tick(ways[-1], stance=stance, elapsed=0.1 * (i + 1), step=4)
    fall = walk.meter.fall("tilt")
    assert fall.reason == "tilt" and fall.cause == cause
    assert (fall.time, fall.onset) == pytest.approx((0.05, 0.03))
    assert (fall.step, fall.phase, fall.share) == (5, "single support", pytest.approx(0.5))
    outward = 0.9 * left if stance == 0 else -0.9 * left
    assert (fall.dcm_forward, fall.dcm_outward) == pytest.approx((0.9 * forward, outward))
    assert (fall.sole_roll, fall.sole_pitch) == pytest.approx((roll, pitch))
    tilts = walk.meter.figures()
    assert (tilts["sole_roll"].mean, tilts["sole_pitch"].mean) == pytest.approx((roll, -pitch))
    assert walk.meter.fall("height").cause == "dropped"


def test_an_impact_is_the_greatest_force_on_the_landing_foot_around_its_touch_down() -> None:
    walk, weight = MadeUpWalk(), 50.0 * 9.80665
    forces = np.zeros((40, 2))
    forces[:, 0] = 900.0  # the stance foot, which is of no interest
    forces[[1, 9, 27], 1] = 800.0  # too early, and too late
    forces[[6, 12, 18], 1] = 300.0, 450.0, 520.0
    for i, both in enumerate(forces.tolist()):
        walk.tick(
            events=(Event.TOUCH_DOWN,) if i == 10 else (), forces=tuple(both), swing=1 if i < 10 else None
        )
    assert walk.meter.figures()["impact"] == pytest.approx(800.0 / weight), (
        "within 50 ms before it was noticed"
    )
    forces[9, 1] = 0.0
    walk = MadeUpWalk()
    for i, both in enumerate(forces.tolist()):
        event = {3: Event.LIFT_OFF, 10: Event.TOUCH_DOWN, 25: Event.NO_TOUCH_DOWN}.get(i)
        walk.tick(events=(event,) if event else (), forces=tuple(both), swing=1 if i < 10 else None)
    figures = walk.meter.figures()
    assert figures["impact"] == pytest.approx(520.0 / weight)
    down = figures["touchdowns"]
    assert (down.early, down.on_time, down.late, down.missed) == (0, 1, 0, 1)


def test_support_is_measured_in_the_middle_of_each_step_of_what_touches_the_stance_sole() -> None:
    walk = MadeUpWalk()
    corners = np.array([[0.1, 0.02], [0.1, -0.04], [-0.2, -0.04], [-0.2, 0.02], [0.0, 0.0]])
    walk.data.site_xpos[1] = [2.0, 3.0, 0.1]
    walk.data.site_xmat[1] = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]  # a quarter turn

    def touch(sole: int, force: float, scale: float) -> None:
        x, y = scale * corners.T
        walk.truth.contact_position = np.column_stack([2.0 - y, 3.0 + x, np.full(5, 0.1)])
        walk.truth.contact_position = np.vstack(
            [walk.truth.contact_position, [9.0, 9.0, 0.0], [-9.0, 0.0, 0.0]]
        )
        walk.truth.contact_sole = np.array([sole] * 5 + [0, 1])
        walk.truth.contact_force = np.zeros((7, 3))
        walk.truth.contact_force[:, 2] = [force] * 5 + [
            500.0,
            0.9,
        ]  # the other foot, and a touch without force

    for step, scale in ((0, 1.0), (1, 0.5)):
        touch(1, 100.0, 9.0)
        walk.tick(stance=1, elapsed=0.39, step=step)
        walk.tick(stance=1, elapsed=0.5, step=step, phase=GaitPhase.DOUBLE)
        touch(1, 100.0, scale)
        walk.tick(stance=1, elapsed=0.41, step=step)
        touch(1, 100.0, 9.0)
        walk.tick(stance=1, elapsed=0.5, step=step)
    areas = np.array([0.3 * 0.06, 0.15 * 0.03])
    assert walk.meter.figures()["contact_area"].mean == pytest.approx(areas.mean())
    assert walk.meter.figures()["contact_area"].std == pytest.approx(areas.std())


# Travel, goal and orders
