"""Rebuild tables and figures of the pages from the journals in docs/journals: `python docs/tables.py [--check]`.

A page marks the place of a table, and this program writes what stands between the two comments:

    <!-- table fig5 from fig5.jsonl.xz --by amplitude --margin 0.5 -->
    <!-- end of table -->

The words are the name of a study, its journal (JSON lines, plain or compressed by xz) and options: `--metric`, `--by`,
`--margin`, `--seeds`, `--cell` and `--arm` of `wbc study table`, `--from` for the layouts from a seed on, and `--as`
for another kind of table:

    choice      `wbc study table --of choice`, with its `--chosen-by`: which arm is best on which ground, and what
                choosing it there is worth
    short       without how the walks of each ground ended; the completed ones of all grounds stand in a line
    table4      the study 'table4' beside the paper's table
    optimum     instead of a study its grounds, joined by a plus sign: the optima beside the paper's Table II, with the
                default law and wide bounds; `--law legacy` for the paper's law and bounds
    held-out    of the same the walks on held-out layouts alone
    folds       the data set that the walks label: accuracy of the paper's model under every split

A figure is drawn anew by `--figures`; it stands under `<!-- figure fig5 from fig5.jsonl.xz --as steps --to
images/fig5_steps.svg -->`, with `--as steps` or `--as differences`, or of optimisations `--as optimum`: J over the
stiffness on each ground.

Under each table stands the hash of the code that walked it, and how many of its walks there are; `--stale` names the
tables of another code than today's. `--pack FOLDER` compresses the journals of a folder into docs/journals, without
wall-clock timings and without what was scanned in single swings. `--held-out FOLDER` writes the studies that walk the
optima on held-out layouts, for `wbc study run`.
"""

from __future__ import annotations

import argparse
import json
import lzma
import re
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from wbc.app.commands.study.paper import BUDGET, EVALUATIONS, VALIDATIONS, WINDOWS
from wbc.core.files import read_json, write_text
from wbc.sim.studies.best_stiffness import labels, stiffness_table
from wbc.sim.studies.catalog import study_by_name
from wbc.sim.studies.intervals import share_text
from wbc.sim.studies.journal import Entry, read_journal
from wbc.sim.studies.paper.choice import choice
from wbc.sim.studies.paper.experiments import optimisation, table_four
from wbc.sim.studies.paper.optimization import OPTIMISATION_SEED, OptimisationSpec, Walked
from wbc.sim.studies.paper.optimum import TABLE_II, Optimum, optimum, table_two, validation, walked_points
from wbc.sim.studies.provenance import code_version
from wbc.sim.studies.stiffness_studies import DatasetSize, dataset, dataset_accuracy
from wbc.sim.studies.study import Study, study_entries
from wbc.sim.studies.study_table import StudyTable, study_table

DOCS = Path(__file__).parent
PLACE = re.compile(r"<!-- table (.+?) -->\n(.*?)<!-- end of table -->\n", re.DOTALL)
LEFT_OUT = ("features", "distance", "profile_error_m", "profile_error_as_believed_m")
"""Parts of each swing of a variable sole that packed journals do not have: what was scanned, not what was decided."""

FIGURE = re.compile(r"<!-- figure (.+?) -->\n", re.DOTALL)
CODE = re.compile(r"with the code `(\w+)`")
OPTIONS = (
    *("--metric", "--by", "--margin", "--seeds", "--from", "--cell", "--arm"),
    *("--chosen-by", "--as", "--to", "--law"),
)


class Mark:
    """Words of a mark: study, journal and options."""

    def __init__(self, words: str, journals: Path) -> None:
        self.words = words
        self.name, _, file, *rest = shlex.split(words)
        self.options: dict[str, list[str]] = {}
        for option, value in zip(rest[::2], rest[1::2], strict=True):
            if option not in OPTIONS:
                raise SystemExit(f"table {words}: no option {option}")
            self.options.setdefault(option, []).append(value)
        self.file = journals / self.name if self.name.endswith(".json") else None  # a study of its own
        path = journals / file
        if not path.is_file():
            raise SystemExit(f"table {words}: no journal {path}")
        self.entries = read_journal(path)

    def option(self, name: str) -> str | None:
        """Return the last value of an option; None if it is not given."""
        return self.options.get(name, [None])[-1]  # type: ignore[list-item]

    @cached_property
    def whole(self) -> Study:
        """The study with all its layouts."""
        study = study_by_name(self.name) if self.file is None else Study.from_json(read_json(self.file))
        return study.narrowed(self.options.get("--cell", ()), self.options.get("--arm", ()))

    @cached_property
    def study(self) -> Study:
        """The part of the study that the table is about: grounds and layouts with walks."""
        part = self.part(self.whole)
        walked = [trial for trial, entry in study_entries(part, self.entries, any_code=True) if entry]
        grounds, layouts = {trial.cell for trial in walked}, {trial.seed for trial in walked}
        return replace(
            part,
            cells=tuple(cell for cell in part.cells if cell.name in grounds) or part.cells,
            seeds=tuple(seed for seed in part.seeds if seed in layouts) or part.seeds,
        )

    def part(self, study: Study) -> Study:
        """Return the layouts of a study that the mark asks for."""
        seeds, first = self.option("--seeds"), int(self.option("--from") or 0)
        part = study.narrowed(seeds=None if seeds is None else int(seeds))
        return replace(part, seeds=tuple(seed for seed in part.seeds if seed >= first))

    def table(self) -> StudyTable:
        """Return the table of the study."""
        margin = self.option("--margin")
        return study_table(
            self.study,
            self.entries,
            metric=self.option("--metric"),
            by=self.options.get("--by", []),
            margin=None if margin is None else float(margin),
            any_code=True,
        )

    def optimised(self) -> Iterator[tuple[OptimisationSpec, list[Walked], Optimum]]:
        """Yield optimisation, walks and optimum of each of its grounds."""
        return _optimised(self.name.split("+"), self.option("--law") or "default", self.entries)

    def code(self, used: list[Entry]) -> str:
        """Return the code of some entries, which must be one."""
        codes = sorted({entry.version["code"] for entry in used})
        if len(codes) != 1:
            raise SystemExit(f"table {self.words}: its walks must be of one code, got {codes or 'none'}")
        return str(codes[0])


def made(words: str, journals: Path) -> str:
    """Return the table of a mark, with its caption."""
    mark = Mark(words, journals)
    kind = mark.option("--as") or "table"
    if kind in ("optimum", "held-out"):
        return _optima(mark)
    if kind == "folds":
        return _folds(mark)
    used = [entry for _, entry in study_entries(mark.study, mark.entries, any_code=True) if entry is not None]
    if kind == "choice":
        first = mark.option("--chosen-by")
        text = choice(
            mark.study,
            mark.entries,
            mark.options.get("--arm", ()),
            chosen_by=None if first is None else int(first),
            any_code=True,
        ).markdown()
    elif kind == "table4":
        text = table_four(mark.table())
    elif kind == "short":
        text = _short(mark.table())
    elif kind == "table":
        text = mark.table().markdown()
    else:
        raise SystemExit(f"table {words}: no kind of table {kind}")
    return (
        f"\n{text}\n\n*{_count(len(used), mark.whole.size)} of `{mark.name}`, {_code(mark.code(used))}*\n\n"
    )


def _count(walked: int, whole: int) -> str:
    return f"{walked:,} walks" if walked == whole else f"Partial: {walked:,} of {whole:,} walks"


def _short(table: StudyTable) -> str:
    """Return means and differences, and of all grounds together the completed walks."""
    parts = []
    for arm in table.study.arms:
        outcomes = table.by_name[table.rows[-1], arm].outcomes
        total = sum(outcomes.values())
        if total:
            parts.append(f"{arm} {share_text(outcomes.get('completed', 0), total)}")
    ended = f"Of all walks: {'; '.join(parts)}."
    return "\n\n".join([table.markdown().partition("\n\nHow they ended")[0], ended])


def _code(code: str) -> str:
    return f"with the code `{code}`. (`python docs/tables.py`)"


def _folds(mark: Mark) -> str:
    """Return how well the paper's model predicts the labels of a data set, by each split of it."""
    full = dataset(DatasetSize(evaluations=EVALUATIONS))
    used = list(mark.entries.values())
    study = full.narrowed(arms={f"{entry.spec['stiffness']:g}" for entry in used})
    table = stiffness_table(study, labels(study, mark.entries, any_code=True), windows=WINDOWS)
    walks = _count(len(used), full.size)
    return f"\n{dataset_accuracy(table)}\n\n*{walks} of `dataset`, {_code(mark.code(used))}*\n\n"


def _optimised(
    grounds: Iterable[str], law: str, entries: Mapping[str, Entry]
) -> Iterator[tuple[OptimisationSpec, list[Walked], Optimum]]:
    """Yield optimisation, walks and optimum of each ground."""
    for ground in grounds:
        spec = optimisation(ground, law)
        known = walked_points(spec, entries, any_code=True)
        yield spec, known, optimum(known, spec.bounds)


def _optima(mark: Mark) -> str:
    """Return the optima of some grounds beside the paper's Table II, and their walks on held-out layouts."""
    found = {spec: best for spec, _, best in mark.optimised()}
    grounds = {spec.ground: each for spec, each in found.items()}
    judged = {k: entry for k, entry in mark.entries.items() if entry.spec["seed"] < OPTIMISATION_SEED}
    study = validation(found, VALIDATIONS).narrowed(arms=mark.options.get("--arm", ()))
    table = study_table(mark.part(study), judged, any_code=True) if judged else None
    if mark.option("--as") == "held-out":
        if table is None:
            raise SystemExit(f"table {mark.words}: no walks on held-out layouts")
        cells = [table.by_name[table.rows[-1], arm] for arm in table.study.arms]
        walks = sum(sum(cell.outcomes.values()) for cell in cells)
        caption = f"*{_count(walks, table.study.size)}, {_code(mark.code(list(judged.values())))}*"
        return f"\n{_short(table)}\n\n{caption}\n\n"
    text = table_two(grounds)
    if table is not None:
        text += f"\n\nOn held-out layouts, each k with the best gains, {_short(table)}"
    used = [entry for entry in mark.entries.values() if entry.spec.get("terrain") in grounds]
    walks = ", ".join(f"{each.walks} on `{ground}`" for ground, each in grounds.items())
    partial = "Partial: " if any(each.walks < BUDGET for each in found.values()) else ""
    caption = f"*{partial}{walks} of {BUDGET} walks a ground, {_code(mark.code(used))}*"
    return f"\n{text}\n\n{caption}\n\n"


def draw(words: str, folder: Path) -> Path:
    """Draw the figure of a mark."""
    from wbc.app.plot.experiments import differences_figure, steps_figure  # noqa: PLC0415 - slow to import
    from wbc.app.plot.optimization import stiffness_figure  # noqa: PLC0415
    from wbc.core.files import save_figure  # noqa: PLC0415

    mark = Mark(words, folder / "journals")
    kinds = {
        "steps": lambda: steps_figure(mark.table()),
        "differences": lambda: differences_figure(mark.table()),
        "optimum": lambda: stiffness_figure(*_by_ground(mark)),
    }
    kind, to = mark.option("--as"), mark.option("--to")
    if kind not in kinds or to is None:
        raise SystemExit(f"figure {words}: needs --as {', '.join(kinds)}, and --to")
    save_figure(kinds[kind](), folder / to, dpi=110.0)
    return folder / to


def _by_ground(mark: Mark) -> tuple[dict[str, list[Walked]], dict[str, Optimum]]:
    """Return walks and optima of a mark by ground."""
    all_of_it = list(mark.optimised())
    return {s.ground: known for s, known, _ in all_of_it}, {s.ground: best for s, _, best in all_of_it}


def rebuilt(text: str, journals: Path) -> str:
    """Return a page with its tables made again."""
    return PLACE.sub(
        lambda mark: f"<!-- table {mark[1]} -->\n{made(mark[1], journals)}<!-- end of table -->\n", text
    )


def stale(text: str) -> list[str]:
    """Return the tables of a page that another code than today's has walked."""
    marks = ((mark[1], CODE.search(mark[2])) for mark in PLACE.finditer(text))
    return [words for words, code in marks if code is None or code[1] != code_version()]


def pages(folder: Path = DOCS) -> Iterator[Path]:
    """Yield the pages that have tables from journals."""
    yield from (
        page for page in sorted(folder.glob("*.md")) if PLACE.search(page.read_text(encoding="utf-8"))
    )


def pack(source: Path, folder: Path = DOCS) -> list[Path]:
    """Compress the journals of a folder: one line a trial, without the wall-clock timings and `LEFT_OUT`."""
    packed = []
    (folder / "journals").mkdir(exist_ok=True)
    for path in sorted(source.glob("*.jsonl")):
        entries: Mapping[str, Entry] = read_journal(path)
        lines = [_packed(entry).line() for entry in entries.values()]
        target = folder / "journals" / f"{path.name}.xz"
        target.write_bytes(lzma.compress(b"".join(lines), preset=9 | lzma.PRESET_EXTREME))
        packed.append(target)
    return packed


def _packed(entry: Entry) -> Entry:
    """Return an entry as a packed journal has it."""
    result = entry.result
    if result is not None and result.get("stiffness"):
        swings = [{**swing, **dict.fromkeys(LEFT_OUT)} for swing in result["stiffness"]]
        result = {**result, "stiffness": swings}
    return replace(entry, clock=None, result=result)


def held_out(target: Path, folder: Path = DOCS) -> list[Path]:
    """Write the studies that walk the optima of the journals on held-out layouts."""
    written = []
    for law, name in (("default", "optimize"), ("legacy", "optimize_legacy")):
        path = folder / "journals" / f"{name}.jsonl.xz"
        if not path.is_file():
            continue
        entries = read_journal(path)
        walked = {entry.spec["terrain"] for entry in entries.values()}
        grounds = [ground for ground in TABLE_II if ground in walked]
        found = {spec: best for spec, _, best in _optimised(grounds, law, entries)}
        written.append(target / f"{name}_held_out.json")
        write_text(written[-1], json.dumps(validation(found, VALIDATIONS).to_json(), indent=1) + "\n")
    return written


def main(words: list[str], folder: Path = DOCS) -> int:
    """Rebuild, check, list, draw or pack; return 1 if a page differs from its journals or a table is stale."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    one = parser.add_mutually_exclusive_group()
    one.add_argument(
        "--check", action="store_true", help="change nothing; 1 if a page differs from its journals"
    )
    one.add_argument("--stale", action="store_true", help="list tables of other code than today's")
    one.add_argument("--figures", action="store_true", help="draw the figures")
    one.add_argument("--pack", type=Path, metavar="FOLDER", help="compress the journals of a folder")
    one.add_argument("--held-out", type=Path, metavar="FOLDER", help="write the studies of the optima there")
    options = parser.parse_args(words)
    if options.pack is not None:
        for path in pack(options.pack, folder):
            print(f"{path.name}: {path.stat().st_size / 1024:.0f} KiB")
        return 0
    if options.held_out is not None:
        print("\n".join(str(path) for path in held_out(options.held_out, folder)))
        return 0
    bad = 0
    for page in pages(folder):
        text = page.read_text(encoding="utf-8")
        if options.stale:
            for table in stale(text):
                print(f"{page.name}: {table} is stale")
                bad = 1
            continue
        if options.figures:
            for mark in FIGURE.finditer(text):
                print(draw(mark[1].replace("\n", " "), folder))
            continue
        new = rebuilt(text, folder / "journals")
        if new != text and options.check:
            print(f"{page.name} differs from its journals: python docs/tables.py")
            bad = 1
        elif new != text:
            page.write_text(new, encoding="utf-8")
            print(f"{page.name} rebuilt")
    return bad


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
