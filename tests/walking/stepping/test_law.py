"""Law of the stepping walk against the pendulum in closed form, and against the impacts of a whole robot."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pendulum import com_after
from properties import examples
from task_factory import ROBOTS, make_robot, random_state

from wbc.core.robot import GRAVITY, Robot
from wbc.walking.stepping.law import (
    NEAR,
    Divergent,
    Orbit,
    divergent_component,
    landing_place,
    remaining_time,
    takes_over,
)

HEIGHT, TIME, WIDTH = 0.6, 0.36, 0.22
OMEGA = math.sqrt(GRAVITY / HEIGHT)
GROWTH = math.exp(OMEGA * TIME)

offsets = st.floats(-0.05, 0.05)
velocities = st.tuples(st.floats(-0.4, 0.6), st.floats(-0.15, 0.15))


class Landing(NamedTuple):
    """End of a step: the foot that lands, its side (1 left, −1 right), the DCM there, and the time of the step."""

    foot: np.ndarray
    side: float
    dcm: np.ndarray
    time: float


def walk(
    steps: int,
    velocity: tuple[float, float],
    error: tuple[float, float] = (0.0, 0.0),
    *,
    timed: bool = True,
    stretch: float = math.inf,
) -> list[Landing]:
    """Steps of a pendulum on point feet that keeps nothing but the law, first with the left foot.

    Args:
        steps: Number of steps.
        velocity: Forward and left, m/s.
        error: Offset of the DCM from its orbit at the start of the first step, m.
        timed: False for steps of the nominal time.
        stretch: Offset ahead, over that of the orbit, that ends a step, m.
    """
    landings = []
    foot, side = np.zeros(2), 1.0  # stance foot, side of the foot in the air
    orbit = Orbit.of(velocity, side, WIDTH, TIME, TIME, OMEGA)
    dcm = np.array([orbit.ahead, side * orbit.outwards / GROWTH]) + error
    com = dcm - np.array([0.01, 0.002])  # with the velocity that makes up the rest of the DCM
    speed = (dcm - com) * OMEGA
    for _ in range(steps):
        orbit = Orbit.of(velocity, side, WIDTH, TIME, TIME, OMEGA)
        ahead, aside = dcm - foot
        time = remaining_time(ahead, side * aside, orbit, OMEGA, 0.005, stretch) if timed else TIME
        place = landing_place(
            (foot[0], foot[1]), Divergent(*dcm, OMEGA), time, (orbit.ahead, -side * orbit.inwards)
        )
        com, speed = com_after(com, speed, foot, OMEGA, time)
        foot, dcm = np.array(place), com + speed / OMEGA
        landings.append(Landing(foot, side, dcm, time))
        side = -side
    return landings


def offset(landing: Landing) -> tuple[float, float]:
    """Offset of the DCM from the foot that has landed: ahead, and towards the other foot, m."""
    x, y = landing.dcm - landing.foot
    return float(x), float(-landing.side * y)


@examples(100)
@given(velocities, offsets, offsets)
def test_an_error_of_the_dcm_is_gone_after_one_step_of_the_nominal_time(
    velocity: tuple[float, float], ahead: float, aside: float
) -> None:
    for landing in walk(3, velocity, (ahead, aside), timed=False):
        orbit = Orbit.of(velocity, landing.side, WIDTH, TIME, TIME, OMEGA)
        assert offset(landing) == pytest.approx((orbit.ahead, orbit.inwards), abs=1e-12)


@examples(100)
@given(velocities, offsets, st.floats(-0.04, 0.04))
def test_a_lateral_error_changes_the_time_of_one_step_and_no_width(
    velocity: tuple[float, float], ahead: float, aside: float
) -> None:
    calm, hit = walk(4, velocity), walk(4, velocity, (ahead, aside))
    growing = aside > 1e-6
    assert hit[0].time < TIME if growing else hit[0].time >= TIME - 1e-3
    for a, b in zip(calm, hit, strict=True):
        assert b.foot[1] == pytest.approx(a.foot[1], abs=1e-9)
    assert [landing.time for landing in hit[1:]] == pytest.approx([TIME] * 3, abs=1e-9)


def test_the_lateral_orbit_is_periodic_with_its_amplitude() -> None:
    landings = walk(40, (0.3, 0.0))
    for before, after in zip(landings, landings[1:], strict=False):
        assert abs(after.foot[1] - before.foot[1]) == pytest.approx(WIDTH, abs=1e-6)
        assert after.time == pytest.approx(TIME, abs=1e-6)
    for landing in landings:
        assert offset(landing)[1] == pytest.approx(WIDTH / (1.0 + GROWTH), abs=1e-6)


@pytest.mark.parametrize("velocity", [(0.4, 0.0), (-0.2, 0.0), (0.0, 0.15), (0.0, -0.15), (0.3, 0.1)])
def test_steps_reach_the_mean_velocity_that_is_asked_for(velocity: tuple[float, float]) -> None:
    """Over pairs of steps: sideways one foot opens and the other one closes."""
    landings = walk(21, velocity, (0.02, -0.02))
    time = sum(landing.time for landing in landings[1:])
    mean = (landings[-1].foot - landings[0].foot) / time
    np.testing.assert_allclose(mean, velocity, atol=1e-9)
    for before, after in zip(landings, landings[1:], strict=False):
        assert after.side * (after.foot[1] - before.foot[1]) > 0.0, "feet cross"


def test_a_velocity_to_the_side_that_feet_cannot_give_crosses_no_feet() -> None:
    for side in (1.0, -1.0):
        for speed in (-5.0, 5.0):
            orbit = Orbit.of((0.0, speed), side, WIDTH, TIME, TIME, OMEGA)
            assert orbit.inwards > 0.0 and orbit.outwards > 0.0
            assert 0.0 < orbit.outwards + orbit.inwards < 2.0 * WIDTH


@examples(100)
@given(velocities, st.floats(-0.1, 0.1), st.floats(-0.033, 0.03), st.floats(0.01, 0.1))
def test_no_step_is_longer_than_its_orbit_and_a_stretch_and_the_next_one_starts_on_its_orbit(
    velocity: tuple[float, float], ahead: float, aside: float, stretch: float
) -> None:
    """A DCM that starts near the stance foot is late aside; what it is off ahead must not grow as long."""
    landings = walk(4, velocity, (ahead, aside), stretch=stretch)
    drift = velocity[0] * TIME / (GROWTH - 1.0)
    assert abs(landings[0].foot[0] + drift) <= GROWTH * abs(drift) + stretch + 1e-9 or landings[0].time == 0.0
    free = walk(1, velocity, (ahead, aside))[0]
    growth = (GROWTH * abs(drift) + stretch) / max(abs(drift + ahead), NEAR)
    stretched = math.log(max(growth, 1.0)) / OMEGA
    assert landings[0].time == pytest.approx(min(free.time, stretched), abs=1e-9)
    for landing in landings:
        orbit = Orbit.of(velocity, landing.side, WIDTH, TIME, TIME, OMEGA)
        assert offset(landing) == pytest.approx((orbit.ahead, orbit.inwards), abs=1e-9)
    assert [landing.time for landing in landings[1:]] == pytest.approx([TIME] * 3, abs=1e-9)


def test_a_dcm_over_the_stance_foot_waits_and_one_beyond_it_lands_at_once() -> None:
    orbit, over, stretch = Orbit.of((0.2, 0.0), 1.0, WIDTH, TIME, TIME, OMEGA), 0.005, 0.05
    for aside in (0.0, -0.0049, NEAR):
        assert remaining_time(orbit.ahead, aside, orbit, OMEGA, over, stretch) > TIME
        assert remaining_time(0.0, aside, orbit, OMEGA, over, stretch) > 3.0 * TIME
    assert remaining_time(0.0, -0.0051, orbit, OMEGA, over, stretch) == 0.0
    assert remaining_time(0.0, 1.001 * orbit.outwards, orbit, OMEGA, over, stretch) == 0.0
    assert remaining_time(-orbit.forward - 0.051, 0.01, orbit, OMEGA, over, stretch) == 0.0
    assert 0.0 < remaining_time(0.0, 0.999 * orbit.outwards, orbit, OMEGA, over, stretch) < 1e-3


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
    for ahead, on in ((0.16, 0.3), (0.06, 0.1)):
        assert carries(ahead, 1.3 * near, 0.15, on=on), "it runs away ahead"
    assert not carries(-0.1, 1.3 * near, 0.15, on=0.1), "behind, it comes to the foot"


@examples(50)
@given(st.floats(-0.2, 0.2), st.floats(0.0, 0.2), st.floats(-0.1, 0.2), st.floats(-0.3, 0.3))
def test_taking_over_is_the_same_in_a_mirrored_direction(
    ahead: float, inwards: float, out: float, on: float
) -> None:
    assert carries(ahead, inwards, out, on) == carries(-ahead, inwards, out, -on, speed=-0.2)
