"""Sweeps: many trials run by an executor, each written to a journal when it ends, none run twice.

    with Journal("sweep.jsonl") as journal:
        summary = sweep(specs, journal, workers=2)

Any executor of the protocol of `concurrent.futures` will do, such as Dask's `Client.get_executor()`. Without one, local
processes of joblib's loky run the trials, each with one thread for linear algebra; one that a trial crashes is started
again.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from dataclasses import dataclass, field
from typing import Annotated, Any

from wbc.base.checked import checked
from wbc.base.errors import InputError, WbcError, check_parts
from wbc.base.registry import allow_code, in_file
from wbc.base.settings import Count, Positive, to_json
from wbc.sim.studies.journal import Entry, Journal, trial_key
from wbc.sim.studies.outcomes import AnyTrialSpec, Outcome, run_trial, trial_from_json
from wbc.sim.studies.provenance import differences, provenance

TIMEOUT = 600.0
"""Default time-out of a trial, s: a walk of 22 steps takes some ten seconds of wall time."""

IN_FLIGHT = 1000
"""Number of trials that a given executor holds at a time: more than a cluster can run."""

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR")} | {
    "VECLIB_MAXIMUM_THREADS": "1"
}
"""Variables that limit the threads of the libraries for linear algebra; they must be set before these are loaded."""


SAFE_PATH = {"PYTHONSAFEPATH": "1"}
"""Variable by which a new process does not import from the current folder, where a file could be named like a library:
loky and Python start their processes by `python -m` and `python -c`, which look there first."""


class SweepError(WbcError):
    """Failure of a sweep, which cannot go on; trials that have ended are in the journal."""


@dataclass
class SweepSummary:
    """Progress of a sweep.

    Attributes:
        counts: Number of trials in the journal by status.
    """

    total: int  # number of different trials
    found: int = 0  # number of trials that were in the journal before
    run: int = 0  # number of trials run by this sweep, however they ended
    counts: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0  # wall time of the sweep, s

    @property
    def per_hour(self) -> float | None:
        """Trials per hour of wall time; None before the first trial has ended."""
        return 3600.0 * self.run / self.seconds if self.run and self.seconds > 0.0 else None

    def to_json(self) -> dict[str, Any]:
        """Return the summary as plain values."""
        return {**to_json(self), "per_hour": self.per_hour}


Progress = Callable[[SweepSummary], None]
"""Function that is called when a sweep begins and after each trial."""

Pending = deque[tuple[AnyTrialSpec, dict[str, Any]]]
Record = Callable[[dict[str, Any], Outcome], None]


@checked
def sweep(
    specs: Iterable[AnyTrialSpec],
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
        specs: Specs of the trials; equal specs are run once.
        journal: Journal to which each trial is written as soon as it has ended. A journal that was opened with
            `any_code` also counts results of other versions of the code.
        executor: Executor that runs the trials; local processes when None.
        workers: Number of local processes.
        timeout: Longest wall time of a trial, s; unlimited when None.
        retry: Run trials again that have crashed or timed out.
        progress: Function that is called at the beginning and after each trial.

    Raises:
        InputError: This process is daemonic, and there is no executor.
        JournalError: The journal cannot be written.
        SweepError: The executor has broken down, has cancelled trials or could not run a trial, or its processes have
            another version of the code.
    """
    begin = time.perf_counter()
    trials = {}
    for spec in specs:
        check_parts("a trial", spec, "kind", "to_json")
        plain = spec.to_json()
        trials[trial_key(plain)] = spec, plain
    summary = SweepSummary(len(trials))
    pending: Pending = deque()
    for key, trial in trials.items():
        status = journal.entries[key].status if key in journal else None
        if status is None or (retry and status in ("crashed", "timeout")):
            pending.append(trial)
        else:
            summary.found += 1
            summary.counts[status] += 1

    def record(plain: dict[str, Any], outcome: Outcome) -> None:
        journal.add(Entry(plain, outcome.status, outcome.result, outcome.clock, outcome.error, provenance()))
        summary.run += 1
        summary.counts[outcome.status] += 1
        summary.seconds = time.perf_counter() - begin
        if progress is not None:
            progress(summary)

    if progress is not None:
        progress(summary)
    if executor is None:
        _run_locally(pending, workers, timeout, record)
    elif lost := _feed(executor, pending, timeout, IN_FLIGHT, record):
        raise SweepError(
            f"the executor has broken down or cancelled trials; {summary.run} trials are written down, {len(lost)} "
            f"were lost and {len(pending)} not begun: run the sweep again"
        )
    summary.seconds = time.perf_counter() - begin
    return summary


def _run_locally(pending: Pending, workers: int, timeout: float | None, record: Record) -> None:
    """Run trials in local processes.

    A process that dies takes its pool with it. The trials that were in flight are then run again one by one, each in a
    process of its own: the one that dies there too has crashed.
    """
    while pending:
        with local_executor(min(workers, len(pending))) as pool:
            lost = _feed(pool, pending, timeout, workers, record)
        for trial in lost:
            with local_executor(1) as pool:
                try:
                    pool.submit(time.monotonic).result()
                except BrokenExecutor as error:
                    raise SweepError(
                        "a process for the trials has ended before one began; the standard error may say why (a script "
                        "that starts a sweep needs `if __name__ == '__main__':`)"
                    ) from error
                if _feed(pool, deque([trial]), timeout, 1, record):
                    record(trial[1], Outcome("crashed", error="the process that ran it died"))


def _feed(
    executor: Executor, pending: Pending, timeout: float | None, in_flight: int, record: Record
) -> Pending:
    """Keep an executor busy until nothing is pending, or until it breaks or cancels a trial.

    An error of the executor, such as a worker without this package, is no result of the trial: it ends the sweep.
    Returned are trials that were not run to their end, such as those of a cluster whose scheduler was restarted.
    """
    running: dict[Future[Outcome], tuple[AnyTrialSpec, dict[str, Any]]] = {}
    lost: Pending = deque()
    failure: BaseException | None = None
    try:
        while (pending and not lost) or running:
            while pending and len(running) < in_flight and not lost:
                try:
                    spec, plain = pending[0]  # another process cannot import the class of a spec from a file
                    sent = plain if in_file(spec.kind) else spec
                    future = executor.submit(_run, sent, timeout, provenance())
                except BrokenExecutor:
                    lost.append(pending.popleft())
                    break
                running[future] = pending.popleft()
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                trial = running.pop(future)
                error = CancelledError() if future.cancelled() else future.exception()
                if isinstance(error, (BrokenExecutor, CancelledError)):
                    lost.append(trial)
                elif isinstance(error, SweepError):  # its process has other code
                    raise error
                elif error is not None:  # no result: an error of a trial is its outcome
                    lost.append(trial)
                    failure = failure or error
                else:
                    record(trial[1], future.result())
    except BaseException:
        for future in running:
            future.cancel()
        raise
    if failure is not None:
        raise SweepError(
            f"the executor could not run a trial ({type(failure).__name__}: {failure}); trials that have ended are "
            "written down, and this one is not: run the sweep again when the executor works"
        ) from failure
    return lost


@checked
@contextlib.contextmanager
def local_executor(workers: Count) -> Iterator[Executor]:
    """Make an executor of local processes, each with one thread for linear algebra; they import the running script.

    A program that is no file, such as one from the standard input, is not imported: it cannot register kinds of trials.
    """
    from joblib.externals import loky  # noqa: PLC0415 - only sweeps need it

    if multiprocessing.current_process().daemon:
        raise InputError(
            "a daemonic process, such as a worker of a pool or of Dask, starts no processes: give `sweep` an executor, "
            "such as concurrent.futures.ThreadPoolExecutor(1), or run it in another process"
        )
    script = getattr(sys.modules["__main__"], "__file__", None)
    # A program from the standard input is no file to import.
    read = script is not None and not os.path.isfile(script)
    with _environment(ONE_THREAD | SAFE_PATH):  # processes of this context take no variables of their own
        pool = loky.ProcessPoolExecutor(
            workers,
            context=loky.backend.get_context("loky" if read else "loky_init_main"),
            initializer=_start_worker,
            initargs=(os.getpid(),),
        )
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, kill_workers=True)
            raise
        pool.shutdown()


@contextlib.contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set variables of the environment for all processes that the block starts."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _start_worker(parent: int) -> None:
    """Prepare a local process: it logs errors alone, and ends with the process `parent` that has started it.

    A parent that was killed before this call is noticed, too: the process has another parent then.
    """
    logging.getLogger().setLevel(logging.ERROR)

    def follow() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=follow, daemon=True, name="follow the sweep").start()


def _run(spec: AnyTrialSpec | dict[str, Any], timeout: float | None, version: Mapping[str, Any]) -> Outcome:
    """Run a trial, by the code that the journal will name alone.

    Other code, since sources have changed meanwhile or a cluster has its own, is a `SweepError`.
    """
    if other := differences(version):
        raise SweepError(
            f"a process that runs trials has other code than the sweep, which has {', '.join(other)}; run the sweep "
            "again with one version of the code"
        )
    if isinstance(spec, dict):
        allow_code(spec)  # the sweep has the spec itself: its code has run
        return run_trial(trial_from_json(spec), timeout)
    return run_trial(spec, timeout)


@checked
@contextlib.contextmanager
def cluster_executor(address: str) -> Iterator[Executor]:
    """Connect to a Dask cluster by the address of its scheduler, as "tcp://10.0.0.1:8786", and return its executor."""
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError(
            "a distributed sweep needs Dask: pip install -e '.[cluster]' in the clone"
        ) from error
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at '{address}': {error}") from error
    with client:
        yield client.get_executor()
