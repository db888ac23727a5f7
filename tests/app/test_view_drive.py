"""Driving from the live page: requests, keys in a real browser, and a page that is closed."""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path
from threading import Timer
from typing import Any

import pytest
from browser import Browser, needs_chromium
from tornado.websocket import websocket_connect

import wbc
from wbc.app.address import ViewError
from wbc.app.view.controls import LiveControls
from wbc.app.view.meshcat_view import MeshcatView
from wbc.app.view.pace import Pace
from wbc.walking import FootstepPlan, WalkingControl, walk_distance


def stage(distance: float | None = None) -> tuple[wbc.Plant, WalkingControl]:
    description = wbc.load_robot("hrp4_class")
    robot = description.robot()
    plan = FootstepPlan.standing(robot)
    if distance is not None:
        plan = walk_distance(plan, distance)
    return wbc.Plant(description), WalkingControl(robot, plan, 0.005)


def test_a_page_drives_a_robot_that_stands_and_no_plan() -> None:
    plant, walking = stage()
    controls = LiveControls(plant, walking)
    assert controls.available()["drive"] == {"forward": 0.4, "back": 0.3, "left": 0.2, "turn": 0.5}
    controls.apply({"do": "drive", "forward": 0.2, "left": -0.1, "turn": 0.3})
    assert walking.velocity == (0.2, -0.1, 0.3) and "0.20 m/s forward" in controls.message
    controls.apply({"do": "drive", "forward": 0.1, "left": 0.0, "turn": 0.0})
    assert len(controls.interventions) == 1, "of several commands to one tick the last one counts"
    controls.halt()
    assert walking.velocity == (0.0, 0.0, 0.0)
    assert "drive" not in LiveControls(*stage(0.3)).available()


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"do": "drive", "forward": 0.1, "left": 0.0}, "turn of a velocity"),
        ({"do": "drive", "forward": "fast", "left": 0.0, "turn": 0.0}, "forward of a velocity"),
        ({"do": "drive", "forward": 0.1, "left": float("nan"), "turn": 0.0}, "left of a velocity"),
        ({"do": "drive", "forward": 99.0, "left": 0.0, "turn": 0.0}, "forward of a velocity"),
    ],
)
def test_bad_velocities_of_a_page_change_nothing(request_: dict[str, Any], message: str) -> None:
    plant, walking = stage()
    controls = LiveControls(plant, walking)
    controls.apply(request_)
    assert controls.message.startswith("refused") and message in controls.message
    assert walking.velocity is None and not controls.interventions


@pytest.mark.slow
@needs_chromium
def test_arrow_keys_and_a_gamepad_in_a_browser_drive_the_robot(tmp_path: Path) -> None:
    plant, walking = stage()
    with MeshcatView(plant, walking, port=0) as view:

        def run(until: Any, ticks: int = 3000) -> None:
            for _ in range(ticks):
                if until():
                    return
                plant.step(walking.command(plant.measure()))
                view.update()
            raise AssertionError("never happens")

        with Browser(tmp_path / "profile") as browser:
            browser.open(view.url)
            assert view.wait_for_page(60.0)
            browser.wait('document.getElementById("stick") !== null')
            key = {"key": "ArrowUp", "code": "ArrowUp", "windowsVirtualKeyCode": 38}
            browser.call("Input.dispatchKeyEvent", type="keyDown", **key)
            run(lambda: walking.velocity == (0.4, 0.0, 0.0))
            run(lambda: walking.steps_done >= 2)
            assert walking.granted_velocity[0] > 0.1
            browser.wait('document.getElementById("text").textContent.includes("granted")')
            browser.call("Input.dispatchKeyEvent", type="keyUp", **key)
            run(lambda: walking.velocity == (0.0, 0.0, 0.0))
            run(lambda: walking.finished)
            left = {"key": "ArrowLeft", "code": "ArrowLeft", "windowsVirtualKeyCode": 37}
            browser.call("Input.dispatchKeyEvent", type="keyDown", **left)
            run(lambda: walking.velocity == (0.0, 0.0, 0.5))
            browser.call("Input.dispatchKeyEvent", type="keyUp", **left)
            back = {"key": "ArrowDown", "code": "ArrowDown", "windowsVirtualKeyCode": 40}
            browser.call("Input.dispatchKeyEvent", type="keyDown", **back)
            run(lambda: walking.velocity == (-0.3, 0.0, 0.0))
            browser.call("Input.dispatchKeyEvent", type="keyUp", **back)
            for axes, velocity in (("-1, 0, 0", (0.0, 0.2, 0.0)), ("0.1, 0, -1", (0.0, 0.0, 0.5))):
                browser.evaluate(f"navigator.getGamepads = () => [null, {{connected: true, axes: [{axes}]}}]")
                run(lambda velocity=velocity: walking.velocity == velocity)
            assert not browser.errors
        run(lambda: walking.velocity == (0.0, 0.0, 0.0))  # the last page is closed
        run(lambda: walking.finished)
    assert walking.fallen is None
    assert {entry["what"] for entry in view.interventions} == {"drive"}


def test_a_driven_robot_stands_when_nobody_is_left_who_may_stop_it() -> None:
    plant, walking = stage()

    async def drive(view: MeshcatView) -> None:
        link = view.url.replace("http", "ws").split("?")
        driver = await websocket_connect(f"{link[0]}stream?{link[1]}")
        watcher = await websocket_connect(f"{link[0]}stream")

        async def until(velocity: float) -> None:
            for _ in range(200):
                await asyncio.sleep(0.02)
                view.update()
                if walking.velocity is not None and walking.velocity[0] == velocity:
                    return
            raise AssertionError(walking.velocity)

        order = {"do": "drive", "forward": 0.2, "left": 0.0, "turn": 0.0}
        await driver.write_message(json.dumps({"order": order}))
        await until(0.2)
        driver.close()
        await until(0.0)
        assert view.pages == 1
        for page in (driver, watcher):
            page.close()
            while await page.read_message() is not None:
                pass

    with MeshcatView(plant, walking, port=0, rate=1e6) as view:
        asyncio.run(drive(view))
    with pytest.raises(ViewError, match="has been closed"):
        view.update()


def test_a_slow_run_waits_until_it_is_told_to_hurry() -> None:
    pace = Pace(0.01)
    begin = time.perf_counter()
    for tick in range(3):
        pace.wait(0.002 * tick)
    assert 0.35 < time.perf_counter() - begin < 1.5
    begin = time.perf_counter()
    pace.wait(100.0)  # a jump
    assert time.perf_counter() - begin < 0.1

    pace.speed = 1e-3
    pace.wait(0.0)
    Timer(0.1, setattr, (pace, "speed", None)).start()
    pace.wait(0.005)  # 5 s
    assert time.perf_counter() - begin < 1.0
