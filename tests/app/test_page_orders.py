"""Orders of pages: what is offered, refused, dropped and told, and what the largest is."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.app.repeat import RepeatWalk
from wbc.app.view.controls import (
    DIRECTIONS,
    MAX_IMPULSE,
    MAX_ORDERS,
    MAX_SPEED,
    LiveControls,
    intervention_text,
    target_of,
)
from wbc.sim.trial.push import PUSH_DURATION

HRP4 = wbc.load_robot("hrp4_class")


# ---- orders ---------------------------------------------------------------------------------------------------------


class Steered:
    """Something that can be driven and stopped."""

    steered, stabilizer, stiffness = True, None, None
    drives: Any = None

    def __init__(self) -> None:
        self.velocity: Any = None
        self.stops = 0

    def stop(self) -> None:
        self.stops += 1


def test_orders_are_offered_that_the_run_can_carry_out() -> None:
    controller = wbc.balance_controller(HRP4.robot(), 0.005)
    plant = wbc.Plant(HRP4)
    walking: Any = Steered()
    assert LiveControls(None, None).offered == {"set"}
    assert LiveControls(None, None, controller).offered == {"set", "target"}
    assert LiveControls(plant, None).offered == {"set", "push"}
    assert LiveControls(None, walking).offered == {"set", "stop", "drive"}
    walking.steered = False
    assert LiveControls(None, walking).offered == {"set", "stop"}
    walking.drives = SimpleNamespace(controller=controller)
    assert LiveControls(None, walking).controller is controller
    other = wbc.balance_controller(HRP4.robot(), 0.005)
    assert LiveControls(None, walking, other).controller is other


def test_interventions_are_carried_out_at_their_times_and_told_once() -> None:
    walking: Any = Steered()
    orders = [
        {"time": 0.3, "what": "stop"},
        {"time": 0.1, "what": "drive", "forward": 0.2, "left": 0.0, "turn": 0.0},
    ]

    def at(time: float) -> Any:
        return SimpleNamespace(plant=SimpleNamespace(time=time, control_period=0.005), control=walking)

    repeat = RepeatWalk(orders)
    repeat.start(at(0.0))
    assert (controls := repeat.controls) is not None
    repeat.tick(at(0.05))
    assert walking.velocity is None
    repeat.tick(at(0.1))
    assert walking.velocity == (0.2, 0.0, 0.0) and not walking.stops
    assert controls.news() == [orders[1]] and controls.news() == []
    controls.order({"do": "stop"})
    repeat.tick(at(0.25))
    assert walking.stops == 1
    assert [entry["what"] for entry in controls.news()] == ["stop"]
    repeat.tick(at(0.35))
    assert walking.stops == 2 and controls.interventions[-1]["time"] == 0.35
    assert len(controls.news()) == 1


@pytest.mark.parametrize("name", ["forward", "left", "turn"])
def test_a_page_asks_for_no_more_than_the_largest_speed(name: str) -> None:
    for value, taken in ((MAX_SPEED, True), (-MAX_SPEED, True), (1.01 * MAX_SPEED, False), (-11.0, False)):
        walking: Any = Steered()
        controls = LiveControls(None, walking)
        controls.apply({"do": "drive", "forward": 0.0, "left": 0.0, "turn": 0.0} | {name: value})
        assert (walking.velocity is not None) is taken is not controls.message.startswith("refused")


def test_pushes_are_as_large_as_their_impulse_and_no_larger_than_the_largest() -> None:
    """Force = impulse × mass / duration, turned from where the robot looks."""
    plant = wbc.Plant(HRP4)
    pushed: list[Any] = []
    turn = 0.7
    q = plant.truth().q.copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.1, -0.2, turn)).coeffs()
    made: Any = SimpleNamespace(
        robot=plant.robot,
        time=1.0,
        foot=None,
        truth=lambda: SimpleNamespace(q=q),
        push=lambda *how: pushed.append(how),
    )
    controls = LiveControls(made, None)
    for side, angle in DIRECTIONS.items():
        controls.apply({"do": "push", "direction": side, "impulse": 0.3})
        body, force, duration = pushed[-1]
        assert body == "torso" and duration == PUSH_DURATION and force[2] == 0.0
        assert np.hypot(*force[:2]) == pytest.approx(0.3 * plant.robot.mass / PUSH_DURATION)
        assert math.remainder(math.atan2(force[1], force[0]) - turn - angle, math.tau) == pytest.approx(
            0.0, abs=1e-9
        )
    assert DIRECTIONS["left"] == math.pi / 2 == -DIRECTIONS["right"]
    controls.apply({"do": "push", "direction": "left", "impulse": MAX_IMPULSE})
    assert len(pushed) == len(DIRECTIONS) + 1


def test_orders_that_cannot_be_carried_out_are_refused() -> None:
    controls = LiveControls(wbc.Plant(HRP4), None, wbc.balance_controller(HRP4.robot(), 0.005))
    orders: tuple[tuple[dict[str, Any], str], ...] = (
        ({"do": "fly"}, "fly"),
        ({"do": "set", "name": "task com/weight", "value": "much"}, "weight"),
        ({"do": "set", "name": "task com/weight", "value": -1.0}, "weight"),
        ({"do": "set", "name": "task cm/weight", "value": 1.0}, "task com"),
        ({"do": "target", "task": "cm", "target": [0.0, 0.0, 0.8]}, "com"),
        ({"do": "target", "task": "com", "target": [0.0, 0.0]}, "com"),
        ({"do": "push", "direction": "left", "impulse": -0.1}, "impulse"),
        ({"do": "push", "direction": "left", "impulse": 1.01 * MAX_IMPULSE}, "impulse"),
    )
    for order, named in orders:
        controls.apply(order)
        assert controls.message.startswith("refused") and named in controls.message, order
    assert not controls.interventions


def test_the_oldest_orders_are_dropped() -> None:
    walking: Any = Steered()
    controls = LiveControls(None, walking)
    for _ in range(MAX_ORDERS + 5):
        controls.order({"do": "stop"})
    controls.update(0.0)
    assert walking.stops == MAX_ORDERS


def test_only_a_robot_that_moves_and_that_a_page_drives_is_halted() -> None:
    ahead, turning, still = (0.1, 0.0, 0.0), (0.0, 0.0, -0.1), (0.0, 0.0, 0.0)
    for velocity, what, steered, halted in (
        (ahead, "drive", True, True),
        (turning, "drive", True, True),
        (ahead, "stop", True, False),
        (None, "drive", True, False),
        (still, "drive", True, False),
        (ahead, "drive", False, False),
    ):
        walking: Any = Steered()
        controls = LiveControls(None, walking)
        controls.interventions.append({"time": 0.0, "what": what})
        walking.velocity, walking.steered = velocity, steered
        controls.halt()
        assert (controls.interventions[-1].get("forward") == 0.0) is halted
        assert walking.velocity == (still if halted else velocity)


def test_targets_are_of_the_kind_and_shape_of_the_task_and_not_of_one_that_is_held() -> None:
    controller = wbc.balance_controller(HRP4.robot(), 0.005)
    pose = controller.add(wbc.PoseTask("left_hand", name="hand"))
    controls = LiveControls(None, None, controller)
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3)).coeffs().tolist()
    controls.apply({"do": "target", "task": "hand", "target": [1.0, 2.0, 3.0, *turn]})
    assert pose.target.translation.tolist() == [1.0, 2.0, 3.0]
    controls.apply({"do": "target", "task": "hand", "target": np.array([1.0, 2.0, 3.0, *turn])})
    assert [entry["target"] for entry in controls.news()] == [[1.0, 2.0, 3.0, *turn]] * 2
    np.testing.assert_allclose(pose.target.rotation, pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), atol=1e-12)
    assert target_of(SimpleNamespace(name="t", target=np.zeros((3, 3))), np.eye(3).tolist()).shape == (3, 3)
    held: Any = SimpleNamespace(name="hand", held_by="behaviour", target=np.zeros(3))
    other: Any = SimpleNamespace(task=lambda name: held, tasks=())
    controls = LiveControls(None, None, other)
    controls.apply({"do": "target", "task": "hand", "target": [1.0, 2.0, 3.0]})
    assert "behaviour" in controls.message and not controls.interventions


def test_settings_have_the_present_values_and_hard_tasks_have_no_weight() -> None:
    controller = wbc.balance_controller(HRP4.robot(), 0.005)
    controller.add(wbc.PositionTask("left_hand", name="soft", weight=[1.0, 5.0, 2.0], stiffness=30.0))
    controller.add(wbc.PositionTask("right_hand", name="hard", hard=True))
    controls = LiveControls(None, None, controller)
    found = controls.settings
    assert found["task soft/weight"].value == 5.0 and found["task soft/stiffness"].value == pytest.approx(
        30.0
    )
    assert found["task soft/stiffness"].unit == "1/s²"
    assert "task hard/weight" not in found and "task hard/stiffness" in found
    controls.apply({"do": "set", "name": "task soft/weight", "value": 7.0})
    assert controls.settings["task soft/weight"].value == 7.0
    controller.remove(controller.task("soft"))
    assert found.keys() - controls.settings.keys() == {
        f"task soft/{name}" for name in ("weight", "stiffness", "damping")
    }
    free: Any = SimpleNamespace(name="t", hard=True, stiffness=np.zeros(1), damping=np.array([2.0]))
    controls.controller = cast(Any, SimpleNamespace(tasks=[free]))
    assert set(controls.settings) == {"task t/damping"}, "no gain that is none"


def test_interventions_are_told_with_their_figures() -> None:
    drive = {"time": 1.0, "what": "drive", "forward": 0.25, "left": -0.5, "turn": 0.125}
    assert intervention_text(drive) == "1.00 s: driven at 0.25 m/s forward, -0.50 m/s left, 0.12 rad/s"
    assert (
        intervention_text({"time": 2.0, "what": "set", "name": "a/b", "value": 1.5})
        == "2.00 s: a/b set to 1.5"
    )
