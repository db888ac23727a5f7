"""Contact of the foot in the air in closed form: when it meets the ground, has lost it, is to carry, or is pushed."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from placed_gait import LEVEL
from point_mass import SCALE

from wbc.core.robot import GRAVITY, SIDES
from wbc.walking.contact import GaitPhase
from wbc.walking.ground import GroundEstimate
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.stepping.felt import BodyState, GaitState
from wbc.walking.stepping.law import Divergent, Orbit, StanceAxes, takes_over
from wbc.walking.stepping.settings import GaitValues, SteppingConstants, SteppingSettings
from wbc.walking.stepping.touch import SwingTouch

DT = 0.004
LAW, SETTINGS = SteppingConstants().in_si(SCALE), SteppingSettings().in_si(SCALE)
OMEGA = math.sqrt(GRAVITY / SCALE.height)
POINT = (0.0, 0.0, 0.0)
STILL = Orbit.of((0.0, 0.0), 1.0, SETTINGS.width, SETTINGS.step_time, SETTINGS.step_time, OMEGA)


def loaded(*forces: float) -> list[list[float]]:
    return [[0.0, 0.0, force, 0.0, 0.0, 0.0] for force in forces]


def touching(
    stance: int, swing_load: float, stance_load: float = 300.0, **state: Any
) -> tuple[SwingTouch, Any]:
    """Contact of a swing foot with forces on both soles, N, in a world where it is level with the one that stands."""
    loads = [swing_load, stance_load] if stance == 1 else [stance_load, swing_load]
    places = ((0.0, 0.11, 0.0), (0.0, -0.11, 0.0))
    usual = {"wrenches": loaded(*loads), "places": places, "speeds": (POINT, POINT), "velocity": POINT}
    felt = SimpleNamespace(
        state=SimpleNamespace(**(usual | state)),
        stance=stance,
        swing=1 - stance,
        elapsed=0.3,
        contact=places[stance],
        dcm=Divergent(0.0, 0.0, OMEGA),
    )
    felt.carrying_point = lambda side: felt.state.places[side]
    felt.centre_of_pressure = lambda side: tuple(np.add(felt.state.places[side], (0.03, 0.0, 0.0)))
    touch = SwingTouch(GaitValues(SETTINGS, LAW, SCALE, DT), felt, GroundEstimate(0.5, 0.25))  # type: ignore[arg-type]
    return touch, felt


def carries(
    touch: SwingTouch, stance: int, yaw: float = 0.0, fast_share: float = 0.0, *, late: bool = False
) -> bool:
    """Return True if the foot in contact is to carry, in steps in place that have a heading, rad."""
    axes = StanceAxes(1.0 if stance == 1 else -1.0, (math.cos(yaw), math.sin(yaw)), POINT)
    touch.track(met=True, at_edge=False)
    return touch.is_to_carry(axes, STILL, LAW.touch.patience, fast_share, late=late)


@pytest.mark.parametrize("stance", [0, 1])
def test_a_foot_meets_the_ground_where_it_is_low_bears_a_force_and_half_of_its_step_is_over(
    stance: int,
) -> None:
    """Lower than a share of the height of the swing over the foot that stands, or over the ground if that is higher."""
    for share, meets in ((0.99, False), (1.01, True)):
        touch, _ = touching(stance, share * LAW.touch.met)
        assert touch.bears(0.4) == meets
    for part, meets in ((0.99, False), (1.01, True)):
        touch, felt = touching(stance, 2.0 * LAW.touch.met)
        felt.elapsed = part * LAW.touch.early * 0.4
        assert touch.bears(0.4) == meets
    low = LAW.touch.low * SETTINGS.swing_height
    for stands, ground, height, meets in (
        (0.0, 0.0, 0.99 * low, True),
        (0.0, 0.0, 1.01 * low, False),
        (0.05, 0.0, 0.05 + 0.99 * low, True),
        (0.05, 0.02, 0.05 + 1.01 * low, False),
        (0.0, 0.03, 0.03 + 0.99 * low, True),
        (-0.1, -0.2, -0.1 + 1.01 * low, False),
    ):
        places = [(0.0, 0.11, stands), (0.0, -0.11, stands)]
        places[1 - stance] = (*places[1 - stance][:2], height)
        touch, _ = touching(stance, 2.0 * LAW.touch.met, places=tuple(places))
        touch._ground.height = ground
        assert touch.bears(0.4) == meets
    touch, felt = touching(stance, 2.0 * LAW.touch.met)
    for part, pushed in ((0.99, True), (1.01, False)):
        felt.elapsed = 0.3 - part * LAW.touch.pushed_time
        touch.push()
        felt.elapsed = 0.3
        assert touch.bears(0.4) != pushed and touch.pushed == pushed
    touch.push()
    touch.begin()
    assert not touch.pushed, "a new step has not been pushed"


@pytest.mark.parametrize("stance", [0, 1])
def test_a_foot_has_lost_the_ground_after_a_while_without_a_force_if_the_other_one_holds(stance: int) -> None:
    for load, since, held, loses in (
        (0.99 * LAW.touch.lost, 1.01 * LAW.touch.lost_time, 1.01 * LAW.touch.held, True),
        (1.01 * LAW.touch.lost, 1.01 * LAW.touch.lost_time, 1.01 * LAW.touch.held, False),
        (0.99 * LAW.touch.lost, 0.99 * LAW.touch.lost_time, 1.01 * LAW.touch.held, False),
        (0.99 * LAW.touch.lost, 1.01 * LAW.touch.lost_time, 0.99 * LAW.touch.held, False),
    ):
        touch, _ = touching(stance, load, held)
        assert touch.loses(since) == loses
    touch, _ = touching(stance, 300.0)
    touch.push()
    assert touch.loses(0.0), "it was pushed"


@pytest.mark.parametrize("stance", [0, 1])
def test_a_foot_in_contact_carries_where_the_other_one_no_longer_does_or_it_has_waited_too_long(
    stance: int,
) -> None:
    far = Divergent(0.0, 0.0, OMEGA)  # half way: waiting would help
    touch, felt = touching(stance, 300.0)
    felt.dcm = far
    touch.track(met=False, at_edge=True)
    assert not carries(touch, stance) and carries(touch, stance, late=True)
    for swing, stands, unloads in (
        (1.01 * LAW.touch.held, 0.99 * LAW.touch.held, True),
        (0.99 * LAW.touch.held, 0.5 * LAW.touch.held, False),
        (1.5 * LAW.touch.held, 1.01 * LAW.touch.held, False),
    ):
        touch, felt = touching(stance, swing, stands)
        felt.dcm = far
        touch.track(met=False, at_edge=True)
        ticks = math.ceil(0.5 * LAW.touch.lost_time / DT + 1e-9)
        for tick in range(1, ticks + 2):
            assert carries(touch, stance, fast_share=0.5) == (
                unloads and tick * DT > 0.5 * LAW.touch.lost_time
            )
        assert carries(touch, stance) == unloads, "at once in a slow walk"


@pytest.mark.parametrize("stance", [0, 1])
@pytest.mark.parametrize("yaw", [0.0, 1.1])
def test_a_foot_in_contact_carries_where_waiting_makes_it_no_more_viable(stance: int, yaw: float) -> None:
    """By the offsets of ξ ahead and inwards from the place where it will carry, and from the contact of the other."""
    side, c, s = (1.0 if stance == 1 else -1.0), math.cos(yaw), math.sin(yaw)
    rng = np.random.default_rng(4)
    found = set()
    for _ in range(60):
        there, here = rng.uniform((-0.2, -0.3), (0.2, 0.3)), rng.uniform((-0.1, -0.1), (0.1, 0.3))
        touch, felt = touching(stance, 300.0)

        def world(ahead: float, outwards: float) -> tuple[float, float]:
            left = side * outwards
            return c * ahead - s * left, s * ahead + c * left

        # ξ at the origin: the foot is `there` behind it and outwards, the other one's contact `here` behind it.
        foot, contact = world(-there[0], there[1]), world(-here[0], -here[1])
        places = [(0.0, 0.0, 0.0)] * 2
        places[1 - stance] = (*foot, 0.0)
        felt.state.places, felt.contact = tuple(places), (*contact, 0.0)
        touch.track(met=False, at_edge=True)
        expected = takes_over(
            tuple(there), tuple(here), STILL, LAW.time.stretch, LAW.touch.wait, LAW.touch.patience
        )
        assert carries(touch, stance, yaw) == expected
        found.add(expected)
    assert found == {True, False}


def test_where_a_foot_in_contact_carries_is_low_passed_from_its_carrying_point_on() -> None:
    touch, felt = touching(1, 300.0)
    touch.track(met=False, at_edge=True)
    assert touch._carrying == felt.state.places[0]
    for tick in range(1, 30):
        touch.track(met=True, at_edge=True)
        share = 1.0 - math.exp(-tick * DT / LAW.area.cop_lag)
        np.testing.assert_allclose(touch._carrying, (0.03 * share, 0.11, 0.0), atol=1e-12)


@pytest.mark.parametrize("side", [0, 1])
def test_a_foot_is_pushed_that_is_faster_than_any_step_without_hurry_in_the_world_and_past_the_com(
    side: int,
) -> None:
    """From its bound and twice the speed of the steps on, once in a step, without urgency and not cut short."""
    for speed, com, urgency, paced, pushed in (
        (1.02, 0.0, 0.0, 1.0, True),
        (0.98, 0.0, 0.0, 1.0, False),
        (1.5, 0.48, 0.0, 1.0, True),
        (1.5, 0.52, 0.0, 1.0, False),
        (1.5, 0.0, 0.49, 1.0, True),
        (1.5, 0.0, 0.51, 1.0, False),
        (1.5, 0.0, 0.0, 0.81, True),
        (1.5, 0.0, 0.0, 0.79, False),
    ):
        bound = LAW.touch.pushed_speed + 2.0 * 0.2
        speeds = [POINT, POINT]
        speeds[side] = (0.6 * speed * bound, -0.8 * speed * bound, 0.0)
        velocity = (0.6 * com * bound, -0.8 * com * bound, 0.0)
        touch, _ = touching(1 - side, 0.0, speeds=tuple(speeds), velocity=velocity)
        touch.notice_push(urgency, paced, 0.2)
        assert touch.pushed == pushed
    touch, felt = touching(1 - side, 0.0, speeds=((9.0, 0.0, 0.0),) * 2)
    for times in (0.0, 0.9):
        felt.elapsed = 3.0 + times * LAW.touch.pushed_time
        touch.notice_push(0.0, 1.0, 0.0)
    felt.elapsed = 3.0 + 1.8 * LAW.touch.pushed_time
    assert touch.pushed, "it goes on while the foot is as fast"
    felt.elapsed = 3.0 + 3.0 * LAW.touch.pushed_time
    touch.notice_push(0.0, 1.0, 0.0)
    assert not touch.pushed, "a foot that comes back is as fast"


# ---- what is felt ---------------------------------------------------------------------------------------------------


def feeling(wrenches: list[list[float]], **state: Any) -> GaitState:
    eye = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    felt = GaitState(GaitValues(SETTINGS, LAW, SCALE, DT))
    places = ((0.0, 0.11, 0.0), (0.0, -0.11, 0.0))
    felt.state = BodyState(
        (0.0, 0.0, SCALE.height), POINT, POINT, places, (eye, eye), wrenches, 0.0, SCALE.mass, **state
    )
    return felt


@pytest.mark.parametrize("side", [0, 1])
def test_a_foot_is_kicked_away_where_it_is_fast_carries_nothing_and_the_other_one_holds(side: int) -> None:
    for load, other, speed, kicked in (
        (0.99 * LAW.touch.lost, 1.01 * LAW.touch.held, 1.01 * LAW.touch.kicked, True),
        (1.01 * LAW.touch.lost, 1.01 * LAW.touch.held, 1.01 * LAW.touch.kicked, False),
        (0.99 * LAW.touch.lost, 0.99 * LAW.touch.held, 1.01 * LAW.touch.kicked, False),
        (0.99 * LAW.touch.lost, 1.01 * LAW.touch.held, 0.99 * LAW.touch.kicked, False),
    ):
        loads, speeds = [load, other], [(0.6 * speed, 0.0, -0.8 * speed), POINT]
        if side:
            loads, speeds = loads[::-1], speeds[::-1]
        felt = feeling(loaded(*loads), speeds=tuple(speeds))
        assert felt.kicked() == (side if kicked else None)


def test_a_contact_point_is_low_passed_and_the_dcm_on_both_feet_is_that_of_the_com_over_it() -> None:
    felt = feeling(loaded(300.0, 100.0))
    felt._begin(GaitPhase.STANDING, 1)
    felt.follow()
    assert felt.contact == pytest.approx((0.0, 0.055, 0.0)), "by the shares of the load"
    state = felt.state._replace(wrenches=loaded(0.0, 400.0), velocity=(0.2, -0.1, 0.3))
    for tick in range(1, 20):
        felt.take(state, LEVEL)
        left = math.exp(-tick * DT / LAW.area.cop_lag)
        assert felt.contact == pytest.approx((0.0, -0.11 + 0.165 * left, 0.0))
    assert felt.dcm == pytest.approx((0.2 / OMEGA, -0.1 / OMEGA, OMEGA))
    low = felt.state._replace(com=(0.0, 0.0, 0.1 * SCALE.height))
    felt.take(low, LEVEL)
    assert felt.dcm.omega == pytest.approx(math.sqrt(GRAVITY / (0.5 * SCALE.height))), (
        "half of the height at least"
    )
    felt._begin(GaitPhase.SINGLE, 1)
    felt.take(state, LEVEL)
    assert felt.contact == pytest.approx((0.0, -0.11, 0.0)), "on one foot it begins anew"
    assert felt.carrying_point(1) == pytest.approx((LAW.area.carrying, -0.11, 0.0))
    assert felt.centre_of_pressure(0) == pytest.approx((LAW.area.carrying, 0.11, 0.0)), "where it would carry"
    assert feeling(loaded(0.0, 0.0)).contact_point() == pytest.approx((0.0, 0.0, 0.0)), (
        "in the air, the middle"
    )


@pytest.mark.parametrize("stance", [0, 1])
@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_foot_goes_on_over_what_it_has_met_by_where_feet_carry_and_not_by_their_centres(
    stance: int, yaw: float
) -> None:
    """Mirror images about the carrying points, one walking forward and one back, go on from the same ξ."""
    aside = (1.0 if stance == 1 else -1.0) * SETTINGS.width
    axes = StanceAxes(math.copysign(1.0, aside), (math.cos(yaw), math.sin(yaw)), POINT)

    def world(ahead: float, left: float) -> tuple[float, float]:
        c, s = axes.direction
        return c * ahead - s * left, s * ahead + c * left

    def begins(sign: float) -> float:
        """Return ξ from which on a foot goes on that has met something 0.1 m behind the foot that stands, m."""
        orbit = Orbit.of((0.1 * sign, 0.0), axes.side, SETTINGS.width, 0.6, 0.6, OMEGA)
        landing = Footstep(SIDES[1 - stance], *world(0.6 * sign - LAW.area.carrying, aside), yaw=yaw)
        touch, felt = touching(stance, 300.0)
        felt.contact = POINT
        felt.carrying_point = lambda side: (
            *world(*((0.0, 0.0) if side == stance else (-0.1 * sign, aside))),
            0.0,
        )
        centres = [(*world(-LAW.area.carrying, 0.0), 0.0)] * 2
        centres[1 - stance] = (*world(-0.1 * sign - LAW.area.carrying, aside), 0.0)
        felt.state.places = tuple(centres)
        for xi in np.arange(0.0, 0.5, 0.002).tolist():
            felt.dcm = Divergent(*world(sign * xi, 0.5 * aside), OMEGA)
            if touch.rubs(axes, orbit, 0.15, landing):
                return float(xi)
        return math.inf

    assert 0.1 < begins(1.0) == begins(-1.0) < 0.4
