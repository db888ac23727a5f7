"""The workbench: what its orders do, and that a run is repeated with them bit for bit."""

from __future__ import annotations

import asyncio
import math
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from browser import Browser, needs_chromium

import wbc
from wbc.app.repeat import RepeatWalk
from wbc.app.view.base import PortError
from wbc.app.view.controls import LiveControls
from wbc.app.view.marks import DCM_COLOUR, Mark, Picture
from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.walking import FootstepPlan, Gait, WalkingControl, walk_distance

viser = pytest.importorskip("viser")

from websockets.asyncio.client import connect  # noqa: E402 - comes with viser
from websockets.exceptions import InvalidStatus  # noqa: E402

from wbc.app.view import workbench  # noqa: E402
from wbc.app.view.workbench import RELOAD_TIME, Workbench, program_text  # noqa: E402


def stand() -> tuple[wbc.Plant, wbc.PositionControl]:
    description = wbc.load_robot("hrp4_class")
    robot = description.robot()
    control = wbc.PositionControl(wbc.balance_controller(robot, 0.005), wbc.Observer(robot))
    return wbc.Plant(description, noise="realistic"), control


def run(
    plant: wbc.Plant, control: Any, ticks: int, update: Callable[[], object], meanwhile: Any = None
) -> list[bytes]:
    commands = []
    for tick in range(ticks):
        command = control.command(plant.measure())
        assert command.joint_position is not None
        commands.append(command.joint_position.tobytes() + plant.data.qpos.tobytes())
        plant.step(command)
        if meanwhile is not None:
            meanwhile(tick)
        update()
    return commands


def test_a_run_is_the_same_with_and_without_a_workbench() -> None:
    plant, control = stand()
    alone = run(plant, control, 40, lambda: None)
    plant, control = stand()
    with Workbench(plant, control, port=0, rate=1e6) as view:
        assert run(plant, control, 40, view.update) == alone
        assert view.frames > 40 and view.controls.interventions == []
        assert any(" s</b>" in handle.content for handle, _ in view._panel._texts), "the time is told"


class Shown(HTMLParser):
    """Text that a page shows of some HTML, and the tags in it."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags, self.text = set[str](), ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.add(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def test_texts_of_a_page_are_shown_and_nothing_in_them_is_run() -> None:
    """Of a log, a program or a control: viser runs what is HTML in Markdown, and what stands in braces."""
    bad = "<script>a()</script> <img src=x onerror=a()> [a](javascript:a) {a()} **a** &lt; a|b"
    plant, control = stand()
    with Workbench(plant, control, port=0) as view:
        page = view._panel
        view.controls.message = bad
        mark = Mark("dcm", "ball", np.zeros((1, 3)), DCM_COLOUR, meaning=bad)
        page.text(lambda: program_text(SimpleNamespace(ended=False, path=bad, history=[(1.0, bad, bad)])))  # type: ignore[arg-type]
        page.draw(Picture(0.0, [mark], text=[bad]))
        page.speak(now=True)
        contents = [handle.content for handle, _ in page._texts if "a()" in handle.content]
        assert all(isinstance(handle, viser.GuiHtmlHandle) for handle, _ in page._texts)
    shown = [Shown(content) for content in contents]
    assert len(shown) == 4 and all(bad in each.text for each in shown)
    assert set().union(*(each.tags for each in shown)) <= {"div", "br", "b", "span"}


def test_a_run_is_repeated_with_its_interventions_bit_for_bit() -> None:
    orders: dict[int, dict[str, Any]] = {
        3: {"do": "push", "direction": "left", "impulse": 0.05},
        8: {"do": "set", "name": "task com/weight", "value": 30.0},
        10: {"do": "set", "name": "task com/damping", "value": 9.0},
        20: {"do": "target", "task": "com", "target": [0.0, 0.01, 0.75]},
    }

    plant, control = stand()
    plain = run(plant, control, 40, lambda: None)
    plant, control = stand()
    with Workbench(plant, control, port=0) as view:
        first = run(
            plant,
            control,
            40,
            view.update,
            lambda tick: view.controls.order(orders[tick]) if tick in orders else None,
        )
    assert [entry["what"] for entry in view.controls.interventions] == [
        order["do"] for order in orders.values()
    ]
    assert first != plain
    plant, control = stand()
    again, tick = RepeatWalk(view.controls.interventions), SimpleNamespace(plant=plant)
    again.controls = LiveControls(plant, None, control.controller)
    assert run(plant, control, 40, lambda: again.tick(tick)) == first  # type: ignore[arg-type]
    assert again.controls.interventions == view.controls.interventions


# ---- the page -------------------------------------------------------------------------------------------------------


def test_the_page_answers_on_this_machine_alone() -> None:
    plant, control = stand()
    with Workbench(plant, control, port=0) as view:
        assert view.url.startswith("http://127.0.0.1:")
        assert asked(view.url) == 200
        with pytest.raises(PortError):
            Workbench(plant, control, port=urlsplit(view.url).port)
        assert not view.ended("without a page there is nobody to ask")
        view.show(*stand())
        view.update()


def asked(url: str, **headers: str) -> int:
    """Return the status of the answer to a request."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as refused:
        return refused.code


def let_in(url: str, origin: str | None) -> bool:
    """Return true if a web socket, by which a page gives its orders, is let in."""

    async def knock() -> bool:
        try:
            async with connect(url.replace("http", "ws").rstrip("/"), origin=origin):  # type: ignore[arg-type]
                return True
        except InvalidStatus as refused:
            assert refused.response.status_code == 403
            return False

    return asyncio.run(knock())


def test_only_the_page_of_the_link_gives_orders() -> None:
    """Another page of the browser does not know the link; one that does has another origin, or another host."""
    with Workbench(*stand(), port=0) as view, Workbench(*stand(), port=0) as other:
        place = urlsplit(view.url)
        root, host = f"http://{place.netloc}/", f"localhost:{place.port}"
        assert asked(view.url) == asked(view.url, Host=host) == asked(f"{view.url}?darkMode") == 200
        for url in (root, f"{root}index.html", f"{view.url[:-2]}/", f"{root}{urlsplit(other.url).path[1:]}"):
            assert asked(url) == 403
        for host in (
            "evil.example",
            f"evil.example:{place.port}",
            f"127.0.0.1.evil.example:{place.port}",
            "[",
            "",
        ):
            assert asked(view.url, Host=host) == 403
        assert let_in(view.url, None) and let_in(view.url, root.rstrip("/"))
        strangers = (
            "http://evil.example",
            "null",
            f"http://127.0.0.1:{urlsplit(other.url).port}",
            "https://127.0.0.1",
        )
        assert not any(let_in(view.url, origin) for origin in strangers)
        assert not let_in(root, None) and not let_in(root, root.rstrip("/"))


def test_a_page_drives_a_robot_that_stands_and_sets_gains_and_stops() -> None:
    description = wbc.load_robot("hrp4_class")
    robot = description.robot()
    plant, walking = wbc.Plant(description), WalkingControl(robot, FootstepPlan.standing(robot), 0.005)
    controls = LiveControls(plant, walking)
    assert "drive" in controls.offered
    controls.apply({"do": "drive", "forward": 0.1, "left": -0.1, "turn": 0.3})
    assert walking.velocity == (0.1, -0.1, 0.3)
    controls.halt()
    assert walking.velocity is None
    controls.apply({"do": "set", "name": "stabilizer/dcm_p", "value": 5.5})
    assert walking.stabilizer is not None and walking.stabilizer.gains.dcm_p == (5.5, 5.5)
    controls.apply({"do": "stop"})
    assert [entry["what"] for entry in controls.interventions] == ["drive", "drive", "set", "stop"]
    planned = WalkingControl(robot, walk_distance(FootstepPlan.standing(robot), 0.3), 0.005)
    assert "drive" in LiveControls(plant, planned).offered, "which ends its plan"


def test_a_driven_robot_comes_to_a_stand_when_its_last_page_goes() -> None:
    """Nobody is left who could stop it; a robot that its program drives walks on."""
    description = wbc.load_robot("hrp4_class")
    robot = description.robot()
    plant, walking = wbc.Plant(description), WalkingControl(robot, FootstepPlan.standing(robot), 0.005)
    with Workbench(plant, walking, port=0) as view:
        walking.velocity = (0.1, 0.0, 0.0)
        view.update()
        assert walking.velocity == (0.1, 0.0, 0.0)
        view.controls.apply({"do": "drive", "forward": 0.2, "left": 0.0, "turn": 0.0})
        assert walking.velocity == (0.2, 0.0, 0.0) and view.pages == 0
        plant.step(walking.command(plant.measure()))
        view.update()
        assert walking.velocity is None


class Hours:
    """A clock that goes on while somebody sleeps, pages that are open at some times, and clicks at others, s."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, open_at: Callable[[float], bool]) -> None:
        self.now, self.clicks = 0.0, list[tuple[float, Callable[[], object]]]()
        names = {"monotonic": lambda: self.now, "perf_counter": lambda: self.now, "sleep": self.sleep}
        monkeypatch.setattr(workbench, "clock", SimpleNamespace(**names))
        monkeypatch.setattr(
            Workbench, "pages", property(lambda view: int(not view.closed and open_at(self.now)))
        )

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        assert self.now < 100.0, "it waits for ever"
        while self.clicks and self.clicks[0][0] <= self.now:
            self.clicks.pop(0)[1]()


@pytest.mark.parametrize(("back", "ends"), [(3.0, 20.0), (math.inf, 1.0 + RELOAD_TIME)])
def test_a_page_that_is_loaded_again_in_a_pause_leaves_the_run_paused(
    back: float, ends: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Gone for good, the run goes on: nobody is left who could let it."""
    hours = Hours(monkeypatch, lambda now: now < 1.0 or now >= back)
    plant, control = stand()
    with Workbench(plant, control, port=0) as view:
        view.update()
        pause = view._panel.pause
        pause.value = True
        hours.clicks = [(20.0, lambda: setattr(pause, "value", False))]
        view.update()
        assert hours.now == pytest.approx(ends, abs=0.1)
        assert not pause.value, "the page says so, too"


@pytest.mark.parametrize(("back", "ends", "again"), [(3.0, 20.0, True), (math.inf, 1.0 + RELOAD_TIME, False)])
def test_a_page_that_is_loaded_again_at_the_end_can_restart_the_run_and_gives_no_other_order(
    back: float, ends: float, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    hours = Hours(monkeypatch, lambda now: now < 1.0 or now >= back)
    plant, control = stand()
    with Workbench(plant, control, port=0) as view:
        view.update()
        calls: list[Callable[[Any], object]] = []
        monkeypatch.setattr(workbench, "when", lambda event, call: calls.append(call))
        push = {"do": "push", "direction": "left", "impulse": 0.1}
        hours.clicks = [(10.0, lambda: view.controls.order(push)), (20.0, lambda: calls[0](None))]
        assert view.ended("completed") is again and hours.now == pytest.approx(ends, abs=0.1)
        assert not view.controls.interventions, "no tick has come since"
        view.show(plant, control)
        view.controls.order(push)
        view.controls.update(plant.time)
        assert [entry["what"] for entry in view.controls.interventions] == ["push"]


@pytest.mark.slow
def test_soles_take_a_stiffness_in_their_next_swing() -> None:
    in_time = (("stiffness.early_landing", 0.0),)  # these swings are too short to be sure of more
    gait = Gait(single_support=0.5, double_support=0.2, initial_double_support=0.5, final_double_support=0.5)
    plan = WalkPlan(distance=0.1)
    spec = WalkSpec(plan=plan, gait=gait, foot="variable", stiffness=10.0, noise="none", changes=in_time)
    trial = WalkTrial(spec)
    controls = LiveControls(trial.plant, trial.control)
    controls.apply({"do": "set", "name": "soles/stiffness", "value": 30.0})
    assert controls.settings["soles/stiffness"].value == 10.0  # no foot has swung
    while trial.control.steps_done < 1:
        measured = trial.plant.measure()
        trial.plant.step(trial.control.command(measured))
    assert measured.sole_stiffness == pytest.approx([30.0, 10.0], abs=0.5)  # the foot that has swung
    assert controls.settings["soles/stiffness"].value == pytest.approx(30.0)


@pytest.mark.slow
@needs_chromium
def test_keys_drive_in_a_browser(tmp_path: Path) -> None:
    robot = wbc.load_robot("hrp4_class")
    plant, model = wbc.Plant(robot), robot.robot()
    walking = WalkingControl(model, FootstepPlan.standing(model), 0.005)

    def until(velocity: tuple[float, float, float]) -> None:
        for _ in range(1000):
            view.update()
            if walking.velocity == pytest.approx(velocity, abs=0.05):
                return
            time.sleep(0.02)
        raise AssertionError(walking.velocity)

    with Workbench(plant, walking, port=0) as view, Browser(tmp_path / "profile") as browser:
        browser.open(view.url)
        assert view.wait_for_page(60.0)
        browser.wait('document.body.innerText.includes("keys i, k")')
        key = {"key": "i", "code": "KeyI", "windowsVirtualKeyCode": 73, "text": "i"}
        browser.call("Input.dispatchKeyEvent", type="keyDown", **key)
        until((0.1, 0.0, 0.0))
        assert not browser.errors
