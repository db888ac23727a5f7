"""Checks by name, in the order of the report, and the probable causes of a wrong one, each with its symptom."""

CAUSES = {
    "shapes": (
        "joints, soles or hands that the description has not or the machine has not; first tick fails",
    ),
    "rest": (
        "a drive buzzes: its damping is too strong for its period or delay, or for a joint without rotor inertia, "
        "as of a servo that a loop computes explicitly at each physics step; or its velocity has the reversed sign",
    ),
    "joint order": (
        "joints in another order than `joint_names`: the wrong limb moves, the QP tears the robot apart",
        "joint_position is ignored, as by drives of torque alone, or the servos are far too soft: torque control alone "
        "works; the others and these checks need kp (q_ref - q) + kd (q̇_ref - q̇) + τ",
        "the command does not reach the drives, these are off or too soft, or the encoder is frozen",
    ),
    "joint motion": (
        "axis the other way round than in the model: feedback drives the joint away, at once",
        "positions in degrees: joints seem to be far away from where they are",
        "positions in the motor's side of the gear, or another unit: joints seem to be far away from where they are",
    ),
    "joint velocity": (
        "velocities with reversed sign: the joints buzz",
        "velocities are zero or frozen: the joints buzz",
        "velocities in degrees per second: damping is too strong",
        "velocities in another unit than the positions: the joints buzz",
    ),
    "fresh": ("sensors are read less often than the control period: velocities jump, damping is late",),
    "delay": ("a delay that was not stated, or soft drives: oscillations of 5 to 15 Hz, falls",),
    "joint zero": (
        "the robot was not at half-sitting, references reach other joints or have another unit or zero than the "
        "encoders, or the drives are too soft to stand: it jumps when it is switched on",
        "zero of an encoder elsewhere than in the model, or a robot that was not at half-sitting: it leans",
    ),
    "torque": (
        "feed-forward torque with the reversed sign: it doubles the sag in place of removing it",
        "feed-forward torque is ignored: position drives sag, torque control does not exist",
        "the drives have other gains than the description, or torque has another unit",
    ),
    "velocity reference": (
        "velocity reference with the reversed sign",
        "velocity references are ignored or damped with another gain: references are followed late",
    ),
    "measured torque": (
        "measured torque with the reversed sign: it must be the drive's on the joint, not the load's",
        "measured torque in another unit: motor side of the gear, current, or fraction of the limit",
    ),
    "accelerometer": (
        "the accelerometer is in units of g",
        "gravity has been removed: send acceleration minus gravity, +9.81 m/s² upwards at rest",
        "the accelerometer has the reversed sign: estimates turn upside down",
        "another unit than m/s²",
    ),
    "gyroscope": (
        "the gyroscope does not turn: frozen, or not of this body",
        "the gyroscope is in degrees per second: the attitude estimate spins",
        "another unit than rad/s",
    ),
    "IMU frame": (
        "accelerometer in another frame than the gyroscope: tilt grows",
        "the gyroscope has the reversed sign: the attitude runs away",
        "the gyroscope is in another frame, or its axes are swapped",
        "the IMU is turned against the description: tilt grows in the wrong plane",
    ),
    "weight": (
        "the wrench is that of the foot on the ground: the robot seems to fly",
        "another unit, offsets, or a robot of another mass",
    ),
    "sides": ("left and right wrench are swapped: walks step into the air",),
    "wrench frame": (
        "moments have the reversed sign: the ankles push the wrong way",
        "moments are about another point than the sole centre, or in another frame or unit: the robot leans",
    ),
    "soles": ("zeros of leg encoders, or legs of another length than in the description: one foot is light",),
    "commanded gains": (
        "gains of a command without effect, or in another unit; robots fall in hybrid control, machines are switched "
        "on and off with full stiffness",
    ),
    "clock": (
        "the time stamp stands still or runs backwards",
        "time stamps in milliseconds",
        "the loop does not run at the rate that it states",
        "time stamps jitter: those of the arrival, or samples are lost",
    ),
}
