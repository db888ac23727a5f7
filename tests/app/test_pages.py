"""Pages and orders: pace, waiting, drives, gizmos and plots, by a clock and a page that are made."""

from __future__ import annotations

import json
import math
import socket
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_views import Clock

import wbc
from wbc.app import MeshcatView, Workbench
from wbc.app.replay import player
from wbc.app.replay.player import Player
from wbc.app.view import base, meshcat_view
from wbc.app.view.base import CATCH_UP_TIME, MAX_STEP, PORTS, View, ViewError, free_port
from wbc.app.view.marks import DCM_COLOUR, Mark, Picture
from wbc.app.view.meshcat_view import MeshcatScene
from wbc.app.view.meshes import BodyMesh, Mesh, box
from wbc.app.view.stage import ShownRun, SimulatedStage
from wbc.base.errors import InputError
from wbc.core.signals import Measurement

HRP4 = wbc.load_robot("hrp4_class")


class Bare(View):
    """A view that serves nothing."""

    open_pages = 0

    def _open(self, port: int) -> None:
        self.url, self.sent = f"http://127.0.0.1:{port}/", list[Picture]()

    def _build(self) -> None:
        pass

    def _count(self) -> int:
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
    view._keep_pace(0.1)
    assert view._due == hours.now and not hours.slept, "the first tick is where the clock is"
    view._keep_pace(0.2)
    assert hours.slept == pytest.approx([0.05]), "0.1 s at twice its pace"
    hours.now += 0.05 + 0.9 * CATCH_UP_TIME
    view._keep_pace(0.3)
    assert hours.slept[-1] == 0.0 and view._due == pytest.approx(100.1), "late, and it catches up"
    hours.now += 0.2 * CATCH_UP_TIME + 0.05
    view._keep_pace(0.4)
    assert view._due == hours.now and len(hours.slept) == 2, "too late"
    for time in (0.4 + 1.01 * MAX_STEP, 0.2):
        view._due = hours.now + 50.0
        view._keep_pace(time)
        assert view._due == hours.now, "another run, or one that has begun anew"
    view._keep_pace(0.2 + 0.99 * MAX_STEP)
    assert hours.slept[-1] == pytest.approx(0.5 * 0.99 * MAX_STEP)
    for bad in (0.0, -1.0, math.nan):
        with pytest.raises(InputError, match="speed"):
            view.speed = bad
    view.speed = None
    count = len(hours.slept)
    view._keep_pace(view._time + 0.5)
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
    view.run.program = program
    assert view.run.walking is None and view.run.steered is None
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
        Bare(plant, port=0).update(measurement=plant.measure())
    with pytest.raises(InputError, match="update"):
        Bare(HRP4, port=0).update()
    with pytest.raises(InputError, match="control of 'g1'"):
        Bare(HRP4, wbc.balance_controller(wbc.load_robot("g1").robot(), 0.005), port=0)
    with pytest.raises(InputError, match="Program"):
        view.run = ShownRun(plant, None, control)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="'panda' is bolted"):
        Bare(wbc.load_robot("panda"), port=0)
    read: Any = Measurement.resting(plant.robot)
    for wrong in (3, replace(read, time=math.nan), replace(read, sole_wrench=np.zeros((1, 6)))):
        with pytest.raises(InputError):
            Bare(HRP4, port=0).update(plant.robot, measurement=wrong)
    with pytest.raises(ViewError, match="no run"):
        Workbench().ended("fell")


def test_the_time_of_a_described_robot_is_that_of_its_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    Clock(monkeypatch, base)
    view = Bare(HRP4, port=0)
    robot = HRP4.robot()
    view.update(robot, measurement=replace(Measurement.resting(robot), time=7.5))
    assert view._time == 7.5 and view.sent[-1].time == 7.5
    view.update(HRP4.robot())
    assert view._time == 7.5, "without one the run has not gone on"


def test_the_first_free_port_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        monkeypatch.setattr(base, "FIRST_PORT", port)
        assert port < free_port(None) < port + PORTS and free_port(free := free_port(0)) == free
        with pytest.raises(base.PortError, match=f"port {port} "):
            free_port(port)
        monkeypatch.setattr(base, "PORTS", 1)
        with pytest.raises(base.PortError, match=f"every port from {port}"):
            free_port(None)


# ---- the hook -------------------------------------------------------------------------------------------------------


class Shown(base.View):
    """A page that notes what it is asked."""

    def _count(self) -> int:
        return 1

    def _open(self, port: int) -> None:
        self.asked: list[Any] = [port]

    def _build(self) -> None:
        self.asked.append(self.run.stage.title)

    def _send(self, picture: Picture) -> None:
        self.asked.append(round(picture.time, 3))

    def _end(self) -> None:
        self.asked.append("end")


def trial_of(plant: Any, control: Any = None) -> Any:
    return SimpleNamespace(plant=plant, control=control)


def test_a_view_is_a_hook_that_opens_with_its_trial_and_ends_with_it() -> None:
    trial = trial_of(wbc.Plant(HRP4))
    with Shown() as never:
        pass
    with pytest.raises(base.ViewError, match="closed"):
        never.start(trial)
    view = Shown(wait=0.5)
    assert not view.closed and view.controls is None and view.url == "", "it is not open"
    assert view.pages == 0 and not view.wait_for_page(0.01)
    for asked in (view.update, lambda: view.ended("well")):
        with pytest.raises(base.ViewError, match="no run yet"):
            asked()
    view.start(trial)
    assert view.asked[1:] == ["hrp4_class", 0.0] and view.frames == 1
    trial.plant.step(trial.plant.hold())
    view.tick(SimpleNamespace(plant=trial.plant))  # type: ignore[arg-type]
    assert view.asked[3:] == [0.005]
    view.end(None)
    assert view.closed and view.asked[-1] == "end"
    with pytest.raises(base.ViewError, match="closed"):
        view.start(trial)


def test_a_view_that_stays_shows_the_next_trial_and_each_of_them_once() -> None:
    view, trials = Shown(), [trial_of(wbc.Plant(name, visuals=False)) for name in (HRP4, "g1")]
    view.stays = True
    for trial in trials:
        view.start(trial)
        view.end(None)
    assert view.asked[1:] == ["hrp4_class", 0.0, "g1", 0.0] and not view.closed


def test_a_trial_waits_for_a_page_as_long_as_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []
    monkeypatch.setattr(base.View, "wait_for_page", lambda view, seconds: waits.append(seconds))
    for wait in (0.0, 3.0):
        Shown(wait=wait).start(trial_of(wbc.Plant(HRP4)))
    assert waits == [0.0, 3.0]


def test_of_a_loop_without_a_model_the_robot_is_shown_alone() -> None:
    q = HRP4.robot().half_sitting
    loop: Any = SimpleNamespace(description=HRP4, truth=lambda: SimpleNamespace(q=q))
    view = Shown()
    view.start(trial_of(loop))
    assert view.asked[1:] == ["hrp4_class"], "its state is not known yet"
    view.tick(SimpleNamespace(plant=loop, measurement=None))  # type: ignore[arg-type]
    assert view.asked[2:] == [0.0]


# ---- MeshCat --------------------------------------------------------------------------------------------------------


def test_meshcat_gets_what_changes_and_its_caption_while_a_page_is_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hours = Clock(monkeypatch, meshcat_view)
    plant = wbc.Plant(HRP4)
    stage: Any = SimulatedStage(plant, None)
    sent: list[tuple[str, str, Any]] = []
    view = MeshcatView.__new__(MeshcatView)
    told: list[Any] = []
    server = SimpleNamespace(busy=False, pages=[], send=lambda _, caption: told.append(caption))
    view.closed, view.frames, view._opened, view._server = False, 2, True, server  # type: ignore[assignment]
    view.run = SimpleNamespace(stage=stage)  # type: ignore[assignment]
    view._build()
    none, grey = Mesh(np.empty((0, 3)), np.empty((0, 3), np.uint32)), (0.5, 0.5, 0.5, 1.0)
    scene = view._scene
    scene.meshes, scene.moving = [BodyMesh(body, grey, none) for body in (1, 1, 2)], [1, 2]

    def captions() -> list[Any]:
        return [json.loads(text) for text in told if text is not None]

    monkeypatch.setattr(scene, "_put", lambda path, kind, *values: sent.append((path, kind.__name__, values)))
    monkeypatch.setattr(
        scene, "_set_mesh", lambda path, mesh, colour, on_top=False: sent.append((path, colour, on_top))
    )
    ball = Mark("b", "ball", np.zeros((1, 3)), DCM_COLOUR, meaning="point")
    line = Mark("l", "line", np.zeros((2, 3)), DCM_COLOUR)
    picture = Picture(1.0, [ball, line], ["text"], np.array([1.0, 2.0, 9.0]), {1: DCM_COLOUR})
    view._send(picture)
    marks = {path.rpartition("/")[2]: on_top for path, _, on_top in sent if "/mark" in path}
    assert marks == {"b": True, "l": False}
    world = next(values[0] for path, _, values in sent if path == meshcat_view.ROOT)
    assert world[:3, 3] == pytest.approx([-1.0, -2.0, -stage.floor - 0.8 * stage.scale.height])
    assert [caption["lines"] for caption in captions()] == [["1.00 s", "text"]], "the first one"
    told.clear()
    view._send(picture)
    assert not captions(), "nobody watches"
    sent.clear()
    hours.now += 1.1 * meshcat_view.TEXT_PERIOD
    server.pages = [1]
    view._send(Picture(2.0, [ball], ["text"], colours={1: DCM_COLOUR}))
    assert {kind for _, kind, _ in sent} == {"SetTransform", "Delete"}, "nothing else has changed"
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
    view.closed, server.pages = False, []
    hours.now += 1.0
    view._send(picture)
    assert len(captions()) == 3
    view._build()
    view._send(Picture(0.0))
    assert captions()[-1]["lines"] == ["0.00 s"], "and the first one of another run"
    scene = view._scene
    monkeypatch.setattr(scene, "_put", lambda *what: sent.append(what))
    server.busy, view.frames = True, 3
    sent.clear()
    view._send(Picture(9.0))
    assert not sent, "a picture is skipped while the last one is on its way"


def test_colours_and_places_are_sent_as_meshcat_takes_them() -> None:
    stage: Any = SimulatedStage(wbc.Plant(HRP4), None)
    scene, sent = MeshcatScene(stage), list[Any]()
    scene._put = lambda path, kind, *values: sent.append(values[0])  # type: ignore[method-assign]
    for on_top in (False, True):
        scene._set_mesh("p", box(1.0, 1.0, 1.0), (1.0, 0.5, 0.2, 0.7), on_top=on_top)
        material = sent[-1].material
        assert material.color == 0xFF8033 and material.opacity == 0.7
        assert ("depthTest" in material.properties) is on_top
    scene._place("p", np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(sent[-1], [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])


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
        assert made._playing.value is (playing and made._time.value < 1.0), "it stops at its end"
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
