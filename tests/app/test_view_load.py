"""Messages between a run and its pages arrive whole, and no page makes the server grow."""

from __future__ import annotations

import asyncio
import contextlib
import pickle
import re
import socket
import struct
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from pages import PAUSE, close_code, facts, page_url
from tornado.websocket import websocket_connect

import wbc
from wbc.app.address import Address, PortError, listen
from wbc.app.replay.page_server import PageServer
from wbc.app.scene.sources import RobotSource
from wbc.app.view import guard, server
from wbc.app.view.channel import Channel
from wbc.app.view.meshcat_view import MeshcatView
from wbc.app.view.process import MAX_ANNOTATIONS, ServerSetup
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
    def run(frames: int) -> None:
        for _ in range(frames):
            plant.data.xpos[1:] += 1e-3  # everything moves
            view.update()
            for client in clients:
                client.sendall(masked('{"speed": null}'))
            view._process.flush(20.0)

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
    """A server in this process, whose frames are received by hand, and the run's end of its channel."""
    scene = RobotSource(wbc.load_robot("hrp4_class"), None).scene
    run, drawing = Channel.pair()
    setup = ServerSetup(scene, Address(port=0), None, {}, "token")
    listening, served = listen(setup.address)
    broadcast = Broadcast(setup, drawing)
    serving = guard.guarded_server(served, page_routes(broadcast))
    serving.add_socket(listening)
    try:
        yield broadcast, run, served.url.replace("http", "ws") + "stream?token=token"
    finally:
        serving.stop()
        await serving.close_all_connections()
        async with asyncio.timeout(20.0):
            while broadcast.pages:
                await asyncio.sleep(0.01)
        run.close()
        drawing.close()


@pytest.mark.slow
def test_a_client_that_does_not_read_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "PING_TIME", 0.1)

    async def drop() -> None:
        async with in_process() as (broadcast, _, url):
            read: list[str | bytes | None] = []
            reader = await websocket_connect(url, on_message_callback=read.append)
            silent = deaf(url, upgrade(url))
            while broadcast.pages < 2:
                await asyncio.sleep(0.01)
            async with asyncio.timeout(20.0):
                while broadcast.pages > 1:
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
        async with in_process() as (broadcast, run, url):
            page = await websocket_connect(url)
            await facts(page, lambda said: "time" in said)
            note = b'{"text": "' + b"x" * (MAX_ANNOTATIONS - 100) + b'"}'
            matrices = np.zeros((len(RobotSource(wbc.load_robot("hrp4_class"), None).scene.moving), 16))
            for frame in range(1, 1001):  # 30 MB
                run.write(pickle.dumps((float(frame), matrices + frame, note)))
                broadcast.receive()
                while run.read() is not None:  # its answers, and how many pages there are
                    pass
            times = [0.0]
            while times[-1] < 1000.0:
                times.append((await facts(page, lambda said: "time" in said))["time"])
            assert len(times) < 10
            page.close()
            await close_code(page)

    asyncio.run(slow())


def test_there_are_only_so_many_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_PAGES", 3)

    async def crowd() -> None:
        async with in_process() as (broadcast, _, url):
            pages = [await websocket_connect(url) for _ in range(3)]
            assert broadcast.pages == 3
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
