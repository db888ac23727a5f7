"""Settings of a walk, gathered from its parts: all but its footsteps."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Literal

from wbc.base.settings import Positive, settings
from wbc.core.drive.control import Mode, SafetySettings
from wbc.core.qp.solving.solver import SolverSettings
from wbc.tasks.stabilizer.bias import BiasSettings
from wbc.tasks.stabilizer.distribution import DistributionSettings
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.lean import LeanSettings
from wbc.walking.hands.hand import HandSettings
from wbc.walking.hands.reaching import ArmSettings
from wbc.walking.lipm.walk import WalkSettings
from wbc.walking.load import LoadSettings
from wbc.walking.plans.sources import DriveSettings
from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.table import TaskGains

Kind = Literal["planned", "free"]
"""Kind of steps: planned ahead, on which a stabilizer balances the robot, or free, which balance it themselves."""


@settings
class WalkingControlSettings:
    """Settings of a walk: all but its footsteps.

    Those that a user turns stand first; the rest are weights, gains and limits of the parts.

    Attributes:
        mode: "position": servos follow an integrated motion; "torque": torques are sent; "hybrid": torques, with
            the machine's soft servos around the motion that they make.
        com_height: Height of the CoM over the support while walking, m; when None that of the robot as it stands, in
            free steps that of `stepping.bend`.
        drive: Limits of a robot that is steered in planned steps.
        stepping: Free steps: width, time, height and velocities.
        arms: Hands with targets, and arms that swing.
        hands: Hands that press on things and grip them.
        load: Estimate of a load of unknown mass in the hands, which the models then carry; all steps are planned then.
            None for empty hands.
        step_kind: Kind of all steps, "planned" or "free", to compare them; when None it follows from mode and request.
        walk: Planned steps: phases, pattern, step adjustment.
        gains: Of the stabilizer.
        distribution: Of the desired wrench over the feet; a desired CoP at the very edge would tip the foot.
        lean: Lean of the trunk where the feet cannot give the desired moment; None keeps it upright.
        bias: Estimator of a constant error of the measured CoM and DCM, which is then subtracted: sensors and models
            are off by millimetres. None takes both as measured.
        feedforward: In position control, add the torques of the desired wrenches to the servos.
        tasks: Weights and gains of the tasks of planned steps.
        safety: Ranges of measurements and commands.
        solver: Solver of the QP. On steep ground a leg may be too short for where its foot should be: hard tasks and
            contacts are then relaxed, and what can be done is done.
    """

    mode: Mode = "position"
    com_height: Annotated[Positive, "m"] | None = None
    drive: DriveSettings = field(default_factory=DriveSettings)
    stepping: SteppingSettings = field(default_factory=SteppingSettings)
    arms: ArmSettings = field(default_factory=ArmSettings)
    hands: HandSettings = field(default_factory=HandSettings)
    load: LoadSettings | None = None
    step_kind: Kind | None = None
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
    def kinds(self) -> tuple[Kind, ...]:
        """Kinds of steps that the robot may take: under torques both, if none is asked for and no load is expected."""
        if self.step_kind is not None:
            return (self.step_kind,)
        planned = self.mode == "position" or self.load is not None
        return ("planned",) if planned else ("planned", "free")
