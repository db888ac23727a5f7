"""Table of the checks: the figures that are shown, and what is wrong, with its probable cause and its symptom."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

from wbc.core.robot import GRAVITY

UNIT = 57.2958
"""Degrees in a radian."""


def tilts(f: SimpleNamespace) -> bool:
    """Return True if gravity is where it should be, upright and tilted."""
    return f.along > 0.97 and 0.5 < f.tilts < 1.6  # type: ignore[no-any-return]


Rule = tuple[str, tuple[tuple[Callable[[SimpleNamespace], bool], str], ...]]

# fmt: off
RULES: dict[str, Rule] = {
    "shapes": ("{found}", (
        (lambda f: f.wrong,
         "joints, soles or hands that the description has not or the machine has not; first tick fails"),
    )),
    "hold": ("{moved:.1f} mrad in a period, {rate:.3f} rad/s", (
        (lambda f: f.moved >= 20.0 or f.rate >= 0.15,
         "the robot was not at half-sitting, references reach other joints or have another unit or zero than the "
         "encoders, or the drives are too soft to stand: it jumps when it is switched on"),
    )),
    "joint order": ("{found}", (
        (lambda f: f.state == "torque alone",
         "joint_position is ignored, as by drives of torque alone, or the servos are far too soft: torque control "
         "alone works; the others and these checks need kp (q_ref - q) + kd (q̇_ref - q̇) + τ"),
        (lambda f: f.state == "swapped",
         "joints in another order than `joint_names`: the wrong limb moves, the QP tears the robot apart"),
        (lambda f: f.state == "dead",
         "the command does not reach the drives, these are off or too soft, or the encoder is frozen"),
    )),
    "joint sign": ("{found}", (
        (lambda f: f.turned, "axis the other way round than in the model: feedback drives the joint away, at once"),
    )),
    "joint unit": ("{size:.2f} of the step{odd}", (
        (lambda f: f.odd and abs(f.size / UNIT - 1.0) < 0.15,
         "positions in degrees: joints seem to be far away from where they are"),
        (lambda f: f.odd, "positions in the motor's side of the gear, or another unit: joints seem to be far away from "
         "where they are"),
    )),
    "joint velocity": ("∫q̇ dt is {ratio:.2f} of the way", (
        (lambda f: f.bad, "velocities with {what}{few}: damping is weak, strong or negative, the joints buzz"),
    )),
    "fresh": ("{stuck:.0f} % of moving samples repeat the last one", (
        (lambda f: f.stuck >= 25.0,
         "sensors are read less often than the control period: velocities jump, damping is late"),
    )),
    "delay": ("{lag:.1f} ms behind the references{torque}", (
        (lambda f: f.torque and f.time > f.allowed,
         "about {time:.0f} ms of delay that were not stated: oscillations of 5 to 15 Hz, falls"),
        (lambda f: f.time > f.allowed, "about {time:.0f} ms of delay or soft drives: oscillations of 5 to 15 Hz"),
    )),
    "joint zero": ("{joint} {off:+.0f} mrad from half-sitting", (
        (lambda f: abs(f.off) >= 50.0 or f.outside,
         "zero of an encoder elsewhere than in the model, or a robot that was not at half-sitting: it leans"),
    )),
    "torque": ("τ = kp Δq to {share:.2f}", (
        (lambda f: f.share < -0.05,
         "feed-forward torque with the reversed sign: it doubles the sag in place of removing it"),
        (lambda f: not f.share > 0.05,
         "feed-forward torque is ignored: position drives sag, torque control does not exist"),
    )),
    "gains": ("kp is {inverse:.2f} of the description's", (
        (lambda f: not 0.5 < f.share < 2.0,
         "the drives have other gains than the description (kp about {inverse:.2g} times as large), or torque has "
         "another unit"),
    )),
    "velocity reference": ("kd q̇_ref = kp Δq to {drag:.2f}", (
        (lambda f: f.drag < -0.1, "velocity reference with the reversed sign"),
        (lambda f: not 0.4 < f.drag < 2.5,
         "velocity references are ignored or damped with another gain: references are followed late"),
    )),
    "measured torque": ("{slope:.2f} of the weight that the joints carry", (
        (lambda f: f.slope < -0.2,
         "measured torque with the reversed sign: it must be the drive's on the joint, not the load's"),
        (lambda f: not 0.5 < f.slope < 1.5,
         "measured torque in another unit: motor side of the gear, current, or fraction of the limit"),
    )),
    "accelerometer": ("{size:.2f} m/s² at rest", (
        (lambda f: abs(f.size - 1.0) < 0.2, "the accelerometer is in units of g"),
        (lambda f: f.size < 2.0,
         "gravity has been removed: send acceleration minus gravity, +9.81 m/s² upwards at rest"),
        (lambda f: f.along <= -0.7,
         "the accelerometer has the reversed sign: +9.81 m/s² upwards at rest; estimates turn upside down"),
        (lambda f: abs(f.size - GRAVITY) >= 0.5, "another unit than m/s²"),
    )),
    "gyroscope": ("{size:.2f} of the turns made", (
        (lambda f: f.size < 0.2, "the gyroscope does not turn: frozen, or not of this body"),
        (lambda f: abs(f.size / UNIT - 1.0) < 0.5,
         "the gyroscope is in degrees per second: the attitude estimate spins"),
        (lambda f: not 0.5 < f.size < 1.6, "another unit than rad/s"),
    )),
    "IMU frame": ("turns agree to {turns:.2f}, tilts to {tilts:.2f}", (
        (lambda f: f.turns > 0.85 and not tilts(f),
         "the accelerometer is in another frame than the gyroscope: tilt grows the wrong way"),
        (lambda f: f.turns < -0.5,
         "the gyroscope has the reversed sign (IMU against world, in the IMU frame): the attitude runs away"),
        (lambda f: f.turns <= 0.85 and tilts(f),
         "the gyroscope is in another frame than the accelerometer (swapped axes, the body's or the world's)"),
        (lambda f: f.turns <= 0.85,
         "the IMU is turned by {angle:.0f}° against the description: tilt grows in the wrong plane"),
    )),
    "IMU frame, hanging": ("{along:.3f} along the vertical", ((lambda f: f.along <= 0.95, "turned IMU"),)),
    "weight": ("normal forces are {share:.2f} of the weight", (
        (lambda f: f.share < -0.5,
         "the wrench is that of the foot on the ground, it must be the ground's on the foot: the robot seems to fly"),
        (lambda f: abs(f.share - 1.0) >= 0.08 or f.least <= -0.05,
         "another unit, offsets that were not removed, or a robot of another mass than the description"),
    )),
    "sides": ("load moves by {load:+.0f} % to the left", (
        (lambda f: not f.load > 0.0, "left and right wrench are swapped: walks step into the air"),
    )),
    "wrench frame": (
        "pressure moves {forward:.2f} and {sideways:.2f} of the way; it is {ahead:+.0f}, {aside:+.0f} mm from the "
        "centre of mass{edge}", (
        (lambda f: f.forward < -0.2,
         "moments have the reversed sign, or the sensor's x axis points backwards: the ankles push the wrong way"),
        (lambda f: not 0.25 < f.forward < 2.5 or not f.rolling < 2.5 or not f.off < 15.0 or not f.beyond < 20.0,
         "moments are about another point than the sole centre (the sensor's or the ankle's), or in another frame or "
         "unit: the robot leans, the feet tilt"),
    )),
    "soles": ("{height:+.1f} mm apart in height, {tilt:.1f}° of tilt", (
        (lambda f: abs(f.height) >= 6.0 or f.tilt >= 2.0,
         "zeros of leg encoders, or legs of another length than in the description: one foot is light"),
    )),
    "commanded gains": ("commanded halves: kp acts with {kp:.2f}, kd with {kd:.2f} of the machine's own", (
        (lambda f: f.bad, "{bad} of a command: without effect, or in another unit; robots fall in hybrid control, "
         "machines are switched on and off with full stiffness"),
    )),
    "clock": ("period {mean:.3f} ms, worst {worst:.3f} ms off", (
        (lambda f: f.least < 0.0 or f.mean <= 0.0, "the time stamp stands still or runs backwards"),
        (lambda f: abs(f.ratio - 1000.0) < 100.0, "time stamps in milliseconds"),
        (lambda f: not 0.95 < f.ratio < 1.05,
         "the loop runs at {rate:.0f} Hz and not at the {stated:.0f} Hz that it states"),
        (lambda f: f.worst >= 0.5 * f.period, "time stamps jitter: those of the arrival, or samples are lost"),
    )),
}
"""Name → figures as shown, a format; conditions of a loop that is wrong, and the cause of the first that holds."""
