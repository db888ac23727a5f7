"""Pages of the live view: the scene and the frames of a run for browsers, and the input of those who watch it.

All of it happens in the thread of a `PageServer`. Who may ask for a page, see `wbc.app.view.guard`; who may change the
run: pages opened by the link with the token. Messages come from a network: what is not exactly as declared here is
dropped.
"""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import secrets
import time as clock
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import tornado.websocket
from pydantic import BaseModel, Field, ValidationError

from wbc.app.scene.layer import Annotations
from wbc.app.scene.scene import Scene
from wbc.app.scene.shapes import HIDDEN, Surface
from wbc.app.view.guard import MAX_MESSAGE, GuardedHandler, PageHandler
from wbc.app.view.pace import Pace
from wbc.app.view.page import SCRIPT, Page
from wbc.app.view.viewer_commands import (
    empty_scene,
    object_commands,
    property_command,
    transform_head,
    transform_tail,
)
from wbc.core.errors import Array
from wbc.core.settings import CONFIG

MAX_PAGES = 32
"""Largest number of open pages."""

LAST_FRAME_TIME = 0.5
"""Longest time that pages are given for the last frame, s."""

POLICY_VIOLATION, TRY_LATER = 1008, 1013
"""Codes of closed connections (RFC 6455, and IANA's WebSocket Close Code registry)."""


Text = Annotated[str, Field(max_length=100)]

Order = Annotated[dict[Text, Text | float], Field(max_length=8)]
"""Order to change a run: {"do": name, …}; `wbc.app.view.controls` checks the rest."""

STAND: dict[str, Any] = {"do": "drive", "forward": 0.0, "left": 0.0, "turn": 0.0}


class PageMessage(BaseModel):
    """Message of a page; what it leaves out stays as it is."""

    model_config = CONFIG

    paused: bool = False
    speed: Annotated[float, Field(ge=1e-3, le=1e3)] | None = None
    order: Order | None = None


class Broadcast:
    """The scene as commands for all open pages, and their input.

    Attributes:
        scene: The scene.
        page: The page.
        time: Simulated time of the present picture, s.
        pages: Number of open pages.
        drivers: Number of those that may change the run: they show the token.
    """

    def __init__(
        self,
        scene: Scene,
        pace: Pace,
        order: Callable[[dict[str, Any]], None],
        offered: dict[str, Any],
        token: str,
    ) -> None:
        """Pack the fixed part of the scene.

        Pages set the pace; `order` is called with each of their orders. `offered` are the controls of the run, see
        `LiveControls.available`; who shows the token may change it, or pause it.
        """
        self.scene, self.page = scene, Page(scene.title, scene.legend, scene.com_height)
        self.pages = self.drivers = 0
        self._pace, self._order, self.token = pace, order, token
        self._controls = {name: offered[name] for name in ("stop", "drive") if name in offered}
        self._driver: PageConnection | None = None  # the page that has given the last velocity
        self._waiting: tuple[float, Array, Annotations] | None = None
        fixed = [thing for thing in scene.objects if not thing.deformable]
        self._objects = [command for thing in fixed for command in object_commands(thing)]
        self._deformable = [thing for thing in scene.objects if thing.deformable]
        self._heads = [transform_head(path) for path in scene.moving]
        self.time = 0.0
        self._matrices = np.tile(HIDDEN.ravel(), (len(scene.moving), 1))
        self._annotations: dict[str, Any] = {}
        self._connections: set[PageConnection] = set()

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
        self._count()
        return True

    def remove(self, connection: PageConnection) -> None:
        """Remove a page: a robot that it drove stands, and a pause ends with the last one that could end it."""
        self._connections.discard(connection)
        self._count()
        if connection is self._driver:
            self._driver = None
            self._order(STAND)
        if not self.drivers:
            self._pace.paused = False
        self._tell()

    def _count(self) -> None:
        self.pages = len(self._connections)
        self.drivers = sum(connection.may_change for connection in self._connections)

    def _tell(self) -> None:
        """Tell the pages that there is something new."""
        for connection in self._connections:
            connection.news.set()

    def put(self, time: float, matrices: Array, annotations: Annotations) -> None:
        """Put a frame of the run in place of one that has not been taken; may be called from any thread."""
        self._waiting = time, matrices, annotations

    def take_frame(self) -> None:
        """Take the frame that waits, if there is one, and tell the pages."""
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self.time, matrices, annotations = waiting
            self._matrices = matrices.transpose(0, 2, 1).reshape(-1, 16)  # as the viewer takes them
            self._annotations = annotations.plain()
            self._tell()

    def take_input(self, message: str | bytes, page: PageConnection | None = None) -> None:
        """Carry out a page's message, and tell all pages about pause, speed, and which of them drives."""
        if len(message) > MAX_MESSAGE:
            return
        try:
            said = PageMessage.model_validate_json(message)
        except ValidationError:
            return
        if "paused" in said.model_fields_set:
            self._pace.paused = said.paused
        if "speed" in said.model_fields_set and said.speed != self._pace.speed:
            self._pace.speed = said.speed
        if said.order is not None:
            self._order(dict(said.order))
            if said.order.get("do") == "drive":
                moves = any(said.order.get(name) for name in ("forward", "left", "turn"))
                self._driver = page if moves else None
        self._tell()

    async def end(self) -> None:
        """Close all connections, after they have taken the last frame or a time."""
        self.take_frame()
        end = clock.perf_counter() + LAST_FRAME_TIME
        while clock.perf_counter() < end and any(
            each.behind or each.news.is_set() for each in self._connections
        ):
            await asyncio.sleep(0.01)
        for connection in list(self._connections):
            connection.end()
        await asyncio.sleep(0)

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
        state = {"paused": self._pace.paused, "speed": self._pace.speed, "other_drives": other}
        return json.dumps({"time": self.time, **facts, **state})


class PageConnection(GuardedHandler, tornado.websocket.WebSocketHandler):
    """Connection to one page.

    Messages are sent one by one, each when the one before has been taken: a page that reads slowly skips frames, and of
    one that does not read one message waits until a ping has found it out.

    Attributes:
        may_change: The page has shown the token: its messages are obeyed.
        news: Set when there is something newer than the page shows.
        behind: A frame is being sent.
        shown: Matrices of the frame that the page shows, or is being sent.
        colours: Colours of that frame.
    """

    shown: Array
    colours: dict[str, Any]

    def initialize(self, broadcast: Broadcast) -> None:
        """Take the broadcast that the application gives."""
        self._broadcast = broadcast
        self.may_change, self.behind = False, True
        self.news = asyncio.Event()
        self._sender: asyncio.Task[None] | None = None

    def open(self, *_: str, **__: str) -> None:
        """Add the page, and begin to send."""
        token = self.get_query_argument("token", "")
        self.may_change = secrets.compare_digest(token.encode(), self._broadcast.token.encode())
        if not self._broadcast.add(self):
            self.close(TRY_LATER, "too many pages are open")
            return
        self._sender = asyncio.create_task(self._send(self._broadcast.scene_messages(self)))

    async def _send(self, messages: list[bytes | str]) -> None:
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            while True:
                for message in messages:
                    await self.write_message(message, binary=isinstance(message, bytes))
                self.behind = False
                await self.news.wait()
                self.behind = True
                self.news.clear()
                messages = self._broadcast.news(self)

    def on_message(self, message: str | bytes) -> None:
        """Take the user's input, if the page may give any."""
        if self.may_change:
            self._broadcast.take_input(message, self)
        else:
            self.close(POLICY_VIOLATION, "changes need the link that the run printed")

    def end(self) -> None:
        """Close the connection, whether the page answers or not."""
        self.close()
        if self.ws_connection is not None and self.ws_connection.stream is not None:
            self.ws_connection.stream.close()

    def on_close(self) -> None:
        """Remove the page."""
        if self._sender is not None:
            self._sender.cancel()
            self._broadcast.remove(self)


class ScriptHandler(GuardedHandler):
    """The viewer."""

    async def get(self) -> None:
        """Answer a request."""
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        await self.answer(SCRIPT.read_bytes())


def page_routes(broadcast: Broadcast) -> list[Any]:
    """Return the rules of the server."""
    return [
        (r"/stream", PageConnection, {"broadcast": broadcast}),
        (r"/", PageHandler, {"page": broadcast.page.live}),
        (r"/main\.min\.js", ScriptHandler),
    ]
