"""Pages and windows of live views: pace, captions, ports, and what a browser shows."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from browser import Browser, needs_chromium
from foreign import foreign_model
from log_writing import write
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect
from watched_walk import tick

import wbc
from wbc.app import MeshcatView, live
from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.view import base
from wbc.app.view.base import PortError, ViewError
from wbc.app.view.marks import (
    DCM_COLOUR,
    css,
)
from wbc.app.view.mujoco_view import MujocoView
from wbc.app.view.rerun_view import RerunView
from wbc.sim import MujocoLoop
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.walking.plans.gait import Gait

HRP4 = wbc.load_robot("hrp4_class")
GAIT = Gait(single_support=0.5, double_support=0.2, initial_double_support=0.5, final_double_support=0.5)
"""Quick steps: these tests are about the view."""


def short_walk(**values: Any) -> WalkSpec:
    return WalkSpec(**{"plan": WalkPlan(distance=0.1), "gait": GAIT, "timestep": 0.0025} | values)


def test_a_run_is_held_to_its_pace_and_its_rate_of_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that goes on while the view sleeps, and 1 ms a tick: 0.5 s of the run take 0.5 s / speed."""
    now, time = [10.0], [0.0]
    names = {"perf_counter": lambda: now[0], "sleep": lambda wait: now.__setitem__(0, now[0] + wait)}
    monkeypatch.setattr(base, "clock", SimpleNamespace(**names))
    plant = wbc.Plant(HRP4)
    monkeypatch.setattr(type(plant), "time", property(lambda self: time[0]))
    with MeshcatView(plant, port=0, speed=0.5, rate=20.0) as view:
        for speed, wanted in ((0.5, 1.0), (1.0, 0.5), (4.0, 0.125), (None, 0.1)):
            view.speed = speed
            view.update()
            begin, shown = now[0], view.frames
            for _ in range(100):
                now[0] += 1e-3
                time[0] += 0.005
                view.update()
            assert now[0] - begin == pytest.approx(wanted, abs=2e-3)
            assert 0.75 * 20.0 * wanted - 1.0 < view.frames - shown < 20.0 * wanted + 1.0


# ---- pages ----------------------------------------------------------------------------------------------------------


def test_meshcat_answers_on_this_machine_alone_and_shows_any_loop() -> None:
    loop = MujocoLoop(HRP4, foreign_model(HRP4, "motor"), prefix="mine/")
    with MeshcatView(loop, port=0, rate=1e6) as view:
        with urllib.request.urlopen(view.url) as page:
            assert page.status == 200 and b"MeshCat" in page.read()
        with pytest.raises(urllib.error.HTTPError, match="404"):  # a foreign name that was made to lead here
            urllib.request.urlopen(urllib.request.Request(view.url, headers={"Host": "evil.example"}))
        loop.step(loop.hold())
        view.update()
        assert view.frames >= 2 and view.pages == 0 and not view.wait_for_page(0.0)
        port = int(view.url.split(":")[2].split("/")[0])
        with pytest.raises(PortError, match=str(port)):
            MeshcatView(loop, port=port)
        with socket.socket() as probe:  # a server for all addresses would answer at this one, too
            assert probe.connect_ex(("127.0.0.2", port)) != 0
    with pytest.raises(ViewError, match="closed"):
        view.update()
    with pytest.raises(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
        pass  # the server has ended with the view


@pytest.mark.slow
def test_a_run_goes_on_while_a_page_takes_nothing() -> None:
    plant = wbc.Plant(HRP4)
    with MeshcatView(plant, port=0, rate=1e6) as view, socket.socket() as page:
        page.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        page.connect(("127.0.0.1", int(view.url.split(":")[2].split("/")[0])))
        upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        key = "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA=="
        page.sendall(f"GET / HTTP/1.1\r\nHost: localhost\r\n{upgrade}{key}\r\n\r\n".encode())
        assert view.wait_for_page(30.0)
        stuck = 0
        while stuck < 100:  # until the buffers of the connection are full
            view.update()
            stuck = stuck + 1 if view._server.busy else 0
        page.settimeout(20.0)
        while view._server.busy:
            assert page.recv(1 << 20)
    assert view.pages == 0


async def captions(trial: WalkTrial) -> list[dict[str, Any]]:
    """Captions that a walk's page gets while the robot is pushed over."""
    with MeshcatView(trial.plant, trial.control, port=0, rate=1e6) as view:
        address = view.url.replace("http", "ws").replace("static/", "caption")
        with pytest.raises(HTTPClientError, match="403"):  # the page of another site
            await websocket_connect(HTTPRequest(address, headers={"Origin": "http://evil.example"}))
        reader = await websocket_connect(address)
        trial.plant.push("torso", (0.0, 500.0, 0.0), 0.1)
        while trial.control.fallen is None and trial.plant.time < 3.0:
            tick(trial)
            view.update()
        view.ended("<b>fell</b>")
    said = []
    while (message := await asyncio.wait_for(reader.read_message(), 30.0)) is not None:
        said.append(json.loads(message))
    return [caption for caption in said if caption["lines"]]


@pytest.mark.slow
def test_the_caption_has_time_state_and_legend_and_is_not_made_while_nobody_watches() -> None:
    trial = WalkTrial(short_walk())
    first, last = asyncio.run(captions(trial))  # no page of MeshCat was open in between
    assert (
        first["lines"][:2] == ["0.00 s", "double support, 0 steps done"] and "control: ok" in first["lines"]
    )
    assert ["DCM", css(DCM_COLOUR)] in first["legend"] and "push" not in dict(first["legend"])
    fallen = trial.control.fallen
    assert fallen is not None and last["lines"][0] == f"{trial.plant.time:.2f} s"
    assert any(line.startswith(f"control: fallen: {fallen.value}") for line in last["lines"])
    assert (
        last["lines"][-1] == "the run has ended: <b>fell</b>"
    )  # a text, which the page does not take as HTML


WALK = ("walk", "--distance", "0.02", "--set", "timestep=0.0025", "--json")


def test_a_port_in_use_stops_a_walk_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "walk.arrow"
    write(log, 5).close()
    kept = log.read_bytes()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert main([*WALK, "--view", "meshcat", "--port", port, "--record", str(log)]) == BAD_INPUT
    captured = capsys.readouterr()
    assert port in captured.err and not captured.out and log.read_bytes() == kept


@pytest.mark.slow
@pytest.mark.parametrize("viewer", ["meshcat", "workbench", "rerun"])
def test_the_command_shows_a_walk(
    viewer: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "BROWSER_TIME", 0.0)
    assert main([*WALK, "--view", viewer, "--port", "0"]) == RAN
    assert json.loads(capsys.readouterr().out)["interactive"] is False


@pytest.mark.slow
@needs_chromium
def test_rerun_counts_its_pages_and_shows_the_run_again(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    plant = wbc.Plant(HRP4)
    with RerunView(plant, port=0, rate=1e6) as view, Browser(tmp_path / "profile") as browser:
        assert view.pages == 0
        port = int(view.url.split(":")[2].split("/")[0])
        with socket.socket() as probe:  # a server for all addresses would answer at this one, too
            assert probe.connect_ex(("127.0.0.2", port)) != 0
        browser.open(view.url)
        assert view.wait_for_page(60.0) and view.pages == 1
        plant.step(plant.hold())
        view.update()
    assert view.pages == 0
    with pytest.raises(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
        pass  # the server has ended with the view


def test_a_window_needs_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ViewError, match="meshcat"):
        MujocoView(wbc.Plant(HRP4))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb on this machine")
def test_the_window_of_mujocos_viewer_shows_a_copy_of_the_run(tmp_path: Path) -> None:
    with subprocess.Popen(["Xvfb", "-displayfd", "1"], stdout=subprocess.PIPE, text=True) as screen:
        try:
            assert screen.stdout is not None
            number = screen.stdout.readline().strip()
            environment = os.environ | {"DISPLAY": f":{number}", "PYTHONPATH": os.pathsep.join(sys.path)}
            done = subprocess.run(
                [sys.executable, "-c", WINDOW],
                env=environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=300,
            )
        finally:
            screen.terminate()
    assert done.returncode == 0, done.stderr


WINDOW = """
import mujoco, numpy as np, wbc
from wbc.app.view.mujoco_view import MujocoView
plant = wbc.Plant(wbc.load_robot("hrp4_class"), foot="soft")
before = plant.model.geom_rgba.copy()
with MujocoView(plant, rate=1e6) as view:
    for _ in range(3):
        plant.step(plant.hold())
        view.update()
    window = view._window
    assert view.pages == 1 and window.user_scn.ngeom > 5
    assert window.d is not plant.data and np.array_equal(window.d.qpos, plant.data.qpos)
    assert (window.m.geom_rgba != before).any() and np.array_equal(plant.model.geom_rgba, before)
    window.close()
    view.update()
assert view.pages == 0
"""
"""Program of a child: MuJoCo chooses its way to draw when it is imported."""


@pytest.mark.slow
@needs_chromium
def test_a_browser_shows_the_robot_where_it_is(tmp_path: Path) -> None:
    trial = WalkTrial(short_walk(terrain="stones", amplitude=0.02))
    with MeshcatView(trial.plant, trial.control, port=0) as view, Browser(tmp_path / "profile") as browser:
        browser.open(view.url)
        assert view.wait_for_page(60.0)
        trial.plant.push("torso", (1.0, 0.0, 0.0), 0.05)
        for _ in range(180):
            tick(trial)
            view.update()
        head = trial.plant.model.body("head").id
        view.ended("<b>far</b>")
        view.close()
        caption = "document.getElementById('caption').innerText"
        browser.wait(f"{caption}.includes('the run has ended: <b>far</b>')")
        said = browser.evaluate(caption).splitlines()
        assert said[0] == f"{trial.plant.time:.2f} s" and {"ZMP", "push", "contact force"} <= set(said)
        x, y, z = trial.plant.data.xpos[head].tolist()
        path = json.dumps(["meshcat", "wbc", f"body {head}"])
        there = f"viewer.scene_tree.find({path}).object"
        near = f"Math.hypot(p[0] - {x}, p[1] - {y}, p[2] - {z}) < 1e-3"
        browser.wait(f"(() => {{ const p = {there}.matrix.elements.slice(12, 15); return {near}; }})()")
        script = f"viewer.scene.updateMatrixWorld(true), {there}.matrixWorld.elements.slice(12, 15)"
        ahead, up, _ = browser.evaluate(
            f"({script})"
        )  # y is up in the viewer's world, whose camera looks at the origin
        assert abs(ahead) < 0.2 and abs(up - z + 0.8 * view.run.stage.scale.height) < 0.05
        names = browser.evaluate("Object.keys(viewer.scene_tree.find(['meshcat', 'wbc', 'mark']).children)")
        assert {"com", "zmp", "dcm", "planned step 0", "real step 0"} <= set(names)
        assert not browser.errors
