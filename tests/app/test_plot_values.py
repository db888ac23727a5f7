"""Values of figures: units, places, intervals and notes, by a log of a walk whose values are known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from known_walk import (
    ROBOT,
    SOLE,
    TICKS,
    TIME,
    about,
    other,
    walk_columns,
)
from log_writing import HEADER, made_log, write
from matplotlib.patches import Polygon

from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.drift import Drift
from wbc.app.log.reader import Log
from wbc.app.log.signals import Signals
from wbc.app.log.stances import stances, support_box
from wbc.app.log.writer import LogWriter
from wbc.app.plot.balance import _errors
from wbc.app.plot.figures import draw, missing
from wbc.app.plot.signals import MAX_SIGNALS, draw_signals, select
from wbc.app.plot.stiffness import scans
from wbc.app.plot.study import draw_study
from wbc.app.plot.style import (
    COLOURS,
    STYLES,
    labels,
    mark_states,
    new_figure,
)
from wbc.base.errors import InputError
from wbc.sim.studies.intervals import CONFIDENCE, FEW, Estimate
from wbc.sim.studies.study_table import StudyTable, TableCell


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return made_log(tmp_path_factory.mktemp("made") / "walked.arrow", walk_columns(), robot=ROBOT)


# ---- figures --------------------------------------------------------------------------------------------------------


def lines(axes: Any) -> dict[str, np.ndarray]:
    return {line.get_label(): np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()}


def test_balance_is_drawn_in_metres_and_its_error_in_millimetres(walked: Log) -> None:
    figure = draw("balance", [walked])
    assert len(figure.axes) == 3
    for i, axes in enumerate(figure.axes[:2]):
        found = lines(axes)
        for label, group in (
            ("ZMP measured", "zmp/measured"),
            ("DCM planned", "dcm/reference"),
            ("CoM planned", "com/reference"),
        ):
            np.testing.assert_array_equal(found[label], walked.vector(group, 2)[:, i])
        low, high = support_box(walked)
        room = 0.15 * (high[:, i].max() - low[:, i].min())
        assert axes.get_ylim() == pytest.approx((low[:, i].min() - room, high[:, i].max() + room))
        assert axes.get_ylabel() == f"{'xy'[i]} (m)"
    error = lines(figure.axes[2])
    np.testing.assert_allclose(error["x"], -3.0, atol=1e-9)  # reference − estimate
    np.testing.assert_allclose(error["y"], -4.0, atol=1e-9)
    assert "DCM" in figure.axes[2].get_ylabel()
    widths = [draw("balance", [walked] * count).get_size_inches()[0] for count in (1, 2, 3)]
    assert widths == pytest.approx([11.0, 14.0, 21.0])


def test_the_error_is_what_the_stabilizer_says_and_without_a_walk_the_sway(
    walked: Log, tmp_path: Path
) -> None:
    told = np.tile([0.5, 0.25], (TICKS, 1))
    np.testing.assert_array_equal(_errors(other(tmp_path, {"stabilizer/dcm_error": told})), told)
    standing = other(
        tmp_path, {"com/estimated": np.tile([1.0, 2.0, 3.0], (TICKS, 1)) + TIME[:, None]}, "dcm/reference"
    )
    np.testing.assert_allclose(_errors(standing), np.tile((TIME - TIME.mean())[:, None], 2), atol=1e-12)
    still = other(tmp_path, {"com/estimated": np.ones((TICKS, 3))}, "dcm/reference")
    assert len(draw("balance", [still]).axes) == 2, "there is no error to draw"
    assert "CoM off its mean" in draw("balance", [standing]).axes[2].get_ylabel()


def test_a_plan_is_drawn_in_the_true_world_in_one_scale_with_all_footsteps(walked: Log) -> None:
    figure = draw("plan", [walked, walked])
    axes = figure.axes[0]
    every = np.concatenate([s.corners for which in ("reference", "truth") for s in stances(walked, which)])
    (x0, y0, _), (x1, y1, _) = every.min(axis=0), every.max(axis=0)
    room = 0.04 + 0.02 * max(x1 - x0, y1 - y0)
    assert axes.get_xlim() == pytest.approx((x0 - room, x1 + room))
    assert axes.get_ylim() == pytest.approx((y0 - room, y1 + room))
    height = min(6.0, max(1.6, 0.86 * 12.0 * (y1 - y0 + 2.0 * room) / (x1 - x0 + 2.0 * room)))
    assert figure.get_size_inches() == pytest.approx([12.0, 2.0 * height + 1.8])
    com = about(walked.vector("com/estimated", 3))
    np.testing.assert_allclose(lines(axes)["CoM"], com[:, 1], atol=1e-9)
    outlines = [patch for patch in axes.patches if isinstance(patch, Polygon)]
    assert len(outlines) == 2 * 3 + 3, "each planned one filled and dashed, each true one"
    assert {"left sole, true", "right sole, planned", "ZMP", "DCM"} <= set(lines(axes))
    assert axes.get_title(loc="left").endswith(Drift.of(walked).text(-1))


def test_a_plan_without_the_truth_is_that_of_the_estimate(tmp_path: Path) -> None:
    log = other(tmp_path, None, "truth")
    axes = draw("plan", [log]).axes[0]
    np.testing.assert_array_equal(lines(axes)["CoM"], log.vector("com/estimated", 2)[:, 1])
    assert "left sole" in lines(axes) and "left sole, true" not in lines(axes)
    assert len(axes.patches) == 6


def test_pushes_are_arrows_where_they_began(tmp_path: Path) -> None:
    force, point = np.zeros((TICKS, 3)), np.tile([0.5, 0.1, 1.0], (TICKS, 1))
    force[3:6], force[20], force[30] = (0.0, -30.0, 0.0), (40.0, 0.0, 0.0), np.nan
    point[3:6] = 0.2, 0.3, 1.0
    axes = draw("plan", [other(tmp_path, {"truth/push/point": point, "truth/push/force": force})]).axes[0]
    arrows = [(tuple(text.xyann), tuple(text.xy)) for text in axes.texts if text.get_text() == ""]
    found = sorted((tuple(np.round(a, 6)), tuple(np.round(b, 6))) for b, a in ((t, h) for t, h in arrows))
    assert found == [((0.2, 0.24), (0.2, 0.3)), ((0.56, 0.1), (0.5, 0.1))]
    assert [line.get_label() for line in axes.get_lines()].count("push") == 1


@pytest.mark.parametrize("lack", ["com/estimated", "zmp/measured", "foot/right/wrench_measured"])
def test_a_figure_says_what_a_log_lacks_for_it(lack: str, walked: Log, tmp_path: Path) -> None:
    assert missing("balance", walked) is None and missing("plan", walked) is None
    assert lack in (missing("balance", other(tmp_path, None, lack)) or "")
    assert "foot/left/stiffness" in (missing("stiffness", walked) or "")


def test_figures_need_ticks_estimates_stances_and_soles_with_a_stiffness(tmp_path: Path) -> None:
    one = made_log(
        tmp_path / "one.arrow", {name: values[:1] for name, values in walk_columns().items()}, robot=ROBOT
    )
    assert "1 ticks" in (missing("balance", one) or "")
    two = made_log(
        tmp_path / "two.arrow", {name: values[:2] for name, values in walk_columns().items()}, robot=ROBOT
    )
    assert missing("balance", two) is None
    unknown = other(tmp_path, {"com/estimated": np.full((TICKS, 3), np.nan)})
    assert missing("balance", unknown) and missing("plan", unknown) is None
    air = other(tmp_path, {f"foot/{side}/contact": np.zeros(TICKS) for side in SOLE})
    assert missing("plan", air) and missing("balance", air) is None
    soles = {
        f"foot/{side}/{what}": np.zeros(TICKS) for side in SOLE for what in ("stiffness", "stiffness_command")
    }
    assert "stiffness" in (missing("stiffness", other(tmp_path, soles)) or "")
    assert missing("stiffness", other(tmp_path, soles | {"foot/left/stiffness": np.ones(TICKS)})) is None


def stiff(path: Path, **changed: Any) -> Log:
    columns = {
        f"foot/{side}/{what}": TIME + 1.0 for side in SOLE for what in ("stiffness", "stiffness_command")
    }
    return other(path, columns | changed)


def test_ranges_and_scans_are_drawn_where_there_are_some(tmp_path: Path) -> None:
    plain, nothing = stiff(tmp_path), [None] * TICKS
    assert len(draw("stiffness", [plain]).axes) == 1 and scans(plain) == []
    blind = {f"foot/{side}/range": np.full(TICKS, np.nan) for side in SOLE}
    assert len(draw("stiffness", [stiff(tmp_path, **blind)]).axes) == 1
    along, heights = [*nothing], [*nothing]
    along[7], heights[7] = np.array([0.1, 0.2, 0.3]), np.array([0.01, 0.03, 0.02])
    along[9], heights[9] = np.array([]), np.array([])
    sides: list[Any] = [None] * 7 + ["left", None, "right"] + [None] * 30
    commanded = np.full(TICKS, np.nan)
    commanded[7] = 33.0
    seen = {
        "stiffness/scan/x": along,
        "stiffness/scan/z": heights,
        "stiffness/side": sides,
        "stiffness/commanded": commanded,
    }
    ranges = blind | {"foot/left/range": 0.05 + 0.01 * TIME}
    log = stiff(tmp_path, **ranges, **seen)
    assert [(side, k) for side, _, _, k in scans(log)] == [("left", 33.0)]
    figure = draw("stiffness", [log])
    assert len(figure.axes) == 3
    np.testing.assert_allclose(lines(figure.axes[1])["left"], 1e3 * (0.05 + 0.01 * TIME))
    (scan,) = [line for line in figure.axes[2].get_lines() if len(line.get_xdata()) == 3]  # type: ignore[arg-type]
    np.testing.assert_allclose(scan.get_ydata(), [10.0, 30.0, 20.0], rtol=1e-6)
    (label,) = figure.axes[2].texts
    assert label.get_text() == "33" and label.xy == pytest.approx((0.2, 30.0))  # type: ignore[attr-defined]
    assert figure.get_size_inches() == pytest.approx([9.0, 2.7 * 3])
    path = tmp_path / "more"
    path.mkdir()
    both = draw("stiffness", [log, stiff(path)])
    assert both.get_size_inches() == pytest.approx([14.0, 2.7 * 3])
    assert [axes.get_visible() for axes in both.axes] == [True, True, True, False, True, False]


# ---- signals --------------------------------------------------------------------------------------------------------


def test_signals_share_a_panel_with_those_of_their_unit_and_texts_have_their_own(tmp_path: Path) -> None:
    signals = Signals()
    read: Callable[..., Any] = lambda tick: None  # noqa: E731
    for name, unit in (("time", "s"), ("a/x", "m"), ("a/y", "m"), ("n", "1"), ("k", "N"), ("m", "1")):
        signals.one(name, unit, "", read, "double")
    signals.one("state", "1", "", read, "text")
    writer = LogWriter(tmp_path / "a.arrow")
    writer.begin(signals, HEADER)
    for i in range(6):
        writer.row[:] = i, 2.0 * i, np.nan if i % 2 else 1.0, 3.0, 4.0, 5.0
        writer.commit([("up", "down", None)[i % 3]])
    writer.close()
    log = Log.open(tmp_path / "a.arrow")
    figure = draw_signals([log], ["a", "n", "k", "state"])
    heads = [axes.get_ylabel() for axes in figure.axes]
    assert heads == ["(m)", "n", "k (N)", "state"]
    (both,) = draw_signals([log], ["n", "m"]).axes
    assert both.get_ylabel() == "(1)"
    assert figure.get_size_inches() == pytest.approx([10.0, 1.2 + 3 * 2.6 + 1.5])
    assert [line.get_marker() for line in figure.axes[0].get_lines()] == ["", "."], "alone between gaps"
    (texts,) = figure.axes[3].get_lines()
    np.testing.assert_array_equal(texts.get_ydata(), [0, 1, np.nan] * 2)
    assert figure.axes[-1].get_xlabel() == "time (s)"
    two = draw_signals([log, log], ["state"])
    np.testing.assert_allclose(two.axes[0].get_lines()[1].get_ydata(), [0.08, 1.08, np.nan] * 2)
    assert [line.get_label() for line in two.axes[0].get_lines()] == labels([log, log])
    assert str(texts.get_label()).startswith("_"), "of one log nothing is to be told apart"
    assert [label.get_text() for label in figure.axes[3].get_yticklabels()] == ["up", "down"]
    assert figure.axes[3].get_ylim() == (-0.5, 1.5)


def test_lines_are_told_apart_by_colour_and_style(tmp_path: Path) -> None:
    """A colour a signal and a style a log; of one signal a colour a log; the styles begin where the colours end."""
    count = len(COLOURS) + 2
    columns = {"time": TIME} | {f"v/{i}": TIME + i for i in range(count)}
    logs = [made_log(tmp_path / f"{name}.arrow", columns) for name in "ab"]

    def drawn(logs: list[Log], words: list[str]) -> list[tuple[Any, Any, Any]]:
        figure = draw_signals(logs, words)
        return [
            (line.get_color(), line.get_linestyle(), line.get_label()) for line in figure.axes[0].get_lines()
        ]

    one = drawn(logs[:1], ["v"])
    assert [colour for colour, *_ in one] == [COLOURS[i % len(COLOURS)] for i in range(count)]
    assert [style for _, style, _ in one] == [STYLES[0]] * len(COLOURS) + [STYLES[1]] * 2
    assert one[3][2] == "v/3"
    both = drawn(logs, ["v/0", "v/1"])
    assert both == [
        (COLOURS[i], STYLES[j], f"v/{i}, {name}") for j, name in enumerate("ab") for i in range(2)
    ]
    assert drawn(logs, ["v/4"]) == [(COLOURS[j], STYLES[0], name) for j, name in enumerate("ab")]


def test_a_signal_that_one_log_alone_has_is_drawn_of_this_one(tmp_path: Path) -> None:
    first = made_log(tmp_path / "a.arrow", {"time": TIME, "a": TIME})
    second = made_log(tmp_path / "b.arrow", {"time": TIME, "b": TIME})
    figure = draw_signals([first, second], ["a", "b"])
    assert [line.get_label() for line in figure.axes[0].get_lines()] == ["a, a", "b, b"]


def test_as_many_signals_as_can_be_told_apart_are_drawn_and_lists_are_not(tmp_path: Path) -> None:
    columns: dict[str, Any] = {"time": TIME} | {f"v/{i}": TIME for i in range(MAX_SIGNALS + 1)}
    log = made_log(tmp_path / "a.arrow", columns | {"w/x": TIME, "w/rows": [np.ones(2)] * TICKS})
    assert len(select([log], [f"v/{i}" for i in range(MAX_SIGNALS)])) == MAX_SIGNALS
    with pytest.raises(InputError, match="too many"):
        select([log], ["v"])
    assert select([log], ["w/"]) == ["w/x"] == select([log], ["w/*"])
    with pytest.raises(InputError, match="lists"):
        select([log], ["w/rows"])


# ---- style ----------------------------------------------------------------------------------------------------------


def test_every_other_state_is_shaded_and_named_without_its_machine() -> None:
    paths = np.array(["demo/a"] * 2 + ["demo/b"] * 3 + ["demo"] * 2, dtype=object)

    class Told(dict[str, Any]):
        time = 0.5 * np.arange(7.0)

        def __len__(self) -> int:
            return 7

        def texts(self, name: str) -> Any:
            return paths

    for names in (True, False):
        axes = new_figure(4.0, 3.0).subplots()
        mark_states(axes, Told({"program/state": 0}), names=names)  # type: ignore[arg-type]
        assert [(patch.get_x(), patch.get_width()) for patch in axes.patches] == [(1.0, 1.5)]
        told = [(text.get_text(), text.get_position()[0]) for text in axes.texts]
        assert told == ([("a", 0.5), ("b", 1.75)] if names else [])
    axes = new_figure(4.0, 3.0).subplots()
    mark_states(axes, Told(), names=True)  # type: ignore[arg-type]
    assert not axes.patches and not axes.texts


# ---- studies --------------------------------------------------------------------------------------------------------


def study_of(*arms: str, cells: tuple[TableCell, ...], completed_only: bool = False) -> StudyTable:
    study: Any = SimpleNamespace(arms=dict.fromkeys(arms), name="s", titled=lambda name: f"{name} (m)")
    return StudyTable(study, "height", completed_only, (), arms[0], ("low", "high", "all"), cells)


def cell(
    row: str, arm: str, mean: float | None, low: float | None, high: float | None, layouts: int
) -> TableCell:
    estimate = Estimate(layouts, mean, low, high, layouts)
    return TableCell(row, arm, estimate, None, None, None, {}, {}, None, {}, 0, {}, "layouts")


def test_a_study_is_drawn_a_row_a_cell_with_the_intervals_of_eight_layouts() -> None:
    cells = (
        cell("low", "a", 3.0, 2.0, 5.0, FEW),
        cell("low", "b", 4.0, 3.0, 6.0, FEW - 1),
        cell("high", "a", None, None, None, 0),
        cell("high", "b", 7.0, None, None, FEW),
    )
    drawn = draw_study(study_of("a", "b", cells=cells))
    (axes,) = drawn.axes
    points = {
        (float(c.lines[0].get_xdata()[0]), round(float(c.lines[0].get_ydata()[0]), 6)): c
        for c in axes.containers
    }
    assert set(points) == {(3.0, -0.175), (4.0, 0.175), (7.0, 1.175)}
    assert [points[place].has_xerr for place in sorted(points)] == [True, False, False]
    (bar,) = points[3.0, -0.175].lines[2]
    assert bar.get_segments()[0][:, 0].tolist() == [2.0, 5.0]
    assert axes.get_ylim() == (2.5, -0.5) and f"{100 * CONFIDENCE:g} %" in axes.get_xlabel()
    assert drawn.get_size_inches() == pytest.approx([7.0, 1.2 + 0.32 * 3])
    wide = draw_study(study_of(*"abcd", cells=cells, completed_only=True))
    assert wide.get_size_inches()[1] == pytest.approx(1.2 + 0.32 * 3 * 2.0)
    assert "completed walks alone" in wide.axes[0].get_xlabel()
    with pytest.raises(InputError, match="height"):
        draw_study(study_of("a", cells=cells[2:3]))


# ---- the command ----------------------------------------------------------------------------------------------------


def test_logs_and_drawings_are_told_apart(
    walked: Log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log is known by its ending, and the first word is one in any case."""
    monkeypatch.chdir(tmp_path)
    drawn: list[tuple[list[str], list[str]]] = []
    monkeypatch.setattr("wbc.app.plot.figures.save", lambda figures, target: [target])
    monkeypatch.setattr(
        "wbc.app.plot.figures.draw",
        lambda name, logs: drawn.append(([log.path.name for log in logs], [name])),
    )
    monkeypatch.setattr(
        "wbc.app.plot.signals.draw_signals",
        lambda logs, words: drawn.append(([log.path.name for log in logs], words)),
    )
    content = walked.path.read_bytes()
    for name in ("one", "two.arrow", "balance"):
        Path(name).write_bytes(content)
    assert main(["plot", "one", "two.arrow", "balance", "com"]) == RAN
    logs = ["one", "two.arrow"]
    assert drawn == [(logs, ["balance"]), (logs, ["com"])]
    assert main(["plot", "one", "none.arrow", "balance"]) == BAD_INPUT
    assert "none.arrow" in capsys.readouterr().err
    drawn.clear()
    assert main(["plot", "one"]) == RAN
    assert [names for _, names in drawn] == [["balance"], ["plan"]], "all that the log can show"


def test_a_log_that_ends_early_is_drawn_with_a_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import json  # noqa: PLC0415

    path = tmp_path / "log.arrow"
    write(path, 700).close()
    path.write_bytes(path.read_bytes()[:-3000])
    count = len(Log.open(path))
    assert main(["plot", str(path), "--list", "--json"]) == RAN
    (told,) = json.loads(capsys.readouterr().out)["logs"]
    assert told["broken"] and told["ticks"] == count and told["header"]["program"] == HEADER["program"]
    assert main(["plot", str(path), "--list"]) == RAN
    assert f"{count} ticks are read" in capsys.readouterr().out
    assert main(["plot", str(path)]) == BAD_INPUT
    assert "--list" in capsys.readouterr().err
