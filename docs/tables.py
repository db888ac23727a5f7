"""Tables and figures of the journals: `python docs/tables.py` writes docs/journals/tables.md, `--figures` draws.

`TABLES` names the tables of studies (of the catalog, of a file beside the journals, or of a hypothesis) and journals,
with options of `wbc study table`; `FIGURES` those of the pages.
`--pack FOLDER` compresses the journals of a folder into docs/journals, without wall-clock timings and without what was
scanned in single swings. `--held-out FOLDER` writes the studies that walk the optima on held-out layouts, for
`wbc study run`. Walks of version 8 and before are those of grounds with a sharp edge and of a law that was called
"legacy" then: the studies are changed to theirs.
"""

from __future__ import annotations

import argparse
import json
import lzma
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from wbc.core.files import read_json, write_text
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.comparison import candidates, compare, comparison_table
from wbc.sim.studies.best_stiffness import labels, stiffness_table
from wbc.sim.studies.catalog import study_by_name
from wbc.sim.studies.journal import Entries, Entry, read_journal
from wbc.sim.studies.paper.choice import choice
from wbc.sim.studies.paper.experiments import TABLE_IV, authority_heights
from wbc.sim.studies.paper.optimization import BOUNDS, OPTIMISATION_SEED, OptimisationSpec, Walked
from wbc.sim.studies.paper.optimum import TABLE_II, Optimum, optimum, table_two, validation, walked_points
from wbc.sim.studies.stiffness_studies import DatasetSize, dataset
from wbc.sim.studies.study import Study, cell_name, merged, study_entries
from wbc.sim.studies.study_table import StudyTable, study_table

DOCS = Path(__file__).parent
HYPOTHESES = DOCS.parent / "sim" / "studies" / "data" / "hypotheses"
BUDGET, VALIDATIONS = 400, 20
"""Walks of an optimisation on one ground, and seeds of its validation."""

EVALUATIONS, WINDOWS = 50, 3
"""Stiffnesses of the data set, and windows of each of its grounds."""

TABLE_IV_STEPS: Mapping[str, tuple[tuple[int, int, int], ...]] = {
    "stones": ((20, 6, 6), (22, 7, 7), (22, 22, 7), (22, 22, 8)),
    "roof_tiles": ((8, 7, 5), (22, 8, 9), (22, 9, 12), (22, 22, 16)),
    "stone_bricks": ((8, 6, 3), (22, 5, 4), (22, 6, 6), (22, 22, 6)),
    "small_stones": ((9, 7, 6), (13, 9, 7), (22, 13, 7), (22, 22, 7)),
    "large_floor_tiles": ((20, 8, 5), (22, 12, 6), (22, 19, 6), (22, 22, 7)),
}
"""Steps of 22 in the paper's Table IV, one walk each: variable, soft, flat, at the heights of `TABLE_IV`."""

LEFT_OUT = ("features", "distance", "profile_error_m", "profile_error_as_believed_m")
"""Parts of each swing of a variable sole that packed journals do not have: what was scanned, not what was decided."""

ALIKE = "4c57d45761ee+d39da6122a0a"
"""Codes of the walks on fixed soles: walks of the second, repeated by the first, were the same to the bit."""

GROUNDS = "+".join(TABLE_II)
TABLES = (
    ("authority", "authority.jsonl.xz", "--margin 0.5"),
    ("damping", "authority.jsonl.xz", "--margin 0.5"),
    ("authority", "authority.jsonl.xz", "--as choice"),
    ("authority", "authority.jsonl.xz", "--as choice --chosen-by 20"),
    ("authority_ramp", "hypotheses.jsonl.xz", f"--margin 0.5 --codes {ALIKE}"),
    ("authority_ramp", "hypotheses.jsonl.xz", f"--as choice --chosen-by 10 --codes {ALIKE}"),
    ("learnt", "oracle.jsonl.xz", "--margin 0.5"),
    ("extremes", "extremes.jsonl.xz", "--margin 0.5"),
    ("table4", "table4.jsonl.xz", "--as table4"),
    ("table4", "table4.jsonl.xz", "--by terrain --margin 0.5"),
    ("table4_frizza", "table4_frizza.jsonl.xz", "--as table4"),
    ("table4_frizza", "table4_frizza.jsonl.xz", "--by terrain --margin 0.5"),
    ("fig5", "fig5.jsonl.xz", "--by amplitude --margin 0.5"),
    ("fig5_frizza", "fig5_frizza.jsonl.xz", "--by amplitude --margin 0.5"),
    ("flat+stones+cylinder_obstacles+roof_tiles", "optimize_legacy.jsonl.xz", "--as optimum --law no_bias"),
    (GROUNDS, "optimize.jsonl.xz", "--as optimum"),
    (GROUNDS, "optimize.jsonl.xz", '--as held-out --from 110 --arm best --arm "usual gains, k 80"'),
    ("dataset", "dataset.jsonl.xz", "--as folds"),
)
"""Study (a name, that of a file, or grounds of an optimisation), journal, options."""

FIGURES = (
    ("authority_ramp", "hypotheses.jsonl.xz", "--as risks", "images/risks.png"),
    (
        "authority_ramp",
        "hypotheses.jsonl.xz",
        "--as differences --margin 0.5",
        "images/stiffness_differences.png",
    ),
    ("fig5_frizza", "fig5_frizza.jsonl.xz", "--as steps", "images/fig5_frizza_steps.png"),
    (GROUNDS, "optimize.jsonl.xz", "--as optimum", "images/optima.png"),
)
"""The same, and the picture."""

OPTIONS = (
    "--metric",
    "--by",
    "--margin",
    "--seeds",
    "--from",
    "--cell",
    "--arm",
    "--chosen-by",
    "--as",
    "--law",
    "--codes",
)


class Mark:
    """Study, journal and options of a table."""

    def __init__(self, name: str, file: str, options: str, journals: Path) -> None:
        self.name, self.words, rest = name, f"{name} from {file} {options}", shlex.split(options)
        self.options: dict[str, list[str]] = {}
        for option, value in zip(rest[::2], rest[1::2], strict=True):
            if option not in OPTIONS:
                raise SystemExit(f"table {self.words}: no option {option}")
            self.options.setdefault(option, []).append(value)
        places = (journals / f"{self.name}.json", HYPOTHESES / f"{self.name}.json")
        self.file = next((each for each in places if each.is_file()), None)  # a study of its own
        path = journals / file
        if not path.is_file():
            raise SystemExit(f"table {self.words}: no journal {path}")
        self.journal = read_journal(path)
        self.ramp = _ramp(self.journal)

    @cached_property
    def entries(self) -> Mapping[str, Entry]:
        """The walks of the journal as of this code."""
        return self.journal.as_own()

    def option(self, name: str) -> str | None:
        """Return the last value of an option; None if it is not given."""
        return self.options.get(name, [None])[-1]  # type: ignore[list-item]

    @cached_property
    def whole(self) -> Study:
        """The study with all its layouts."""
        study = Study.from_json(read_json(self.file)) if self.file is not None else study_by_name(self.name)
        study = replace(study, base=merged(study.base, {"terrain_params": self.ramp}))
        return study.narrowed(self.options.get("--cell", ()), self.options.get("--arm", ()))

    @cached_property
    def study(self) -> Study:
        """The part of the study that the table is about: grounds and layouts with walks."""
        part = self.part(self.whole)
        walked = [trial for trial, entry in study_entries(part, self.entries) if entry]
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
        )

    def optimised(self) -> Iterator[tuple[OptimisationSpec, list[Walked], Optimum]]:
        """Yield optimisation, walks and optimum of each of its grounds."""
        return _optimised(self.name.split("+"), self.option("--law") or "default", self.journal)

    def code(self, used: list[Entry]) -> str:
        """Return the code of some entries: one, or those that `--codes` says to walk alike, with + between."""
        codes = "+".join(sorted({entry.version["code"] for entry in used}))
        if codes != self.option("--codes") and (not codes or "+" in codes):
            raise SystemExit(f"table {self.words}: its walks must be of one code, got {codes or 'none'}")
        return codes


def _ramp(entries: Mapping[str, Entry]) -> dict[str, float]:
    """Return the parameter of the grounds of a journal whose walks do not say their ramp; nothing for those that do."""
    spec = next(iter(entries.values())).spec
    return {} if "ramp" in spec.get("terrain_params", {}) else {"ramp": 0.0}


def made(name: str, file: str, options: str, journals: Path) -> str:
    """Return a table with its caption."""
    mark = Mark(name, file, options, journals)
    kind = mark.option("--as") or "table"
    if kind in ("optimum", "held-out"):
        return _optima(mark)
    if kind == "folds":
        return _folds(mark)
    used = [entry for _, entry in study_entries(mark.study, mark.entries) if entry is not None]
    if kind == "choice":
        first = mark.option("--chosen-by")
        text = choice(
            mark.study,
            mark.entries,
            mark.options.get("--arm", ()),
            chosen_by=None if first is None else int(first),
        ).markdown()
    elif kind == "table4":
        text = table_four(mark.table())
    elif kind == "table":
        text = mark.table().markdown()
    else:
        raise SystemExit(f"table {mark.words}: no kind of table {kind}")
    return f"{text}\n\n*{_count(len(used), mark.whole.size)} of `{mark.name}`, {_code(mark.code(used))}*\n"


def _count(walked: int, whole: int) -> str:
    return f"{walked:,} walks" if walked == whole else f"Partial: {walked:,} of {whole:,} walks"


def _code(code: str) -> str:
    return f"with the code `{code}`."


def table_four(table: StudyTable) -> str:
    """Return the table of the study 'table4' beside the paper's Table IV, as Markdown: steps of 22 in the mean."""
    cells, arms = table.by_name, list(table.study.arms)
    lines = [
        f"| | {' | '.join(arms)} | variable, soft, flat of the paper |",
        "|---|" + "---:|" * (len(arms) + 1),
    ]
    for name, amplitudes in TABLE_IV.items():
        for amplitude, paper in zip(amplitudes, TABLE_IV_STEPS[name], strict=True):
            row = cell_name(name, amplitude)
            if row in table.rows:
                ours = [cells[row, arm].estimate.text() if (row, arm) in cells else "" for arm in arms]
                lines.append(f"| {row} | {' | '.join(ours)} | {', '.join(map(str, paper))} |")
    return "\n".join(lines)


def _folds(mark: Mark) -> str:
    """Return how well the paper's model predicts the labels of a data set, by each split of it."""
    full = dataset(DatasetSize(evaluations=EVALUATIONS))
    used = list(mark.entries.values())
    sharp = replace(full, base=merged(full.base, {"terrain_params": mark.ramp}))
    study = sharp.narrowed(arms={f"{entry.spec['stiffness']:g}" for entry in used})
    table = stiffness_table(study, labels(study, mark.entries), windows=WINDOWS)
    walks = _count(len(used), full.size)
    chosen = [c for c in candidates() if c.name in ("KNN 10, paper's features (paper)", "largest class")]
    judged = comparison_table(compare(table, chosen, folds=10, clusters=Clusters.logarithmic()))
    return f"{judged}\n\n*{walks} of `dataset`, {_code(mark.code(used))}*\n"


def _optimised(
    grounds: Iterable[str], law: str, entries: Mapping[str, Entry]
) -> Iterator[tuple[OptimisationSpec, list[Walked], Optimum]]:
    """Yield optimisation, walks and optimum of each ground."""
    own = law == "default"  # the others are the paper's: its bounds, and the family's own height
    for ground in grounds:
        spec = OptimisationSpec(
            ground=ground,
            amplitude=authority_heights().get(ground) if own else None,
            law=law,
            bounds=BOUNDS["wide" if own else "paper"],
            ramp=_ramp(entries).get("ramp"),
        )
        known = walked_points(spec, entries)
        yield spec, known, optimum(known, spec.bounds)


def _optima(mark: Mark) -> str:
    """Return the optima of some grounds beside the paper's Table II, and their walks on held-out layouts."""
    found = {spec: best for spec, _, best in mark.optimised()}
    grounds = {spec.ground: each for spec, each in found.items()}
    held_out = [e for e in mark.journal.values() if e.spec["seed"] < OPTIMISATION_SEED]
    judged = Entries({entry.key: entry.line()[:-1] for entry in held_out}).as_own()
    study = validation(found, VALIDATIONS).narrowed(arms=mark.options.get("--arm", ()))
    table = study_table(mark.part(study), judged) if judged else None
    if mark.option("--as") == "held-out":
        if table is None:
            raise SystemExit(f"table {mark.words}: no walks on held-out layouts")
        cells = [table.by_name[table.rows[-1], arm] for arm in table.study.arms]
        walks = sum(sum(cell.outcomes.values()) for cell in cells)
        caption = f"*{_count(walks, table.study.size)}, {_code(mark.code(list(judged.values())))}*"
        return f"{table.markdown()}\n\n{caption}\n"
    text = table_two(grounds)
    if table is not None:
        text += f"\n\nOn held-out layouts, each k with the best gains:\n\n{table.markdown()}"
    used = [entry for entry in mark.journal.values() if entry.spec.get("terrain") in grounds]
    walks = ", ".join(f"{each.walks} on `{ground}`" for ground, each in grounds.items())
    partial = "Partial: " if any(each.walks < BUDGET for each in found.values()) else ""
    caption = f"*{partial}{walks} of {BUDGET} walks a ground, {_code(mark.code(used))}*"
    return f"{text}\n\n{caption}\n"


def draw(name: str, file: str, options: str, to: str, folder: Path) -> Path:
    """Draw a figure."""
    from study_figures import differences_figure, risks_figure, steps_figure  # noqa: PLC0415 - slow

    from wbc.app.plot.optimization import stiffness_figure  # noqa: PLC0415
    from wbc.core.files import save_figure  # noqa: PLC0415

    mark = Mark(name, file, options, folder / "journals")
    kinds = {
        "risks": lambda: risks_figure(mark.table()),
        "steps": lambda: steps_figure(mark.table()),
        "differences": lambda: differences_figure(mark.table()),
        "optimum": lambda: stiffness_figure(*_by_ground(mark)),
    }
    save_figure(kinds[mark.option("--as") or ""](), folder / to, dpi=110.0)
    return folder / to


def _by_ground(mark: Mark) -> tuple[dict[str, list[Walked]], dict[str, Optimum]]:
    """Return walks and optima of a mark by ground."""
    all_of_it = list(mark.optimised())
    return {s.ground: known for s, known, _ in all_of_it}, {s.ground: best for s, _, best in all_of_it}


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
    for law, name in (("default", "optimize"), ("no_bias", "optimize_legacy")):
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
    """Write the tables, draw, or pack."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    one = parser.add_mutually_exclusive_group()
    one.add_argument("--figures", action="store_true", help="draw the figures")
    one.add_argument("--pack", type=Path, metavar="FOLDER", help="compress the journals of a folder")
    one.add_argument("--held-out", type=Path, metavar="FOLDER", help="write the studies of the optima there")
    options = parser.parse_args(words)
    if options.pack is not None:
        for path in pack(options.pack, folder):
            print(f"{path.name}: {path.stat().st_size / 1024:.0f} KiB")
    elif options.held_out is not None:
        print("\n".join(str(path) for path in held_out(options.held_out, folder)))
    elif options.figures:
        for figure in FIGURES:
            print(draw(*figure, folder))
    else:
        parts = [f"## {' '.join(table)}\n\n{made(*table, folder / 'journals')}" for table in TABLES]
        write_text(folder / "journals" / "tables.md", "# Tables of the journals\n\n" + "\n".join(parts))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
