"""Small errors put into the code, drawn at random, to see whether the default tests notice them; run by hand.

    python tests/mutations.py core                        # 40 errors of a room, or of folders of this name
    python tests/mutations.py sim feet --count 60 --seed 2
    python tests/mutations.py core --kinds number         # constants are doubled

Each error changes one place in a copy of the tree: an operator of arithmetic, a comparison, a sign, or the seed of
random draws. Those of the room's tests that run through this line, as a run with coverage (needs pytest-cov) has found,
run there until the first fails; then those that run through the module, as a line that runs once, for what is kept, is
covered by the first test alone. The same seed draws the same errors. Errors that change nothing, or nothing that a
test could ask for, stand in survivors.txt with the reason.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from coverage import CoverageData

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("wbc", "robots", "feet", "tasks", "sim")
KINDS = ("arithmetic", "comparison", "seed", "number")
SLOWEST = 300  # s of CPU; tests that hang have noticed, too
LARGEST = 6 << 30  # bytes of memory; a loop that an error makes endless may fill that of the machine
MOST = 80  # tests of one run, those of the room first

ARITHMETIC = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
COMPARISON = {
    **{ast.Lt: ">", ast.Gt: "<", ast.LtE: ">", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="},
    **{ast.And: "or", ast.Or: "and"},
}
SEEDED = ("default_rng", "SeedSequence", "RandomState")


class Mutation(NamedTuple):
    """One error: a kind, first byte and last byte + 1 in the file, and the new text."""

    kind: str
    first: int
    last: int
    new: str


def parts(node: ast.AST) -> Iterator[tuple[str, ast.expr, ast.expr, str]]:
    """Pairs of neighbours of an operator that can be changed, with the kind and the new operator."""
    if isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
        yield "arithmetic", node.left, node.right, ARITHMETIC[type(node.op)]
    elif isinstance(node, ast.AugAssign) and type(node.op) in ARITHMETIC:
        yield "arithmetic", node.target, node.value, f"{ARITHMETIC[type(node.op)]}="
    elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in COMPARISON:
        yield "comparison", node.left, node.comparators[0], COMPARISON[type(node.ops[0])]
    elif isinstance(node, ast.BoolOp) and len(node.values) == 2:
        yield "comparison", node.values[0], node.values[1], COMPARISON[type(node.op)]


def mutations(text: bytes) -> Iterator[Mutation]:
    """Yield all errors of a module."""
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def place(line: int | None, column: int | None) -> int:
        return starts[(line or 1) - 1] + (column or 0)

    tree = ast.parse(text)
    annotations = [
        node.annotation for node in ast.walk(tree) if getattr(node, "annotation", None) is not None
    ]
    notes = {id(inner) for annotation in annotations for inner in ast.walk(annotation)}
    for node in ast.walk(tree):
        if id(node) in notes:  # unions of types are no arithmetic
            continue
        for kind, left, right, new in parts(node):
            first, last = place(left.end_lineno, left.end_col_offset), place(right.lineno, right.col_offset)
            old = text[first:last].decode()
            if set(old) <= set(" +-*/<>=!andor"):  # no bracket or line break between the operands
                yield Mutation(kind, first, last, f" {new} ")
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
            first = place(node.lineno, node.col_offset)
            sign = isinstance(node.op, ast.USub)
            yield Mutation("arithmetic" if sign else "comparison", first, first + (1 if sign else 3), "")
        elif isinstance(node, ast.Call) and node.args and ast.unparse(node.func).endswith(SEEDED):
            seed = node.args[0]
            first, last = place(seed.lineno, seed.col_offset), place(seed.end_lineno, seed.end_col_offset)
            yield Mutation("seed", first, last, "0")
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            first, last = place(node.lineno, node.col_offset), place(node.end_lineno, node.end_col_offset)
            yield Mutation("number", first, last, repr(2 * node.value or 1))


def package_file(file: Path) -> Path:
    """Return the path of a module below wbc/, as Python imports it."""
    relative = file.relative_to(ROOT)
    return relative if relative.parts[0] == "wbc" else Path("wbc") / relative


class Covering:
    """Tests that run through a line, from a run of the rooms' default tests with coverage."""

    def __init__(self, data: Path, tree: Path) -> None:
        self._data = CoverageData(str(data))
        self._data.read()
        self._files = {str((tree / name).resolve()): name for name in self._data.measured_files()}
        self._tree = tree

    def tests(self, file: Path, lines: range, room: str, draws: random.Random) -> Iterator[list[str]]:
        """Yield the tests of some lines, then further ones of the whole module; those of the room if there are none."""
        name = self._files.get(str((self._tree / file.relative_to(ROOT)).resolve()))
        by_line = self._data.contexts_by_lineno(name) if name is not None else {}
        past: set[str] = set()
        for some in (lines, by_line):
            found = {test.rpartition("|")[0] for line in some for test in by_line.get(line, ()) if test}
            tests = sorted(found - past)
            draws.shuffle(tests)
            tests = sorted(tests, key=lambda test: f"tests/{room}/" not in test)
            past |= {*tests}
            for first in range(0, len(tests), MOST):
                yield tests[first : first + MOST]
        if not past:
            yield [f"tests/{room}"]


def limit() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (SLOWEST, SLOWEST))
    resource.setrlimit(resource.RLIMIT_DATA, (LARGEST, LARGEST))


def pytest_in(tree: Path, arguments: list[str], timeout: float | None = 10 * SLOWEST) -> int:
    """Run pytest in a tree and return its exit status; 1 for a run that hangs."""
    environment = os.environ | {
        "PYTHONPATH": str(tree),
        "OMP_NUM_THREADS": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    limited = None if timeout is None else limit
    try:
        return subprocess.run(
            command,
            check=False,
            cwd=tree,
            env=environment,
            preexec_fn=limited,
            capture_output=True,
            timeout=timeout,
        ).returncode
    except subprocess.TimeoutExpired:
        return 1


def cover(tree: Path, data: Path, rooms: list[str]) -> None:
    """Run the default tests of some rooms in a tree with coverage, and keep which test ran which line."""
    settings = tree / ".coveragerc"
    sources = "\n    ".join(PACKAGES)
    settings.write_text(
        f"[run]\ndata_file = {data}\nsource =\n    {sources}\nrelative_files = true\n", encoding="utf-8"
    )
    options = ["-n", "2", "--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report="]
    folders = [f"tests/{room}" for room in rooms if (tree / "tests" / room).is_dir()]
    failed = pytest_in(tree, options + (folders if len(folders) == len(rooms) else []), timeout=None)
    if not data.is_file():
        raise SystemExit("the run with coverage left no data; is pytest-cov installed?")
    if failed:
        print("tests fail as they are: what they notice means nothing", flush=True)


def reasons() -> dict[tuple[str, str], str]:
    """Return (file, changed line) → the reason why no test notices the error."""
    found = {}
    for line in Path(__file__).with_name("survivors.txt").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            file, _, rest = line.partition(" | ")
            text, _, reason = rest.rpartition(" | ")  # a line may have a " | " of its own
            found[file.strip(), text.strip()] = reason.strip()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "rooms", nargs="+", metavar="ROOM", help="a room, such as core, else folders or files of a name"
    )
    parser.add_argument("--count", type=int, default=40, help="errors a room, default %(default)s")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", default="arithmetic,comparison,seed", help=f"of {', '.join(KINDS)}")
    parser.add_argument(
        "--coverage",
        type=Path,
        help="file that keeps the run with coverage, for a next call with the same rooms",
    )
    options = parser.parse_args()
    kinds = options.kinds.split(",")
    if not set(kinds) <= set(KINDS):
        parser.error(f"kinds are {', '.join(KINDS)}, got '{options.kinds}'")
    files = sorted(
        {f for package in PACKAGES for f in (ROOT / package).rglob("*.py") if "__pycache__" not in f.parts}
    )
    excused = reasons()
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(
            ROOT, tree, symlinks=True, ignore=shutil.ignore_patterns(".*", "__pycache__", "build")
        )
        data = options.coverage.resolve() if options.coverage else Path(folder) / "coverage"
        if not data.is_file():
            cover(tree, data, options.rooms)
        covering = Covering(data, tree)
        for room in options.rooms:
            own = [f for f in files if package_file(f).parts[1] == room]
            chosen = own or [f for f in files if room in package_file(f).parts]
            every = [(f, m) for f in chosen for m in mutations(f.read_bytes()) if m.kind in kinds]
            if not every:
                parser.error(f"no file of '{room}' has an error to make")
            draws = random.Random(options.seed)
            counts = dict.fromkeys(("noticed", "excused", "survived"), 0)
            for file, (_, first, last, new) in draws.sample(every, min(options.count, len(every))):
                text, copy = file.read_bytes(), tree / file.relative_to(ROOT)
                changed = text[:first] + new.encode() + text[last:]
                line = text[:first].count(b"\n") + 1
                after = changed.splitlines()[line - 1].decode().strip()
                lines = range(line, text[:last].count(b"\n") + 2)
                copy.write_bytes(changed)
                selection = tree / "selection.txt"
                survived = True
                for tests in covering.tests(file, lines, room, random.Random(options.seed)):
                    selection.write_text("\n".join(tests), encoding="utf-8")
                    survived = survived and pytest_in(tree, ["-x", f"@{selection}"]) == 0
                copy.write_bytes(text)
                word = "noticed"
                if survived:
                    word = "excused" if (str(file.relative_to(ROOT)), after) in excused else "survived"
                counts[word] += 1
                print(f"{word:<9}{file.relative_to(ROOT)}:{line} | {after}", flush=True)
            print(f"{room}: " + ", ".join(f"{count} {word}" for word, count in counts.items()), flush=True)


if __name__ == "__main__":
    main()
