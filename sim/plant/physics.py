"""Settings of MuJoCo's physics, each with the source of its value."""

from __future__ import annotations

from typing import Annotated

import mujoco
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.settings import LONGEST_PERIOD, SHORTEST_PERIOD, Positive, settings
from wbc.core.robot import GRAVITY


@settings
class PhysicsSettings:
    """Settings of MuJoCo's integrator and contact solver.

    The integrator is `discrete`. It solves the contacts in the same metric in which it integrates the stiffness of
    servos and soles. Soft feet are therefore quiet at a step of 1 ms, while with the other integrators their forces
    chatter by hundreds of newtons. The solver is Newton, with elliptic cones and a sparse Jacobian. A dense Jacobian
    gives the same motion to 1e-12, but takes 2.2 times as long on soft feet. (MuJoCo 4.0.0 has a wrong sparse
    factorisation, so this package excludes it.)

    Attributes:
        timestep: Physics step, s; 1 ms is the reference, 2 ms the fast mode.
        iterations: Largest number of solver iterations in a step; 1 is enough at rest, 2 to 3 are used while walking.
        impratio: Friction impedance divided by normal impedance. With 10 a loaded sole hardly creeps: at 4 µm/s instead
            of 104 µm/s under 60 N of shear.
        gravity: Gravity along −z, m/s²; with 0 the robot floats.
        few_contacts: True if a flat rigid sole touches a level floor with only eight of its spheres. Support and
            friction are the same, and a physics step takes nearly half the time.

    Source: measured on soft feet over 60 grounds and stiffnesses with mujoco 4.0 and again 3.17.
    """

    timestep: Annotated[float, Field(ge=SHORTEST_PERIOD, le=LONGEST_PERIOD), "s"] = 0.001
    iterations: Annotated[int, Field(ge=1, le=10_000)] = 20
    impratio: Annotated[Positive, Field(le=1e4)] = 10.0
    gravity: Annotated[float, Field(ge=0.0, le=1000.0), "m/s²"] = GRAVITY
    few_contacts: bool = True

    @checked
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
