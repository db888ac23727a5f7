"""Pages and orders: pace, waiting, drives, gizmos and plots, by a clock and a page that are made."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from contextlib import nullcontext, suppress
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.app import MeshcatView
from wbc.app.replay import player
from wbc.app.replay.player import Player
from wbc.app.view import base, meshcat_view, viser_page, workbench
from wbc.app.view.base import CATCH_UP_TIME, FIRST_PORT, MAX_STEP, PORTS, View, free_port
from wbc.app.view.controls import (
    DIRECTIONS,
    MAX_IMPULSE,
    MAX_ORDERS,
    MAX_SPEED,
    LiveControls,
    intervention_text,
    target_of,
)
from wbc.app.view.marks import DCM_COLOUR, Mark, Picture, Scale
from wbc.app.view.viser_page import PLOT_TIME, BalancePlot, ViserPage, paint
from wbc.app.view.walk_hook import WatchWalk
from wbc.app.view.workbench import Gizmo, Workbench, program_text
from wbc.base.errors import InputError
from wbc.core.signals import Command
from wbc.sim.trial.push import PUSH_DURATION

HRP4 = wbc.load_robot("hrp4_class")


class Clock:
    """A clock that goes on while somebody sleeps."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *modules: Any, start: float = 100.0) -> None:
        self.now, self.slept = start, list[float]()
        names = {"perf_counter": lambda: self.now, "monotonic": lambda: self.now, "sleep": self.sleep}
        for module in modules:
            monkeypatch.setattr(module, "clock", SimpleNamespace(**names))

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.slept.append(seconds)


class Bare(View):
    """A view that serves nothing."""

    open_pages = 0

    def _open(self, port: int) -> None:
        self.url, self.sent = f"http://127.0.0.1:{port}/", list[Picture]()

    def _build(self) -> None:
        pass

    @property
    def pages(self) -> int:
        return self.open_pages

    def _send(self, picture: Picture) -> None:
        self.sent.append(picture)

    def _end(self) -> None:
        self.ends = getattr(self, "ends", 0) + 1


# ---- pace -----------------------------------------------------------------------------------------------------------


def test_a_run_waits_for_the_clock_and_does_not_catch_up_what_is_long_gone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hours = Clock(monkeypatch, base)
    view = Bare(HRP4, port=0, speed=2.0)
    view._wait_for(0.1)
    assert view._due == hours.now and not hours.slept, "the first tick is where the clock is"
    view._wait_for(0.2)
    assert hours.slept == pytest.approx([0.05]), "0.1 s at twice its pace"
    hours.now += 0.05 + 0.9 * CATCH_UP_TIME
    view._wait_for(0.3)
    assert hours.slept[-1] == 0.0 and view._due == pytest.approx(100.1), "late, and it catches up"
    hours.now += 0.2 * CATCH_UP_TIME + 0.05
    view._wait_for(0.4)
    assert view._due == hours.now and len(hours.slept) == 2, "too late"
    for time in (0.4 + 1.01 * MAX_STEP, 0.2):
        view._due = hours.now + 50.0
        view._wait_for(time)
        assert view._due == hours.now, "another run, or one that has begun anew"
    view._wait_for(0.2 + 0.99 * MAX_STEP)
    assert hours.slept[-1] == pytest.approx(0.5 * 0.99 * MAX_STEP)
    view.speed = None
    count = len(hours.slept)
    view._wait_for(view._time + 0.5)
    assert len(hours.slept) == count


def test_pictures_come_with_their_period(monkeypatch: pytest.MonkeyPatch) -> None:
    hours = Clock(monkeypatch, base)
    view = Bare(HRP4, port=0, rate=10.0)
    robot = HRP4.robot()
    shown = []
    for _ in range(25):
        view.update(robot)
        shown.append(view.frames)
        hours.now += 0.04
    assert shown == [1 + i // 3 for i in range(25)], "0.12 s apart: the first tick after 0.1 s"
    view.close()
    view.close()
    assert view.ends == 1 and view.closed


@pytest.mark.parametrize(("opens", "waits"), [(3.0, 3.0), (math.inf, 5.0)])
def test_a_run_waits_for_a_page_as_long_as_it_may(
    opens: float, waits: float, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    hours = Clock(monkeypatch, base)
    view = Bare(HRP4, port=0)
    monkeypatch.setattr(Bare, "pages", property(lambda self: int(hours.now >= 100.0 + opens)))
    assert view.wait_for_page(5.0) is (opens < 5.0)
    assert hours.now - 100.0 == pytest.approx(waits, abs=0.03) and "5 s" in capsys.readouterr().err
    assert not Bare(HRP4, port=0).wait_for_page(0.0) or opens < 5.0
    assert "open it now" not in capsys.readouterr().err
    closed = Bare(HRP4, port=0)
    closed.close()
    begin = hours.now
    monkeypatch.setattr(Bare, "pages", property(lambda self: 0))
    assert not closed.wait_for_page(5.0) and hours.now == begin, "nobody can open it"


def test_what_a_view_says_of_program_control_and_end() -> None:
    plant = wbc.Plant(HRP4)
    control = wbc.PositionControl(wbc.balance_controller(plant.robot, plant.control_period))
    program: Any = SimpleNamespace(path="demo/wait", control=control)
    view = Bare(plant, control, port=0)
    view._program = program
    assert view.walking is None and view.steered is None
    assert not view.ended("fell")
    view.close()
    text = view.sent[-1].text
    assert text[0] == "demo/wait" and text[-1] == "the run has ended: fell"
    assert any(line.startswith("control: ") for line in text)
    assert not any("ended" in line for line in view.sent[0].text)
    with pytest.raises(InputError, match="a view shows"):
        Bare(plant, 3, port=0)
    with pytest.raises(InputError, match="update"):
        Bare(plant, port=0).update(plant.robot)
    with pytest.raises(InputError, match="update"):
        Bare(HRP4, port=0).update()


def test_the_time_of_a_described_robot_is_that_of_its_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    Clock(monkeypatch, base)
    view = Bare(HRP4, port=0)
    view.update(HRP4.robot(), measurement=SimpleNamespace(time=7.5, sole_wrench=None))  # type: ignore[arg-type]
    assert view._time == 7.5 and view.sent[-1].time == 7.5
    view.update(HRP4.robot())
    assert view._time == 7.5, "without one the run has not gone on"


def test_the_first_free_port_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = set(range(FIRST_PORT, FIRST_PORT + 3))

    class Probe:
        def __enter__(self) -> Any:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def setsockopt(self, *_: object) -> None:
            pass

        def bind(self, place: tuple[str, int]) -> None:
            if place[1] in taken:
                raise OSError
            self.port = place[1]

        def getsockname(self) -> tuple[str, int]:
            return "127.0.0.1", self.port

    monkeypatch.setattr(base.socket, "socket", Probe)
    assert free_port(None) == FIRST_PORT + 3 and free_port(8123) == 8123
    taken = set(range(FIRST_PORT, FIRST_PORT + PORTS))
    with pytest.raises(base.PortError, match=f"every port from {FIRST_PORT}"):
        free_port(None)
    with pytest.raises(base.PortError, match=f"port {FIRST_PORT} "):
        free_port(FIRST_PORT)


# ---- orders ---------------------------------------------------------------------------------------------------------


class Steered:
    """Something that can be driven and stopped."""

    steered, controller, stabilizer, stiffness = True, None, None, None

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
    walking.controller = controller
    assert LiveControls(None, walking).controller is controller
    other = wbc.balance_controller(HRP4.robot(), 0.005)
    assert LiveControls(None, walking, other).controller is other


def test_interventions_are_carried_out_at_their_times_and_told_once() -> None:
    walking: Any = Steered()
    orders = [
        {"time": 0.3, "what": "stop"},
        {"time": 0.1, "what": "drive", "forward": 0.2, "left": 0.0, "turn": 0.0},
    ]
    controls = LiveControls(None, walking, repeat=orders)
    controls.update(0.05)
    assert walking.velocity is None
    controls.update(0.1)
    assert walking.velocity == (0.2, 0.0, 0.0) and not walking.stops
    assert json.loads(controls.news()) == [orders[1]] and controls.news() == ""
    controls.order({"do": "stop"})
    controls.update(0.25)
    assert walking.stops == 1
    assert [entry["what"] for entry in json.loads(controls.news())] == ["stop"]
    controls.update(0.35)
    assert walking.stops == 2 and controls.interventions[-1]["time"] == 0.35
    assert len(json.loads(controls.news())) == 1


def test_only_the_last_drive_of_a_tick_counts_and_others_stay() -> None:
    walking: Any = Steered()
    controls = LiveControls(None, walking)

    def drive(time: float, forward: float) -> None:
        controls.update(time)
        controls.apply({"do": "drive", "forward": forward, "left": 0.1, "turn": -0.1})

    drive(1.0, 0.1)
    drive(1.0, 0.2)
    drive(2.0, 0.3)
    controls.apply({"do": "stop"})
    drive(2.0, 0.4)
    told = [(entry["time"], entry["what"], entry.get("forward")) for entry in controls.interventions]
    assert told == [(1.0, "drive", 0.2), (2.0, "drive", 0.3), (2.0, "stop", None), (2.0, "drive", 0.4)]


@pytest.mark.parametrize("name", ["forward", "left", "turn"])
@pytest.mark.parametrize(
    ("value", "taken"),
    [(MAX_SPEED, True), (-MAX_SPEED, True), (1.01 * MAX_SPEED, False), (-1.01 * MAX_SPEED, False)],
)
def test_a_page_asks_for_no_more_than_the_largest_speed(name: str, value: float, taken: bool) -> None:
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
    count = len(pushed)
    for impulse in (-0.1, 1.01 * MAX_IMPULSE):
        controls.apply({"do": "push", "direction": "left", "impulse": impulse})
    assert len(pushed) == count
    controls.apply({"do": "push", "direction": "left", "impulse": MAX_IMPULSE})
    assert len(pushed) == count + 1


@pytest.mark.parametrize(
    "order", [3, {}, {"do": 3}, {"do": "fly"}, {"do": "set", "name": "x", "value": "much"}]
)
def test_orders_that_are_none_are_refused(order: Any) -> None:
    controls = LiveControls(None, None)
    controls.apply(order)
    assert controls.message.startswith("refused") and not controls.interventions


def test_the_oldest_orders_are_dropped_and_none_is_taken_at_the_end() -> None:
    walking: Any = Steered()
    controls = LiveControls(None, walking)
    for _ in range(MAX_ORDERS + 5):
        controls.order({"do": "stop"})
    controls.update(0.0)
    assert walking.stops == MAX_ORDERS
    controls.order({"do": "stop"})
    controls.end()
    controls.order({"do": "stop"})
    controls.update(0.0)
    assert walking.stops == MAX_ORDERS and "ended" in controls.message


@pytest.mark.parametrize(
    ("velocity", "driven", "halted"),
    [
        ((0.1, 0.0, 0.0), True, True),
        ((0.0, 0.0, -0.1), True, True),
        ((0.1, 0.0, 0.0), False, False),
        (None, True, False),
        ((0.0, 0.0, 0.0), True, False),
    ],
)
def test_only_a_robot_that_moves_and_that_a_page_drives_is_halted(
    velocity: Any, driven: bool, halted: bool
) -> None:
    walking: Any = Steered()
    controls = LiveControls(None, walking)
    controls.interventions.append({"time": 0.0, "what": "drive" if driven else "stop"})
    walking.velocity = velocity
    controls.halt()
    assert (controls.interventions[-1].get("forward") == 0.0) is halted
    assert walking.velocity == ((0.0, 0.0, 0.0) if halted else velocity)
    walking.steered = False
    still = LiveControls(None, walking)
    still.interventions.append({"time": 0.0, "what": "drive"})
    still.halt()
    assert len(still.interventions) == 1


def test_targets_are_of_the_kind_and_shape_of_the_task_and_not_of_one_that_is_held() -> None:
    controller = wbc.balance_controller(HRP4.robot(), 0.005)
    pose = controller.add(wbc.PoseTask("left_hand", name="hand"))
    controls = LiveControls(None, None, controller)
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3)).coeffs().tolist()
    controls.apply({"do": "target", "task": "hand", "target": [1.0, 2.0, 3.0, *turn]})
    assert pose.target.translation.tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(pose.target.rotation, pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), atol=1e-12)
    assert target_of(SimpleNamespace(name="t", target=np.zeros((3, 3))), np.eye(3).tolist()).shape == (3, 3)
    held: Any = SimpleNamespace(name="hand", held_by="behaviour", target=np.zeros(3))
    controls.controller = SimpleNamespace(task=lambda name: held, tasks=())
    controls.apply({"do": "target", "task": "hand", "target": [1.0, 2.0, 3.0]})
    assert "behaviour" in controls.message and len(controls.interventions) == 1


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
    free: Any = SimpleNamespace(name="t", hard=True, stiffness=np.zeros(1), damping=np.array([2.0]))
    controls.controller = SimpleNamespace(tasks=[free])
    assert set(controls.settings) == {"task t/damping"}, "no gain that is none"


def test_interventions_are_told_with_their_figures() -> None:
    drive = {"time": 1.0, "what": "drive", "forward": 0.25, "left": -0.5, "turn": 0.125}
    assert intervention_text(drive) == "1.00 s: driven at 0.25 m/s forward, -0.50 m/s left, 0.12 rad/s"
    assert (
        intervention_text({"time": 2.0, "what": "set", "name": "a/b", "value": 1.5})
        == "2.00 s: a/b set to 1.5"
    )


# ---- the hook -------------------------------------------------------------------------------------------------------


class Shown:
    """A page that notes what it is asked."""

    def __init__(self, *what: Any, **options: Any) -> None:
        self.opened, self.options, self.closed = [what], options, False
        self.waits: list[float] = []
        self.updates: list[Any] = []

    def show(self, *what: Any) -> None:
        self.opened.append(what)

    def wait_for_page(self, seconds: float) -> None:
        self.waits.append(seconds)

    def update(self, *state: Any, **measured: Any) -> None:
        self.updates.append(state)

    def ended(self, how: str) -> bool:
        return how == "again"

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> list[Shown]:
    made: list[Shown] = []

    def make(*what: Any, **options: Any) -> Shown:
        made.append(Shown(*what, **options))
        return made[-1]

    monkeypatch.setattr(meshcat_view, "MeshcatView", make)
    monkeypatch.setattr(workbench, "Workbench", make)
    return made


def trial_of(plant: Any) -> Any:
    return SimpleNamespace(plant=plant, control="walking")


def test_a_hook_opens_one_page_waits_for_it_and_ends_it(pages: list[Shown]) -> None:
    plant = wbc.Plant(HRP4)
    hook = WatchWalk(wait=3.0, speed=2.0, port=0)
    assert hook.controls is None and not hook.restarted("again")
    hook.close()
    hook.start(trial_of(plant))
    hook.start(trial_of(plant))
    (page,) = pages
    assert (
        page.opened == [(plant, "walking")]
        and page.waits == [3.0, 3.0]
        and page.options == {"port": 0, "speed": 2.0}
    )
    assert hook.controls is None, "MeshCat's page has none"
    hook.tick(SimpleNamespace(plant=plant))  # type: ignore[arg-type]
    assert page.updates == [()]
    assert hook.restarted("again") and not hook.restarted("enough")
    hook.end(None)
    assert page.closed and not hook.restarted("again")
    hook.start(trial_of(plant))
    assert len(pages) == 2, "a closed page is not opened again"
    quiet = WatchWalk()
    quiet.start(trial_of(plant))
    assert pages[-1].waits == []


def test_a_page_that_stays_shows_the_next_trial(pages: list[Shown]) -> None:
    plant = wbc.Plant(HRP4)
    hook = WatchWalk("workbench", stay=True)
    hook.open(trial_of(plant))
    hook.start(trial_of(plant))
    hook.end(None)
    pages[0].controls = "controls"  # type: ignore[attr-defined]
    assert hook.controls == "controls" and not pages[0].closed
    hook.open(trial_of(plant))
    assert len(pages) == 1 and pages[0].opened == [(plant, "walking")] * 2
    hook.close()
    hook.open(trial_of(plant))
    assert len(pages) == 2


def test_of_a_loop_without_a_model_the_robot_is_shown_alone(pages: list[Shown]) -> None:
    loop: Any = SimpleNamespace(description=HRP4, truth=lambda: SimpleNamespace(q="state"))
    hook = WatchWalk()
    hook.tick(SimpleNamespace(plant=loop, measurement=None))  # type: ignore[arg-type]
    hook.start(trial_of(loop))
    hook.tick(SimpleNamespace(plant=loop, measurement=None))  # type: ignore[arg-type]
    assert pages[0].opened == [(HRP4, None)] and pages[0].updates == [("state",)]


# ---- MeshCat --------------------------------------------------------------------------------------------------------


def test_meshcat_gets_what_changes_and_its_caption_while_a_page_is_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hours = Clock(monkeypatch, meshcat_view)
    plant = wbc.Plant(HRP4)
    stage: Any = base.SimulatedStage(plant, None)
    sent: list[tuple[str, str, Any]] = []
    view = MeshcatView.__new__(MeshcatView)

    class Kind:
        def __getattr__(self, name: str) -> Any:
            return name

    server = SimpleNamespace(busy=False, pages=[], send=lambda _, caption: told.append(caption))
    view._commands, view.stage, view.closed, view.frames = Kind(), stage, False, 2
    view._meshes, view._marks, view._colours, view._meanings = {1: ["a", "b"], 2: ["c"]}, {}, {}, {}
    view._spoken, view._orders, view._server = -math.inf, [], server  # type: ignore[assignment]
    told: list[Any] = []

    def captions() -> list[Any]:
        return [json.loads(text) for text in told if text is not None]

    monkeypatch.setattr(view, "_order", lambda path, kind, *values: sent.append((path, kind, values)))
    monkeypatch.setattr(
        view, "_set_mesh", lambda path, mesh, colour, on_top=False: sent.append((path, "mesh", on_top))
    )
    ball = Mark("b", "ball", np.zeros((1, 3)), DCM_COLOUR, meaning="point")
    line = Mark("l", "line", np.zeros((2, 3)), DCM_COLOUR)
    picture = Picture(1.0, [ball, line], ["text"], np.array([1.0, 2.0, 9.0]), {1: DCM_COLOUR})
    view._send(picture)
    assert [path for path, kind, _ in sent if kind == "SetProperty"] == ["a", "b"]
    marks = {path.rpartition("/")[2]: on_top for path, kind, on_top in sent if kind == "mesh"}
    assert marks == {"b": True, "l": False}
    world = next(values[0] for path, _, values in sent if path == meshcat_view.ROOT)
    assert world[:3, 3] == pytest.approx([-1.0, -2.0, -stage.floor - 0.8 * stage.scale.height])
    body = next(values[0] for path, _, values in sent if path.endswith("body 2"))
    np.testing.assert_allclose(body[:3, 3], plant.data.xpos[2])
    np.testing.assert_allclose(body[:3, :3], plant.data.xmat[2].reshape(3, 3))
    assert not captions(), "nobody watches"
    sent.clear()
    server.pages = [1]
    view._send(Picture(2.0, [ball], ["text"], colours={1: DCM_COLOUR}))
    assert not [each for each in sent if each[1] in ("SetProperty", "mesh")], "nothing else has changed"
    assert [path.rpartition("/")[2] for path, kind, _ in sent if kind == "Delete"] == ["l"]
    assert captions()[-1]["lines"] == ["2.00 s", "text"] and captions()[-1]["legend"][0][0] == "point"
    hours.now += 0.9 * meshcat_view.TEXT_PERIOD
    view._send(picture)
    assert len(captions()) == 1
    hours.now += 0.2 * meshcat_view.TEXT_PERIOD
    view._send(picture)
    assert len(captions()) == 2
    view.closed = True
    view._send(picture)
    assert len(captions()) == 3, "the last caption comes in any case"
    for first, expected in ((1, 4), (2, 4)):
        view.closed, view.frames, server.pages = False, first, []
        hours.now += 1.0
        view._send(picture)
        assert len(captions()) == expected, "and the first one"
    server.busy, view.frames = True, 3
    sent.clear()
    view._send(Picture(9.0))
    assert not sent and view._marks, "a picture is skipped while the last one is on its way"


def test_colours_and_places_are_sent_as_meshcat_takes_them() -> None:
    from meshcat import geometry  # noqa: PLC0415

    view = MeshcatView.__new__(MeshcatView)
    view._geometry, view._commands = geometry, SimpleNamespace(SetObject="object", SetTransform="move")
    sent: list[Any] = []
    view._order = lambda path, kind, *values: sent.append(values[0])  # type: ignore[method-assign]
    mesh = base.SimulatedStage  # noqa: F841
    from wbc.app.view.meshes import box  # noqa: PLC0415

    for on_top in (False, True):
        view._set_mesh("p", box(1.0, 1.0, 1.0), (1.0, 0.5, 0.2, 0.7), on_top=on_top)
        material = sent[-1].material
        assert material.color == 0xFF8033 and material.opacity == 0.7
        assert ("depthTest" in material.properties) is on_top
    view._move("p", np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(sent[-1], [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])


# ---- viser ----------------------------------------------------------------------------------------------------------


class Handle(SimpleNamespace):
    """An element of a page; `fire` is what a user does with it."""

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self.calls: list[Any] = []
        self.removed = False

    def on_update(self, call: Any) -> None:
        self.calls.append(call)

    on_click = on_trigger = on_update

    def remove(self) -> None:
        self.removed = True

    def fire(self, **event: Any) -> None:
        for call in self.calls:
            with suppress(StopIteration):
                call(SimpleNamespace(**event)).send(None)

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        pass


class Gui:
    """A panel whose elements are kept by their labels."""

    def __init__(self) -> None:
        self.made: dict[str, Handle] = {}

    def _keep(self, name: str, *_: Any, **values: Any) -> Handle:
        self.made[name] = Handle(**values)
        return self.made[name]

    def add_slider(self, label: str, low: float, high: float, step: float, value: float) -> Handle:
        return self._keep(label, min=low, max=high, step=step, value=value)

    def add_command(self, label: str, hotkey: str) -> Handle:
        return self._keep(hotkey, label=label)

    def add_number(self, label: str, value: float, **how: Any) -> Handle:
        return self._keep(label, value=value, **how)

    def add_checkbox(self, label: str, value: bool) -> Handle:
        return self._keep(label, value=value)

    def add_dropdown(self, label: str, options: tuple[str, ...], initial_value: str | None = None) -> Handle:
        return self._keep(label, value=initial_value or options[0])

    def add_html(self, content: str) -> Handle:
        return self._keep(f"html {len(self.made)}", content=content)

    def __getattr__(self, name: str) -> Callable[..., Handle]:
        return self._keep


def test_keys_and_sliders_drive_within_what_the_robot_grants() -> None:
    """Limits ahead, back, aside and in turns are rounded down to centimetres a second; a key is a quarter of them."""
    view, orders = Workbench.__new__(Workbench), list[dict[str, Any]]()
    view._gui, view._commands = Gui(), []
    view.controls = SimpleNamespace(order=orders.append)  # type: ignore[assignment]
    view._drive_folder((0.409, 0.206, 0.159, 0.807))
    made = view._gui.made
    ranges = {
        name: (made[name].min, made[name].max) for name in ("forward (m/s)", "left (m/s)", "turn (rad/s)")
    }
    assert ranges == {"forward (m/s)": (-0.2, 0.4), "left (m/s)": (-0.15, 0.15), "turn (rad/s)": (-0.8, 0.8)}
    for key, part, wanted in (
        ("i", "forward", 0.1),
        ("i", "forward", 0.2),
        ("k", "forward", 0.15),
        ("j", "turn", 0.2),
        ("l", "turn", 0.0),
        ("u", "left", 0.04),
        ("o", "left", 0.0),
    ):
        made[key].fire()
        assert orders[-1]["do"] == "drive" and orders[-1][part] == pytest.approx(wanted, abs=0.011), (
            key,
            orders[-1],
        )
    for _ in range(9):
        made["i"].fire()
    assert orders[-1]["forward"] == 0.4
    for _ in range(20):
        made["k"].fire()
    assert orders[-1]["forward"] == -0.2
    made["space"].fire()
    assert orders[-1] == {"do": "drive", "forward": 0.0, "left": 0.0, "turn": 0.0}
    made["turn (rad/s)"].value = 0.3
    count = len(orders)
    made["turn (rad/s)"].fire(client=None)
    assert len(orders) == count, "moved by the program"
    made["turn (rad/s)"].fire(client=1)
    assert orders[-1]["turn"] == 0.3 and len(view._commands) == 7


@pytest.mark.parametrize(
    ("target", "moves", "turns"),
    [
        (np.array([1.0, 2.0, 3.0]), True, False),
        (pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), False, True),
        (pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0])), True, True),
    ],
)
def test_a_gizmo_follows_its_target_and_moves_it_as_the_task_takes_it(
    target: Any, moves: bool, turns: bool
) -> None:
    made: dict[str, Handle] = {}

    def add(name: str, **how: Any) -> Handle:
        made[name] = Handle(position=None, wxyz=None, **how)
        return made[name]

    page: Any = SimpleNamespace(server=SimpleNamespace(scene=SimpleNamespace(add_transform_controls=add)))
    frame = pin.SE3(np.eye(3), np.array([7.0, 8.0, 9.0]))
    task: Any = SimpleNamespace(
        name="a/b", target=target, frame="f", robot=SimpleNamespace(placement=lambda frame_: frame)
    )
    orders: list[dict[str, Any]] = []
    gizmo = Gizmo(page, task, 0.3, orders.append)
    (handle,) = made.values()
    assert (handle.disable_axes, handle.disable_sliders, handle.disable_rotations) == (
        not moves,
        not moves,
        not turns,
    )
    gizmo.follow()
    assert handle.position is None, "hidden"
    gizmo.show(True)
    place = [1.0, 2.0, 3.0] if moves else [7.0, 8.0, 9.0]
    assert np.asarray(handle.position).tolist() == place
    w, x, y, z = handle.wxyz
    wanted = pin.rpy.rpyToMatrix(0.1, 0.2, 0.3) if turns else np.eye(3)
    np.testing.assert_allclose(pin.Quaternion(w, x, y, z).matrix(), wanted, atol=1e-12)
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, 1.0))
    moved = SimpleNamespace(position=(4.0, 5.0, 6.0), wxyz=(2.0 * turn.w, 0.0, 0.0, 2.0 * turn.z))
    handle.fire(phase="update", target=moved)
    told = orders[-1]["target"]
    assert orders[-1]["task"] == "a/b"
    if not moves:
        np.testing.assert_allclose(told, turn.matrix(), atol=1e-12)
    else:
        assert told == pytest.approx([4.0, 5.0, 6.0, *(turn.coeffs() if turns else ())])
    handle.position = None
    gizmo.follow()
    assert handle.position is None, "somebody holds it"
    handle.fire(phase="end", target=moved)
    gizmo.follow()
    assert handle.position is not None
    gizmo.remove()
    assert handle.removed


def test_the_panel_has_the_settings_of_the_tasks_as_they_are() -> None:
    plant = wbc.Plant(HRP4)
    controller = wbc.balance_controller(HRP4.robot(), plant.control_period)
    view, orders = Workbench.__new__(Workbench), list[Any]()
    gizmos: list[str] = []
    view._gui, view._gizmos, view._shown, view._room = Gui(), [], [], None
    sizes: list[float] = []

    def add(name: str, **how: Any) -> Any:
        gizmos.append(name)
        sizes.append(how["scale"])
        return Handle(**how)

    scene = SimpleNamespace(add_transform_controls=add)
    view._page = SimpleNamespace(server=SimpleNamespace(scene=scene), checkbox=lambda *_: None)  # type: ignore[assignment]
    view.stage = SimpleNamespace(scale=Scale(0.8, 400.0))  # type: ignore[assignment]
    view.controls = LiveControls(None, None, controller)
    view.controls.order = orders.append  # type: ignore[method-assign]
    view._match()
    shown = list(view._shown)
    assert shown == list(view.controls.settings) and "task com" in view._gui.made
    assert any("com" in name for name in gizmos) and not any("posture" in name for name in gizmos)
    assert sizes == pytest.approx([0.2] * len(gizmos)), "a quarter of the height of the CoM"
    number = view._gui.made["weight"]
    number.value = 3.0
    number.fire()
    assert orders[-1]["do"] == "set" and orders[-1]["name"].endswith("/weight") and orders[-1]["value"] == 3.0
    count = len(gizmos)
    view._match()
    assert len(gizmos) == count, "nothing has come or gone"
    room = view._room
    controller.add(wbc.PositionTask("left_hand", name="hand"))
    view._match()
    assert room.removed and len(gizmos) == 2 * count + 1


def test_the_page_moves_the_world_under_a_robot_that_it_follows_and_makes_it_thin() -> None:
    page = ViserPage.__new__(ViserPage)
    page._target, page._root = np.array([1.0, -2.0, 0.9]), SimpleNamespace(position=None)
    page._follow(True)
    assert page._root.position == (-1.0, 2.0, 0.0)
    page._follow(False)
    assert page._root.position == (0.0, 0.0, 0.0) and not page._follows
    meshes = {body: [SimpleNamespace(opacity=None)] for body in (0, 1)}
    page._meshes = meshes
    page._see_through(True)
    assert (meshes[0][0].opacity, meshes[1][0].opacity) == (None, 0.4)
    page._see_through(False)
    assert meshes[1][0].opacity is None
    assert paint((0.0, 0.5, 1.0, 1.0)) == {"color": (0, 128, 255), "opacity": None}
    assert paint((0.0, 0.5, 1.0, 0.3))["opacity"] == 0.3


def test_a_page_is_built_for_the_size_of_its_robot_and_drawn_where_bodies_and_marks_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The camera stands at (2.6, −2, 1.7) heights and looks at 0.8 of one; the grid lies on the floor."""
    page, server = ViserPage.__new__(ViserPage), MagicMock()
    nodes: dict[str, Any] = {}

    def node(name: str, *parts: Any, **how: Any) -> Any:
        nodes[name] = SimpleNamespace(parts=parts, how=how, color=how.get("color"), removed=False)
        if len(parts) > 1:
            nodes[name].vertices = np.asarray(parts[0], dtype=np.float32)
        nodes[name].remove = lambda: setattr(nodes[name], "removed", True)
        return nodes[name]

    scene = server.scene
    scene.add_frame = scene.add_grid = scene.add_mesh_simple = node
    server.atomic = nullcontext
    page.server = server
    monkeypatch.setattr(viser_page, "BalancePlot", lambda gui: MagicMock())
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom type="plane" size="1 1 0.1" rgba="0.25 0.5 0.75 1"/>
        <body name="box" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.2 0.3" rgba="1 0.5 0 1"/></body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    stage: Any = SimpleNamespace(scale=SimpleNamespace(height=0.5), floor=-0.3, model=model, data=data)
    page.build(stage)
    assert server.initial_camera.position == pytest.approx((1.3, -1.0, 0.85))
    assert server.initial_camera.look_at == pytest.approx((0.0, 0.0, 0.4))
    (grid,) = [each for name, each in nodes.items() if name.endswith("/grid")]
    assert grid.parts == (40.0, 40.0) and grid.how["position"] == (0.0, 0.0, -0.3)
    meshes = {name: each for name, each in nodes.items() if "/body " in name and len(each.parts) == 2}
    assert {name.partition("/body ")[2][0]: each.how["cast_shadow"] for name, each in meshes.items()} == {
        "0": False,
        "1": True,
    }
    data.qpos[:] = [1.0, 2.0, 3.0, 0.6, 0.0, 0.8, 0.0]
    mujoco.mj_kinematics(model, data)
    ball = Mark("zmp", "ball", np.array([[0.5, 0.25, 0.0]]), (0.2, 0.4, 0.6, 0.5), 0.02, "here")
    target, body = np.array([1.0, 2.0, 0.5]), (0.0, 1.0, 0.0, 1.0)
    page.draw(Picture(1.5, [ball], ["walks"], target, {1: body}))
    (frame,) = [each for name, each in nodes.items() if name.endswith("/body 1")]
    np.testing.assert_allclose(frame.position, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(frame.wxyz, [0.6, 0.0, 0.8, 0.0])
    (box,) = [each for name, each in meshes.items() if "/body 1/" in name]
    assert box.color == (0, 255, 0) and page._root.position == (-1.0, -2.0, 0.0)
    (mark,) = [each for name, each in nodes.items() if name.endswith("/marks/zmp")]
    assert mark.how["color"] == (51, 102, 153) and mark.how["opacity"] == 0.5
    assert page._said == viser_page.text_html("1.50 s", "walks") and page._meanings
    moved = Mark("zmp", "ball", np.array([[0.7, 0.25, 0.0]]), ball.colour, 0.02)
    count = len(nodes)
    page.draw(Picture(1.6, [moved], [], target))
    assert len(nodes) == count and mark.vertices[:, 0].mean() == pytest.approx(0.7, abs=1e-3)
    page.draw(Picture(1.7, [], [], target))
    assert mark.removed


def test_texts_are_brought_up_to_date_with_their_period_or_now(monkeypatch: pytest.MonkeyPatch) -> None:
    hours = Clock(monkeypatch, viser_page)
    page, plots, said = ViserPage.__new__(ViserPage), [], ["a"]
    handle = SimpleNamespace(content="")
    page._spoken, page._texts = -math.inf, [(handle, lambda: said[0])]
    page._plot = SimpleNamespace(show=lambda: plots.append(1))  # type: ignore[assignment]
    assert page.speak() and handle.content == "a"
    said[0] = "b"
    hours.now += 0.9 * viser_page.TEXT_PERIOD
    assert not page.speak() and handle.content == "a"
    assert page.speak(now=True) and handle.content == "b"
    hours.now += 1.1 * viser_page.TEXT_PERIOD
    assert page.speak() and len(plots) == 3


def test_plots_keep_ten_seconds_and_have_a_range_around_their_values() -> None:
    pytest.importorskip("viser")
    made: list[Any] = []

    def add(data: Any, series: Any, **how: Any) -> Any:
        made.append(SimpleNamespace(data=data, series=series, **how))
        return made[-1]

    plot = BalancePlot(SimpleNamespace(add_folder=lambda *_, **__: nullcontext(), add_uplot=add))
    assert len(made) == 2 and len(made[0].series) == 5 == len(made[0].data)
    assert made[0].scales["y"]["range"] == pytest.approx((-0.01, 0.01))
    for now in np.arange(0.0, 15.5, 0.5):
        plot.add(Picture(now, [Mark("dcm", "ball", np.array([[now, -2.0 * now, 0.0]]), DCM_COLOUR)]))
    plot.show()
    assert made[0].data[0][0] == pytest.approx(15.0 - PLOT_TIME) and made[0].data[0][-1] == 15.0
    assert made[0].scales["y"]["range"] == pytest.approx((5.0 - 0.01, 15.01))
    assert made[1].scales["y"]["range"] == pytest.approx((-30.01, -10.0 + 0.01))


def test_a_program_is_told_with_its_last_states() -> None:
    history = [(float(i), f"state {i}", "done") for i in range(8)]
    text = program_text(SimpleNamespace(ended=False, path="now", outcome="", history=history))  # type: ignore[arg-type]
    assert "now" in text and [f"state {i}" in text for i in range(8)] == [i >= 3 for i in range(8)]
    assert "ended: well" in program_text(SimpleNamespace(ended=True, path="", outcome="well", history=[]))  # type: ignore[arg-type]


# ---- the player -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("speed", "playing", "pages", "start", "shown"),
    [
        ("1", True, 1, 0.0, [1, 2, 3]),
        ("2", True, 1, 0.0, [2, 4, 6]),
        ("1", False, 1, 0.0, [0, 0, 0]),
        ("1", True, 0, 0.0, [0, 0, 0]),
        ("4", True, 1, 0.8, [10, 0, 4]),
        ("1", True, 1, 0.95, [10, 10, 10]),
    ],
)
def test_a_replay_plays_at_its_speed_and_begins_again_after_its_end(
    speed: str, playing: bool, pages: int, start: float, shown: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    hours = Clock(monkeypatch, player)
    times = 0.1 * np.arange(11)
    seen: list[int] = []

    class Enough(Exception):
        pass

    def show(tick: int) -> None:
        seen.append(tick)
        made._playing.value = playing and start != 0.95
        if start == 0.8:
            made._playing.value = True
        if len(seen) == 3:
            raise Enough

    made = Player.__new__(Player)
    made._times, made._page = times, SimpleNamespace(open_pages=pages)  # type: ignore[assignment]
    made._time = SimpleNamespace(value=start, min=0.0, max=1.0)
    made._playing, made._speed = SimpleNamespace(value=playing), SimpleNamespace(value=speed)
    made.show = show  # type: ignore[method-assign]
    monkeypatch.setattr(player, "RATE", 10.0)
    with pytest.raises(Enough):
        made.run()
    assert seen == shown and hours.slept == pytest.approx([0.1] * 3)


def test_a_replay_has_a_slider_over_its_times_and_shows_each_tick_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """To a hundredth of a second, from the first tick on; the space bar plays and pauses."""
    page, drawn, calls = MagicMock(), [], []
    page.url = "http://here/"
    monkeypatch.setattr(player, "ViserPage", lambda port, title: calls.append((port, title)) or page)
    monkeypatch.setattr(player, "free_port", lambda port: (port or 7000) + 1)
    gui, pressed = page.server.gui, []
    gui.add_checkbox = lambda label, value: SimpleNamespace(value=value)
    monkeypatch.setattr(player, "when", lambda event, call: pressed.append(call))
    replay: Any = SimpleNamespace(
        log=SimpleNamespace(time=np.array([0.504, 1.0, 2.0, 3.456])),
        title="walk",
        picture=lambda tick: drawn.append(tick) or tick,
    )
    made = Player.__new__(Player)
    Player.__init__.__wrapped__(made, replay, 7100)  # type: ignore[attr-defined] - the replay is not checked
    assert calls == [(7101, "walk")] and made.url == page.url and drawn == [0]
    page.build.assert_called_once_with(replay)
    gui.add_slider.assert_called_once_with("time (s)", 0.5, 3.46, 0.01, 0.5)
    gui.add_dropdown.assert_called_once_with("speed", tuple(player.SPEEDS), initial_value="1")
    assert all(float(name) == speed for name, speed in player.SPEEDS.items())
    made.show(0)
    made.show(3)
    made.show(3)
    made.show(1)
    assert drawn == [0, 3, 1] and page.speak.call_count == 3
    assert made._playing.value
    for playing in (False, True):
        pressed[0](None)
        assert made._playing.value is playing
    assert made._repr_html_().startswith('<iframe src="http://here/"')
    made.close()
    page.close.assert_called_once_with()


def test_a_replay_stops_playing_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    Clock(monkeypatch, player)

    class Enough(Exception):
        pass

    def show(tick: int) -> None:
        raise Enough

    made = Player.__new__(Player)
    made._times, made._page = 0.1 * np.arange(11), SimpleNamespace(open_pages=1)  # type: ignore[assignment]
    made._time, made._speed = SimpleNamespace(value=0.99, min=0.0, max=1.0), SimpleNamespace(value="1")
    made._playing, made.show = SimpleNamespace(value=True), show  # type: ignore[method-assign]
    with pytest.raises(Enough):
        made.run()
    assert made._time.value == 1.0 and not made._playing.value


def test_a_command_of_a_page_changes_no_measurement() -> None:
    """A push comes to the plant with the next step alone."""
    plant = wbc.Plant(HRP4)
    controls = LiveControls(plant, None)
    before = plant.measure().joint_position.copy()
    controls.apply({"do": "push", "direction": "left", "impulse": 0.1})
    np.testing.assert_array_equal(plant.measure().joint_position, before)
    assert isinstance(plant.hold(), Command)
