"""Settings of a walk, gathered from its parts: all but its footsteps."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated

from wbc.base.settings import Positive, settings
from wbc.core.drive.control import Mode
from wbc.core.drive.sensing import SafetySettings
from wbc.core.qp.solving.solver import SolverSettings
from wbc.tasks.stabilizer.bias import BiasSettings
from wbc.tasks.stabilizer.distribution import DistributionSettings
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.lean import LeanSettings
from wbc.walking.hands.arm import ArmSettings
from wbc.walking.hands.hand import HandSettings
from wbc.walking.lipm.settings import WalkSettings
from wbc.walking.load import LoadSettings
from wbc.walking.plans.sources import DriveSettings
from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.table import TaskGains


@settings
class WalkingControlSettings:
    """Settings of a walk, without its footsteps.

    Settings that users often change come first; the others are weights, gains and limits of the parts.

    Attributes:
        mode: Kind of drive commands. "position": servos follow an integrated motion. "torque": torques. "hybrid":
            torques, and the motion that they should produce, which soft servos of the machine follow.
        com_height: Height of the CoM over the support during the walk, m. When None, it is the height at the start, or
            in free steps the height by `stepping.bend`.
        drive: Limits of steering in planned steps, those of position control.
        stepping: Settings of free steps, those of torque and hybrid control: width, time, height and velocities.
        arms: Settings of hands with targets, and of swinging arms.
        hands: Settings of hands that press on objects or grip them.
        load: Settings of the estimate of a load of unknown mass in the hands, which the models then carry; None for
            empty hands.
        walk: Settings of planned steps: phases, pattern, step adjustment.
        gains: Gains of the stabilizer.
        distribution: Settings of the distribution of the desired wrench to the feet. They keep the desired CoP from the
            edge of a sole, where the foot would tip.
        lean: Lean of the trunk if the feet cannot give the desired moment; None keeps the trunk upright.
        bias: Settings of the estimator of a constant error of the measured CoM and DCM, which is then subtracted, since
            sensors and models have errors of millimetres. With None both are used as measured.
        feedforward: In position control, add the torques of the desired wrenches to the commands of the servos.
        tasks: Weights and gains of the tasks of planned steps.
        safety: Ranges of measurements and commands.
        solver: Settings of the QP solver. On steep ground a leg may be too short for the place of its foot; hard tasks
            and contacts are then relaxed.
    """

    mode: Mode = "position"
    com_height: Annotated[Positive, "m"] | None = None
    drive: DriveSettings = field(default_factory=DriveSettings)
    stepping: SteppingSettings = field(default_factory=SteppingSettings)
    arms: ArmSettings = field(default_factory=ArmSettings)
    hands: HandSettings = field(default_factory=HandSettings)
    load: LoadSettings | None = None
    walk: WalkSettings = field(default_factory=WalkSettings)
    gains: StabilizerGains = field(default_factory=StabilizerGains)
    distribution: DistributionSettings = field(default_factory=lambda: DistributionSettings(margin=0.008))
    lean: LeanSettings | None = field(default_factory=LeanSettings)
    bias: BiasSettings | None = field(default_factory=lambda: BiasSettings(drift_std=0.002))
    feedforward: bool = True
    tasks: TaskGains = field(default_factory=TaskGains)
    safety: SafetySettings = field(default_factory=SafetySettings)
    solver: SolverSettings = field(default_factory=lambda: SolverSettings(relaxation=1e4))

    @property
    def free(self) -> bool:
        """True for free steps, which torque and hybrid control take; False for planned steps, in position control."""
        return self.mode != "position"
