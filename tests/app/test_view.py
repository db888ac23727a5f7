"""The live view shows what is the case, and changes nothing."""

from __future__ import annotations

import asyncio
import json
import math
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from pages import page_url, taken
from tornado.websocket import websocket_connect

import wbc
from wbc.app.address import ViewError
from wbc.app.scene.robot_shapes import robot_parts
from wbc.app.scene.shapes import ROOT, MeshFile, Part, Surface, box, cylinder, ellipsoid
from wbc.app.scene.sources import PlantSource, RobotSource
from wbc.app.view.meshcat_view import MeshcatView
from wbc.core.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.core.signals import Command
from wbc.robots.urdf import without_geometry
from wbc.sim.terrain.spec import terrain
from wbc.tasks import Behaviour, Program, StateMachine, after
from wbc.tasks.balance import balance_controller

ROBOTS = ("hrp4_class", "talos", "g1")
Commands = list[dict[str, Any]]


def matrices(of: Commands) -> dict[str, np.ndarray]:
    moves = [command for command in of if command["type"] == "set_transform"]
    return {command["path"]: np.array(command["matrix"]).reshape(4, 4).T for command in moves}


def new_plant() -> wbc.Plant:
    return wbc.Plant(wbc.load_robot("hrp4_class"), noise="realistic", seed=5, control_period=0.002)


def fall_over(plant: wbc.Plant, commands: list[Command], view: MeshcatView | None = None) -> list[np.ndarray]:
    """Push a robot over; return its true and measured states, with noisy sensors."""
    states = []
    for command in commands:
        if plant.ticks == 50:
            plant.push("torso", [150.0, 40.0, 0.0], 0.2)
        plant.step(command)
        if view is not None:
            view.update()
        measured = plant.measure()
        states.append(
            np.concatenate(
                [plant.data.qpos, plant.data.qvel, measured.sole_wrench.ravel(), measured.specific_force]
            )
        )
    return states


@pytest.fixture(scope="module")
def plant() -> wbc.Plant:
    plant = new_plant()
    fall_over(plant, [plant.hold()] * 200)
    return plant


@pytest.fixture(scope="module")
def view(plant: wbc.Plant) -> Iterator[MeshcatView]:
    with MeshcatView(plant, port=0, rate=1000.0) as view:
        yield view


# ---- what is shown --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_every_link_is_drawn_where_pinocchio_has_it(name: str) -> None:
    description = wbc.load_robot(name)
    robot = description.robot()
    rng = np.random.default_rng(1)
    plant = wbc.Plant(description)
    plant.reset(pin.integrate(robot.model, robot.q, 0.2 * rng.normal(size=robot.nv)))
    source, model = PlantSource(plant), RobotSource(description, None)
    q = plant.truth().q
    robot.update(q, np.zeros(robot.nv))
    links = {f.name for f in robot.model.frames if f.type == pin.FrameType.BODY}
    assert set(source.scene.bodies) <= links
    moving = {robot.model.frames[robot.frame_id(body)].parentJoint for body in source.scene.bodies}
    assert moving == set(range(1, robot.model.njoints))  # something moves with every joint
    for snapshot in (source.snapshot(), model.snapshot(robot, None, 0.0), model.snapshot(q, None, 0.0)):
        for body, pose in zip(source.scene.bodies, snapshot.poses, strict=True):
            assert pose == pytest.approx(robot.placement(body).homogeneous, abs=1e-9)
        assert snapshot.com == pytest.approx(robot.com, abs=1e-9)


def test_meshes_of_the_built_in_robots_are_found() -> None:
    for name in ("talos", "g1"):
        parts = robot_parts(wbc.load_robot(name))
        assert sum(isinstance(part.shape, MeshFile) for part in parts) > 25
    assert not any(isinstance(part.shape, MeshFile) for part in robot_parts(wbc.load_robot("hrp4_class")))


def test_forces_and_zmp_are_those_of_a_robot_that_stands() -> None:
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description)
    control = wbc.PositionControl(balance_controller(description.robot(), plant.control_period))
    for _ in range(100):
        plant.step(control.command(plant.measure()))
    source, model = PlantSource(plant), RobotSource(description, None)
    robot = description.robot()
    robot.update(plant.truth().q, np.zeros(robot.nv))
    weight = robot.mass * GRAVITY
    seen = (source.snapshot(), model.snapshot(robot, plant.truth().sole_wrench, 0.5))
    for snapshot, scene in zip(seen, (source.scene, model.scene), strict=True):
        assert [kind for kind, _, _ in snapshot.forces] == ["ground", "ground"]
        assert sum(force[2] for _, _, force in snapshot.forces) == pytest.approx(weight, rel=1e-3)
        assert snapshot.zmp is not None
        assert snapshot.zmp[:2] == pytest.approx(robot.com[:2], abs=1e-3)  # at rest, the ZMP is under the CoM
        frame = dict(zip(scene.moving, scene.frame(snapshot), strict=True))
        arrows = [frame[f"{ROOT}/forces/ground_{i}"] for i in range(2)]
        assert sum(arrow[2, 2] for arrow in arrows) == pytest.approx(scene.com_height, rel=1e-3)
        for arrow, (_, point, _) in zip(arrows, sorted(snapshot.forces, key=lambda f: -f[2][2]), strict=True):
            assert arrow[:3, 3] == pytest.approx(point)
            assert abs(point[2]) < 1e-3
        assert np.linalg.norm(frame[f"{ROOT}/forces/ground_2"][:3, :3]) < 1e-5
        assert frame[f"{ROOT}/markers/zmp"][:3, 3] == pytest.approx(snapshot.zmp)
        assert frame[f"{ROOT}/markers/com"][:3, 3] == pytest.approx(robot.com)
    assert seen[0].zmp == pytest.approx(seen[1].zmp, abs=1e-3)


def test_pushes_are_arrows_that_end_where_they_press() -> None:
    plant = wbc.Plant(wbc.load_robot("hrp4_class"))
    source = PlantSource(plant)
    force = np.array([30.0, -20.0, 10.0])
    plant.push("torso", force, 0.02)
    plant.step(plant.hold())
    snapshot = source.snapshot()
    ((kind, point, pushed),) = [arrow for arrow in snapshot.forces if arrow[0] == "push"]
    assert (kind, pushed.tolist()) == ("push", force.tolist())
    place = source.scene.moving.index(f"{ROOT}/forces/push_0")
    arrow = source.scene.frame(snapshot)[place]
    assert arrow @ [0.0, 0.0, 1.0, 1.0] == pytest.approx([*point, 1.0])
    assert np.cross(arrow[:3, 2], force) == pytest.approx(np.zeros(3), abs=1e-9)
    for _ in range(5):
        plant.step(plant.hold())
    assert not [arrow for arrow in source.snapshot().forces if arrow[0] == "push"]


def test_a_robot_in_the_air_has_no_arrows() -> None:
    plant = wbc.Plant(wbc.load_robot("hrp4_class"))
    q = np.array(plant.robot.half_sitting)
    q[2] += 0.5
    plant.reset(q)
    snapshot = PlantSource(plant).snapshot()
    assert snapshot.zmp is None and not snapshot.forces


def test_rough_ground_and_soles_that_bend_are_drawn() -> None:
    ground = terrain("stones", amplitude=0.03, seed=1)
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), foot="soft", terrain=ground)
    source = PlantSource(plant)
    (relief,) = [d.shape for d in source.scene.objects if d.path == f"{ROOT}/ground/relief"]
    assert isinstance(relief, Surface)
    x, y, z = relief.vertices.T
    assert z == pytest.approx(ground.height(x, y))
    assert float(np.ptp(z)) == pytest.approx(0.03, abs=0.003)
    corners = relief.vertices[relief.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0.0).all()  # they face up, or the light falls on the wrong side
    phalanges = [body for body in source.scene.bodies if body.startswith("foot/")]
    assert len(phalanges) >= 2 * 10
    joint = plant.model.joint(plant.feet[0].sole_joints[0])
    before = source.snapshot().poses
    plant.data.qpos[joint.qposadr] += 0.1
    import mujoco  # noqa: PLC0415

    mujoco.mj_kinematics(plant.model, plant.data)
    moved = np.abs(source.snapshot().poses - before).max(axis=(1, 2)) > 1e-6
    assert 0 < moved.sum() < len(phalanges)
    assert {source.scene.bodies[i] for i in np.flatnonzero(moved)} <= set(phalanges)


def parts_of(shin: str) -> dict[str, list[Part]]:
    """Shapes of the robot without any, unless the left shin is given some, by link."""
    bare = without_geometry(wbc.load_robot("hrp4_class").urdf)
    link = '<link name="left_shin">'
    assert link in bare
    description = replace(wbc.load_robot("hrp4_class"), urdf=bare.replace(link, link + shin))
    parts: dict[str, list[Part]] = {}
    for part in robot_parts(description):
        parts.setdefault(part.body, []).append(part)
    assert set(parts) == set(RobotSource(description, None).scene.bodies)
    return parts


def extent(part: Part) -> np.ndarray:
    assert isinstance(part.shape, Surface)
    return np.ptp(part.shape.vertices, axis=0)


def test_shapes_are_closed_and_face_outwards() -> None:
    for shape, volume in (
        (box(1.0, 2.0, 3.0), 6.0),
        (ellipsoid(1.0, 2.0, 3.0), 8.0 * math.pi),
        (cylinder(0.5, 2.0), 0.5 * math.pi),
        (cylinder(0.5, 2.0, round_ends=True), (0.5 + 0.5 / 3.0) * math.pi),
    ):
        a, b, c = shape.vertices[shape.faces].transpose(1, 0, 2)
        assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(volume, rel=0.04)
        assert np.cross(b - a, c - a).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_robot_without_shapes_is_a_stick_figure() -> None:
    parts = parts_of("")
    assert len(parts) == wbc.load_robot("hrp4_class").robot().model.njoints - 1
    _, rod = parts["left_shin"]
    ends = [(rod.placement @ [0.0, 0.0, 0.5 * s * extent(rod)[2], 1.0])[:3] for s in (-1, 1)]
    assert sorted(end[2] for end in ends) == pytest.approx(
        [-0.341, 0.0], abs=1e-9
    )  # from the knee to the ankle
    plate = next(part for part in parts["left_foot"] if extent(part)[:2] == pytest.approx((0.16, 0.076)))
    assert plate.placement[2, 3] - 0.5 * extent(plate)[2] == pytest.approx(-0.093)


def test_collision_shapes_stand_in_for_a_mesh_that_is_not_there() -> None:
    missing = '<visual><geometry><mesh filename="package://nowhere/shin.stl"/></geometry></visual>'
    simple = '<collision><origin xyz="0 0 -0.1"/><geometry><sphere radius="0.05"/></geometry></collision>'
    (shin,) = parts_of(missing + simple)["left_shin"]
    assert extent(shin) == pytest.approx((0.1, 0.1, 0.1))
    assert shin.placement[2, 3] == -0.1
    assert len(parts_of(missing)["left_shin"]) == 2  # ball and rod of a stick figure


def test_colours_are_those_of_the_urdf() -> None:
    paint = '<material name="paint"><color rgba="0.2 0.4 0.6 1"/></material>'
    (shin,) = parts_of(f'<visual><geometry><box size=".1 .1 .3"/></geometry>{paint}</visual>')["left_shin"]
    assert shin.colour == (0.2, 0.4, 0.6, 1.0)
    assert extent(shin) == pytest.approx((0.1, 0.1, 0.3))


# ---- the page -------------------------------------------------------------------------------------------------------


def test_the_page_holds_robot_ground_forces_and_labels(plant: wbc.Plant, view: MeshcatView) -> None:
    view.update()
    taken(view._server)
    html, drawn = view._broadcast.page.live(""), list(map(umsgpack.unpackb, view._broadcast.commands()))
    assert "hrp4_class" in html and "contact force" in html
    objects = [command["path"] for command in drawn if command["type"] == "set_object"]
    for part in (
        "robot/head/",
        "robot/left_ankle",
        "ground/plane",
        "forces/ground_0",
        "markers/com",
        "markers/zmp",
    ):
        assert any(path.startswith(f"{ROOT}/{part}") for path in objects), part
    places = matrices(drawn)
    data, model = plant.data, plant.model
    for body in view.scene.bodies:
        pose = places[f"{ROOT}/robot/{body}"]
        place = model.body(body).id
        assert pose[:3, 3] == pytest.approx(data.xpos[place], abs=1e-12)
        assert pose[:3, :3] == pytest.approx(data.xmat[place].reshape(3, 3), abs=1e-12)


def test_a_browser_gets_the_scene_and_then_what_moves(plant: wbc.Plant, view: MeshcatView) -> None:
    async def follow() -> tuple[list[Any], list[Any]]:
        socket = await websocket_connect(page_url(view, "stream"))

        async def until_facts() -> list[Any]:
            messages: list[Any] = []
            while not messages or isinstance(messages[-1], bytes) or "hello" in messages[-1]:
                message = await asyncio.wait_for(socket.read_message(), 20.0)
                messages.append(message)
            return [umsgpack.unpackb(m) if isinstance(m, bytes) else json.loads(m) for m in messages]

        scene = await until_facts()
        assert view.pages == 1
        plant.data.xpos[plant.model.body("head").id] += [0.0, 0.0, 0.1]  # as if the head alone had moved
        view.update()
        moved = await until_facts()
        plant.data.xpos[plant.model.body("head").id] -= [0.0, 0.0, 0.1]
        socket.close()
        return scene, moved

    view.update()
    assert view.pages == 0 and not view.wait_for_page(0.0)
    scene, moved = asyncio.run(follow())
    assert scene[0]["hello"]["controls"] == {}  # there is no walk to be stopped
    assert scene[1] == {"type": "delete", "path": ROOT}
    assert sum(command.get("type") == "set_object" for command in scene) >= len(view.scene.objects)
    assert scene[-1]["time"] == plant.time and not scene[-1]["paused"]
    assert scene[-1]["target"] == pytest.approx(plant.truth().com, abs=1e-4)
    assert [command["path"] for command in moved[:-1]] == [f"{ROOT}/robot/head"]
    with (
        urllib.request.urlopen(view.url) as page,
        urllib.request.urlopen(page_url(view, "main.min.js")) as script,
    ):
        assert b"hrp4_class" in page.read() and b"MeshCat" in script.read()


# ---- it changes nothing ---------------------------------------------------------------------------------------------


def test_a_run_is_the_same_with_and_without_a_view_even_one_that_is_busy() -> None:
    # The torques are recorded first: what is compared is the plant, not one run of a solver with another.
    control = wbc.TorqueControl(balance_controller(wbc.load_robot("hrp4_class").robot(), 0.002))
    plant, commands = new_plant(), []
    while plant.time < 0.4:
        commands.append(control.command(plant.measure()))
        plant.step(commands[-1])
    alone = fall_over(new_plant(), commands)

    plant = new_plant()
    with MeshcatView(plant, port=0, rate=1e6) as view:
        states = fall_over(plant, commands[:120], view)
        assert view.frames > len(states)
        view._server.soon(time.sleep, 0.3)
        states += fall_over(plant, commands[120:], view)
    assert np.array_equal(states, alone)
    assert np.abs(alone[-1] - alone[0]).max() > 0.1  # something did happen
    view.close()  # a second time does no harm
    with pytest.raises(ViewError, match="has been closed"):
        view.update()


def test_the_state_of_a_program_stands_in_the_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    plant, said = wbc.Plant(wbc.load_robot("hrp4_class")), list[str]()
    control = wbc.PositionControl(balance_controller(plant.description.robot(), plant.control_period))
    states = [Behaviour("wait", done=after(0.02)), Behaviour("look", done=after(0.02))]
    program = Program(StateMachine("demo", states), control)
    with MeshcatView(plant, program=program, port=0, rate=1e6) as view:
        monkeypatch.setattr(view, "_send", lambda time, matrices, note: said.append(note.text[0]))
        program.run(plant, after_tick=view.update)
    assert list(dict.fromkeys(said)) == ["demo/wait", "demo/look", "demo"]


def test_pictures_are_taken_at_the_rate(view: MeshcatView, monkeypatch: pytest.MonkeyPatch) -> None:
    step = 2.0**-15  # s; 33 of them are needed to fill the 1 ms of this view
    now = math.ceil(time.perf_counter() / step) * step + 1.0
    monkeypatch.setattr("wbc.app.view.base.clock.perf_counter", lambda: now)
    view.update()
    before = view.frames
    for _ in range(1000):
        now += step
        view.update()
    assert view.frames - before == 1000 // 33
    view._next = 0.0  # for the tests that follow, which have the real clock


# ---- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rate": 0.0}, "rate of the view"),
        ({"speed": -1.0}, "speed of the view"),
        ({"port": 70000}, "port must be"),
        ({"port": 1.5}, "port must be an integer"),
        ({"host": ""}, "host must be an address.*got ''"),
        ({"terrain": terrain("stones")}, "its own terrain"),
    ],
)
def test_options_out_of_range_are_refused(plant: wbc.Plant, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        MeshcatView(plant, **options)


def test_states_that_do_not_belong_are_refused(plant: wbc.Plant, view: MeshcatView) -> None:
    with pytest.raises(InputError, match="takes its state from the plant"):
        view.update(plant.robot)
    model = RobotSource(wbc.load_robot("hrp4_class"), None)
    with pytest.raises(InputError, match="'hrp4_class', not Robot\\('talos'"):
        model.snapshot(wbc.load_robot("talos").robot(), None, 0.0)
    with pytest.raises(InputError, match="configuration to show"):
        model.snapshot(np.zeros(3), None, 0.0)
    with pytest.raises(InputError, match="sole wrenches to show"):
        model.snapshot(plant.truth().q, np.full((2, 6), np.nan), 0.0)
