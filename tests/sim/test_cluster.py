"""Sweeps on a Dask cluster of processes that its own commands start, over loopback; needs the extra `cluster`."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from sweep_trials import MadeUpTrial

from wbc.sim.studies.journal import Journal, read_journal
from wbc.sim.studies.sweep import SweepError, SweepSummary, cluster_executor, sweep

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]


@contextmanager
def program(folder: Path, *command: str) -> Iterator[subprocess.Popen[bytes]]:
    """A program of Dask in a folder and an environment of its own, killed in the end."""
    folder.mkdir(parents=True, exist_ok=True)
    own = {
        "PATH": os.environ["PATH"],
        "HOME": str(folder),
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests" / "support"), *sys.path[1:]]),
    }
    with (folder / "output").open("ab") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", *command],
            cwd=folder,
            env=own,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


class Cluster:
    """A scheduler and workers, each a program."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._folder, self._stack = folder, stack
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"

    def schedule(self) -> subprocess.Popen[bytes]:
        scheduler = ("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        process = self._stack.enter_context(program(self._folder / "scheduler", *scheduler, "--no-dashboard"))
        end = time.monotonic() + 30.0
        while time.monotonic() < end:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return process
            time.sleep(0.1)
        raise AssertionError((self._folder / "scheduler" / "output").read_text())

    def work(self, name: str) -> subprocess.Popen[bytes]:
        worker = ("distributed.cli.dask_worker", self.address, "--nworkers", "1", "--nthreads", "1")
        return self._stack.enter_context(program(self._folder / name, *worker, "--no-dashboard"))


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with ExitStack() as stack:
        yield Cluster(tmp_path / "cluster", stack)


def trials(count: int, seconds: float, marks: Path) -> list[MadeUpTrial]:
    return [MadeUpTrial(number, seconds=seconds, marks=str(marks)) for number in range(count)]


def run(cluster: Cluster, specs: list[MadeUpTrial], book: Path, progress=None) -> SweepSummary:
    with cluster_executor(cluster.address) as pool, Journal(book) as journal:
        return sweep(specs, journal, executor=pool, progress=progress)


def test_a_worker_that_is_killed_costs_no_trial(cluster: Cluster, tmp_path: Path) -> None:
    cluster.schedule()
    workers = [cluster.work("one"), cluster.work("two")]

    def kill(summary: SweepSummary) -> None:
        if summary.run == 6 and workers[0].poll() is None:
            os.killpg(workers[0].pid, signal.SIGKILL)

    specs = trials(24, 0.2, tmp_path / "marks")
    assert run(cluster, specs, tmp_path / "book", kill).counts == {"done": 24}
    assert len(read_journal(tmp_path / "book")) == 24
    runs = len((tmp_path / "marks").read_text().splitlines())
    assert 24 <= runs <= 25  # at most the one that the killed worker had


def test_a_sweep_goes_on_after_its_scheduler_has_been_started_again(cluster: Cluster, tmp_path: Path) -> None:
    scheduler = cluster.schedule()
    for name in ("one", "two"):
        cluster.work(name)

    def kill(summary: SweepSummary) -> None:
        if summary.run == 6 and scheduler.poll() is None:
            os.killpg(scheduler.pid, signal.SIGKILL)

    specs = trials(24, 0.2, tmp_path / "marks")
    with pytest.raises(SweepError, match="run the sweep again"):
        run(cluster, specs, tmp_path / "book", kill)
    before = len(read_journal(tmp_path / "book"))
    assert 6 <= before < 24
    cluster.schedule()
    for name in ("three", "four"):
        cluster.work(name)
    again = run(cluster, specs, tmp_path / "book")
    assert again.found == before and again.counts == {"done": 24}


def test_two_workers_are_twice_as_fast_as_one(cluster: Cluster, tmp_path: Path) -> None:
    cluster.schedule()
    cluster.work("one")
    run(cluster, trials(2, 0.0, tmp_path / "marks"), tmp_path / "start")
    alone = run(cluster, trials(30, 0.5, tmp_path / "marks"), tmp_path / "alone").seconds
    cluster.work("two")
    time.sleep(8.0)  # a worker that has just started still imports
    run(cluster, trials(8, 0.1, tmp_path / "marks"), tmp_path / "both start")
    both = run(cluster, trials(60, 0.5, tmp_path / "marks"), tmp_path / "both").seconds
    print(
        f"30 trials on one worker {alone:.2f} s, 60 on two {both:.2f} s: {alone / both:.1%} of twice as many"
    )
    assert alone / both > 0.95
