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
from typing import Annotated, Any

from wbc.core.arguments import checked
from wbc.core.errors import InputError, WbcError, check_parts, shown
from wbc.core.settings import Count, Positive, to_json
from wbc.sim.studies.journal import Entry, Journal, trial_key
from wbc.sim.studies.provenance import differences, provenance
from wbc.sim.studies.trials import Outcome, Trial, run_trial

TIMEOUT = 600.0
"""Default time-out of a trial, s: a walk of 22 steps takes some ten seconds of wall time."""

IN_FLIGHT = 1000
"""Number of trials that a given executor holds at a time: more than a cluster can run."""

STARTS = 5
"""Number of times in a row that a process may end before its trial has begun: a script whose processes cannot start
ends its sweep, one that is killed while it starts does not."""

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
    workers: Count = 1,
    timeout: Annotated[Positive, "s"] | None = TIMEOUT,
    retry: bool = False,
    progress: Progress | None = None,
) -> SweepSummary:
    """Run all trials that the journal does not have.

    Args:
        specs: The trials; equal ones are run once.
        journal: Journal to which each trial is written as soon as it has ended. One that was opened with `any_code` has
            results of other versions of the code, too.
        executor: Executor that runs them; local processes when None.
        workers: Number of local processes.
        timeout: Wall time that a trial may take, s; unlimited when None.
        retry: Run trials again that crashed or timed out.
        progress: Called when the sweep begins and after each trial.

    Raises:
        InputError: A number of workers below 1, a time-out that is not positive, a spec that is no trial, or a
            `progress` that is no function.
        JournalError: The journal cannot be written.
        SweepError: The executor has broken down or cancelled trials, or its processes have other code than this one.
    """
    if inspect.isclass(progress):
        raise InputError(f"progress must be a function of the summary, or none, got {shown(progress)}")
    begin = time.perf_counter()
    version = provenance()
    specs = list(specs)
    for spec in specs:
        check_parts("a trial", spec, "kind", "to_json")
    trials = {trial_key(plain): (spec, plain) for spec in specs for plain in [spec.to_json()]}
    summary = SweepSummary(len(trials))
    pending: Pending = deque()
    for key, (spec, plain) in trials.items():
        status = journal.entries[key].status if key in journal else None
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
        lost = _feed(executor, pending, timeout, IN_FLIGHT, record)
        if lost:
            raise SweepError(
                f"the executor has broken down or cancelled trials; {summary.run} trials are written down, {len(lost)} "
                f"were lost and {len(pending)} not begun: run the sweep again"
            )
    elif pending:
        _run_locally(pending, workers, timeout, record)
    summary.seconds = time.perf_counter() - begin
    return summary


Pending = deque[tuple[Trial, dict[str, Any]]]
Record = Callable[[dict[str, Any], Outcome], None]


def _run_locally(pending: Pending, workers: int, timeout: float | None, record: Record) -> None:
    """Run trials in local processes.

    A process that dies takes its pool with it. The trials that were in flight are then run again one by one, each in a
    process of its own: the one that dies there too has crashed. Processes that end again and again before a trial has
    begun are a `SweepError`.
    """
    while pending:
        with local_executor(min(workers, len(pending))) as pool:
            lost = _feed(pool, pending, timeout, workers, record, stuck_ends=True)
        for trial in lost:
            _run_alone(trial, timeout, record)


def _run_alone(trial: tuple[Trial, dict[str, Any]], timeout: float | None, record: Record) -> None:
    """Run a trial in a process of its own, which may end before it begins some times, when it is killed meanwhile."""
    for _ in range(STARTS):
        with local_executor(1) as pool:
            try:
                pool.submit(time.monotonic).result()
            except BrokenExecutor:
                continue
            if _feed(pool, deque([trial]), timeout, 1, record, stuck_ends=True):
                record(trial[1], Outcome("crashed", error="the process that ran it died"))
            return
    raise SweepError(
        f"processes for the trials have ended {STARTS} times before one began; the standard error may say why (a "
        "script that starts a sweep needs `if __name__ == '__main__':`)"
    )


def _feed(
    executor: Executor,
    pending: Pending,
    timeout: float | None,
    in_flight: int,
    record: Record,
    *,
    stuck_ends: bool = False,
) -> Pending:
    """Keep a given executor busy until nothing is pending, or until it breaks or cancels a trial.

    Returned are trials that were not run to their end, such as those of a cluster whose scheduler was restarted.
    """
    running: dict[Future[Outcome], tuple[Trial, dict[str, Any]]] = {}
    lost: Pending = deque()
    try:
        while pending or running:
            while pending and len(running) < in_flight and not lost:
                try:
                    future = executor.submit(_run, pending[0][0], timeout, provenance(), stuck_ends)
                except BrokenExecutor:
                    lost.append(pending.popleft())
                    break
                running[future] = pending.popleft()
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                trial = running.pop(future)
                error = CancelledError() if future.cancelled() else future.exception()
                if isinstance(error, (BrokenExecutor, CancelledError)):
                    lost.append(trial)
                elif isinstance(error, SweepError):  # its process has other code
                    raise error
                elif error is not None:  # such as a spec that cannot be sent
                    record(trial[1], Outcome("crashed", error=f"{type(error).__name__}: {error}"))
                else:
                    record(trial[1], future.result())
            if lost and not running:
                return lost
    except BaseException:
        for future in running:
            future.cancel()
        raise
    return lost


@contextlib.contextmanager
def local_executor(workers: int) -> Iterator[Executor]:
    """Make an executor of local processes for many small sweeps, which take over its processes from one another.

    Each has one thread for linear algebra, and ends when this process does, however it ends.
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


def _run(spec: Trial, timeout: float | None, version: Mapping[str, Any], stuck_ends: bool) -> Outcome:
    """Run a trial, by the code that the journal will name alone; its process may end when a library does not return.

    Other code, since sources have changed meanwhile or a cluster has its own, is a `SweepError`.
    """
    if other := differences(version):
        raise SweepError(
            f"a process that runs trials has other code than the sweep, which has {', '.join(other)}; run the sweep "
            "again with one version of the code"
        )
    return run_trial(spec, timeout, exit_when_stuck=stuck_ends)


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


@contextlib.contextmanager
@checked
def cluster_executor(address: str, *, workers: int | None = None) -> Iterator[Executor]:
    """Connect to a Dask cluster, and return its executor.

    Args:
        address: Address of the scheduler, such as "tcp://10.0.0.1:8786"; "local" starts a cluster on this machine.
        workers: Number of processes of a local cluster; as many as cores when None.

    Raises:
        InputError: Dask is not installed, or no scheduler answers at that address.
    """
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
