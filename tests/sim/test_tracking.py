"""Tracking a clip in the simulator: the result is what joints, mass and feet do, and a fall is off the clip."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

from wbc.core.estimation.falls import FallReason
from wbc.motion import MotionClip
from wbc.robots import load
from wbc.sim.balance.tracking import TrackSpec, TrackTrial
from wbc.sim.trial.falls import FallSettings
from wbc.sim.trial.trial import TrialHook

ROBOT = load("g1").robot()


class Notes(TrialHook):
    """Frames of the clip, and true configurations, centres of mass and places of the soles after each tick."""

    def __init__(self) -> None:
        self.given: list[int] = []
        self.q: list[np.ndarray] = []
        self.com: list[np.ndarray] = []
        self.soles: list[np.ndarray] = []

    def after(self, trial: TrackTrial) -> None:
        truth = trial.plant.truth()
        self.given.append(trial.given)
        self.q.append(truth.q)
        self.com.append(truth.com)
        self.soles.append(trial.plant.data.site_xpos[list(trial.plant.sole_sites)].copy())


def wave(seconds: float) -> MotionClip:
    """A clip in which an arm swings and the knees give, 0.2 m over the ground."""
    t = np.arange(0.0, seconds + 1e-9, 0.005)
    q = np.tile(ROBOT.half_sitting, (t.size, 1))
    q[:, 2] += 0.2
    q[:, 7 + ROBOT.joint_names.index("left_elbow_joint")] -= 0.4 * np.sin(np.pi * t / seconds) ** 2
    return MotionClip.of(ROBOT, q, 200.0, "wave")


def test_the_result_is_what_joints_and_centre_of_mass_did_against_the_clip() -> None:
    clip, notes = wave(0.2), Notes()
    trial = TrackTrial(clip, TrackSpec(robot="g1", noise="none", after=0.06))
    result = trial.run([notes])
    given = clip.configurations(ROBOT)[notes.given]
    off = np.degrees(np.array(notes.q)[:, 7:] - given[:, 7:])
    data = ROBOT.model.createData()
    com = np.array([pin.centerOfMass(ROBOT.model, data, q).copy() for q in given])
    assert (result.seconds, result.clip_seconds) == pytest.approx((0.26, 0.2)) and len(off) == 52
    assert set(np.diff(notes.given)) == {0, 1} and notes.given[-1] == 40
    assert np.degrees(result.joint_rms) == pytest.approx(np.sqrt((off**2).mean()), rel=1e-6)
    each = np.sqrt((off**2).mean(axis=0))
    assert result.worst_joint == ROBOT.joint_names[each.argmax()] == "left_elbow_joint"
    assert np.degrees(result.worst_joint_rms) == pytest.approx(each.max(), rel=1e-6)
    assert np.degrees(result.joint_error_max) == pytest.approx(abs(off).max(), rel=1e-6)
    away = (np.array(notes.com) - com)[:, :2]
    assert result.com_rms == pytest.approx(np.sqrt((away**2).sum(axis=1).mean()), rel=1e-3)
    soles = np.array(notes.soles)
    slid = np.linalg.norm((soles - soles[0])[:, :, :2], axis=2).max()
    assert result.foot_slide == pytest.approx(slid, rel=1e-6)
    assert result.completed and result.fall is None and result.failures == result.landings == 0
    assert (result.motion, result.robot, result.mode) == ("wave", "g1", trial.control.settings.mode)


def com_height(q: np.ndarray) -> float:
    return float(pin.centerOfMass(ROBOT.model, ROBOT.model.createData(), q)[2])


def test_a_robot_has_fallen_where_the_clip_does_not_have_it() -> None:
    trial = TrackTrial(wave(0.02), TrackSpec(robot="g1", noise="none"))
    assert trial.true_fall() is None
    limits, q = FallSettings(), trial.plant.truth().q
    scale = trial.plant.robot.length_scale
    for drop, tilt, fallen in (
        (0.97, 0.97, None),
        (1.03, 0.0, FallReason.HEIGHT),
        (0.0, 1.03, FallReason.TILT),
    ):
        low = q.copy()
        low[3:7] = [0.0, math.sin(0.5 * tilt * limits.tilt), 0.0, math.cos(0.5 * tilt * limits.tilt)]
        low[2] += com_height(q) - com_height(low) - drop * scale * limits.drop
        trial.plant.reset(low)
        assert trial.true_fall() is fallen
    trial.source.tick = 10**6
    assert trial.given == 4
