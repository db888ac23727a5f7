"""Figures of a walk, recorded tick by tick: errors, torques, touch-downs, soles, and the onset of a fall."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Sequence
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.hull import hull_and_area
from wbc.base.numbers import Array
from wbc.base.vectors import Point, along
from wbc.core.conventions import rotation_of
from wbc.core.frames import heading, yaw_rotation
from wbc.core.robot import GRAVITY, SIDES
from wbc.core.signals import Measurement
from wbc.feet.sensing.scan import Profile
from wbc.sim.plant.plant import Plant
from wbc.sim.simulation.simulation import Simulation
from wbc.sim.terrain.areas import Area, at_places
from wbc.sim.trial.trial import AnyTrial, TrialHook, TrialTick
from wbc.sim.walks.result import Energy, Fall, Spread, Touchdowns, WalkResult
from wbc.tasks.scheduling.stiffness import StepStiffness
from wbc.tasks.stabilizer.pendulum import MIN_FORCE
from wbc.tasks.stabilizer.stabilizer import StabilizerOutput
from wbc.walking.contact import TOUCHED, Event, GaitPhase
from wbc.walking.control import WalkingControl
from wbc.walking.source import Progress, Reference
from wbc.walking.steered import SteeredControl

EXCURSION = 0.06
"""DCM error at the onset of a fall, m: the threshold of a first study of 108 falls."""

IMPACT_TIME = 0.1
"""Time after a touch-down in which its greatest force is the impact, s."""

NOTICE_TIME = 0.05
"""Greatest delay between a contact and the detection of its touch-down, s: the load is filtered and thresholded."""

MEMORY_TIME = 5.0
"""Time before a fall in which its onset is searched, s."""

CARRIES, SLIDES = 0.05, 0.05
"""Share of the weight that a sole carries, and speed along the ground, m/s, from which its way counts as slip: a sole
that rests shakes and rolls at some 0.02 m/s."""

SAMPLE = 0.02
"""Period over which accelerations of joints are differences of velocities, for the vibration, s."""

AT_ONCE = 256
"""Ticks whose torques or places are looked at at once: one by one takes ten times as long, all need gigabytes."""

LEAST_WAY = 0.05
"""Shortest distance for which a cost of transport and a speed are told, m."""


SPREADS = tuple(name for name, kind in get_type_hints(WalkResult).items() if kind is Spread)
"""Figures of which mean and standard deviation are told."""


class _Moment(NamedTuple):
    """State of one tick, for the onset of a fall."""

    time: float
    progress: Progress
    rotation: Array  # of the stance sole, shape (3, 3)
    dcm_error: list[float] | None  # target minus measured; None without a stabilizer

    @property
    def share(self) -> float:
        """Elapsed time over the duration of the phase."""
        now = self.progress
        return min(1.0, now.elapsed / now.duration) if now.duration > 0.0 else 0.0

    @property
    def dcm(self) -> tuple[float, float] | None:
        """DCM measured minus reference, forward and outward seen from the stance foot, m; None without its error."""
        return None if self.dcm_error is None else self.seen(-self.dcm_error[0], -self.dcm_error[1])

    def seen(self, x: float, y: float) -> tuple[float, float]:
        """Return a horizontal vector of the world, forward and outward seen from the stance foot."""
        yaw = heading(self.rotation)
        ahead, left = along((math.cos(yaw), math.sin(yaw)), x, y)
        return ahead, left if self.progress.stance == 0 else -left

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch of the stance sole, rad."""
        down, side, up = self.rotation[2].tolist()
        return math.atan2(side, up), -math.asin(min(1.0, max(-1.0, down)))


def vibration(velocities: ArrayLike, period: float) -> Array:
    """Return the sums of the changes of joints' accelerations from sample to sample, shape (na,), rad/s².

    An acceleration is the difference of two samples of the velocities, shape (na,), rad/s, over their period, s.
    """
    found: Array = np.abs(np.diff(velocities, 2, axis=0)).sum(axis=0) / period
    return found


class WalkMeter(TrialHook):
    """The figures of one walk."""

    def __init__(self, plant: Simulation, walking: SteeredControl, areas: Sequence[Area] = ()) -> None:
        """Begin without any tick, on a ground with some areas, over whose walkways a sole does not slip.

        Of a policy, which has no references, torques and work alone are measured.
        """
        self._plant, self._walking = plant, walking
        self._areas = [area for area in areas if area.name == "speed"]
        self._values: dict[str, list[float]] = {name: [] for name in SPREADS}
        self._events: Counter[Event] = Counter()
        self._moments: deque[_Moment] = deque(maxlen=max(1, round(MEMORY_TIME / plant.control_period)))
        self._peak = np.zeros(plant.robot.na)  # greatest torque of each joint over its limit
        self._work = np.zeros(plant.robot.na)
        self._drives: list[tuple[Array, Array]] = []  # torques and velocities of the last ticks
        self._ticks = 0
        self._every = max(1, round(SAMPLE / plant.control_period))  # ticks in a sample
        self._sample = self._every * plant.control_period
        self._velocities: list[Array] = []  # of the joints, a sample
        self._places: list[Sequence[float]] = []  # of the base, a sample
        self._slip = 0.0
        self._least = CARRIES * plant.robot.mass * GRAVITY  # N
        # Centre of pressure of each sole that carries: over the sole, and in the world, x and y, m.
        self._centres: list[tuple[Point, Point] | None] = [None, None]
        self._impact: float | None = None
        self._impact_until = -math.inf
        self._forces: deque[list[float]] = deque(maxlen=max(1, round(NOTICE_TIME / plant.control_period)))
        self._landed = 0
        self._swing: int | None = None  # foot in the air in the last recorded tick
        self._middle = -1  # last step whose middle has been recorded
        self._reference: Reference | None = None  # of the last recorded tick

    def tick(self, tick: TrialTick) -> None:
        """Record a tick, before the plant moves on."""
        seen: Measurement | None = tick.measurement
        if seen is None or seen.sole_wrench is None:
            seen = tick.control.drives.measurement
        wrenches: list[list[float]] = [] if seen is None else seen.wrenches.tolist()
        self._record_slip(wrenches)
        if not isinstance(self._walking, WalkingControl):
            return
        reference, output = self._walking.reference, self._walking.output
        if reference is None or reference is self._reference:
            return  # the controller has had no good measurement, yet or this time
        self._reference = reference
        progress = reference.progress
        dcm_error = None if output is None else self._record_errors(reference, output)
        self._record_events(progress.events, tick.measurement.time, [wrench[2] for wrench in wrenches])
        self._swing = progress.swing
        self._record_stance(progress, dcm_error)

    def after(self, trial: AnyTrial) -> None:
        """Record torques and work of the joints, after the plant has moved on."""
        del trial
        plant, velocity = self._plant, self._plant.joint_velocity
        if self._ticks % self._every == 0:
            self._velocities.append(velocity)
            self._places.append(plant.base_pose[:2])
        self._ticks += 1
        self._drives.append((plant.joint_torque, velocity))
        if len(self._drives) == AT_ONCE:
            self._take_drives()

    @property
    def work(self) -> Array:
        """Work of each joint, the negative counted as positive, shape (na,), J."""
        if self._drives:
            self._take_drives()
        return self._work

    def _take_drives(self) -> None:
        """Add torques and velocities of the joints since the last call to the figures."""
        torque, velocity = np.array(self._drives).swapaxes(0, 1)
        share = self._plant.robot.torque_share(torque)
        self._peak = np.maximum(self._peak, share.max(axis=0))
        self._values["torque_ratio"] += share.max(axis=1).tolist()
        self._work += np.abs(torque * velocity).sum(axis=0) * self._plant.control_period
        self._drives.clear()

    def _record_slip(self, wrenches: list[list[float]]) -> None:
        """Add the way along the ground of the points of the soles at their centres of pressure, m."""
        for side, (_, _, force, roll, pitch, _) in enumerate(wrenches[:2]):
            last, self._centres[side] = self._centres[side], None
            if force < self._least:
                continue
            centre, rotation = self._plant.sole_poses[side]
            (x, y, _), ((a, b, _), (c, d, _), _) = centre.tolist(), rotation.tolist()
            u, v = -pitch / force, roll / force
            self._centres[side] = (u, v), (x + a * u + b * v, y + c * u + d * v)
            if last is not None:
                (u, v), (old_x, old_y) = last
                at_x, at_y = x + a * u + b * v, y + c * u + d * v
                moved_x, moved_y = at_x - old_x, at_y - old_y
                if self._areas:
                    belt = float(at_places(self._areas, "speed", np.array([[at_x, at_y]]), 0.0)[0])
                    moved_x -= belt * self._plant.control_period
                way = math.hypot(moved_x, moved_y)
                self._slip += way if way > SLIDES * self._plant.control_period else 0.0

    def _record_errors(self, reference: Reference, output: StabilizerOutput) -> list[float]:
        """Record the errors of a stabilizer, and return that of the DCM, target minus measured, m."""
        (x, y, _), (desired_x, desired_y, _) = output.measured_zmp.tolist(), reference.pendulum.zmp.tolist()
        distance = math.hypot(desired_x - x, desired_y - y)
        if math.isfinite(distance):  # there is none in the air
            self._values["zmp_error"].append(distance)
        x, y, _ = output.errors.com.tolist()
        self._values["com_error"].append(math.hypot(x, y))
        dcm_error: list[float] = output.errors.dcm.tolist()
        self._values["dcm_error"].append(math.hypot(*dcm_error))
        return dcm_error

    def _record_events(self, events: tuple[Event, ...], now: float, forces: list[float]) -> None:
        """Record the events of a tick at a time, s, with the normal forces on the soles, N."""
        self._forces.append(forces)
        for event in events:
            self._events[event] += 1
            if event in TOUCHED:
                self._impact_until = now + IMPACT_TIME
                self._landed = self._landed if self._swing is None else self._swing
                self._hit(max(before[self._landed] for before in self._forces))
        if now <= self._impact_until:
            self._hit(self._forces[-1][self._landed])

    def _hit(self, force: float) -> None:
        """Update the greatest force of the landings, N."""
        self._impact = force if self._impact is None else max(force, self._impact)

    def _record_stance(self, progress: Progress, dcm_error: list[float] | None) -> None:
        """Record the tilt of the stance sole and the DCM error; its contact area once a step."""
        plant, stance = self._plant, progress.stance
        moment = _Moment(plant.time, progress, plant.sole_poses[stance][1].copy(), dcm_error)
        self._moments.append(moment)
        if progress.phase is not GaitPhase.SINGLE:
            return
        roll, pitch = moment.tilt
        self._values["sole_roll"].append(abs(roll))
        self._values["sole_pitch"].append(abs(pitch))
        if self._middle != progress.steps_done and moment.share >= 0.5:
            self._middle = progress.steps_done
            self._values["contact_area"].append(self._contact_area(stance))

    def _contact_area(self, stance: int) -> float:
        """Return the area of the hull of the contacts of a sole, m²."""
        truth, (centre, rotation) = self._plant.truth(), self._plant.sole_poses[stance]
        mine = (truth.contact_sole == stance) & (truth.contact_force[:, 2] > MIN_FORCE)
        points = (truth.contact_position[mine] - centre) @ rotation
        return hull_and_area(points[:, :2])[1]

    def fall(self, reason: str) -> Fall:
        """Return a fall that has just been detected, with its onset.

        Without DCM errors the onset is the fall itself, and its direction that of the CoM's true velocity, which is
        seen from the pelvis where no stance foot is known: of a policy.
        """
        moments = list(self._moments)
        if not moments:
            unseen = self._walking.progress._replace(elapsed=0.0, stance=0)
            ahead = yaw_rotation(heading(rotation_of(np.array(self._plant.base_pose[3:]))))
            moments = [_Moment(self._plant.time, unseen, ahead, None)]
        onset = moments[-1]
        for moment in reversed(moments):
            if moment.dcm is None or math.hypot(*moment.dcm) < EXCURSION:
                break
            onset = moment
        x, y, _ = self._plant.truth().com_velocity.tolist()
        way = onset.seen(x, y) if onset.dcm is None else onset.dcm
        forward, outward, roll, pitch = (value + 0.0 for value in (*way, *onset.tilt))  # no -0.0
        if reason == "height":
            cause = "dropped"
        elif abs(outward) >= abs(forward):
            cause = "left" if (outward > 0.0) == (onset.progress.stance == 0) else "right"
        else:
            cause = "forward" if forward > 0.0 else "backward"
        return Fall(
            reason=reason,
            time=self._plant.time,
            onset=onset.time,
            step=onset.progress.steps_done + 1,
            phase=onset.progress.phase.value,
            share=onset.share,
            dcm_forward=None if onset.dcm is None else forward,
            dcm_outward=None if onset.dcm is None else outward,
            cause=cause,
            sole_roll=roll,
            sole_pitch=pitch,
        )

    def figures(self) -> dict[str, Any]:
        """Return the fields of a `WalkResult` that are measured here."""
        work, legs = self.work, self._plant.robot.leg_joints
        worst = int(np.argmax(self._peak))
        count = self._events
        return {
            **{name: spread(values) for name, values in self._values.items()},
            "dcm_error_max": max(self._values["dcm_error"], default=None),
            "peak_torque_ratio": float(self._peak[worst]),
            "peak_torque_joint": self._plant.robot.joint_names[worst],
            "speed": self._speed(),
            "energy": Energy(float(work[legs].sum()), float(np.delete(work, legs).sum())),
            "vibration": float(vibration(self._velocities, self._sample).sum()),
            "slip": self._slip,
            "touchdowns": Touchdowns(
                early=count[Event.EARLY_TOUCH_DOWN],
                on_time=count[Event.TOUCH_DOWN],
                late=count[Event.LATE_TOUCH_DOWN],
                missed=count[Event.NO_TOUCH_DOWN],
                forced_lift_offs=count[Event.FORCED_LIFT_OFF],
            ),
            "impact": None if self._impact is None else self._impact / (self._plant.robot.mass * GRAVITY),
        }

    def _speed(self) -> float | None:
        """Return the mean speed over the middle half of the way from the start, m/s; None for hardly any way."""
        ways = np.linalg.norm(np.subtract(self._places, self._places[:1]).reshape(-1, 2), axis=1)
        if not (ways.size and ways[-1] >= LEAST_WAY):
            return None
        first, last = (int(np.argmax(ways >= share * ways[-1])) for share in (0.25, 0.75))
        return float((ways[last] - ways[first]) / ((last - first) * self._sample))


def spread(values: list[float]) -> Spread:
    """Return mean and standard deviation."""
    if not values:
        return Spread(None, None)
    array = np.array(values)
    return Spread(float(array.mean()), float(array.std()))


class StiffnessMeter(TrialHook):
    """Comparison of each scan with the true ground when its step is decided, and the record of all steps.

    A scan is made with estimated poses, and the estimate drifts along a walk. Its shape, which decides the stiffness,
    is compared with the ground under the true pose of the foot.
    """

    def __init__(self, plant: Plant, walking: WalkingControl) -> None:
        """Begin without any step; the controller has a `StiffnessScheduler`."""
        assert walking.stiffness is not None
        self._plant, self._walking, self._task = plant, walking, walking.stiffness
        self._soles = [sole.frame for sole in walking.controller.robot.soles]
        self._last: StepStiffness | None = None
        self._errors: dict[int, dict[str, float]] = {}
        self._times: list[float] = []

    def tick(self, tick: TrialTick) -> None:
        """Record a tick, before the plant moves on."""
        del tick
        decided = self._task.decided
        if decided is None or decided is self._last:
            return
        self._last = decided
        self._times.append(1e6 * decided.computing)
        if decided.profile is not None:
            self._errors[decided.step] = self._error(SIDES.index(decided.side), decided.profile)

    def _error(self, side: int, profile: Profile) -> dict[str, float]:
        """Return mean and 95th percentile of |scanned minus true heights|, without their mean, m."""
        estimate = self._walking.drives.observer.robot.placement(self._soles[side])
        data, site = self._plant.data, self._plant.sole_sites[side]
        rotation = data.site_xmat[site].reshape(3, 3) @ estimate.rotation.T
        there = data.site_xpos[site] + (profile.points - estimate.translation) @ rotation.T
        shape = there[:, 2] - self._plant.terrain.height(there[:, 0], there[:, 1])
        size = np.abs(shape - shape.mean())
        return {"mean": float(size.mean()), "p95": float(np.percentile(size, 95))}

    def steps(self) -> list[dict[str, Any]]:
        """Return the record of each swing, as plain values that follow from the spec."""
        result = []
        for step in self._task.steps:
            entry = step.as_dict()
            del entry["decision_us"]  # a wall-clock time
            result.append(entry | {"profile_error_m": self._errors.get(step.step)})
        return result

    def decision_us(self) -> dict[str, float] | None:
        """Return the computing time of profile and policy, µs: median and maximum; None without a decision."""
        if not self._times:
            return None
        return {"median": float(np.median(self._times)), "max": max(self._times)}
