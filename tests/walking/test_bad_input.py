"""Footsteps, gaits, orders and walks that are refused: the type of the error and what it names."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from point_mass import SCALE
from standing_hands import measure

import wbc
from wbc.base.errors import InputError, UnknownNameError
from wbc.tasks.stabilizer.lean import LeanSettings
from wbc.walking import FootstepPlan, Gait, WalkingControl
from wbc.walking.hands.hand import HandState
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arms
from wbc.walking.lipm.adjustment import AdjustmentSettings
from wbc.walking.lipm.settings import PhaseSettings
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.check import check_plan
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.planners import climb_stairs, turn_in_place, walk_distance, walk_path, walk_velocity
from wbc.walking.plans.reach import Reach
from wbc.walking.source import StandSource
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import (
    AreaConstants,
    PathConstants,
    SteppingConstants,
    SteppingSettings,
    SwingConstants,
    TimeConstants,
    TouchConstants,
)

DT = 0.005
ROBOT = wbc.load_robot("hrp4_class").robot()
START = FootstepPlan.standing(ROBOT)
NAN = math.nan


def checked(*moves: tuple[float, float, float]) -> None:
    check_plan(walk_path(START, moves), Reach.of(ROBOT))


def step(*place: float, **angles: float) -> None:
    check_plan(replace(START, steps=(Footstep("left", *place, **angles),)), Reach.of(ROBOT))


def walking() -> WalkingControl:
    return WalkingControl(ROBOT.clone(), START, DT, extent=(-1.0, 1.0, -1.0, 1.0))


def body(name: str, value: object) -> None:
    setattr(walking().body, name, value)


def drive(*velocity: float) -> None:
    walking().velocity = velocity  # type: ignore[assignment]


def hands() -> Hands:
    control = walking()
    measure(control)
    return control.hands


def gripping() -> Hands:
    given = hands()
    given.all["left_hand"].state = HandState.GRIP
    return given


def bound() -> Arms:
    arms = walking().arms
    arms.place("box", pin.SE3.Identity())
    arms["left_hand"].reach([0.0, 0.0, 0.1], "box")
    return arms


def one_handed() -> WalkingControl:
    given = wbc.load_robot("hrp4_class")
    description = replace(given, hands={"right_hand": given.hands["right_hand"]})
    return WalkingControl(description.robot(), None, DT)


AHEAD, DOWN = (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)

REFUSED: list[tuple[Callable[[], object], str]] = [
    (lambda: Footstep("middle", 0.0, 0.0), "middle"),
    (lambda: Footstep("left", [1.0], 0.0), "x of a footstep"),  # type: ignore[arg-type]
    (lambda: LipmWalk(ROBOT, START, 0.78, -1.0), "dt of LipmWalk"),
    (lambda: LipmWalk(ROBOT, START, 0.78, DT, extent=(1.0, -1.0, -1.0, 1.0)), "extent of LipmWalk"),
    (lambda: SteppingWalk.of(ROBOT, -1.0), "dt of SteppingWalk.of"),
    (lambda: SteppingWalk.of(ROBOT, DT, extent=(1.0, -1.0, -1.0, 1.0)), "extent of SteppingWalk"),
    (lambda: SteppingWalk(SteppingSettings(), SCALE, NAN, DT), "heading of SteppingWalk"),
    (lambda: check_plan(START, None, (0.0, 0.0, -1.0, 1.0)), "extent of check_plan"),
    (lambda: Gait(takeoff_time=0.3, landing_time=0.3), "single"),
    (lambda: Gait(single_support=0.01, takeoff_time=0.0, landing_time=0.0), "at least 0.1 s"),
    (lambda: step(3.0, 0.0875), "forward by 3 m"),
    (lambda: step(1e200, 0.0875), r"forward by 1e\+200 m"),
    (lambda: step(0.0, 3.0), "beside the stance foot"),
    (lambda: setattr(walking(), "dt", -1.0), "dt of WalkingControl"),
    (lambda: walk_distance(START, 0.0), "zero"),
    (lambda: walk_velocity(START, (0.1, 0.0, -1.5), 3), "turn"),
    (lambda: climb_stairs(START, rise=0.1, tread=0.3, count=2, first_edge=0.1), "tread"),
    (lambda: checked((0.6, 0.0, 0.0)), "forward"),
    (lambda: step(0.1, 0.0875, 0.5), "rises"),
    (lambda: check_plan(replace(START, gait=Gait(swing_height=0.5)), Reach.of(ROBOT)), "swing_height"),
    (
        lambda: check_plan(replace(START, gait=Gait(single_support=0.2, landing_time=0.05)), Reach.of(ROBOT)),
        "single_support of 0.2 s is too quick",
    ),
    (lambda: check_plan(replace(START, right=Footstep("right", 0.0, 0.02)), Reach.of(ROBOT)), "overlap"),
    (lambda: drive(0.1, 0.0, NAN), "velocity"),
    (lambda: drive(0.0, 0.0, 20.0), "rad/s"),  # degrees for radians, here and below
    (lambda: turn_in_place(START, 90.0), r"angle of turn_in_place \(rad\)"),
    (lambda: turn_in_place(START, -7.0), r"angle of turn_in_place \(rad\)"),
    (lambda: turn_in_place(START, 1.0, per_step=15.0), r"per_step of turn_in_place \(rad\)"),
    (lambda: walk_path(START, [(0.1, 0.0, 10.0)]), r"turn of a move \(rad\)"),
    (lambda: walk_velocity(START, (0.1, 0.0, 20.0), 3), r"turning velocity \(rad/s\)"),
    (lambda: walking().go_to(0.5, 0.0, 90.0), r"yaw of WalkingControl.go_to \(rad\)"),
    (lambda: body("turn", 45.0), "rad"),
    (lambda: body("lean", (10.0, 0.0)), "rad"),
    (lambda: walk_distance(START, math.inf), r"distance of walk_distance \(m\)"),
    (lambda: climb_stairs(START, rise=0.1, tread=0.3, count=0, first_edge=0.4), "count"),
    (lambda: walking().go_to(3.0, 0.0, 0.0), "ground"),
    (lambda: walking().follow("left"), "FootstepPlan"),  # type: ignore[arg-type]
    (lambda: body("com_height", 0.3), "com_height"),
    (lambda: body("lean", (0.0, 3.0)), "lean"),
    (lambda: walking().arms["left"], "left_hand"),
    (lambda: walking().arms["left_hand"].reach([0.0, 0.0, 0.0], "box"), "box"),
    (lambda: hands().press("left_hnd", 5.0, DOWN), "left_hand"),
    (lambda: hands().press("left_hand", 5.0, (0.0, 0.0, 0.0)), "direction of left_hand"),
    (lambda: walking().hands.press("left_hand", 5.0, DOWN), "after the first tick"),
    (lambda: gripping().press("left_hand", 5.0, AHEAD, firm=True), "must let go of what it holds"),
    (lambda: hands().press("left_hand", 5.0, DOWN, firm="no"), "firm of Hands.press"),  # type: ignore[arg-type]
    (lambda: walking().arms.place(["box"], ROBOT.data.oMi[1]), "name of Arms.place"),  # type: ignore[arg-type]
    (lambda: walking().hands.point("left_hand", NAN, 0.5), r"ahead of Hands.point"),
    (lambda: bound().place("box", None), "release left_hand, and wait"),
    (lambda: one_handed().hands.heading, "left_hand"),
    (
        lambda: SteppingWalk.of(ROBOT, DT, constants=SteppingConstants(area=AreaConstants(box=(2.0, 0.1)))),
        "box of AreaConstants",
    ),
    (lambda: SwingConstants(touch=NAN), "touch must be a finite number"),
    (lambda: TimeConstants(brisk=0.0), "brisk"),
    (lambda: TouchConstants(most_force=-1.0), "most_force"),
    (lambda: TouchConstants(early=7.0), "early"),
    # Newtons for weights, millimetres for heights of the CoM, milliseconds for 1/ω, degrees for rad.
    (
        lambda: SteppingWalk.of(
            ROBOT, DT, constants=SteppingConstants(touch=TouchConstants(most_force=458.0))
        ),
        "mg",
    ),
    (lambda: SteppingWalk.of(ROBOT, DT, constants=SteppingConstants(path=PathConstants(astray=45.0))), "rad"),
    (lambda: SteppingWalk.of(ROBOT, DT, SteppingSettings(swing_height=60.0)), "swing_height"),
    (lambda: SteppingWalk.of(ROBOT, DT, SteppingSettings(slow_time=700.0)), "slow_time"),
    (lambda: PhaseSettings(touch_down=0.0), "touch_down"),
    (lambda: PhaseSettings(max_late=500.0), "max_late"),
    (lambda: AdjustmentSettings(threshold=5.0), "threshold"),
    (lambda: LeanSettings(limit=20.0), "limit"),
    (
        lambda: hands().press("left_hand", 5.0, AHEAD, at=(2.0, 0.2, 0.9)),
        "point for left_hand must be within",
    ),
    (lambda: hands().press("left_hand", 500.0, DOWN, firm=True), "left_hand can press with"),
    (lambda: WalkingControl(ROBOT.clone(), walk_distance(START, 3.0), DT, extent=(-1, 2, -1, 1)), "ground"),
    (
        lambda: WalkingControl(ROBOT.clone(), None, DT, extent=(1.0, -1.0, -1.0, 1.0)),
        "smallest and largest x",
    ),
    (
        lambda: WalkingControl(ROBOT.clone(), StandSource(ROBOT), DT, extent=(-1.0, 1.0, -1.0, 1.0)),
        "leave it out",
    ),
    (lambda: START.moved(np.eye(4)), "world of FootstepPlan.moved"),
    (lambda: START.foot("lft"), "left"),
    (lambda: START.stance("left"), "index of FootstepPlan.stance"),  # type: ignore[arg-type]
    (lambda: START.stance(0), "the plan has no steps"),
    (lambda: walk_distance(START, 0.3).stance(9), "its steps are 0 to"),
    (lambda: START.feet(-1), "count of FootstepPlan.feet"),
    (lambda: START.with_step(0, (0.1, 0.1)), "step of FootstepPlan.with_step"),  # type: ignore[arg-type]
    (lambda: START.with_step(0, Footstep("left", 0.1, 0.1)), "no step 0"),
    (lambda: START.on(0.1), "height of FootstepPlan.on"),  # type: ignore[arg-type]
    (lambda: START.on(lambda x, y: "low"), "height"),  # type: ignore[arg-type,return-value]
    (lambda: Gait.for_speed((0.1, 0.0, 0.0), 0.5), "gait of Gait.for_speed"),  # type: ignore[arg-type]
    (lambda: Gait.at_speed(-0.1), r"speed of Gait.at_speed \(m/s\)"),
    (lambda: setattr(walking().stabilizer, "gains", {"dcm_p": 5.0}), "gains of Stabilizer"),
]


@pytest.mark.parametrize(("call", "named"), REFUSED)
def test_what_a_robot_cannot_do_is_refused(call: Callable[[], object], named: str) -> None:
    with pytest.raises((InputError, UnknownNameError), match=named):
        call()


def test_a_task_that_the_walk_sets_at_every_tick_has_no_target_of_the_users() -> None:
    controller = walking().controller
    for name in ("com", "pelvis", "left_foot swing"):
        with pytest.raises(InputError, match=name):
            controller.task(name).target = np.zeros(3)  # type: ignore[attr-defined]


def test_an_attribute_that_a_walk_does_not_have_is_refused() -> None:
    with pytest.raises(AttributeError, match="velocty"):
        walking().velocty = (0.2, 0.0, 0.0)  # type: ignore[attr-defined]
