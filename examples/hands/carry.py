"""Carry: a load of unknown mass is put into both hands or on the chest, found, carried for some steps, and dropped.

python examples/hands/carry.py --share 0.2 --steps 4 --view
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _arms import arms_forward
from _hands import HandTrial, hand_options

import wbc
from wbc.walking import LoadSettings

ENDS = ("drop", "back", "keep")


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    loads = {"share": 0.15, "hold": ("hands", "chest"), "forward": 0.35, "over": 1.0, "overs": 1}
    options = hand_options(__doc__, arguments, steps=2, end=ENDS, known=("yes", "no"), **loads)
    robot = wbc.load_robot(options.robot).robot()
    standing, chest, mass = float(robot.com[2]), options.hold == "chest", options.share * robot.mass
    posture = robot.half_sitting if chest else arms_forward(robot, options.forward, options.share)
    robot.update(posture, np.zeros(robot.nv))
    frames = (robot.torso_frame,) if chest else tuple(robot.frames.values())
    at = np.zeros(3)  # the load, in each frame
    if chest:
        torso = robot.placement(robot.torso_frame)
        at = torso.actInv(np.array([options.forward, 0.0, torso.translation[2] + 0.2]))
    looks = LoadSettings(hands=("torso",) if chest else ()) if options.known == "yes" else None
    height = (
        standing if robot.name == "g1" and not chest else None
    )  # its raised arms take it too high for a step
    trial = HandTrial(options, posture=posture, com_height=height, load=looks)
    plant, walking, load, truth = trial.plant, trial.walking, trial.walking.load, trial.plant.robot
    errors = np.zeros(2)  # of mass, as a share of it, and of place, m

    def put(kilograms: float, over: float = options.over, rest: float = 3.0) -> None:
        """Put a load there within a time, s, wait, and judge what is found."""
        for frame in frames:
            plant.load(frame, kilograms / len(frames), over=over, at=at)
        trial.go(over + rest)
        if kilograms and load is not None:
            truth.update(plant.truth().q, np.zeros(truth.nv))
            true, middle = (
                np.mean([truth.placement(frame).act(point) for frame in frames], axis=0)
                for point in (at, np.zeros(3))
            )
            off = (load.place - load.middle - true + middle)[:2]
            np.maximum(errors, [abs(load.mass / kilograms - 1.0), np.hypot(*off)], out=errors)

    with trial.stages("empty hands"):
        trial.go(2.0)  # what the sensors show now is no load
        for again in range(options.overs):
            trial.stage = f"hand-over {again + 1}"
            if again:
                put(0.0)
            put(mass)
        if options.steps:
            trial.stage, walking.velocity = "steps", (0.1, 0.0, 0.0)
            trial.wait(lambda: walking.steps_done >= options.steps - 1, 2.0 * options.steps + 5.0)
            walking.velocity = None  # one more step closes up
            trial.go(4.0)
        trial.stage = options.end
        if options.end != "keep":
            put(0.0, over=0.0 if options.end == "drop" else options.over, rest=4.0)

    return trial.report(
        load_kg=mass,
        mass_error=float(errors[0]),
        place_error_mm=1e3 * float(errors[1]),
        steps=walking.steps_done,
        at_the_end_kg=0.0 if load is None else load.mass,
    )


if __name__ == "__main__":
    main()
