"""Law of the stepping walk against the pendulum in closed form, and against the impacts of a whole robot."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples
from task_factory import ROBOTS, make_robot, random_state

from wbc.core.robot import GRAVITY, Robot
from wbc.walking.stepping.law import (
    Divergent,
    Orbit,
    divergent_component,
    takes_over,
)

HEIGHT, TIME, WIDTH = 0.6, 0.36, 0.22
OMEGA = math.sqrt(GRAVITY / HEIGHT)
GROWTH = math.exp(OMEGA * TIME)


def test_a_velocity_to_the_side_that_feet_cannot_give_crosses_no_feet() -> None:
    for side in (1.0, -1.0):
        for speed in (-5.0, 5.0):
            orbit = Orbit.of((0.0, speed), side, WIDTH, TIME, TIME, OMEGA)
            assert orbit.inwards > 0.0 and orbit.closing > 0.0
            assert orbit.inwards + orbit.closing == pytest.approx(2.0 * WIDTH / (1.0 + GROWTH))


@examples(50)
@given(st.tuples(*[st.floats(-1.0, 1.0)] * 5))
def test_the_dcm_of_a_point_mass_at_its_height_is_that_of_its_velocity(values: tuple[float, ...]) -> None:
    x, y, u, v, z = values
    contact, com, mass = (0.4, -0.2, z), (x, y, z + HEIGHT), 33.0
    dcm = divergent_component(com, (u, v, 0.0), (0.0, 0.0, 0.0), contact, mass, 0.1)
    assert dcm.omega == pytest.approx(OMEGA)
    assert (dcm.x, dcm.y) == pytest.approx((x + u / OMEGA, y + v / OMEGA), abs=1e-12)
    # A velocity along the line to the contact has no angular momentum about it, and makes nothing fall.
    along = tuple(u * (a - b) for a, b in zip(com, contact, strict=True))
    still = divergent_component(com, along, (0.0, 0.0, 0.0), contact, mass, 0.1)
    assert (still.x, still.y) == pytest.approx((x, y), abs=1e-12)


def test_a_trunk_that_turns_forward_falls_forward() -> None:
    """As in the law's docstring, ξ_x grows by L_y and ξ_y by −L_x."""
    com, still, mass = (0.0, 0.0, HEIGHT), (0.0, 0.0, 0.0), 33.0
    pitched = divergent_component(com, still, (0.0, 3.0, 0.0), still, mass, 0.1)
    rolled = divergent_component(com, still, (3.0, 0.0, 5.0), still, mass, 0.1)
    assert (pitched.x, pitched.y) == pytest.approx((3.0 / (mass * HEIGHT * OMEGA), 0.0))
    assert (rolled.x, rolled.y) == pytest.approx((0.0, -3.0 / (mass * HEIGHT * OMEGA)))


def test_a_com_that_has_sunk_counts_with_the_least_height() -> None:
    sunk = divergent_component((0.0, 0.0, 0.1), (0.3, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, 0.4)
    assert sunk.omega == pytest.approx(math.sqrt(GRAVITY / 0.4))


def dcm_about(
    robot: Robot, q: np.ndarray, v: np.ndarray, contact: np.ndarray
) -> tuple[Divergent, np.ndarray]:
    """Return the DCM by the angular momentum about a contact, and the one by the velocity of the CoM."""
    robot.update(q, v)
    com, speed, spin = robot.com, robot.com_velocity, robot.data.hg.angular
    dcm = divergent_component(com.tolist(), speed.tolist(), spin.tolist(), contact.tolist(), robot.mass, 0.05)
    return dcm, com[:2] + speed[:2] / dcm.omega


@pytest.mark.parametrize("name", ROBOTS)
def test_an_impact_leaves_the_dcm_about_its_own_point_as_it_is(name: str) -> None:
    """Any impulse at a point of the foot that lands: c + ċ/ω jumps, the DCM by the angular momentum does not."""
    robot, rng = make_robot(name), np.random.default_rng(11)
    sole = robot.frame_id(robot.soles[0].frame)
    jumps = []
    for _ in range(20):
        q, v = random_state(robot, rng)
        q[3:7] = [0.0, 0.0, 0.0, 1.0]
        robot.update(q, v)
        frame = robot.placement(robot.soles[0].frame)
        contact = frame.act(np.array([*rng.uniform(-0.05, 0.05, 2), 0.0]))
        jacobian = pin.getFrameJacobian(robot.model, robot.data, sole, pin.LOCAL_WORLD_ALIGNED)
        linear = jacobian[:3] - pin.skew(contact - frame.translation) @ jacobian[3:]
        impulse = 0.3 * robot.mass * rng.normal(size=3)
        hit = v + np.linalg.solve(np.array(robot.mass_matrix), linear.T @ impulse)
        before, plain = dcm_about(robot, q, v, contact)
        after, plain_after = dcm_about(robot, q, hit, contact)
        np.testing.assert_allclose(after, before, atol=1e-9)
        jumps.append(np.linalg.norm(plain_after - plain))
    assert np.median(jumps) > 0.02


def carries(ahead: float, inwards: float, out: float, on: float = 0.0, speed: float = 0.2) -> bool:
    """Return True if a foot in contact takes over, by offsets of the DCM from it and from the foot that stands."""
    orbit = Orbit.of((speed, 0.0), 1.0, WIDTH, TIME, TIME, OMEGA)
    return takes_over((ahead, inwards), (on, out), orbit, 0.054, 0.2, 1.5)


def test_a_foot_in_contact_carries_once_waiting_no_longer_helps() -> None:
    orbit = Orbit.of((0.2, 0.0), 1.0, WIDTH, TIME, TIME, OMEGA)
    near = 1.5 * orbit.inwards
    assert carries(orbit.ahead, 0.99 * near, 0.15), "the next step is long enough"
    assert not carries(orbit.ahead, 1.3 * near, 0.15), "the DCM is on its way to the foot"
    assert carries(orbit.ahead, 1.3 * near, -0.01), "it moves away from it, over the outer edge"
    for ahead, on in ((0.16, 0.3), (0.1, 0.1)):
        assert carries(ahead, 1.3 * near, 0.15, on=on), "it runs away ahead"
    assert not carries(0.06, 1.3 * near, 0.15, on=0.1), "it runs away ahead, but aside is the greater need"
    assert not carries(0.08, 0.42, 0.29, on=0.1), "a foot that was thrown aside: both feet hold the DCM"
    assert not carries(-0.1, 1.3 * near, 0.15, on=0.1), "behind, it comes to the foot"


@examples(50)
@given(st.floats(-0.2, 0.2), st.floats(0.0, 0.2), st.floats(-0.1, 0.2), st.floats(-0.3, 0.3))
def test_taking_over_is_the_same_in_a_mirrored_direction(
    ahead: float, inwards: float, out: float, on: float
) -> None:
    assert carries(ahead, inwards, out, on) == carries(-ahead, inwards, out, -on, speed=-0.2)
