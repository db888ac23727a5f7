"""The trunk that leans where the feet can do no more."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.base.numbers import Array
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.tasks.stabilizer.lean import DEAD_BAND, UPRIGHT, Lean, LeanSettings
from wbc.tasks.stabilizer.pendulum import Pendulum

MASS, HEIGHT, DT = 40.0, 0.8, 0.005


def lean(**settings: float) -> Lean:
    return Lean(MASS, HEIGHT, LeanSettings(**settings))


def test_the_reaction_gives_the_moment_that_is_missing() -> None:
    motion = lean(inertia=0.05).update((4.0, -8.0), DT)
    inertia = 0.05 * MASS * HEIGHT**2
    np.testing.assert_allclose(motion.acceleration, (-4.0 / inertia, 8.0 / inertia, 0.0), rtol=1e-12)
    np.testing.assert_allclose(motion.velocity, DT * motion.acceleration, rtol=1e-12)
    np.testing.assert_allclose(pin.log3(motion.rotation), DT * motion.velocity, rtol=0.0, atol=1e-12)


def test_a_lean_moves_the_dcm_by_its_share_of_the_height() -> None:
    """A pendulum with a wheel: from rest over its ZMP, a quick lean displaces the CoM by −I φ / (m h)."""
    trunk, dt = lean(stiffness=1e-9, limit=0.3, braking=2e4), 1e-5
    com = speed = 0.0
    omega2 = 9.81 / HEIGHT
    inertia = trunk.settings.inertia * MASS * HEIGHT**2
    while trunk.angle[1] > -0.3 + 1e-5:
        acceleration = trunk.update((0.0, 2e4), dt).acceleration[1]
        # What turns the trunk about y by the moment I φ̈ pushes the CoM the other way with the force I φ̈ / h.
        speed += dt * (omega2 * com + inertia * acceleration / (MASS * HEIGHT))
        com += dt * speed
    expected = inertia * trunk.angle[1] / (MASS * HEIGHT)
    assert com == pytest.approx(expected, rel=0.02)
    assert com == pytest.approx(-0.06 * HEIGHT * 0.3, rel=0.02)


def test_it_comes_back_upright_and_rests() -> None:
    trunk = lean()
    for _ in range(40):
        trunk.update((10.0, -5.0), DT)
    assert min(map(abs, trunk.angle)) > 0.03
    ticks = 0
    while trunk.update((0.0, 0.0), DT) is not UPRIGHT:
        ticks += 1
    assert ticks * DT < 5.0
    assert trunk.angle == trunk.speed == (0.0, 0.0)
    np.testing.assert_array_equal(UPRIGHT.rotation, np.eye(3))


def test_a_trunk_that_is_let_go_swings_back_as_its_spring_and_damper_say() -> None:
    """φ(t) = e^(−ζωt) (a cos ω_d t + b sin ω_d t) with ω = √k and ω_d = ω √(1 − ζ²)."""
    stiffness, damping, dt = 30.0, 0.4, 1e-4
    trunk = lean(stiffness=stiffness, damping=damping)
    for _ in range(500):
        trunk.update((40.0, -25.0), dt)
    angle, speed = np.array(trunk.angle), np.array(trunk.speed)
    decay = damping * np.sqrt(stiffness)
    rate = np.sqrt(stiffness - decay**2)
    for tick in range(1, 5001):
        trunk.update((0.0, 0.0), dt)
        if tick % 1000 == 0:
            t = tick * dt
            swing = angle * np.cos(rate * t) + (speed + decay * angle) / rate * np.sin(rate * t)
            np.testing.assert_allclose(trunk.angle, np.exp(-decay * t) * swing, atol=3e-3 * abs(angle).max())


def test_small_moments_are_left_alone() -> None:
    trunk = lean()
    dead_band = DEAD_BAND * MASS * 9.81 * HEIGHT
    assert trunk.update((0.9 * dead_band, 0.0), DT) is UPRIGHT
    assert trunk.update((0.0, 1.1 * dead_band), DT) is not UPRIGHT


@pytest.mark.parametrize("dt", [0.001, 0.005, 0.01])
def test_it_stays_within_its_limit_and_can_always_brake(dt: float) -> None:
    rng = np.random.default_rng(0)
    trunk = lean(limit=0.4, braking=50.0)
    highest = 0.0
    for _ in range(20):
        missing = tuple(rng.uniform(-200.0, 200.0, 2))
        for _ in range(int(rng.integers(1, int(0.6 / dt)))):
            trunk.update(missing, dt)
            for angle, speed in zip(trunk.angle, trunk.speed, strict=True):
                highest = max(highest, abs(angle))
                assert abs(angle) <= 0.4 + 1e-12
                if angle * speed > 0.0:
                    assert speed**2 / (2.0 * 50.0) <= 0.4 - abs(angle) + abs(speed) * dt
    assert highest > 0.35


@pytest.mark.parametrize("robot", ["hrp4_class", "talos"])
def test_the_trunks_of_robots_have_that_inertia(robot: str) -> None:
    """The QP turns an acceleration of the trunk into a moment as the settings say: same sign, same size."""
    walking = WalkTrial(WalkSpec(robot=robot, foot="flat", terrain="flat"), visuals=False).control
    body, controller = walking.controller.robot, walking.controller
    tasks = [controller.task(name) for name in ("pelvis", "torso")]

    def solved() -> Array:
        """Accelerations of a tick in which the walk has handed out the pendulum that is there."""
        com, pendulum = controller.task("com"), Pendulum.at_rest(np.array(body.com))
        com.follow(pendulum.com, pendulum.com_velocity, pendulum.com_acceleration)
        for contact in controller.contacts:
            contact.hold()
        return controller.solve().accelerations.copy()

    before = solved()
    for axis in (0, 1):
        push = np.eye(3)[axis]
        for task in tasks:
            task.follow(np.array(task.target), acceleration=push)
        change = solved() - before
        pin.ccrba(body.model, body.data, body.q, body.v)
        moment = (body.data.Ag @ change)[3 + axis]
        share = moment / (body.mass * body.com[2] ** 2)
        assert 0.06 <= share <= 0.12
