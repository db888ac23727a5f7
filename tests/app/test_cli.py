"""The command `wbc`: options from configuration classes, one JSON object on stdout, exit codes."""

from __future__ import annotations

import importlib
import json
import logging
import os
import re
import shlex
import subprocess
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

import pytest
from cyclopts import App, Parameter

import wbc
from wbc.app import cli, live
from wbc.app.arguments import plain_options
from wbc.app.commands import COMMANDS, GROUPS, balance
from wbc.app.output import Flat, Output, Report, reports
from wbc.core.errors import InputError
from wbc.core.settings import Count, Positive, settings
from wbc.robots import names, others

Captured = pytest.CaptureFixture[str]

ELSEWHERE = {
    **dict.fromkeys(("walk", "study show", "study run", "study table"), "app/test_walks_command.py"),
    "stiffness": "sim/test_best_stiffness.py",
    "study optimize": "sim/test_optimization.py",
    "bench walk": "app/test_bench.py",
    "plot": "app/test_plots.py",
    "log convert": "app/test_convert.py",
    "view": "app/test_log_replay.py",
    "motion": "motion/test_track.py",
}
"""Commands that have their own tests of what they print, because it takes a walk or a file: the file that does it."""

QUICK: dict[str, tuple[list[str], set[str]]] = {  # arguments with which it ends soon, keys of its result
    "robots": ([], {"robots"}),
    "stand": (
        ["--seconds", "0.1"],
        {"robot", "mode", "upright", "com_error_mm", "zmp_noise_mm", "real_time_factor", "tick_us"},
    ),
    "check-plant": (["--robot", "g1"], {"ok", "checks"}),
    "push": (
        [
            "--robot",
            "hrp4_class",
            "--mode",
            "torque",
            "--directions",
            "1",
            "--resolution",
            "0.9",
            "--after",
            "0.1",
        ],
        {"unit", "cells"},
    ),
    "bench tick": (
        ["--ticks", "50", "--warm-up", "5"],
        {"robot", "nv", "median_us", "p99_us", "parts", "failures"},
    ),
    "bench solver": (["--ticks", "40"], {"ticks", "unsolved", "above_tolerance", "slow_ticks", "solve_us"}),
    "foot": (["--robot", "g1"], {"feet"}),
    "foot press": (["--terrain", "stones", "--amplitude", "0.02"], {"foot", "hold", "support", "impact"}),
    "foot pitch": (["--foot", "rigid", "--rate", "60"], {"foot", "pitch", "centre_of_pressure"}),
    "terrain": ([], {"terrains", "scenes"}),
    "terrain stones": (["--amplitude", "0.02"], {"terrain", "amplitude_m", "roughness"}),
}


def wbc_command(capfd: Captured, *arguments: str) -> tuple[int, str, str]:
    code = cli.main(list(arguments))
    out, err = capfd.readouterr()
    return code, out, err


def test_every_command_is_tested_here_or_elsewhere() -> None:
    quick = {words if words in COMMANDS else words.split()[0] for words in QUICK}
    assert set(COMMANDS) == quick | set(ELSEWHERE) and not quick & set(ELSEWHERE)
    assert len(COMMANDS) <= 20
    assert {words.split()[0] for words in COMMANDS if " " in words} == set(GROUPS)
    for words, file in ELSEWHERE.items():
        text = (Path(__file__).resolve().parents[1] / file).read_text(encoding="utf-8")
        assert f'"{words.split()[0]}"' in text and "--json" in text, (words, file)


@pytest.mark.parametrize("words", QUICK)
def test_json_is_one_object_and_alone_on_stdout(capfd: Captured, words: str) -> None:
    arguments, keys = QUICK[words]
    code, out, _ = wbc_command(capfd, *words.split(), *arguments, "--json")
    assert code == cli.RAN
    assert out.count("\n") == 1
    result = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert isinstance(result, dict) and keys <= set(result)
    loggers = {"wbc": logging.getLogger("wbc"), **logging.Logger.manager.loggerDict}
    levels = {name: logger.level for name, logger in loggers.items() if isinstance(logger, logging.Logger)}
    assert not {name: level for name, level in levels.items() if name.startswith("wbc") and level}


@pytest.mark.parametrize("words", ["robots", "terrain", "foot press", "terrain stones"])
def test_text_is_what_people_get(capfd: Captured, words: str) -> None:
    code, out, _ = wbc_command(capfd, *words.split(), *QUICK[words][0])
    assert code == cli.RAN and len(out.splitlines()) > 2
    with pytest.raises(json.JSONDecodeError):
        json.loads(out)


def configurations(words: str) -> list[type]:
    """The configuration classes whose fields are the options of a command."""
    module, _, name = COMMANDS[words].partition(":")
    function = getattr(importlib.import_module(f"wbc.app.commands.{module}"), name)
    hints = get_type_hints(function, include_extras=False)
    classes = [hint for hint in hints.values() if isinstance(hint, type) and is_dataclass(hint)]
    return [
        getattr(kind, "__settings__", kind)
        for kind in classes
        if kind is not Report and not hasattr(kind, "__fields_of__")
    ]


def option_of(configuration: type, field: str) -> str:
    """The option of a field: the name that its annotation gives it, or its own."""
    hint = get_type_hints(configuration, include_extras=True)[field]
    given = [part.name for part in getattr(hint, "__metadata__", ()) if isinstance(part, Parameter)]
    return given[0][0].removeprefix("--") if given and given[0] else field.replace("_", "-")


@pytest.mark.parametrize("words", COMMANDS)
def test_help_shows_and_explains_every_field_of_the_configuration(capfd: Captured, words: str) -> None:
    code, out, _ = wbc_command(capfd, *words.split(), "--help")
    assert code == cli.RAN and f"Usage: wbc {words}" in out
    assert len(out.splitlines()) <= 80, "what is turned first; the rest by --set and files"
    assert str(Path(wbc.__file__).parents[1]) not in re.sub(r"[\s│]", "", out), "a folder of this machine"
    shown = "".join(character for character in out if character not in "│\n ")
    classes = configurations(words)
    assert Output in classes
    while classes:
        configuration = classes.pop()
        explained = "".join(base.__doc__ or "" for base in configuration.__mro__)
        types = get_type_hints(configuration)
        for field in fields(configuration):
            if is_dataclass(types[field.name]):  # its fields are options
                classes.append(types[field.name])
                continue
            option = option_of(configuration, field.name)
            assert f"--{option}" in shown or f".{option}" in shown, field.name
            assert f"{field.name}: " in explained, f"{configuration} does not explain {field.name}"


def test_help_lists_every_command_and_the_exit_codes(capfd: Captured) -> None:
    code, out, _ = wbc_command(capfd, "--help")
    assert code == cli.RAN
    assert all(f" {words.split()[0]} " in out for words in COMMANDS)
    assert "2 bad input" in out
    assert wbc_command(capfd) == (cli.RAN, out, "")


def test_version(capfd: Captured) -> None:
    assert wbc_command(capfd, "--version") == (cli.RAN, f"{wbc.__version__}\n", "")


def test_robots_in_a_table_and_one_in_full(capfd: Captured) -> None:
    _, out, _ = wbc_command(capfd, "robots")
    assert [line.split()[0] for line in out.splitlines()[1:]] == [*names(), *others()]
    _, out, _ = wbc_command(capfd, "robots", "talos", "--json")
    facts = json.loads(out)
    assert facts["mass_kg"] == pytest.approx(90.27, abs=0.01) and facts["nv"] == 38
    _, out, _ = wbc_command(capfd, "robots", "g1")
    assert out.startswith("g1:") and "half-sitting" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stnd"], 'Did you mean "stand"'),
        (["stand", "--robbot", "g1"], "--robbot"),
        (["stand", "--seconds", "long"], "--seconds"),
        (["stand", "--seconds"], "--seconds"),
        (["stand", "--mode", "velocity"], "torque"),
        (["stand", "--robot", "talso"], "did you mean 'talos'"),
        (["stand", "--control-period", "0.0015"], "whole multiple"),
        (["stand", "--port", "7000"], "--view"),
        (["view", "run.arrow", "--speed", "2"], "film"),
        (["view", "run.arrow", "-o", "run.html", "--size", "640", "480"], "film"),
        (["view", "run.arrow", "-o", "run.mp4", "--port", "7000"], "served"),
        (["bench"], "bench"),
        (["terrain", "stones", "--param", "density"], "name=value"),
    ],
)
def test_bad_input_is_one_line_on_stderr(capfd: Captured, arguments: list[str], message: str) -> None:
    if arguments == ["bench"]:  # a group alone shows its commands
        code, out, _ = wbc_command(capfd, *arguments)
        assert code == cli.RAN and "tick" in out and "solver" in out
        return
    code, out, err = wbc_command(capfd, *arguments)
    assert code == cli.BAD_INPUT
    assert out == ""
    assert err.count("\n") == 1 and err.startswith("wbc: ")
    assert message in err


@pytest.mark.slow
def test_a_run_can_be_watched(capfd: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "BROWSER_TIME", 0.0)
    code, out, err = wbc_command(capfd, "stand", "--seconds", "0.2", "--view", "--port", "0", "--json")
    assert code == cli.RAN and json.loads(out)["upright"]
    assert "live view: http://127.0.0.1:" in err
    assert json.loads(out)["real_time_factor"] < 1.2  # held back to real time


@settings
class Inner:
    """Inner settings.

    Attributes:
        depth: Depth, m.
    """

    depth: Annotated[Positive, "m"] = 2.0


@settings(kw_only=True)
class Outer(Inner):
    """Settings.

    Attributes:
        count: Number.
        side: Side.
        out: File.
        size: Pixels.
        inner: More.
    """

    count: Count = 3
    side: Literal["left", "right"] = "left"
    out: Annotated[Path | None, Parameter(alias="-o")] = None
    size: tuple[int, int] = (4, 3)
    inner: Inner = Inner()


def options_of(*words: str) -> Outer:
    """Return what a command gets when its options are validated settings."""
    default = Outer()
    app = App(default_parameter=Parameter(negative=()))
    got: list[Outer] = []

    @app.default
    @plain_options
    def command(options: Flat[Outer] = default) -> None:
        got.append(options)

    app(words, exit_on_error=False, print_error=False, result_action="return_value")
    return got[0]


def test_validated_settings_are_options() -> None:
    assert options_of() == Outer()
    words = "--depth 1 --count 2 --side right -o a.txt --size 1 2 --inner.depth 0.5"
    assert options_of(*words.split()) == Outer(
        depth=1.0, count=2, side="right", out=Path("a.txt"), size=(1, 2), inner=Inner(0.5)
    )
    for words, message in (
        ("--depth -1", r"depth \(m\) must be a finite number above 0, got -1"),
        ("--inner.depth nan", r"depth \(m\) must be a finite number above 0, got nan"),
        ("--count 0", "count must be an integer of at least 1, got 0"),
    ):
        with pytest.raises(InputError, match=message):
            options_of(*words.split())


def test_an_internal_failure_is_told_apart_from_bad_input(
    capfd: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(options: Any) -> None:
        raise ZeroDivisionError("something of ours")

    monkeypatch.setattr(balance, "StandTrial", broken)
    code, out, err = wbc_command(capfd, "stand", "--json")
    assert code == cli.FAILED and out == ""
    assert "Traceback" in err and "something of ours" in err


def test_whatever_is_printed_meanwhile_goes_to_stderr(capfd: Captured) -> None:
    @reports
    def noisy(*, output: Output) -> Report:
        print("from Python")
        os.write(1, b"from C\n")
        return output.report({"nan": float("nan"), "path": Path("a"), "pair": (1, 2.0)}, "done")

    noisy(output=Output(json=True))
    out, err = capfd.readouterr()
    assert json.loads(out) == {"nan": None, "path": "a", "pair": [1, 2.0]}
    assert "from Python" in err and "from C" in err
    noisy(output=Output())
    assert capfd.readouterr().out == "done\n"


def test_a_command_loads_what_it_needs_alone() -> None:
    program = (
        "import sys; from wbc.app.cli import main; code = main(['robots', '--json']); "
        "sys.exit(code or 10 * any(m in sys.modules for m in ('mujoco', 'matplotlib', 'meshcat')))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert set(names()) == {robot["name"] for robot in json.loads(done.stdout)["robots"]}


def test_the_list_of_commands_loads_none_of_them() -> None:
    program = (
        "import sys, wbc.app.cli; [wbc.app.cli.main([word]) for word in ('--version', '--help')]; "
        "print(*(m for m in ('pinocchio', 'scipy', 'pydantic', 'mujoco') if m in sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout and not done.stderr.strip()


@pytest.mark.slow
def test_a_closed_stdout_is_no_failure() -> None:
    command = f"{shlex.quote(sys.executable)} -m wbc robots talos >&-"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_reader_that_goes_away_is_no_failure() -> None:
    program = [sys.executable, "-m", "wbc", "robots", "talos"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 0
