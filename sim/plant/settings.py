"""Settings of the physics that every simulation shares, each with the source of its value."""

from __future__ import annotations

import math
from typing import Annotated

import mujoco
from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import LONGEST_PERIOD, NonNegative, Positive, settings
from wbc.core.robot import GRAVITY

SHORTEST_STEP = 1e-6
"""Shortest physics step, s: a hundredth of the reference; a second of simulation then takes minutes."""

LONGEST_DELAY = 0.1
"""Longest delay of measurements and commands, s."""


@settings
class PhysicsSettings:
    """Settings of MuJoCo's integrator and contact solver.

    The integrator is `discrete`: it solves the contacts in the metric in which it integrates servo and sole stiffness,
    so that soft feet are quiet at 1 ms where the other integrators chatter by hundreds of newtons. Solver Newton,
    elliptic cones and a sparse Jacobian go with it: the dense one gives the same motion to 1e-12 in 2.2 times the time
    on soft feet (MuJoCo 4.0.0, whose sparse factorisation is wrong, is excluded by this package).

    Attributes:
        timestep: Physics step, s. 1 ms is the reference, 2 ms the fast mode.
        iterations: Largest number of solver iterations in a step; 1 is enough at rest, 2 to 3 are used while walking.
        impratio: Friction impedance over normal impedance; 10 stops the creep of a loaded sole (4 µm/s against
            104 µm/s under 60 N of shear).
        gravity: Along −z, m/s²; 0 floats.
        few_contacts: Whether a flat rigid sole on a level floor touches it with eight of its spheres instead of all:
            support and friction are the same, and a step is nearly twice as quick.

    Source: measured on soft feet over 60 grounds and stiffnesses with mujoco 4.0 and again 3.17.
    """

    timestep: Annotated[float, Field(ge=SHORTEST_STEP, le=LONGEST_PERIOD), "s"] = 0.001
    iterations: Annotated[int, Field(ge=1, le=10_000)] = 20
    impratio: Annotated[Positive, Field(le=1e4)] = 10.0
    gravity: Annotated[float, Field(ge=0.0, le=1000.0), "m/s²"] = GRAVITY
    few_contacts: bool = True

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Write the settings into a model under construction."""
        option = spec.option
        option.timestep = self.timestep
        option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
        option.impratio = self.impratio
        option.iterations = self.iterations
        option.gravity = [0.0, 0.0, -self.gravity]
        # A reset in the middle of a run would hide that the simulation has diverged.
        option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        # A robot is one island; looking for more costs 8 % of a step.
        option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)


@settings
class Machine:
    """Properties of a simulated machine that its description does not have; all off by default.

    Attributes:
        measurement_delay: Age of every measurement, on top of the latency of each sensor, s; rounded up to whole
            physics steps.
        command_delay: Time from a command to its effect, s; rounded up to whole physics steps.
        force_sensors: False for feet without force sensors: `Measurement.sole_wrench` is None.
        torque_sensors: True for drives that report their torque: `Measurement.joint_torque`.
        hand_sensors: True for force sensors at the wrists: `Measurement.hand_wrenches`; a plant with a scene always has
            them.
        friction: Dry friction of every joint on top of the description's, Nm (or N).
        payload: Mass at the centre of mass of the torso's link which the description does not have, kg.
    """

    measurement_delay: Annotated[float, Field(ge=0.0, le=LONGEST_DELAY), "s"] = 0.0
    command_delay: Annotated[float, Field(ge=0.0, le=LONGEST_DELAY), "s"] = 0.0
    force_sensors: bool = True
    torque_sensors: bool = False
    hand_sensors: bool = False
    friction: Annotated[NonNegative, "Nm"] = 0.0
    payload: Annotated[NonNegative, "kg"] = 0.0


Step = Annotated[float, Field(ge=SHORTEST_STEP, le=LONGEST_PERIOD), "s"]
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
