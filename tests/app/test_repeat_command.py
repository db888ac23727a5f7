"""`wbc walk --record` and `--repeat`, with a walk that is made up: what is recorded, compared and told."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from log_writing import made_log

from wbc.app.cli import FAILED, RAN, main
from wbc.app.commands import walk as walk_command
from wbc.app.log import writer
from wbc.app.log.recorder import Recorder
from wbc.app.log.signals import Signals
from wbc.app.log.sources import _add_stiffness
from wbc.app.log.writer import LogWriter
from wbc.app.repeat import RepeatWalk
from wbc.app.replay import film
from wbc.app.view import meshcat_view
from wbc.base import drawing
from wbc.base.errors import InputError
from wbc.base.files import FileError
from wbc.sim import WalkSpec

Said = pytest.CaptureFixture[str]
TIME = 0.005 * np.arange(20)


class Recorded:
    """A recorder whose log has the numbers of `values`, and which may lose something."""

    values, lost = TIME, None
    added: list[str] = []  # noqa: RUF012

    def __init__(self, path: Path, spec: Any) -> None:
        self.path, self.spec, self.loss = path, spec, type(self).lost

    def add(self, name: str, value: Any, about: str) -> None:
        type(self).added.append(name)
        self.news = value

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        pass


class Walked:
    """A walk that is over at once."""

    hooks: list[Any] = []  # noqa: RUF012
    given: list[Any] = []  # noqa: RUF012

    def __init__(self, spec: Any, **_: Any) -> None:
        self.spec, self.last = spec, None

    def run(self, hooks: list[Any]) -> Any:
        type(self).given.append(hooks)
        for hook in hooks:
            if isinstance(hook, Recorded):
                assert hook.news(None) == ""
                self.last = 0.5
                assert json.loads(hook.news(None)) == [{"time": 0.5, "what": "end"}]
                self.last = None
                made_log(hook.path, {"time": TIME, "a": hook.values})
        return SimpleNamespace(to_json=lambda: {"outcome": "completed"})

    def stop(self) -> None:
        pass


@pytest.fixture
def walks(monkeypatch: pytest.MonkeyPatch) -> type[Recorded]:
    monkeypatch.setattr(walk_command, "WalkTrial", Walked)
    monkeypatch.setattr(walk_command, "Recorder", Recorded)
    monkeypatch.setattr(walk_command, "walk_text", lambda *_: "walked")
    for name, value in (("values", TIME), ("lost", None)):
        monkeypatch.setattr(Recorded, name, value)
    Walked.given.clear()
    return Recorded


def test_a_repeated_walk_is_compared_with_its_log(
    walks: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    log = tmp_path / "log.arrow"
    spec = WalkSpec().to_json()
    made_log(log, {"time": TIME, "a": TIME}, spec=spec, versions={"libraries": {}})
    assert main(["walk", "--repeat", str(log)]) == RAN
    assert capsys.readouterr().out.splitlines()[-1].split() == [
        "repeated",
        "bit",
        "for",
        "bit",
        "the",
        "same",
    ]
    ((recorder, repeat),) = Walked.given
    assert isinstance(recorder, Recorded) and isinstance(repeat, RepeatWalk)
    assert not recorder.path.exists(), "a file of its own, which is gone"
    monkeypatch.setattr(Recorded, "values", np.where(TIME > 0.03, 9.0, TIME))
    monkeypatch.setattr(walk_command, "differences", lambda versions: ["numpy 1"])
    assert main(["walk", "--repeat", str(log), "--record", str(tmp_path / "again.arrow")]) == FAILED
    line = capsys.readouterr().out.splitlines()[-1]
    assert "NOT THE SAME: from 0.035 s on, first in a" in line and line.endswith("; the log is of numpy 1")
    assert (tmp_path / "again.arrow").exists()
    monkeypatch.setattr(walk_command, "differences", lambda versions: [])
    assert main(["walk", "--repeat", str(log), "--json"]) == FAILED
    facts = json.loads(capsys.readouterr().out)
    assert facts["same"] is False and facts["versions"] == [] and "record" not in facts
    assert main(["walk", "--repeat", str(log)]) == FAILED
    assert "; the log is of" not in capsys.readouterr().out


def test_a_walk_is_recorded_and_what_is_lost_is_told(
    walks: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    words = ["walk", "--distance", "0.1"]
    assert main(words) == RAN
    assert Walked.given == [[]], "nothing is recorded that is not asked for"
    assert "repeated" not in capsys.readouterr().out
    assert main([*words, "--record", str(tmp_path / "a.arrow"), "--json"]) == RAN
    facts = json.loads(capsys.readouterr().out)
    assert (
        facts["record"] == str(tmp_path / "a.arrow")
        and facts["record_failure"] is None
        and "same" not in facts
    )
    assert Recorded.added[-1] == "view/change"
    monkeypatch.setattr(Recorded, "lost", FileError("full"))
    assert main([*words, "--record", str(tmp_path / "b.arrow"), "--json"]) == FAILED
    said = capsys.readouterr()
    assert json.loads(said.out)["record_failure"] == "full" and "full" in said.err
    made_log(tmp_path / "log.arrow", {"time": TIME, "a": TIME}, spec=WalkSpec().to_json())
    assert main(["walk", "--repeat", str(tmp_path / "log.arrow"), "--json"]) == FAILED
    assert "same" not in json.loads(capsys.readouterr().out), "what is lost cannot be compared"


def test_a_recorder_keeps_its_own_spec_and_takes_that_of_a_trial(tmp_path: Path) -> None:
    trial: Any = SimpleNamespace(spec=SimpleNamespace(seed=7, to_json=lambda: {"seed": 7}))
    for given in (None, {"own": 1}):
        with Recorder(tmp_path / "a.arrow", spec=given) as recorder:
            recorder.start(trial)
            assert recorder._spec == (given or {"seed": 7})


def test_a_log_that_cannot_be_begun_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for error, said in ((OSError(5, "Input/output error"), "Input/output error"), (OSError("boom"), "boom")):

        def fail(*_: Any, error: OSError = error, **__: Any) -> int:
            raise error

        monkeypatch.setattr(writer.tempfile, "mkstemp", fail)
        with pytest.raises(InputError, match=said):
            LogWriter(tmp_path / "a.arrow")


def test_each_step_of_a_scheduler_is_logged_once_when_it_has_landed() -> None:
    """Not the one that was done before the recording; each later one in its own tick."""

    def step(side: str) -> Any:
        values = {
            "commanded": 10.0,
            "actual": 11.0,
            "requested": 12.0,
            "decided_before": 0.1,
            "computing": 0.0,
        }
        return SimpleNamespace(side=side, fallback=None, profile=None, decision=None, **values)

    for before in ([], [step("left"), step("left")]):
        task: Any = SimpleNamespace(steps=list(before))
        signals = Signals()
        _add_stiffness(signals, task)
        row = np.zeros(signals.width)
        told = []
        for new in (None, "right", None, "left", None):
            if new is not None:
                task.steps = [*task.steps, step(new)]
            texts = signals.read(SimpleNamespace(), row)  # type: ignore[arg-type]
            told.append((texts[0], None if np.isnan(row[0]) else row[:3].tolist()))
        values = [10.0, 11.0, 12.0]
        assert told == [(None, None), ("right", values), (None, None), ("left", values), (None, None)]


# ---- what the machine does not have ---------------------------------------------------------------------------------


def test_a_renderer_that_mujoco_could_not_make_is_not_asked_for_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A second attempt aborts the process, in libc++, where there is neither EGL nor a display."""
    import mujoco  # noqa: PLC0415 - with the driver that `film` has chosen

    asked: list[str] = []

    def fail(*_: Any) -> None:
        asked.append("once")
        raise mujoco.FatalError("no OpenGL")

    monkeypatch.setattr(drawing, "_refusals", [])
    monkeypatch.setattr(film, "Renderer", fail)
    for _ in range(2):
        with pytest.raises(film.RenderError, match="no OpenGL.*MUJOCO_GL=egl"):
            film.renderer(mujoco.MjSpec().compile(), 16, 16)
    assert asked == ["once"]


def test_meshcats_page_has_the_caption() -> None:
    sent: list[Any] = []
    page: Any = SimpleNamespace(set_header=lambda *_: None, finish=sent.append)
    meshcat_view.Start.get(page)
    (text,) = sent
    whole = (Path(meshcat_view.VIEWER_ROOT) / meshcat_view.VIEWER_HTML).read_text(encoding="utf-8")
    before, end, after = text.partition(meshcat_view.CAPTION)
    assert end and before + after == whole and after.startswith("</body>")
