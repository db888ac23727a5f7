"""Messages between a run and its pages arrive whole, and no page makes the server grow."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import socket
import struct
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from pages import PAUSE, close_code, facts, page_url, taken
from tornado.websocket import websocket_connect

import wbc
from wbc.app.address import Address, PortError
from wbc.app.scene.layer import Annotations
from wbc.app.scene.sources import RobotSource
from wbc.app.view import guard, server
from wbc.app.view.meshcat_view import MeshcatView
from wbc.app.view.pace import Pace
from wbc.app.view.server import Broadcast, page_routes


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
    with urllib.request.urlopen(view.url) as page:
        assert b"hrp4_class" in page.read()
    port = urlsplit(view.url).port
    with pytest.raises(PortError, match=rf"\[::1\]:{port}.*another port"):
        guard.PageServer("replay", Address("::1", port))


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


@pytest.mark.parametrize("size", [guard.MAX_MESSAGE + 1, 1 << 22])
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
            taken(view._server)

    clients: list[socket.socket] = []
    url = page_url(view, "stream")
    before = plant.data.xpos.copy()
    try:
        clients += [deaf(url, upgrade(url)) for _ in range(20)]
        while view.pages < len(clients):
            time.sleep(0.01)
        run(50)
        first = memory(os.getpid())
        run(150)
        assert memory(os.getpid()) - first < 3.0
    finally:
        plant.data.xpos[:] = before
        for client in clients:
            client.close()
    while view.pages:
        time.sleep(0.01)


@contextmanager
def serving() -> Iterator[tuple[Broadcast, guard.PageServer, str]]:
    """A server without a run, and the address of its messages."""
    scene = RobotSource(wbc.load_robot("hrp4_class"), None).scene
    broadcast = Broadcast(scene, Pace(None), lambda order: None, {}, "token")
    server = guard.PageServer("view", Address(port=0))
    server.start(page_routes(broadcast), last=broadcast.end)
    try:
        yield broadcast, server, server.served.url.replace("http", "ws") + "stream?token=token"
    finally:
        server.close()
    assert broadcast.pages == 0


@pytest.mark.slow
def test_a_client_that_does_not_read_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "PING_TIME", 0.1)

    async def drop(broadcast: Broadcast, url: str) -> None:
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

    with serving() as (broadcast, _, url):
        asyncio.run(drop(broadcast, url))


def test_a_slow_page_skips_frames() -> None:
    async def slow(broadcast: Broadcast, server: guard.PageServer, url: str) -> None:
        page = await websocket_connect(url)
        await facts(page, lambda said: "time" in said)
        count = len(broadcast.scene.moving)
        for frame in range(1, 1001):  # 30 MB
            broadcast.put(float(frame), np.full((count, 4, 4), frame), Annotations(["x" * 30_000]))
            server.soon(broadcast.take_frame)
            taken(server)
        times = [0.0]
        while times[-1] < 1000.0:
            times.append((await facts(page, lambda said: "time" in said))["time"])
        assert len(times) < 500  # sockets hold some
        page.close()
        await close_code(page)

    with serving() as (broadcast, server, url):
        asyncio.run(slow(broadcast, server, url))


def test_there_are_only_so_many_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_PAGES", 3)

    async def crowd(broadcast: Broadcast, url: str) -> None:
        pages = [await websocket_connect(url) for _ in range(3)]
        async with asyncio.timeout(20.0):
            while broadcast.pages < 3:
                await asyncio.sleep(0.01)
        assert await close_code(await websocket_connect(url)) == 1013
        for page in pages:
            page.close()
            await close_code(page)

    with serving() as (broadcast, _, url):
        asyncio.run(crowd(broadcast, url))


def test_the_last_frame_arrives_before_the_end() -> None:
    async def last(broadcast: Broadcast, server: guard.PageServer, url: str) -> None:
        page = await websocket_connect(url)
        await facts(page, lambda said: "time" in said)
        broadcast.put(7.0, np.zeros((len(broadcast.scene.moving), 4, 4)), Annotations())
        ending = asyncio.get_running_loop().run_in_executor(None, server.close)
        assert (await facts(page, lambda said: "time" in said))["time"] == 7.0
        await close_code(page)
        await ending

    with serving() as (broadcast, server, url):
        asyncio.run(last(broadcast, server, url))


@pytest.mark.slow
def test_an_answer_that_is_not_taken_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "SEND_TIME", 0.2)

    class Large(guard.GuardedHandler):
        """More than sockets hold."""

        async def get(self) -> None:
            await self.answer(bytes(1 << 24))
            done.set()

    done = threading.Event()
    server = guard.PageServer("view", Address(port=0))
    server.start([(r"/", Large)])
    place = urlsplit(server.served.url)
    client = deaf(server.served.url, f"GET / HTTP/1.1\r\nHost: {place.netloc}\r\n\r\n".encode())
    assert done.wait(20.0)
    server.close()
    client.settimeout(20.0)
    taken = 0
    with contextlib.suppress(ConnectionResetError):
        while data := client.recv(1 << 20):
            taken += len(data)
    client.close()
    assert taken < 1 << 24
