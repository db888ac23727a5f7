"""Sources of signals: names, units, meanings and values of all that a run has, in the order of the file.

A new signal is one more line in the function of its object. `Signals.each` describes signals whose values are one
array, `Signals.one` a number, truth value, text or list; the last argument of both reads the value from a `Tick`, None
where there is none. Signals that share an intermediate result read it through `cached`, which computes it once a tick.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pinocchio as pin

from wbc.app.log.signals import (
    WRENCH,
    WRENCH_UNITS,
    XY,
    XYZ,
    Signals,
    Tick,
    TickPart,
    add_motion,
    cached,
    foot_names,
    joint_units,
    torque_units,
)
from wbc.app.log.truth import add_plant, add_truth, dcm_of
from wbc.base.numbers import Array
from wbc.core.drive.position import PositionControl
from wbc.core.frames import net_wrench
from wbc.core.robot import Robot
from wbc.sim.plant.plant import Plant
from wbc.tasks.behaviours import Program
from wbc.tasks.stabilizer.pendulum import NoContactForceError, dcm, level_zmp, natural_frequency
from wbc.walking.contact import LIFT_OFFS
from wbc.walking.control import WalkingControl

if TYPE_CHECKING:
    from wbc.tasks.scheduling.stiffness import StiffnessScheduler
    from wbc.walking.source import Reference

VELOCITY, VELOCITY_UNITS = ("forward", "left", "turn"), ("m/s", "m/s", "rad/s")


def tick_signals(tick: Tick) -> Signals:
    """Return the signals of all objects of a run, from its first tick."""
    signals = Signals()
    signals.one("time", "s", "time stamp of the measurement", lambda t: t.measurement.time, "double")
    signals.one("tick/clock", "s", "wall-clock time of the recording", lambda t: perf_counter(), "double")
    if tick.program is not None:
        _add_program(signals, tick.program)
    if tick.estimate is not None and tick.walking is not None:
        _add_walk(signals, tick)
        if tick.walking.stabilizer is not None:
            _add_stabilizer(signals, tick)
    if tick.estimate is not None:
        _add_estimate(signals, tick)
    if tick.drives is not None and tick.drives.observer.outside is not None:
        _add_outside(signals, tick)
    _add_measurement(signals, tick)
    _add_command(signals, tick)
    if tick.control is not None or tick.solution is not None:
        _add_solver(signals, tick)
    if isinstance(tick.plant, Plant):
        add_plant(signals, tick)
    elif tick.truth is not None:
        add_truth(signals, tick)
    if tick.walking is not None and tick.walking.stiffness is not None:
        _add_stiffness(signals, tick.walking.stiffness)
    return signals


def _add_program(signals: Signals, program: Program) -> None:
    told = [0]

    def events(_: Tick) -> str | None:
        ended, told[0] = program.history[told[0] :], len(program.history)
        return "; ".join(f"{path}: {outcome}" for _, path, outcome in ended) or None

    signals.one("program/state", "1", "path of the state at work", lambda t: program.path, "text")
    about = "states that have ended with their outcomes, separated by ';'"
    signals.one("program/event", "1", about, events, "text")


def _add_walk(signals: Signals, tick: Tick) -> None:
    one, group = signals.one, signals.group
    told: list[Any] = []
    planned = TickPart(lambda t: t.reference)
    of_walk = TickPart(lambda t: None if t.reference is None else t.walking)

    def events(walk: WalkingControl) -> str | None:
        assert walk.reference is not None
        texts = [event.value for event in walk.reference.progress.events]
        if walk.fallen is not None and not told:
            told.append(walk.fallen)
            texts.append(f"fallen: {walk.fallen.value}")
        return "; ".join(texts) or None

    next_step = TickPart(cached(of_walk(lambda w: next(iter(w.progress.upcoming), None))))
    steps = planned(lambda r: r.progress.steps_done)
    one("walk/phase", "1", "phase of the walk", planned(lambda r: r.progress.phase.value), "text")
    one("walk/event", "1", "events of this tick, separated by ';'", of_walk(events), "text")
    one("walk/step", "1", "index of the step that swings, or swings next", steps, "whole")
    one("walk/steps_done", "1", "single supports that have ended", of_walk(lambda w: w.steps_done), "whole")
    one("walk/heading", "rad", "desired heading of pelvis and torso", planned(lambda r: r.progress.heading))
    one("step/side", "1", "foot that swings, or swings next", next_step(lambda s: s.side), "text")
    parts, units = ("x", "y", "z", "yaw"), ("m", "m", "m", "rad")
    landing = next_step(lambda s: (s.x, s.y, s.z, s.yaw))
    group("step/landing", parts, units, "planned landing, world", landing)
    one("pendulum/omega", "1/s", "natural frequency", planned(lambda r: r.pendulum.omega))
    commanded = of_walk(lambda w: w.velocity or None)
    group("drive/commanded", VELOCITY, VELOCITY_UNITS, "commanded velocity; NaN while none is", commanded)
    about = "velocity that the planned footsteps give"
    group("drive/granted", VELOCITY, VELOCITY_UNITS, about, of_walk(lambda w: w.granted_velocity))
    if tick.walking is not None and tick.walking.ground is not None:
        _add_known_ground(signals)
    _add_references(signals, foot_names(tick.robot), planned)


def _add_known_ground(signals: Signals) -> None:
    one = signals.one
    ground = TickPart(lambda t: None if t.walking is None else t.walking.ground)
    about = "what is not used of the ground, and why"
    one("ground/doubt", "1", about, ground(lambda g: g.status or None), "text")
    about = "ground known under the sole that stands, over that sole, at the last lift-off"
    one("ground/difference", "m", about, ground(lambda g: g.difference))
    about = "changes of what is known of the ground"
    one("ground/changes", "1", about, ground(lambda g: g.version), "whole")
    seen = TickPart(cached(_seen))
    for axis, name in enumerate(XYZ):
        about = "known cells at the lift-off of a foot, world"
        one(f"ground/map/{name}", "m", about, seen(lambda p, axis: p[:, axis], axis), "list")


def _add_references(signals: Signals, feet: Sequence[str], planned: TickPart[Reference]) -> None:
    one, group = signals.one, signals.group
    group("com/reference", XYZ, "m", "world", planned(lambda r: r.pendulum.com))
    group("com/reference_velocity", XYZ, "m/s", "world", planned(lambda r: r.pendulum.com_velocity))
    group("com/reference_acceleration", XYZ, "m/s²", "world", planned(lambda r: r.pendulum.com_acceleration))
    group("zmp/reference", XYZ, "m", "world", planned(lambda r: r.pendulum.zmp))
    for i, foot in enumerate(feet):
        contact = planned(lambda r, i: r.progress.contact[i], i)
        one(f"foot/{foot}/contact", "1", "planned contact", contact, "flag")
        pose = planned(lambda r, i: pin.SE3ToXYZQUAT(r.feet[i].placement), i)
        velocity = planned(lambda r, i: r.feet[i].velocity, i)
        add_motion(signals, f"foot/{foot}/reference", "sole", "world", pose, velocity)
    group("dcm/reference", XY, "m", "world", planned(lambda r: r.pendulum.dcm[:2]))
    group("dcm/estimated", XY, "m", "of the estimated CoM, world", lambda t: dcm_of(t, t.estimate))


def _add_stabilizer(signals: Signals, tick: Tick) -> None:
    one, group = signals.one, signals.group
    stabilized = TickPart(lambda t: t.output)
    balanced = TickPart(lambda t: None if t.output is None or t.walking is None else t.walking.balance)
    lean = balanced(lambda b: (0.0, 0.0) if b.lean is None else b.lean.angle)
    group("walk/lean", ("roll", "pitch"), "rad", "of the trunk, about x and y of the world", lean)
    bias = balanced(lambda b: (0.0, 0.0) if b.bias is None else b.bias.bias)
    group("stabilizer/bias", XY, "m", "estimated in the measured DCM and subtracted, world", bias)
    one("stabilizer/in_air", "1", "neither foot has contact", stabilized(lambda o: o.in_air), "flag")
    group("zmp/desired", XYZ, "m", "of the desired net wrench, world", stabilized(lambda o: o.zmp))
    group("stabilizer/dcm_error", XY, "m", "target minus measured, world", stabilized(lambda o: o.errors.dcm))
    group("stabilizer/dcm_error_average", XY, "m", "world", stabilized(lambda o: o.errors.average))
    group("stabilizer/dcm_error_rate", XY, "m/s", "world", stabilized(lambda o: o.errors.rate))
    about = "desired, world"
    group("stabilizer/com_acceleration", XYZ, "m/s²", about, stabilized(lambda o: o.com_acceleration))
    about = "desired, at the world origin"
    group("stabilizer/net_wrench", WRENCH, WRENCH_UNITS, about, stabilized(lambda o: o.net_wrench))
    for i, foot in enumerate(foot_names(tick.robot)):
        desired = stabilized(lambda o, i: o.feet.wrenches[i], i)
        about = "desired by the stabilizer, sole frame"
        group(f"foot/{foot}/wrench_desired", WRENCH, WRENCH_UNITS, about, desired)
        correction = stabilized(lambda o, i: o.corrections[i][:3], i)
        parts, units = ("roll", "pitch", "height"), ("rad", "rad", "m")
        group(f"foot/{foot}/correction", parts, units, "added by the stabilizer", correction)


def _seen(tick: Tick) -> Array | None:
    """Return the known cells of the ground, shape (n, 3), m, in a tick in which a foot lifts off."""
    walk, reference = tick.walking, tick.reference
    if (
        walk is None
        or walk.ground is None
        or reference is None
        or LIFT_OFFS.isdisjoint(reference.progress.events)
    ):
        return None
    return walk.ground.map.known()[0]


def _add_estimate(signals: Signals, tick: Tick) -> None:
    robot = cast(Robot, tick.estimate)
    group, estimated = signals.group, TickPart(lambda t: t.estimate)

    def base(state: TickPart[Any], name: str) -> None:
        add_motion(signals, name, "base", "base frame", state(lambda s: s.q[:7]), state(lambda s: s.v[:6]))

    if robot.base_nq:
        base(estimated, "base/estimated")
    group("com/estimated", XYZ, "m", "world", estimated(lambda r: r.com))
    group("com/estimated_velocity", XYZ, "m/s", "world", estimated(lambda r: r.com_velocity))
    for foot, sole in zip(foot_names(robot), robot.soles, strict=True):
        frame = robot.frame_id(sole.frame)
        pose = estimated(lambda r, frame: pin.SE3ToXYZQUAT(r.data.oMf[frame]), frame)
        add_motion(signals, f"foot/{foot}/estimated", "sole", "world", pose, None)
    if isinstance(tick.drives, PositionControl):
        base(TickPart(lambda t: t.drives), "base/commanded")
    if robot.soles:
        balance = TickPart(cached(_balance))
        own = balance(lambda b: b[0])
        about = "of the measured foot wrenches, world"
        group(
            "zmp/measured", XYZ, "m", about, lambda t: own(t) if t.output is None else t.output.measured_zmp
        )
        if tick.walking is None:
            group("dcm/estimated", XY, "m", "over the lower sole, world", balance(lambda b: b[1]))


def _balance(tick: Tick) -> tuple[Array, Array] | None:
    """Return ZMP of the measured wrenches, NaN without a force, and DCM of the CoM, both over the lower sole."""
    robot = tick.estimate
    if robot is None:
        return None
    soles = [robot.placement(sole.frame) for sole in robot.soles]
    low = min((sole.translation for sole in soles), key=lambda place: float(place[2]))
    point, wrenches = np.full(3, math.nan), tick.measurement.sole_wrench
    if wrenches is not None:
        with contextlib.suppress(NoContactForceError):
            point = level_zmp(net_wrench(wrenches.tolist(), soles), low)
    height = max(float(robot.com[2] - low[2]), 1e-3)  # of a robot that lies
    return point, dcm(robot.com[:2], robot.com_velocity[:2], natural_frequency(height))


def _add_outside(signals: Signals, tick: Tick) -> None:
    outside = TickPart[Any](lambda t: t.drives)(lambda d: d.observer.outside.wrench)
    about = (
        "of the surroundings besides the ground, without the load that the models carry; about the CoM, world"
    )
    signals.group("outside/wrench", WRENCH, WRENCH_UNITS, about, outside)
    if tick.walking is not None and tick.walking.load is not None:
        load = TickPart[Any](lambda t: None if t.walking is None else t.walking.load)
        signals.one("load/mass", "kg", "as estimated", load(lambda m: m.mass))
        signals.group("load/place", XYZ, "m", "as estimated, world", load(lambda m: m.place))


def _add_measurement(signals: Signals, tick: Tick) -> None:
    group, robot, first = signals.group, tick.robot, tick.measurement
    joints, units, feet = robot.joint_names, joint_units(robot), foot_names(robot)

    def measured(name: str, parts: Sequence[str], units: str | Sequence[str], about: str, field: str) -> None:
        group(name, parts, units, about, lambda t: getattr(t.measurement, field))

    measured("joint/position", joints, units, "encoder", "joint_position")
    rates = [f"{unit}/s" for unit in units]
    measured("joint/velocity", joints, rates, "velocity from the drive", "joint_velocity")
    measured("imu/angular_velocity", XYZ, "rad/s", "gyroscope, IMU frame", "angular_velocity")
    about = "accelerometer: acceleration minus gravity, IMU frame"
    measured("imu/specific_force", XYZ, "m/s²", about, "specific_force")
    about = "of the ground on the sole, sole frame"
    _add_wrenches(signals, "foot", feet, about, lambda t: t.measurement.sole_wrench)
    if len(first.sole_range) == len(feet):  # that of a robot with other than two is a default
        about = "range sensor under the toe; NaN without an echo"
        signals.each([f"foot/{foot}/range" for foot in feet], "m", about, lambda t: t.measurement.sole_range)
    if len(first.sole_stiffness) == len(feet):
        names = [f"foot/{foot}/stiffness" for foot in feet]
        signals.each(names, "Nm/rad", "actual, of the sole", lambda t: t.measurement.sole_stiffness)
    if first.joint_torque is not None:
        measured("joint/torque_measured", joints, torque_units(robot), "of the drive", "joint_torque")
    if first.hand_wrenches is not None:
        count = len(first.hand_wrenches)
        hands = list(robot.frames) if len(robot.frames) == count else range(count)
        about = "on the hand, less its own weight, frame of the hand"
        _add_wrenches(signals, "hand", hands, about, lambda t: t.measurement.hand_wrenches)


def _add_wrenches(
    signals: Signals, kind: str, names: Sequence[object], about: str, read: Callable[[Tick], Array | None]
) -> None:
    parts = [f"{kind}/{name}/wrench_measured/{axis}" for name in names for axis in WRENCH]
    flat = TickPart(read)(lambda wrenches: wrenches.ravel())
    signals.each(parts, WRENCH_UNITS * len(names), about, flat)


def _add_command(signals: Signals, tick: Tick) -> None:
    robot, first = tick.robot, tick.command
    joints, units, torques = robot.joint_names, joint_units(robot), torque_units(robot)
    rates = [f"{unit}/s" for unit in units]
    group = signals.group
    group("joint/position_reference", joints, units, "of the servo", lambda t: t.command.joint_position)
    group("joint/velocity_reference", joints, rates, "of the servo", lambda t: t.command.joint_velocity)
    about = "torque, or feed-forward of the servo"
    group("joint/torque_command", joints, torques, about, lambda t: t.command.joint_torque)
    if first.kp is not None or first.kd is not None:
        per_angle = [f"{torque}/{unit}" for torque, unit in zip(torques, units, strict=True)]
        per_speed = [f"{torque}s/{unit}" for torque, unit in zip(torques, units, strict=True)]
        group("joint/kp_command", joints, per_angle, "gain of the servo", lambda t: t.command.kp)
        group("joint/kd_command", joints, per_speed, "gain of the servo", lambda t: t.command.kd)
    names = [f"foot/{foot}/stiffness_command" for foot in foot_names(robot)]
    signals.each(names, "Nm/rad", "commanded, of the sole", lambda t: t.command.sole_stiffness)


def _add_solver(signals: Signals, tick: Tick) -> None:
    """Describe status, residuals, active limits and timings of the QP, with the tasks and contacts of the first tick.

    One that is taken out later has NaN from then on.
    """
    one = signals.one
    solved = TickPart(lambda t: t.solution)
    one("solver/status", "1", "status of the QP", solved(lambda s: s.status.value), "text")
    one("solver/iterations", "1", "outer iterations", solved(lambda s: s.iterations), "whole")
    about = "failed ticks so far"
    one("solver/failures", "1", about, lambda t: 0 if t.drives is None else t.drives.failures, "whole")
    parts, about = ("model", "assembly", "solve", "decode"), "wall time of a part of the controller's tick"
    signals.group("tick", parts, "s", about, solved(lambda s: s.timings))
    if tick.solution is None:
        return
    layout = tick.solution.layout
    feet = dict(zip((s.name for s in tick.robot.soles), foot_names(tick.robot), strict=True))
    for name, variables in layout.contacts.items():
        size = variables.stop - variables.start
        where = f"foot/{feet[name]}" if name in feet else f"contact/{name}"
        about = "solution of the QP, frame of the contact"
        wrench = solved(lambda s, name: _part(s.variables, s.layout.contacts.get(name)), name)
        signals.group(f"{where}/wrench_solved", WRENCH[:size], WRENCH_UNITS[:size], about, wrench)
    for name in layout.tasks:
        about = "norm of achieved minus desired acceleration, torque or wrench"
        rows = TickPart(solved(lambda s, name: _part(s.residual_rows, s.layout.tasks.get(name)), name))
        norm = rows(lambda values: math.sqrt(values.dot(values)))
        one(f"solver/residual/{name}", layout.units[name], about, norm)
    limits = solved(lambda s: "; ".join(s.active_limits) or None)
    one("solver/active_limits", "1", "active limits, separated by ';'", limits, "text")


def _part(values: Array, place: slice | None) -> Array | None:
    """Return a part of the values of a solution; None where it has none."""
    return None if place is None else values[place]


def _add_stiffness(signals: Signals, task: StiffnessScheduler) -> None:
    last: list[Any] = [task.steps[-1] if task.steps else None]

    def find(_: Tick) -> Any:
        if not task.steps or task.steps[-1] is last[0]:
            return None
        last[0] = task.steps[-1]
        return last[0]

    step = TickPart(landed := cached(find))
    scan = TickPart(lambda t: None if (done := landed(t)) is None else done.profile)
    decision = TickPart(lambda t: None if (done := landed(t)) is None else done.decision)

    one = signals.one
    one("stiffness/side", "1", "foot that landed", step(lambda s: s.side), "text")
    signals.group(
        "stiffness",
        ("commanded", "actual", "wanted", "time_before_landing", "computing"),
        ("Nm/rad", "Nm/rad", "Nm/rad", "s", "s"),
        "at the landing; time_before_landing and computing belong to the decision",
        step(lambda s: (s.commanded, s.actual, s.requested, s.decided_before, s.computing)),
    )
    one("stiffness/cluster", "1", "cluster chosen by the policy", decision(lambda d: d.cluster), "whole")
    one("stiffness/fallback", "1", "reason for the fallback stiffness", step(lambda s: s.fallback), "text")
    features = decision(lambda d: json.dumps(dict(d.features)))
    one("stiffness/features", "1", "features of the decision, as JSON", features, "text")
    about = "profile: distance along the walking direction from the world origin"
    one("stiffness/scan/x", "m", about, scan(lambda p: p.x), "list")
    one("stiffness/scan/z", "m", "profile: height in the world", scan(lambda p: p.z), "list")
    one("stiffness/scan/lateral", "m", "profile: to the left of that line", scan(lambda p: p.lateral), "list")
    heading = scan(lambda p: math.atan2(p.forward[1], p.forward[0]))
    one("stiffness/scan/heading", "rad", "walking direction of the profile", heading)
