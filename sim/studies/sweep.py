"""Sweeps: many trials run by an executor, each written to a journal when it ends, none run twice.

    with Journal("sweep.jsonl") as journal:
        summary = sweep(specs, journal, workers=2)

Any executor of the protocol of `concurrent.futures` will do, such as Dask's `Client.get_executor()`. Without one,
local processes run the trials, each with one thread for linear algebra. They end with the process that has started
them, and one that a trial crashes is started again.
"""

from __future__ import annotations

import contextlib
import inspect
import logging
import multiprocessing
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass, field
from typing import Any

from wbc.core.arguments import checked
from wbc.core.errors import InputError, WbcError, check_parts, positive, shown
from wbc.core.settings import to_json
from wbc.sim.studies.journal import Entry, Journal, Status, trial_key
from wbc.sim.studies.provenance import differences, provenance
from wbc.sim.studies.trials import Outcome, Trial, run_trial, trial_from_json

TIMEOUT = 600.0
"""Default time-out of a trial, s: a walk of 22 steps takes some ten seconds of wall time."""

IN_FLIGHT = 64
"""Number of trials that a given executor holds at a time: more than a cluster of some dozen cores can run."""

STARTS = 5
"""Number of times in a row that every worker may end before a trial has begun: one that is killed while it starts ends
no sweep, a script whose processes cannot start does."""

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
        InputError: A number of workers below 1, a time-out that is not positive, a spec that is no trial, or a
            `progress` that is no function.
        JournalError: The journal cannot be written.
        SweepError: The executor has broken down or cancelled trials, or its processes have other code than this one.
    """
    if workers < 1 or in_flight < 1:
        raise InputError(f"workers and trials in flight must be at least 1, got {workers} and {in_flight}")
    if timeout is not None:
        positive("time-out of a trial (s)", timeout)
    if progress is not None and (not callable(progress) or inspect.isclass(progress)):
        raise InputError(f"progress must be a function of the summary, or none, got {shown(progress)}")
    begin = time.perf_counter()
    version = provenance()
    specs = list(specs)
    for spec in specs:
        check_parts("a trial", spec, "kind", "to_json")
    trials = {trial_key(plain, version): (spec, plain) for spec in specs for plain in [spec.to_json()]}
    known = by_spec(journal.entries.values()) if any_code else {}
    summary = SweepSummary(len(trials))
    pending: Pending = deque()
    for key, (spec, plain) in trials.items():
        if key in journal:
            status: Status | None = journal.entries.status(key)
        else:
            other = known.get(trial_key(plain, {})) if known else None
            status = None if other is None else other.status
        if status is None or (retry and status in ("crashed", "timeout")):
            pending.append((spec, plain))
        else:
            summary.found += 1
            summary.counts[status] = summary.counts.get(status, 0) + 1

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
        lost = _feed(executor, pending, timeout, in_flight, record)
        if lost:
            raise SweepError(
                f"the executor has broken down or cancelled trials; {summary.run} trials are written down, {len(lost)} "
                f"were lost and {len(pending)} not begun: run the sweep again"
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


Pending = deque[tuple[Trial, dict[str, Any]]]
Record = Callable[[dict[str, Any], Outcome], None]


def _run_locally(pending: Pending, workers: int, timeout: float | None, record: Record) -> None:
    """Run trials in local processes.

    Each process has a pool of its own: when one dies, the trial that it had is known, and the others go on. The trial
    has crashed if it had begun; otherwise the process was killed while it started, and the trial is given to another.

    Raises:
        SweepError: Processes end again and again before a trial has begun.
    """
    begun = multiprocessing.get_context("spawn").RawArray("b", len(pending))
    waiting = deque(range(len(pending)))
    failed_starts, most = 0, STARTS * workers
    running: dict[Future[Outcome], tuple[_Worker, int]] = {}
    with _local_workers(min(workers, len(pending)), begun) as pool:
        idle = list(pool)
        while waiting or running:
            while waiting and idle:
                worker, number = idle.pop(), waiting.popleft()
                running[worker.submit(number, pending[number][0], timeout, provenance())] = worker, number
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                worker, number = running.pop(future)
                idle.append(worker)
                if isinstance(_error(future), BrokenExecutor) and not begun[number]:
                    waiting.appendleft(number)
                    failed_starts += 1
                    if failed_starts == most:
                        raise SweepError(
                            f"processes for the trials have ended {most} times before one began; the standard error "
                            "may say why (a script that starts a sweep needs `if __name__ == '__main__':`)"
                        )
                else:
                    failed_starts = 0
                    record(pending[number][1], _outcome(future))


def _outcome(future: Future[Outcome]) -> Outcome:
    """Return the outcome of a trial that has ended, with or without its process.

    Raises:
        SweepError: The trial was not run, as its process has other code.
    """
    error = _error(future)
    if error is None:
        return future.result()
    if isinstance(error, SweepError):
        raise error
    if isinstance(error, BrokenExecutor):
        return Outcome("crashed", error="the process that ran it died")
    return Outcome("crashed", error=f"{type(error).__name__}: {error}")  # such as a spec that cannot be sent


def _error(future: Future[Outcome]) -> BaseException | None:
    return CancelledError() if future.cancelled() else future.exception()


def _feed(
    executor: Executor, pending: Pending, timeout: float | None, in_flight: int, record: Record
) -> Pending:
    """Keep a given executor busy until nothing is pending, or until it breaks or cancels a trial.

    Returns:
        Trials that were not run to their end, such as those of a cluster whose scheduler was restarted; none if all
        went well.
    """
    running: dict[Future[Outcome], tuple[Trial, dict[str, Any]]] = {}
    lost: Pending = deque()
    try:
        while pending or running:
            while pending and len(running) < in_flight and not lost:
                try:
                    future = executor.submit(_run, pending[0][0], timeout, provenance())
                except BrokenExecutor:
                    lost.append(pending.popleft())
                    break
                running[future] = pending.popleft()
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                trial = running.pop(future)
                if isinstance(_error(future), (BrokenExecutor, CancelledError)):
                    lost.append(trial)
                else:
                    record(trial[1], _outcome(future))
            if lost and not running:
                return lost
    except BaseException:
        for future in running:
            future.cancel()
        raise
    return lost


class _Worker:
    """One local process with one thread, started when it is needed, and again when it has died."""

    def __init__(self, begun: Any) -> None:
        self._begun = begun
        self._pool: ProcessPoolExecutor | None = None

    def submit(self, number: int, *trial: Any) -> Future[Outcome]:
        """Give the process the arguments of `_run`; `begun[number]` is set as soon as the trial begins."""
        if self._pool is not None:
            try:
                return self._pool.submit(_begin, number, *trial)
            except BrokenExecutor:
                self.end()
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(
            1, mp_context=context, initializer=_start_worker, initargs=(self._begun,)
        )
        return self._pool.submit(_begin, number, *trial)

    def end(self, *, wait: bool = True) -> None:
        """End the process after its trial."""
        if self._pool is not None:
            self._pool.shutdown(wait, cancel_futures=not wait)


@contextlib.contextmanager
def _local_workers(count: int, begun: Any) -> Iterator[list[_Worker]]:
    """Make local workers; their processes end when this process does, however it ends.

    Args:
        count: Number of workers.
        begun: Shared array with a byte for each trial.
    """
    workers = [_Worker(begun) for _ in range(count)]
    with _one_thread():
        try:
            yield workers
        except BaseException:
            for worker in workers:
                worker.end(wait=False)
            raise
        for worker in workers:
            worker.end()


@contextlib.contextmanager
def local_executor(workers: int) -> Iterator[Executor]:
    """Make an executor of local processes for many small sweeps, which take over its processes from one another.

    Each has one thread for linear algebra, and ends when this process does, however it ends.

    Args:
        workers: Number of processes.
    """
    context = multiprocessing.get_context("spawn")
    with (
        _one_thread(),
        ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker) as pool,
    ):
        yield pool


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


_begun: Any = None
"""In a local process, the array in which begun trials are marked, shared with the sweep. Every trial has its own byte:
a lock would never be released by a process that is killed."""


def _begin(number: int, spec: Trial, timeout: float | None, version: Mapping[str, Any]) -> Outcome:
    """Mark a trial as begun and run it, in a local process."""
    _begun[number] = 1
    return _run(spec, timeout, version, exit_when_stuck=True)


def _run(
    spec: Trial, timeout: float | None, version: Mapping[str, Any], *, exit_when_stuck: bool = False
) -> Outcome:
    """Run a trial, by the code that the journal will name alone.

    Raises:
        SweepError: This process has other code: sources have changed since the sweep began, or a cluster has its own.
    """
    if other := differences(version):
        raise SweepError(
            f"a process that runs trials has other code than the sweep, which has {', '.join(other)}; run the sweep "
            "again with one version of the code"
        )
    return run_trial(spec, timeout, exit_when_stuck=exit_when_stuck)


def _start_worker(begun: Any = None) -> None:
    """Prepare a local process."""
    global _begun  # noqa: PLW0603 - initializers have no other way to hand something to the calls
    _begun = begun
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
        from distributed import Client, LocalCluster  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError(
            "a distributed sweep needs Dask: pip install -e '.[cluster]' in the clone"
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
