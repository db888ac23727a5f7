"""The live view of a walk shows what is the case; its controls do what they say, and nothing else changes the walk."""

from __future__ import annotations

import asyncio
import io
import json
import math
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from browser import Browser, needs_chromium
from pages import page_url
from PIL import Image
from tornado.websocket import websocket_connect

import wbc
from wbc.app import live
from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.repeat import interventions_of
from wbc.app.scene.colours import STIFFEST, stiffness_colour
from wbc.app.scene.footsteps import FootstepsLayer, drift_of
from wbc.app.scene.layer import Annotations, Layer
from wbc.app.scene.layers import CORNERS, RangeLayer, make_layers
from wbc.app.scene.marks import LIFT
from wbc.app.scene.shapes import HIDDEN, ROOT
from wbc.app.scene.sources import PlantSource
from wbc.app.view.controls import LiveControls
from wbc.app.view.guard import MAX_MESSAGE
from wbc.app.view.meshcat_view import MeshcatView
from wbc.app.view.pace import Pace
from wbc.app.view.server import Broadcast
from wbc.app.view.walk_hook import WatchWalk
from wbc.core.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.sim.trial.loop import TrialHook, TrialTick
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial, walk
from wbc.walking.planning.footsteps import Footstep, FootstepPlan
from wbc.walking.planning.gait import Gait

GAIT = Gait(single_support=0.5, double_support=0.2, initial_double_support=0.5, final_double_support=0.5)
"""Quick steps: these tests are about the view."""


def short_walk(**values: Any) -> WalkSpec:
    return WalkSpec(**{"plan": WalkPlan(distance=0.1), "gait": GAIT, "timestep": 0.0025} | values)


def tick(trial: WalkTrial) -> Any:
    """One control period; returns what was measured before the plant moved on."""
    measurement = trial.plant.measure()
    command = trial.walking.command(measurement)
    trial.plant.step(command)
    return measurement


def all_feet(plan: FootstepPlan) -> list[Footstep]:
    """First swing foot, first stance foot, and all landings of a plan."""
    return [plan.lift_off(0), plan.stance(0), *plan.steps]


class Picture:
    """Matrices of all paths of a view at an instant, and its annotations."""

    def __init__(self, source: PlantSource, layers: tuple[Layer, ...]) -> None:
        self.annotations = Annotations()
        own = source.scene.frame(source.snapshot())
        self.matrices: dict[str, np.ndarray] = dict(zip(source.scene.moving, own, strict=True))
        for layer in layers:
            found = np.tile(HIDDEN, (len(layer.moving), 1, 1))
            layer.fill(found, self.annotations)
            self.matrices |= dict(zip(layer.moving, found, strict=True))

    def __getitem__(self, path: str) -> np.ndarray:
        return self.matrices[f"{ROOT}/{path}"]

    def shown(self, prefix: str) -> list[str]:
        """Paths that begin so and can be seen."""
        start = f"{ROOT}/{prefix}"
        seen = [path for path, matrix in self.matrices.items() if abs(matrix[:3, :3]).max() > 1e-3]
        return [path.removeprefix(f"{ROOT}/") for path in seen if path.startswith(start)]


class Stage:
    """A walk with its layers."""

    def __init__(self, **values: Any) -> None:
        self.trial = WalkTrial(short_walk(**values))
        self.plant, self.walking = self.trial.plant, self.trial.walking
        self.source = PlantSource(self.plant)
        self.layers = make_layers(self.plant, self.source.scene, self.walking)

    def picture(self) -> Picture:
        return Picture(self.source, self.layers)


@pytest.fixture(scope="module")
def stage() -> Stage:
    return Stage()


@pytest.fixture(scope="module")
def view(stage: Stage) -> Iterator[MeshcatView]:
    with MeshcatView(stage.plant, stage.walking, port=0, rate=1e6) as view:
        yield view


# ---- what is shown --------------------------------------------------------------------------------------------------


def test_footsteps_are_where_they_are_planned_and_where_feet_really_stand() -> None:
    stage = Stage(plan=WalkPlan(distance=0.2), noise="none")
    plan = stage.walking.walk.phases.plan
    feet = all_feet(plan)
    assert [foot.side for foot in feet] == ["left", "right", "left", "right", "left"]
    first = stage.picture()
    assert len(first.shown("footsteps/planned_")) == len(feet)
    for i, foot in enumerate(feet):
        placed = first[f"footsteps/planned_{i}"][:3, 3]
        assert placed == pytest.approx(foot.position + (0.0, 0.0, LIFT), abs=1e-5)
    assert first.shown("footsteps/real_") == ["footsteps/real_0", "footsteps/real_1"]

    left, lifted, landed, wanted = 0, None, None, None
    site = stage.plant.model.site(stage.plant.feet[left].wrench_site).id
    phases = stage.walking.walk.phases
    while stage.walking.steps_done < 2:
        if phases.swing == "left":
            drift = drift_of(stage.plant, stage.walking)
            wanted = drift @ [*phases.plan.steps[0].position, 1.0]  # the adjusted landing
        tick(stage.trial)
        picture = stage.picture()
        if phases.swing == "left" and lifted is None:
            lifted = picture["footsteps/real_0"]
            assert picture.shown("footsteps/real_") == ["footsteps/real_0", "footsteps/real_1"]
        if stage.walking.steps_done == 1:
            landed = stage.plant.data.site_xpos[site].copy()
            assert picture["footsteps/real_2"][:3, 3] == pytest.approx(landed, abs=2.0 * LIFT)
            if phases.swing == "right":
                assert f"step 2 of {len(plan)}, single support: right foot swings" in picture.annotations.text
    picture = stage.picture()
    assert picture["footsteps/real_0"] == pytest.approx(lifted)  # what was left behind stays
    assert len(picture.shown("footsteps/real_")) == 4
    assert wanted is not None
    assert picture["footsteps/planned_2"][:3, 3] == pytest.approx(wanted[:3] + (0.0, 0.0, LIFT), abs=1e-3)
    assert landed is not None and np.linalg.norm(landed[:2] - feet[0].position[:2]) > 0.05


def test_what_is_planned_is_shown_where_it_lies_in_the_true_world() -> None:
    stage = Stage(plan=WalkPlan(distance=0.2), noise="none")
    for _ in range(20):
        tick(stage.trial)
    before, data = stage.picture(), stage.plant.data
    x, y, turn = 0.3, -0.4, 0.5 * math.pi
    data.qpos[:2] = (
        x - data.qpos[1],
        y + data.qpos[0],
    )  # the robot turns and moves, the estimate does not see it
    mujoco.mju_mulQuat(
        data.qpos[3:7], np.array([math.cos(0.5 * turn), 0, 0, math.sin(0.5 * turn)]), data.qpos[3:7].copy()
    )
    mujoco.mj_forward(stage.plant.model, data)
    after = stage.picture()
    for path in [*before.shown("footsteps/planned_"), "balance/zmp_planned", "balance/dcm_planned"]:
        (was_x, was_y), now = before[path][:2, 3], after[path][:2, 3]
        assert now == pytest.approx([x - was_y, y + was_x], abs=1e-3)
    assert before.annotations.text[-1].startswith("estimate 0 mm and ")
    assert after.annotations.text[-1].endswith(" mm and +90.0° off")


def test_a_stop_takes_footsteps_away() -> None:
    stage = Stage(plan=WalkPlan(distance=1.0))
    while stage.walking.walk.phases.swing is None:
        tick(stage.trial)
    before = stage.picture().shown("footsteps/planned_")
    stage.walking.stop()
    assert len(before) == 2 + 8
    assert len(stage.picture().shown("footsteps/planned_")) == 2 + len(stage.walking.walk.phases.plan) <= 4


def test_only_the_last_footsteps_of_a_long_walk_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbc.app.scene.footsteps.MAX_STEPS", 6)
    stage = Stage(plan=WalkPlan(distance=1.0))
    (layer,) = [layer for layer in stage.layers if isinstance(layer, FootstepsLayer)]
    assert len(layer.moving) == 2 * 6
    feet = all_feet(stage.walking.walk.phases.plan)
    phases = stage.walking.walk.phases
    phases.step = phases.completed = 5  # as if five had been taken: the next ones are 7, 8, 9 and the end
    picture = stage.picture()
    places = ("footsteps/planned_1", "footsteps/planned_0", "footsteps/planned_3")  # left stays left
    assert set(picture.shown("footsteps/planned_")) == set(places)
    for i, path in zip((7, 8, 9), places, strict=True):
        assert picture[path][:2, 3] == pytest.approx(feet[i].position[:2])
        assert feet[i].side == feet[int(path[-1])].side


def test_balance_is_shown_as_it_is_and_as_planned() -> None:
    stage = Stage(foot="soft", noise="none")
    while stage.walking.walk.phases.swing is None:
        tick(stage.trial)
    for _ in range(40):
        tick(stage.trial)
    picture, truth, reference = stage.picture(), stage.plant.truth(), stage.walking.reference
    assert reference is not None
    dcm = truth.com + truth.com_velocity / stage.walking.walk.omega
    assert picture["balance/dcm"][:2, 3] == pytest.approx(dcm[:2])
    assert picture["balance/zmp_planned"][:2, 3] == pytest.approx(reference.pendulum.zmp[:2], abs=3e-3)
    assert picture["balance/dcm_planned"][:2, 3] == pytest.approx(reference.pendulum.dcm[:2], abs=3e-3)
    corners = picture.annotations.shapes[f"{ROOT}/support/polygon"]
    assert corners.shape == (CORNERS, 3) and np.ptp(corners[:, 2]) == 0.0
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([-edges[:, 1], edges[:, 0]])  # to the inside: corners are counter-clockwise
    zmp = picture["markers/zmp"][:2, 3]
    assert ((zmp - corners[:, :2]) * normals).sum(axis=1).min() > -1e-6  # a ZMP cannot be elsewhere
    bearing = truth.contact_force[:, 2] > 0.005 * stage.plant.robot.mass * GRAVITY
    inside = (truth.contact_position[bearing, None, :2] - corners[:, :2]) * normals
    assert inside.sum(axis=2).min() > -1e-9


def test_soles_have_the_colour_of_their_stiffness() -> None:
    stage = Stage(foot="variable", stiffness=10.0)
    parts = [drawing.path for drawing in stage.source.scene.objects]
    colours = stage.picture().annotations.colours
    assert len(colours) == 2 * 10  # the phalanges
    assert set(colours.values()) == {stiffness_colour(10.0)}
    for path in colours:
        assert any(part.startswith(path + "/") for part in parts)
    stage.plant.step(stage.plant.hold())
    joints = [stage.plant.model.joint(name).id for name in stage.plant.feet[1].variable_joints]
    stage.plant.model.jnt_stiffness[joints] = 40.0
    picture = stage.picture()
    assert set(picture.annotations.colours.values()) == {stiffness_colour(10.0), stiffness_colour(40.0)}
    assert "soles 10.0 and 40.0 Nm/rad" in picture.annotations.text
    reds = [stiffness_colour(k)[0] for k in (0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0)]
    assert all(a < b for a, b in zip(reds, reds[1:], strict=False))
    assert stiffness_colour(2.0 * STIFFEST) == stiffness_colour(STIFFEST)
    assert not Stage().picture().annotations.colours  # rigid soles have none


def test_rays_end_on_the_ground_and_scans_lie_on_it() -> None:
    spec = short_walk(foot="variable", noise="none", terrain="stones", amplitude=0.02, seed=3)
    trial = WalkTrial(spec)
    plant, ground = trial.plant, spec.ground()
    layer = RangeLayer(plant, trial.walking)
    side = None
    while trial.walking.walk.phases.elapsed < 0.3 or side is None:
        measurement = plant.measure()
        layer.measurement, note = measurement, Annotations()
        matrices = np.tile(HIDDEN, (2, 1, 1))
        command = trial.walking.command(measurement)
        layer.fill(matrices, note)
        plant.step(command)
        side = trial.walking.walk.phases.swing
    i = 0 if side == "left" else 1
    start, end = (matrices[i] @ [0.0, 0.0, s, 1.0] for s in (-0.5, 0.5))
    heights = sorted([(start[2], start), (end[2], end)], key=lambda pair: pair[0])
    low = heights[0][1]
    assert low[2] == pytest.approx(float(ground.height(low[0], low[1])), abs=1e-3)
    assert math.dist(start, end) == pytest.approx(float(measurement.sole_range[i]))
    scan = note.shapes[f"{ROOT}/range/scan_{i}"]
    middle = 0.5 * (scan[: len(scan) // 2] + scan[len(scan) // 2 :])
    seen = ground.height(middle[:, 0], middle[:, 1])
    assert middle[:, 2] == pytest.approx(seen + LIFT, abs=1.5e-3)
    assert np.ptp(middle[:, 0]) > 0.02  # the toe has moved on
    assert f"{ROOT}/range/scan_{1 - i}" not in note.shapes  # the foot that stands scans nothing


def test_annotations_say_everything() -> None:
    stage = Stage(foot="variable", plan=WalkPlan(distance=3.0))
    note = stage.picture().annotations
    rng = np.random.default_rng(0)
    note.shapes = {path: -100.0 * rng.random(shape.shape) for path, shape in note.shapes.items()}
    note.target = (1.0, 2.0, 3.0)
    said = json.loads(json.dumps(note.plain()))
    assert said["text"].startswith("step 1 of 22") and said["target"] == [1.0, 2.0, 3.0]
    for path, shape in note.shapes.items():
        assert np.reshape(said["shapes"][path], (-1, 3)) == pytest.approx(shape, abs=1e-4)


# ---- it changes nothing ---------------------------------------------------------------------------------------------


class Commands(TrialHook):
    """Recorder of all commands."""

    def __init__(self) -> None:
        self.all: list[bytes] = []

    def tick(self, tick: TrialTick) -> None:
        assert tick.command.joint_position is not None
        self.all.append(tick.command.joint_position.tobytes())


@pytest.mark.slow
def test_a_walk_is_the_same_bit_for_bit_with_and_without_a_view() -> None:
    spec = short_walk(foot="variable", terrain="stones", amplitude=0.01, plan=WalkPlan(distance=0.05))
    alone, watched = Commands(), Commands()
    plain = walk(spec, hooks=[alone])
    with WatchWalk(port=0, rate=1e6, speed=None) as watch:
        result = walk(spec, hooks=[watch, watched])
        assert watch.view is not None and watch.view.frames > len(watched.all)
    assert result.record() == plain.record() and plain.outcome == "completed"
    assert watched.all == alone.all
    assert watch.interventions == []


# ---- controls -------------------------------------------------------------------------------------------------------


def test_pushes_come_from_the_robots_side_and_are_written_down() -> None:
    stage = Stage(start=(0.0, 0.0, 0.5 * math.pi), noise="none")
    plant = stage.plant
    controls = LiveControls(plant, stage.walking)
    tick(stage.trial)
    controls.apply({"do": "push", "direction": "left", "impulse": 0.3})
    tick(stage.trial)
    force = plant.data.xfrc_applied[:, :3].sum(axis=0)
    assert force == pytest.approx([-3.0 * plant.robot.mass, 0.0, 0.0], abs=1.0)  # the robot looks along y
    (entry,) = controls.interventions
    assert entry == {"time": plant.control_period, "what": "push", "direction": "left", "impulse": 0.3}
    assert controls.message == "0.01 s: pushed left with 0.3 Ns/kg"


def test_gains_and_stiffness_are_set_and_stops_stop() -> None:
    stage = Stage(foot="variable", stiffness=10.0, plan=WalkPlan(distance=0.5), noise="none")
    walking = stage.walking
    controls = LiveControls(stage.plant, walking)
    offer = {gain["name"]: gain["value"] for gain in controls.available()["gains"]}
    assert offer["dcm_p"] == walking.stabilizer.gains.dcm_p[0]  # type: ignore[index]
    assert controls.available()["stiffness"] == {"low": 1.0, "high": 2000.0, "value": 10.0}
    controls.apply({"do": "gain", "name": "dcm_p", "value": 5.5})
    controls.apply({"do": "stiffness", "value": 30})
    controls.apply({"do": "stop"})
    assert walking.stabilizer.gains.dcm_p == (5.5, 5.5)
    assert [entry["what"] for entry in controls.interventions] == ["gain", "stiffness", "stop"]
    assert len(walking.walk.phases.plan) < 2
    in_time = (("stiffness.early_landing", 0.0),)  # these swings are too short to be sure of more
    stage = Stage(foot="variable", stiffness=10.0, noise="none", changes=in_time)
    LiveControls(stage.plant, stage.walking).apply({"do": "stiffness", "value": 30.0})
    while stage.walking.steps_done < 1:
        measured = tick(stage.trial).sole_stiffness
    assert measured == pytest.approx([30.0, 10.0], abs=0.5)  # the foot that has swung


@pytest.mark.parametrize(
    ("order", "message"),
    [
        ("push", "must say what to do"),
        ({"do": "jump"}, "request 'jump'"),
        ({"do": "push", "direction": "up", "impulse": 0.1}, "forward"),
        ({"do": "push", "direction": "left", "impulse": 50.0}, "impulse"),
        ({"do": "push", "direction": "left", "impulse": "hard"}, "must be a number"),
        ({"do": "push", "direction": "left", "impulse": 10**400}, "refused"),
        ({"do": "gain", "name": "dcm_q", "value": 1.0}, "dcm_p"),
        ({"do": "gain", "name": "dcm_p", "value": float("nan")}, "finite"),
        ({"do": "gain", "name": "dcm_p", "value": -1.0}, "gain 'dcm_p'"),
        ({"do": "stiffness", "value": 5.0}, "request 'stiffness'"),  # soles that are what they are
    ],
)
def test_requests_that_make_no_sense_are_refused(stage: Stage, order: Any, message: str) -> None:
    controls = LiveControls(stage.plant, stage.walking)
    controls.apply(order)
    assert "refused" in controls.message and message in controls.message
    assert controls.interventions == []
    without = LiveControls(None, None)
    without.apply({"do": "push", "direction": "left", "impulse": 0.1})
    assert "refused" in without.message and without.available() == {}


NONSENSE: tuple[str | bytes, ...] = (
    "",
    "no JSON",
    b"\xff\xfe",
    "null",
    "3",
    "[]",
    '{"speed": "fast"}',
    '{"speed": NaN}',
    '{"speed": -1}',
    '{"speed": true}',
    '{"speed": 1e999}',
    '{"order": 3}',
    '{"order": {"do": ["push"]}}',
    '{"order": {"do": "push", "impulse": Infinity}}',
    '{"order": {"do": "' + "x" * 101 + '"}}',
    '{"order": {"do": "\\ud800"}}',
    '{"order": {"value": ' + "9" * 4000 + "}}",
    '{"paused": 1}',
    '{"paused": true, "more": 1}',
    "[" * 4000,
    '{"order":' * 400,
    '{"paused": true}' + " " * MAX_MESSAGE,
)
"""Messages that are dropped."""


def test_pages_ask_for_pause_speed_and_changes(stage: Stage) -> None:
    pace, orders = Pace(1.0), list[dict[str, Any]]()
    broadcast = Broadcast(stage.source.scene, pace, orders.append, {}, "token")
    for nonsense in NONSENSE:
        broadcast.take_input(nonsense)
    assert (pace.paused, pace.speed, orders) == (False, 1.0, [])
    broadcast.take_input('{"paused": true, "speed": 0.5}')
    assert pace.paused and pace.speed == 0.5
    broadcast.take_input('{"speed": null, "order": {"do": "push", "number": 3}}')
    assert pace.paused and pace.speed is None and orders == [{"do": "push", "number": 3}]


def test_a_page_pauses_and_pushes(stage: Stage, view: MeshcatView) -> None:
    sent, ended = threading.Event(), threading.Event()
    said: list[dict[str, Any]] = []

    async def follow() -> None:
        page = await websocket_connect(page_url(view, "stream"))
        await page.write_message("no JSON")
        await page.write_message(json.dumps({"paused": True}))
        await page.write_message(
            json.dumps({"order": {"do": "push", "direction": "forward", "impulse": 0.2}})
        )

        async def until(what: Any) -> None:
            while True:
                message = await asyncio.wait_for(page.read_message(), 20.0)
                if isinstance(message, str):
                    said.append(json.loads(message))
                    if what(said[-1]):
                        return

        await until(lambda facts: facts.get("paused"))
        sent.set()
        await until(lambda facts: "pushed forward" in facts.get("text", ""))  # the run has noticed
        assert not ended.is_set()
        await page.write_message(json.dumps({"paused": False, "speed": 2.0}))
        await until(lambda facts: facts.get("paused") is False)
        await page.write_message(json.dumps({"paused": True}))
        await until(lambda facts: facts.get("paused"))
        page.close()  # and with the last page the pause ends
        while await page.read_message() is not None:
            pass

    thread = threading.Thread(target=lambda: asyncio.run(follow()))
    thread.start()
    assert sent.wait(20.0)
    end = time.monotonic() + 20.0
    while not view.interventions and time.monotonic() < end:
        view.update()
    ended.set()
    assert [entry["what"] for entry in view.interventions] == ["push"]
    thread.join(20.0)
    assert not thread.is_alive()
    view.update()  # would hang
    hello = next(facts["hello"] for facts in said if "hello" in facts)
    assert set(hello["controls"]) == {"stop"}
    stage.plant.step(stage.plant.hold())
    assert stage.plant.data.xfrc_applied[:, 0].max() == pytest.approx(2.0 * stage.plant.robot.mass)


def test_a_walk_without_a_plant_is_refused(stage: Stage) -> None:
    with pytest.raises(InputError, match="with its plant"):
        MeshcatView(wbc.load_robot("hrp4_class"), stage.walking)


# ---- commands -------------------------------------------------------------------------------------------------------

WALK = ("walk", "--distance", "0.02", "--set", "timestep=0.0025", "--view", "--json")


def test_a_port_in_use_stops_a_walk_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "old.arrow"
    log.write_text("kept")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert main([*WALK, "--port", port, "--record", str(log)]) == BAD_INPUT
    captured = capsys.readouterr()
    assert f"127.0.0.1:{port}" in captured.err and "another port" in captured.err and not captured.out
    assert log.read_text() == "kept"


@pytest.mark.slow
def test_a_result_says_whether_the_page_has_changed_the_walk(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "BROWSER_TIME", 0.0)
    order = {"do": "push", "direction": "left", "impulse": 0.05}
    start = WatchWalk.start

    def push_at_once(self: WatchWalk, trial: WalkTrial) -> None:
        start(self, trial)
        assert self.view is not None
        self.view._pace.speed = None
        self.view.controls.order(order)

    monkeypatch.setattr(WatchWalk, "start", push_at_once)
    log = tmp_path / "walk.arrow"
    assert main([*WALK, "--port", "0", "--record", str(log)]) == RAN
    data = json.loads(capsys.readouterr().out)
    assert data["interactive"] is True
    assert data["interventions"] == [{"time": 0.0, "what": "push", "direction": "left", "impulse": 0.05}]
    assert interventions_of(log) == data["interventions"]


# ---- in a browser ---------------------------------------------------------------------------------------------------

TREE = """(() => {
    const names = [];
    const walk = (node, path) => {
        for (const [name, child] of Object.entries(node.children)) {
            if (name === "<object>") names.push(path); else walk(child, path + "/" + name);
        }
    };
    walk(viewer.scene_tree.find(["wbc"]), "");
    return names;
})()"""


@pytest.mark.slow
@needs_chromium
def test_a_browser_shows_robot_terrain_and_labels_during_a_walk(tmp_path: Path) -> None:
    spec = short_walk(foot="variable", stiffness=20.0, terrain="stones", amplitude=0.02, seed=7)
    trial = WalkTrial(replace(spec, policy="fixed", policy_params=(("stiffness", 20.0),)))
    with (
        MeshcatView(trial.plant, trial.walking, port=0) as view,
        Browser(tmp_path / "profile") as browser,
    ):
        browser.open(view.url)
        assert view.wait_for_page(60.0)
        while trial.walking.walk.phases.swing is None or trial.walking.walk.phases.elapsed < 0.25:
            tick(trial)
            view.update()
        before = view.frames
        while view.frames == before:
            view.update()
        shown = f"{trial.plant.time:.2f} s"
        browser.wait(f'document.getElementById("time").textContent === "{shown}"')

        objects = browser.wait(f"(() => {{ const names = {TREE}; return names.length > 100 && names; }})()")
        for part in (
            "/robot/head/",
            "/robot/foot_",
            "/ground/plane/",
            "/ground/relief/",
            "/footsteps/planned_3/",
            "/footsteps/real_0/",
            "/forces/ground_0/",
            "/markers/zmp/",
            "/balance/dcm/",
            "/support/polygon/",
            "/range/ray_",
            "/range/scan_",
        ):
            assert any(name.startswith(part) for name in objects), part
        where = "viewer.scene_tree.find(['wbc', 'robot', 'head']).object.matrixWorld.elements.slice(12, 15)"
        browser.evaluate("viewer.scene.updateMatrixWorld(true)")
        x, y, z = browser.evaluate(f"Array.from({where})")  # y is up in the viewer's world
        head = trial.plant.data.body("head").xpos
        assert (x, -z, y) == pytest.approx(tuple(head), abs=1e-3)
        words = browser.evaluate('document.getElementById("facts").innerText')
        assert "step 1 of" in words and "soles 20.0 and 20.0 Nm/rad" in words
        for label in (
            "ZMP",
            "DCM",
            "contact force",
            "support polygon",
            "left footstep",
            "range ray",
            "as scanned",
        ):
            assert label in words
        colours = browser.evaluate(
            "(() => { const seen = []; for (const [name, node] of "
            "Object.entries(viewer.scene_tree.find(['wbc', 'robot']).children)) if (name.startsWith('foot_')) "
            "node.object.traverse((part) => { if (part.material) seen.push(part.material.color.toArray()); });"
            "return seen; })()"
        )
        expected = np.array(stiffness_colour(20.0)[:3])
        assert (np.abs(np.array(colours) - expected).max(axis=1) < 0.01).sum() == 2 * 10  # the phalanges

        picture = np.asarray(Image.open(io.BytesIO(browser.screenshot())).convert("RGB")).reshape(-1, 3)
        assert len(np.unique(picture, axis=0)) > 2000  # something is drawn

        browser.evaluate('document.getElementById("stop").click()')
        end = time.monotonic() + 20.0
        while not view.interventions and time.monotonic() < end:
            tick(trial)
            view.update()
        assert [entry["what"] for entry in view.interventions] == ["stop"]
        before = view.frames
        while view.frames < before + 2:
            tick(trial)
            view.update()
        browser.wait('document.getElementById("text").textContent.includes("told to stop")')

        place = view.url.partition("?")[0]
        browser.open(place)  # without the token
        browser.wait("document.getElementById('pause')?.disabled")
        assert "open the link" in browser.evaluate("document.getElementById('change').textContent")
        assert not browser.errors  # nor has the content security policy blocked anything
        assert all(url.startswith((place, "data:", "blob:")) for url in browser.requests)
