"""Figures show what the log holds, say in which units, and refuse what they cannot show."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from properties import by_default
from recorded import make_walk, recorded_stand, recorded_walk

import wbc
from wbc.app.cli import main
from wbc.app.drift import Drift
from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.app.log.stances import stances
from wbc.app.plot.figures import FIGURES, draw, missing, save
from wbc.app.plot.signals import draw_signals, select
from wbc.app.plot.style import labels, mark_pushes, new_figure
from wbc.app.replay.replay import Replay
from wbc.base.errors import InputError, UnknownNameError
from wbc.tasks import Behaviour, Program, StateMachine, after
from wbc.tasks.balance import balance_controller


@pytest.fixture(scope="module")
def log() -> Log:
    return Log.open(recorded_walk())


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """A log without a walk, of rigid soles."""
    return recorded_stand(tmp_path_factory.mktemp("logs") / "stand.arrow", ticks=10)


def curves(figure: Figure) -> list[np.ndarray]:
    """Ordinates of all lines, and of everything that is shown as an image."""
    lines = [np.asarray(line.get_ydata(), dtype=float) for ax in figure.axes for line in ax.get_lines()]
    return lines + [np.asarray(image.get_array(), dtype=float) for ax in figure.axes for image in ax.images]


def shows(figure: Figure, values: np.ndarray) -> bool:
    return any(c.shape == values.shape and np.array_equal(c, values, equal_nan=True) for c in curves(figure))


def test_figures_show_the_numbers_of_the_log(log: Log) -> None:
    balance = draw("balance", log)
    for group in ("zmp/measured", "zmp/reference", "dcm/estimated", "com/estimated", "com/reference"):
        assert shows(balance, log[group][:, 0]) and shows(balance, log[group][:, 1]), group
    assert shows(balance, 1e3 * log["stabilizer/dcm_error/y"])
    assert shows(draw("plan", [log]), Drift.of(log)(log["com/estimated"])[:, 1])
    assert shows(draw("stiffness", [log]), log["foot/left/stiffness"])
    own = draw_signals([log], ["own/answer", "com/estimated", "walk/phase"])
    assert shows(own, log["own/answer"]) and shows(own, log["com/estimated/z"])
    phases = log.texts("walk/phase")
    ticks = [label.get_text() for label in own.axes[1].get_yticklabels()]
    assert set(ticks) == set(phases)
    drawn = np.asarray(own.axes[1].get_lines()[0].get_ydata())
    assert [ticks[int(level)] for level in drawn] == phases.tolist()


def test_logs_are_told_apart_by_title_else_by_file(tmp_path: Path) -> None:
    def named(*rows: tuple[str, str]) -> list[str]:
        logs: Any = [SimpleNamespace(header={"title": title}, path=tmp_path / file) for title, file in rows]
        return labels(logs)

    assert named(("a", "1.arrow"), ("b", "2.arrow")) == ["a", "b"]
    assert named(("a", "1.arrow"), ("a", "2.arrow")) == ["1", "2"] == named(("", "1.arrow"), ("b", "2.arrow"))
    assert named(("a", "x/1.arrow"), ("a", "y/1.arrow")) == [
        str(tmp_path / each / "1.arrow") for each in "xy"
    ]


def test_a_figure_of_signals_needs_a_log_and_a_signal(log: Log) -> None:
    for logs, words in (([], ["time"]), ([log], [])):
        with pytest.raises(InputError, match="at least one"):
            draw_signals(logs, words)


def test_states_of_a_program_are_drawn_as_bands(tmp_path: Path) -> None:
    plant = wbc.Plant(wbc.load_robot("hrp4_class"))
    control = wbc.PositionControl(balance_controller(plant.description.robot(), plant.control_period))
    look = r"look $\frac$"  # no mathematics
    states = [Behaviour("wait", done=after(0.03)), Behaviour(look, done=after(0.03))]
    program = Program(StateMachine("demo", states), control)
    with Recorder(tmp_path / "demo.arrow") as record:
        program.run(plant, record=record)
    log = Log.open(tmp_path / "demo.arrow")
    told = list(dict.fromkeys(log.texts("program/state")))
    assert told == ["demo/wait", f"demo/{look}", "demo"]
    ended = [(path, how) for _, path, how in program.history]
    assert [event for _, event in log.events] == [f"{path}: {how}" for path, how in ended]
    assert log.events[0][0] == pytest.approx(program.history[0][0])
    replay = Replay(log)
    assert replay.picture(2).text == ["demo/wait"] and replay.picture(len(log) - 1).text[0] == "demo"
    for figure in (draw("balance", [log]), draw_signals([log], ["com/estimated"])):
        figure.draw_without_rendering()  # type: ignore[no-untyped-call]
        assert {text.get_text() for text in figure.axes[0].texts} >= {"wait", look}
        assert figure.axes[0].patches


def test_planned_footsteps_lie_where_feet_really_landed(log: Log) -> None:
    drift = Drift.of(log)
    estimated, true = log["com/estimated"][:, :2], log["truth/com"][:, :2]
    assert np.abs(drift(estimated) - true).max() < 3e-3 < np.abs(estimated - true).max()
    assert drift.size.max() > 5e-3
    assert re.fullmatch(r"estimate \d+ mm and [+-]\d\.\d° off", drift.text(-1))
    assert drift.text(9) in Replay(log).picture(9).text
    for planned, real in zip(stances(log), stances(log, "truth"), strict=True):
        assert (planned.side, planned.start) == (real.side, real.start)
        np.testing.assert_allclose(planned.corners.mean(axis=0), real.corners.mean(axis=0), atol=6e-3)


def test_logs_without_a_walk_are_refused_by_name(standing: Log) -> None:
    with pytest.raises(InputError, match="'plan'"):
        draw("plan", [standing])
    with pytest.raises(InputError, match="stiffness"):
        draw("stiffness", [standing])
    assert missing("balance", standing) is None  # the command draws it
    with pytest.raises(UnknownNameError, match="balance"):
        draw("balances", [standing])
    with pytest.raises(InputError, match="at least one log"):
        draw("balance", [])


@pytest.mark.parametrize("bad", by_default(["all", "first", "last"], "all", "first"))
def test_every_figure_of_a_log_with_bad_measurements_is_drawn_or_refused(bad: str, tmp_path: Path) -> None:
    """Without an estimate no foot is planned to stand, and no place is known."""
    plant, walk = make_walk()
    with Recorder(tmp_path / "bad.arrow") as record:
        for tick in range(6):
            measurement = plant.measure()
            if bad == "all" or (tick < 3) is (bad == "first"):
                measurement = replace(
                    measurement, joint_position=np.full_like(measurement.joint_position, np.nan)
                )
            command = walk.command(measurement)
            record(plant, walk, measurement, command)
            plant.step(command)
    found = Log.open(tmp_path / "bad.arrow")
    for name in FIGURES:
        if missing(name, found) is None:
            draw(name, [found])
        else:
            with pytest.raises(InputError, match=name):
                draw(name, [found])
    assert (missing("plan", found) is None) is (bad != "all")


def test_signals_are_chosen_by_name_group_or_pattern(log: Log) -> None:
    assert select([log], ["com/estimated/x"]) == ["com/estimated/x"]
    assert select([log], ["com/estimated", "com/estimated/y"]) == [f"com/estimated/{a}" for a in "xyz"]
    assert select([log], ["joint/torque_command/*knee*"]) == [
        "joint/torque_command/left_knee_pitch",
        "joint/torque_command/right_knee_pitch",
    ]
    with pytest.raises(UnknownNameError, match="'com/estimated'"):
        select([log], ["com/estimatedd"])
    with pytest.raises(InputError, match="too many"):
        select([log], ["joint"])


@pytest.mark.slow
def test_pictures_are_what_their_names_say(standing: Log, tmp_path: Path) -> None:
    figures = {"balance": draw("balance", [standing]), "com": draw_signals([standing], ["com/estimated"])}
    png = save(figures, tmp_path / "walk.png")
    assert [path.name for path in png] == ["walk-balance.png", "walk-com.png"]
    with Image.open(png[0]) as picture:
        assert picture.format == "PNG" and picture.width > 800
    (svg,) = save({"com": figures["com"]}, tmp_path / "com.svg")
    assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    (pdf,) = save(figures, tmp_path / "walk.pdf")
    assert pdf.read_bytes().count(b"/Type /Page ") == 2


def test_command_draws_lists_and_refuses(
    log: Log,
    standing: Log,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plot", str(standing.path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["files"] == ["stand.png"] and Path("stand.png").is_file()
    assert not facts["notes"]
    for name in ("balance", "com"):
        Path(name).write_text("a file that is called like what is drawn")
    assert main(["plot", str(standing.path), str(log.path), "com/estimated", "-o", "two.pdf"]) == 0
    assert capsys.readouterr().out.strip() == "two.pdf"
    assert main(["plot", str(log.path), "--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [s["name"] for s in listed["signals"]] == list(log)
    assert {"name": "own/answer", "unit": "m", "about": "to everything", "kind": "double"} in listed[
        "signals"
    ]
    assert main(["plot", str(log.path), "--list"]) == 0
    assert re.search(r"^com/estimated/x +m +world$", capsys.readouterr().out, re.MULTILINE)


class Marked(dict[str, Any]):
    """A log of 6 ticks with two pushes and one change of the kind of steps."""

    time = np.arange(6.0)

    def __len__(self) -> int:
        return len(self.time)

    def vector(self, name: str, size: int) -> Any:
        return self[name][:, :size]


def test_pushes_are_marked() -> None:
    force = np.zeros((6, 3))
    force[1:3, 1], force[5, 0] = 30.0, np.nan
    force[4, 0] = -10.0
    log = Marked({"truth/push/force/x": 0, "truth/push/force": force})
    axes = new_figure(4.0, 3.0).subplots()
    mark_pushes(axes, log)  # type: ignore[arg-type]
    assert [patch.get_x() for patch in axes.patches] == [1.0, 4.0]
    assert [patch.get_width() for patch in axes.patches] == [2.0, 1.0]
    assert axes.get_legend_handles_labels()[1] == ["push"]


@pytest.mark.parametrize("name", ["plan", "balance"])
def test_the_title_is_above_the_legend_and_no_panel_is_empty(log: Log, name: str) -> None:
    figure = draw(name, [log])
    figure.draw_without_rendering()  # type: ignore[no-untyped-call]
    first = figure.axes[0]
    title, legend = first._left_title, first.get_legend()  # type: ignore[attr-defined]
    assert legend is not None and title.get_window_extent().y0 >= legend.get_window_extent().y1 - 3.0
    for axes in figure.axes:
        lines = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]
        assert any(
            np.isfinite(line).any() and np.ptp(line[np.isfinite(line)]) > 0.0 for line in lines if len(line)
        )
