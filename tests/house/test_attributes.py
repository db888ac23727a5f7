"""Public attributes are pairs: what is read can be assigned, which changes nothing, and is not written in silence."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from task_factory import MOTION_TASKS, left_hand, right_hand

import wbc
from wbc import tasks
from wbc.base.checked import Fixed
from wbc.base.errors import InputError, WbcError
from wbc.core.robot import Robot
from wbc.tasks.stabilizer.distribution import WrenchDistribution
from wbc.tasks.stabilizer.stabilizer import Stabilizer

SIX = np.arange(1.0, 7.0)
MISSING = object()
Made = tuple[Any, ...]
"""Items of a controller, those that others need first; the last one is looked at."""


def with_contact(robot: Robot) -> Made:
    contact = wbc.FixedContact(left_hand(robot))
    return contact, tasks.WrenchTask(contact, SIX, weight=SIX)


def stabilizer(robot: Robot) -> Made:
    feet = wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot")
    return *feet, wbc.StabilizerTask(feet, [0.0, 0.0, 0.79])


ITEMS: dict[str, Callable[[Robot], Any]] = {
    **{f"{name} task": case.make for name, case in MOTION_TASKS.items()},
    "posture task": lambda r: wbc.PostureTask(
        {r.joint_names[3]: 0.1}, joint_weights={r.joint_names[0]: 10.0}
    ),
    "posture task of some": lambda r: wbc.PostureTask(
        joints=r.joint_names[:2], weight=[1.0, 2.0], joint_weights={r.joint_names[0]: 10.0}
    ),
    "torque task": lambda r: tasks.JointTorqueTask(joints=r.joint_names[:2], weight=[1.0, 2.0]),
    "wrench task": with_contact,
    "stabilizer task": stabilizer,
    "distance task": lambda r: tasks.DistanceTask(left_hand(r), right_hand(r)),
    "coupling task": lambda r: tasks.JointCouplingTask({r.joint_names[0]: 1.0}),
    "manipulability task": lambda r: tasks.ManipulabilityTask(left_hand(r)),
    "low acceleration task": lambda r: tasks.LowAccelerationTask(),
    "fixed contact": lambda r: wbc.FixedContact(left_hand(r)),
    "contact that may yield": lambda r: wbc.FixedContact(left_hand(r), motion_weight=SIX, wrench_weight=SIX),
    "point contact": lambda r: wbc.PointContact(left_hand(r), max_force=50.0),
    "sole contact": lambda r: wbc.SoleContact("left_foot", torsion=0.05),
    "contact that is off": lambda r: wbc.SoleContact("left_foot", active=False),
    "closure": lambda r: wbc.LoopClosure(left_hand(r), right_hand(r), motion_weight=SIX),
    "joint limits": lambda r: wbc.JointLimits(acceleration=10.0, braking=5.0),
    "torque limits": lambda r: wbc.TorqueLimits(rate=1e3),
    "place limit": lambda r: wbc.FramePositionLimit(left_hand(r), lower=[-np.inf, -1.0, -1.0]),
    "speed limit": lambda r: wbc.FrameSpeedLimit(left_hand(r), linear=1.0),
    "cone limit": lambda r: wbc.AxisConeLimit(r.torso_frame, 0.3),
    "polygon limit": lambda r: wbc.CoMPolygonLimit([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]),
    "collision limit": lambda r: wbc.CollisionLimit(
        obstacles=[wbc.Obstacle("ball", wbc.CollisionSphere(0.1))],
        against=[left_hand(r)],
        shapes={left_hand(r): wbc.CollisionSphere(0.05)},
    ),
}


def balancing() -> wbc.Controller:
    return wbc.balance_controller(wbc.load_robot("hrp4_class").robot(), 0.005)


def walking() -> wbc.WalkingControl:
    robot = wbc.load_robot("hrp4_class").robot()
    return wbc.WalkingControl(robot, wbc.FootstepPlan.standing(robot), 0.005)


OBJECTS: dict[str, Callable[[], Any]] = {
    "controller": balancing,
    "inverse kinematics": lambda: wbc.InverseKinematics(balancing().robot, 0.005),
    "position control": lambda: wbc.PositionControl(balancing()),
    "torque control": lambda: wbc.TorqueControl(balancing()),
    "hybrid control": lambda: wbc.HybridControl(balancing()),
    "stabilizer of a light robot": lambda: Stabilizer(10.0, WrenchDistribution(((0.1, 0.05), (0.1, 0.05)))),
    "obstacle": lambda: wbc.Obstacle("ball", wbc.CollisionSphere(0.1)),
    "behaviour": lambda: tasks.Behaviour("wait", timeout=1.0),
    "walking control": walking,
    "hand of a walk": lambda: walking().arms["left_hand"],
    "robot": lambda: balancing().robot,
}


SOLVERS = ("controller", "inverse kinematics")
DRIVES = ("position control", "torque control", "hybrid control")


def made(what: str, *, added: bool) -> tuple[Any, Any]:
    """Return an object, and what keeps it alive."""
    if what in OBJECTS:
        return (thing := OBJECTS[what]()), thing
    controller = wbc.Controller(wbc.load_robot("hrp4_class").robot(), 0.005)
    items = ITEMS[what](controller.robot)
    items = items if isinstance(items, tuple) else (items,)
    if added:
        controller.add(*items)
    return items[-1], (controller, items)


def assignable(thing: Any) -> list[str]:
    """Return the names of the public attributes of an object that can be assigned, without counts and orders."""
    slots = [name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ())]
    properties = [
        name
        for name, member in inspect.getmembers(type(thing))
        if isinstance(member, property) and member.fset is not None
    ]
    names = {name for name in (*slots, *properties, *vars_of(thing)) if not name.startswith("_")}
    names -= {name for name in names if isinstance(inspect.getattr_static(type(thing), name, None), Fixed)}
    return sorted(names - {"revision"} - ({"velocity"} if isinstance(thing, wbc.WalkingControl) else set()))


def vars_of(thing: Any) -> dict[str, Any]:
    return getattr(thing, "__dict__", {})


def state(thing: Any, depth: int = 0) -> Any:
    """Return what an object holds, of any depth, without counts of changes; of other robots and controllers nothing."""
    if isinstance(thing, np.ndarray):
        return repr([f"{x:.12g}" for x in thing.ravel()] if thing.dtype.kind == "f" else thing.tolist())
    if isinstance(thing, pin.SE3):
        return thing.homogeneous.tolist()
    if isinstance(thing, (list, tuple)):
        return [state(each, depth + 1) for each in thing]
    if isinstance(thing, dict):
        return {str(key): state(each, depth + 1) for key, each in thing.items()}
    if not type(thing).__module__.startswith("wbc.") or depth > 3 or (depth and isinstance(thing, Robot)):
        return repr(thing) if isinstance(thing, (int, float, str, bool, type(None))) else type(thing).__name__
    slots = [name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ())]
    held = {name: getattr(thing, name, None) for name in (*slots, *vars_of(thing))}
    left_out = {"revision", "_fed", "_owner", "_robot", "_assembly", "_solver", "model_time", "_dirty"}
    return {name: state(value, depth + 1) for name, value in held.items() if name not in left_out}


def read(thing: Any, name: str) -> Any:
    """Return a public attribute; `MISSING` where it has no value yet."""
    try:
        return getattr(thing, name)
    except (WbcError, AttributeError):
        return MISSING


everything = pytest.mark.parametrize("what", [*ITEMS, *OBJECTS])


@pytest.mark.parametrize(
    ("what", "added"), [*((what, True) for what in (*ITEMS, *OBJECTS)), *((what, False) for what in ITEMS)]
)
def test_an_attribute_that_is_assigned_as_it_is_read_changes_nothing(what: str, added: bool) -> None:
    thing, kept = made(what, added=added)
    names = assignable(thing)
    assert kept and (names or what == "inverse kinematics")  # whose robot stays
    for name in names:
        value = read(thing, name)
        if value is MISSING:
            continue
        before, seen = state(thing), {each: state(read(thing, each)) for each in names}
        try:
            setattr(thing, name, value)
        except WbcError:
            assert isinstance(thing, Robot)  # which is made anew instead
        after = state(thing)
        changed = {each: (before[each], after[each]) for each in before if before[each] != after[each]}
        assert not changed, f"{name} of {what}"
        if isinstance(value, np.ndarray) and not isinstance(
            thing, Robot
        ):  # nor does a copy change what is read
            setattr(thing, name, np.array(value))
            assert {each: state(read(thing, each)) for each in names} == seen, f"{name} of {what}"


@pytest.mark.parametrize("what", [*ITEMS, *SOLVERS, *DRIVES])
def test_an_option_is_checked_or_refused_where_it_is_assigned(what: str) -> None:
    thing, kept = made(what, added=True)
    options = [*inspect.signature(type(thing).__init__).parameters][1:]
    assert kept and options
    for name in set(options) - {"name", "args", "options", "kwargs"}:
        if what in DRIVES and not hasattr(thing, name):
            continue  # of another object: the failure policy is that of the record
        with pytest.raises((WbcError, AttributeError)):
            setattr(thing, name, object())
        for value in ("nonsense", np.ones(3), np.nan) if what in DRIVES else ():
            with pytest.raises(InputError):
                setattr(thing, name, value)


@pytest.mark.parametrize("name", ["settings", "robot"])
def test_an_observer_has_the_settings_and_the_robot_with_which_its_filters_were_made(name: str) -> None:
    observer = wbc.Observer(balancing().robot)
    with pytest.raises(InputError, match=f"{name} .*another observer"):
        setattr(observer, name, getattr(observer, name))


@pytest.mark.parametrize("kind", [wbc.PositionControl, wbc.HybridControl])
def test_references_of_a_control_can_be_neither_written_nor_swapped(kind: Any) -> None:
    control = kind(balancing())
    for name in ("q", "v"):
        with pytest.raises(InputError, match="reset"):
            setattr(control, name, np.zeros(3))
        with pytest.raises(ValueError, match="read-only"):
            getattr(control, name)[:] = 0.0
    for part in (control.observer.inertial, control.observer.observe_outside()):
        with pytest.raises(InputError, match="settings"):
            part.settings = None


@pytest.mark.parametrize("what", ITEMS)
def test_a_name_is_text_and_stays_while_a_controller_has_the_item(what: str) -> None:
    """Solutions, logs and status tables find items by their names: a second item of one name would be lost."""
    item, (controller, items) = made(what, added=True)
    name = item.name
    for other in (controller.limits or controller.contacts or controller.tasks)[0].name, "other", 5, None:
        if other != name:
            with pytest.raises(InputError, match="name"):
                item.name = other
    assert item.name == name
    if isinstance(item, (wbc.SoleContact, wbc.TorqueLimits, wbc.JointLimits)):
        return  # whose names are those of a sole, or their own
    controller.remove(*items)
    item.name = "other"
    controller.add(*items)
    assert "other" in [each.name for each in (*controller.tasks, *controller.contacts, *controller.limits)]


@everything
def test_a_value_that_is_changed_in_place_changes_the_attribute_or_is_refused(what: str) -> None:
    thing, kept = made(what, added=True)
    assert kept
    for name in assignable(thing):
        part = _part(read(thing, name))
        if not isinstance(part, np.ndarray) or not part.size or part.dtype.kind != "f":
            continue
        try:
            part[...] = part + 0.01
        except ValueError:  # read-only
            continue
        again = _part(read(thing, name))
        assert state(again) == state(part), f"{name} of {what} is a copy that can be written"


def _part(value: Any) -> Any:
    """Return what can be written of a value."""
    return value.translation if isinstance(value, pin.SE3) else value


def settings() -> Iterator[Any]:
    """Every class of settings that has defaults."""
    for module in pkgutil.walk_packages(wbc.__path__, "wbc."):
        for kind in vars(importlib.import_module(module.name)).values():
            if inspect.isclass(kind) and dataclasses.is_dataclass(kind) and kind.__module__ == module.name:
                parameters = inspect.signature(kind).parameters.values()
                if not inspect.isabstract(kind) and all(
                    each.default is not each.empty for each in parameters
                ):
                    yield kind


def test_settings_made_of_what_they_hold_are_the_same() -> None:
    kinds = list(settings())
    assert len(kinds) > 30
    for kind in kinds:
        try:
            one = kind()
        except InputError:  # which needs more
            continue
        other = dataclasses.replace(one)
        for field in dataclasses.fields(kind):
            assert state(getattr(one, field.name)) == state(getattr(other, field.name)), (kind, field.name)
