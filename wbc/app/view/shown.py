"""Run that a view shows: its stage, its control and its program, and what is said of them in words."""

from __future__ import annotations

from textwrap import shorten
from typing import Any

from wbc.app.view.marks import Picture
from wbc.app.view.stage import DescribedStage, SimulatedStage
from wbc.base.errors import InputError
from wbc.core.drive.control import Control
from wbc.core.qp.controller import Controller
from wbc.robots import RobotDescription
from wbc.sim.plant.mujoco_robot import MujocoRobot
from wbc.tasks.behaviours import Program
from wbc.walking.control import WalkingControl
from wbc.walking.steered import SteeredControl

STATUS_LENGTH = 120
"""Number of characters of the state of the control that are shown; a fall and a stop stand first in it."""


class ShownRun:
    """Run that a view shows; None for what it has not.

    Attributes:
        stage: Model, its state, and sizes of what is drawn.
        program: Program whose state is shown.
        controller: Controller whose tasks a workbench shows.
        walking: Control that makes the commands, if it is a walk.
        steered: The control, if it is of a robot that is steered.
        ending: How the run has ended; empty before.
    """

    stage: SimulatedStage | DescribedStage

    def __init__(
        self, source: MujocoRobot | RobotDescription, control: Any = None, program: Program | None = None
    ) -> None:
        """Take the parts that are shown; see `View` for what they may be."""
        control = program.control if control is None and program is not None else control
        if control is not None and not isinstance(control, (Control, Controller)):
            raise InputError(f"a view shows a control or a Controller, got {control!r}")
        self.program, self.ending, acting = program, "", None
        self._control: Control | None = None
        self.controller = control if isinstance(control, Controller) else None
        if isinstance(control, Control):
            self._control, drives, acting = control, control.drives, control.acting
            self.controller = None if drives is None else drives.controller
        self.walking = acting if isinstance(acting, WalkingControl) else None
        self.steered = control if isinstance(control, SteeredControl) else None
        if isinstance(source, RobotDescription) and self.walking is None:
            self.stage = DescribedStage(source)
        elif isinstance(source, MujocoRobot):
            self.stage = SimulatedStage(source, self.walking)
        else:
            raise InputError(
                "a view shows a plant or a MujocoLoop, or the description of a robot without a walk, whose states are "
                f"given to update(robot); got {source!r}"
            )

    def add_texts(self, picture: Picture) -> None:
        """Add to a picture the state of program and control, and the end of the run."""
        if self.program is not None:
            picture.text.insert(0, self.program.path)
        if self._control is not None:
            status = shorten(self._control.status(), STATUS_LENGTH, placeholder=" …")
            picture.text.append(f"control: {status}")
        if self.ending:
            picture.text.append(f"the run has ended: {self.ending}")
