"""Properties of a simulated machine that its description omits, and its physics steps."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import LONGEST_PERIOD, SHORTEST_PERIOD, NonNegative, settings
from wbc.core.estimation.observer import LONGEST_DELAY

SoleIndex = Annotated[int, Field(ge=0, le=1)]
"""A sole: 0 left, 1 right."""


@settings
class Machine:
    """Properties of a simulated machine that the description of the robot omits; all are off by default.

    Attributes:
        measurement_delay: Age of every measurement, in addition to the latency of each sensor, s; rounded up to whole
            physics steps.
        command_delay: Time from a command to its effect, s; rounded up to whole physics steps.
        force_sensors: False for feet without force sensors: `Measurement.sole_wrench` is None.
        torque_sensors: True for drives that report their torque in `Measurement.joint_torque`.
        hand_sensors: True for force sensors at the wrists, in `Measurement.hand_wrenches`. A plant with a scene always
            has them.
        friction: Dry friction of every joint, in addition to that of the description, Nm (or N).
        payload: Unmodelled mass at the centre of mass of the torso link, kg.
    """

    measurement_delay: Annotated[float, Field(ge=0.0, le=LONGEST_DELAY), "s"] = 0.0
    command_delay: Annotated[float, Field(ge=0.0, le=LONGEST_DELAY), "s"] = 0.0
    force_sensors: bool = True
    torque_sensors: bool = False
    hand_sensors: bool = False
    friction: Annotated[NonNegative, "Nm"] = 0.0
    payload: Annotated[NonNegative, "kg"] = 0.0

    def check_loop(self, loop: str) -> None:
        """Refuse the properties that only a `wbc.Plant` can give a robot, for another loop, named as in a sentence."""
        given = [name for name in ("friction", "payload", "hand_sensors") if getattr(self, name)]
        if given:
            raise InputError(
                f"{' and '.join(given)} of the machine can be set in a wbc.Plant alone: {loop} has the friction and "
                "the masses of its own model, and measures no hands; leave friction, payload and hand_sensors alone"
            )


Step = Annotated[float, Field(ge=SHORTEST_PERIOD, le=LONGEST_PERIOD), "s"]
"""A physics step, or a control period of a simulation."""


def whole_steps(time: float, timestep: float) -> int:
    """Return a time, s, as whole physics steps, rounded up: 3 steps of 0.001 s are 3 steps, not 4."""
    return math.ceil(time / timestep - ROUNDING)


def steps_per_tick(control_period: float, timestep: float) -> int:
    """Return the number of physics steps in a control period, both in s; `InputError` if it is no whole number."""
    ratio = control_period / timestep
    steps = round(ratio)
    if steps < 1 or abs(ratio - steps) > 1e-6 * ratio:
        near = max(1, steps) * timestep
        raise InputError(
            f"control period {control_period:g} s must be a whole multiple of the physics step {timestep:g} s, "
            f"it is {ratio:.6g} times; the nearest is {near:g} s"
        )
    return steps
