"""Studies: trials, sweeps, the journal of their results, and tables and statistics made from it.

A study is a JSON file, such as those of `examples/studies`, or is made by a program; a new kind of trial is registered
with `register_trial`.
"""

from wbc.sim.studies import kinds  # noqa: F401 - it registers the kinds of trials of the library
from wbc.sim.studies.intervals import (
    Estimate,
    holm,
    mean_interval,
    rate_interval,
    share_interval,
    sign_flip_p,
)
from wbc.sim.studies.journal import Entry, Journal, JournalError, read_journal
from wbc.sim.studies.outcomes import Outcome, TrialKind, register_trial, run_trial, trial_from_json
from wbc.sim.studies.study import Cell, Study, study_entries
from wbc.sim.studies.study_table import StudyTable, study_frame, study_table
from wbc.sim.studies.sweep import SweepError, SweepSummary, cluster_executor, local_executor, sweep

__all__ = [
    # A study and its trials
    "Cell",
    "Study",
    "Outcome",
    "TrialKind",
    "register_trial",
    "run_trial",
    "trial_from_json",
    # Many trials
    "SweepError",
    "SweepSummary",
    "cluster_executor",
    "local_executor",
    "sweep",
    # Their results
    "Entry",
    "Journal",
    "JournalError",
    "read_journal",
    "study_entries",
    # Tables
    "StudyTable",
    "study_frame",
    "study_table",
    # Statistics
    "Estimate",
    "holm",
    "mean_interval",
    "rate_interval",
    "share_interval",
    "sign_flip_p",
]
