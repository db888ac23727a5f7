"""The process that draws: it serves the page, sends frames from shared memory to browsers, and hands their wishes back.

Run as `python -m wbc.app.view.server` by `wbc.app.view.view`: a pickled `Setup` comes in on the standard input,
one line of JSON with the port (or what went wrong) goes out on the standard output, and the end of the input is the
end of it. It is a process and not a thread because drawing costs milliseconds of Python a frame, for which a thread
would stop the control loop.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import pickle
import signal
import struct
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import tornado.httpserver
import tornado.ioloop
import tornado.netutil
import tornado.web
import tornado.websocket
import umsgpack  # type: ignore[import-untyped]  # comes with meshcat, which speaks it
from meshcat import geometry

from wbc.app.view.channel import Channel
from wbc.app.view.controls import Wishes
from wbc.app.view.page import SCRIPT, Page
from wbc.app.view.scene import HIDDEN, ROOT, SKY_COLOURS, SceneObject, Setup
from wbc.app.view.shapes import Colour, MeshFile, Shape, Surface, VisualBox, VisualCylinder, VisualEllipsoid
from wbc.core.errors import Array

FIRST_PORT, PORTS = 7000, 200
"""Ports that are tried when none is asked for; MeshCat's own begin with 7000, too."""

SLOWEST_TICK = 0.03
"""Longest time between two looks for a new frame, s."""


# ---- commands of the viewer -----------------------------------------------------------------------------------------


def object_commands(drawing: SceneObject) -> Iterator[bytes]:
    """Yield the packed commands that create an object."""
    for i, (shape, placement) in enumerate(_geometries(drawing.shape)):
        path = f"{drawing.path}/{i}"
        lowered = geometry.Mesh(shape, _material(drawing)).lower()
        for made in lowered[
            "geometries"
        ]:  # the name that the page has now for what the package calls "_meshfile"
            made["type"] = made["type"].replace("_meshfile", "_meshfile_geometry")
        yield transform_command(path, (drawing.placement @ placement).T.ravel())
        yield umsgpack.packb({"type": "set_object", "path": path, "object": lowered})


def transform_command(path: str, columns: Array) -> bytes:
    """Return the packed command that moves a path.

    Args:
        path: The path.
        columns: Homogeneous matrix by columns, shape (16,).
    """
    return transform_head(path) + transform_tail(columns)


def property_command(path: str, name: str, value: Any) -> bytes:
    """Return the packed command that sets a property of a path."""
    packed: bytes = umsgpack.packb({"type": "set_property", "path": path, "property": name, "value": value})
    return packed


def transform_head(path: str) -> bytes:
    """The part of a transform command that is the same for every matrix."""
    packed: bytes = umsgpack.packb({"type": "set_transform", "path": path, "matrix": []})
    return packed[:-1]  # less the empty list


def transform_tail(columns: Array) -> bytes:
    """The matrix of a transform command: a list of 16 doubles in MessagePack."""
    values = np.empty(16, [("tag", "u1"), ("value", ">f8")])
    values["tag"], values["value"] = 0xCB, columns
    return struct.pack(">BH", 0xDC, 16) + values.tobytes()


def _geometries(shape: Shape) -> Iterator[tuple[Any, Array]]:
    """Yield MeshCat's geometries for a shape, each with its placement."""
    here = np.eye(4)
    if isinstance(shape, VisualBox):
        yield geometry.Box(list(shape.size)), here
    elif isinstance(shape, VisualEllipsoid):
        yield geometry.Sphere(1.0), np.diag([*shape.semi_axes, 1.0])
    elif isinstance(shape, VisualCylinder):
        along_z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # theirs is along y
        yield geometry.Cylinder(shape.length, shape.radius), along_z
        if shape.round_ends:
            for end in (-0.5, 0.5):
                cap = np.diag([shape.radius, shape.radius, shape.radius, 1.0])
                cap[2, 3] = end * shape.length
                yield geometry.Sphere(1.0), cap
    elif isinstance(shape, Surface):
        colours = None if shape.colours is None else shape.colours.astype(np.float32)
        vertices = shape.vertices.astype(np.float32)
        yield geometry.TriangularMeshGeometry(vertices, shape.faces, colours), here
    elif isinstance(shape, MeshFile):
        yield _mesh(shape.path), np.diag([*shape.scale, 1.0])


def _mesh(path: str) -> Any:
    kinds = {
        ".stl": geometry.StlMeshGeometry,
        ".obj": geometry.ObjMeshGeometry,
        ".dae": geometry.DaeMeshGeometry,
    }
    return kinds[os.path.splitext(path)[1].lower()].from_file(path)


def _material(drawing: SceneObject) -> Any:
    options: dict[str, Any] = {"color": _colour_number(drawing.colour), "opacity": drawing.colour[3]}
    if isinstance(drawing.shape, Surface) and drawing.shape.colours is not None:
        options["vertexColors"] = True
    if drawing.on_top:  # drawn last and not hidden by anything
        options |= {"transparent": True, "depthTest": False}
    return (geometry.MeshLambertMaterial if drawing.shaded else geometry.MeshBasicMaterial)(**options)


def _colour_number(colour: Colour) -> int:
    red, green, blue = (round(255 * value) for value in colour[:3])
    return (red << 16) + (green << 8) + blue


# ---- the server -----------------------------------------------------------------------------------------------------


class Show:
    """The scene as commands, and the browsers that follow it."""

    def __init__(self, setup: Setup, channel: Channel) -> None:
        """Pack what does not change."""
        scene = setup.scene
        self.page = Page(scene.title, scene.legend, scene.size)
        self._channel = channel
        self._wishes = Wishes(setup.speed)
        self._hello = {"page": self.page.key, "controls": setup.controls}
        self._first = [umsgpack.packb({"type": "delete", "path": ROOT})]
        settings: list[tuple[str, str, Any]] = [("/Grid", "visible", False)]  # the ground has tiles
        settings += [("/Background", key, list(colour)) for key, colour in SKY_COLOURS.items()]
        self._first += [property_command(*setting) for setting in settings]
        fixed = [drawing for drawing in scene.drawings if not drawing.bends]
        self._objects = [command for drawing in fixed for command in object_commands(drawing)]
        self._bending = [drawing for drawing in scene.drawings if drawing.bends]
        self._heads = [transform_head(path) for path in scene.moving]
        self._number, self.time = 0, 0.0
        self._matrices = np.tile(HIDDEN.ravel(), (len(scene.moving), 1))
        self._note: dict[str, Any] = {}
        self._streams: set[FrameStream] = set()

    @property
    def text(self) -> str:
        """What the present picture says in words."""
        return str(self._note.get("text", ""))

    def commands(self) -> list[bytes]:
        """Everything that a new page must be told; places come before the objects that appear in them."""
        self._fetch()
        moves = self._moves(self._matrices, range(len(self._heads)))
        shapes = self._note.get("shapes", {})
        bent = []
        for drawing in self._bending:
            shape = drawing.shape
            assert isinstance(shape, Surface)
            if drawing.path in shapes:
                shape = replace(shape, vertices=np.reshape(shapes[drawing.path], (-1, 3)))
            bent += list(object_commands(replace(drawing, shape=shape)))
        return [*self._first, *moves, *self._objects, *bent, *self._colours({})]

    def add(self, stream: FrameStream) -> None:
        """Take a page in."""
        stream.send(json.dumps({"hello": self._hello}))
        for command in self.commands():
            stream.send(command)
        stream.send(self._facts())
        stream.shown, stream.colours = self._matrices, self._note.get("colours", {})
        self._streams.add(stream)
        self._channel.pages = len(self._streams)

    def remove(self, stream: FrameStream) -> None:
        """Forget a page."""
        self._streams.discard(stream)
        if not self._streams:  # nobody could end the pause
            self._tell({"paused": False})
        self._channel.pages = len(self._streams)

    def tick(self) -> None:
        """Send the newest frame to every page that has taken in the last one."""
        self._fetch()
        for stream in self._streams:
            if not stream.busy and stream.shown is not self._matrices:
                moved = np.flatnonzero((stream.shown != self._matrices).any(axis=1))
                for command in self._moves(self._matrices, moved.tolist()):
                    stream.send(command)
                for command in self._colours(stream.colours):
                    stream.send(command)
                stream.send(self._facts())
                stream.shown, stream.colours = self._matrices, self._note.get("colours", {})

    def wish(self, text: str | bytes) -> None:
        """Hand over what a page wishes for, and let all pages know about pause and speed."""
        try:
            said = json.loads(text)
        except ValueError:
            return
        self._tell(said)

    def _tell(self, said: Any) -> None:
        self._wishes.take(said)
        self._channel.wish(self._wishes.pack())
        for stream in self._streams:
            stream.send(self._facts())

    def _fetch(self) -> None:
        newer = self._channel.read(self._number)
        if newer is not None:
            self._number, self.time, self._matrices, note = newer
            self._note = json.loads(note)
            self._channel.shown = self._number

    def _moves(self, matrices: Array, places: range | list[int]) -> list[bytes]:
        return [self._heads[i] + transform_tail(matrices[i]) for i in places]

    def _colours(self, known: dict[str, Any]) -> list[bytes]:
        """Commands for colours that a page does not know yet."""
        colours: dict[str, Any] = self._note.get("colours", {})
        changed = {path: colour for path, colour in colours.items() if known.get(path) != colour}
        return [property_command(path, "color", colour) for path, colour in changed.items()]

    def _facts(self) -> str:
        facts = {key: value for key, value in self._note.items() if key != "colours"}
        state = {"paused": self._wishes.paused, "speed": self._wishes.speed}
        return json.dumps({"time": self.time, **facts, **state})


class FrameStream(tornado.websocket.WebSocketHandler):
    """The connection to one page; pages of other sites are refused by tornado's check of the origin."""

    shown: Array
    colours: dict[str, Any]

    def initialize(self, show: Show) -> None:
        """Take over what to show."""
        self._show = show
        self._sent: asyncio.Future[None] | None = None

    @property
    def busy(self) -> bool:
        """True while something sent is still on its way."""
        return self._sent is not None and not self._sent.done()

    def open(self, *_: str, **__: str) -> None:
        """Begin with the whole scene."""
        self._show.add(self)

    def send(self, message: bytes | str) -> None:
        """Send one message."""
        try:
            self._sent = self.write_message(message, binary=isinstance(message, bytes))
        except tornado.websocket.WebSocketClosedError:
            return
        self._sent.add_done_callback(lambda done: done.exception())  # a page may go at any time

    def on_message(self, message: str | bytes) -> None:
        """Take a wish."""
        self._show.wish(message)

    def on_close(self) -> None:
        """Forget the page."""
        self._show.remove(self)


class Text(tornado.web.RequestHandler):
    """The pages and the script."""

    def initialize(self, show: Show, kind: str) -> None:
        """Take over what to show."""
        self._show, self._kind = show, kind

    def get(self) -> None:
        """Answer a request."""
        self.set_header("Cache-Control", "no-store")
        if self._kind == "script":
            self.set_header("Content-Type", "text/javascript; charset=utf-8")
            self.finish(SCRIPT.read_bytes())
        elif self._kind == "static":
            commands = self._show.commands()
            self.finish(self._show.page.static(commands, self._show.time, self._show.text))
        else:
            self.finish(self._show.page.live())


def listen(host: str, port: int | None) -> list[Any]:
    """Return listening sockets.

    Raises:
        OSError: No port that was asked for, or none of the range, is free.
    """
    if port is not None:
        return tornado.netutil.bind_sockets(port, host)
    for candidate in range(FIRST_PORT, FIRST_PORT + PORTS):
        try:
            return tornado.netutil.bind_sockets(candidate, host)
        except OSError as error:
            last = error
    raise last


async def serve(setup: Setup, channel: Channel, ended: asyncio.Event) -> None:
    """Serve until the parent goes.

    Raises:
        OSError: The port cannot be had.
    """
    sockets = listen(setup.host, setup.port)
    show = Show(setup, channel)
    routes: list[Any] = [(r"/stream", FrameStream, {"show": show})]
    for pattern, kind in ((r"/", "live"), (r"/scene\.html", "static"), (r"/main\.min\.js", "script")):
        routes.append((pattern, Text, {"show": show, "kind": kind}))
    server = tornado.httpserver.HTTPServer(tornado.web.Application(routes))
    server.add_sockets(sockets)
    print(json.dumps({"port": sockets[0].getsockname()[1]}), flush=True)
    tornado.ioloop.PeriodicCallback(show.tick, 1000.0 * min(1.0 / setup.rate, SLOWEST_TICK)).start()
    await ended.wait()


async def _main() -> None:
    setup: Setup = pickle.load(sys.stdin.buffer)
    channel = Channel(len(setup.scene.moving), setup.fd)
    ended = asyncio.Event()
    asyncio.get_running_loop().add_reader(
        0, ended.set
    )  # nothing more is ever written: it can only be the end
    try:
        await serve(setup, channel, ended)
    except OSError as error:
        print(json.dumps({"error": error.strerror or str(error)}), flush=True)


def main() -> None:
    """Run the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run; its end is ours
    logging.getLogger("tornado.access").setLevel(logging.ERROR)
    asyncio.run(_main())


if __name__ == "__main__":
    main()
