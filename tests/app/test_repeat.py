"""Ctrl-C ends a walk as its time would, and a recorded walk is repeated bit for bit, interventions and end included."""

from __future__ import annotations

import json
import math
import signal
from pathlib import Path
from typing import Any

import pytest

from wbc.app import Log
from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.log.header import FORMAT
from wbc.app.log.signals import Signals
from wbc.app.log.stances import sole_sizes
from wbc.app.log.writer import LogWriter
from wbc.app.repeat import RepeatWalk, first_difference, interventions_of, recorded_walk
from wbc.base.errors import InputError
from wbc.sim.trial.trial import Trial

LEVEL = ["--terrain", "flat", "--foot", "flat", "--noise", "none"]


@pytest.fixture
def interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C in the 150th tick of a trial."""
    step, ticks = Trial.step, [0]

    def counted(trial: Trial) -> bool:
        ticks[0] += 1
        if ticks[0] == 150:
            signal.raise_signal(signal.SIGINT)
        return step(trial)

    monkeypatch.setattr(Trial, "step", counted)


def run(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    assert main(["walk", *words, "--json"]) == RAN
    return json.loads(capsys.readouterr().out)


@pytest.mark.usefixtures("interrupted")
@pytest.mark.parametrize(
    "words",
    [
        pytest.param(["--distance", "0.5"], marks=pytest.mark.slow),
        pytest.param(["--mode", "torque", "--seconds", "9", "--drive"], marks=pytest.mark.slow),
    ],
)
def test_an_end_by_interrupt_is_recorded_and_repeated(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wbc.app.live.LiveDrive.__post_init__", lambda _: None)  # no page
    log, again = tmp_path / "log.arrow", tmp_path / "again.arrow"
    first = run(capsys, *words, *LEVEL, "--record", str(log))
    assert first["outcome"] == "stopped" and len(Log.open(log)) == 150
    assert (
        first["interventions"]
        == interventions_of(Log.open(log))
        == [{"time": Log.open(log).time[-1], "what": "end"}]
    )
    second = run(capsys, "--repeat", str(log), "--record", str(again))
    assert second["same"] and second["interventions"] == first["interventions"]
    assert second["spec"] == first["spec"] and interventions_of(Log.open(again)) == interventions_of(
        Log.open(log)
    )


@pytest.mark.slow
def test_a_log_that_was_cut_off_is_repeated_as_far_as_it_goes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, cut = tmp_path / "log.arrow", tmp_path / "cut.arrow"
    run(capsys, "--distance", "0.05", *LEVEL, "--record", str(log))
    data = log.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    again = run(capsys, "--repeat", str(cut))
    assert again["same"], again["difference"]
    assert again["outcome"] == "stopped"
    assert again["seconds"] == pytest.approx(Log.open(cut).time[-1] + 0.005)
    push = ["--push", "impulse=0.05,direction=90,step=1"]
    other = run(capsys, "--distance", "0.05", *LEVEL, *push, "--record", str(cut))
    assert other["outcome"] == "completed"
    difference = first_difference(Log.open(log), Log.open(cut))
    assert difference is not None and " s on" in difference


def written(path: Path, header: dict[str, Any], change: str | None = None) -> Log:
    """Write a log of one tick with a header, and with an intervention."""
    signals = Signals()
    signals.one("time", "s", "", lambda tick: 0.0, "double")
    signals.one("view/change", "1", "", lambda tick: None, "text")
    writer = LogWriter(path)
    writer.begin(signals, {"format": FORMAT, **header})
    writer.row[0] = 0.0
    writer.commit([change])
    writer.close()
    return Log.open(path)


@pytest.mark.parametrize(
    "change",
    [
        "3",
        "[3]",
        "{",
        '[{"what": "push", "time": "soon"}]',
        '[{"what": "push", "time": 1.0, "direction": 3, "impulse": 0.1}]',
        '[{"what": "set", "time": true, "name": "task com/weight", "value": 1.0}]',
        '[{"what": "target", "time": 1.0, "task": "com", "target": 1.0}]',
        '[{"what": "drive", "time": NaN, "forward": 0, "left": 0, "turn": 0}]',
        '[{"what": ["end"], "time": 1.0}]',
        '[{"time": 1.0}]',
    ],
)
def test_a_recorded_change_that_means_nothing_is_refused(change: str, tmp_path: Path) -> None:
    log = written(tmp_path / "log.arrow", {}, change)
    with pytest.raises(InputError, match=r"log\.arrow"):
        interventions_of(log)
    if change.startswith("[") and "NaN" not in change:
        with pytest.raises(InputError, match="recorded change"):
            RepeatWalk(json.loads(change))


ROBOT: dict[str, Any] = {"name": "g1", "mass_kg": 30.0, "soles": [], "torque_limit_Nm": {}}
SOLE = {"name": "a", "length_m": 0.2, "width_m": 0.1}


@pytest.mark.parametrize(
    "header",
    [
        {"robot": "g1"},
        {"robot": ROBOT | {"mass_kg": "30"}},
        {"robot": ROBOT | {"soles": [{"name": "a", "length_m": 1}]}},
        {"robot": ROBOT | {"soles": [SOLE | {"length_m": math.nan}]}},
        {"versions": {"libraries": ["numpy"]}},
        {"versions": 3},
        {"title": ["walk"]},
        {"seed": "1"},
        {"control_period": {}},
        {"control_period": -0.005},
        {"plant": [], "description": 3},
    ],
)
def test_a_header_whose_values_are_of_other_kinds_is_refused(header: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"'{next(iter(header))}.*' of its header"):
        written(tmp_path / "log.arrow", header)


@pytest.mark.parametrize(
    "spec", [None, 3, {"plan": 3}, {"plan": {}, "robot": 3}, {"plan": {}, "terrain_params": 3}]
)
def test_a_log_without_a_walk_is_not_repeated(spec: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        recorded_walk(written(tmp_path / "log.arrow", {"spec": spec}))
    with pytest.raises(InputError, match="no robot"):
        sole_sizes(Log.open(tmp_path / "log.arrow"))


def test_texts_of_a_file_do_not_steer_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "log.arrow"
    written(path, {"title": "\x1b[31mred\x9b2J\u202eback"})
    assert main(["plot", str(path), "--list"]) == RAN
    shown = capsys.readouterr().out
    assert "\\x1b[31mred\\x9b2J\\u202eback" in shown
    assert main(["plot", str(path), "\x1b[2Jno*"]) == BAD_INPUT
    for text in (shown, capsys.readouterr().err):
        assert all(each.isprintable() or each == "\n" for each in text)
