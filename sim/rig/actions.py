"""Press and pitch: pure functions of a foot test."""

from __future__ import annotations

import math

import numpy as np

from wbc.core.errors import Array, InputError, finite_scalar, positive
from wbc.core.hull import hull_and_area
from wbc.sim.rig.fixture import Rig
from wbc.sim.rig.results import Hold, Impact, PitchResult, PressResult, SupportPolygon
from wbc.sim.rig.spec import FootTest

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

LONGEST = 60.0
"""Longest motion of a test, s."""


def press(test: FootTest, *, support: bool = True) -> PressResult:
    """Drop the foot onto the ground, let it settle under its load and measure it at rest.

    Args:
        test: Foot, ground and load.
        support: True to measure the equivalent support polygon as well (needs an ankle servo).
    """
    rig = Rig(test)
    landing = land(rig)
    if landing is None:
        return PressResult(diverged=True)
    impact, gap, depth = landing
    hold = _hold(rig, gap, depth)
    if hold is None:
        return PressResult(diverged=True)
    if not support or test.ankle_stiffness == 0.0:
        return PressResult(False, impact, hold)
    polygon = _support(rig)
    return PressResult(True) if polygon is None else PressResult(False, impact, hold, polygon)


def pitch(
    test: FootTest, *, amplitude: float = math.radians(5.0), rate: float = math.radians(10.0)
) -> PitchResult:
    """Pitch the ankle of a loaded foot toe down, toe up and back, and follow the centre of pressure.

    `amplitude` is the largest commanded pitch, rad, `rate` the speed of the command, rad/s. `InputError`: an ankle
    without a servo.
    """
    if test.ankle_stiffness == 0.0:
        raise InputError("pitching needs an ankle servo: ankle_stiffness must be above 0 Nm/rad")
    finite_scalar("pitch amplitude (rad)", amplitude, low=0.0, high=0.5 * math.pi, open_low=True)
    duration = 4.0 * amplitude / positive("pitch rate (rad/s)", rate)
    if duration > LONGEST:
        raise InputError(
            f"the pitch would last {duration:g} s, at most {LONGEST:g} s are simulated; move faster"
        )
    if duration < 2.0 * _SAMPLE:
        raise InputError(
            f"pitching by {amplitude:g} rad at {rate:g} rad/s lasts {duration:g} s, less than two samples"
        )
    rig = Rig(test)
    if land(rig) is None:
        return PitchResult(True)
    path = np.array([0.0, amplitude, -amplitude, 0.0])
    times = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path)) / rate)])
    every = rig.steps(_SAMPLE)
    rows: list[tuple[float, float, float, float]] = []
    for step in range(1, rig.steps(float(times[-1])) + 1):
        rig.set_tilt(0.0, float(np.interp(step * test.physics.timestep, times, path)))
        rig.step()
        if step % every == 0:
            centre = float(rig.centre_of_pressure()[0])
            rows.append((rig.tilt[1], centre, rig.pitch_moment, rig.ankle_height))
    if rig.diverged:
        return PitchResult(True)
    angles, centres, moments, heights = (tuple(column) for column in zip(*rows, strict=True))
    return PitchResult(False, angles, centres, moments, heights)


def land(rig: Rig) -> tuple[Impact, float, float] | None:
    """Drop the foot; return impact, largest loop gap (m) and largest penetration (m) so far; None if it diverged."""
    dt, gravity = rig.test.physics.timestep, rig.test.physics.gravity
    start = rig.ankle_height
    touched = -1
    speed = peak = sole_heat = arch_heat = upward = gap = depth = 0.0
    for step in range(rig.steps(rig.test.settle)):
        before = rig.ankle_speed
        rig.step()
        force = rig.vertical_force
        if touched < 0 and force > 0.0:
            touched, speed = step, -before
        peak = max(peak, force)
        sole_heat += rig.sole_power * dt
        arch_heat += rig.arch_power * dt
        if touched >= 0 and (step - touched) * dt <= REBOUND_TIME:
            upward = max(upward, rig.ankle_speed)
        gap, depth = max(gap, rig.probe.loop_gap(rig.data)), max(depth, _depth(rig))
        if rig.diverged:
            return None
    energy = rig.mass * gravity * (start - rig.ankle_height)
    rebound = 0.5 * rig.mass * upward**2
    impact = Impact(
        speed=speed,
        peak_force=peak,
        drop_energy=energy,
        sole_energy=sole_heat,
        arch_energy=arch_heat,
        spring_energy=rig.spring_energy,
        rebound_energy=rebound,
        absorbed=1.0 - rebound / energy if energy > 0.0 else math.nan,
    )
    return impact, gap, depth


def _hold(rig: Rig, gap_peak: float, depth_peak: float) -> Hold | None:
    forces, gap, depth, rates = [], 0.0, 0.0, 0.0
    count = rig.steps(rig.test.hold)
    for _ in range(count):
        rig.step()
        forces.append(rig.vertical_force)
        gap, depth = max(gap, rig.probe.loop_gap(rig.data)), max(depth, _depth(rig))
        rates += float(np.mean(rig.sole_rates**2)) if rig.sole_rates.size else 0.0
    if rig.diverged:
        return None
    weight = rig.mass * rig.test.physics.gravity
    contacts = rig.contacts(rig.min_contact_force)
    plan = rig.in_plan(contacts.points)
    return Hold(
        weight=weight,
        force_mean=float(np.mean(forces)),
        force_std=float(np.std(forces)),
        balance_error=float(np.mean(forces)) / weight - 1.0,
        centre_of_pressure=tuple(rig.centre_of_pressure().tolist()),
        ankle_height=rig.ankle_height,
        ankle_place=rig.ankle_position,
        ankle_tilt=rig.tilt,
        contacts=len(plan),
        contact_points=_rows(np.column_stack([plan, contacts.points[:, 2]])),
        contact_forces=tuple(contacts.forces[:, 2].tolist()),
        contact_area=rig.contact_area(),
        sole_angles=tuple(rig.probe.angles(rig.data).tolist()),
        sole_line=_rows(rig.sole_line()),
        skeleton=_rows(rig.skeleton()),
        loop_gap=gap,
        loop_gap_peak=max(gap, gap_peak),
        penetration=depth,
        penetration_peak=max(depth, depth_peak),
        jitter=math.sqrt(rates / count),
    )


def _support(rig: Rig) -> SupportPolygon | None:
    """Tilt the ankle in every direction from where it rests, and collect the centres of pressure."""
    centres = [rig.supporting_centre(SUPPORT_LOAD)]
    every, count = rig.steps(_SAMPLE), rig.steps(_RAMP)
    # The servo yields under the moment of the ground, so its command goes beyond the tilt of the polygon.
    yielding = rig.mass * rig.test.physics.gravity * rig.foot.fit.sole.length / rig.test.ankle_stiffness
    for k in range(SUPPORT_DIRECTIONS):
        twin = rig.fork()
        direction = math.tau * k / SUPPORT_DIRECTIONS
        for step in range(1, count + 1):
            angle = (SUPPORT_TILT + yielding) * step / count
            twin.set_tilt(angle * math.sin(direction), angle * math.cos(direction))
            twin.step()
            if step % every == 0:
                if math.hypot(*twin.tilt) > SUPPORT_TILT:
                    break
                centres.append(twin.supporting_centre(SUPPORT_LOAD))
        if twin.diverged:
            return None
    points = np.array(centres)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):  # a foot that has slipped off its stone
        return SupportPolygon(SUPPORT_TILT, (), 0.0, math.nan, math.nan, math.nan, math.nan)
    corners, area = hull_and_area(points)
    (backward, right), (forward, left) = corners.min(axis=0), corners.max(axis=0)
    return SupportPolygon(
        tilt=SUPPORT_TILT,
        polygon=_rows(corners),
        area=area,
        forward=float(forward),
        backward=float(backward),
        left=float(left),
        right=float(right),
    )


def _depth(rig: Rig) -> float:
    """Return the deepest penetration now, m."""
    return -float(rig.data.contact.dist.min()) if rig.data.ncon else 0.0


def _rows(points: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in points.tolist())
