"""Ends of commands: exit codes, signals, Ctrl-C, and what is said of runs that go on."""

from __future__ import annotations

import errno
import io
import json
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from wbc.app import cli
from wbc.app.cli import BAD_INPUT, FAILED, INTERRUPTED, LONGEST_LINE, RAN, main
from wbc.app.commands import study as run_command
from wbc.app.live import ended_by_interrupt
from wbc.base.errors import InputError, WbcError
from wbc.sim.studies.journal import Journal
from wbc.sim.studies.study import Study

Said = pytest.CaptureFixture[str]


# ---- exit codes -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (InputError("bad"), BAD_INPUT, "wbc: bad"),
        (WbcError("failed"), FAILED, "wbc: failed"),
        (MemoryError(), FAILED, "out of memory"),
        (BrokenPipeError(), RAN, ""),
        (OSError(errno.ENOSPC, "No space"), FAILED, "No space"),
        (OSError(errno.ENAMETOOLONG, "too long"), BAD_INPUT, "too long"),
        (KeyboardInterrupt(), INTERRUPTED, "wbc: interrupted\n"),
        (KeyboardInterrupt("3 of 4 kept"), INTERRUPTED, "wbc: interrupted; 3 of 4 kept"),
        (ZeroDivisionError("ours"), FAILED, "internal failure"),
    ],
)
def test_errors_have_their_exit_codes(
    error: BaseException, code: int, said: str, monkeypatch: pytest.MonkeyPatch, capfd: Said
) -> None:
    def run(*_: Any, **__: Any) -> None:
        raise error

    monkeypatch.setattr(cli, "make_app", lambda words: run)
    kept = os.dup(1)
    try:
        assert main([]) == code
    finally:
        os.dup2(kept, 1)
        os.close(kept)
    assert said in capfd.readouterr().err


@pytest.mark.parametrize("length", [LONGEST_LINE, LONGEST_LINE + 1])
def test_a_long_reason_is_cut_off(length: int, monkeypatch: pytest.MonkeyPatch, capsys: Said) -> None:
    def run(*_: Any, **__: Any) -> None:
        raise InputError("x" * length)

    monkeypatch.setattr(cli, "make_app", lambda words: run)
    main([])
    line = capsys.readouterr().err.removeprefix("wbc: ").rstrip("\n")
    assert len(line) == LONGEST_LINE and line.endswith("...") is (length > LONGEST_LINE)


@pytest.fixture
def endable() -> Iterator[None]:
    """Signals that end a program; one that runs in the background may not have them."""
    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, signal.SIG_DFL) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.usefixtures("endable")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_all_blocks_and_ends_as_a_program_that_it_ends(
    number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[int] = []

    def run(*_: Any, **__: Any) -> None:
        try:
            signal.raise_signal(number)
        finally:
            left.append(1)

    monkeypatch.setattr(cli, "make_app", lambda words: run)
    with pytest.raises(SystemExit) as end:
        main([])
    assert end.value.code == 128 + number and left
    assert signal.getsignal(number) is signal.SIG_DFL, "as it was before"
    own = signal.signal(number, lambda *_: left.append(2))
    try:
        assert main([]) == RAN
        assert left == [1, 2, 1], "a program of one's own has its own"
    finally:
        signal.signal(number, own)


def test_commands_run_in_other_threads_and_with_words_of_the_process(
    monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    codes: list[int] = []
    monkeypatch.setattr(sys, "argv", ["wbc", "settings", "nothing_of_this_name"])
    thread = threading.Thread(target=lambda: codes.append(main()))
    thread.start()
    thread.join()
    assert codes == [BAD_INPUT] and "nothing_of_this_name" in capsys.readouterr().err


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Ctrl-C as in a program of a terminal; one that runs in the background may not have it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_a_trial_and_a_second_one_interrupts() -> None:
    stops: list[int] = []
    trial: Any = SimpleNamespace(stop=lambda: stops.append(1))
    before = signal.getsignal(signal.SIGINT)
    with ended_by_interrupt(trial):
        signal.raise_signal(signal.SIGINT)
        assert stops == [1]
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before

    def elsewhere() -> None:
        with ended_by_interrupt(trial):
            stops.append(2)

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert stops == [1, 2]


PLAIN = {"name": "s", "cells": {"a": {}}, "arms": {"b": {}}, "seeds": [0, 1, 2], "metric": "steps_done"}


def test_an_interrupted_sweep_says_what_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    from wbc.sim.studies.journal import Entry  # noqa: PLC0415
    from wbc.sim.studies.provenance import provenance  # noqa: PLC0415

    (tmp_path / "s.json").write_text(json.dumps(PLAIN))
    with Journal(tmp_path / "j.jsonl") as journal:
        for trial in list(Study.from_json(PLAIN).trials())[:2]:
            journal.add(Entry(dict(trial.plain), "done", {"steps_done": 1}, None, None, provenance()))

    def stop(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run_command, "run_trials", stop)
    assert (
        main(["study", "run", str(tmp_path / "s.json"), "--journal", str(tmp_path / "j.jsonl")])
        == INTERRUPTED
    )
    assert "2 of 3 trials are kept" in capsys.readouterr().err


def test_a_text_that_would_be_a_formula_is_none_in_a_spreadsheet() -> None:
    from wbc.app.commands.study import _cell  # noqa: PLC0415

    assert [_cell(value) for value in ("=1", " +1", "-1", "@a", "a=1", 3.5, None)] == [
        "'=1",
        "' +1",
        "'-1",
        "'@a",
        "a=1",
        3.5,
        None,
    ]


def test_streams_that_are_no_terminals_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert main(["settings", "nothing_of_this_name"]) == BAD_INPUT
