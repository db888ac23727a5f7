"""Server of the live view: sends the page and the frames of a run to browsers, and user input back.

Run as `python -m wbc.app.view.server FD` by `wbc.app.view.process`, with the file descriptor of the channel: a pickled
`ServerSetup` comes first, JSON with the address (or an error) is the answer, then frames come and user input goes; the
end of the channel ends the process. Who may ask for a page, see `wbc.app.view.guard`; who may change the run: pages
opened by the link with the token.
"""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import logging
import pickle
import secrets
import signal
import sys
from typing import Any

import numpy as np
import tornado.websocket

from wbc.app.address import listen
from wbc.app.scene.shapes import HIDDEN, Surface
from wbc.app.view.channel import Channel
from wbc.app.view.guard import GuardedHandler, guarded_server, new_nonce
from wbc.app.view.page import SCRIPT, Page
from wbc.app.view.process import START_TIME, ServerSetup
from wbc.app.view.user_input import UserInput
from wbc.app.view.viewer_commands import (
    empty_scene,
    object_commands,
    property_command,
    transform_head,
    transform_tail,
)
from wbc.core.errors import Array

MAX_PAGES = 32
"""Largest number of open pages."""

HALT = '{"order": {"do": "drive", "forward": 0.0, "left": 0.0, "turn": 0.0}}'
"""Message of a page that lets the robot stand."""

POLICY_VIOLATION, TRY_LATER = 1008, 1013
"""Codes of closed connections (RFC 6455, and IANA's WebSocket Close Code registry)."""


class Broadcast:
    """The scene as commands for all open pages."""

    def __init__(self, setup: ServerSetup, channel: Channel) -> None:
        """Pack the fixed part of the scene."""
        scene = setup.scene
        self.page = Page(scene.title, scene.legend, scene.com_height)
        self._channel = channel
        self._input = UserInput(setup.speed)
        self._controls = {name: setup.controls[name] for name in ("stop", "drive") if name in setup.controls}
        self._token = setup.token
        self._driver: PageConnection | None = None  # the page that has given the last velocity
        fixed = [thing for thing in scene.objects if not thing.deformable]
        self._objects = [command for thing in fixed for command in object_commands(thing)]
        self._deformable = [thing for thing in scene.objects if thing.deformable]
        self._heads = [transform_head(path) for path in scene.moving]
        self.time = 0.0
        self._matrices = np.tile(HIDDEN.ravel(), (len(scene.moving), 1))
        self._annotations: dict[str, Any] = {}
        self._connections: set[PageConnection] = set()

    @property
    def text(self) -> str:
        """Text of the present picture."""
        return str(self._annotations.get("text", ""))

    @property
    def pages(self) -> int:
        """Number of open pages."""
        return len(self._connections)

    def commands(self) -> list[bytes]:
        """Return the commands for a new page; transforms come before the objects, so that none appears elsewhere."""
        moves = self._moves(self._matrices, range(len(self._heads)))
        shapes = self._annotations.get("shapes", {})
        deformed: list[bytes] = []
        for thing in self._deformable:
            shape = thing.shape
            assert isinstance(shape, Surface)
            if thing.path in shapes:
                shape = dataclasses.replace(shape, vertices=np.reshape(shapes[thing.path], (-1, 3)))
            deformed += object_commands(dataclasses.replace(thing, shape=shape))
        return [*empty_scene(), *moves, *self._objects, *deformed, *self._colours({})]

    def scene_messages(self, connection: PageConnection) -> list[bytes | str]:
        """Return the messages for a new page: what it may change, the whole scene and the facts."""
        hello = {"page": self.page.key, "controls": self._controls, "may_change": connection.may_change}
        messages: list[bytes | str] = [
            json.dumps({"hello": hello}),
            *self.commands(),
            self._facts(connection),
        ]
        connection.shown, connection.colours = self._matrices, self._annotations.get("colours", {})
        return messages

    def news(self, connection: PageConnection) -> list[bytes | str]:
        """Return the messages that bring a page from the frame that it shows to the newest."""
        moved = np.flatnonzero((connection.shown != self._matrices).any(axis=1)).tolist()
        moves, colours = self._moves(self._matrices, moved), self._colours(connection.colours)
        connection.shown, connection.colours = self._matrices, self._annotations.get("colours", {})
        return [*moves, *colours, self._facts(connection)]

    def add(self, connection: PageConnection) -> bool:
        """Add a page; return false if there are too many."""
        if len(self._connections) >= MAX_PAGES:
            return False
        self._connections.add(connection)
        self._tell()
        return True

    def remove(self, connection: PageConnection) -> None:
        """Remove a page: a robot that it drove stands, and a pause ends with the last one that could end it."""
        self._connections.discard(connection)
        if connection is self._driver:
            self.take_input(HALT, connection)
        if not any(other.may_change for other in self._connections):
            self.take_input('{"paused": false}')
        self._tell()

    def _tell(self) -> None:
        """Tell the run what the pages want, and how many there are."""
        drivers = sum(other.may_change for other in self._connections)
        self._channel.write(self._input.pack(self.pages, drivers))

    def receive(self) -> None:
        """Take a frame of the run, if there is one, and tell the pages; `EOFError` if the run has ended."""
        frame = self._channel.read()
        if frame is not None:
            self.time, self._matrices, annotations = pickle.loads(frame)
            self._annotations = json.loads(annotations)
            for connection in self._connections:
                connection.news.set()

    def take_input(self, message: str | bytes, page: PageConnection | None = None) -> None:
        """Pass on a page's message, and tell all pages about pause, speed, and which of them drives."""
        order = self._input.take(message)
        if order is not None and order.get("do") == "drive":
            moves = any(order.get(name) for name in ("forward", "left", "turn"))
            self._driver = page if moves else None
        self._tell()
        for connection in self._connections:
            connection.news.set()

    def may_change(self, token: str) -> bool:
        """Return true for the token of the link that the run has printed."""
        return secrets.compare_digest(token.encode(), self._token.encode())

    def _moves(self, matrices: Array, places: range | list[int]) -> list[bytes]:
        return [self._heads[i] + transform_tail(matrices[i]) for i in places]

    def _colours(self, known: dict[str, Any]) -> list[bytes]:
        """Return the commands for colours that a page does not have yet."""
        colours: dict[str, Any] = self._annotations.get("colours", {})
        changed = {path: colour for path, colour in colours.items() if known.get(path) != colour}
        return [property_command(path, "color", colour) for path, colour in changed.items()]

    def _facts(self, page: PageConnection) -> str:
        facts = {key: value for key, value in self._annotations.items() if key != "colours"}
        other = self._driver is not None and self._driver is not page
        state = {"paused": self._input.paused, "speed": self._input.speed, "other_drives": other}
        return json.dumps({"time": self.time, **facts, **state})


class PageConnection(GuardedHandler, tornado.websocket.WebSocketHandler):
    """Connection to one page.

    Messages are sent one by one, each when the one before has been taken: a page that reads slowly skips frames, and of
    one that does not read one message waits until a ping has found it out.

    Attributes:
        may_change: The page has shown the token: its messages are obeyed.
        news: Set when there is something newer than the page shows.
        shown: Matrices of the frame that the page shows, or is being sent.
        colours: Colours of that frame.
    """

    shown: Array
    colours: dict[str, Any]

    def initialize(self, broadcast: Broadcast) -> None:
        """Take the broadcast that the application gives."""
        self._broadcast = broadcast
        self.may_change = False
        self.news = asyncio.Event()
        self._sender: asyncio.Task[None] | None = None

    def open(self, *_: str, **__: str) -> None:
        """Add the page, and begin to send."""
        self.may_change = self._broadcast.may_change(self.get_query_argument("token", ""))
        if not self._broadcast.add(self):
            self.close(TRY_LATER, "too many pages are open")
            return
        self._sender = asyncio.create_task(self._send(self._broadcast.scene_messages(self)))

    async def _send(self, messages: list[bytes | str]) -> None:
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            while True:
                for message in messages:
                    await self.write_message(message, binary=isinstance(message, bytes))
                await self.news.wait()
                self.news.clear()
                messages = self._broadcast.news(self)

    def on_message(self, message: str | bytes) -> None:
        """Take the user's input, if the page may give any."""
        if self.may_change:
            self._broadcast.take_input(message, self)
        else:
            self.close(POLICY_VIOLATION, "changes need the link that the run printed")

    def on_close(self) -> None:
        """Remove the page."""
        if self._sender is not None:
            self._sender.cancel()
            self._broadcast.remove(self)


class PageHandler(GuardedHandler):
    """Live page, self-contained page and script."""

    def initialize(self, broadcast: Broadcast, kind: str) -> None:
        """Take the broadcast that the application gives."""
        self._broadcast, self._kind = broadcast, kind

    async def get(self) -> None:
        """Answer a request."""
        page, nonce = self._broadcast.page, new_nonce()
        if self._kind == "script":
            self.set_header("Content-Type", "text/javascript; charset=utf-8")
            await self.answer(SCRIPT.read_bytes())
        elif self._kind == "static":
            commands = self._broadcast.commands()
            await self.answer(page.static(commands, self._broadcast.time, self._broadcast.text, nonce), nonce)
        else:
            await self.answer(page.live(nonce), nonce)


def page_routes(broadcast: Broadcast) -> list[Any]:
    """Return the rules of the server."""
    routes: list[Any] = [(r"/stream", PageConnection, {"broadcast": broadcast})]
    for pattern, kind in ((r"/", "live"), (r"/scene\.html", "static"), (r"/main\.min\.js", "script")):
        routes.append((pattern, PageHandler, {"broadcast": broadcast, "kind": kind}))
    return routes


async def serve(setup: ServerSetup, channel: Channel) -> None:
    """Serve until the run ends.

    Raises:
        OSError: The port is in use.
    """
    listening, served = listen(setup.address)
    broadcast = Broadcast(setup, channel)
    guarded_server(served, page_routes(broadcast), framed=setup.framed).add_socket(listening)
    channel.write(json.dumps(dataclasses.asdict(served)).encode())
    ended = asyncio.Event()

    def receive() -> None:
        try:
            broadcast.receive()
        except EOFError:
            asyncio.get_running_loop().remove_reader(channel)
            ended.set()

    asyncio.get_running_loop().add_reader(channel, receive)
    await ended.wait()


def main() -> None:
    """Run the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run, whose end ends this process
    logging.getLogger("tornado.access").setLevel(logging.ERROR)
    channel = Channel(int(sys.argv[1]))
    setup = channel.read(START_TIME)
    assert setup is not None
    try:
        asyncio.run(serve(pickle.loads(setup), channel))
    except OSError as error:
        channel.write(json.dumps({"error": error.strerror or str(error)}).encode())


if __name__ == "__main__":
    main()
