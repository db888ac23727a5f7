"""Press: a pure function of a foot test, and its result."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from wbc.base.checked import checked
from wbc.base.hull import hull_and_area
from wbc.base.numbers import Array
from wbc.sim.rig.rig import MIN_CONTACT_SHARE, FootTest, Rig
from wbc.sim.simulation.simulation import DivergedError

REBOUND_TIME = 0.3
"""Time after the first contact in which the rebound is measured, s."""

SUPPORT_TILT = math.radians(2.0)
"""Largest ankle tilt of the equivalent support polygon, rad: a standing robot turns its foot less."""

SUPPORT_DIRECTIONS = 8
"""Directions in which the ankle is tilted: along the axes and the diagonals, which reach the corners."""

SUPPORT_LOAD = 0.5
"""Least vertical force, as a share of the weight, at which a centre of pressure counts for the support polygon. A tilt
is so slow that the ground carries about the weight; a foot that rolls off a stone loses it for some ticks, and the
quotient of two small moments and forces lies anywhere."""

_RAMP = 0.6  # s for one tilt; ten times slower changes the polygons of the soft foot by less than 1 mm
_SAMPLE = 0.005  # s between samples of the centre of pressure

Points = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Impact:
    """Landing from the start height until the foot rests.

    Attributes:
        drop_energy: Potential energy given up between start and rest, J; all of it is absorbed in the end.
    """

    speed: float  # downward speed of the ankle at the first contact, m/s
    peak_force: float  # largest vertical force, N
    drop_energy: float
    sole_energy: float  # part of the drop energy turned to heat in the dampers of the sole, J
    arch_energy: float  # part of the drop energy turned to heat in the damper of the frontal arch, J
    spring_energy: float  # part of the drop energy stored in the springs at rest, J
    rebound_energy: float  # kinetic energy of the fastest upward motion after the first contact, J
    absorbed: float  # ratio of the drop energy that the rebound does not return


@dataclass(frozen=True)
class Hold:
    """The foot at rest under its load. Plan coordinates are forward and left of the sole centre at the start.

    Attributes:
        sole_line: Contact spheres' lowest points in plan and world z, row by row from the toe, m.
        skeleton: Heel hinge, ankle and tip of the frontal arch (rigid foot: sole centre and ankle) in plan
            and world z, m.
    """

    weight: float  # weight of load and foot, N
    force_mean: float  # mean vertical contact force, N
    force_std: float  # standard deviation of the vertical contact force, N
    balance_error: float  # force_mean / weight − 1
    centre_of_pressure: tuple[float, ...]  # in plan, m
    ankle_height: float  # height of the ankle over the level z = 0 of the ground, m
    ankle_place: tuple[float, float]  # world x and y of the ankle, m
    ankle_tilt: tuple[float, float]  # roll and pitch of the ankle, rad
    contacts: int  # number of contact points that carry load
    contact_points: Points = field(repr=False)  # these points, in plan and world z, m
    contact_forces: tuple[float, ...]  # vertical forces at these points, N
    contact_area: float  # area of the convex hull of the contact points in plan, m²
    sole_angles: tuple[float, ...]  # angles of the sole hinges from the toe to the heel, rad
    sole_line: Points = field(repr=False)
    skeleton: Points = field(repr=False)
    loop_gap: float  # largest distance between the sides of the loop closure in the hold, m
    penetration: float  # largest penetration in the hold, m
    jitter: float  # root mean square of the sole hinge rates in the hold, rad/s


@dataclass(frozen=True)
class SupportPolygon:
    """Equivalent support polygon: the area in which the foot can put its centre of pressure.

    The convex hull of the centres of pressure while the ankle was tilted a little in all directions and the ground
    carried at least half of the weight, of contacts that push up with at least 0.5 % of it each.

    Attributes:
        polygon: Convex hull of the centres of pressure in plan, counter-clockwise, m.
    """

    tilt: float  # largest tilt of the ankle considered, rad
    polygon: Points = field(repr=False)
    area: float  # area of the polygon, m²
    forward: float  # largest x, m
    backward: float  # smallest x, m
    left: float  # largest y, m
    right: float  # smallest y, m


@dataclass(frozen=True)
class PressResult:
    """A foot dropped onto a ground and pressed; nothing but `diverged` if the simulation diverged.

    Attributes:
        diverged: True if the simulation diverged.
        impact: Speed, force and energies of the landing; None if the simulation diverged.
        hold: Forces, contacts and shape of the foot at rest; None if the simulation diverged.
        support: Equivalent support polygon; None if it was not asked for, without an ankle servo, or after divergence.
    """

    diverged: bool
    impact: Impact | None = None
    hold: Hold | None = None
    support: SupportPolygon | None = None


@checked
def press(test: FootTest, *, support: bool = True) -> PressResult:
    """Drop the foot onto the ground, let it settle under its load and measure it at rest.

    Args:
        test: Foot, ground and load.
        support: Also measure the equivalent support polygon, which needs an ankle servo.
    """
    rig = Rig(test)
    try:
        impact, hold = _land(rig), _hold(rig)
        polygon = _support(rig) if support and test.ankle_stiffness > 0.0 else None
    except DivergedError:
        return PressResult(diverged=True)
    return PressResult(False, impact, hold, polygon)


def _land(rig: Rig) -> Impact:
    """Drop the foot until it rests."""
    dt, start, touched = rig.test.physics.timestep, float(rig.ankle[2]), -1
    speed = peak = upward = 0.0
    heat = np.zeros(2)
    for step in range(rig.steps(rig.test.settle)):
        before = rig.ankle_speed
        rig.step()
        force = rig.vertical_force
        if touched < 0 and force > 0.0:
            touched, speed = step, -before
        peak = max(peak, force)
        heat += rig.powers * dt
        if touched >= 0 and (step - touched) * dt <= REBOUND_TIME:
            upward = max(upward, rig.ankle_speed)
    energy = rig.weight * (start - float(rig.ankle[2]))
    rebound = 0.5 * rig.mass * upward**2
    return Impact(
        speed=speed,
        peak_force=peak,
        drop_energy=energy,
        sole_energy=float(heat[0]),
        arch_energy=float(heat[1]),
        spring_energy=rig.spring_energy,
        rebound_energy=rebound,
        absorbed=1.0 - rebound / energy if energy > 0.0 else math.nan,
    )


def _hold(rig: Rig) -> Hold:
    forces, gap, depth, rates = [], 0.0, 0.0, 0.0
    count = rig.steps(rig.test.hold)
    for _ in range(count):
        rig.step()
        rates += rig.mean_square_rate
        forces.append(rig.vertical_force)
        gap, depth = max(gap, rig.loop_gap), max(depth, rig.depth)
    points, bearing = rig.contacts(MIN_CONTACT_SHARE)
    plan = rig.in_plan(points)
    x, y, z = rig.ankle.tolist()
    return Hold(
        weight=rig.weight,
        force_mean=float(np.mean(forces)),
        force_std=float(np.std(forces)),
        balance_error=float(np.mean(forces)) / rig.weight - 1.0,
        centre_of_pressure=tuple(rig.centre_of_pressure().tolist()),
        ankle_height=z,
        ankle_place=(x, y),
        ankle_tilt=rig.tilt,
        contacts=len(plan),
        contact_points=_rows(np.column_stack([plan, points[:, 2]])),
        contact_forces=tuple(bearing[:, 2].tolist()),
        contact_area=hull_and_area(plan)[1],
        sole_angles=tuple(rig.angles.tolist()),
        sole_line=_rows(rig.sole_line()),
        skeleton=_rows(rig.skeleton()),
        loop_gap=gap,
        penetration=depth,
        jitter=math.sqrt(rates / count),
    )


def _support(rig: Rig) -> SupportPolygon:
    """Tilt the ankle in every direction from where it rests, and collect the centres of pressure."""
    centres = [rig.centre_of_pressure(MIN_CONTACT_SHARE, SUPPORT_LOAD)]
    count, every = rig.steps(_RAMP), rig.steps(_SAMPLE)
    # The servo yields under the moment of the ground, so its command goes beyond the tilt of the polygon.
    yielding = rig.weight * rig.foot.fit.sole.length / rig.test.ankle_stiffness
    ramp = (SUPPORT_TILT + yielding) * np.arange(1, count + 1) / count
    for k in range(SUPPORT_DIRECTIONS):
        twin, direction = rig.fork(), math.tau * k / SUPPORT_DIRECTIONS
        for step, tilt in enumerate(ramp.tolist(), 1):
            twin.set_tilt(tilt * math.sin(direction), tilt * math.cos(direction))
            twin.step()
            if step % every == 0:
                if math.hypot(*twin.tilt) > SUPPORT_TILT:
                    break
                centres.append(twin.centre_of_pressure(MIN_CONTACT_SHARE, SUPPORT_LOAD))
    points = np.array(centres)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):  # a foot that has slipped off its stone
        return SupportPolygon(SUPPORT_TILT, (), 0.0, math.nan, math.nan, math.nan, math.nan)
    corners, area = hull_and_area(points)
    (backward, right), (forward, left) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return SupportPolygon(SUPPORT_TILT, _rows(corners), area, forward, backward, left, right)


def _rows(points: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in points.tolist())
