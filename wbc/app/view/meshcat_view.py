"""Live view by MeshCat, which comes with every installation.

`update` hands a snapshot over to the thread that serves the page, so that a run waits for nothing but its own pace.
"""

from __future__ import annotations

import secrets
import weakref
from typing import TYPE_CHECKING

from wbc.app.address import Address, ViewError
from wbc.app.scene.layer import Annotations
from wbc.app.view.base import View
from wbc.app.view.guard import PageServer
from wbc.app.view.server import Broadcast, page_routes
from wbc.core.errors import Array
from wbc.robots import RobotDescription
from wbc.sim.plant.plant import Plant
from wbc.sim.terrain.spec import Terrain

if TYPE_CHECKING:
    from wbc.sim import MujocoLoop
    from wbc.tasks.behaviours import Program
    from wbc.walking.control import ReferenceControl

TOKEN_BYTES = 16
"""Length of the random token in the link, bytes."""


class MeshcatView(View):
    """A page in the browser that shows a robot as it moves; see `View` for what it shows.

    Unless `controls` are off, the page can stop a walk and drive a robot that is steered. `Workbench` changes the rest.

    The view ends when it is closed or when the program ends; the page then keeps its last picture, and a later view on
    the same port continues in the same page.
    """

    def __init__(
        self,
        source: Plant | MujocoLoop | RobotDescription,
        *,
        walking: ReferenceControl | None = None,
        program: Program | None = None,
        terrain: Terrain | None = None,
        host: str = "127.0.0.1",
        port: int | None = None,
        rate: float = 30.0,
        speed: float | None = None,
        controls: bool = True,
        notebook: bool = False,
    ) -> None:
        """Start serving the page; its address goes to the standard error.

        Args:
            source: A plant; another loop, of which the robot is shown; or the description of a robot whose states are
                given to `update`.
            walking: Controller of a walk, to show its footsteps and references; only with a plant.
            program: Program whose state is shown, with the walk that it drives.
            terrain: The ground under a described robot; flat when None. A plant has its own.
            host: Address to listen at. The default is reached from this machine alone; on a remote one use it with
                `ssh -L` from the same port, or "0.0.0.0" to let everybody in the network watch. The controls need the
                link that is printed.
            port: Port to listen at; the first free one from 7000 on when None, any free one when 0.
            rate: Largest rate of pictures, 1/s.
            speed: Hold the run back to this multiple of real time, 1 for real time; None never waits. The page can
                change it.
            controls: Let the page change the run; pause and speed are always available.
            notebook: Let pages of this machine, such as a notebook, show the page in a frame.

        Raises:
            InputError: A value out of range, no host, a terrain given with a plant, or a walk without one.
            PortError: The port is in use.
        """
        address = Address(host, port)
        super().__init__(
            source,
            walking,
            program=program,
            terrain=terrain,
            rate=rate,
            speed=speed,
            controls=controls,
            notebook=notebook,
        )
        token = secrets.token_urlsafe(TOKEN_BYTES)
        self._broadcast = Broadcast(
            self.scene, self._pace, self.controls.order, self.controls.available(), token
        )
        self._server = PageServer("live view", address)
        self._server.start(page_routes(self._broadcast), framed=notebook, last=self._broadcast.end)
        self._finalizer = weakref.finalize(self, self._server.close)
        self._url = f"{self._server.served.url}?token={token}"
        self._begin()

    @property
    def url(self) -> str:
        """Link to the page, with the token that its controls need; without the token, a page only shows the run."""
        return self._url

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        return 0 if self.closed else self._broadcast.pages

    @property
    def drivers(self) -> int:
        """Number of open pages that may change the run."""
        return 0 if self.closed else self._broadcast.drivers

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return not self._finalizer.alive

    def _send(self, time: float, matrices: Array, annotations: Annotations) -> None:
        self._broadcast.put(time, matrices, annotations)
        self._server.soon(self._broadcast.take_frame)

    def _end(self) -> None:
        self._finalizer()

    def html(self) -> str:
        """Return the present picture as a self-contained page that opens without network.

        Raises:
            ViewError: The view has ended.
        """
        if self.closed:
            raise ViewError("the live view has ended")
        return self._server.ask(self._broadcast.static)
