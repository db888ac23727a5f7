"""Hostile words and files for the commands, and the process of its own in which commands meet them.

A command must end in a result or in one line, within bounded memory and time. The bound of the memory is relative to
the size of the process that it limits: that of the tests goes on without one.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import resource
import select
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np

MEMORY, SECONDS, SILENCE = 4 * 2**30, 10.0, 120.0
"""Address space beside the imported library's, bytes; processor time of a command, s; time until it is killed, s."""

COMMANDS: dict[str, list[str]] = {
    "walk": ["--distance", "0.1"],
    "stand": ["--seconds", "0.05"],
    "foot": ["press", "--settle", "0.1", "--hold", "0.1"],
    "terrain": ["stones"],
    "robots": ["hrp4_class"],
    "study show": ["study.json"],
    "study table": ["study.json", "--journal", "journal.jsonl"],
    "plot": ["log.arrow", "balance", "-o", "new.png"],
}
"""Command → arguments with which it ends soon, beside the one that is hostile."""

READERS = {
    "ground.npy": "terrain image --param source={} --param metres_per_pixel=0.1 --length 0.5 --width 0.3",
    "ground.png": "terrain image --param source={} --param metres_per_pixel=0.1 --length 0.5 --width 0.3",
    "ground.csv": "terrain image --param source={} --param metres_per_pixel=0.1 --length 0.5 --width 0.3",
    "motion.npz": "motion check {}",
    "motion.csv": "motion check {}",
    "person.bvh": "motion check {}",
    "walk.toml": "walk --spec {}",
    "robot.toml": "robots check {}",
    "robot.xml": "robots check {}",
    "robot.urdf": "robots check {} --left left_sole --right right_sole",
    "log.arrow": "plot {} balance com/estimated -o new.png",
    "study.json": "study show {}",
    "journal.jsonl": "study table study.json --journal {} --any-code",
}
"""Valid file → command that reads it."""


def words_of(command: str, file: Path) -> list[str]:
    """Return the words of a command with the file in place of `{}`; its path may hold spaces."""
    return [word.format(file) for word in command.split()]


WORDS = (
    *("-1", "0", "1", "0.5", "1e300", "1e-300", "1e9", "nan", "-inf", "text", "", " ", "none", "x" * 10_000, "../.."),
    *("\ud800", "a\0b", "1" * 5000, "1_000", "٣", "1,2,3", "=", "a=", "=1", "seed=nan", "nothing=1", "deep.json"),
    *("empty.json", "/proc/self/mem", "/nowhere/at/all.json", "."),
)  # fmt: skip
PIECES = (
    b"",
    b"\0",
    b"\xff\xfe",
    b"PK\x03\x04",
    b"[" * 2000,
    b"<",
    b'"',
    b"\n",
    b",",
    b"nan",
    b"-1",
    b"1e308",
    b"[]",
)


VALUES = (
    *(None, True, -1, 0, 2.5, 1e300, float("nan"), 10**400, "", "text", "\x1b[31m", "x" * 10_000),
    *([], {}, [[]], [None], {"a": 1}, [1e300] * 7, ["left", "left"]),
)
"""Values that take the place of a value of another kind or range."""


def options(words: str) -> list[str]:
    """Return the options and the first word of a command that take a value; those that open a page are left out."""
    from wbc.app.cli import make_app  # noqa: PLC0415

    command = make_app(None)
    for word in words.split():
        command = command[word]
    found = [a for a in command.assemble_argument_collection() if a.parse and a.name != "*"]
    pages = ("--port", "--cluster")
    return [a.name for a in found if bool not in (a.hint, *get_args(a.hint)) and a.name not in pages]


def line(words: str, option: str, value: str) -> list[str]:
    """Return a command line in which an option, or the word that begins it, is hostile."""
    usual = COMMANDS[words]
    if not option.startswith("-"):
        return [*words.split(), value, *usual[1:]]
    spared = [i for i, word in enumerate(usual) if word == option or (i and usual[i - 1] == option)]
    return [*words.split(), *(w for i, w in enumerate(usual) if i not in spared), f"{option}={value}"]


def mutate(data: bytes, seed: int) -> bytes:
    """Return data of which some bits, numbers or pieces are others."""
    rng, changed = np.random.default_rng(seed), bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        start = int(rng.integers(min(len(changed), 200) if rng.integers(2) else len(changed)))
        place = slice(start, start + int(rng.geometric(0.02)))
        numbers = list(re.finditer(rb"-?\d[\d.e+-]*", changed)) if b"\0" not in data else []
        match int(rng.integers(6 if numbers else 4)):
            case 0:
                changed[start] ^= 1 << int(rng.integers(8))
            case 1:
                del changed[place if rng.integers(2) else slice(start, None)]
            case 2:
                changed[place] = PIECES[int(rng.integers(len(PIECES)))]
            case 3:
                changed[start:start] = bytes(changed[place]) * int(rng.integers(1, 20))
            case _:
                number = numbers[int(rng.integers(len(numbers)))]
                changed[number.start() : number.end()] = PIECES[int(rng.integers(len(PIECES)))]
        changed = changed or bytearray(b"\0")
    return bytes(changed)


def damaged(name: str, data: bytes, seed: int) -> bytes:
    """Return a damaged file; in every other one that holds JSON a value is another one, and its sums are right."""
    kept = {"study.json": _of_json, "journal.jsonl": _of_journal, "log.arrow": _of_log}
    if name not in kept or seed % 2:
        return mutate(data, seed)
    return kept[name](data, np.random.default_rng(seed))


def _of_json(data: bytes, rng: np.random.Generator) -> bytes:
    return json.dumps(_with_other_value(json.loads(data), rng)).encode()


def _of_journal(data: bytes, rng: np.random.Generator) -> bytes:
    from wbc.sim.studies.journal import canonical  # noqa: PLC0415 - a process of its own measures its memory

    return canonical(_with_other_value(json.loads(data), rng)).encode() + b"\n"


def _of_log(data: bytes, rng: np.random.Generator) -> bytes:
    import pyarrow as pa  # noqa: PLC0415
    from pyarrow import ipc  # noqa: PLC0415

    table, made = ipc.open_file(pa.BufferReader(data)).read_all(), pa.BufferOutputStream()
    header = _with_other_value(json.loads(table.schema.metadata[b"wbc"]), rng)
    table = table.replace_schema_metadata({b"wbc": json.dumps(header).encode()})
    with ipc.new_file(made, table.schema) as file:
        file.write_table(table)
    return bytes(made.getvalue())


def _with_other_value(value: Any, rng: np.random.Generator) -> Any:
    """Return JSON with another value in place of one of its values, or without it."""
    keys = (
        list(value) if isinstance(value, dict) else list(range(len(value))) if isinstance(value, list) else []
    )
    if not keys or rng.random() < 0.1:
        return VALUES[int(rng.integers(len(VALUES)))]
    key = keys[int(rng.integers(len(keys)))]
    if rng.random() < 0.1:
        del value[key]
    else:
        value[key] = _with_other_value(value[key], rng)
    return value


class Commands:
    """A process that runs command lines in a folder, one after the other; one that dies is started anew."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._process: subprocess.Popen[str] | None = None

    def __call__(
        self, words: Sequence[str], *, refusable: bool = True, acceptable: bool = True
    ) -> str | None:
        """Run a command; return what is wrong with its end, None for a result or a refusal, where they may be."""
        if self._process is None:
            command = [sys.executable, __file__]
            pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            self._process = subprocess.Popen(command, cwd=self.folder, **pipes)
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        print(json.dumps(list(words)), file=process.stdin, flush=True)
        ready = select.select([process.stdout], [], [], SILENCE)[0]
        answer = process.stdout.readline() if ready else ""
        if not answer:
            self.close()
            return f"ended by {process.returncode}" if ready else "hangs"
        code, said = json.loads(answer)
        told = [text for text in said.splitlines() if text.startswith("wbc: ")]
        if code == "began" or (code == 0 and "Traceback" not in said):
            return None if acceptable else f"is accepted: {said[-1000:]}"
        good = (
            refusable
            and (code in (1, 2) if acceptable else code == 2 and said.startswith("wbc: "))
            and len(told) == 1
            and len(told[0]) < 1500
            and "Traceback" not in said
        )
        return None if good else f"exit {code}: {said[-1000:]}"

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            process, self._process = self._process, None
            process.kill()
            with process:
                pass


class Began(BaseException):
    """Long work has begun: the input was accepted."""


def _serve() -> None:
    """Run the commands of standard input, within bounds, and answer each with its exit code and what it said."""
    from wbc.app import cli  # noqa: PLC0415
    from wbc.sim.trial.trial import Trial  # noqa: PLC0415

    def begin(*_: Any, **__: Any) -> Any:
        raise Began

    def late(*_: Any) -> None:
        raise TimeoutError("never ends")

    Trial.run = begin  # type: ignore[assignment,method-assign]
    signal.signal(signal.SIGPROF, late)
    size = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
    with os.fdopen(os.dup(1), "w") as answers:
        for asked in sys.stdin:
            said = io.StringIO()
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            try:
                with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
                    code: int | str = cli.main(json.loads(asked))
            except Began:
                code = "began"
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            print(json.dumps([code, said.getvalue()]), file=answers, flush=True)


if __name__ == "__main__":
    _serve()
