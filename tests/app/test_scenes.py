"""Scenes of all pages: what was shown before, in the same run or in another one, does not change what is shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from properties import by_default
from scipy.spatial.transform import Rotation

from wbc.app.view.marks import Mark, Picture, Scale
from wbc.app.view.meshcat_view import MeshcatScene
from wbc.app.view.rerun_view import RerunScene, RerunView
from wbc.app.view.stage import DrawnScene
from wbc.app.view.viser_page import ViserScene

KINDS = {"ball": 1, "arrow": 2, "line": 5, "area": 4, "cloud": 3}
"""Kinds of marks, and the number of their points."""

XML = """<mujoco><worldbody><geom type="plane" size="1 1 0.1"/>
<body name="{name}"><freejoint/><geom type="box" size="0.1 0.2 0.3" rgba="1 0.5 0 {opacity}"/>
<body><joint/><geom size="0.1"/></body></body></worldbody></mujoco>"""


def stage_of(name: str, opacity: float) -> Any:
    model = mujoco.MjModel.from_xml_string(XML.format(name=name, opacity=opacity))
    return SimpleNamespace(
        model=model, data=mujoco.MjData(model), floor=0.0, scale=Scale(0.8, 400.0), title=name
    )


class MeshcatPage:
    """Tree of MeshCat, by its own commands."""

    def begin(self, stage: Any) -> DrawnScene:
        self.shown = getattr(self, "shown", {})
        return MeshcatScene(stage)

    def state(self, scene: Any) -> dict[Any, Any]:
        for (kind, path, *rest), data in scene.messages:
            if kind == "delete":
                self.shown = {k: v for k, v in self.shown.items() if not f"{k[1]}/".startswith(f"{path}/")}
            else:
                self.shown[kind, path, *rest] = self._without_names(data)
        scene.messages = []
        return self.shown

    def place(self, scene: Any) -> tuple[Any, Any]:
        matrix = np.reshape(self.state(scene)["set_transform", "/meshcat/wbc/body 1"]["matrix"], (4, 4)).T
        return matrix[:3, 3], matrix[:3, :3]

    @staticmethod
    def _without_names(data: bytes) -> Any:
        from meshcat.geometry import umsgpack  # noqa: PLC0415

        plain = umsgpack.unpackb(data)
        if "object" not in plain:
            return plain
        (shape,), (material,) = plain["object"]["geometries"], plain["object"]["materials"]
        return [{key: value for key, value in each.items() if key != "uuid"} for each in (shape, material)]


class ViserNodes(dict[str, Any]):
    """Nodes of viser's scene."""

    reset = dict.clear

    def add_frame(self, name: str, **how: Any) -> Any:
        self[name] = SimpleNamespace(**how, remove=lambda: self.pop(name))
        return self[name]

    def add_grid(self, name: str, *size: float, **how: Any) -> Any:
        return self.add_frame(name, size=size, **how)

    def add_mesh_simple(self, name: str, vertices: Any, faces: Any, **how: Any) -> Any:
        return self.add_frame(name, vertices=np.asarray(vertices, np.float32), faces=faces, **how)


class ViserPage:
    """Page of viser."""

    def __init__(self) -> None:
        self.nodes = ViserNodes()

    def begin(self, stage: Any) -> DrawnScene:
        return ViserScene(stage, self.nodes)

    def state(self, scene: Any) -> dict[Any, Any]:
        del scene
        plain = {name: {**vars(node)} for name, node in self.nodes.items()}
        for each in plain.values():
            del each["remove"]
        return plain

    def place(self, scene: Any) -> tuple[Any, Any]:
        node = self.state(scene)["/wbc/body 1"]
        return node["position"], Rotation.from_quat(np.roll(node["wxyz"], -1)).as_matrix()


class RerunPage:
    """Recording of Rerun that the page shows, the last one that has begun."""

    def __init__(self) -> None:
        rerun = pytest.importorskip("rerun")
        self.recordings: list[dict[str, dict[str, Any]]] = []
        self.view: Any = RerunView.__new__(RerunView)
        self.view._stream, self.view._source = None, "page"

        def recording(_: str) -> Any:
            entities: dict[str, dict[str, Any]] = {}
            self.recordings.append(entities)

            def log(path: str, what: Any, static: bool = False) -> None:
                del static
                if isinstance(what, rerun.Clear):
                    entities.pop(path, None)
                    return
                columns = {
                    str(each.component_descriptor()): each.as_arrow_array().to_pylist()
                    for each in what.as_component_batches()
                }
                entities.setdefault(path, {}).update(columns)

            idle = dict.fromkeys(("set_time", "connect_grpc", "send_blueprint"), lambda *_, **how: None)
            return SimpleNamespace(log=log, disconnect=lambda: None, **idle)

        self.recording = recording

    def begin(self, stage: Any) -> DrawnScene:
        self.view.run = SimpleNamespace(stage=stage)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("rerun.RecordingStream", self.recording)
            self.view._build()
        scene: RerunScene = self.view._scene
        return scene

    def state(self, scene: Any) -> dict[Any, Any]:
        del scene
        return self.recordings[-1]

    def place(self, scene: Any) -> tuple[Any, Any]:
        columns = self.state(scene)["robot/robot"]
        (place,), (turn,) = (
            next(values for name, values in columns.items() if part in name)
            for part in ("translation", "quaternion")
        )
        return place, Rotation.from_quat(turn).as_matrix()


PAGES: dict[str, Callable[[], Any]] = {"meshcat": MeshcatPage, "viser": ViserPage, "rerun": RerunPage}


def picture(rng: np.random.Generator, time: float) -> Picture:
    """A picture of some marks of any kind, in colours that may let light through, on a robot that may be painted."""

    def colour() -> Any:
        return *(round(float(part), 2) for part in rng.uniform(size=3)), float(rng.choice([0.3, 1.0]))

    marks: list[Any] = []
    for name in KINDS:
        kind: Any = name if rng.uniform() < 0.7 else rng.choice([*KINDS])
        points, size = rng.normal(size=(KINDS[kind], 3)), float(rng.choice([0.02, 0.05]))
        if rng.uniform() < 0.7:
            marks.append(Mark(name, kind, points, colour(), size))
    bodies = {body: colour() for body in (1, 2) if rng.uniform() < 0.5}
    return Picture(time, marks, [], rng.normal(size=3), bodies)


@pytest.mark.parametrize("kind", PAGES)
def test_bodies_stand_where_the_simulation_has_them(kind: str) -> None:
    page, stage, rng = PAGES[kind](), stage_of("robot", 1.0), np.random.default_rng(3)
    stage.data.qpos[:] = rng.normal(size=stage.model.nq)
    mujoco.mj_kinematics(stage.model, stage.data)
    scene = page.begin(stage)
    scene.draw(picture(rng, 0.0))
    position, rotation = page.place(scene)
    np.testing.assert_allclose(position, stage.data.xpos[1], rtol=1e-6)
    np.testing.assert_allclose(rotation, stage.data.xmat[1].reshape(3, 3), atol=1e-6)


@pytest.mark.parametrize("kind", PAGES)
@pytest.mark.parametrize("seed", by_default(range(5), 0))
def test_a_page_shows_the_last_picture_whatever_it_showed_before(kind: str, seed: int) -> None:
    """After other pictures of the run, and after another run in the same view."""
    rng = np.random.default_rng(seed)
    used, new = PAGES[kind](), PAGES[kind]()
    former = used.begin(stage_of("former", 1.0))
    for k in range(3):
        former.draw(picture(rng, float(k)))
    used.state(former)
    stage = stage_of("robot", 0.3)
    stage.data.qpos[:] = rng.normal(size=stage.model.nq)
    mujoco.mj_kinematics(stage.model, stage.data)
    last, other, alone = picture(rng, 9.0), used.begin(stage), new.begin(stage)
    last.marks += [replace(mark, name=f"still {mark.name}") for mark in last.marks]
    for k in range(4):
        before = picture(rng, float(k))
        before.marks += [replace(mark, size=0.01) for mark in last.marks if mark.name.startswith("still")]
        other.draw(before)
    for scene in (other, alone):
        scene.draw(last)
    one, two = used.state(other), new.state(alone)
    assert one.keys() == two.keys()
    for name, shown in one.items():
        np.testing.assert_equal(shown, two[name], err_msg=str(name))


def test_a_run_that_was_reset_begins_anew_in_rerun() -> None:
    """In the same recording, what the run had shown at later times would still be there."""
    page, stage = RerunPage(), stage_of("robot", 0.3)
    page.begin(stage)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rerun.RecordingStream", page.recording)
        for time, recordings in ((0.0, 1), (1.0, 1), (1.0, 1), (0.5, 2), (0.6, 2)):
            page.view._send(picture(np.random.default_rng(1), time))
            assert len(page.recordings) == recordings
