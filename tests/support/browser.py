"""A headless Chromium for tests, driven through its own protocol (DevTools); no driver and no library is needed."""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
import time
from collections.abc import Coroutine
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest
from tornado.websocket import WebSocketClientConnection, websocket_connect

CHROMIUM = next((path for path in map(shutil.which, ("chromium", "chromium-browser")) if path), None)

needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-port=0",
)
"""WebGL is drawn by the processor, and nothing but the page is asked for over the network."""


class Browser:
    """One page.

    Attributes:
        errors: What went wrong in the page's scripts, and what its security policy has blocked.
    """

    def __init__(self, folder: Path, size: tuple[int, int] = (1000, 750)) -> None:
        """Start it.

        Args:
            folder: Empty folder for its profile.
            size: Of the window, pixels.
        """
        assert CHROMIUM is not None
        self.errors: list[str] = []
        window = f"--window-size={size[0]},{size[1]}"
        self._process = subprocess.Popen(
            [CHROMIUM, *OPTIONS, window, f"--user-data-dir={folder}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._runner = asyncio.Runner()
        self._count = 0
        try:
            self._socket = self._do(self._connect(folder / "DevToolsActivePort"))
        except BaseException:
            self._process.kill()
            self._process.wait()
            self._runner.close()
            raise
        for domain in ("Runtime", "Page", "Log"):
            self.call(f"{domain}.enable")

    def _do(self, work: Coroutine[Any, Any, Any]) -> Any:
        return self._runner.run(work)

    async def _connect(self, place: Path) -> WebSocketClientConnection:
        end = time.monotonic() + 60.0
        while not place.exists() or place.read_text().count("\n") < 1:
            assert time.monotonic() < end, "chromium does not start"
            await asyncio.sleep(0.05)
        port, path = place.read_text().split()
        socket = await websocket_connect(f"ws://127.0.0.1:{port}{path}", max_message_size=1 << 28)
        self._session = ""
        self._socket = socket
        targets = (await self._call("Target.getTargets"))["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        attached = await self._call("Target.attachToTarget", targetId=page, flatten=True)
        self._session = attached["sessionId"]
        return socket

    async def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._count += 1
        number = self._count
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        await self._socket.write_message(json.dumps(message))
        while True:
            answer = await asyncio.wait_for(self._socket.read_message(), 60.0)
            assert answer is not None, "chromium is gone"
            said = json.loads(answer)
            self._note(said)
            if said.get("id") == number:
                assert "error" not in said, said
                result: dict[str, Any] = said["result"]
                return result

    async def _hang_up(self) -> None:
        self._socket.close()
        while await asyncio.wait_for(self._socket.read_message(), 10.0) is not None:
            pass

    def _note(self, said: dict[str, Any]) -> None:
        if said.get("method") == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(said["params"]["exceptionDetails"]))
        if said.get("method") == "Log.entryAdded" and said["params"]["entry"]["source"] == "security":
            self.errors.append(said["params"]["entry"]["text"])  # as of the content security policy

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol."""
        result: dict[str, Any] = self._do(self._call(method, **parameters))
        return result

    def open(self, url: str) -> None:
        """Go to a page, and wait until it has a body."""
        self.call("Page.navigate", url=url)
        self.wait("document.body !== null && location.href !== 'about:blank'")

    def evaluate(self, script: str) -> Any:
        """Return the value of an expression in the page."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def wait(self, script: str, seconds: float = 60.0) -> Any:
        """Return the value of an expression as soon as it is true."""
        end = time.monotonic() + seconds
        while not (value := self.evaluate(script)):
            assert time.monotonic() < end, f"never true: {script}"
            time.sleep(0.05)
        return value

    def close(self) -> None:
        """End it."""
        self._do(self._hang_up())
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._runner.close()

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
