"""A stepping gait of a robot whose feet are placed by hand."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from point_mass import SCALE

from wbc.core.robot import GRAVITY
from wbc.walking.contact import GaitPhase
from wbc.walking.stepping.felt import BodyState
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.law import Divergent
from wbc.walking.stepping.settings import SteppingConstants, SteppingSettings

DT = 0.004
CONSTANTS, SETTINGS = SteppingConstants().in_si(SCALE), SteppingSettings().in_si(SCALE)
OMEGA = math.sqrt(GRAVITY / SCALE.height)
POINT = (0.0, 0.0, 0.0)


def frame_of(place: tuple[float, ...]) -> pin.SE3:
    """Return the frame of a sole at x, y, z (m), with yaw, pitch and roll (rad)."""
    x, y, z, yaw, pitch, roll = place
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array([x, y, z]))


def gait_on(
    frames: tuple[pin.SE3, pin.SE3],
    com: tuple[float, float, float] = (0.0, 0.0, SCALE.height),
    speed: tuple[float, float, float] = POINT,
    wrenches: list[list[float]] | None = None,
    heading: float = 0.0,
) -> SteppingWalk:
    """Return the gait of a robot on placed feet, half of the weight on each where no wrenches are given."""
    gait = SteppingWalk(SteppingSettings(), SCALE, heading, DT)
    half = [0.0, 0.0, 0.5 * SCALE.weight, 0.0, 0.0, 0.0]
    left, right = gait.felt.frames = frames
    gait.felt.state = BodyState(
        com,
        speed,
        POINT,
        (left.translation.tolist(), right.translation.tolist()),
        (left.rotation.tolist(), right.rotation.tolist()),
        [half, half] if wrenches is None else wrenches,
        heading,
        SCALE.mass,
    )
    return gait


def step_on(gait: SteppingWalk, stance: int) -> None:
    """Begin a step of 0.4 s on a foot that presses at the origin, with the DCM there."""
    gait.felt._begin(GaitPhase.SINGLE, stance)
    gait.felt._contact, gait.felt.dcm = POINT, Divergent(0.0, 0.0, OMEGA)
    gait.step.begin()
    gait.step.duration = 0.4


LEVEL = frame_of((0.0, 0.11, 0.0, 0.0, 0.0, 0.0)), frame_of((0.0, -0.11, 0.0, 0.0, 0.0, 0.0))
