"""Checks by name, in the order of the report: the ratios of a good loop, and the probable causes of a wrong one."""

RATIOS = {
    "joint motion": (0.3, 2.5),
    "joint velocity": (0.6, 1.4),
    "torque": (0.5, 2.0),
    "velocity reference": (0.4, 2.5),
    "measured torque": (0.5, 1.5),
    "gyroscope": (0.5, 1.6),
    "IMU frame": (0.5, 1.6),
    "weight": (0.92, 1.08),
    "wrench frame": (0.25, 2.5),
    "commanded gains": (0.2, 0.8),
    "clock": (0.95, 1.05),
}
"""Check → range of the ratio of what is measured to what is asked for or to what the model says, in which it is right;
half the gains are commanded. The ratio is 1, or 0.5, in a loop without friction, noise and delay: a wrong unit is
farther off than the ends."""

CAUSES = {
    "shapes": {
        "shape": "joints, soles or hands that the description has not or the machine has not; first tick fails",
    },
    "rest": {
        "buzzes": (
            "a drive buzzes: its damping is too strong for its period or delay, or for a joint without rotor "
            "inertia, as of a servo that a loop computes explicitly at each physics step; or its velocity has the "
            "reversed sign"
        ),
    },
    "joint order": {
        "swapped": "joints in another order than `joint_names`: the wrong limb moves, the QP tears the robot apart",
        "torque_alone": (
            "joint_position is ignored, as by drives of torque alone, or the servos are far too soft: torque "
            "control alone works; the others and these checks need kp (q_ref - q) + kd (q̇_ref - q̇) + τ"
        ),
        "dead": "the command does not reach the drives, these are off or too soft, or the encoder is frozen",
    },
    "joint motion": {
        "reversed": "axis the other way round than in the model: feedback drives the joint away, at once",
        "degrees": "positions in degrees: joints seem to be far away from where they are",
        "unit": (
            "positions in the motor's side of the gear, or another unit: joints seem to be far away from where "
            "they are"
        ),
    },
    "joint velocity": {
        "reversed": "velocities with reversed sign: the joints buzz",
        "still": "velocities are zero or frozen: the joints buzz",
        "degrees": "velocities in degrees per second: damping is too strong",
        "unit": "velocities in another unit than the positions: the joints buzz",
    },
    "fresh": {
        "repeats": "sensors are read less often than the control period: velocities jump, damping is late",
    },
    "delay": {
        "late": "a delay that was not stated, or soft drives: oscillations of 5 to 15 Hz, falls",
    },
    "joint zero": {
        "moves": (
            "the robot was not at half-sitting, references reach other joints or have another unit or zero than "
            "the encoders, or the drives are too soft to stand: it jumps when it is switched on"
        ),
        "off": "zero of an encoder elsewhere than in the model, or a robot that was not at half-sitting: it leans",
    },
    "torque": {
        "reversed": "feed-forward torque with the reversed sign: it doubles the sag in place of removing it",
        "ignored": "feed-forward torque is ignored: position drives sag, torque control does not exist",
        "gains": "the drives have other gains than the description, or torque has another unit",
    },
    "velocity reference": {
        "reversed": "velocity reference with the reversed sign",
        "ignored": "velocity references are ignored or damped with another gain: references are followed late",
    },
    "measured torque": {
        "reversed": "measured torque with the reversed sign: it must be the drive's on the joint, not the load's",
        "unit": "measured torque in another unit: motor side of the gear, current, or fraction of the limit",
    },
    "accelerometer": {
        "in_g": "the accelerometer is in units of g",
        "without_gravity": "gravity has been removed: send acceleration minus gravity, +9.81 m/s² upwards at rest",
        "reversed": "the accelerometer has the reversed sign: estimates turn upside down",
        "unit": "another unit than m/s²",
    },
    "gyroscope": {
        "still": "the gyroscope does not turn: frozen, or not of this body",
        "degrees": "the gyroscope is in degrees per second: the attitude estimate spins",
        "unit": "another unit than rad/s",
    },
    "IMU frame": {
        "other_frames": "accelerometer in another frame than the gyroscope: tilt grows",
        "reversed": "the gyroscope has the reversed sign: the attitude runs away",
        "gyroscope_turned": "the gyroscope is in another frame, or its axes are swapped",
        "turned": "the IMU is turned against the description: tilt grows in the wrong plane",
    },
    "weight": {
        "reversed": "the wrench is that of the foot on the ground: the robot seems to fly",
        "unit": "another unit, offsets, or a robot of another mass",
    },
    "sides": {
        "swapped": "left and right wrench are swapped: walks step into the air",
    },
    "wrench frame": {
        "reversed": "moments have the reversed sign: the ankles push the wrong way",
        "elsewhere": (
            "moments are about another point than the sole centre, or in another frame or unit: the robot leans"
        ),
    },
    "soles": {
        "uneven": "zeros of leg encoders, or legs of another length than in the description: one foot is light",
    },
    "commanded gains": {
        "ignored": (
            "gains of a command without effect, or in another unit; robots fall in hybrid control, machines are "
            "switched on and off with full stiffness"
        ),
    },
    "clock": {
        "still": "the time stamp stands still or runs backwards",
        "milliseconds": "time stamps in milliseconds",
        "rate": "the loop does not run at the rate that it states",
        "jitter": "time stamps jitter: those of the arrival, or samples are lost",
    },
}
"""Check → causes by their keys in `Session.check`, each with its symptom in a controller."""
