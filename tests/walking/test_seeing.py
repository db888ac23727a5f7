"""A walk whose ground is known lands on it, stays in reach, meets its goal, and is the same in a turned world."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from point_mass import PointMass
from properties import by_default

from wbc.base.errors import InputError
from wbc.ground import KnownGround
from wbc.ground.cloud import ElevationMap
from wbc.ground.footprint import FootprintSettings
from wbc.ground.known import GroundSettings
from wbc.robots import load
from wbc.walking.ground import GroundEstimate
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.planners import walk_distance

DT = 0.005
HEIGHT = 0.78


def standing(turn: pin.SE3 | None = None):
    robot = load("hrp4_class").robot()
    q = robot.half_sitting.copy()
    if turn is not None:
        base = turn * pin.XYZQUATToSE3(q[:7])
        q[:7] = pin.SE3ToXYZQUAT(base)
    robot.update(q, np.zeros(robot.nv))
    return robot


def walk(
    robot, heights: np.ndarray | None, turn: pin.SE3 | None = None, plan=None, true: float | None = None
) -> tuple[LipmWalk, list[Footstep]]:
    """Walk with perfect contacts over what is known, or a level that is the true one; return where feet landed, too."""
    plan = walk_distance(FootstepPlan.standing(robot), 0.9) if plan is None else plan
    walking = LipmWalk(robot, plan, HEIGHT, DT)
    ground = KnownGround(robot)
    yaw, at = 0.0, np.zeros(3)
    if turn is not None:
        yaw, at = math.atan2(turn.rotation[1, 0], turn.rotation[0, 0]), turn.translation
    if heights is not None:
        corner = np.array([-0.5, -0.5, 0.0])
        corner = corner if turn is None else turn.rotation @ corner
        ground.add(ElevationMap(heights, 0.02, (at[0] + corner[0], at[1] + corner[1], yaw)))
    walking.ground.sight = ground
    landed: list[Footstep] = []
    loads, weight, soles = [0.5, 0.5], robot.mass * 9.81, None
    for k in range(6000):
        ground.update(robot, DT * k)
        before = walking.steps_done
        reference = walking.advance([weight * share for share in loads], soles)
        if walking.steps_done > before:
            landed.append(walking.phases.plan.steps[walking.phases.step - 1])
        if walking.finished:
            break
        # Feet are where they are told; a swing foot stops on its landing, the other one carries.
        step = walking.phases.plan.steps[min(walking.phases.step, len(walking.phases.plan) - 1)]
        moving = 0 if step.side == "left" else 1
        loads = [0.5, 0.5]
        soles = [motion.placement.copy() for motion in reference.feet]
        level = step.z if true is None else true
        meets = walking.feet.swing is not None and soles[moving].translation[2] <= level + 1e-5
        if meets and walking.phases.elapsed > 0.6 * walking.phases.duration:
            soles[moving].translation[2] = level
        else:
            loads[moving], loads[1 - moving] = 0.0, 1.0
    assert walking.finished
    return walking, landed


def rough(seed: int) -> np.ndarray:
    """Blocks of 60 mm of random heights up to 30 mm, on cells of 20 mm; level under the feet at the start."""
    blocks = np.random.default_rng(seed).uniform(0.0, 0.03, (34, 17))
    heights = np.kron(blocks, np.ones((3, 3)))[:100, :50]
    heights[:32] = 0.0
    return heights


@pytest.mark.parametrize("seed", by_default(range(3), 0))
def test_feet_land_on_what_is_known_within_reach_and_at_the_goal(seed: int) -> None:
    robot = standing()
    plan = walk_distance(FootstepPlan.standing(robot), 0.9)
    walking, landed = walk(robot, rough(seed), plan=plan)
    planned = plan.steps
    assert len(landed) == len(planned)
    heights = [step.z for step in landed]
    assert max(heights) > 0.01
    moved = [math.hypot(a.x - b.x, a.y - b.y) for a, b in zip(landed, planned, strict=True)]
    assert max(moved) > 0.01  # to quieter ground
    assert max(moved) < math.hypot(0.041, 0.026)
    assert moved[-2:] == pytest.approx([0.0, 0.0], abs=1e-6)
    for a, b in zip(landed, landed[1:], strict=False):
        forward, left, up, _ = b.seen_from(a)
        assert abs(forward) <= walking.reach.max_length
        assert walking.reach.min_spacing - 1e-9 <= abs(left) <= walking.reach.max_spacing
        assert abs(up) <= walking.reach.max_height


def test_a_foot_that_is_fooled_searches_down_to_where_the_ground_was() -> None:
    phantom = np.zeros((100, 50))
    phantom[40:52] = 0.06
    _, landed = walk(standing(), phantom, true=0.0)
    assert [step.z for step in landed] == pytest.approx([0.0] * len(landed), abs=1e-3)


def test_fixed_steps_stay_where_they_are() -> None:
    robot = standing()
    plan = walk_distance(FootstepPlan.standing(robot), 0.9)
    fixed = FootstepPlan(
        plan.left,
        plan.right,
        tuple(Footstep(s.side, s.x, s.y, s.z, s.yaw, fixed=True) for s in plan.steps),
        plan.gait,
    )
    _, landed = walk(robot, rough(0), plan=fixed)
    for a, b in zip(landed, fixed.steps, strict=True):
        assert (a.x, a.y) == pytest.approx((b.x, b.y), abs=1e-6)
    assert max(step.z for step in landed) > 0.01
    moved = fixed.moved(pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 1.0), np.array([1.0, 2.0, 0.0])))
    assert all(step.fixed for step in moved.steps)
    with pytest.raises(InputError, match="True or False"):
        Footstep("left", 0.0, 0.0, fixed="here")  # type: ignore[arg-type]


def test_unknown_ground_is_walked_blind_to_the_bit() -> None:
    robot = standing()
    _, blind = walk(robot, None)
    _, nothing = walk(robot, np.full((100, 50), np.nan))
    assert blind == nothing


@pytest.mark.slow
@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-math.pi, math.pi))
@settings(max_examples=4, deadline=None)
def test_a_walk_is_the_same_in_a_moved_and_turned_world(x: float, y: float, yaw: float) -> None:
    turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array([x, y, 0.0]))
    # Heights that vary little within a cell's border: a point on the very border may fall to either side.
    _, here = walk(standing(), rough(1))
    _, there = walk(standing(turn), rough(1), turn)
    for a, b in zip(here, there, strict=True):
        back = turn.actInv(b.position)
        assert (back[0], back[1], back[2]) == pytest.approx((a.x, a.y, a.z), abs=0.004)


def test_ground_out_of_reach_is_no_landing() -> None:
    heights = np.zeros((100, 50))
    heights[45:] = 2.0
    _, landed = walk(standing(), heights)
    assert max(step.z for step in landed) < 0.3


def test_the_tilt_that_is_seen_is_kept_in_every_tick_of_a_swing() -> None:
    """A slope of 0.15 begins at 0.1 m; landings a cell beyond follow it by 0.1 rad at most, from the first look on."""
    ground = KnownGround(load("g1").robot(), GroundSettings(footprint=FootprintSettings(tilt=0.1)))
    x = np.arange(-1.0, 3.0, 0.02) + 0.01
    slope = np.tile(0.15 * np.maximum(x - 0.1, 0.0)[:, None], (1, 150))
    ground.add(ElevationMap(slope, 0.02, (-1.0, -1.5, 0.0)))
    mass = PointMass()
    mass.gait.ground.sight = ground
    mass.gait.steering.command((0.3, 0.0, 0.0))
    tilts = []
    for tick in mass.run(2.2):
        landing = tick.reference.progress.landing
        if tick.reference.progress.air is not None and landing is not None and landing.x > 0.12:
            tilts.append(landing.pitch)
    assert len(tilts) > 100
    np.testing.assert_allclose(tilts, -math.atan(0.1), atol=1e-6)


class Told:
    """Sight of one place, 10 mm ahead of where it is asked for."""

    version = 3

    def __init__(self, z: float, slope: tuple[float, float] = (0.0, 0.0), over: float = -math.inf) -> None:
        """Take the height and the slopes of the place, and the highest ground on the way there, m."""
        self.z, self.slope, self.over = z, slope, over

    def support(self, side: int, x: float, y: float, yaw: float) -> SimpleNamespace:
        """Return the place under a foot."""
        return SimpleNamespace(x=x, y=y, z=self.z, slope=self.slope)

    def best(self, side: int, x: float, y: float, yaw: float, *_: object) -> SimpleNamespace:
        """Return the place near a foot."""
        return SimpleNamespace(x=x + 0.01, y=y, z=self.z, slope=self.slope)

    def highest(self, *_: object) -> float:
        """Return the highest ground."""
        return self.over

    def stand(self, *_: object) -> None:
        """Take nothing."""


PLANNED = Footstep("left", 0.3, 0.1, 0.02)


def test_landings_move_the_ground_that_is_expected_and_its_rise_by_their_shares() -> None:
    ground = GroundEstimate(0.5, 0.1)
    assert ground.expect(PLANNED) == PLANNED and ground.way(pin.SE3.Identity(), PLANNED) == -math.inf
    ground.land(0.02, 0.015)
    assert (ground.height, ground.rise, ground.uneven) == pytest.approx((0.01, 0.002, 0.015))
    assert ground.expect(PLANNED).z == pytest.approx(0.02 + 0.012)
    ground.land(-0.01, -0.001)
    assert (ground.height, ground.rise) == pytest.approx((0.012 - 0.005, 0.002 - 0.001))
    assert ground.uneven == pytest.approx(0.9 * 0.015)
    down = ground.settled([PLANNED], swings=False)
    assert down[0].z == pytest.approx(0.02 + 0.5 * 0.01)
    assert ground.settled([PLANNED], swings=True) == [PLANNED]
    ground.forget()
    assert (ground.height, ground.rise, ground.uneven, ground.raised) == (0.0, 0.0, 0.0, 0.0)
    assert ground.settled([PLANNED], swings=False) == [PLANNED]


def test_what_is_seen_is_landed_on_at_its_height_and_tilt_unless_legs_do_not_reach_it() -> None:
    ground = GroundEstimate(0.5, 0.1, 0.2)
    assert ground.choose(PLANNED) is PLANNED and not ground.news
    ground.sight = Told(0.07, (0.1, -0.2))  # type: ignore[assignment]
    assert ground.news
    seen = ground.choose(PLANNED)
    assert (seen.x, seen.z, seen.pitch, seen.roll) == pytest.approx(
        (0.3, 0.07, -math.atan(0.1), math.atan(-0.2))
    )
    assert not ground.news
    ground.height, ground.rise = 0.01, 0.005
    near = ground.expect(PLANNED, lambda x, y: True)
    assert (near.x, near.z) == pytest.approx((0.31, 0.07))
    assert (ground.height, ground.rise, ground.raised) == pytest.approx((0.05, 0.0, 0.07 - 0.035))
    ground.sight = Told(0.0)  # type: ignore[assignment]
    ground.expect(PLANNED, lambda x, y: True)
    assert (ground.height, ground.raised) == pytest.approx((-0.02, 0.0))
    for stands, z, found in (
        (0.1, -0.09, True),
        (0.1, -0.11, False),
        (-0.1, 0.11, False),
        (-0.1, 0.09, True),
    ):
        ground.lift(1, pin.SE3(np.eye(3), np.array([0.0, 0.0, stands])))
        ground.sight = Told(z)  # type: ignore[assignment]
        assert (ground.choose(PLANNED).z == z) == found


@pytest.mark.parametrize(("start", "over", "way"), [(0.0, 0.05, 0.05), (0.0, 0.3, 0.08), (0.1, 0.3, 0.16)])
def test_the_way_of_a_swing_is_over_what_is_seen_and_no_more_than_60_mm_over_its_higher_end(
    start: float, over: float, way: float
) -> None:
    ground = GroundEstimate(0.5, 0.1)
    ground.sight = Told(0.0, over=over)  # type: ignore[assignment]
    place = pin.SE3(np.eye(3), np.array([0.0, 0.1, start]))
    assert ground.way(place, PLANNED) == pytest.approx(way)
