"""Sweeps: many trials run by an executor, each written to a journal when it ends, none run twice.

    with Journal("sweep.jsonl") as journal:
        summary = sweep(specs, journal, workers=2)

Any executor of the protocol of `concurrent.futures` will do, such as Dask's `Client.get_executor()`. Without one,
local processes run the trials, each with one thread for linear algebra. They end with the process that has started
them, and one that a trial crashes is started again.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any

from wbc.core.arguments import checked
from wbc.core.errors import InputError, WbcError, positive
from wbc.core.settings import to_json
from wbc.sim.studies.journal import Entry, Journal, trial_key
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.trials import Outcome, Trial, run_trial, trial_from_json

TIMEOUT = 600.0
"""Default time-out of a trial, s: a walk of 22 steps takes some ten seconds of wall time."""

IN_FLIGHT = 64
"""Number of trials that a given executor holds at a time: more than a cluster of some dozen cores can run."""

THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
"""Variables that limit the threads of the libraries for linear algebra; they must be set before these are loaded."""

_log = logging.getLogger(__name__)


class SweepError(WbcError):
    """A sweep that cannot go on; trials that have ended are in the journal."""


@dataclass
class SweepSummary:
    """Progress of a sweep.

    Attributes:
        total: Number of different trials.
        found: Number of trials that were in the journal before.
        run: Number of trials run by this sweep, however they ended.
        counts: Trials that are in the journal now: status → number.
        seconds: Wall time of the sweep, s.
    """

    total: int
    found: int = 0
    run: int = 0
    counts: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def per_hour(self) -> float | None:
        """Trials per hour of wall time; None before the first."""
        return 3600.0 * self.run / self.seconds if self.run and self.seconds > 0.0 else None

    def to_json(self) -> dict[str, Any]:
        """Return the summary as plain values."""
        return {**to_json(self), "per_hour": self.per_hour}


Progress = Callable[[SweepSummary], None]
"""Function that is called when a sweep begins and after each trial."""


@checked
def sweep(
    specs: Iterable[Trial],
    journal: Journal,
    *,
    executor: Executor | None = None,
    workers: int = 1,
    timeout: float | None = TIMEOUT,
    retry: bool = False,
    any_code: bool = False,
    in_flight: int = IN_FLIGHT,
    progress: Progress | None = None,
) -> SweepSummary:
    """Run all trials that the journal does not have.

    Args:
        specs: The trials; equal ones are run once.
        journal: Journal to which each trial is written as soon as it has ended.
        executor: Executor that runs them; local processes when None.
        workers: Number of local processes.
        timeout: Wall time that a trial may take, s; unlimited when None.
        retry: Run trials again that crashed or timed out.
        any_code: Accept results of other versions of the code, too.
        in_flight: Number of trials that a given executor holds at a time.
        progress: Called when the sweep begins and after each trial.

    Raises:
        InputError: A number of workers below 1, or a time-out that is not positive.
        JournalError: The journal cannot be written.
        SweepError: The executor has broken down.
    """
    if workers < 1 or in_flight < 1:
        raise InputError(f"workers and trials in flight must be at least 1, got {workers} and {in_flight}")
    if timeout is not None:
        positive("time-out of a trial (s)", timeout)
    begin = time.perf_counter()
    version = provenance()
    trials = {trial_key(plain, version): (spec, plain) for spec in specs for plain in [spec.to_json()]}
    known = by_spec(journal.entries.values()) if any_code else {}
    summary = SweepSummary(len(trials))
    pending: list[tuple[Trial, dict[str, Any]]] = []
    for key, (spec, plain) in trials.items():
        entry = journal.entries.get(key) or known.get(trial_key(plain, {}))
        if entry is None or (retry and entry.status in ("crashed", "timeout")):
            pending.append((spec, plain))
        else:
            summary.found += 1
            summary.counts[entry.status] = summary.counts.get(entry.status, 0) + 1

    def record(plain: dict[str, Any], outcome: Outcome) -> None:
        journal.add(Entry(plain, outcome.status, outcome.result, outcome.clock, outcome.error, version))
        summary.run += 1
        summary.counts[outcome.status] = summary.counts.get(outcome.status, 0) + 1
        summary.seconds = time.perf_counter() - begin
        if progress is not None:
            progress(summary)

    if progress is not None:
        progress(summary)
    if executor is not None:
        left = _feed(executor, pending, timeout, in_flight, record, ours=False)
        if left:
            raise SweepError(
                f"the executor has broken down; {summary.run} trials are written down, {len(left)} were lost and "
                "the rest not begun: run the sweep again"
            )
    elif pending:
        _run_locally(pending, workers, timeout, record)
    summary.seconds = time.perf_counter() - begin
    return summary


def by_spec(entries: Iterable[Entry]) -> dict[str, Entry]:
    """Return entries by the key of their spec alone, whatever code made them.

    Specs are read and written again, so that those of earlier versions have the keys of today; specs that cannot be
    read any more are left out.
    """
    found = {}
    for entry in entries:
        try:
            found[trial_key(trial_from_json(entry.spec).to_json(), {})] = entry
        except (InputError, TypeError):
            continue
    return found


Pending = list[tuple[Trial, dict[str, Any]]]
Record = Callable[[dict[str, Any], Outcome], None]


def _run_locally(pending: Pending, workers: int, timeout: float | None, record: Record) -> None:
    """Run trials in local processes.

    A process that dies takes the pool with it, and it is unknown which trial did it. Those in flight are then run one
    by one, so that the next one that dies is the culprit.
    """
    suspects: Pending = []
    while pending or suspects:
        if suspects:
            lost = _feed_new_pool(suspects[:1], 1, timeout, record)
            if lost:
                record(lost[0][1], Outcome("crashed", error="the process that ran it died"))
            del suspects[:1]
        else:
            lost = _feed_new_pool(pending, min(workers, len(pending)), timeout, record)
            if workers == 1 and lost:
                record(lost[0][1], Outcome("crashed", error="the process that ran it died"))
            else:
                suspects = lost


def _feed_new_pool(pending: Pending, workers: int, timeout: float | None, record: Record) -> Pending:
    """Run trials in a new pool; remove those begun from the list, and return those lost if the pool broke."""
    with local_executor(workers) as pool:
        try:
            pool.submit(os.getpid).result()
        except BrokenExecutor as error:
            raise SweepError(
                "processes for the trials do not start; the standard error says why "
                "(a script that starts a sweep needs `if __name__ == '__main__':`)"
            ) from error
        return _feed(pool, pending, timeout, workers, record, ours=True)


def _feed(
    executor: Executor, pending: Pending, timeout: float | None, in_flight: int, record: Record, *, ours: bool
) -> Pending:
    """Keep an executor busy until nothing is pending.

    Returns:
        Trials that were lost with an executor that broke; none if all went well.
    """
    running: dict[Future[Outcome], tuple[Trial, dict[str, Any]]] = {}
    lost: Pending = []
    try:
        while pending or running:
            while pending and len(running) < in_flight and not lost:
                spec, plain = pending[0]
                try:
                    future = executor.submit(run_trial, spec, timeout, exit_when_stuck=ours)
                except BrokenExecutor:
                    if not running:  # broken before anything was begun: trying again would never end
                        raise
                    break
                running[future] = (spec, plain)
                del pending[0]
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                trial = running.pop(future)
                try:
                    outcome = future.result()
                except BrokenExecutor:
                    lost.append(trial)
                except Exception as error:  # of the executor, or a spec that cannot be sent
                    record(trial[1], Outcome("crashed", error=f"{type(error).__name__}: {error}"))
                else:
                    record(trial[1], outcome)
            if lost and not running:
                return lost
    except BaseException:
        for future in running:
            future.cancel()
        raise
    return lost


@contextlib.contextmanager
def local_executor(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of new processes with one thread each; they end when this process does, however it ends.

    Args:
        workers: Number of processes.
    """
    context = multiprocessing.get_context("spawn")
    with _one_thread():
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker)
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        pool.shutdown()


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Limit the threads of processes that are started meanwhile."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _start_worker() -> None:
    """Prepare a local process."""
    logging.getLogger().setLevel(logging.ERROR)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True, name="follow the sweep").start()


@checked
def cluster_executor(
    address: str, *, workers: int | None = None
) -> contextlib.AbstractContextManager[Executor]:
    """Connect to a Dask cluster, and return its executor.

    Args:
        address: Address of the scheduler, such as "tcp://10.0.0.1:8786"; "local" starts a cluster on this machine.
        workers: Number of processes of a local cluster; as many as cores when None.

    Raises:
        InputError: Dask is not installed, or no scheduler answers at that address.
    """
    return _dask(address, workers)


@contextlib.contextmanager
def _dask(address: str, workers: int | None) -> Iterator[Executor]:
    try:
        from distributed import Client, LocalCluster  # type: ignore[import-not-found] # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError(
            "a distributed sweep needs Dask: install the extra 'cluster', wbc[cluster]"
        ) from error
    logging.getLogger("distributed").setLevel(logging.WARNING)
    with contextlib.ExitStack() as stack:
        if address == "local":
            stack.enter_context(_one_thread())
            cluster = stack.enter_context(
                LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None)
            )
            client = stack.enter_context(Client(cluster))
        else:
            try:
                client = stack.enter_context(Client(address, timeout="10s"))
            except (OSError, ValueError) as error:
                raise InputError(f"no Dask scheduler answers at '{address}': {error}") from error
        yield stack.enter_context(client.get_executor())
