"""Sources of pictures, a robot in a simulation or a described one whose states are given, and scenes that show them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from textwrap import shorten
from typing import Any

import mujoco
import numpy as np

from wbc.app.drift import MIN_LOAD
from wbc.app.view.marks import Force, Mark, Picture, Scale, force_marks, legend, sole_force
from wbc.app.view.meshes import body_meshes
from wbc.app.view.walk_marks import WalkMarks
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, finite_scalar
from wbc.core.drive.control import Control
from wbc.core.frames import net_wrench
from wbc.core.qp.controller import Controller
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement
from wbc.robots import RobotDescription
from wbc.robots.mechanism import Colour
from wbc.sim.plant.model import drawing_model
from wbc.sim.plant.mujoco_robot import MujocoRobot
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.plant import Plant
from wbc.sim.terrain.spec import terrain
from wbc.tasks.behaviours import Program
from wbc.tasks.stabilizer.pendulum import NoContactForceError, level_zmp, natural_frequency
from wbc.walking.control import WalkingControl
from wbc.walking.steered import SteeredControl

EYE, LOOK_AT = np.array([2.6, -2.0, 1.7]), np.array([0.0, 0.0, 0.8])
"""Place of the camera and point that it looks at, in heights of the centre of mass."""

STATUS_LENGTH = 120
"""Number of characters of the state of the control that are shown; a fall and a stop stand first in it."""


class Stage(ABC):
    """Content of a page, film or file: bodies of a model, whose state is taken and made into a picture, or is shown.

    Attributes:
        title: Name of the robot.
        robot: The robot, for names and sizes.
        model: MuJoCo's model.
        data: Its state: places of the bodies.
        floor: Height of the floor plane, m.
        scale: Sizes of the robot, for marks and camera.
        plant: Robot in a simulation; None for a described one.
        places: Places of the robot in the model.
        soles: Bodies of each sole of variable stiffness; empty without them.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    places: RobotPlaces
    plant: MujocoRobot | None = None
    soles: Sequence[Sequence[int]] = ()

    def __init__(self, title: str, robot: Robot, com: float, floor: float) -> None:
        self.title, self.robot, self.floor = title, robot, floor
        self.scale = Scale(com - floor, robot.mass * GRAVITY)

    @abstractmethod
    def take(self, state: Robot | Array | None, read: Measurement | None) -> float:
        """Take the state that is given, and what the soles measure; return its time, s. `View.update` says which."""

    @abstractmethod
    def show(self, q: Array) -> None:
        """Put the bodies where they are in a configuration: MuJoCo's of a simulation, Pinocchio's of a description."""

    @abstractmethod
    def picture(self) -> Picture | None:
        """Return the picture of the state that was taken last, with the forces on its soles; None before one was."""


class SimulatedStage(Stage):
    """Robot in a simulation, to which a live view writes nothing."""

    plant: MujocoRobot

    def __init__(self, robot: MujocoRobot, walking: WalkingControl | None) -> None:
        floor = float(robot.terrain.surface.floor) if isinstance(robot, Plant) else 0.0
        super().__init__(robot.description.name, robot.robot, float(robot.truth().com[2]), floor)
        self.plant, self._walking = robot, walking
        self.model, self.data, self.places = robot.model, robot.data, robot.places
        self._marks = None if walking is None else WalkMarks(robot, walking, self.scale)
        feet = robot.feet if isinstance(robot, Plant) else ()
        hinges = [[robot.model.joint(name) for name in foot.variable_joints] for foot in feet]
        self.soles = [sorted({int(hinge.bodyid[0]) for hinge in each}) for each in hinges]
        self._springs = [int(each[0].id) for each in hinges if each]

    def take(self, state: Robot | Array | None, read: Measurement | None) -> float:
        """See `Stage`; `InputError` for what a simulation has itself."""
        if state is not None or read is not None:
            raise InputError(
                "a view of a simulation reads its state itself: update() without state and measurement"
            )
        return self.plant.time

    def show(self, q: Array) -> None:
        """See `Stage`."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)

    def picture(self) -> Picture:
        """See `Stage`."""
        robot, truth, data = self.plant, self.plant.truth(), self.data
        position, force, sole = truth.contact_position, truth.contact_force, truth.contact_sole
        forces = []
        for i in range(len(robot.places.feet)):
            on_sole = sole == i
            load = force[on_sole, 2]
            if load.sum() > 0.0:
                point = load @ position[on_sole] / load.sum()
                forces.append(Force("ground", point, force[on_sole].sum(axis=0)))
        forces += [Force("ground", position[i], force[i]) for i in np.flatnonzero(sole < 0)]
        pushed = np.flatnonzero(data.xfrc_applied[:, :3].any(axis=1) & robot.places.of_robot)
        forces += [Force("push", data.xipos[i].copy(), data.xfrc_applied[i, :3].copy()) for i in pushed]
        wrench = np.concatenate([force.sum(axis=0), np.cross(position, force).sum(axis=0)])
        centre = truth.centre_of_pressure
        level = self.floor if np.isnan(centre).any() else float(centre[2])
        reference = None if self._walking is None else self._walking.reference
        omega = natural_frequency(self.scale.height) if reference is None else reference.pendulum.omega
        dcm = truth.com + truth.com_velocity / omega
        support = position[force[:, 2] > MIN_LOAD * self.scale.weight]
        picture = Picture(robot.time, target=truth.com)
        picture.add_balance(self.scale, truth.com, level, zmp_of(wrench, level), dcm, support)
        picture.marks += force_marks(self.scale, forces)
        if self._marks is not None:
            self._marks.add(picture)
        if self._springs:
            picture.add_soles(self.soles, [float(self.model.jnt_stiffness[k]) for k in self._springs])
        return picture


class DescribedStage(Stage):
    """Robot whose states are given: an estimate, a plan, a real robot."""

    def __init__(self, description: RobotDescription) -> None:
        if description.base == "fixed":
            raise InputError(
                f"a view shows a robot that moves about, and '{description.name}' is bolted down"
            )
        ground, robot = terrain("flat"), description.robot()
        super().__init__(description.name, robot, float(robot.com[2]), float(ground.surface.floor))
        self.model = drawing_model(description, robot, ground)
        self.data, self.places = mujoco.MjData(self.model), RobotPlaces(self.model, robot)
        self._state: Robot | Array | None = None
        self._read: Measurement | None = None
        self._time = 0.0

    def take(self, state: Robot | Array | None, read: Measurement | None) -> float:
        """See `Stage`: a robot, or a configuration (nq,); the time is that measured last."""
        own = self.robot
        if state is None:
            raise InputError("a view of a description needs the state to show: update(robot)")
        if not isinstance(state, Robot):
            state = finite_array("configuration to show", state, (own.nq,))
        elif state.model.nq != own.model.nq or state.model.nframes != own.model.nframes:
            raise InputError(f"the view shows '{own.name}', not {state!r}")
        if read is not None:
            if not isinstance(read, Measurement):
                raise InputError(f"a view shows a Measurement, got {read!r}")
            if (wrench := read.sole_wrench) is not None and np.shape(wrench) != (len(own.soles), 6):
                raise InputError(
                    f"sole_wrench must be of {len(own.soles)} soles, got shape {np.shape(wrench)}"
                )
            self._time = finite_scalar("time of the measurement (s)", read.time)
        self._state, self._read = state, read
        return self._time

    def show(self, q: Array) -> None:
        """See `Stage`."""
        self.places.set_configuration(q, self.data.qpos)
        mujoco.mj_kinematics(self.model, self.data)

    def picture(self) -> Picture | None:
        """See `Stage`."""
        robot, state, read = self.robot, self._state, self._read
        if state is None:
            return None
        if isinstance(state, Robot):
            robot = state
        else:
            robot.update(state, np.zeros(robot.nv))
        self.show(robot.q)
        total, level, forces = np.zeros(6), self.floor, []
        if read is not None and read.sole_wrench is not None:
            places = [robot.placement(sole.frame) for sole in robot.soles]
            total = net_wrench(read.sole_wrench.tolist(), places)
            for place, wrench in zip(places, read.sole_wrench, strict=True):
                forces += sole_force(place.translation, place.rotation, wrench)
            level = min((float(place.translation[2]) for place in places), default=level)
        picture = Picture(self._time, target=np.array(robot.com))
        picture.add_balance(self.scale, picture.target, level, zmp_of(total, level))
        picture.marks += force_marks(self.scale, forces)
        return picture


class DrawnScene(ABC):
    """Bodies and marks as one kind of page, stream or file shows them; `draw` shows a picture.

    Attributes:
        stage: Stage whose bodies are shown.
        meshes: Triangles of the bodies, each of one colour; a mesh is named by its number in this list.
        moving: Bodies that move.
        meanings: Legend of all pictures so far: texts and their colours.
    """

    def __init__(self, stage: Stage) -> None:
        """Begin without marks; the first picture paints all meshes."""
        self.stage, self.meshes = stage, body_meshes(stage.model)
        self.moving = sorted({mesh.body for mesh in self.meshes} - {0})
        self.meanings: dict[str, Colour] = {}
        self._colours: dict[int, Colour] = {}  # of the meshes as they are shown
        self._marks: dict[str, Mark] = {}  # as they are shown

    def draw(self, picture: Picture) -> None:
        """Show a picture: bodies at their places, and the colours and marks that look other than those shown."""
        for body in self.moving:
            self._move(body)
        for number, (body, own, _) in enumerate(self.meshes):
            if self._colours.get(number) != (colour := picture.colours.get(body, own)):
                self._colours[number] = colour
                self._paint(number, colour)
        for name in self._marks.keys() - {mark.name for mark in picture.marks}:
            self._erase(self._marks.pop(name))
        for mark in picture.marks:
            shown = self._marks.get(mark.name)
            if shown is None or not mark.looks_like(shown):
                if shown is not None and shown.kind != mark.kind:
                    self._erase(shown)
                self._marks[mark.name] = mark
                self._show(mark)
        self.meanings |= legend(picture)

    @abstractmethod
    def _move(self, body: int) -> None:
        """Move a body to its place in the stage's data."""

    @abstractmethod
    def _paint(self, number: int, colour: Colour) -> None:
        """Give a mesh a colour."""

    @abstractmethod
    def _show(self, mark: Mark) -> None:
        """Show a mark, in the place of the one of its name, which is of its kind."""

    @abstractmethod
    def _erase(self, mark: Mark) -> None:
        """Take a mark away."""


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

    stage: Stage

    def __init__(
        self, source: MujocoRobot | RobotDescription, control: Any = None, program: Program | None = None
    ) -> None:
        if program is not None and not isinstance(program, Program):
            raise InputError(f"a view shows the states of a Program, got {program!r}")
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
        own = self.stage.robot if self.controller is None else self.controller.robot
        if own.joint_names != self.stage.robot.joint_names:
            raise InputError(f"a view of '{self.stage.title}' cannot show a control of '{own.name}'")

    def add_texts(self, picture: Picture) -> None:
        """Add to a picture the state of program and control, and the end of the run."""
        if self.program is not None:
            picture.text.insert(0, self.program.path)
        if self._control is not None:
            status = shorten(self._control.status(), STATUS_LENGTH, placeholder=" …")
            picture.text.append(f"control: {status}")
        if self.ending:
            picture.text.append(f"the run has ended: {self.ending}")


def zmp_of(wrench: Array, level: float) -> Array | None:
    """Return the ZMP of a wrench at the world origin in the horizontal plane at a level, m; None without force."""
    try:
        return level_zmp(wrench, np.array([0.0, 0.0, level]))
    except NoContactForceError:
        return None
