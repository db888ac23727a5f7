"""Models of the best stiffness from roughness: trained, and judged on grounds that they were not trained on.

    python examples/paper/models.py train table.csv -o model.json     # for `wbc walk --policy model`
    python examples/paper/models.py judge table.csv                   # the paper's model beside others

A table is one of labels.py, or the file that the paper's authors published (`scripts/tot.csv` of their controller): no
header, a row for each trajectory with Sp, P, P², Sku³, P³, Sp³ and the cluster of its stiffness.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from labels import data_set
from numpy.typing import NDArray
from scipy.linalg import qr, svd
from sklearn.decomposition import PCA
from sklearn.dummy import DummyClassifier, DummyRegressor
from sklearn.ensemble import RandomForestRegressor
from sklearn.model_selection import GroupKFold, StratifiedKFold, cross_val_predict
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.svm import SVR
from walks import MODELS, markdown, walks

from wbc.feet import StiffnessModel
from wbc.feet.sensing.roughness import PARAMETERS
from wbc.feet.stiffness.model import PAPER_FEATURES, Clusters, ModelSettings, feature_values

Array = NDArray[np.float64]


DEFAULT_TABLE = MODELS / "stiffness_table.csv"
"""Training data of the model that comes with the library: 1,920 walks of version 1."""

WINDOW_FEATURES = ("sqrt(Sz)", "sqrt(P)", "Ssk", "Sku", "lines")
"""Features for the short profile of one swing, chosen here: without powers, which give rare bumps too much weight."""

CLUSTERS = {"paper": Clusters(), "log": Clusters((0.0, *np.geomspace(1.0, 2000.0, 10).tolist()))}
"""Classes of stiffness: twenty of 4 Nm/rad, or one below 1 and nine of one ratio up to 2,000 Nm/rad."""


def clusters_of(stiffness: pd.Series | Array) -> Clusters:
    """Return the paper's classes if they reach the greatest stiffness, Nm/rad, else the others."""
    return CLUSTERS["paper" if stiffness.max() <= 80.0 else "log"]


SPLITS: dict[str, list[str]] = {
    "grounds": ["ground"],
    "amplitudes": ["ground", "amplitude"],
    "layouts": ["ground", "seed"],
    "shuffled": [],
    "paper": [],
}
"""Ways to split a table: what is on one side of a fold. In "paper" folds follow the order of the rows, so that profiles
of one ground are on both sides; "grounds" compares to a walk on unknown ground."""


def read_table(path: str | Path) -> pd.DataFrame:
    """Return a table of labels.py, or the one of the paper's authors, whose grounds and trajectories are numbered.

    Their rows come in blocks of six trajectories for each amplitude and five amplitudes for each ground. Of the
    parameters only Sp, P and Sku are known; the others are 0. The stiffness is the middle of its cluster.
    """
    first = Path(path).read_text(encoding="utf-8").partition("\n")[0]
    if first.startswith(("#", "ground")):
        return pd.read_csv(path, comment="#")
    theirs = pd.read_csv(path, header=None)
    if theirs.shape[1] != len(PAPER_FEATURES) + 1 or len(theirs) % 30:
        raise SystemExit(
            f"{path} is no table of the paper's authors: it needs seven columns and 30 rows a ground"
        )
    index = np.arange(len(theirs))
    known = {"Sp": theirs[0], "P": theirs[1], "Sku": np.cbrt(theirs[3])}
    return pd.DataFrame(
        {
            "ground": 1 + index // 30, "amplitude": 1.0 + index % 30 // 6, "seed": index % 6, "window": 0,
            **{name: known.get(name, 0.0) for name in PARAMETERS},
            "stiffness": CLUSTERS["paper"].centres[theirs[6].to_numpy(int) - 1],
        }
    )  # fmt: skip


def dataset_of(journal: str | Path) -> pd.DataFrame:
    """Return the table of a journal of the study 'dataset', three windows a ground."""
    return data_set(walks(journal), windows=3)


@dataclass(frozen=True)
class Candidate:
    """A model to judge: its name, a pipeline from roughness parameters, and whether it predicts a class."""

    name: str
    pipeline: Pipeline
    classifies: bool = True


def pipeline(
    features: tuple[str, ...] = PAPER_FEATURES, kind: str = "classification", neighbours: int = 10
) -> Pipeline:
    """Return scikit-learn's model of nearest neighbours, from roughness parameters to cluster or stiffness."""
    model = KNeighborsClassifier if kind == "classification" else KNeighborsRegressor
    taken = FunctionTransformer(feature_values, kw_args={"names": features})
    return make_pipeline(taken, StandardScaler(), model(neighbours, weights="distance", algorithm="kd_tree"))


def candidates(features: Iterable[str] = ("paper", "window")) -> list[Candidate]:
    """Return the paper's model, variations of it, other kinds of models, and two baselines without features."""
    names = {"paper": PAPER_FEATURES, "window": WINDOW_FEATURES}
    found = []
    for which in features:
        for kind in ("classification", "regression"):
            for neighbours in (10, 30):
                own = " (paper)" if (which, kind, neighbours) == ("paper", "classification", 10) else ""
                name = f"KNN {neighbours}{'' if kind == 'classification' else ' regression'}, {which}'s features{own}"
                model = pipeline(names[which], kind, neighbours)
                found.append(Candidate(name, model, kind == "classification"))
        taken = FunctionTransformer(feature_values, kw_args={"names": names[which]})
        others = {"support vectors": make_pipeline(taken, StandardScaler(), SVR(C=10.0, epsilon=1.0))}
        others["random forest"] = make_pipeline(
            taken, RandomForestRegressor(100, min_samples_leaf=3, random_state=0)
        )
        found += [Candidate(f"{name}, {which}'s features", each, False) for name, each in others.items()]
    found.append(Candidate("largest class", make_pipeline(DummyClassifier(strategy="most_frequent"))))
    return [*found, Candidate("median stiffness", make_pipeline(DummyRegressor(strategy="median")), False)]


def splitter(table: pd.DataFrame, split: str, folds: int) -> tuple[Any, NDArray[np.intp] | None]:
    """Return scikit-learn's splitter and the groups of the rows."""
    if not SPLITS[split]:
        shuffle = split == "shuffled"
        return StratifiedKFold(folds, shuffle=shuffle, random_state=0 if shuffle else None), None
    groups = pd.factorize(pd.MultiIndex.from_frame(table[SPLITS[split]]))[0]
    return GroupKFold(min(folds, int(groups.max()) + 1)), groups


def judge(
    table: pd.DataFrame, model: Candidate, split: str, clusters: Clusters, folds: int = 10
) -> dict[str, float]:
    """Return how well a model commands the stiffness of rows that it was not trained on.

    Accuracy is the share in the right class, with its standard deviation over the folds; the rest is over all rows.
    """
    values, best = table[list(PARAMETERS)].to_numpy(), table["stiffness"].to_numpy(float)
    labels = clusters.of(best)
    split_by, groups = splitter(table, split, folds)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # classes of fewer rows than folds, as in the paper's data
        parts = list(split_by.split(values, labels, groups))
        predicted = cross_val_predict(model.pipeline, values, labels if model.classifies else best, cv=parts)
    command = clusters.centres[predicted.astype(int) - 1] if model.classifies else predicted
    found = clusters.of(np.clip(command, clusters.edges[0], clusters.edges[-1]))
    right = np.array([(found[test] == labels[test]).mean() for _, test in parts])
    result = {
        "accuracy": float(right.mean()),
        "spread": float(right.std()),
        "error": float(np.abs(command - best).mean()),
        "within one": float((np.abs(found - labels) <= 1).mean()),
    }
    if "stiffness_low" in table:
        nearly = (command >= table["stiffness_low"]) & (command <= table["stiffness_high"])
        result["nearly best"] = float(nearly.mean())
    return result


def comparison(table: pd.DataFrame, names: Sequence[str] = (), folds: int = 10) -> str:
    """Return the cross-validations of models by each split as Markdown, in classes of the table's range."""
    clusters = clusters_of(table["stiffness"])
    known = ("paper", "window") if table["Sa"].any() else ("paper",)
    models = [each for each in candidates(known) if not names or each.name in names]
    rows = []
    for split in SPLITS:
        for model in models:
            r = judge(table, model, split, clusters, folds)
            nearly = f"{r['nearly best']:.2f}" if "nearly best" in r else ""
            accuracy = f"{r['accuracy']:.2f} ± {r['spread']:.2f}"
            rows.append([split, model.name, accuracy, f"{r['error']:.1f}", f"{r['within one']:.2f}", nearly])
    return markdown(
        ["split", "model", "accuracy", "mean error (Nm/rad)", "within one class", "nearly best"], rows
    )


@dataclass(frozen=True)
class Selection:
    """Result of a selection of features.

    Attributes:
        kept: Selected features, the most independent first.
        twins: Pairs (left out, kept) of features that are the same up to a factor, such as M and Sq^2.
        condition: Condition number of the selected features.
    """

    kept: tuple[str, ...]
    twins: tuple[tuple[str, str], ...]
    condition: float


def select_features(values: Array, powers: Sequence[int] = (1, 2, 3), bound: float = 5.0) -> Selection:
    """Select features by rank and pivoted QR, as in the paper's section IV-B.

    The columns are scaled to a mean of 0 and a deviation of 1, because a QR with pivoting takes the longest column
    first and the parameters differ in magnitude. The rank is the number of singular values within `bound` of the
    largest. QR with column pivoting then orders the columns: next is always the one with the largest part that the
    columns before it do not explain. Of equally long columns the one with the largest share in the first singular
    vector is first, so that the selection depends neither on units nor on the order of the profiles.

    Source: Golub & Van Loan, Matrix Computations, sections 5.4.2 (column pivoting) and 5.5.7 (subset selection).
    """
    names = [name if p == 1 else f"{name}^{p}" for p in powers for name in PARAMETERS]
    matrix = feature_values(values, tuple(names))
    varies = matrix.std(axis=0) > 1e-12 * np.abs(matrix).max(axis=0)
    names = [name for name, own in zip(names, varies, strict=True) if own]
    scaled = (matrix[:, varies] - matrix[:, varies].mean(axis=0)) / matrix[:, varies].std(axis=0)
    unit = scaled / np.linalg.norm(scaled, axis=0)
    first = np.argmax(
        np.abs(unit.T @ unit) > 1.0 - 1e-12, axis=0
    )  # multiples of each other: rounding would choose
    twins = tuple((names[j], names[i]) for j, i in enumerate(first) if i != j)
    keep = np.flatnonzero(first == np.arange(first.size))
    names, scaled = [names[i] for i in keep], scaled[:, keep]
    _, sigma, vt = svd(scaled, full_matrices=False)
    rank = int((sigma * bound >= sigma[0]).sum())
    tie_break = 1.0 + 1e-9 * np.abs(vt[0]) / np.abs(vt[0]).max()
    order = qr(scaled * tie_break, mode="economic", pivoting=True)[2][:rank]
    own = svd(scaled[:, order], compute_uv=False)
    return Selection(tuple(names[i] for i in order), twins, float(own[0] / own[-1]))


def learning_curve(table: pd.DataFrame, points: int = 6, repetitions: int = 10) -> tuple[Array, Array, Array]:
    """Return numbers of training grounds (k,), and accuracy and mean error (Nm/rad) on others, (k, repetitions)."""
    values, best = table[list(PARAMETERS)].to_numpy(), table["stiffness"].to_numpy(float)
    clusters = clusters_of(best)
    labels = clusters.of(best)
    groups = pd.factorize(pd.MultiIndex.from_frame(table[["ground", "amplitude"]]))[0]
    number = int(groups.max()) + 1
    tested = max(1, round(0.25 * number))
    fewest = int(np.searchsorted(np.cumsum(np.sort(np.bincount(groups))), ModelSettings.neighbours)) + 1
    sizes = np.unique(np.geomspace(fewest, number - tested, points).round().astype(int))
    accuracy, error = np.empty((sizes.size, repetitions)), np.empty((sizes.size, repetitions))
    rng = np.random.default_rng(0)
    for j in range(repetitions):
        order = rng.permutation(number)
        test = np.isin(groups, order[:tested])
        for i, size in enumerate(sizes):
            train = np.isin(groups, order[tested : tested + size])
            predicted = pipeline().fit(values[train], labels[train]).predict(values[test])
            accuracy[i, j] = (predicted == labels[test]).mean()
            error[i, j] = np.abs(clusters.centres[predicted - 1] - best[test]).mean()
    return sizes, accuracy, error


def principal_components(table: pd.DataFrame) -> tuple[Array, Array]:
    """Return the shares of the components of the paper's features, and the rows in the first two."""
    scaled = StandardScaler().fit_transform(feature_values(table[list(PARAMETERS)], PAPER_FEATURES))
    pca = PCA().fit(scaled)
    return pca.explained_variance_ratio_, pca.transform(scaled)[:, :2]


def amplitude_trends(table: pd.DataFrame) -> pd.Series:
    """Return Spearman's correlation of amplitude and mean best stiffness on each ground."""
    means = table.groupby(["ground", "amplitude"])["stiffness"].mean().reset_index()
    return means.groupby("ground")[["amplitude", "stiffness"]].apply(
        lambda g: g["amplitude"].corr(g["stiffness"], "spearman")
    )


def train(table: pd.DataFrame, settings: ModelSettings, made: dict[str, Any]) -> StiffnessModel:
    """Return the model of a table."""
    groups = pd.factorize(pd.MultiIndex.from_frame(table[["ground", "amplitude"]]))[0]
    return StiffnessModel.fit(table[list(PARAMETERS)], table["stiffness"], groups, settings, made=made)


def main() -> None:
    """Train or judge."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("do", choices=("train", "judge"))
    parser.add_argument("table", nargs="?", default=DEFAULT_TABLE, type=Path)
    parser.add_argument("-o", "--out", type=Path, help="model that train writes (.json)")
    parser.add_argument("--features", choices=("paper", "window", "select"), default="paper")
    parser.add_argument("--neighbours", type=int, default=10)
    parser.add_argument("--kind", choices=("classification", "regression"), default="classification")
    parser.add_argument("--clusters", choices=tuple(CLUSTERS), help="by the greatest stiffness if not given")
    parser.add_argument("--folds", type=int, default=10)
    options = parser.parse_args()
    table = read_table(options.table)
    values = table[list(PARAMETERS)].to_numpy()
    if options.do == "judge":
        print(comparison(table, folds=options.folds))
        sizes, accuracy, _ = learning_curve(table)
        curve = ", ".join(f"{n}: {a:.2f}" for n, a in zip(sizes, accuracy.mean(axis=1), strict=True))
        print(f"\naccuracy by the number of training grounds: {curve}")
        print(
            f"two principal components hold {100.0 * principal_components(table)[0][:2].sum():.0f} % of the variance"
        )
        print(
            f"rank correlation of best stiffness and amplitude:\n{amplitude_trends(table).round(2).to_string()}"
        )
        if table["Sa"].any():
            print(f"features that the table would choose: {', '.join(select_features(values).kept)}")
        return
    if options.out is None:
        parser.error("give the model to write: -o model.json")
    features = {"paper": PAPER_FEATURES, "window": WINDOW_FEATURES}.get(options.features) or select_features(
        values
    ).kept
    clusters = CLUSTERS[options.clusters] if options.clusters else clusters_of(table["stiffness"])
    settings = ModelSettings(features, options.neighbours, clusters, options.kind)
    model = train(table, settings, {"table": str(options.table)})
    model.save(options.out)
    print(f"{options.out}: {settings.neighbours} nearest of {len(table)} profiles by {', '.join(features)}")


if __name__ == "__main__":
    main()
