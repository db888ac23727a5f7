"""A replay shows what was: the same poses, forces and times; pages need nothing, films need what they say."""

from __future__ import annotations

import base64
import importlib
import json
import re
import shutil
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import umsgpack
from browser import Browser, needs_chromium
from full_disk import limited_file_size
from pages import get
from PIL import Image
from recorded import make_walk, recorded_scans, recorded_stand, recorded_walk, run

import wbc
from wbc.app.address import Address, PortError
from wbc.app.cli import main
from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.app.log.stances import Drift
from wbc.app.replay.film import RenderError, _drawing_context, check_film, find_ffmpeg, render_video
from wbc.app.replay.mujoco_scene import MujocoScene
from wbc.app.replay.page import replay_page
from wbc.app.replay.replay import Replay
from wbc.app.scene.colours import stiffness_colour
from wbc.app.scene.shapes import Surface
from wbc.app.scene.sources import PlantSource
from wbc.app.view.guard import PageServer
from wbc.core.errors import InputError
from wbc.core.files import FileError

SIZE = (96, 72)


@pytest.fixture(scope="module")
def replay() -> Replay:
    return Replay(Log.open(recorded_walk()))


@pytest.fixture(scope="module")
def page(replay: Replay) -> str:
    return replay_page(replay, rate=10.0)


def mujoco_scene(replay: Replay) -> MujocoScene:
    return MujocoScene(replay.scene, replay.plant.terrain, *SIZE, replay.sole_paths)


def can_draw() -> bool:
    try:
        with _drawing_context(16, 16):
            return True
    except RenderError:
        return False


def ffmpeg_or_skip() -> str:
    try:
        return find_ffmpeg()
    except RenderError:
        return pytest.skip("no ffmpeg here")


drawing = pytest.mark.skipif(not can_draw(), reason="no offscreen rendering here")


def test_replay_shows_what_the_live_view_showed(tmp_path: Path) -> None:
    plant, walk = make_walk()
    source = PlantSource(plant)
    seen: list[np.ndarray] = []
    coms: list[np.ndarray] = []

    def watch(plant: wbc.Plant, *rest: object) -> None:
        snapshot = source.snapshot()
        seen.append(snapshot.poses)
        coms.append(np.array(snapshot.com))

    with Recorder(tmp_path / "walk.arrow") as record:
        run(plant, walk, 1.3, record, watch)
    replay = Replay(Log.open(tmp_path / "walk.arrow"))
    assert replay.scene.bodies == source.scene.bodies and len(replay) == len(seen)
    for tick in range(0, len(seen), 20):
        snapshot = replay.snapshot(tick)
        np.testing.assert_allclose(snapshot.poses, seen[tick], atol=2e-6)  # soles as they were bent, too
        np.testing.assert_allclose(snapshot.com, coms[tick], atol=1e-6)
        assert snapshot.time == replay.log.time[tick]
    assert np.ptp([poses[:, :3, 3] for poses in seen], axis=0).max() > 0.05


def test_forces_are_those_of_the_sensors(replay: Replay) -> None:
    log = replay.log
    tick = next(i for i in range(300, 600) if not log["foot/left/contact"][i])
    kinds = [kind for kind, _, _ in replay.snapshot(tick).forces]
    total = sum(force for _, _, force in replay.snapshot(tick).forces)
    assert kinds and set(kinds) == {"ground"}
    measured = log["foot/left/wrench_measured/fz"][tick] + log["foot/right/wrench_measured/fz"][tick]
    assert total[2] == pytest.approx(measured, abs=0.02 * measured + 2.0)


def test_push_is_shown_while_it_lasts(tmp_path: Path) -> None:
    plant, walk = make_walk()
    plant.push("torso", (0.0, 30.0, 0.0), 0.05)
    with Recorder(tmp_path / "walk.arrow") as record:
        run(plant, walk, 0.2, record)
    replay = Replay(Log.open(tmp_path / "walk.arrow"))
    pushed = [[f for kind, _, f in replay.snapshot(i).forces if kind == "push"] for i in range(len(replay))]
    assert [len(p) for p in pushed] == [0] + [1] * 10 + [0] * 29
    assert pushed[3][0].tolist() == [0.0, 30.0, 0.0]


def test_pictures_come_at_the_rate_asked_for(replay: Replay) -> None:
    for rate, speed in ((10.0, 1.0), (30.0, 1.0), (10.0, 0.5), (25.0, 4.0)):
        times = replay.log.time[replay.ticks(rate, speed)]
        assert abs(len(times) - replay.log.time[-1] * rate / speed) <= 1.5
        assert np.abs(np.diff(times) - speed / rate).max() <= 0.005 + 1e-9
    for rate, speed in ((0.0, 1.0), (10.0, -1.0)):
        with pytest.raises(InputError, match="above|must lie"):
            replay.ticks(rate, speed)


def commands(page: str) -> list[dict[str, Any]]:
    found = re.search(r"for \(const text of (\[.*?\])\)", page)
    assert found
    return [umsgpack.unpackb(base64.b64decode(text)) for text in json.loads(found.group(1))]


def constant(page: str, name: str) -> Any:
    found = re.search(rf"^const {name} = (.*);$", page, re.MULTILINE)
    assert found, name
    return json.loads(found.group(1))


def test_page_holds_robot_terrain_labels_and_every_frame(replay: Replay, page: str) -> None:
    paths = [command["path"] for command in commands(page) if command["type"] == "set_object"]
    for part in ("/wbc/robot/", "/wbc/ground/", "/wbc/footsteps/", "/wbc/support/", "/wbc/markers/dcm"):
        assert any(path.startswith(part) for path in paths), part
    ticks = replay.ticks(10.0)
    assert constant(page, "times") == [round(t, 4) for t in replay.log.time[ticks].tolist()]
    captions = constant(page, "captions")
    assert any("single support, left foot swings" in text for text in captions)
    assert any("touch-down" in text for text in captions) and "Nm/rad" in captions[0]
    assert "a short walk" in page and "centre of mass" in page and "DCM" in page
    found = re.search(r'atob\("([^"]+)"\)', page)
    assert found
    frames = np.frombuffer(base64.b64decode(found.group(1)), "<f4").reshape(len(ticks), -1, 4, 3)
    assert constant(page, "paths") == list(replay.scene.moving) and frames.shape[1] == len(
        replay.scene.moving
    )
    for i in (0, 7, len(ticks) - 1):
        expected = replay.frame(ticks[i])[:, :3, :].transpose(0, 2, 1)
        np.testing.assert_allclose(frames[i], expected, rtol=1e-6, atol=1e-6)


def test_page_needs_no_network(page: str) -> None:
    tags = re.findall(r"<(?:script|link|img|iframe)[^>]*>", page)
    assert tags and not [tag for tag in tags if re.search(r"(src|href)=(?!\"data:)", tag)]
    ours = page[page.rindex("const paths") :]
    assert "http:" not in ours and "https:" not in ours and "WebSocket" not in ours


def test_footsteps_appear_when_feet_have_landed(replay: Replay) -> None:
    log, moving = replay.log, replay.overlays.moving
    landed = [i for i, path in enumerate(moving) if path.startswith("/wbc/footsteps/")]
    count = []
    for tick in range(0, len(log), 10):
        there = replay.overlays.frame(tick)[landed]
        count.append(int((there[:, 0, 0] == 1.0).sum()))
    assert count[0] == 2 and count == sorted(count)
    assert count[-1] == len(landed) == 2 + sum("touch-down" in text for _, text in log.events)
    supports = [i for i, path in enumerate(moving) if path.startswith("/wbc/support/")]
    for tick in range(0, len(log), 10):  # one region at a time
        assert (replay.overlays.frame(tick)[supports, 0, 0] == 1.0).sum() == 1
    assert replay.overlays.frame(100)[-1, :2, 3] == pytest.approx(log["truth/dcm"][100], abs=5e-3)


def test_soles_and_scans_are_shown_as_they_were() -> None:
    path, steps = recorded_scans()
    replay = Replay(Log.open(path))
    log = replay.log
    assert [len(paths) for paths in replay.sole_paths] == [10, 10]
    for paths, side in zip(replay.sole_paths, ("left", "right"), strict=True):
        assert all(f"foot_{side}_" in path for path in paths)
    for tick in (0, len(log) - 1):
        stiffness = [log[f"foot/{side}/stiffness"][tick] for side in ("left", "right")]
        assert replay.sole_colours(tick) == [stiffness_colour(value) for value in stiffness]
    assert replay.sole_colours(0) != replay.sole_colours(len(log) - 1)
    landed = [i for i, side in enumerate(log.texts("stiffness/side")) if side is not None]
    scans = [i for i, path in enumerate(replay.overlays.moving) if path.startswith("/wbc/scans/")]
    known = [i for i, step in zip(landed, steps, strict=True) if step.profile is not None]
    assert len(scans) == len(known) >= 2
    for k, tick in enumerate(known):
        there = [replay.overlays.frame(t)[scans, 0, 0] == 1.0 for t in (tick - 1, tick)]
        assert [int(each.sum()) for each in there] == [k, k + 1]
    drawn = {drawing.path: drawing.shape for drawing in replay.scene.objects}
    profiles = [step.profile for step in steps if step.profile is not None]
    drift = Drift(log)
    for k, (profile, tick) in enumerate(zip(profiles, known, strict=True)):
        shape = drawn[f"/wbc/scans/{k}/shape"]
        assert isinstance(shape, Surface)
        half = len(shape.vertices) // 2
        middle = 0.5 * (shape.vertices[:half] + shape.vertices[half:])
        np.testing.assert_allclose(middle[:, :2], drift(profile.points, tick)[:, :2], atol=1e-5)
    page = replay_page(replay, rate=2.0)
    assert constant(page, "soles") == [list(paths) for paths in replay.sole_paths]
    stage = mujoco_scene(replay)
    stage.set(replay.frame(0), replay.sole_colours(0))
    rgba = stage.model.geom_rgba[stage.model.geom_bodyid == stage.model.body(replay.sole_paths[1][0]).id]
    assert len(rgba) and np.allclose(rgba, replay.sole_colours(0)[1])


def test_stage_puts_everything_where_the_replay_has_it(replay: Replay) -> None:
    stage = mujoco_scene(replay)
    frame = replay.frame(250)
    stage.set(frame)
    for path in stage.shown:
        matrix = frame[replay.scene.moving.index(path)]
        body = stage.model.body(path).id
        if np.linalg.norm(matrix[:3, 0]) < 0.5:
            assert stage.data.xpos[body][2] < -10.0
            continue
        np.testing.assert_allclose(stage.data.xpos[body], matrix[:3, 3], atol=1e-9)
        np.testing.assert_allclose(stage.data.xmat[body].reshape(3, 3), matrix[:3, :3], atol=1e-6)
    assert stage.model.ngeom > 50


@drawing
def test_film_moves_and_shows_the_robot(replay: Replay, tmp_path: Path) -> None:
    path = tmp_path / "walk.gif"
    done: list[tuple[int, int]] = []
    count = render_video(replay, path, rate=1.0, size=SIZE, progress=lambda *at: done.append(at))
    assert done == [(i + 1, count) for i in range(count)]
    with Image.open(path) as film:
        assert (film.format, film.n_frames, film.size) == ("GIF", count, SIZE)
        pictures = []
        for i in range(count):
            film.seek(i)
            pictures.append(np.asarray(film.convert("RGB"), dtype=int))
    for picture, later in zip(pictures, pictures[1:], strict=False):
        assert np.ptp(picture) > 100  # neither black nor white
        assert np.abs(picture - later).mean() > 0.5


@drawing
def test_film_as_mp4(replay: Replay, tmp_path: Path) -> None:
    ffmpeg = ffmpeg_or_skip()
    path = tmp_path / "walk.mp4"
    count = render_video(replay, path, rate=2.0, size=SIZE)
    raw = subprocess.run(
        [ffmpeg, "-loglevel", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True,
        check=True,
    ).stdout
    pictures = np.frombuffer(raw, np.uint8).reshape(-1, SIZE[1], SIZE[0], 3)
    assert len(pictures) == count and np.ptp(pictures[0].astype(int)) > 100


@drawing
@pytest.mark.parametrize("ending", ["gif", "mp4"])
def test_a_film_on_a_full_disk_leaves_the_old_one(replay: Replay, tmp_path: Path, ending: str) -> None:
    if ending == "mp4":
        ffmpeg_or_skip()
    path = tmp_path / f"walk.{ending}"
    path.write_text("old")
    with limited_file_size(1000), pytest.raises((FileError, RenderError), match="write"):
        render_video(replay, path, rate=2.0, size=SIZE)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_film_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(RenderError, match=r"MP4 needs ffmpeg: install it.*GIF needs none"):
        check_film(tmp_path / "walk.mp4")
    real = importlib.import_module

    def without_egl(name: str) -> Any:
        if name.startswith("mujoco."):
            raise AttributeError("'NoneType' object has no attribute 'eglQueryDevicesEXT'")
        return real(name)

    monkeypatch.setattr(importlib, "import_module", without_egl)
    with pytest.raises(RenderError, match=r"MUJOCO_GL=.*install EGL .*libegl1.*OSMesa"):
        check_film(tmp_path / "walk.gif")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("size", "words"), [((95, 72), "two even numbers"), ((0, 0), "at least 16"), ((8, 8), "at least 16")]
)
@drawing
def test_film_sizes_are_checked(replay: Replay, tmp_path: Path, size: tuple[int, int], words: str) -> None:
    with pytest.raises(InputError, match=words):
        render_video(replay, tmp_path / "walk.gif", size=size)


def test_logs_that_cannot_be_replayed_say_why(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="recorded without a plant"):
        Replay(recorded_stand(tmp_path / "a.arrow", shown=lambda plant: None))
    empty = recorded_stand(tmp_path / "b.arrow")
    empty._table = empty._table.slice(0, 0)
    with pytest.raises(InputError, match="no ticks"):
        Replay(empty)
    other = recorded_stand(tmp_path / "c.arrow")
    header = dict(other.header)
    header["plant"] = header["plant"] | {"foot": {"$class": "nowhere.at.all:Foot"}}
    other.header = header
    with pytest.raises(InputError, match="import nowhere.at.all first"):
        Replay(other)
    soft = recorded_stand(tmp_path / "d.arrow")
    soft.header = dict(soft.header) | {"plant": Log.open(recorded_walk()).header["plant"]}
    with pytest.raises(InputError, match="other joints"):
        Replay(soft)


def test_run_without_a_walk_is_replayed_without_overlays(tmp_path: Path) -> None:
    replay = Replay(recorded_stand(tmp_path / "stand.arrow"))
    assert replay.overlays.moving == [] and replay.frame(0).shape == (len(replay.scene.moving), 4, 4)
    assert "const captions" in replay_page(replay)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["talos", "g1"])
@drawing
def test_robots_made_of_meshes_can_be_filmed(tmp_path: Path, robot: str) -> None:
    replay = Replay(recorded_stand(tmp_path / "stand.arrow", robot, ticks=30))
    render_video(replay, tmp_path / "stand.gif", rate=10.0, size=SIZE)
    stage = mujoco_scene(replay)
    assert stage.model.nmesh >= 30


def test_command_writes_a_page_and_a_film(
    replay: Replay, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(replay.log.path)
    html = tmp_path / "walk.html"
    assert main(["view", log, "-o", str(html), "--rate", "5", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["file"] == str(html) and facts["pictures"] == len(replay.ticks(5.0))
    assert '<input id="slider"' in html.read_text(encoding="utf-8")
    if can_draw():
        film = ["-o", str(tmp_path / "walk.gif"), "--rate", "1", "--size", "96", "72"]
        assert main(["view", log, *film]) == 0
        assert (tmp_path / "walk.gif").stat().st_size > 1000


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["none.arrow"], "cannot read the log none.arrow"),
        (["{log}", "-o", "walk.avi"], "must end in one of .html, .mp4, .gif"),
        (["{log}", "-o", "/none/walk.html"], "no folder /none"),
        (["{log}", "-o", "/proc/walk.gif"], "cannot write /proc/walk.gif"),
        (["{log}", "--rate", "0"], "rate (pictures a second)"),
        (["{log}", "--port", "{port}"], "choose another port"),
    ],
)
def test_command_names_what_is_wrong(
    words: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = PageServer("replay", Address(port=0))
    try:
        port = str(taken.served.port)
        filled = [w.replace("{log}", str(recorded_walk())).replace("{port}", port) for w in words]
        assert main(["view", *filled]) == 2
    finally:
        taken.close()
    assert expected in capsys.readouterr().err


def test_scripts_of_a_served_page_carry_its_nonce(replay: Replay) -> None:
    served = replay_page(replay, rate=2.0, nonce="abc")
    assert re.findall(r"<script\b([^>]*)>", served) == [' nonce="abc"'] * 3
    assert not re.search(r"<[^>]+\son[a-z]+=", re.sub(r"<script.*?</script>", "", served, flags=re.S))


def test_page_is_served_to_this_machine_alone(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    server = PageServer("replay", Address(port=0))
    url, port = server.served.url, server.served.port
    assert url.startswith("http://127.0.0.1:")
    with pytest.raises(PortError, match="choose another port"):
        PageServer("replay", Address(port=port))
    thread = threading.Thread(target=server.serve_page, args=(page, "abc", 1.5))
    thread.start()
    try:
        for _ in range(50):
            try:
                with urllib.request.urlopen(url, timeout=2.0) as answer:
                    got = answer.read().decode()
                break
            except OSError:
                time.sleep(0.05)
        assert got == page
        evil = {"Host": f"evil.example:{port}", "Origin": f"http://evil.example:{port}"}
        assert get(url, **evil).status == 403
        rules = get(url).headers["Content-Security-Policy"]
        assert "script-src 'nonce-abc';" in rules and "frame-ancestors 'none'" in rules
    finally:
        thread.join()
    assert url in capsys.readouterr().err


@pytest.mark.slow
@needs_chromium
def test_exported_page_works_in_a_browser_without_network(replay: Replay, page: str, tmp_path: Path) -> None:
    html = tmp_path / "walk.html"
    html.write_text(page, encoding="utf-8")
    last = len(replay.ticks(10.0)) - 1
    base = next(i for i, path in enumerate(replay.scene.moving) if path.startswith("/wbc/robot/"))
    path = replay.scene.moving[base].strip("/").split("/")
    position = f"viewer.scene_tree.find({json.dumps(path)}).object.position.toArray()"
    meshes = (
        "(() => { const count = {}; for (const part of ['robot', 'ground', 'footsteps', 'markers']) {"
        " let n = 0; viewer.scene_tree.find(['wbc', part]).object.traverse((o) => { n += o.isMesh ? 1 : 0; });"
        " count[part] = n; } return count; })()"
    )
    with Browser(tmp_path / "profile") as browser:
        browser.call(
            "Network.emulateNetworkConditions",
            offline=True,
            latency=0,
            downloadThroughput=0,
            uploadThroughput=0,
        )
        browser.open(html.as_uri())
        browser.wait("typeof shown !== 'undefined' && shown >= 0")
        counts = browser.evaluate(meshes)
        first = browser.evaluate(f"play(false); show(0); {position}")
        browser.evaluate(f"slider.value = {last}; slider.oninput(); 0")
        second = browser.evaluate(position)
        text = browser.evaluate("document.getElementById('facts').innerText")
        shot = tmp_path / "shot.png"
        shot.write_bytes(browser.screenshot())
        assert not browser.errors
        assert [address for address in browser.requests if not address.startswith(("file:", "data:"))] == []
    drawn = [d.path for d in replay.scene.objects]
    assert counts["robot"] >= sum(path.startswith("/wbc/robot/") for path in drawn) > 40
    assert counts["ground"] >= 1 and counts["footsteps"] >= 4 and counts["markers"] == 4
    ticks = replay.ticks(10.0)
    for got, tick in ((first, 0), (second, ticks[-1])):
        assert got == pytest.approx(replay.frame(tick)[base][:3, 3].tolist(), abs=1e-5)
    assert "a short walk" in text and "steps done" in text and f"{replay.log.time[ticks[-1]]:.2f} s" in text
    with Image.open(shot) as image:
        colours = np.unique(np.asarray(image.convert("RGB")).reshape(-1, 3), axis=0)
        assert len(colours) > 1000
