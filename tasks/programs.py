"""Programs in a file: states of a machine as TOML tables, for behaviours that need no function of one's own.

    [[state]]
    name = "squat"
    body.lower = 0.08                    # m, of a walking robot
    timeout = 4.0                        # s
    next.timeout = "stand"               # outcome → state; "done" goes to the next one

What a state moves it waits for, unless `done` says what else ends it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin

from wbc.core.errors import (
    InputError,
    UnknownNameError,
    choose,
    finite_array,
    finite_scalar,
    shown,
    shown_path,
)
from wbc.core.files import read_toml
from wbc.core.settings import Positive, from_json, settings
from wbc.tasks.behaviours import (
    Behaviour,
    StateMachine,
    after,
    all_of,
    any_of,
    error_below,
    reached,
    speed_below,
)


@settings(kw_only=True)
class Move:
    """Way of a task or a hand.

    Attributes:
        to: Target: coordinates, m, of a pose those of its point; of a posture joint → angle, rad.
        by: Way from the present target of a task, in its axes, or the present place of a hand, in the world, m.
        frame: Frame of `to`, of a hand: "world" or "pelvis".
        duration: s.
        speed: Greatest speed, m/s.
    """

    to: tuple[float, ...] | dict[str, float] | None = None
    by: tuple[float, ...] | None = None
    frame: str = "world"
    duration: Annotated[Positive, "s"] | None = None
    speed: Annotated[Positive, "m/s"] | None = None

    def __post_init__(self) -> None:
        if (self.to is None) == (self.by is None) or (self.by is not None and self.frame != "world"):
            raise InputError("a move is either 'to' a target or 'by' a way in the world")


@settings(kw_only=True)
class StateTable:
    """One state.

    Attributes:
        name: Name of the state.
        task: Task → where its target goes.
        hand: Hand of a walking robot → where it goes.
        release: Hands that go back to the posture.
        body: Attribute of `walking.body` → value: com_height, lean, turn, look_at (an empty list looks ahead); or
            lower, m below the height of the walk.
        go_to: Place in the world that a walking robot walks to: x, y (m) and heading (rad).
        done: What ends the state: "reached", "looking", "walked", "never", or a table of one key: after = s,
            error_below or speed_below = { task = bound }, all or any = a list of these. All that it moves when None.
        timeout: s.
        next: Outcome → state that follows.
    """

    name: str
    task: dict[str, Move] = field(default_factory=dict)
    hand: dict[str, Move] = field(default_factory=dict)
    release: tuple[str, ...] = ()
    body: dict[str, float | tuple[float, ...]] = field(default_factory=dict)
    go_to: Annotated[tuple[float, float, float], "m, m, rad"] | None = None
    done: str | dict[str, Any] | None = None
    timeout: Annotated[Positive, "s"] | None = None
    next: dict[str, str] = field(default_factory=dict)


def read_state_machine(source: str | Path | dict[str, Any], control: object) -> StateMachine:
    """Return the machine of a TOML file, its names looked up in what it is to drive.

    Args:
        source: Path of the file, or what is in it.
        control: As of `Program`: a control of drives, a walking robot or a `Controller`.

    Raises:
        UnknownNameError: A key, task, hand, condition or state that there is not; the message names the state.
        InputError: A file that cannot be read, or a value that cannot be used.
    """
    table = dict(source) if isinstance(source, dict) else read_toml(Path(source).expanduser())
    table.setdefault("name", "program" if isinstance(source, dict) else Path(source).stem)
    if not {"name", "state"} >= set(table):
        where = "a program" if isinstance(source, dict) else shown_path(source)
        raise InputError(f"{where} has [[state]] tables and a name, got {', '.join(map(shown, table))}")
    return _machine(table, control, "")


def _machine(table: Mapping[str, Any], control: Any, path: str) -> StateMachine:
    path, tables = f"{path}{table.get('name')}/", table.get("state")
    if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
        raise InputError(f"'{path}' needs [[state]] tables, got {shown(tables)}")
    states: list[Behaviour] = []
    for each in tables:
        where = f"state '{path}{each.get('name')}'"
        if "state" in each:
            for key in each:
                choose(f"key of {where}, a machine,", key, ("name", "state", "next"))
            states.append(_machine(each, control, path))
            continue
        try:
            states.append(_state(from_json(StateTable, each), control))
        except InputError as error:
            raise (UnknownNameError if isinstance(error, UnknownNameError) else InputError)(
                f"{where}: {error}"
            ) from error
    return StateMachine(
        str(table.get("name")), states, {str(each.get("name")): each.get("next", {}) for each in tables}
    )


def _state(given: StateTable, control: Any) -> Behaviour:
    """Return a state, its names looked up."""
    controller = getattr(control, "controller", control)
    if (given.hand or given.release or given.body or given.go_to) and not hasattr(control, "arms"):
        raise InputError(f"hand, release, body and go_to are of a walking robot, got {shown(control)}")
    tasks = {name: controller.task(name) for name in given.task}
    hands = {name: control.arms[name] for name in (*given.hand, *given.release)}
    starts: list[Callable[[], object]] = [partial(hands[name].release) for name in given.release]
    for name, move in given.task.items():
        task, what = tasks[name], f"task '{name}'"
        if not hasattr(task, "move_to"):
            raise InputError(f"{what} has no target that moves")
        place = partial(getattr, task, "target")
        _move(move, what, place, task.check_move)
        starts.append(partial(_move, move, what, place, task.move_to))
    for name, move in given.hand.items():
        hand, what = hands[name], f"hand '{name}'"
        place = partial(getattr, hand, "position")
        _move(move, what, place, hand.check, move.frame)
        starts.append(partial(_move, move, what, place, hand.reach, move.frame))
    for name, value in given.body.items():
        choose("attribute of body", name, ("com_height", "lower", "lean", "turn", "look_at"))
        to: Any = value
        if name == "lower":
            to = control.body.com_height - finite_scalar("lower (m)", value)
        attribute = "com_height" if name == "lower" else name
        if to or name != "look_at":
            control.body.check(attribute, to)
        look = partial(control.body.look_at, to or None)
        starts.append(look if name == "look_at" else partial(setattr, control.body, attribute, to))
    if given.go_to is not None:
        control.source.check_goal(*given.go_to[:2])
        starts.append(partial(control.go_to, *given.go_to))
    moved = [*tasks.values(), *(hands[name] for name in given.hand)]
    moved += [control.body] if given.body.keys() - {"look_at"} else []
    waits = ["reached"] if moved else []
    waits += ["looking"] if given.body.get("look_at") else []
    waits += ["walked"] if given.go_to is not None else []
    done = {"all": waits} if given.done is None and waits else given.done
    if done is None and given.timeout is None:
        raise InputError(
            'it moves nothing to wait for: give done = { after = 2.0 }, a timeout, or done = "never"'
        )
    condition = None if done in (None, "never") else _condition(done, controller, moved)
    return Behaviour(
        given.name, lambda now: [start() for start in starts], done=condition, timeout=given.timeout
    )


def _condition(given: Any, controller: Any, moved: list[Any]) -> Any:
    """Return a condition by its name or table."""
    kind: Any
    value: Any
    kind, value = next(iter(given.items())) if isinstance(given, dict) and len(given) == 1 else (given, None)
    named = {
        "reached": lambda: reached(*moved),
        "looking": lambda: lambda now: now.control.body.looking,
        "walked": lambda: lambda now: now.control.finished,
    }
    tables = {
        "after": lambda: after(value),
        "all": lambda: all_of(*(_condition(each, controller, moved) for each in value)),
        "any": lambda: any_of(*(_condition(each, controller, moved) for each in value)),
        "error_below": lambda: all_of(
            *(error_below(controller.task(n), bound) for n, bound in value.items())
        ),
        "speed_below": lambda: all_of(
            *(speed_below(controller.task(n), bound) for n, bound in value.items())
        ),
    }
    known: dict[str, Callable[[], Any]] = named if value is None else tables
    choose("condition", kind, (*known, *({"never"} if value is None else ())))
    try:
        return known[kind]()
    except (TypeError, AttributeError, KeyError) as error:
        raise InputError(f"condition '{kind}' cannot be {shown(value)}") from error


def _move(move: Move, what: str, place: Callable[[], Any], go: Callable[..., object], *frame: str) -> None:
    """Move from a place, or check it; the point of a pose moves, and its rotation stays."""
    here: Any = place()
    point = here.translation if isinstance(here, pin.SE3) else here
    if np.ndim(point) != 1:
        raise InputError(f"{what} turns: a file moves points, poses and joints")
    target: Any = move.to
    if move.by is not None:
        target = point + finite_array(f"'by' of {what}", move.by, point.shape)
    if isinstance(here, pin.SE3):
        target = pin.SE3(here.rotation, finite_array(f"'to' of {what} (m)", target, (3,)))
    go(target, *frame, duration=move.duration, speed=move.speed)
