"""Small errors put into the code, one at a time, to see whether the tests notice them; run by hand.

    python tests/mutations.py                        # all of tests/mutations.txt; run again, it goes on where it was
    python tests/mutations.py --room walking         # core, walking, motion, tasks, feet or sim
    python tests/mutations.py --only stabilizer.py   # those whose file or change holds a text
    python tests/mutations.py --list                 # results so far, survivors first

Each is made in a copy of the tree, and the tests of its group run there until the first that fails. Results are lines
of JSON; a mutation that has one is not run again unless its line is removed.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_suffix(".txt")
RESULTS = ROOT / "build" / "mutations.jsonl"
SLOWEST = 120.0
"""Time after which the tests hang, s: that is noticed, too."""

OUTPUT = "output.txt"
"""Output of the last tests, in the copy of the tree."""

PRELOADED = ("numpy", "pinocchio", "coal", "proxsuite", "mujoco", "scipy.signal", "pydantic")


@dataclass(frozen=True)
class Mutation:
    """One change of one file.

    Attributes:
        file: Path in the repository.
        old: Text that occurs in the file exactly once.
        new: Text in its place.
        tests: Arguments of pytest.
    """

    file: str
    old: str
    new: str
    tests: str

    @property
    def room(self) -> str:
        parts = self.file.split("/")
        return parts[1] if parts[0] == "wbc" else parts[0]

    def __str__(self) -> str:
        return f"{self.file}: {self.old} => {self.new}"


def read_table(path: Path = TABLE) -> Iterator[Mutation]:
    file = tests = ""
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("@ "):
            file, _, tests = line[2:].partition("  ")
        elif line and not line.startswith("#"):
            old, _, new = line.partition(" => ")
            yield Mutation(file, old, new, tests)


def faults(mutations: Iterable[Mutation], root: Path = ROOT) -> list[str]:
    """Mutations that do not fit the code any more, each with what is wrong."""
    found = []
    for mutation in mutations:
        count = (root / mutation.file).read_text(encoding="utf-8").count(mutation.old)
        if count != 1:
            found.append(f"{mutation}: occurs {count} times")
        elif mutation.old == mutation.new or not mutation.new:
            found.append(f"{mutation}: changes nothing")
        found += [
            f"{mutation.file}: no {test}"
            for test in mutation.tests.split()
            if test.endswith(".py") and not (root / test).exists()
        ]
    return found


def copy_of_tree(to: Path) -> None:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True)
    for name in filter(None, listed.stdout.split("\0")):
        if not (name.startswith("docs/") or not (ROOT / name).exists()):
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name, follow_symlinks=False)


def preload() -> None:
    """Import what does not change, so that the forks of `passes` need not."""
    os.environ["OMP_NUM_THREADS"] = "1"
    for name in PRELOADED:
        importlib.import_module(name)


def passes(tests: str, tree: Path) -> bool:
    """Run tests in a tree, in a fork of this process, until the first that fails."""
    output = tree / OUTPUT
    child = os.fork()
    if child == 0:
        os.chdir(tree)
        sys.path.insert(0, str(tree))
        written = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(written, 1)
        os.dup2(written, 2)
        code = 3
        try:
            code = int(pytest.main(["-x", "-q", "-n0", "-p", "no:cacheprovider", *tests.split()]))
        except BaseException:
            traceback.print_exc()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    end = time.monotonic() + SLOWEST
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return False
        time.sleep(0.05)
    code = os.waitstatus_to_exitcode(status)
    if code in (3, 4, 5):
        raise SystemExit(f"pytest {tests} ended with {code}:\n{output.read_text()}")
    return code == 0  # 1: a test failed; 2: no import; below 0: a crash


def write(path: Path, text: str) -> None:
    """Write a module and forget its compiled form, which is told apart by seconds and size alone."""
    path.write_text(text, encoding="utf-8")
    Path(importlib.util.cache_from_source(str(path))).unlink(missing_ok=True)


def run(mutation: Mutation, tree: Path) -> str:
    path = tree / mutation.file
    before = path.read_text(encoding="utf-8")
    write(path, before.replace(mutation.old, mutation.new))
    try:
        return "survived" if passes(mutation.tests, tree) else "noticed"
    finally:
        write(path, before)


def results(path: Path) -> dict[Mutation, str]:
    if not path.exists():
        return {}
    entries = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    names = [field.name for field in dataclasses.fields(Mutation)]
    return {Mutation(**{name: entry[name] for name in names}): entry["result"] for entry in entries}


def summary(mutations: list[Mutation], known: dict[Mutation, str]) -> str:
    done = [mutation for mutation in mutations if mutation in known]
    lines = [f"survived  {mutation}" for mutation in done if known[mutation] == "survived"]
    for room in sorted({mutation.room for mutation in done}):
        here = [known[mutation] for mutation in done if mutation.room == room]
        lines.append(f"{room:<8} {here.count('noticed'):4d} of {len(here)} noticed")
    noticed = len(done) - sum(known[mutation] == "survived" for mutation in done)
    share = f", {100.0 * noticed / len(done):.1f} %" if done else ""
    return "\n".join(
        [*lines, f"{noticed} of {len(done)} noticed{share}; {len(mutations) - len(done)} not run"]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--room", choices=("core", "walking", "motion", "tasks", "feet", "sim"))
    parser.add_argument("--only", default="", metavar="TEXT", help="those whose file or change holds it")
    parser.add_argument("--results", type=Path, default=RESULTS, metavar="FILE")
    parser.add_argument("--list", action="store_true", help="run nothing")
    options = parser.parse_args()
    mutations = [m for m in read_table() if options.room in (None, m.room) and options.only in str(m)]
    if wrong := faults(mutations):
        raise SystemExit("\n".join(wrong))
    known = results(options.results)
    if not options.list:
        options.results.parent.mkdir(parents=True, exist_ok=True)
        sound: set[str] = set()
        with tempfile.TemporaryDirectory() as folder, options.results.open("a", encoding="utf-8") as log:
            preload()
            copy_of_tree(Path(folder))
            for mutation in mutations:
                if mutation in known:
                    continue
                if mutation.tests not in sound and not passes(mutation.tests, Path(folder)):
                    raise SystemExit(
                        f"{mutation.tests} fail without any mutation:\n{(Path(folder) / OUTPUT).read_text()}"
                    )
                sound.add(mutation.tests)
                start = time.monotonic()
                known[mutation] = result = run(mutation, Path(folder))
                entry = {"result": result, "seconds": round(time.monotonic() - start, 1)}
                print(
                    json.dumps(dataclasses.asdict(mutation) | entry, ensure_ascii=False), file=log, flush=True
                )
                print(f"{result:<9} {mutation}", flush=True)
    print(summary(mutations, known))


if __name__ == "__main__":
    main()
