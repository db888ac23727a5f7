"""Results of foot tests."""

from __future__ import annotations

from dataclasses import dataclass

Points = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Impact:
    """Landing from the start height until the foot rests.

    Attributes:
        speed: Downward speed of the ankle at the first contact, m/s.
        peak_force: Largest vertical force, N.
        drop_energy: Potential energy given up between start and rest, J; all of it is absorbed in the end.
        sole_energy: Part of the drop energy turned to heat in the dampers of the sole, J.
        arch_energy: Part of the drop energy turned to heat in the damper of the frontal arch, J.
        spring_energy: Part of the drop energy stored in the springs at rest, J.
        rebound_energy: Kinetic energy of the fastest upward motion after the first contact, J.
        absorbed: Ratio of the drop energy that the rebound does not return.
    """

    speed: float
    peak_force: float
    drop_energy: float
    sole_energy: float
    arch_energy: float
    spring_energy: float
    rebound_energy: float
    absorbed: float


@dataclass(frozen=True)
class Hold:
    """The foot at rest under its load. Plan coordinates are forward and left of the sole centre at the start.

    Attributes:
        weight: Weight of load and foot, N.
        force_mean: Mean vertical contact force, N.
        force_std: Standard deviation of the vertical contact force, N.
        balance_error: force_mean / weight − 1.
        centre_of_pressure: In plan, m.
        ankle_height: Height of the ankle over the level z = 0 of the ground, m.
        ankle_place: World x and y of the ankle, m.
        ankle_tilt: Roll and pitch of the ankle, rad.
        contacts: Number of contact points that carry load.
        contact_points: These points, in plan and world z, m.
        contact_forces: Vertical forces at these points, N.
        contact_area: Area of the convex hull of the contact points in plan, m².
        sole_angles: Angles of the sole hinges from the toe to the heel, rad.
        sole_line: Contact spheres' lowest points in plan and world z, row by row from the toe, m.
        skeleton: Heel hinge, ankle and tip of the frontal arch (rigid foot: sole centre and ankle) in plan
            and world z, m.
        loop_gap: Largest distance between the sides of the loop closure in the hold, m.
        loop_gap_peak: The same from the start on, m.
        penetration: Largest penetration in the hold, m.
        penetration_peak: The same from the start on, m.
        jitter: Root mean square of the sole hinge rates in the hold, rad/s.
    """

    weight: float
    force_mean: float
    force_std: float
    balance_error: float
    centre_of_pressure: tuple[float, ...]
    ankle_height: float
    ankle_place: tuple[float, float]
    ankle_tilt: tuple[float, float]
    contacts: int
    contact_points: Points
    contact_forces: tuple[float, ...]
    contact_area: float
    sole_angles: tuple[float, ...]
    sole_line: Points
    skeleton: Points
    loop_gap: float
    loop_gap_peak: float
    penetration: float
    penetration_peak: float
    jitter: float


@dataclass(frozen=True)
class SupportPolygon:
    """Equivalent support polygon: the area in which the foot can put its centre of pressure.

    The convex hull of the centres of pressure while the ankle was tilted a little in all directions and the ground
    carried at least half of the weight, of contacts that push up with at least 0.5 % of it each.

    Attributes:
        tilt: Largest tilt of the ankle considered, rad.
        polygon: Convex hull of the centres of pressure in plan, counter-clockwise, m.
        area: Area of the polygon, m².
        forward: Largest x, m.
        backward: Smallest x, m.
        left: Largest y, m.
        right: Smallest y, m.
    """

    tilt: float
    polygon: Points
    area: float
    forward: float
    backward: float
    left: float
    right: float


@dataclass(frozen=True)
class PressResult:
    """A foot dropped onto a ground and pressed.

    Attributes:
        diverged: True if the simulation diverged; the rest is None then.
        impact: The landing.
        hold: The foot at rest.
        support: Equivalent support polygon; None if it was not asked for.
    """

    diverged: bool
    impact: Impact | None = None
    hold: Hold | None = None
    support: SupportPolygon | None = None


@dataclass(frozen=True)
class PitchResult:
    """A loaded foot whose ankle is pitched slowly back and forth.

    Attributes:
        diverged: True if the simulation diverged.
        pitch: Pitch of the ankle, toe down positive, rad.
        centre_of_pressure: x of the centre of pressure in plan, m.
        moment: Ankle moment of the ground's force about the transverse axis, Nm.
        ankle_height: Height of the ankle over the level z = 0 of the ground, m.
    """

    diverged: bool
    pitch: tuple[float, ...] = ()
    centre_of_pressure: tuple[float, ...] = ()
    moment: tuple[float, ...] = ()
    ankle_height: tuple[float, ...] = ()
