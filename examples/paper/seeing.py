"""Softness or sight: how seeing and blind walks end, as a small table, and its figure.

python examples/paper/seeing.py JOURNAL …   writes seeing.csv from journals of the studies seeing and seeing_high
python examples/paper/seeing.py             prints what the default sole, a camera and range sensors at the toes add
python examples/paper/figures.py sight      draws it
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from walks import PAPER

from wbc.sim.studies import mean_interval, read_journal
from wbc.sim.studies.intervals import sign_flip_p

TABLE = PAPER / "seeing.csv"
EYES = {"none": ("blind", "0.6"), "toes": ("toes", "#f0b429"), "depth": ("depth", "#1f77b4")}
NAMES = {
    ("rigid", None): "rigid",
    **{("long_arch", k): f"long arch {k:g}" for k in (1.0, 5.0, 20.0, 80.0, 400.0)},
    **{("soft", k): f"soft {k:g}" for k in (5.0, 80.0)},
}
"""Foot and stiffness (Nm/rad) → name of a sole."""
COLUMNS = ["sole", "eyes", "family", "height", "seed", "outcome", "code"]


def rows(journal: Path) -> list[tuple[object, ...]]:
    """Return sole, eyes, family, height (m), seed, outcome and version of the code of each walk of a journal."""
    return [
        (
            NAMES[entry.spec["foot"], entry.spec["stiffness"]],
            entry.spec.get("eyes", "none"),
            *(entry.spec[name] for name in ("terrain", "amplitude", "seed")),
            entry.result["outcome"],
            entry.version["git"],
        )
        for entry in read_journal(journal).values()
        if entry.result is not None and (entry.spec["foot"], entry.spec["stiffness"]) in NAMES
    ]


GAINS = (
    (("long arch 5", "none"), ("rigid", "none")),
    (("rigid", "depth"), ("rigid", "none")),
    (("long arch 5", "depth"), ("long arch 5", "none")),
    (("long arch 5", "depth"), ("rigid", "depth")),
    (("long arch 5", "depth"), ("rigid", "none")),
    *(((sole, "toes"), (sole, "none")) for sole in ("long arch 5", "rigid", "soft 5", "soft 80")),
)
"""Soles and eyes that are compared: the first with the second."""


def gains() -> str:
    """Return the differences in completed walks, in % of all walks, with families as units."""
    lines = []
    for high, part in stored().groupby("high"):
        done = 100.0 * (part["outcome"] == "completed")
        of = done.groupby([part["sole"], part["eyes"], part["family"], part["seed"]]).mean()
        for one, other in GAINS:
            if not {one, other} <= {*zip(part["sole"], part["eyes"], strict=True)}:
                continue
            found = (of[one] - of[other]).dropna()
            families = found.index.get_level_values("family")
            each, p = mean_interval(found.tolist(), families), sign_flip_p(found.tolist(), families)
            lines.append(
                f"{'1.5 times as high' if high else 'usual height'}, {', '.join(one)} over {', '.join(other)}: "
                f"{each.mean:+.0f} [{each.low:.0f}, {each.high:.0f}] %, p = {p:.2g}, {each.n} pairs"
            )
    return "\n".join(lines)


def stored() -> pd.DataFrame:
    """Return the stored walks; `high` says whether their ground is higher than that of the study `seeing`."""
    table = pd.read_csv(TABLE)
    study = json.loads((PAPER.parent / "studies" / "seeing.json").read_text())
    heights = {cell["terrain"]: cell["amplitude"] for cell in study["cells"].values()}
    table["high"] = table["height"] > 1.01 * table["family"].map(heights)
    return table


def sight() -> Figure:
    """Draw the share of walks completed, and of those that strayed, by sole, sight and height."""
    table = stored()
    figure = Figure(figsize=(7.6, 2.8), layout="constrained")
    for axes, high in zip(figure.subplots(1, 2, sharey=True), (False, True), strict=True):
        part = table[table["high"] == high]
        soles = [sole for sole in NAMES.values() if sole in set(part["sole"])]
        eyes = [eye for eye in EYES if eye in set(part["eyes"])]
        for k, eye in enumerate(eyes):
            name, colour = EYES[eye]
            for i, sole in enumerate(soles):
                own = part[(part["eyes"] == eye) & (part["sole"] == sole)]
                if own.empty:
                    continue
                x, width = i + 0.8 * ((k + 0.5) / len(eyes) - 0.5), 0.76 / len(eyes)
                share = 100.0 * (own["outcome"] == "completed").groupby(own["family"]).mean()
                strayed = 100.0 * (own["outcome"] == "strayed").mean()
                each = mean_interval(share.to_numpy())
                mean = share.mean()
                ends = [mean if end is None else end for end in (each.low, each.high)]
                axes.bar(x, mean, width, color=colour, label=name if i == 0 else None)
                axes.bar(x, strayed, width, mean, color=colour, alpha=0.35)
                axes.plot([x, x], np.clip(ends, 0.0, 100.0), color="0.2", lw=1.0)
                axes.text(x, 2.0, f"{len(own)}", ha="center", fontsize=6, color="white")
        axes.set_xticks(range(len(soles)), [sole.replace("arch ", "arch\n") for sole in soles], fontsize=7)
        axes.set_title("1.5 times as high" if high else "heights of the study", fontsize=9)
    figure.axes[0].set(ylim=(0.0, 118.0), yticks=range(0, 101, 20))
    figure.axes[0].set_ylabel("walks completed, %", fontsize=8)
    figure.axes[0].legend(fontsize=7, loc="upper center", ncols=3, frameon=False)
    return figure


def main() -> None:
    """Write the table of outcomes from journals, or print the gains; a walk in two journals is that of the later."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("journals", nargs="*", type=Path)
    if not (journals := parser.parse_args().journals):
        print(gains())
        return
    found = [row for journal in journals for row in rows(journal)]
    table = pd.DataFrame(found, columns=COLUMNS).drop_duplicates(COLUMNS[:5], keep="last")
    table.sort_values(COLUMNS[:5]).to_csv(TABLE, index=False)
    print(f"{TABLE}: {len(table)} walks of {', '.join(sorted(set(table['code'])))}")


if __name__ == "__main__":
    main()
