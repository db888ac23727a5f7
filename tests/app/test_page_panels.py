"""Pages of viser: keys, sliders, gizmos, settings, texts and plots, by a page that is made."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from contextlib import nullcontext, suppress
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from made_views import Clock

import wbc
from wbc.app.view import viser_page
from wbc.app.view.controls import (
    LiveControls,
)
from wbc.app.view.marks import Mark, Picture, Scale
from wbc.app.view.viser_page import ViserPanel
from wbc.app.view.workbench import Gizmo, SettingsFolder, add_drive, program_text

HRP4 = wbc.load_robot("hrp4_class")


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


def panel_of(gui: Any) -> Any:
    """A panel of a page that is made, without a scene."""
    panel = ViserPanel.__new__(ViserPanel)
    panel._page, panel.gui = SimpleNamespace(keys=[]), gui  # type: ignore[assignment]
    return panel


def test_keys_and_sliders_drive_within_what_the_robot_grants() -> None:
    """Limits ahead, back, aside and in turns are rounded down to centimetres a second; a key is a quarter of them."""
    panel, orders = panel_of(Gui()), list[dict[str, Any]]()
    add_drive(panel, (0.409, 0.206, 0.159, 0.807), orders.append)
    made = panel.gui.made
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
    assert orders[-1]["turn"] == 0.3 and len(panel._page.keys) == 7


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

    nodes = SimpleNamespace(add_transform_controls=add)
    frame = pin.SE3(np.eye(3), np.array([7.0, 8.0, 9.0]))
    task: Any = SimpleNamespace(
        name="a/b", target=target, frame="f", robot=SimpleNamespace(placement=lambda frame_: frame)
    )
    orders: list[dict[str, Any]] = []
    gizmo = Gizmo(nodes, task, 0.3, orders.append)
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
    orders, gizmos = list[Any](), list[str]()
    sizes: list[float] = []

    def add(name: str, **how: Any) -> Any:
        gizmos.append(name)
        sizes.append(how["scale"])
        return Handle(**how)

    controls = LiveControls(None, None, controller)
    controls.order = orders.append  # type: ignore[method-assign]
    panel = panel_of(Gui())
    panel.scene = SimpleNamespace(stage=SimpleNamespace(scale=Scale(0.8, 400.0)))  # type: ignore[assignment]
    folder = SettingsFolder(panel, SimpleNamespace(add_transform_controls=add), controls)
    assert folder._shown == list(controls.settings) and "task com" in panel.gui.made
    assert any("com" in name for name in gizmos) and not any("posture" in name for name in gizmos)
    assert sizes == pytest.approx([0.2] * len(gizmos)), "a quarter of the height of the CoM"
    number = panel.gui.made["weight"]
    number.value = 3.0
    number.fire()
    assert orders[-1]["do"] == "set" and orders[-1]["name"].endswith("/weight") and orders[-1]["value"] == 3.0
    count = len(gizmos)
    folder.match()
    assert len(gizmos) == count, "nothing has come or gone"
    room = folder._folder
    controller.add(wbc.PositionTask("left_hand", name="hand"))
    folder.match()
    assert room.removed and len(gizmos) == 2 * count + 1


def test_a_page_is_built_for_the_size_of_its_robot_and_follows_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The camera stands at (2.6, −2, 1.7) heights and looks at 0.8 of one; the grid lies on the floor."""
    server, key, nodes = MagicMock(), MagicMock(), dict[str, Any]()

    def node(name: str, *parts: Any, **how: Any) -> Any:
        nodes[name] = SimpleNamespace(parts=parts, how=how, color=how.get("color"))
        return nodes[name]

    server.scene.add_frame = server.scene.add_grid = server.scene.add_mesh_simple = node
    server.atomic = nullcontext
    page: Any = SimpleNamespace(server=server, keys=[key])
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom type="plane" size="1 1 0.1" rgba="0.25 0.5 0.75 1"/>
        <body name="box"><freejoint/><geom type="box" size="0.1 0.2 0.3" rgba="1 0.5 0 1"/></body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    stage: Any = SimpleNamespace(scale=SimpleNamespace(height=0.5), floor=-0.3, model=model, data=data)
    panel = ViserPanel(page, stage)
    key.remove.assert_called_once_with()
    assert not page.keys, "those of the content before"
    assert server.initial_camera.position == pytest.approx((1.3, -1.0, 0.85))
    assert server.initial_camera.look_at == pytest.approx((0.0, 0.0, 0.4))
    assert nodes["/wbc/grid"].parts == (40.0, 40.0) and nodes["/wbc/grid"].how["position"] == (0.0, 0.0, -0.3)
    ball = Mark("zmp", "ball", np.array([[0.5, 0.25, 0.0]]), (0.2, 0.4, 0.6, 0.5), 0.02, "here")
    panel.draw(Picture(1.5, [ball], ["walks"], np.array([1.0, 2.0, 0.5])))
    shadows = [each.how["cast_shadow"] for name, each in nodes.items() if re.search(r"/body \d/", name)]
    assert shadows == [False, True], "of the ground and of the box"
    assert panel.scene._root.position == (-1.0, -2.0, 0.0)
    panel.scene.follow(False)
    assert panel.scene._root.position == (0.0, 0.0, 0.0)
    assert nodes["/wbc/marks/zmp"].how["color"] == (51, 102, 153)
    assert panel._said == viser_page.text_html("1.50 s", "walks") and panel.scene.meanings


def test_texts_are_brought_up_to_date_with_their_period_or_now(monkeypatch: pytest.MonkeyPatch) -> None:
    hours = Clock(monkeypatch, viser_page)
    page, said = ViserPanel.__new__(ViserPanel), ["a"]
    handle = SimpleNamespace(content="")
    page._spoken, page._texts = -math.inf, [(handle, lambda: said[0])]
    assert page.speak() and handle.content == "a"
    said[0] = "b"
    hours.now += 0.9 * viser_page.TEXT_PERIOD
    assert not page.speak() and handle.content == "a"
    assert page.speak(now=True) and handle.content == "b"
    hours.now += 1.1 * viser_page.TEXT_PERIOD
    assert page.speak()


def test_a_program_is_told_with_its_last_states() -> None:
    history = [(float(i), f"state {i}", "done") for i in range(8)]
    text = program_text(SimpleNamespace(ended=False, path="now", outcome="", history=history))  # type: ignore[arg-type]
    assert "now" in text and [f"state {i}" in text for i in range(8)] == [i >= 3 for i in range(8)]
    assert "ended: well" in program_text(SimpleNamespace(ended=True, path="", outcome="well", history=[]))  # type: ignore[arg-type]
