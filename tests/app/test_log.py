"""A log holds what was written, in a file that others read, too, whatever happens to the program or to the file."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from full_disk import limited_file_size
from known_walk import TICKS, other
from log_writing import HEADER, made_log, signals, values, write
from pyarrow import ipc

from wbc.app.drift import Drift
from wbc.app.log import reader, writer
from wbc.app.log.header import FORMAT, KEY, encode
from wbc.app.log.reader import Log
from wbc.app.log.stances import stances, support_box
from wbc.app.log.writer import ROWS, LogWriter
from wbc.app.plot.figures import draw
from wbc.base.errors import InputError, UnknownNameError


@pytest.fixture
def log_file(tmp_path: Path) -> Path:
    path = tmp_path / "log.arrow"
    write(path, 2 * ROWS + 100).close()
    return path


def test_what_is_written_comes_back(log_file: Path) -> None:
    log = Log.open(log_file)
    n = 2 * ROWS + 100
    assert len(log) == n and log.broken is None
    expected = np.array([values(i) for i in range(n)])
    assert (log.time == expected[:, 0]).all()  # to the last bit
    assert (log["com/estimated"] == expected[:, 1:].astype(np.float32)).all()
    assert (log["com/estimated/y"] == log["com/estimated"][:, 1]).all()
    phases = [("single" if i % 3 else "double") if i % 5 else None for i in range(n)]
    assert log.texts("walk/phase").tolist() == phases
    assert (log["foot/contact"] == np.arange(n) % 2).all()
    assert (log["walk/step"] == np.arange(n)).all()
    scans = log.lists("scan")
    assert [i for i, scan in enumerate(scans) if scan is not None] == list(range(0, n, 7))
    assert all(scans[i].tolist() == list(range(i % 4)) for i in range(0, n, 7))
    assert log.units["com/estimated/z"] == "m" and log.signals["time"].about == "clock"
    assert list(log) == [signal.name for signal, _ in signals().columns]
    assert log.header == HEADER


def test_pandas_and_polars_open_it_without_us(log_file: Path) -> None:
    log, frame, table = Log.open(log_file), pd.read_feather(log_file), pl.read_ipc(log_file)
    assert list(frame.columns) == list(log) == table.columns
    for name in ("time", "com/estimated/x", "walk/step", "foot/contact"):
        assert (frame[name].to_numpy() == log[name]).all()
        assert (table[name].to_numpy() == log[name]).all()
    assert table["walk/phase"].to_list() == log.texts("walk/phase").tolist()
    assert frame["walk/phase"].value_counts()["double"] == table["walk/phase"].eq("double").sum() > 0
    schema = ipc.open_file(log_file).schema
    assert json.loads(schema.metadata[b"wbc"]) == HEADER
    assert schema.field("com/estimated/x").metadata[b"unit"] == b"m"


@pytest.mark.parametrize("gap", [b"", bytes(1000)])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9, 0.999])
def test_truncated_log_is_read_up_to_the_break(log_file: Path, share: float, gap: bytes) -> None:
    whole, data = Log.open(log_file), log_file.read_bytes()
    end = int(share * len(data))
    log_file.write_bytes(data[:end] + (gap + data[end:] if gap else gap))
    log = Log.open(log_file)
    assert log.broken
    assert len(log) % ROWS == 0 or len(log) == len(whole)
    assert len(log) >= ROWS * (int(share * len(data) / (len(data) / (len(whole) / ROWS))) - 1)
    assert (log["com/estimated"] == whole["com/estimated"][: len(log)]).all()


def test_the_first_batch_that_is_damaged_is_named(log_file: Path) -> None:
    """Of three, by the length that the second or the third one says."""
    data = log_file.read_bytes()
    places = [at for at in range(len(data)) if data.startswith(b"\xff\xff\xff\xff", at) and at % 8 == 0]
    for batch in (2, 3):
        at = places[batch]  # the schema is the first message
        log_file.write_bytes(data[: at + 4] + bytes(4) + data[at + 8 :])
        log = Log.open(log_file)
        assert log.broken == f"batch {batch} of 3 is damaged" and len(log) == (batch - 1) * ROWS


@pytest.mark.parametrize(
    "content", [None, b"", b"time,x\n0,1\n", b"ARROW1\0\0", b"ARROW1\0\0" + 300 * b"nonsense"]
)
def test_what_is_no_log_is_refused(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "log.arrow"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match="log.arrow"):
        Log.open(path)


def test_log_of_another_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "later.arrow"
    metadata = {KEY: encode({"format": FORMAT + 1, "program": "wbc 9.0"})}
    schema = pa.schema([pa.field("time", pa.float64())], metadata=metadata)
    with ipc.new_file(str(path), schema):
        pass
    with pytest.raises(InputError, match="wbc 9.0"):
        Log.open(path)


@pytest.mark.parametrize(("batch", "said"), [(1_000_000, "has a batch of"), (2000, "unpacks to more than")])
def test_a_small_file_that_unpacks_to_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int, said: str
) -> None:
    """A large batch before it is unpacked, and many small ones when they are too many."""
    monkeypatch.setattr(reader, "MEMORY", 1_000_000)
    monkeypatch.setattr(reader, "LARGEST_BATCH", 20_000)
    monkeypatch.setattr(reader, "LARGEST_RATIO", 1)
    schema = pa.schema([pa.field("time", pa.float64())], metadata={KEY: encode(HEADER)})
    path = tmp_path / "bomb.arrow"
    with ipc.new_file(str(path), schema, options=ipc.IpcWriteOptions(compression="lz4")) as out:
        for _ in range(1_000_000 // batch):
            out.write_batch(pa.RecordBatch.from_arrays([pa.array(np.zeros(batch))], schema=schema))
    before = pa.total_allocated_bytes()
    with pytest.raises(InputError, match=said):
        Log.open(path)
    assert pa.total_allocated_bytes() == before


def test_batches_of_long_lists_are_small_enough_to_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for room in (reader, writer):
        monkeypatch.setattr(room, "LARGEST_BATCH", 20_000)
    rows = [np.random.default_rng(i).normal(size=1000) for i in range(40)]
    log = made_log(tmp_path / "log.arrow", {"time": np.arange(40.0), "ground/map/x": rows})
    assert log.broken is None and np.allclose(np.stack(log.lists("ground/map/x")), rows, atol=1e-6)  # type: ignore[arg-type]


def test_a_log_that_unpacks_to_more_than_memory_is_read_signal_by_signal(
    log_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = Log.open(log_file)
    monkeypatch.setattr(reader, "MEMORY", 1000)
    monkeypatch.setattr(reader, "LARGEST_FILE", 1000)
    log = Log.open(log_file)
    assert len(log) == len(whole) and list(log) == list(whole) and log.broken is None
    for name in ("time", "com/estimated", "walk/step"):
        assert (log[name] == whole[name]).all()
    assert log.texts("walk/phase").tolist() == whole.texts("walk/phase").tolist()
    log_file.write_bytes(log_file.read_bytes()[:-2000])
    assert Log.open(log_file).broken and len(Log.open(log_file)) % ROWS == 0


@pytest.mark.parametrize(
    ("times", "kept"),
    [([0.0, 1.0, 1.0, 2.0], 4), ([0.0, 1.0, 0.5, 2.0], 2), ([0.0, np.nan, 1.0], 1), ([np.inf, 1.0], 0)],
)
def test_a_log_whose_time_goes_back_is_read_up_to_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: list[float], kept: int
) -> None:
    """A loop that was reset, or a stamp of a machine that is none; of a large log, too, which stays in the file."""
    columns = {"time": np.array(times), "v/x": np.arange(float(len(times))), "state": ["a"] * len(times)}
    for memory in (reader.MEMORY, 1):
        monkeypatch.setattr(reader, "MEMORY", memory)
        log = made_log(tmp_path / "a.arrow", columns)
        assert len(log) == len(log.time) == len(log["v/x"]) == len(log.texts("state")) == kept
        assert log["v/x"].tolist() == list(range(kept)) and (log.broken is None) is (kept == len(times))


def test_unknown_signal_names_the_nearest_ones(log_file: Path) -> None:
    log = Log.open(log_file)
    with pytest.raises(UnknownNameError, match="'com/estimated'"):
        log["com/estimatd"]
    with pytest.raises(InputError, match="texts"):
        log["walk/phase"]
    for read in (log.column, log.parts, log.texts, log.lists):
        with pytest.raises(InputError, match=f"of Log.{read.__name__} must be"):
            read(["time"])  # type: ignore[arg-type]


def test_the_parts_of_a_vector_may_stand_in_any_order(log_file: Path) -> None:
    log = Log.open(log_file)
    table = ipc.open_file(log_file).read_all()
    with ipc.new_file(log_file, (turned := table.select(table.column_names[::-1])).schema) as out:
        out.write_table(turned)
    assert (Log.open(log_file).vector("com/estimated", 3) == log["com/estimated"]).all()


READERS: dict[str, tuple[Callable[[Log], object], tuple[str, ...]]] = {
    "drift": (Drift.of, ("truth/base/orientation/w", "foot/left/estimated/position/x")),
    "stances": (stances, ("foot/left/reference/position/z", "foot/right/reference/orientation/w")),
    "true": (lambda log: stances(log, "truth"), ("truth/foot/left/position/y", "foot/left/contact")),
    "support": (support_box, ("foot/left/reference/position/y", "foot/right/wrench_measured/fz")),
    "balance": (lambda log: draw("balance", [log]), ("com/estimated/y", "truth/push/force/z")),
    "plan": (lambda log: draw("plan", [log]), ("zmp/measured/y", "foot/left/reference/orientation/x")),
}
"""Reader of a log → the function and columns that it needs."""


@pytest.mark.parametrize(
    ("name", "column"), [(name, column) for name, (_, columns) in READERS.items() for column in columns]
)
def test_a_log_without_a_column_is_refused_by_what_needs_it(tmp_path: Path, name: str, column: str) -> None:
    """A vector without one of its parts, above all: its values would be those of another one."""
    log = other(tmp_path, {"truth/push/force": np.zeros((TICKS, 3))})
    table = ipc.open_file(log.path).read_all().drop_columns([column])
    with ipc.new_file(tmp_path / "walk.arrow", table.schema) as out:
        out.write_table(table)
    with pytest.raises(InputError, match=f"walk.arrow.*{column}|{column}.*walk.arrow"):
        READERS[name][0](Log.open(tmp_path / "walk.arrow"))


def test_log_without_ticks_is_a_log(tmp_path: Path) -> None:
    write(tmp_path / "log.arrow", 0).close()
    log = Log.open(tmp_path / "log.arrow")
    assert len(log) == 0 and log.broken is None and log["com/estimated"].shape == (0, 3)


CHILD = """
import os, signal, sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
from log_writing import ROWS, write
writer = write(Path({path!r}), {ticks})
{end}
"""


def run_child(path: Path, end: str, ticks: str = "3 * ROWS + 50") -> subprocess.CompletedProcess[bytes]:
    tests = str(Path(__file__).parents[1] / "support")
    code = CHILD.format(tests=tests, path=str(path), ticks=ticks, end=end)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)


@pytest.mark.slow  # processes that import the library
def test_a_process_that_ends_before_the_first_batch_replaces_no_log(log_file: Path) -> None:
    """Killed or left; and a process that finds the log being written is refused."""
    old = log_file.read_bytes()
    for end in ("os.kill(os.getpid(), signal.SIGKILL)", "sys.exit()"):
        run_child(log_file, end, ticks="ROWS - 1")
        assert log_file.read_bytes() == old
    first = write(log_file, ROWS + 10)
    done = run_child(log_file, "writer.close()")
    assert done.returncode != 0 and b"is being written" in done.stderr
    first.close()
    assert len(Log.open(log_file)) == ROWS + 10 and Log.open(log_file).broken is None


def test_an_old_log_stays_until_the_first_batch_of_the_new_one(log_file: Path) -> None:
    """A recording that fails or is given up before it has kept anything replaces nothing."""
    old = log_file.read_bytes()
    LogWriter(log_file).close()  # nothing was recorded
    assert log_file.read_bytes() == old
    write(log_file, 5)  # never closed
    assert log_file.read_bytes() == old and [each.name for each in log_file.parent.iterdir()] == [
        log_file.name
    ]
    log_file.chmod(0o640)
    link = log_file.with_name("link.arrow")
    link.symlink_to(log_file)
    write(link, 3).close()
    assert link.is_symlink() and len(Log.open(log_file)) == 3 and log_file.stat().st_mode & 0o777 == 0o640
    assert len(list(log_file.parent.iterdir())) == 2


@pytest.mark.parametrize("ticks", [0, ROWS + 10])
def test_of_two_recordings_of_one_log_the_second_is_refused(log_file: Path, ticks: int) -> None:
    """Before and after the first batch has taken the place of the old log."""
    first = write(log_file, ticks)
    with pytest.raises(InputError, match=r"log\.arrow is being written"):
        LogWriter(log_file)
    first.close()
    assert len(Log.open(log_file)) == ticks and Log.open(log_file).broken is None
    LogWriter(log_file).close()
    assert len(list(log_file.parent.iterdir())) == 1


@pytest.mark.parametrize("ticks", [10, ROWS + 10])
def test_a_forked_process_leaves_the_log_of_its_parent(ticks: int, log_file: Path) -> None:
    """The child ends the recording, or Python ends it with the child."""
    writer = write(log_file, ticks)
    child = os.fork()
    if child == 0:
        with contextlib.suppress(BaseException):
            writer.close()
            writer._place._finalizer()
        os._exit(0)
    os.waitpid(child, 0)
    writer.close()
    assert writer.loss is None and len(Log.open(log_file)) == ticks and Log.open(log_file).broken is None


@pytest.mark.slow
def test_killed_program_leaves_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "log.arrow"
    done = run_child(path, "os.kill(os.getpid(), signal.SIGKILL)")
    assert done.returncode == -signal.SIGKILL, done.stderr
    log = Log.open(path)
    assert log.broken and len(log) == 3 * ROWS
    assert (log.time == [values(i)[0] for i in range(3 * ROWS)]).all()


def test_full_disk_at_any_moment_leaves_what_was_written(tmp_path: Path) -> None:
    """Full at the first byte, in the header, in a batch or in the last bytes of the file; the run goes on."""
    path = tmp_path / "log.arrow"
    write(path, ROWS + 30).close()
    size = path.stat().st_size
    for share in (0, 100, size // 2, size - 10, size - 1):
        with limited_file_size(share):
            writer = write(path, ROWS + 30)
            writer.close()
        assert writer.loss is not None
        if share == size - 10:
            assert len(Log.open(path)) == ROWS + 30
    with limited_file_size(size):
        writer = write(path, ROWS + 30)
        writer.close()
    assert writer.loss is None and Log.open(path).broken is None
