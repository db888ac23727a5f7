"""Server of the live view: sends the page and frames from shared memory to browsers, and user input back.

Run as `python -m wbc.app.view.server FD` by `wbc.app.view.process`, with the file descriptor of the channel: a pickled
`ServerSetup` comes in on the standard input, one line of JSON with the port (or an error) goes out on the standard
output, and the end of the input ends the process.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import pickle
import signal
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import tornado.httpserver
import tornado.ioloop
import tornado.web
import tornado.websocket

from wbc.app.scene.shapes import HIDDEN, Surface
from wbc.app.view.address import listen
from wbc.app.view.channel import Channel
from wbc.app.view.page import SCRIPT, Page
from wbc.app.view.process import ServerSetup
from wbc.app.view.user_input import UserInput
from wbc.app.view.viewer_commands import (
    empty_scene,
    object_commands,
    property_command,
    transform_head,
    transform_tail,
)
from wbc.core.errors import Array

MAX_POLL_TIME = 0.03
"""Longest time between two checks for a new frame, s."""


class Broadcast:
    """The scene as commands for all open pages."""

    def __init__(self, setup: ServerSetup, channel: Channel) -> None:
        """Pack the fixed part of the scene."""
        scene = setup.scene
        self.page = Page(scene.title, scene.legend, scene.com_height)
        self._channel = channel
        self._input = UserInput(setup.speed)
        self._hello = {"page": self.page.key, "controls": setup.controls}
        fixed = [thing for thing in scene.objects if not thing.deformable]
        self._objects = [command for thing in fixed for command in object_commands(thing)]
        self._deformable = [thing for thing in scene.objects if thing.deformable]
        self._heads = [transform_head(path) for path in scene.moving]
        self._number, self.time = 0, 0.0
        self._matrices = np.tile(HIDDEN.ravel(), (len(scene.moving), 1))
        self._annotations: dict[str, Any] = {}
        self._connections: set[PageConnection] = set()

    @property
    def text(self) -> str:
        """Text of the present picture."""
        return str(self._annotations.get("text", ""))

    def commands(self) -> list[bytes]:
        """Return the commands for a new page; transforms come before the objects, so that none appears elsewhere."""
        self._fetch()
        moves = self._moves(self._matrices, range(len(self._heads)))
        shapes = self._annotations.get("shapes", {})
        deformed: list[bytes] = []
        for thing in self._deformable:
            shape = thing.shape
            assert isinstance(shape, Surface)
            if thing.path in shapes:
                shape = replace(shape, vertices=np.reshape(shapes[thing.path], (-1, 3)))
            deformed += object_commands(replace(thing, shape=shape))
        return [*empty_scene(), *moves, *self._objects, *deformed, *self._colours({})]

    def add(self, connection: PageConnection) -> None:
        """Add a page: send it the whole scene."""
        connection.send(json.dumps({"hello": self._hello}))
        for command in self.commands():
            connection.send(command)
        connection.send(self._facts())
        connection.shown, connection.colours = self._matrices, self._annotations.get("colours", {})
        self._connections.add(connection)
        self._channel.pages = len(self._connections)

    def remove(self, connection: PageConnection) -> None:
        """Remove a page; a pause ends with the last one."""
        self._connections.discard(connection)
        if not self._connections:
            self.take_input({"paused": False})
        self._channel.pages = len(self._connections)

    def tick(self) -> None:
        """Send the newest frame to every page that has received the last one."""
        self._fetch()
        for connection in self._connections:
            if not connection.busy and connection.shown is not self._matrices:
                moved = np.flatnonzero((connection.shown != self._matrices).any(axis=1))
                for command in self._moves(self._matrices, moved.tolist()):
                    connection.send(command)
                for command in self._colours(connection.colours):
                    connection.send(command)
                connection.send(self._facts())
                connection.shown, connection.colours = self._matrices, self._annotations.get("colours", {})

    def take_input(self, message: Any) -> None:
        """Pass on a page's message, and tell all pages about pause and speed."""
        self._input.take(message)
        self._channel.write_input(self._input.pack())
        for connection in self._connections:
            connection.send(self._facts())

    def _fetch(self) -> None:
        newer = self._channel.read(self._number)
        if newer is not None:
            self._number, self.time, self._matrices, annotations = newer
            self._annotations = json.loads(annotations)
            self._channel.shown = self._number

    def _moves(self, matrices: Array, places: range | list[int]) -> list[bytes]:
        return [self._heads[i] + transform_tail(matrices[i]) for i in places]

    def _colours(self, known: dict[str, Any]) -> list[bytes]:
        """Return the commands for colours that a page does not have yet."""
        colours: dict[str, Any] = self._annotations.get("colours", {})
        changed = {path: colour for path, colour in colours.items() if known.get(path) != colour}
        return [property_command(path, "color", colour) for path, colour in changed.items()]

    def _facts(self) -> str:
        facts = {key: value for key, value in self._annotations.items() if key != "colours"}
        state = {"paused": self._input.paused, "speed": self._input.speed}
        return json.dumps({"time": self.time, **facts, **state})


class PageConnection(tornado.websocket.WebSocketHandler):
    """Connection to one page; tornado's check of the origin refuses pages of other sites."""

    shown: Array
    colours: dict[str, Any]

    def initialize(self, broadcast: Broadcast) -> None:
        """Take the broadcast that the application gives."""
        self._broadcast = broadcast
        self._sent: asyncio.Future[None] | None = None

    @property
    def busy(self) -> bool:
        """True while a message is being sent."""
        return self._sent is not None and not self._sent.done()

    def open(self, *_: str, **__: str) -> None:
        """Add the page."""
        self._broadcast.add(self)

    def send(self, message: bytes | str) -> None:
        """Send one message."""
        try:
            self._sent = self.write_message(message, binary=isinstance(message, bytes))
        except tornado.websocket.WebSocketClosedError:
            return
        self._sent.add_done_callback(lambda done: done.exception())  # a page may go at any time

    def on_message(self, message: str | bytes) -> None:
        """Take the user's input; text that is no JSON is dropped."""
        with contextlib.suppress(ValueError):
            self._broadcast.take_input(json.loads(message))

    def on_close(self) -> None:
        """Remove the page."""
        self._broadcast.remove(self)


class PageHandler(tornado.web.RequestHandler):
    """Live page, self-contained page and script."""

    def initialize(self, broadcast: Broadcast, kind: str) -> None:
        """Take the broadcast that the application gives."""
        self._broadcast, self._kind = broadcast, kind

    def get(self) -> None:
        """Answer a request."""
        self.set_header("Cache-Control", "no-store")
        if self._kind == "script":
            self.set_header("Content-Type", "text/javascript; charset=utf-8")
            self.finish(SCRIPT.read_bytes())
        elif self._kind == "static":
            commands = self._broadcast.commands()
            self.finish(self._broadcast.page.static(commands, self._broadcast.time, self._broadcast.text))
        else:
            self.finish(self._broadcast.page.live())


async def serve(setup: ServerSetup, channel: Channel, ended: asyncio.Event) -> None:
    """Serve until the run ends.

    Raises:
        OSError: The port is in use.
    """
    listening = listen(setup.host, setup.port)
    broadcast = Broadcast(setup, channel)
    routes: list[Any] = [(r"/stream", PageConnection, {"broadcast": broadcast})]
    for pattern, kind in ((r"/", "live"), (r"/scene\.html", "static"), (r"/main\.min\.js", "script")):
        routes.append((pattern, PageHandler, {"broadcast": broadcast, "kind": kind}))
    server = tornado.httpserver.HTTPServer(tornado.web.Application(routes))
    server.add_socket(listening)
    print(json.dumps({"port": listening.getsockname()[1]}), flush=True)
    tornado.ioloop.PeriodicCallback(broadcast.tick, 1000.0 * min(1.0 / setup.rate, MAX_POLL_TIME)).start()
    await ended.wait()


async def _main() -> None:
    setup: ServerSetup = pickle.load(sys.stdin.buffer)
    channel = Channel(len(setup.scene.moving), int(sys.argv[1]))
    ended = asyncio.Event()
    asyncio.get_running_loop().add_reader(0, ended.set)  # nothing more is written: readable means the end
    try:
        await serve(setup, channel, ended)
    except OSError as error:
        print(json.dumps({"error": error.strerror or str(error)}), flush=True)


def main() -> None:
    """Run the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run, whose end ends this process
    logging.getLogger("tornado.access").setLevel(logging.ERROR)
    asyncio.run(_main())


if __name__ == "__main__":
    main()
