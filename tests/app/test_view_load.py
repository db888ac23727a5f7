"""Messages between a run and its pages arrive whole, and no page makes the server grow."""

from __future__ import annotations

import asyncio
import contextlib
import re
import socket
import struct
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import FrameType
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from pages import PAUSE, close_code, facts, page_url
from tornado.websocket import websocket_connect

import wbc
from wbc.app.address import Address, listen
from wbc.app.replay.page_server import PageServer
from wbc.app.scene.sources import RobotSource
from wbc.app.view import MeshcatView, PortError, guard, server
from wbc.app.view import channel as channel_module
from wbc.app.view.channel import MAX_ANNOTATIONS, Channel, _Newest, _slot
from wbc.app.view.process import ServerSetup
from wbc.app.view.server import Broadcast, page_routes
from wbc.app.view.user_input import MAX_MESSAGE


def has_ipv6() -> bool:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        return False
    return True


@pytest.fixture(scope="module")
def plant() -> wbc.Plant:
    return wbc.Plant(wbc.load_robot("hrp4_class"))


@pytest.fixture(scope="module")
def view(plant: wbc.Plant) -> Iterator[MeshcatView]:
    with MeshcatView(plant, host="::1" if has_ipv6() else "127.0.0.1", port=0, rate=1e6) as view:
        yield view


@pytest.mark.skipif(not has_ipv6(), reason="no IPv6 on this machine")
def test_ipv6_addresses_open(view: MeshcatView) -> None:
    assert re.match(r"http://\[::1\]:\d+/\?token=", view.url)
    assert "hrp4_class" in view.html()
    port = urlsplit(view.url).port
    with pytest.raises(PortError, match=rf"\[::1\]:{port}.*another port"):
        PageServer("::1", port)


# ---- entries of the channel are whole -------------------------------------------------------------------------------

PATHS = 800

HAMMER = f"""
import sys
import numpy as np
from wbc.app.view.channel import Channel

channel = Channel({PATHS}, int(sys.argv[1]))
value = 0
while channel.pages == 0:
    value += 1
    text = str(value).encode() * (1 + value % 500)
    channel.write(float(value), np.full(({PATHS}, 4, 4), float(value)), text)
    channel.write_input(text[:4000])
"""
"""A process that writes as fast as it can; all parts of an entry say its number."""


@pytest.mark.slow
@pytest.mark.parametrize("count", [20_000])
def test_entries_do_not_tear_under_two_processes(count: int) -> None:
    channel = Channel(PATHS)
    hammer = subprocess.Popen([sys.executable, "-c", HAMMER, str(channel.fd)], pass_fds=[channel.fd])
    try:
        frame = inputs = frames = texts = 0
        end = time.monotonic() + 30.0 + 0.02 * count
        while (frames < count or texts < count) and time.monotonic() < end:
            if (newer := channel.read(frame)) is not None:
                number, stamp, matrices, text = newer
                assert number > frame and stamp == number
                assert (matrices == stamp).all()
                assert text == str(number).encode() * (1 + number % 500)
                frame, frames = number, frames + 1
            if (said := channel.read_input(inputs)) is not None:
                number, text = said
                assert number > inputs and text == (str(number).encode() * (1 + number % 500))[:4000]
                inputs, texts = number, texts + 1
        assert frames >= count and texts >= count
        while time.monotonic() < end:  # a reader that pauses is overtaken, and reads the newest
            time.sleep(0.01)
            if (newer := channel.read(frame)) is not None and newer[0] > frame + 1:
                break
            frame = frame if newer is None else newer[0]
        else:
            pytest.fail("every frame was read")
    finally:
        channel.pages = 1
        hammer.wait(20.0)
        channel.close()


def at_every_line(function: Callable[..., Any], then: Callable[[], None], *args: Any, **values: Any) -> Any:
    """Call a function; before each of its lines, and at its end, do something."""

    def line(frame: FrameType, event: str, _: Any) -> Any:
        then()
        return line

    before = sys.gettrace()
    sys.settrace(lambda frame, *_: line if frame.f_code is function.__code__ else None)
    try:
        return function(*args, **values)
    finally:
        sys.settrace(before)


@pytest.mark.parametrize("checksum", [True, False], ids=["as it is", "sequence numbers alone"])
def test_no_order_of_reading_and_writing_gives_parts_of_two_entries(
    checksum: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The writer's memory after every store, and a reader that is overtaken by any number of stores at every line."""
    if not checksum:
        monkeypatch.setattr(channel_module, "_checksum", lambda *_: 0)
    number, slots = np.zeros(1, np.int64), np.zeros(2, _slot(8, ("time", "f8"), ("twice", "f8")))
    newest = _Newest(number, slots)
    moments: list[tuple[int, bytes]] = []

    def record() -> None:
        if not moments or moments[-1] != (number[0], slots.tobytes()):
            moments.append((int(number[0]), slots.tobytes()))

    for value in range(1, 7):
        at_every_line(_Newest.write, record, newest, b"%d" % value * 8, time=float(value), twice=2.0 * value)
    assert len(moments) > 6 * 5
    rng = np.random.default_rng(0)
    place = read = overtaken = 0

    def overtake() -> None:
        nonlocal place
        place = min(place + int(rng.choice((0, 0, 1, 3, 9))), len(moments) - 1)
        number[0], slots.view(np.uint8)[:] = moments[place][0], np.frombuffer(moments[place][1], np.uint8)

    for start in [*range(len(moments))] * 60:
        place = start
        overtake()
        first = int(number[0])
        found = at_every_line(_Newest.read, overtake, newest, 0)
        if found is None:
            overtaken += 1
            continue
        value, data, text = found
        assert first <= value <= moments[place][0] and (data["time"], data["twice"]) == (value, 2.0 * value)
        assert text == b"%d" % value * 8
        read += 1
    assert read > 1500 and overtaken < 200


@pytest.mark.parametrize("part", ["begun", "check", "data"])
def test_a_half_written_entry_is_not_read(part: str) -> None:
    channel = Channel(3)
    channel.write(1.0, np.ones((3, 4, 4)), b"{}")
    assert channel.read(0) is not None
    slot = channel._all["frames"][1]
    if part == "data":
        slot["data"]["matrices"][1, 7] += 1e-9
    else:
        slot[part] += 1
    assert channel.read(0) is None
    channel.write(2.0, np.ones((3, 4, 4)), b"{}")
    assert channel.read(0) is not None
    del slot
    channel.close()


# ---- who does not read ----------------------------------------------------------------------------------------------


def upgrade(url: str) -> bytes:
    """The request that opens a WebSocket."""
    place = urlsplit(url)
    return (
        f"GET {place.path}?{place.query} HTTP/1.1\r\nHost: {place.netloc}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    ).encode()


def deaf(url: str, request: bytes) -> socket.socket:
    """A client that asks and never reads."""
    place = urlsplit(url)
    client = socket.socket(socket.AF_INET6 if ":" in str(place.hostname) else socket.AF_INET)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    client.connect((place.hostname, place.port))
    client.sendall(request)
    return client


def memory(pid: int) -> float:
    """Resident memory of a process, MB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    found = re.search(r"VmRSS:\s+(\d+) kB", status)
    assert found
    return int(found.group(1)) / 1000.0


def masked(text: str) -> bytes:
    """A message of a client (RFC 6455, 5.2), with a mask of zeros."""
    return struct.pack(">BBQ", 0x81, 0xFF, len(text)) + bytes(4) + text.encode()


@pytest.mark.parametrize("size", [MAX_MESSAGE + 1, 1 << 22])
def test_long_messages_end_the_connection(view: MeshcatView, size: int) -> None:
    url = page_url(view, "stream")
    with socket.create_connection((urlsplit(url).hostname, urlsplit(url).port), 20.0) as client:
        client.sendall(upgrade(url))
        with contextlib.suppress(ConnectionError):  # it may end before all is said
            client.sendall(masked(PAUSE.ljust(size)))
            while client.recv(1 << 16):
                pass
    while view.pages:
        time.sleep(0.01)
    view.update()  # would wait


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_clients_that_never_read_do_not_make_the_server_grow(plant: wbc.Plant, view: MeshcatView) -> None:
    channel = view._process.channel

    def run(frames: int) -> None:
        for _ in range(frames):
            plant.data.xpos[1:] += 1e-3  # everything moves
            view.update()
            for client in clients:
                client.sendall(masked('{"speed": null}'))
            while channel.shown < channel.newest:
                time.sleep(0.001)

    clients: list[socket.socket] = []
    url = page_url(view, "stream")
    before = plant.data.xpos.copy()
    try:
        clients += [deaf(url, upgrade(url)) for _ in range(20)]
        while view.pages < len(clients):
            time.sleep(0.01)
        run(50)
        first = memory(view.pid)
        run(250)
        assert memory(view.pid) - first < 3.0
    finally:
        plant.data.xpos[:] = before
        for client in clients:
            client.close()
    while view.pages:
        time.sleep(0.01)


@asynccontextmanager
async def in_process() -> AsyncIterator[tuple[Broadcast, Channel, str]]:
    """A server in this process; its tick is called by hand."""
    scene = RobotSource(wbc.load_robot("hrp4_class"), None).scene
    channel = Channel(len(scene.moving))
    setup = ServerSetup(scene, Address(port=0), 30.0, None, {}, "token")
    listening, served = listen(setup.address)
    broadcast = Broadcast(setup, channel)
    serving = guard.guarded_server(served, page_routes(broadcast))
    serving.add_socket(listening)
    try:
        yield broadcast, channel, served.url.replace("http", "ws") + "stream?token=token"
    finally:
        serving.stop()
        await serving.close_all_connections()
        async with asyncio.timeout(20.0):
            while channel.pages:
                await asyncio.sleep(0.01)
        channel.close()


def test_a_client_that_does_not_read_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "PING_TIME", 0.1)

    async def drop() -> None:
        async with in_process() as (_, channel, url):
            read: list[str | bytes | None] = []
            reader = await websocket_connect(url, on_message_callback=read.append)
            silent = deaf(url, upgrade(url))
            while channel.pages < 2:
                await asyncio.sleep(0.01)
            async with asyncio.timeout(20.0):
                while channel.pages > 1:
                    await asyncio.sleep(0.05)
            silent.close()
            await reader.write_message(PAUSE)  # the other one is still there
            async with asyncio.timeout(20.0):
                while '"paused": true' not in str(read[-1]):
                    await asyncio.sleep(0.01)
            reader.close()

    asyncio.run(drop())


def test_a_slow_page_skips_frames() -> None:
    async def slow() -> None:
        async with in_process() as (broadcast, channel, url):
            page = await websocket_connect(url)
            await facts(page, lambda said: "time" in said)
            note = b'{"text": "' + b"x" * (MAX_ANNOTATIONS - 100) + b'"}'
            for frame in range(1, 1001):  # 30 MB
                channel.write(float(frame), np.full((channel_paths(channel), 4, 4), float(frame)), note)
                broadcast.tick()
            times = [0.0]
            while times[-1] < 1000.0:
                times.append((await facts(page, lambda said: "time" in said))["time"])
            assert len(times) < 10
            page.close()
            await close_code(page)

    asyncio.run(slow())


def channel_paths(channel: Channel) -> int:
    return int(channel._all["frames"]["data"]["matrices"].shape[1])


def test_there_are_only_so_many_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_PAGES", 3)

    async def crowd() -> None:
        async with in_process() as (_, channel, url):
            pages = [await websocket_connect(url) for _ in range(3)]
            assert channel.pages == 3
            assert await close_code(await websocket_connect(url)) == 1013
            for page in pages:
                page.close()
                await close_code(page)

    asyncio.run(crowd())


@pytest.mark.slow
def test_an_answer_that_is_not_taken_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "SEND_TIME", 0.2)

    class Large(guard.GuardedHandler):
        """More than sockets hold."""

        async def get(self) -> None:
            await self.answer(bytes(1 << 24))
            done.set()

    async def ask() -> int:
        listening, served = listen(Address(port=0))
        server = guard.guarded_server(served, [(r"/", Large)])
        server.add_socket(listening)
        place = urlsplit(served.url)
        client = deaf(served.url, f"GET / HTTP/1.1\r\nHost: {place.netloc}\r\n\r\n".encode())
        await asyncio.wait_for(done.wait(), 20.0)
        server.stop()
        client.settimeout(20.0)
        taken = 0
        try:
            while data := client.recv(1 << 20):
                taken += len(data)
        except ConnectionResetError:
            pass
        client.close()
        return taken

    done = asyncio.Event()
    assert asyncio.run(ask()) < 1 << 24
