"""A page of viser that shows a model and marks, with a panel: for the workbench and for replays."""

from __future__ import annotations

import contextlib
import hmac
import http
import io
import math
import secrets
import threading
import time as clock
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from html import escape
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from wbc.app.view.base import HOSTS, LOCAL, TEXT_PERIOD, ViewError
from wbc.app.view.marks import Mark, Picture, css, mark_mesh
from wbc.app.view.stage import EYE, LOOK_AT, DrawnScene, Stage
from wbc.robots.mechanism import Colour

ROOT = "/wbc"
"""Root of all nodes."""

SPEEDS = {"0.1": 0.1, "0.25": 0.25, "0.5": 0.5, "1": 1.0, "2": 2.0, "4": 4.0}
"""Choices of the speed, multiples of real time."""

_one_at_a_time = threading.Lock()


class PageGuard:
    """Gate in front of viser's server, which itself answers everybody: whoever speaks to a workbench drives the robot.

    Requests are answered if all of these hold:

    - their path begins with a secret of the run, which stands in the link;
    - their host is a name of this machine, so that no foreign name can be made to lead here;
    - the page that has sent them, their origin, is the page itself, or they come from no page.

    Attributes:
        secret: First part of the path of every request.
        stands: True once it stands in front of a server.
    """

    def __init__(self) -> None:
        self.secret = secrets.token_urlsafe(16)
        self.stands = False

    @contextlib.contextmanager
    def guards(self) -> Iterator[None]:
        """Stand in front of viser's server that the block starts.

        viser has no means of its own: it hands its requests to a function of `websockets`, which is wrapped.
        """
        from websockets.asyncio import server  # noqa: PLC0415 - comes with viser, an extra

        serve = server.serve

        def serve_guarded(handler: Any, *places: Any, process_request: Any = None, **how: Any) -> Any:
            if handler.__module__.partition(".")[0] == "viser":
                process_request, self.stands = partial(self.answer, process_request), True
            return serve(handler, *places, process_request=process_request, **how)

        with _one_at_a_time:
            server.serve = serve_guarded  # type: ignore[assignment,misc]
            try:
                yield
            finally:
                server.serve = serve  # type: ignore[misc]

    def answer(self, answer: Callable[[Any, Any], Any], connection: Any, request: Any) -> Any:
        """Return the answer to a request (None lets a web socket in), or a refusal."""
        _, first, rest = [*request.path.split("/", 2), "", ""][:3]
        known = hmac.compare_digest(first.partition("?")[0].encode(), self.secret.encode())
        if not (known and self.is_own(request.headers.get_all("Host"), request.headers.get_all("Origin"))):
            return connection.respond(
                http.HTTPStatus.FORBIDDEN, "Open the link that the program has printed.\n"
            )
        request.path = f"/{rest}"
        return answer(connection, request)

    @staticmethod
    def is_own(hosts: list[str], origins: list[str]) -> bool:
        """Return true for a request to this machine by its name, from the page itself or from no page."""
        if len(hosts) != 1 or len(origins) > 1:
            return False
        try:
            named = urlsplit(f"//{hosts[0]}").hostname in HOSTS
        except ValueError:
            return False
        return named and all(origin == f"http://{hosts[0]}" for origin in origins)


class ViserPage:
    """Server of a page of viser; a `ViserPanel` is its content.

    Attributes:
        server: Viser's server, of this machine alone.
        url: Link to the page, with a secret: who does not have it is refused, see `PageGuard`.
        keys: Keys of its present panel.
    """

    def __init__(self, port: int, title: str) -> None:
        """Start serving; `ViewError` without viser."""
        try:
            import viser  # noqa: PLC0415 - an extra
        except ImportError as missing:
            raise ViewError(
                f"this page needs viser ({missing}): in a clone, pip install -e '.[workbench]'"
            ) from missing
        guard = PageGuard()
        with contextlib.redirect_stdout(io.StringIO()), guard.guards():
            self.server: Any = viser.ViserServer(LOCAL, port, title, verbose=False)
        if not guard.stands:
            self.close()
            raise ViewError(
                f"the page cannot be protected from other programs with viser {viser.__version__}: install viser 1.1"
            )
        self.server.gui.configure_theme(show_share_button=False, show_logo=False)
        self.url = f"http://{LOCAL}:{self.server.get_port()}/{guard.secret}/"
        self.keys: list[Any] = []

    @property
    def open_pages(self) -> int:
        """Number of open browser pages."""
        return len(self.server.get_clients())

    def close(self) -> None:
        """Stop serving."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()


class ViserScene(DrawnScene):
    """Scene of a page: below one root a frame for each body, with its meshes, and the marks."""

    def __init__(self, stage: Stage, nodes: Any) -> None:
        super().__init__(stage)
        nodes.reset()
        self._nodes, self._follows, self._target = nodes, True, np.zeros(3)
        self._root = nodes.add_frame(ROOT, show_axes=False)
        nodes.add_grid(f"{ROOT}/grid", 40.0, 40.0, position=(0.0, 0.0, stage.floor))
        self._frames = {body: nodes.add_frame(f"{ROOT}/body {body}", show_axes=False) for body in self.moving}
        self._drawn: dict[int, Any] = {}  # meshes by their number
        self._beside: dict[str, Any] = {}  # marks

    def draw(self, picture: Picture) -> None:
        """See `DrawnScene`."""
        super().draw(picture)
        self._target = picture.target
        self.follow(self._follows)

    def follow(self, on: bool) -> None:
        """Move the world so that the robot stays where it is in the picture, or leave it where it is."""
        self._follows = on
        x, y = self._target[:2] if on else (0.0, 0.0)
        self._root.position = (-x, -y, 0.0)

    def _move(self, body: int) -> None:
        frame, data = self._frames[body], self.stage.data
        frame.position, frame.wxyz = data.xpos[body], data.xquat[body]

    def _paint(self, number: int, colour: Colour) -> None:
        body, _, (vertices, faces) = self.meshes[number]
        look = paint(colour)
        if (drawn := self._drawn.get(number)) is not None:
            drawn.color, drawn.opacity = look.values()
        else:
            self._drawn[number] = self._nodes.add_mesh_simple(
                f"{ROOT}/body {body}/{number}", vertices, faces, **look, cast_shadow=body > 0
            )

    def _show(self, mark: Mark) -> None:
        (vertices, faces), node, look = mark_mesh(mark), self._beside.get(mark.name), paint(mark.colour)
        if node is not None and node.vertices.shape == vertices.shape:
            node.vertices = vertices.astype(np.float32)
            node.color, node.opacity = look.values()
        else:
            look |= {"side": "double", "cast_shadow": False}
            name = f"{ROOT}/marks/{mark.name}"
            self._beside[mark.name] = self._nodes.add_mesh_simple(name, vertices, faces, **look)

    def _erase(self, mark: Mark) -> None:
        self._beside.pop(mark.name).remove()


class ViserPanel:
    """Content of a page: the scene of a stage, and a panel with time and text, camera and legend.

    Attributes:
        scene: The scene.
        gui: Viser's panel.
    """

    def __init__(self, page: ViserPage, stage: Stage) -> None:
        self._page, self.gui, camera = page, page.server.gui, page.server.initial_camera
        while page.keys:
            page.keys.pop().remove()
        self.gui.reset()
        self.scene = ViserScene(stage, page.server.scene)
        camera.position, camera.look_at = stage.scale.height * EYE, stage.scale.height * LOOK_AT
        self._texts: list[tuple[Any, Callable[[], str]]] = []
        self._said, self._spoken = "", -math.inf  # text of the last picture; clock of the last texts
        self.text(lambda: self._said)
        self.checkbox("camera follows", True, self.scene.follow)
        with self.gui.add_folder("meaning of the colours", expand_by_default=False):
            dot = '<span style="color: {}">⬤</span> {}'
            meanings = self.scene.meanings
            self.text(lambda: paragraph(dot.format(css(c), escape(text)) for text, c in meanings.items()))

    def draw(self, picture: Picture) -> None:
        """Show a picture; the texts follow by `speak`."""
        with self._page.server.atomic():
            self.scene.draw(picture)
        self._said = text_html(*picture.lines)

    def text(self, text: Callable[[], str]) -> None:
        """Add a text that follows the run, as HTML: see `text_html`."""
        self._texts.append((self.gui.add_html(""), text))

    def checkbox(self, label: str, value: bool, call: Callable[[bool], object]) -> None:
        """Add a checkbox."""
        box = self.gui.add_checkbox(label, value)
        when(box.on_update, lambda _: call(bool(box.value)))

    def key(self, key: str, label: str, call: Callable[[], object]) -> None:
        """Add a key of the page, with a label for viser's list of commands."""
        self._page.keys.append(self.gui.add_command(label, hotkey=key))
        when(self._page.keys[-1].on_trigger, lambda _: call())

    def speak(self, *, now: bool = False) -> bool:
        """Bring the texts up to date if they are older than `TEXT_PERIOD`, or now; True if they were."""
        if not now and clock.perf_counter() < self._spoken + TEXT_PERIOD:
            return False
        self._spoken = clock.perf_counter()
        for place, text in self._texts:
            if place.content != (new := text()):
                place.content = new
        return True


def when(event: Callable[[Any], object], call: Callable[[Any], object]) -> None:
    """Call a function at an event of the page, one after the other in the order of the events."""

    async def take(given: Any) -> None:
        call(given)

    event(take)


def text_html(head: str, *lines: str) -> str:
    """Return lines of text as HTML, the first one bold; what is HTML or a script in them is shown as it is written.

    Texts of logs, programs and tasks come from anywhere. Markdown would not do: the page runs what is HTML in it.
    """
    return paragraph([f"<b>{escape(head)}</b>", *map(escape, lines)] if head or lines else [])


def paragraph(lines: Iterable[str]) -> str:
    """Return lines of HTML as a paragraph of the panel."""
    return f"<div style='padding: 0 1em; font-size: 0.85em'>{'<br>'.join(lines)}</div>"


def paint(colour: Colour) -> dict[str, Any]:
    """Return colour and opacity of a mesh as viser has them."""
    red, green, blue = (round(255 * part) for part in colour[:3])
    return {"color": (red, green, blue), "opacity": colour[3] if colour[3] < 1.0 else None}
