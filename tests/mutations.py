"""Small errors put into the code, drawn at random, to see whether the tests of its folder notice them; run by hand.

    python tests/mutations.py --count 60 --seed 1      # of the whole package
    python tests/mutations.py --only core/estimation   # of the files whose path holds a text

Each changes one operator or one number in a copy of the tree; the tests of the folder run there until the first that
fails, then, if none does, the repeated beginnings of runs.
The same seed draws the same errors.
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

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("wbc/base", "wbc/core", "wbc/walking", "wbc/motion", "wbc/machine", "robots", "feet", "tasks", "sim")
WHOLE = ["tests/sim/test_repeatable.py"]
SLOWEST = 300  # s of CPU; tests that hang have noticed, too

SWAPS = {
    **{ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"},
    **{ast.Lt: ">", ast.Gt: "<", ast.LtE: ">", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="},
    **{ast.And: "or", ast.Or: "and"},
}


def parts(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr, str]]:
    """Pairs of neighbours of an operator that can be changed, with the new operator."""
    if isinstance(node, ast.BinOp) and type(node.op) in SWAPS:
        yield node.left, node.right, SWAPS[type(node.op)]
    elif isinstance(node, ast.AugAssign) and type(node.op) in SWAPS:
        yield node.target, node.value, f"{SWAPS[type(node.op)]}="
    elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in SWAPS:
        yield node.left, node.comparators[0], SWAPS[type(node.ops[0])]
    elif isinstance(node, ast.BoolOp) and len(node.values) == 2:
        yield node.values[0], node.values[1], SWAPS[type(node.op)]


def changes(text: bytes) -> Iterator[tuple[int, int, str]]:
    """Yield all changes of a module: first byte, last byte + 1, new text."""
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def place(line: int | None, column: int | None) -> int:
        return starts[(line or 1) - 1] + (column or 0)

    for node in ast.walk(ast.parse(text)):
        for left, right, new in parts(node):
            first, last = place(left.end_lineno, left.end_col_offset), place(right.lineno, right.col_offset)
            old = text[first:last].decode()
            if set(old) <= set(" +-*/<>=!andor"):  # no bracket or line break between the operands
                yield first, last, f" {new} "
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
            first = place(node.lineno, node.col_offset)
            yield first, first + (1 if isinstance(node.op, ast.USub) else 3), ""
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            first, last = place(node.lineno, node.col_offset), place(node.end_lineno, node.end_col_offset)
            yield first, last, repr(2 * node.value or 1)


def tests_of(room: str, file: Path) -> list[str]:
    """Tests of a room, first those that name the module of the file."""
    found = sorted((ROOT / "tests" / Path(room).name).rglob("test_*.py"))
    return [str(t.relative_to(ROOT)) for t in sorted(found, key=lambda t: file.stem not in t.read_text())]


def limit() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (SLOWEST, SLOWEST))


def passes(tests: list[str], tree: Path, *more: str) -> bool:
    environment = os.environ | {
        "PYTHONPATH": str(tree),
        "OMP_NUM_THREADS": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *more, *tests]
    try:
        done = subprocess.run(
            command,
            check=False,
            cwd=tree,
            env=environment,
            preexec_fn=limit,
            capture_output=True,
            timeout=10 * SLOWEST,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", metavar="TEXT", help="files whose path holds it")
    options = parser.parse_args()
    files = [
        (room, f) for room in ROOMS for f in sorted((ROOT / room).rglob("*.py")) if options.only in str(f)
    ]
    every = [(room, f, change) for room, f in files for change in changes(f.read_bytes())]
    drawn = random.Random(options.seed).sample(every, min(options.count, len(every)))
    counts = dict.fromkeys(("noticed", "later", "survived"), 0)
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(
            ROOT, tree, symlinks=True, ignore=shutil.ignore_patterns(".*", "__pycache__", "build")
        )
        for room, file, (first, last, new) in drawn:
            text, copy = file.read_bytes(), tree / file.relative_to(ROOT)
            copy.write_bytes(text[:first] + new.encode() + text[last:])
            word = "noticed"
            if passes(tests_of(room, file), tree):
                word = "survived" if passes(WHOLE, tree, "-m", "") else "later"
            copy.write_bytes(text)
            counts[word] += 1
            line, old = text[:first].count(b"\n") + 1, text[first:last].decode()
            where = text.splitlines()[line - 1].decode().strip()
            print(f"{word:<9}{file.relative_to(ROOT)}:{line}  {old!r} => {new!r}  in  {where}", flush=True)
    print(
        f"{counts['noticed']} of {len(drawn)} noticed by the tests of their folder, {counts['later']} more by "
        f"streams; {counts['survived']} survived"
    )


if __name__ == "__main__":
    main()
