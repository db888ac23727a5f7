"""The command `wbc`: options from configuration classes, one JSON object on stdout, exit codes."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from wbc.app import cli
from wbc.app.commands import COMMANDS, stand
from wbc.app.output import Report, reports
from wbc.robots import names
from wbc.robots.registry import others

Captured = pytest.CaptureFixture[str]


QUICK: dict[str, tuple[list[str], set[str]]] = {  # arguments with which it ends soon, keys of its result
    "robots": ([], {"robots"}),
    "stand": (
        ["--seconds", "0.1"],
        {"robot", "mode", "upright", "com_error", "zmp_noise", "real_time_factor", "tick_us"},
    ),
    "bench tick": (
        ["--ticks", "50", "--warm-up", "5"],
        {"robot", "nv", "median_us", "p99_us", "parts", "failures"},
    ),
    "foot": (["--robot", "g1"], {"feet"}),
    "terrain": ([], {"terrains", "scenes"}),
    "settings": (["gains.dcm_p"], {"settings"}),
    "terrain stones": (["--amplitude", "0.02"], {"terrain", "amplitude_m", "roughness"}),
}


def wbc_command(capfd: Captured, *arguments: str) -> tuple[int, str, str]:
    code = cli.main(list(arguments))
    out, err = capfd.readouterr()
    return code, out, err


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


@pytest.mark.parametrize("words", COMMANDS)
def test_every_command_has_help(capfd: Captured, words: str) -> None:
    code, out, _ = wbc_command(capfd, *words.split(), "--help")
    assert code == cli.RAN and f"Usage: wbc {words}" in out


def test_help_lists_every_command_and_the_exit_codes(capfd: Captured) -> None:
    code, out, _ = wbc_command(capfd, "--help")
    assert code == cli.RAN
    assert all(f" {words.split()[0]} " in out for words in COMMANDS)
    assert "2 bad input" in out
    assert wbc_command(capfd) == (cli.RAN, out, "")


def test_robots_in_a_table_and_one_in_full(capfd: Captured) -> None:
    _, out, _ = wbc_command(capfd, "robots")
    assert [line.split()[0] for line in out.splitlines()[1:]] == [*names(), *others()]
    _, out, _ = wbc_command(capfd, "robots", "talos", "--json")
    facts = json.loads(out)
    assert facts["mass_kg"] == pytest.approx(90.27, abs=0.01) and facts["nv"] == 38
    _, out, _ = wbc_command(capfd, "robots", "g1")
    assert out.startswith("g1:") and "half-sitting" in out


def test_an_internal_failure_is_told_apart_from_bad_input(
    capfd: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(options: Any, **_: object) -> None:
        raise ZeroDivisionError("something of ours")

    monkeypatch.setattr(stand, "StandTrial", broken)
    code, out, err = wbc_command(capfd, "stand", "--json")
    assert code == cli.FAILED and out == ""
    assert "Traceback" in err and "something of ours" in err


def test_whatever_is_printed_meanwhile_goes_to_stderr(capfd: Captured) -> None:
    @reports
    def noisy() -> Report:
        print("from Python")
        os.write(1, b"from C\n")
        return Report({"nan": float("nan"), "path": Path("a"), "pair": (1, 2.0)}, "done")

    noisy(json=True)
    out, err = capfd.readouterr()
    assert json.loads(out) == {"nan": None, "path": "a", "pair": [1, 2.0]}
    assert "from Python" in err and "from C" in err
    noisy()
    assert capfd.readouterr().out == "done\n"


def test_the_list_of_commands_loads_none_of_them() -> None:
    program = (
        "import sys, wbc.app.cli; [wbc.app.cli.main([word]) for word in ('--version', '--help')]; "
        "print(*(m for m in ('pinocchio', 'scipy', 'pydantic', 'mujoco') if m in sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout and not done.stderr.strip()


@pytest.mark.slow  # a process that imports the library
def test_a_reader_that_goes_away_is_no_failure() -> None:
    program = [sys.executable, "-m", "wbc", "robots", "hrp4_class"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 0
