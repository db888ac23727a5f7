"""Tables of the paper from its journals: `python examples/paper/tables.py [NAME …]` prints those of the names, or all.

Each function is one row of the README. `--journal FILE` takes the walks of a table from a journal of your own.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from choice import choice
from sklearn.isotonic import IsotonicRegression
from walks import by_sole, corrected, falls, gain, markdown, shown, walks

from wbc.sim.studies import mean_interval

SOLES = ("rigid", "soft, 1", "soft, 5", "soft, 20", "soft, 80", "soft, 400", "soft, 2000")
"""Fixed soles: the rigid one of the soft sole's size, and soft ones by stiffness, Nm/rad."""

PAPER_TABLE_IV: Mapping[str, tuple[tuple[int, int, int], ...]] = {
    "stones": ((22, 22, 8), (22, 22, 7), (22, 7, 7), (20, 6, 6)),
    "roof_tiles": ((22, 22, 16), (22, 9, 12), (22, 8, 9), (8, 7, 5)),
    "stone_bricks": ((22, 22, 6), (22, 6, 6), (22, 5, 4), (8, 6, 3)),
    "small_stones": ((22, 22, 7), (22, 13, 7), (13, 9, 7), (9, 7, 6)),
    "large_floor_tiles": ((22, 22, 7), (22, 19, 6), (22, 12, 6), (20, 8, 5)),
}
"""Steps of 22 in the paper's Table IV, one walk each: variable, soft, flat, by ascending height."""


def table4(journal: str | Path = "table4", paper: str = "soft, 5") -> str:
    """Return steps of 22 on the grounds of Table IV beside the paper's, sums, and differences to the soft sole."""
    table = walks(journal).assign(
        sole=lambda t: t["sole"].where(~t["sole"].str.startswith("soft") | (t["sole"] == paper), "tuned")
    )
    arms = [
        arm
        for arm in ("flat", "rigid", paper, "variable", "variable, 75 % at once", "tuned")
        if arm in set(table["sole"])
    ]
    means = table.pivot_table("steps", ["terrain", "amplitude"], "sole")[arms]
    rows = []
    for name, theirs in PAPER_TABLE_IV.items():
        for (_, height), steps, own in zip(
            means.loc[[name]].index, theirs, means.loc[name].to_numpy(), strict=True
        ):
            rows.append(
                [f"{name}, {1e3 * height:g} mm", *(f"{each:.1f}" for each in own), ", ".join(map(str, steps))]
            )
    theirs = np.array([steps for each in PAPER_TABLE_IV.values() for steps in each]).sum(axis=0)
    rows.append(["sum, of 440", *(f"{each:.0f}" for each in means.sum()), ", ".join(map(str, theirs))])
    done = table.groupby("sole")["arrived"]
    rows.append(["arrived", *(f"{done.sum()[arm]} of {done.size()[arm]}" for arm in arms), ""])
    steps = by_sole(table)
    rows.append(
        [
            f"steps over '{paper}'",
            *("" if arm == paper else shown(gain(steps, arm, paper)[0]) for arm in arms),
            "",
        ]
    )
    return markdown(["steps", *arms, "variable, soft, flat of the paper"], rows)


def fig5(journal: str | Path = "fig5") -> str:
    """Return steps of 22 on the unidirectional grounds of Fig. 5 by height, and differences to the soft sole."""
    table = walks(journal)
    arms = ["flat", "rigid", "soft, 5", "variable"]
    means, steps = table.pivot_table("steps", "amplitude", "sole")[arms], by_sole(table)
    rows = [
        [f"{1e3 * height:g} mm", *(f"{each:.1f}" for each in own)]
        for height, own in zip(means.index, means.to_numpy(), strict=True)
    ]
    rows.append(
        [
            "steps over 'soft, 5'",
            *("" if arm == "soft, 5" else shown(gain(steps, arm, "soft, 5")[0]) for arm in arms),
        ]
    )
    return markdown(["steps", *arms], rows)


def soles(arms: Sequence[str], journal: str | Path = "hypotheses", reference: str = "soft, 80") -> str:
    """Return arrivals, steps over a reference (families as the unit) and falls of soles on the same layouts."""
    table = walks(journal)
    steps, rows = by_sole(table), []
    found = {arm: gain(steps, arm, reference, "terrain") for arm in arms if arm != reference}
    p = corrected({arm: value for arm, (_, value) in found.items()})
    for arm in arms:
        own = table[table["sole"] == arm]
        rate = falls(table, arm)
        more = f"{shown(found[arm][0])} (p = {p[arm]:.2g})" if arm in found else ""
        causes = (f"{falls(table, arm, cause)[0]:.1f}" for cause in ("sideways", "forward"))
        peak = own.loc[own["arrived"], "impact"].mean()
        rows.append(
            [
                arm,
                f"{own['arrived'].sum()} of {len(own)}",
                more,
                "{:.1f} [{:.1f}, {:.1f}]".format(*rate),
                *causes,
                f"{peak:.2f}",
            ]
        )
    head = [
        "sole",
        "arrived",
        f"steps over '{reference}'",
        "falls per 1,000 steps",
        "sideways",
        "forward",
        "landing peak",
    ]
    return markdown(head, rows)


def arrivals(journal: str | Path = "hypotheses") -> str:
    """Return the share of walks that arrive more than on the rigid sole, in percent of the walks, families as unit.

    p-values are corrected for the six stiffnesses of the soft sole, for the eight soles of 'design' and 'front', and
    for all soles of the journal.
    """
    values = 100.0 * by_sole(walks(journal), "arrived")
    soft, shapes = SOLES[1:], [arm for arm in values if "arch" in arm]
    arms = [arm for arm in values if arm != "rigid"]
    found = {arm: gain(values, arm, "rigid", "terrain") for arm in arms}
    p = [corrected({arm: found[arm][1] for arm in group}) for group in (soft, shapes, arms)]
    rows = [
        [arm, f"{values[arm].eq(100.0).sum()}", shown(each, 0), f"{value:.2g}"]
        + [f"{group[arm]:.2g}" if arm in group else "" for group in p]
        for arm, (each, value) in sorted(found.items(), key=lambda item: item[1][1])
    ]
    corrections = [f"p (Holm, {len(group)})" for group in p]
    return markdown(["sole", "arrived", "more than on rigid, %", "p", *corrections], rows)


def authority(journal: str | Path = "authority") -> str:
    """Return falls within five steps over the edge that the grounds of version 8 begin with, of 680 walks a sole."""
    table = walks(journal)
    own = table[table["foot_changes"].map(len).eq(0) & table["seed"].lt(1000)]
    early = own[own["fell"] & own["steps"].le(5)].groupby("sole").size()
    rows = [
        [arm, f"{early.get(arm, 0)} of {own['sole'].eq(arm).sum()}", f"{falls(own, arm, 'forward')[0]:.1f}"]
        for arm in SOLES
    ]
    return markdown(["sole", "fell within five steps", "forward falls per 1,000 steps"], rows)


def damping(journal: str | Path = "authority") -> str:
    """Return what half of the critical damping does more than the paper's dampers of 2 Nms/rad."""
    table = walks(journal)
    table = table.assign(
        sole=table["sole"]
        + table["foot_changes"].map(lambda c: ", half critical" if "damping_ratio" in c else "")
    )
    steps = by_sole(table)
    found = {f"k = {k}": gain(steps, f"soft, {k}, half critical", f"soft, {k}") for k in (5, 80, 400)}
    p = corrected({k: value for k, (_, value) in found.items()})
    rows = [[k, shown(each), f"{p[k]:.2g}"] for k, (each, _) in found.items()]
    return markdown(["half critical damping", "steps over b = 2 Nms/rad", "p (Holm)"], rows)


def oracle(journal: str | Path, first: int = 10) -> str:
    """Return the best stiffness of each family by the first layouts, and what knowing it is worth on the others."""
    table = walks(journal)
    own = table[
        table["sole"].isin(SOLES[1:]) & table["seed"].lt(30_000) & table["foot_changes"].map(len).eq(0)
    ]
    return choice(by_sole(own)[list(SOLES[1:])], chosen_by=first).markdown()


def learnt(journal: str | Path = "learnt_ramp") -> str:
    """Return what models do that scan the ground, trained where walks fall, over 80 Nm/rad on the same layouts."""
    steps = by_sole(walks("hypotheses")).join(by_sole(walks(journal)), how="inner")
    models = ("ramp_model", "ramp_model_regression")
    found = {arm: gain(steps, arm, "soft, 80", "terrain") for arm in models}
    p = corrected({arm: value for arm, (_, value) in found.items()})
    return markdown(
        ["model", "steps over 80 Nm/rad", "p (Holm)"],
        [[arm, shown(each), f"{p[arm]:.2f}"] for arm, (each, _) in found.items()],
    )


def patchwork(journal: str | Path = "oracle", reference: str = "soft, 80") -> str:
    """Return what oracles of the place and models do over 80 Nm/rad on a ground that changes on the way."""
    steps = by_sole(walks(journal))
    arms = [arm for arm in steps.columns if arm != reference and steps[arm].notna().sum() > 8]
    found = {arm: gain(steps, arm, reference) for arm in arms}
    p = corrected({arm: value for arm, (_, value) in found.items()})
    rows = [[arm, shown(each), f"{value:.2g}", f"{p[arm]:.2g}"] for arm, (each, value) in found.items()]
    return markdown(["sole", f"steps over '{reference}'", "p", "p (Holm)"], rows)


def swings(journal: str | Path = "") -> str:
    """Return the stiffness that was commanded in the swings of variable soles: quartiles over all of them, Nm/rad."""
    rows = []
    for each in [journal] if journal else ["table4", "table4_frizza", "fig5", "fig5_frizza"]:
        table = walks(each)
        commanded = table.loc[table["sole"] == "variable", "commanded"].explode().astype(float)
        rows.append([each, len(commanded), *(f"{k:.1f}" for k in commanded.quantile([0.25, 0.5, 0.75]))])
    return markdown(["variable soles", "swings", "quarter", "half", "three quarters"], rows)


def halfway(journal: str | Path = "halfway") -> str:
    """Return the height of each family at which half of the walks arrive, by a decreasing share of them, mm."""
    rows = []
    for name, own in walks(journal).groupby("terrain"):
        tried = np.unique(own["amplitude"])
        fit = IsotonicRegression(increasing=False).fit(own["amplitude"], own["arrived"])
        share = fit.predict(tried).round(9)
        # At a plateau of a half the two directions find its two ends.
        ends = np.interp(-0.5, -share, tried), np.interp(0.5, share[::-1], tried[::-1])
        rows.append([name, f"{1e3 * np.mean(ends):.1f}"])
    return markdown(["family", "half of the walks arrive, mm"], rows)


PARTS = {
    "gains.dcm_p": "gains of the DCM: kP 4 and kD 0, not 3.4 and 2.1",
    "gains.cop_admittance": "a CoP admittance five times as quick",
    "gains.support_height_leak": "gains of force difference and height, rate of ankles",
    "distribution.margin": "costs and margin of the distribution, ZMP inwards",
    "walk.adjustment": "step adjustment",
    "feedforward": "torque feed-forward",
    "lean": "lean",
    "walk.phases.lift_off": "a step that waits for load",
    "bias.drift_std": "a bias that drifts slowly",
}
"""A setting of each part of the default law, of those that the studies of parts change together → the part."""

WHOLE, NONE = "all, the default law", "nothing"


def parts(study: str, journal: str | Path = "") -> pd.DataFrame:
    """Return the walks of 'attribution' or 'indispensable' with the part of the law that is added or taken out."""
    table = walks(journal or study)
    usual = table["apex"] == (0.5 if study == "attribution" else 0.4)
    part = pd.Series(np.where(usual, NONE, "slow landing"), table.index)
    if study == "attribution":
        part[table["gains"] == "default"] = WHOLE
    for i, changes in table["changes"].items():
        part[i] = next((name for key, name in PARTS.items() if key in changes), part[i])
    return table.assign(part=part)


def attribution(journal: str | Path = "") -> str:
    """Return what each part of the default law does added to the paper's, and taken out of the default one.

    The journal is that of the parts that are added.
    """
    added, taken = parts("attribution", journal), parts("indispensable")
    tables = {}
    for name, table in (("added", added), ("taken", taken)):
        steps = by_sole(table, name="part")
        found = {part: gain(steps, part, NONE) for part in steps.columns if part != NONE}
        p = corrected({part: value for part, (_, value) in found.items()})
        tables[name] = table.groupby("part")["arrived"], found, p
    rows = []
    for part in (*PARTS.values(), "slow landing", WHOLE, NONE):
        row = [part]
        for done, found, p in tables.values():
            row += [
                str(done.sum().get(part, "")),
                f"{shown(found[part][0])} (p = {p[part]:.2g})" if part in found else "",
            ]
        rows.append(row)
    return markdown(
        [
            "part of the default law",
            "added: arrived of 100",
            "steps more",
            "taken out: arrived of 50",
            "steps more",
        ],
        rows,
    )


def gains(journal: str | Path = "gains") -> str:
    """Return what gains of the default law do in the paper's, all together and in parts."""
    names = {0: "the paper's law", 2: "gains of the DCM", 4: "and CoP admittance", 7: "all gains"}
    table = walks(journal)
    arm = table["changes"].map(len).map(names).where(table["gains"] == "frizza", WHOLE)
    table = table.assign(arm=arm)
    steps, done = by_sole(table, name="arm"), table.groupby("arm")["arrived"]
    rows = [
        [
            each,
            f"{done.sum()[each]} of {done.size()[each]}",
            "" if each == names[0] else shown(gain(steps, each, names[0])[0]),
        ]
        for each in (*names.values(), WHOLE)
    ]
    return markdown(["law", "arrived", "steps more"], rows)


def stepping(journal: str | Path = "stepping_soles") -> str:
    """Return arrivals of the stepping walk beside those of the LIPM walk on the same layouts and soles."""
    table, lipm = walks(journal), walks("hypotheses")
    ours, theirs = (100.0 * by_sole(each, "arrived") for each in (table, lipm))
    metres = by_sole(table, "distance")
    share = ours.groupby("terrain").mean().mean(axis=1)
    open_ones = metres[metres.index.get_level_values("terrain").map(share.between(10.0, 90.0))]
    further = {arm: gain(open_ones, arm, "rigid", "terrain") for arm in ours.columns if arm != "rigid"}
    p = corrected({arm: value for arm, (_, value) in further.items()})
    rows = []
    for arm in ("rigid", "soft, 5", "soft, 80", "long arch, 5"):
        more = (ours[arm] - theirs[arm]).dropna()
        found = mean_interval(more.tolist(), more.index.get_level_values("terrain").tolist())
        own = table[table["sole"] == arm]
        far = "" if arm == "rigid" else f"{shown(further[arm][0], 2)} (p = {p[arm]:.2g})"
        peak = own.loc[own["arrived"], "impact"].mean()
        rows.append(
            [
                arm,
                f"{ours[arm].eq(100).sum():.0f}",
                f"{theirs[arm].eq(100).sum():.0f}",
                shown(found, 0),
                far,
                f"{peak:.1f}",
            ]
        )
    return markdown(
        ["sole", "stepping, of 340", "LIPM, of 340", "difference, %", "m over rigid", "landing peak"], rows
    )


def table2(journal: str | Path = "optimize") -> str:
    """Return the optima of Bayesian optimisation on the grounds of Table II beside the paper's."""
    from optimize import stored_optima, table_two  # noqa: PLC0415 - slow to import

    return table_two({ground: best for ground, _, best in stored_optima(journal)})


def held_out(journal: str | Path = "optimize") -> str:
    """Return what the optima do over 80 Nm/rad at the usual gains, on layouts that no optimisation has walked."""
    from optimize import held_out_steps  # noqa: PLC0415 - slow to import

    return held_out_steps(journal)


def dataset(journal: str | Path = "dataset") -> str:
    """Return how often the paper's model is right on its data set walked anew, by each split of it."""
    from models import comparison, dataset_of  # noqa: PLC0415 - slow to import

    return comparison(dataset_of(journal), ("KNN 10, paper's features (paper)", "largest class"))


TABLES: dict[str, Callable[..., str]] = {
    "table2": table2,
    "held_out": held_out,
    "dataset": dataset,
    "halfway": halfway,
    "swings": swings,
    "table4": table4,
    "table4_frizza": partial(table4, journal="table4_frizza"),
    "fig5": fig5,
    "fig5_frizza": partial(fig5, journal="fig5_frizza"),
    "authority_ramp": lambda journal="hypotheses": "\n\n".join(
        (soles(SOLES, journal), arrivals(journal), oracle(journal))
    ),
    "authority": lambda journal="authority": f"{authority(journal)}\n\n{oracle(journal, 20)}",
    "damping": damping,
    "oracle": patchwork,
    "extremes": lambda journal="extremes": f"{patchwork(journal)}\n\n{patchwork(journal, 'soft, 2000')}",
    "learnt_ramp": learnt,
    "phase": partial(
        soles,
        (
            *(f"phase: {a}, on one foot {b}" for a, b in ((400, 5), (400, 20), (80, 5))),
            "edge: 400, else 5",
            "soft, 5",
            "soft, 80",
            "rigid",
        ),
    ),
    "design": partial(soles, [f"long arch, {k}" for k in (1, 5, 20, 80)] + ["soft, 5", "soft, 80", "rigid"]),
    "front": partial(
        soles,
        ["toe 400, arch 5", "toe 400, arch 20", "toe 2000, arch 5", "toe 5, arch 400", "soft, 80", "rigid"],
    ),
    "attribution": attribution,
    "gains": gains,
    "stepping_soles": stepping,
}
"""Table → function that returns it as Markdown, of another `journal` where one is given."""


def main() -> None:
    """Print tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help=f"tables: {', '.join(TABLES)}; all when left out")
    parser.add_argument("--journal", type=Path, help="journal of your own, for one table")
    options = parser.parse_args()
    for name in options.names or TABLES:
        if name not in TABLES:
            parser.error(f"no table '{name}'; there are {', '.join(TABLES)}")
        journal = {} if options.journal is None else {"journal": options.journal}
        print(f"## {name}\n\n{TABLES[name](**journal)}\n")


if __name__ == "__main__":
    main()
