"""Live view by MeshCat, which comes with every installation.

`update` hands a snapshot over to the thread that serves the page, so that a run waits for nothing but its own pace.
"""

from __future__ import annotations

import secrets
import weakref

from wbc.app.address import Address
from wbc.app.scene.layer import Annotations
from wbc.app.view.base import View
from wbc.app.view.guard import PageServer
from wbc.app.view.server import Broadcast, page_routes
from wbc.core.errors import Array

TOKEN_BYTES = 16
"""Length of the random token in the link, bytes."""


class MeshcatView(View):
    """A page in the browser that shows a robot as it moves; see `View` for what it shows.

    The page can stop a walk and drive a robot that is steered. `Workbench` changes the rest.

    The view ends when it is closed or when the program ends; the page then keeps its last picture, and a later view on
    the same port continues in the same page.
    """

    RATE = 30.0

    def _open(self, address: Address) -> None:
        token = secrets.token_urlsafe(TOKEN_BYTES)
        self._broadcast = Broadcast(
            self.scene, self._pace, self.controls.order, self.controls.available(), token
        )
        self._server = PageServer("live view", address)
        self._server.start(page_routes(self._broadcast), framed=self._framed, last=self._broadcast.end)
        self._finalizer = weakref.finalize(self, self._server.close)
        self.url = f"{self._server.served.url}?token={token}"

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        return 0 if self.closed else self._broadcast.pages

    @property
    def drivers(self) -> int:
        """Number of open pages that may change the run."""
        return 0 if self.closed else self._broadcast.drivers

    def _send(self, time: float, matrices: Array, annotations: Annotations) -> None:
        self._broadcast.put(time, matrices, annotations)
        self._server.soon(self._broadcast.take_frame)

    def _end(self) -> None:
        self._finalizer()
