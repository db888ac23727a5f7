"""The workbench: who may open it, what its orders do, and that a run is repeated with them bit for bit."""

from __future__ import annotations

import asyncio
import math
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from browser import Browser, needs_chromium
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

import wbc
from wbc.app.address import PortError
from wbc.app.view.controls import LiveControls
from wbc.core.errors import InputError
from wbc.walking import FootstepPlan, WalkingControl

viser = pytest.importorskip("viser")

from wbc.app.view.workbench import Workbench, cone_margin  # noqa: E402


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
        assert view.frames > 40 and view.interventions == []


def test_a_run_is_repeated_with_its_interventions_bit_for_bit() -> None:
    orders: dict[int, dict[str, Any]] = {
        3: {"do": "push", "direction": "left", "impulse": 0.05},
        8: {"do": "task", "task": "com", "weight": 30.0},
        10: {"do": "task", "task": "com", "damping": 9.0},
        12: {"do": "pull", "body": "torso", "force": [10.0, 0.0, 0.0]},
        20: {"do": "own", "name": "lower", "value": 0.02},
        25: {"do": "pull", "body": "torso", "force": [0.0, 0.0, 0.0]},
    }

    def lower(control: Any) -> Callable[[float], None]:
        com = control.controller.task("com")
        return lambda by: com.move_to(com.target - [0.0, 0.0, by], speed=0.1)

    plant, control = stand()
    plain = run(plant, control, 60, lambda: None)
    plant, control = stand()
    with Workbench(plant, control, port=0) as view:
        view.slider("lower", 0.0, 0.1, 0.0, lower(control), "m")
        first = run(
            plant,
            control,
            60,
            view.update,
            lambda tick: view.controls.order(orders[tick]) if tick in orders else None,
        )
    assert [entry["what"] for entry in view.interventions] == [order["do"] for order in orders.values()]
    assert first != plain
    plant, control = stand()
    again = LiveControls(plant, None, control.controller, repeat=view.interventions)
    again.add_own("lower", lower(control))
    assert run(plant, control, 60, again.update) == first
    assert again.interventions == view.interventions


def test_gizmos_of_tasks_that_cannot_have_one_are_refused_before_the_loop() -> None:
    plant, control = stand()
    _, other = stand()
    robot = plant.description.robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), 0.005)
    controls = LiveControls(plant, None, control.controller)
    com = control.controller.task("com")
    assert controls.check_task(com) is com
    with pytest.raises(InputError, match="no task of the controller"):
        controls.check_task(other.controller.task("com"))
    with pytest.raises(InputError, match="walking.body.com_height"):
        LiveControls(plant, walking).check_task(walking.controller.task("com"))
    with Workbench(plant, control, port=0) as view:
        with pytest.raises(InputError, match="no point, orientation or pose"):
            view.gizmo(control.controller.task("posture"))
        free = view.gizmo("goal", pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0])))
        view.controls.order({"do": "own", "name": "goal", "value": [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]})
        view.update()
        assert free is not None and free.value.translation == pytest.approx([2.0, 0.0, 0.0])
        with pytest.raises(InputError, match="'goal' already"):
            view.button("goal", lambda: None)


def test_a_task_that_a_state_adds_has_a_folder_as_long_as_it_is_there() -> None:
    plant, control = stand()
    controller = control.controller
    with Workbench(plant, control, port=0) as view:

        def folders() -> list[str]:
            view._next = view._spoken = -math.inf  # the next picture, and its texts, are due
            view.update()
            return [thing.name for thing, *_ in view._made]

        before, shown = folders(), len(view._live)
        assert before == [thing.name for thing in (*controller.tasks, *controller.contacts)]
        hand = controller.add(wbc.PositionTask("left_hand", name="hand"))
        assert set(folders()) - set(before) == {"hand"} and len(view._live) == shown + 2  # gizmo and plots
        controller.remove(hand)
        assert folders() == before and len(view._live) == shown


@pytest.mark.parametrize(
    ("order", "message"),
    [
        ({"do": "task", "task": "cm", "weight": 1.0}, "com"),
        ({"do": "task", "task": "com"}, "one of weight"),
        ({"do": "task", "task": "com", "weight": -1.0}, "negative"),
        ({"do": "task", "task": "com", "target": [0.0, math.nan, 0.0]}, "finite"),
        ({"do": "pull", "body": "tail", "force": [0.0, 0.0, 1.0]}, "tail"),
        ({"do": "pull", "body": "torso"}, "force of a pull"),
        ({"do": "own", "name": "dance"}, "dance"),
    ],
)
def test_orders_that_make_no_sense_are_refused(order: dict[str, Any], message: str) -> None:
    plant, control = stand()
    controls = LiveControls(plant, None, control.controller)
    controls.apply(order)
    assert controls.message.startswith("refused") and message in controls.message
    assert controls.interventions == []


def test_a_task_is_switched_off_and_on_with_its_weight() -> None:
    plant, control = stand()
    com = control.controller.task("com")
    weight, controls = np.array(com.weight), LiveControls(plant, None, control.controller)
    controls.apply({"do": "task", "task": "com", "on": False})
    assert not com.weight.any()
    controls.apply({"do": "task", "task": "com", "on": True})
    assert com.weight == pytest.approx(weight)


def test_the_margin_to_a_cone_is_one_on_its_axis_and_zero_on_its_edge() -> None:
    _, control = stand()
    contact = control.controller.contacts[0]
    axis = np.zeros(6)
    axis[2] = 100.0
    slides = axis + np.array([100.0 * contact.friction, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert cone_margin(contact, axis) == pytest.approx(1.0)
    assert cone_margin(contact, slides) == pytest.approx(0.0)
    assert cone_margin(contact, 0.5 * (axis + slides)) == pytest.approx(0.5)
    assert math.isnan(cone_margin(contact, np.zeros(6)))


# ---- who may open it ------------------------------------------------------------------------------------------------


def status(url: str, **headers: str) -> int:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:  # else the server waits for the end of the page
            return error.code


def test_nobody_opens_the_page_without_the_link_or_from_another_site() -> None:
    plant, control = stand()
    with Workbench(plant, control, port=0) as view:
        place, _, token = view.url.partition("?")
        assert status(view.url) == 200
        for url, headers in (
            (place, {}),
            (f"{place}?token=guess", {}),
            (view.url, {"Host": "evil.example"}),
            (view.url, {"Origin": "http://evil.example"}),
        ):
            assert status(url, **headers) == 403
        with urllib.request.urlopen(view.url) as answer:
            policy = answer.headers["Content-Security-Policy"]
        assert "frame-ancestors 'none'" in policy and "default-src 'none'" in policy

        async def connect(query: str, origin: str | None) -> int:
            headers = {} if origin is None else {"Origin": origin}
            request = HTTPRequest(place.replace("http", "ws") + query, headers=headers)
            try:
                page = await websocket_connect(request, subprotocols=[f"viser-v{viser.__version__}"])
            except HTTPClientError as error:
                return error.code
            message = await asyncio.wait_for(page.read_message(), 20.0)
            page.close()
            while await page.read_message() is not None:  # else the server waits for the end of the page
                pass
            return 101 if isinstance(message, bytes) else 0

        own = place.rstrip("/")
        assert asyncio.run(connect(f"?{token}", own)) == 101
        assert asyncio.run(connect("", own)) == 403
        assert asyncio.run(connect("?token=guess", own)) == 403
        assert asyncio.run(connect(f"?{token}", "http://evil.example")) == 403
        with pytest.raises(PortError, match="another port"):
            Workbench(plant, control, port=int(place.rstrip("/").rpartition(":")[2]))
    plant, control = stand()
    with (
        Workbench(plant, control, port=0, notebook=True) as framed,
        urllib.request.urlopen(framed.url) as answer,
    ):
        assert "frame-ancestors http://localhost:*" in answer.headers["Content-Security-Policy"]
        assert answer.headers["X-Frame-Options"] is None
        assert f'<iframe src="{framed.url}"' in framed._repr_html_()


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
