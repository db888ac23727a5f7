"""A replay shows what was: the same poses, forces and times; films and files for Rerun hold it."""

from __future__ import annotations

import copy
import dataclasses
import importlib.util
import json
import subprocess
import sys
import urllib.request
from collections.abc import Iterator, Sequence
from pathlib import Path
from threading import Thread
from typing import Any

import mujoco
import numpy as np
import pytest
from browser import Browser, needs_chromium
from full_disk import limited_file_size
from properties import by_default
from recorded import make_walk, recorded_scans, recorded_stand, recorded_walk, run

import wbc
from wbc.app import Log, Player, Recorder, Replay, convert_log, render_video
from wbc.app.cli import main
from wbc.app.drift import Drift
from wbc.app.replay.film import RenderError, renderer
from wbc.app.view.marks import Mark, Picture, stiffness_colour
from wbc.app.view.mujoco_view import MujocoMarks
from wbc.app.view.stage import SimulatedStage
from wbc.base.errors import InputError
from wbc.base.files import FileError
from wbc.base.registry import run_code
from wbc.feet import SoftFoot, register_foot
from wbc.feet.soles import catalog
from wbc.sim.terrain.families import base
from wbc.sim.terrain.spec import terrain

SIZE = (96, 72)


@pytest.fixture(scope="module")
def replay() -> Replay:
    return Replay(Log.open(recorded_walk()))


def can_draw() -> bool:
    import mujoco  # noqa: PLC0415

    try:
        renderer(mujoco.MjSpec().compile(), 16, 16).close()
    except RenderError:
        return False
    return True


drawing = pytest.mark.skipif(not can_draw(), reason="no offscreen rendering here")


def named(replay: Replay, tick: int, prefix: str) -> list[Mark]:
    return [mark for mark in replay.picture(tick).marks if mark.name.startswith(prefix)]


# ---- pictures -------------------------------------------------------------------------------------------------------


SAME = ("com", "ZMP planned", "DCM planned")
"""Marks that a live view and a replay take from the same values."""


def test_a_replay_shows_what_the_live_view_showed(tmp_path: Path) -> None:
    plant, walk = make_walk()
    stage, shown = SimulatedStage(plant, walk), dict[int, Picture]()
    seen: list[np.ndarray] = []

    def watch(plant: wbc.Plant, *rest: object) -> None:
        if len(seen) % 20 == 0:
            shown[len(seen)] = stage.picture()
        seen.append(np.concatenate([plant.data.xpos, plant.data.xmat], axis=1))

    with Recorder(tmp_path / "walk.arrow") as record:
        run(plant, walk, 0.8, record, watch)
    replay = Replay(Log.open(tmp_path / "walk.arrow"))
    assert len(replay) == len(seen) and replay.stage.model.nbody == plant.model.nbody
    for tick in shown:
        picture = replay.picture(tick)
        poses = np.concatenate([replay.stage.data.xpos, replay.stage.data.xmat], axis=1)
        np.testing.assert_allclose(poses, seen[tick], atol=2e-6)  # soles as they were bent, too
        assert picture.time == shown[tick].time == replay.log.time[tick]
        assert {*shown[tick].text} <= {*picture.text}  # which has the last event, too
        marks, live = ({mark.name: mark for mark in each.marks} for each in (picture, shown[tick]))
        assert {*SAME} <= marks.keys() <= live.keys() | {f"planned step {i}" for i in range(9)}
        for name in SAME:
            assert marks[name].meaning == live[name].meaning and marks[name].colour == live[name].colour
            np.testing.assert_allclose(marks[name].points, live[name].points, atol=1e-6)
    assert np.ptp([poses[:, :3] for poses in seen], axis=0).max() > 0.05


def test_forces_are_those_of_the_sensors(replay: Replay) -> None:
    log = replay.log
    tick = next(i for i in range(300, 600) if not log["foot/left/contact"][i])
    arrows = sum(mark.points[1] - mark.points[0] for mark in named(replay, tick, "ground force"))
    measured = log["foot/left/wrench_measured/fz"][tick] + log["foot/right/wrench_measured/fz"][tick]
    force = arrows[2] * replay.stage.scale.weight / replay.stage.scale.height
    assert force == pytest.approx(measured, abs=0.02 * measured + 2.0)


def test_pictures_come_at_the_rate_asked_for(replay: Replay) -> None:
    for rate, speed in ((10.0, 1.0), (30.0, 1.0), (10.0, 0.5), (25.0, 4.0)):
        times = replay.log.time[replay.ticks(rate, speed)]
        assert abs(len(times) - replay.log.time[-1] * rate / speed) <= 1.5
        assert np.abs(np.diff(times) - speed / rate).max() <= 0.005 + 1e-9
    for rate, speed in ((0.0, 1.0), (10.0, -1.0)):
        with pytest.raises(InputError):
            replay.ticks(rate, speed)


def test_footsteps_appear_when_feet_have_landed(replay: Replay) -> None:
    log = replay.log
    count = [len(named(replay, tick, "real step")) for tick in range(0, len(log), 10)]
    assert count[0] == 2 and count == sorted(count)
    assert count[-1] == 2 + sum("touch-down" in text for _, text in log.events)
    assert all(len(named(replay, tick, "support")) == 1 for tick in range(0, len(log), 10))
    assert named(replay, 100, "dcm")[0].points[0, :2] == pytest.approx(log["truth/dcm"][100], abs=5e-3)
    text = replay.picture(400).text
    assert any("steps done" in line for line in text) and any("estimate" in line for line in text)


@pytest.mark.slow
def test_soles_and_scans_are_shown_as_they_were() -> None:
    path, steps = recorded_scans()
    replay = Replay(Log.open(path))
    log, drift = replay.log, Drift.of(replay.log)
    for tick in (0, len(log) - 1):
        stiffness = [log[f"foot/{side}/stiffness"][tick] for side in ("left", "right")]
        colours = replay.picture(tick).colours
        assert len(colours) == 20  # the phalanges
        assert {*colours.values()} == {stiffness_colour(value) for value in stiffness}
    landed = [i for i, side in enumerate(log.texts("stiffness/side")) if side is not None]
    known = [(i, step.profile) for i, step in zip(landed, steps, strict=True) if step.profile is not None]
    assert len(known) >= 2
    for k, (tick, profile) in enumerate(known):
        assert [len(named(replay, t, "scan")) for t in (tick - 1, tick)] == [k, k + 1]
        points = named(replay, tick, f"scan {k}")[0].points
        np.testing.assert_allclose(points[:, :2], drift(profile.points, tick)[:, :2], atol=1e-5)


FURNITURE = """<mujoco><worldbody>
<body name="cup" pos=".6 .3 .3"><freejoint/><geom size=".05"/></body>
<body name="door" pos="1 0 1"><joint name="hinge" axis="0 0 1"/><geom type="box" size=".01 .4 .8" pos="0 .4 0"/>
  <body name="flap" pos="0 .4 0"><joint type="slide" axis="0 0 1"/><joint type="ball"/><geom size=".05"/></body></body>
</worldbody></mujoco>"""


def test_furniture_moves_as_it_moved_and_a_run_without_a_walk_has_no_footsteps(tmp_path: Path) -> None:
    """All kinds of joints, with and without names."""
    bodies, seen = ("scene/cup", "scene/door", "scene/flap"), []

    def shown(plant: wbc.Plant) -> wbc.Plant:
        if not seen:
            plant.data.qvel[-11:] = np.linspace(0.5, 1.5, 11)
        mujoco.mj_kinematics(plant.model, plant.data)
        seen.append([plant.data.body(name).xpos.copy() for name in bodies])
        seen[-1] += [plant.data.body(name).xquat.copy() for name in bodies]
        return plant

    log = recorded_stand(tmp_path / "cup.arrow", ticks=40, scene=FURNITURE, shown=shown)
    replay = Replay(log)
    assert not named(replay, 2, "planned") and named(replay, 2, "com")
    for tick in (39, 0, 20):
        replay.picture(tick)
        found = [replay.stage.data.body(name).xpos for name in bodies] + [
            replay.stage.data.body(n).xquat for n in bodies
        ]
        for one, other in zip(found, seen[tick], strict=True):
            np.testing.assert_allclose(one, other, atol=1e-6)
    assert np.linalg.norm(seen[39][0] - seen[0][0]) > 0.05, "it moves"
    np.testing.assert_allclose(log.vector("truth/scene/cup/position", 3)[20], seen[20][0], atol=1e-6)


def test_logs_that_cannot_be_replayed_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        Replay(recorded_stand(tmp_path / "a.arrow", shown=lambda plant: None))
    with pytest.raises(InputError):
        Replay(recorded_stand(tmp_path / "b.arrow", ticks=0))
    other = recorded_stand(tmp_path / "c.arrow")
    foot = {"foot": {"name": "sotf", "parameters": {}}}
    other.header = dict(other.header) | {"plant": other.header["plant"] | foot}
    with pytest.raises(InputError, match="sotf"):
        Replay(other)
    soft = recorded_stand(tmp_path / "d.arrow")
    soft.header = dict(soft.header) | {"plant": Log.open(recorded_walk()).header["plant"]}
    with pytest.raises(InputError, match="joints"):
        Replay(soft)
    with pytest.raises(InputError):
        Replay(Log.open(recorded_walk())).picture(10**6)


# ---- films ----------------------------------------------------------------------------------------------------------


@drawing
def test_marks_are_drawn_where_they_are() -> None:
    """Each kind of mark, in red on white, covers the middle of the picture that its points are around."""
    import mujoco  # noqa: PLC0415

    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1], pos=[0, 0, -1], rgba=[1, 1, 1, 1]
    )
    model = spec.compile()
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    mujoco.mj_forward(model, data)
    camera.distance, camera.elevation, camera.azimuth = 3.0, -90.0, 90.0
    shapes = {
        "ball": [(0, 0, 0)],
        "cloud": [(0, 0, 0), (9, 9, 9)],
        "arrow": [(-0.5, 0, 0), (0.5, 0, 0)],
        "line": [(-0.5, 0, 0), (0.5, 0, 0)],
        "area": [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)],
    }
    with renderer(model, *SIZE) as drawn:
        for kind, points in shapes.items():
            drawn.update_scene(data, camera)
            before = drawn.render().astype(int)
            mark = Mark("m", kind, np.array(points, dtype=float), (1.0, 0.0, 0.0, 1.0), 0.1)  # type: ignore[arg-type]
            MujocoMarks(drawn.scene).add([mark])
            changed = np.abs(drawn.render().astype(int) - before).sum(axis=2) > 60
            assert changed[SIZE[1] // 2, SIZE[0] // 2], kind
            columns = np.flatnonzero(changed.any(axis=0))
            assert columns.mean() == pytest.approx(0.5 * SIZE[0], abs=2.5), kind
            assert not changed[0].any() and changed.sum() < 0.5 * changed.size, kind


def test_a_cloud_that_stays_is_drawn_as_one_that_is_made_anew(replay: Replay) -> None:
    colour, model, data = (1.0, 0.0, 0.0, 1.0), replay.stage.model, replay.stage.data
    cloud, other = (
        Mark("known ground", "cloud", np.array([(x, y, 0.0)]), colour, 0.1)
        for x, y in ((0.5, 0.0), (0.0, 0.5))
    )
    ball = Mark("ball", "ball", np.array([(0.0, -0.5, 0.5)]), colour, 0.1)

    def geoms(scene: mujoco.MjvScene, drawn: MujocoMarks, marks: list[Mark]) -> list[Any]:
        mujoco.mjv_updateScene(
            model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL, scene
        )
        drawn.add(marks)
        return [(g.type, *g.pos, *g.mat.ravel(), *g.size, *g.rgba) for g in scene.geoms[: scene.ngeom]]

    used = mujoco.MjvScene(model, maxgeom=2000)
    kept = MujocoMarks(used)
    for clouds in ([cloud], [cloud], [other], [], [cloud, other], [cloud, other], [cloud]):
        new = mujoco.MjvScene(model, maxgeom=2000)
        marks = [ball, *clouds]
        assert geoms(used, kept, marks) == geoms(new, MujocoMarks(new), marks)


@drawing
def test_a_colour_of_a_body_ends_with_the_picture_that_has_it_and_the_model_stays_as_it_is(
    replay: Replay,
) -> None:
    import mujoco  # noqa: PLC0415 - with the driver that `film` has chosen

    def state() -> bytes:
        content = np.empty(mujoco.mj_sizeModel(replay.stage.model), np.uint8)
        mujoco.mj_saveModel(replay.stage.model, None, content)
        return content.tobytes() + replay.stage.data.light_xpos.tobytes()

    camera, picture, own = mujoco.MjvCamera(), replay.picture(0), state()
    camera.distance, camera.elevation = 3.0, -20.0
    seen = []
    with renderer(replay.stage.model, *SIZE) as drawn:
        for bodies in ((), range(replay.stage.model.nbody), ()):
            picture.colours = dict.fromkeys(bodies, (1.0, 0.0, 0.0, 1.0))
            seen.append(drawn.draw(replay.stage, picture, camera).astype(int))
    red, again = ((np.abs(each - seen[0]).max(axis=2) > 60).mean() for each in seen[1:])
    assert red > 0.01 and again < 0.001, "shares of the picture that look otherwise"
    assert state() == own


@drawing
def test_a_film_moves_and_shows_the_robot(replay: Replay, tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    path = tmp_path / "walk.mp4"
    count = render_video(replay, path, rate=1.0, size=SIZE)
    words = [ffmpeg, "-loglevel", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run(words, capture_output=True, check=True).stdout
    pictures = np.frombuffer(raw, np.uint8).reshape(-1, SIZE[1], SIZE[0], 3).astype(int)
    assert len(pictures) == count
    for picture, later in zip(pictures, pictures[1:], strict=False):
        assert np.ptp(picture) > 100  # neither black nor white
        assert np.abs(picture - later).mean() > 0.5


@pytest.mark.slow
@drawing
def test_a_film_on_a_full_disk_leaves_the_old_one(replay: Replay, tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / "walk.mp4"
    path.write_text("old")
    with limited_file_size(1000), pytest.raises((FileError, RenderError)):
        render_video(replay, path, rate=2.0, size=SIZE)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


# ---- files for Rerun ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", by_default(["rrd", "mcap"], "rrd"))
def test_the_progress_of_a_conversion_has_its_pictures_and_an_error_leaves_the_old_file(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip({"rrd": "rerun", "mcap": "foxglove"}[kind])
    log, path, told = recorded_stand(tmp_path / "a.arrow", ticks=12), tmp_path / f"a.{kind}", []
    pictures = len({*Replay(log).ticks(30.0)})

    def progress(steps: Sequence[Any]) -> Iterator[Any]:
        for k, step in enumerate(steps):
            told.append((k, len(steps)))
            yield step

    assert convert_log(log, path, rate=30.0, progress=progress) is None
    groups = {name.rpartition("/")[0] or name for name in log if name != "time"}
    assert told == [(k, len(groups) + pictures) for k in range(len(groups) + pictures)]
    old = path.read_bytes()
    monkeypatch.setattr(Replay, "picture", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        convert_log(log, path)
    assert path.read_bytes() == old and len([*tmp_path.iterdir()]) == 2


@pytest.mark.slow
def test_rerun_opens_an_rrd(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    half, whole = tmp_path / "walk.arrow", recorded_walk().read_bytes()
    half.write_bytes(whole[: len(whole) // 2])
    path = tmp_path / "walk.rrd"
    assert convert_log(Log.open(half), path, rate=5.0) is None

    def rerun(word: str) -> str:
        words = [sys.executable, "-m", "rerun", "rrd", word, str(path)]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        return done.stdout + done.stderr

    assert "1 file verified without error" in rerun("verify")
    listed = rerun("print")
    for part in ("/com/estimated", "/robot/head", "/ground", "/marks/real_step_0", "/marks/zmp"):
        assert part in listed


@pytest.mark.slow
def test_foxglove_reads_what_the_log_has(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    reader = pytest.importorskip("mcap.reader")
    log, path = Log.open(recorded_walk()), tmp_path / "walk.mcap"
    assert convert_log(log, path, rate=1.0) is None
    with path.open("rb") as file:
        messages = list(reader.make_reader(file).iter_messages())
    topics = {channel.topic: schema for schema, channel, _ in messages}
    names = {topic: topics[topic].name for topic in ("/robot", "/marks", "/tf", "/texts")}
    scene = "foxglove.SceneUpdate"
    assert names == {
        "/robot": scene,
        "/marks": scene,
        "/tf": "foxglove.FrameTransforms",
        "/texts": "foxglove.Log",
    }
    com = [message for _, channel, message in messages if channel.topic == "/com/estimated"]
    assert json.loads(topics["/com/estimated"].data)["properties"]["x"]["description"].startswith("m: ")
    assert [message.log_time for message in com] == [round(1e9 * time) for time in log.time]
    read = np.array([[json.loads(message.data)[axis] for axis in "xyz"] for message in com])
    np.testing.assert_array_equal(read, log.vector("com/estimated", 3))
    moved = sum(channel.topic == "/tf" for _, channel, _ in messages)
    assert (
        moved == len(Replay(log).ticks(1.0)) == sum(channel.topic == "/marks" for _, channel, _ in messages)
    )


# ---- the command ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_command_writes_films_and_files_for_rerun(
    replay: Replay, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if can_draw() and importlib.util.find_spec("imageio_ffmpeg"):
        film = tmp_path / "walk.mp4"
        words = ["view", str(replay.log.path), "-o", str(film), "--rate", "1", "--size", "96", "72", "--json"]
        assert main(words) == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["file"] == str(film) and facts["pictures"] == len(replay.ticks(1.0))
    pytest.importorskip("rerun")
    log, out = tmp_path / "stand.arrow", tmp_path / "stand.rrd"
    recorded_stand(log, shown=lambda plant: None)
    assert main(["view", str(log), "-o", str(out), "--json"]) == 0
    assert "plant" in json.loads(capsys.readouterr().out)["without_scene"] and out.stat().st_size > 1000


def test_a_page_of_a_replay_answers_and_shows_any_tick(replay: Replay) -> None:
    pytest.importorskip("viser")
    player = Player(replay, port=0)
    try:
        assert player.url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(player.url) as answer:
            assert answer.status == 200
        player.show(300)
        slider = player._time
        assert slider.min <= replay.log.time[0] and slider.max >= replay.log.time[-1], (
            "every tick can be chosen"
        )
    finally:
        player.close()


@pytest.mark.slow
@needs_chromium
def test_a_replay_plays_in_a_browser(replay: Replay, tmp_path: Path) -> None:
    pytest.importorskip("viser")
    player = Player(replay, port=0)
    Thread(target=player.run, daemon=True).start()
    with Browser(tmp_path / "profile") as browser:
        browser.open(player.url)
        browser.wait('document.body.innerText.includes("steps done")')
        browser.wait('document.body.innerText.includes("touch-down")')
        assert not browser.errors
    player.close()


# ---- grounds and feet of one's own ---------------------------------------------------------------------------------

OWN = '''
import numpy as np

from wbc.sim import FieldFamily, ShapeFamily, dome, family, param
from wbc.core.frames import yaw_rotation
from wbc.sim.terrain.shapes import Box, Pyramid


@family("own solids")
class Solids(ShapeFamily):
    """One solid of each kind."""

    smallest_feature = 0.05

    def shapes(self, site):
        h, (x, y) = site.amplitude, (site.x0 + 0.6, 0.0)
        yield dome(x, y, 0.1, h)
        yield Box(np.array([x + 0.4, y, 0.2 * h]), np.array([0.05, 0.08, 0.3 * h]), yaw_rotation(0.3))
        yield Pyramid(np.array([x + 1.8, y, 0.9 * h]), 0.0, 0.1, 0.2)


@family("own heights")
class Heights(FieldFamily):
    """Waves both ways."""

    smallest_feature = 0.2

    def heights(self, site, x, y):
        return np.sin(8.0 * x) * np.cos(7.0 * y)
'''


@pytest.mark.parametrize("ground", ["own solids", "own heights"])
def test_a_log_holds_a_ground_of_ones_own(
    ground: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its family, which must be known where it is replayed."""
    monkeypatch.setattr(base, "_FAMILIES", copy.copy(base._FAMILIES))
    file = tmp_path / "own.py"
    file.write_text(OWN)
    run_code([file])
    real = terrain(ground, amplitude=0.03, seed=2)
    log = recorded_stand(tmp_path / "own.arrow", terrain=real)
    shown = Replay(log).plant
    assert shown is not None and shown.terrain.name == ground
    x, y = np.random.default_rng(1).uniform((-1.0, -0.6), (4.0, 0.6), (2000, 2)).T
    np.testing.assert_allclose(shown.terrain.height(x, y), real.height(x, y), atol=1e-6)
    assert np.ptp(shown.terrain.height(x, y)) > 0.02
    del base._FAMILIES[ground]
    with pytest.raises(InputError, match=f"ground '{ground}' is not known here.*--code"):
        Replay(log)


def test_a_file_that_is_named_registers_the_feet_of_a_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(catalog, "_FEET", copy.copy(catalog._FEET))
    file, log, out = tmp_path / "own.py", tmp_path / "own.arrow", tmp_path / "own.rrd"
    file.write_text("from wbc.feet import SoftFoot, register_foot\nregister_foot('own', SoftFoot)\n")
    pytest.importorskip("rerun")
    own = dataclasses.make_dataclass("Own", [], bases=(SoftFoot,), frozen=True)
    register_foot("own", own)
    recorded_stand(log, foot=own())
    del catalog._FEET["own"]
    assert main(["view", str(log), "-o", str(out), "--json"]) == 0
    assert "'own'" in json.loads(capsys.readouterr().out)["without_scene"]
    assert main(["view", str(log), "-o", str(out), "--json", "--code", str(file)]) == 0
    assert not json.loads(capsys.readouterr().out)["without_scene"]
