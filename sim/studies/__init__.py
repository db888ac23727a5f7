"""Studies: trials, sweeps, the journal of their results, and tables and statistics made from it.

A new study is a function in `catalog` with one line in its table, or a JSON file of your own; a new kind of trial is
registered with `register_trial`.
"""

from wbc.sim.studies.best_stiffness import Label, best_stiffness, label_table, labels, stiffness_table
from wbc.sim.studies.catalog import STUDIES, study_by_name
from wbc.sim.studies.intervals import (
    Equivalence,
    Estimate,
    equivalence,
    holm,
    mean_interval,
    rate_interval,
    share_interval,
    sign_flip_p,
)
from wbc.sim.studies.journal import Entry, Journal, JournalError, read_journal, trial_key
from wbc.sim.studies.study import Cell, Study, StudyTrial, study_entries
from wbc.sim.studies.study_table import StudyTable, TableCell, study_rows, study_table
from wbc.sim.studies.sweep import SweepError, SweepSummary, cluster_executor, sweep
from wbc.sim.studies.swing_summary import SwingSummary, swing_summaries, swing_table
from wbc.sim.studies.trials import (
    Check,
    Outcome,
    Trial,
    TrialKind,
    TrialTimeout,
    WalkPushLimitSpec,
    register_trial,
    run_trial,
    trial_from_json,
)

__all__ = [
    # studies
    "STUDIES",
    "Cell",
    "Study",
    "StudyTrial",
    "study_by_name",
    # trials
    "Check",
    "Outcome",
    "Trial",
    "TrialKind",
    "TrialTimeout",
    "WalkPushLimitSpec",
    "register_trial",
    "run_trial",
    "trial_from_json",
    # sweeps
    "SweepError",
    "SweepSummary",
    "cluster_executor",
    "sweep",
    # journals
    "Entry",
    "Journal",
    "JournalError",
    "read_journal",
    "study_entries",
    "trial_key",
    # tables and statistics
    "Equivalence",
    "Estimate",
    "StudyTable",
    "TableCell",
    "equivalence",
    "holm",
    "mean_interval",
    "rate_interval",
    "share_interval",
    "sign_flip_p",
    "study_rows",
    "study_table",
    # soles
    "Label",
    "SwingSummary",
    "best_stiffness",
    "label_table",
    "labels",
    "stiffness_table",
    "swing_summaries",
    "swing_table",
]
