"""Control of a robot that balances by its steps: its parts put together.

walk        place and time of the next step, swing foot, height of the CoM   `wbc.walking.stepping.source`
tasks       these as targets of tasks and contacts                           `wbc.walking.stepping.tasks`
control     the tick                                                         `wbc.walking.control`
"""

from __future__ import annotations

from dataclasses import field
from typing import Annotated

from wbc.base.checked import checked
from wbc.base.settings import Period, Positive, settings
from wbc.core.drive.control import Mode, SafetySettings
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.core.qp.controller import Controller
from wbc.core.qp.solver import SolverSettings
from wbc.core.robot import Robot
from wbc.ground import KnownGround
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.walking.balance import Balance
from wbc.walking.body import Body
from wbc.walking.control import Law, ReferenceControl, drive_control
from wbc.walking.hands.reaching import Arms, ArmSettings
from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.stepping.source import SteppingWalk
from wbc.walking.stepping.tasks import stepping_tasks

OBSERVER = ObserverSettings(inertial=InertialSettings(velocity_time_constant=0.2, yaw_time_constant=1000.0))
"""Estimate of a robot on points: feet that turn on a stone say little about velocity and nothing about heading."""


@settings
class SteppingControlSettings:
    """Settings of a stepping walk.

    Attributes:
        mode: "torque": torques are sent; "hybrid": torques, with the machine's soft servos around the motion that they
            make; "position": stiff servos follow that motion, which starts anew from the estimate in each period.
        com_height: Height of the CoM over the soles while walking, m; from `gait.bend` when None.
        gait: Law of the steps.
        arms: Hands with targets, and arms that swing.
        safety: Ranges of measurements and commands.
        solver: Solver of the QP.
    """

    mode: Mode = "torque"
    com_height: Annotated[Positive, "m"] | None = None
    gait: SteppingSettings = field(default_factory=SteppingSettings)
    arms: ArmSettings = field(default_factory=ArmSettings)
    safety: SafetySettings = field(default_factory=SafetySettings)
    solver: SolverSettings = field(default_factory=SolverSettings)


class SteppingControl(ReferenceControl):
    """Control of a robot that balances by its steps: it stands, walks where it is steered, and stands.

        walking = SteppingControl(robot, plant.control_period)
        walking.velocity = (0.4, 0.0, 0.0)  # at any tick; None for a stand

    Attributes:
        settings: Settings.
    """

    source: SteppingWalk

    @checked
    def __init__(
        self,
        robot: Robot,
        dt: Period,
        settings: SteppingControlSettings | None = None,
        *,
        observer: Observer | None = None,
        stiffness: StiffnessScheduler | None = None,
        ground: KnownGround | None = None,
    ) -> None:
        """Make all parts for a robot that stands.

        Args:
            robot: The robot, standing.
            dt: Control period, s.
            settings: Settings; the defaults when None.
            observer: Estimates the robot's state; a new one when None.
            stiffness: Sets the soles while they swing; needs feet of variable stiffness.
            ground: What is known of the ground, made with a robot of the same description that stands at the start;
                None walks blind.
        """
        self.settings = s = settings or SteppingControlSettings()
        source = SteppingWalk(robot, dt, s.gait, s.com_height)
        controller = Controller(robot, dt, settings=s.solver)
        tasks = stepping_tasks(controller, source.gait)
        arms = Arms(controller, tasks, dt, s.arms)
        height, yields = source.com_height, tasks.reaching
        body = Body(controller, height, dt, waist=False, lift=source.lift, reaching=yields)
        observer = observer or Observer(robot, OBSERVER, adopt=s.mode != "position")
        # References that lag behind the estimate hold ankles and soles against the ground that they stand on.
        servos = {"feedback": "closed", "reference_time": dt}
        control = drive_control(s.mode, controller, observer, s.safety, **servos)
        super().__init__(Law(source, tasks, Balance()), control, arms, body, stiffness, ground)
