"""Carry: a load of unknown mass is put into both hands or on the chest, found, carried for some steps, and dropped.

python examples/hands/carry.py --share 0.2 --steps 4 --view
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _hands import arms_ahead, connect, hand_options, period, report

import wbc
from wbc.walking import FootstepPlan, LoadSettings, WalkingControl, WalkingControlSettings


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    ways = {"hold": ("hands", "chest"), "end": ("drop", "keep")}
    options = hand_options(__doc__, arguments, share=0.15, forward=0.2, over=1.0, overs=1, steps=2, **ways)
    robot, height, at = wbc.load_robot(options.robot).robot(), None, np.zeros(3)
    frames, mass, posture = tuple(robot.frames.values()), options.share * robot.mass, arms_ahead(robot)
    if options.hold == "chest":
        frames, posture, torso = (robot.torso_frame,), robot.half_sitting, robot.placement(robot.torso_frame)
        at = torso.actInv(np.array([options.forward, 0.0, torso.translation[2] + 0.2]))
    elif robot.name == "g1":
        height = float(robot.com[2])  # its raised arms take the CoM too high for a step
    robot.update(posture, np.zeros(robot.nv))
    looks = WalkingControlSettings(mode=options.mode, com_height=height, load=LoadSettings(hands=frames))
    walking = WalkingControl(robot, FootstepPlan.standing(robot), period(options), looks)
    trial = connect(options, walking, None, initial_configuration=posture)
    plant, load, errors = trial.plant, walking.load, np.zeros(2)  # of its mass, and of its place, mm

    def put(kilograms: float, over: float = options.over) -> None:
        for frame in frames:
            plant.load(frame, kilograms / len(frames), over=over, at=at)
        trial.advance(over + 3.0)

    with trial.running(options.hooks()):
        trial.advance(2.0)  # what the sensors show of empty hands is no load
        for trial.stage in ["hand-over"] * options.overs:
            if plant.load_mass:
                put(0.0)
            put(mass)
            off = load.place - load.middle - robot.placement(frames[0]).rotation @ at
            np.maximum(errors, [abs(load.mass / mass - 1.0), 1e3 * np.hypot(*off[:2])], out=errors)
        trial.stage, walking.velocity = "steps", (0.1, 0.0, 0.0)
        trial.until(lambda: walking.steps_done >= options.steps - 1, 2.0 * options.steps + 5.0)
        walking.velocity = None  # one more step closes up
        trial.advance(4.0)
        if options.end == "drop":
            put(0.0, 0.0)
        trial.stage = "done"
    found = {"mass_error": errors[0], "place_error_mm": errors[1], "at_the_end_kg": load.mass}
    return report(trial, options, load_kg=mass, **found, steps=walking.steps_done)


if __name__ == "__main__":
    main()
