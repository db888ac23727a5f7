"""The page of what was found says what its journals give: numbers of its sentences, computed anew."""

from __future__ import annotations

import json
import lzma
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from wbc.sim.studies.intervals import holm, mean_interval, rate_interval, sign_flip_p
from wbc.sim.studies.study_table import cause_of

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.insert(0, str(DOCS))

from tables import TABLE_IV_STEPS  # noqa: E402 - of docs

PAGE = re.sub(r"\s+", " ", (DOCS / "found.md").read_text(encoding="utf-8"))
SOLES = ("rigid", "1", "5", "20", "80", "400", "2000")

Result = dict[str, Any]
Layout = tuple[str, int]


def walks(journal: str) -> Iterable[tuple[dict[str, Any], Result]]:
    with lzma.open(DOCS / "journals" / f"{journal}.jsonl.xz") as lines:
        for line in lines:
            entry = json.loads(line)
            yield entry["spec"], entry["result"]


def sole(spec: dict[str, Any]) -> str:
    return f"{spec['stiffness']:g}" if spec["foot"] == "soft" else spec["foot"]


@cache
def authority() -> dict[str, dict[Layout, Result]]:
    """Walks of the study of that name, whose grounds begin with an edge: sole → layout."""
    found: dict[str, dict[Layout, Result]] = defaultdict(dict)
    for spec, result in walks("authority"):
        if spec["seed"] < 1000 and not spec["foot_changes"]:
            found[sole(spec)][spec["terrain"], spec["seed"]] = result
    return found


def arrived(result: Result) -> bool:
    return bool(result["outcome"] == "completed")


def early(result: Result) -> bool:
    return bool(result["fell"]) and result["steps_done"] <= 5


def says(text: str) -> None:
    assert text in PAGE, f"the page does not say: {text}"


def listed(values: Iterable[Any]) -> str:
    *most, last = map(str, values)
    return f"{', '.join(most)} and {last}"


def test_the_page_is_short_and_its_studies_are_there() -> None:
    assert len((DOCS / "found.md").read_text(encoding="utf-8").splitlines()) <= 250
    folder = DOCS.parent / "sim" / "studies" / "data" / "hypotheses"
    for path in folder.glob("*.json"):
        assert f"`{path.stem}`" in PAGE


def test_soft_soles_fall_over_an_edge() -> None:
    """The study 'authority', whose grounds begin with one."""
    soles = authority()
    falls = {k: sum(map(early, soles[k].values())) for k in SOLES}
    says(f"within five steps {listed(falls[k] for k in SOLES[1:])} of 680 walks fall")
    says(f"{falls['rigid']} on the rigid sole")
    forward = [cause_of(result) for result in soles["5"].values()].count("forward")
    says(
        f"with 5 Nm/rad are {1e3 * forward / sum(map(steps, soles['5'].values())):.1f} per 1,000 steps there"
    )
    for k in SOLES[1:]:
        more = [steps(soles[k][at]) - steps(soles["rigid"][at]) for at in soles["rigid"]]
        found = mean_interval(more, [family for family, _ in soles["rigid"]])
        assert found.low is not None and found.low < 0.0
    best = best_by_family({k: soles[k] for k in SOLES[1:]}, list(range(100, 120)))
    gained = {
        (f, s): steps(soles[k][f, s]) - steps(soles["80"][f, s])
        for f, k in best.items()
        for s in range(120, 140)
    }
    edge = [at for at in gained if early(soles[best[at[0]]][at]) or early(soles["80"][at])]
    says(
        f"{interval(list(gained.values()))} steps on the 20 others, most of them from layouts with a fall within"
    )
    assert sum(gained[at] for at in edge) > 0.5 * sum(gained.values())


def best_by_family(soles: dict[str, dict[Layout, Result]], seeds: list[int]) -> dict[str, str]:
    """Sole of most steps on layouts of each family; of equal ones the best over all families, of those the first."""
    families = sorted({family for walks_of in soles.values() for family, _ in walks_of})
    done = {(f, k): sum(int(steps(soles[k][f, s])) for s in seeds) for f in families for k in soles}
    pooled = {k: sum(done[f, k] for f in families) for k in soles}
    return {f: max(soles, key=lambda k, f=f: (done[f, k], pooled[k])) for f in families}  # type: ignore[misc]


def fixed() -> dict[str, dict[Layout, Result]]:
    """Walks of the study 'authority_ramp' on fixed soles: k, or rigid → layout."""
    return {name: hypotheses()[name if name == "rigid" else f"soft, {name}"] for name in SOLES}


def test_two_risks_are_opposed() -> None:
    for cause, first in (
        ("sideways", "Sideways falls per 1,000 steps are"),
        ("forward", "Forward falls are"),
    ):
        rates = {}
        for k, walks_of in fixed().items():
            done = sum(map(steps, walks_of.values())) / 1e3
            rates[k] = f"{sum(cause_of(result) == cause for result in walks_of.values()) / done:.1f}"
        says(f"{first} {rates['rigid']} on the rigid sole and {listed(rates[k] for k in SOLES[1:])}")


def test_sideways_falls_by_layout_and_family_and_forward_ones_by_phase() -> None:
    soles = fixed()
    soft, rigid = ({at: cause_of(r) == "sideways" for at, r in soles[k].items()} for k in ("5", "rigid"))
    alone = sum(soft[at] and not rigid[at] for at in soft), sum(rigid[at] and not soft[at] for at in soft)
    says(f"only the soft sole falls sideways on {alone[0]} layouts, only the rigid one on {alone[1]}")
    families = {family for family, _ in soft}
    lead = [sum(rigid[at] - soft[at] for at in soft if at[0] == f) for f in families]
    says(f"less often on {sum(n > 0 for n in lead)} families and more often on {sum(n < 0 for n in lead)}")
    forward = [r["fall"]["phase"] for r in soles["5"].values() if cause_of(r) == "forward"]
    says(
        f"of the {len(forward)} forward falls with 5 Nm/rad {forward.count('double support')} begin in double"
    )


def test_more_walks_arrive_on_soft_soles() -> None:
    """By the rule of 'authority_ramp': completed walks against the rigid sole, families as the unit, Holm."""
    soles = fixed()
    done = {k: sum(map(arrived, soles[k].values())) for k in SOLES}
    says(f"{done['rigid']} of 340 on the rigid sole, and {listed(done[k] for k in SOLES[1:])}")
    says(f"With 5 Nm/rad {done['5']} of 340 walks arrive, on a rigid sole of its size {done['rigid']}")
    found = {k: gain(f"soft, {k}", "rigid", lambda r: 100.0 * arrived(r), 0) for k in SOLES[1:]}
    for k, (text, p) in found.items():
        name = {"5": "5 Nm/rad wins", "2000": "2,000"}.get(k, k)
        says(f"{name} {text} %{' of the walks' if k == '5' else ''} (p = {p:.2f})")
    corrected = dict(zip(found, holm([p for _, p in found.values()]), strict=True))
    assert all(p is not None and p > 0.05 for p in corrected.values())
    says(f"none is established (5 Nm/rad: p = {corrected['5']:.2f})")


def test_landings_are_softer_and_more_of_the_sole_touches() -> None:
    soles = fixed()
    pairs = [(soles["20"][at], soles["rigid"][at]) for at in soles["20"]]
    both = [(a, b) for a, b in pairs if arrived(a) and arrived(b)]

    def values(part: Callable[[Result], float]) -> tuple[np.ndarray, np.ndarray, float]:
        soft, rigid = (np.array([part(pair[i]) for pair in both]) for i in (0, 1))
        return soft, rigid, 100.0 * float(soft.mean() / rigid.mean() - 1.0)

    soft, rigid, less = values(lambda result: result["impact"])
    lower = 100.0 * np.mean(soft < rigid)
    says(
        f"the landing peak is {soft.mean():.2f} of the weight, not {rigid.mean():.2f} (−{-less:.0f} %, lower in "
        f"{lower:.0f} % of the pairs)"
    )
    zmp, area = values(lambda r: r["zmp_error"]["mean"])[2], values(lambda r: r["contact_area"]["mean"])[2]
    says(f"the ZMP error −{-zmp:.0f} %, the contact area of the stance sole +{area:.0f} %")


def test_a_schedule_by_the_ground_has_nothing_to_win() -> None:
    """By the rule of 'authority_ramp': the best k of layouts 1 to 10 of a family, on its layouts 11 to 20."""
    soles = {k: walks_of for k, walks_of in fixed().items() if k != "rigid"}
    seeds = sorted({seed for _, seed in soles["80"]})
    best = best_by_family(soles, seeds[:10])
    other = best_by_family({k: soles[k] for k in ("5", "1", "20", "80", "400", "2000")}, seeds[:10])
    layouts = [(family, seed) for family in best for seed in seeds[10:]]
    families = [family for family, _ in layouts]

    def gained(
        best: dict[str, str], part: Callable[[Result], float], digits: int
    ) -> tuple[str, float | None]:
        more = [part(soles[best[at[0]]][at]) - part(soles["80"][at]) for at in layouts]
        return interval(more, families, digits), sign_flip_p(more, families)

    text, p = gained(best, steps, 2)
    assert p is not None and p > 0.05
    says(f"does {text} steps more than 80 on its layouts 11 to 20 (families as the unit, p = {p:.2f})")
    text, p = gained(best, lambda result: 100.0 * arrived(result), 0)
    says(f"lets {text} % more walks arrive (p = {p:.2f})")
    equal = [family for family in best if best[family] != other[family]]
    assert all((best[family], other[family]) == ("1", "5") for family in equal) and len(equal) == 5
    says(f"with 5 there it does {gained(other, steps, 2)[0]}")


def test_models_that_scan_the_ground_win_nothing() -> None:
    """The study 'learnt_ramp' beside the walks of 80 Nm/rad on its layouts, and its rule."""
    models: dict[str, dict[Layout, Result]] = defaultdict(dict)
    for spec, result in walks("learnt_ramp"):
        kind = "regression" if "regression" in dict(spec["policy_params"])["path"] else "classifier"
        models[kind][spec["terrain"], spec["seed"]] = result
    best = best_by_family({k: fixed()[k] for k in SOLES[1:]}, list(range(21000, 21010)))
    over, below, p_values = [], [], []
    for walks_of in (models["classifier"], models["regression"]):
        assert len(walks_of) == 170
        families = [family for family, _ in walks_of]
        more = [steps(result) - steps(fixed()["80"][at]) for at, result in walks_of.items()]
        less = [steps(fixed()[best[at[0]]][at]) - steps(result) for at, result in walks_of.items()]
        found = mean_interval(more, families)
        assert found.high is not None and found.high < 0.5
        over.append(interval(more, families))
        below.append(interval(less, families))
        p_values.append(sign_flip_p(more, families))
    assert all(p is not None and p > 0.05 for p in holm(p_values))
    says(f"it does {over[0]} steps more than 80 Nm/rad as a classifier and {over[1]} as a regression")
    says(f"{below[0]} and {below[1]} less than the oracle of the family")


@cache
def experiment(journal: str) -> dict[str, dict[Layout, Result]]:
    """Walks of an experiment of the paper: sole → ground with its height and layout."""
    soles: dict[str, dict[Layout, Result]] = defaultdict(dict)
    for spec, result in walks(journal):
        ground = f"{spec['terrain']} {spec['amplitude']} {spec['terrain_params'].get('cutoff')}"
        soles[sole(spec)][ground, spec["seed"]] = result
    return soles


def sums(journal: str) -> dict[str, float]:
    """Sum of the mean steps of the cells of an experiment, with as many walks each, for each sole."""
    return {
        name: sum(map(steps, arm.values())) * len({ground for ground, _ in arm}) / len(arm)
        for name, arm in experiment(journal).items()
    }


def test_table_four_beside_the_papers() -> None:
    paper = [sum(row[i] for rows in TABLE_IV_STEPS.values() for row in rows) for i in (2, 1, 0)]
    says(f"| paper, one walk a cell | {', '.join(map(str, paper))} |")
    law, default = sums("table4_frizza"), sums("table4")
    one, two = (
        [f"{found[name]:.0f}" for name in ("flat", "5", "variable", "rigid")] for found in (law, default)
    )
    says(f"means of 10 walks a cell | {', '.join(one[:3])}; a rigid sole of the soft one's size {one[3]} |")
    says(f"means of 20 walks a cell | {', '.join(two[:3])}; rigid {two[3]} |")
    law, default = (
        [sum(map(arrived, experiment(journal)[name].values())) for name in ("flat", "rigid", "5")]
        for journal in ("table4_frizza", "table4")
    )
    says(
        f"{default[0]} of 400 walks arrive on the robot's own sole, {default[1]} on a rigid one of the soft sole's "
        f"size, {default[2]} on the soft one. By the paper's law as printed it is {listed(law)} of 200"
    )


def test_a_stiffness_that_is_scheduled_as_the_paper_does_gains_nothing() -> None:
    """Steps more than the soft sole of 5 Nm/rad on the same layouts."""

    def more(journal: str, name: str = "variable") -> str:
        soles = experiment(journal)
        return interval([steps(result) - steps(soles["5"][at]) for at, result in soles[name].items()])

    fixed = np.mean([steps(result) for result in experiment("fig5_frizza")["5"].values()])
    says(
        f"the paper's law as printed, Table IV, {more('table4_frizza')}; Fig. 5, where the fixed sole does "
        f"{fixed:.1f} of 22, {more('fig5_frizza')}; default law, Table IV, {more('table4')}"
    )
    says(f"a stiffness that changes at once it does {more('table4_frizza', 'paper')}")
    soles = experiment("table4_frizza")
    soft = interval([steps(result) - steps(soles["rigid"][at]) for at, result in soles["5"].items()])
    peaks = [np.mean([r["impact"] for r in soles[name].values() if arrived(r)]) for name in ("5", "rigid")]
    says(
        f"over the rigid sole of its size, {soft}, but for softer landings, {peaks[0]:.1f} against {peaks[1]:.1f}"
    )


@cache
def hypotheses() -> dict[str, dict[Layout, Result]]:
    """Walks of 'phase', 'design', 'front' and 'authority_ramp', which share their layouts: sole → layout."""
    arms: dict[str, dict[Layout, Result]] = defaultdict(dict)
    for spec, result in walks("hypotheses"):
        given = spec.get("policy_params", {})
        if spec.get("policy") == "phase":
            name = f"phase: {given['landing']:g}, on one foot {given['single']:g}"
        elif spec.get("policy") == "edge":
            name = f"edge: {given['edge']:g}, else {given['smooth']:g}"
        else:
            kind = spec["foot"].replace("_", " ")
            front = dict(spec["foot_changes"]).get("front_stiffness")
            name = kind if kind == "rigid" else f"{kind}, {spec['stiffness']:g}"
            name = name if front is None else f"toe {front:g}, arch {spec['stiffness']:g}"
        arms[name][spec["terrain"], spec["seed"]] = result
    return {name: arm for name, arm in arms.items() if len(arm) == 340}


def over(arm: str, other: str, part: Callable[[Result], float]) -> tuple[list[float], list[str]]:
    """Differences of two soles on the same layouts, and the families of these."""
    arms = hypotheses()
    assert arms[arm].keys() == arms[other].keys()
    return [part(arms[arm][at]) - part(arms[other][at]) for at in arms[arm]], [at[0] for at in arms[arm]]


@cache
def stepping_soles() -> dict[str, dict[Layout, Result]]:
    """Walks of the study of that name: sole → layout."""
    soles: dict[str, dict[Layout, Result]] = defaultdict(dict)
    for spec, result in walks("stepping_soles"):
        kind = spec["foot"].replace("_", " ")
        name = kind if kind == "rigid" else f"{kind}, {spec['stiffness']:g}"
        soles[name][spec["terrain"], spec["seed"]] = result
    return soles


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


@cache
def parts_of(study: str, own_apex: float) -> dict[str, dict[Layout, Result]]:
    """Walks of a study of parts of the law: part that is added or taken out → layout; its own swing has that apex."""
    parts: dict[str, dict[Layout, Result]] = defaultdict(dict)
    for spec, result in walks(study):
        changed = [name for key, name in PARTS.items() if key in dict(spec["changes"])]
        name = NONE if spec["gait"]["apex"] == own_apex else "slow landing"
        if study == "attribution" and spec["gains"] == "default":
            name = WHOLE
        parts[changed[0] if changed else name][spec["terrain"], spec["seed"]] = result
    return parts


def signed(text: str) -> str:
    return text.replace("-", "−").replace("−0.0", "0.0")


def interval(values: list[float], layouts: list[str] | None = None, digits: int = 1) -> str:
    """Mean with its interval as the page writes it; the unit is a walk when `layouts` is None."""
    found = mean_interval(values, layouts)
    assert found.low is not None and found.high is not None
    return signed(f"{found.mean:.{digits}f} [{found.low:.{digits}f}, {found.high:.{digits}f}]")


def gain(arm: str, other: str, part: Callable[[Result], float], digits: int = 1) -> tuple[str, float]:
    """Mean difference of two soles with its interval, families as the unit, and its p-value."""
    values, families = over(arm, other, part)
    return interval(values, families, digits), sign_flip_p(values, families)


def steps(result: Result) -> float:
    return float(result["steps_done"])


def rate(arm: str, cause: str | None = None) -> tuple[float, float, float]:
    """Falls per 1,000 steps, all or those of a cause, and the ends of the interval."""
    results = hypotheses()[arm].values()
    falls = sum(bool(r["fell"]) if cause is None else cause_of(r) == cause for r in results)
    done = sum(map(steps, results)) / 1e3
    return falls / done, *rate_interval(falls, done)


def row(arm: str, reference: str = "soft, 80") -> str:
    """Row of a table of hypotheses."""
    falls, low, high = rate(arm)
    more = "" if arm == reference else f"{gain(arm, reference, steps)[0]} "
    return (
        f"| {arm} | {sum(map(arrived, hypotheses()[arm].values()))} | {more}| {falls:.1f} [{low:.1f}, {high:.1f}] "
        f"| {rate(arm, 'sideways')[0]:.1f} | {rate(arm, 'forward')[0]:.1f} |"
    )


def test_stiffness_by_the_phase_of_the_step_gains_nothing() -> None:
    """The table of the study 'phase'."""
    arms = [name for name in hypotheses() if name.startswith(("phase", "edge"))] + [
        "soft, 5",
        "soft, 80",
        "rigid",
    ]
    assert len(arms) == 7
    for arm in arms:
        says(row(arm))


def test_an_arch_under_the_toe_takes_the_forward_falls_away() -> None:
    """The table of the study 'design' and what is said of its rule."""
    arms = hypotheses()
    arch = [f"long arch, {k}" for k in (1, 5, 20, 80)]
    soles = (*arch, "soft, 5", "soft, 80", "rigid")
    for arm in soles:
        says(row(arm))
    done = {arm: sum(map(arrived, arms[arm].values())) for arm in soles}
    says(
        f"{done['long arch, 5']} of 340 walks to their goal, {done['soft, 5']} the paper's soft foot and "
        f"{done['rigid']} a rigid sole"
    )

    def rated(arm: str, cause: str) -> tuple[float, float, str]:
        falls, low, high = rate(arm, cause)
        return low, high, f"{falls:.1f} [{low:.1f}, {high:.1f}]"

    for k, forward, sideways in (
        (
            5,
            "forward falls per 1,000 steps against {} of the soft",
            "sideways ones against {} of the rigid sole",
        ),
        (20, "against {}, and", ""),
    ):
        ours, soft = rated(f"long arch, {k}", "forward"), rated(f"soft, {k}", "forward")
        assert ours[1] < soft[0]
        says(f"{ours[2]} {forward.format(soft[2])}")
        ours, rigid = rated(f"long arch, {k}", "sideways"), rated("rigid", "sideways")
        assert ours[1] < rigid[0]
        says(f"and {ours[2]} {sideways.format(rigid[2])}".strip())

    def gains(k: str, other: str, part: Callable[[Result], float] = steps, digits: int = 1) -> str:
        return gain(f"long arch, {k}", other, part, digits)[0]

    pairs = [(arm, other) for arm in arch for other in ("soft, 80", "rigid")]
    p = dict(zip(pairs, holm([gain(*pair, steps)[1] for pair in pairs]), strict=True))
    assert {pair for pair in pairs if p[pair] < 0.05} == {(arm, "rigid") for arm in arch[1:3]}
    says(
        f"do {gains('5', 'rigid')} and {gains('20', 'rigid')} steps more than the rigid sole "
        f"(p = {p[arch[1], 'rigid']:.2f} and {p[arch[2], 'rigid']:.2f} after Holm's"
    )
    says(f"have p = {p[arch[1], 'soft, 80']:.2f} and {p[arch[2], 'soft, 80']:.2f}")
    more = [gains(k, "rigid", lambda result: 100.0 * arrived(result), 0) for k in ("5", "20")]
    says("let {} % and {} % more of the walks arrive".format(*more))
    says(f"they do {gains('5', 'soft, 5')} and {gains('20', 'soft, 20')} steps more")

    def mean(arm: str, part: Callable[[Result], float]) -> float:
        return float(np.mean([part(result) for result in arms[arm].values() if arrived(result)]))

    peaks = (f"{mean(arm, lambda r: r['impact']):.2f}" for arm in ("long arch, 5", "soft, 5", "rigid"))
    says("(with 5, {} of the weight; {}; rigid {})".format(*peaks))
    area = [mean(arm, lambda r: r["contact_area"]["mean"]) for arm in ("long arch, 5", "soft, 5")]
    says(
        f"the contact area of the stance sole is {100.0 * (area[0] / area[1] - 1.0):.0f} % larger than with soft 5"
    )


def test_a_stiff_toe_falls_forward_as_often_as_a_soft_one() -> None:
    """The study 'front' and what is said of its rule."""
    toes = ("toe 400, arch 5", "toe 400, arch 20", "toe 2000, arch 5", "toe 5, arch 400")
    for arm in toes:
        says(row(arm))
    causes = {arm: [cause_of(result) for result in walked.values()] for arm, walked in hypotheses().items()}
    forward = {arm: found.count("forward") for arm, found in causes.items()}
    assert forward[toes[0]] == forward["soft, 5"]
    arch = [f"long arch, {k}" for k in (1, 5, 20, 80)]
    rates = {arm: rate(arm, "forward")[0] for arm in (*arch, *toes)}
    assert max(rates, key=rates.__getitem__) == toes[-1]
    p = holm([gain(arm, other, steps)[1] for arm in toes for other in ("soft, 80", "rigid")])
    says(f"(p ≥ {min(value for value in p if value is not None):.2f} after Holm's correction for eight)")


def more_steps(parts: dict[str, dict[Layout, Result]]) -> dict[str, np.ndarray]:
    """Steps that walks with a part changed do more than those with nothing changed on the same layouts."""
    return {
        name: np.array([steps(walks_of[at]) - steps(parts[NONE][at]) for at in sorted(walks_of)])
        for name, walks_of in parts.items()
        if name != NONE
    }


def established(more: dict[str, np.ndarray], level: float) -> set[str]:
    p_values = holm([sign_flip_p(list(gained)) for gained in more.values()])
    return {name for name, p in zip(more, p_values, strict=True) if p is not None and p <= level}


def test_which_part_of_the_law_closes_the_gap() -> None:
    """The table of the studies 'attribution' and 'indispensable', by layouts, and what is said of their rules."""
    added, taken = parts_of("attribution", 0.5), parts_of("indispensable", 0.4)
    gains, losses = more_steps(added), more_steps(taken)
    whole = gains[WHOLE]
    drawn = np.random.default_rng(0).integers(0, len(whole), (10_000, len(whole)))
    for name in {*gains, *losses}:
        cells = [name]
        if name in gains:
            assert len(gains[name]) == 100
            share = (gains[name][drawn].mean(1) / whole[drawn].mean(1)).tolist()
            low, high = (round(100.0 * float(np.quantile(share, q))) for q in (0.025, 0.975))
            part = f"{100.0 * gains[name].mean() / whole.mean():.0f} [{low}, {high}] %"
            cells += [
                str(sum(map(arrived, added[name].values()))),
                interval(list(gains[name])),
                "" if name == WHOLE else signed(part),
            ]
        else:
            cells += ["", "", ""]
        if name in losses:
            assert len(losses[name]) == 50
            cells += [str(sum(map(arrived, taken[name].values()))), interval(list(losses[name]))]
        else:
            cells += ["", ""]
        says(re.sub(r" +", " ", f"| {' | '.join(cells)} |"))
    assert established(gains, 0.003) == {PARTS["gains.cop_admittance"], "lean", WHOLE}
    needed = {PARTS[key] for key in ("gains.dcm_p", "gains.cop_admittance", "gains.support_height_leak")}
    assert established(losses, 0.002) == established(losses, 0.05) == needed
    says(f"{sum(map(arrived, added[NONE].values()))} of 100 walks arrive, by the default law")
    says(f"on which {sum(map(arrived, taken[NONE].values()))} of 50 walks by the whole default law arrive")
    falls = [cause_of(r) for r in added[NONE].values()].count("sideways")
    says(f"it falls sideways {falls / sum(map(steps, added[NONE].values())) * 1e3:.0f} times in 1,000 steps")


def test_the_gains_together_close_two_thirds_of_the_gap() -> None:
    """The study 'gains': those that the default law cannot do without, in the paper's law."""
    arms: dict[str, dict[Layout, Result]] = defaultdict(dict)
    names = {0: "paper", 2: "DCM", 4: "DCM and CoP admittance", 7: "all"}
    for spec, result in walks("gains"):
        name = "default" if spec["gains"] == "default" else names[len(spec["changes"])]
        arms[name][spec["terrain"], spec["seed"]] = result
    layouts = sorted(arms["paper"])
    assert {len(walks_of) for walks_of in arms.values()} == {len(layouts)} == {40}

    def more(one: str, other: str) -> list[float]:
        return [steps(arms[one][at]) - steps(arms[other][at]) for at in layouts]

    says(f"those of the DCM alone lose {interval([-gained for gained in more('DCM', 'paper')])} steps")
    says(f"with the admittance they gain {interval(more('DCM and CoP admittance', 'paper'))}")
    done = {name: sum(map(arrived, walks_of.values())) for name, walks_of in arms.items()}
    says(
        f"all of them {interval(more('all', 'paper'))}: {done['all']} of 40 walks arrive, {done['paper']} without, "
        f"{done['default']} by the default law"
    )
    says(f"the default law does {interval(more('default', 'all'))} steps more")
    share = np.mean(more("all", "paper")) / np.mean(more("default", "paper"))
    assert 0.6 < share < 0.7
    changed = {name: np.array(more(name, "paper")) for name in ("DCM", "DCM and CoP admittance", "all")}
    assert established(changed, 0.05) == {"DCM", "all"}


def test_under_the_stepping_walk_no_soft_sole_goes_further() -> None:
    """The table of the study 'stepping_soles' beside the LIPM walks of the same layouts, and its rule."""
    soles, lipm = stepping_soles(), hypotheses()
    families = {family for family, _ in soles["rigid"]}
    share = {f: np.mean([arrived(w[at]) for w in soles.values() for at in w if at[0] == f]) for f in families}
    pairs = [at for at in soles["rigid"] if 0.1 <= share[at[0]] <= 0.9]
    of_pairs = [family for family, _ in pairs]
    assert len(set(of_pairs)) == 10
    counts, further, beside, forward = {}, {}, {}, {}
    for name, results in soles.items():
        more = [100.0 * (arrived(results[at]) - arrived(lipm[name][at])) for at in results]
        beside[name] = sign_flip_p(more, [family for family, _ in results])
        counts[name] = [sum(map(arrived, some.values())) for some in (results, lipm[name])]
        forward[name] = [cause_of(result) for result in results.values()].count("forward")
        peak = np.mean([result["impact"] for result in results.values() if arrived(result)])
        text = interval(more, [family for family, _ in results], 0)
        says(f"| {name} | {counts[name][0]} | {counts[name][1]} | {text} | {peak:.1f} |")
        if name != "rigid":
            metres = [results[at]["distance"] - soles["rigid"][at]["distance"] for at in pairs]
            further[name] = sign_flip_p(metres, of_pairs)
            word = {
                "soft, 80": " m further than rigid",
                "soft, 5": " m, the arch",
                "long arch, 5": " m (p = 0.04",
            }
            says(f"{interval(metres, of_pairs, 2)}{word[name]}")
    p = dict(zip(further, holm(list(further.values())), strict=True))
    assert {name for name in p if p[name] < 0.05} == {"long arch, 5"} and f"{p['long arch, 5']:.2f}" == "0.04"
    p = dict(zip(beside, holm(list(beside.values())), strict=True))
    assert {name for name in p if p[name] < 0.05} == {"long arch, 5"}
    says(f"(p = {p['long arch, 5']:.3f} after Holm's correction for the four soles)")
    won = [[counts[name][i] - counts["rigid"][i] for name in further] for i in (0, 1)]
    says(
        f"Where the LIPM walk gains {min(won[1])} to {max(won[1])} walks by softness, the stepping walk loses "
        f"{-max(won[0])} to {-min(won[0])}"
    )
    says(
        f"{forward['soft, 5']} times in 340 walks with 5 Nm/rad and {forward['long arch, 5']} times on the arch, "
        f"{forward['rigid']} times on the rigid sole"
    )
