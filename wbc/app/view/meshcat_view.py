"""Live view by MeshCat, which comes with every installation: drawing happens in a process of its own.

`update` hands a snapshot over, so that a run waits for nothing but its own pace.
"""

from __future__ import annotations

import secrets
from typing import TYPE_CHECKING

from wbc.app.address import Address
from wbc.app.scene.layer import Annotations
from wbc.app.view.base import View
from wbc.app.view.process import DrawingProcess, ServerSetup
from wbc.app.view.user_input import RunInput
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
            PortError: The port is in use; nothing is left running.
            ViewError: The process does not start; nothing is left running.
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
        self._process = DrawingProcess(
            ServerSetup(self.scene, address, speed, self.controls.available(), token, notebook)
        )
        self._input: RunInput | None = None  # the last one that was carried out
        self._request_number = 0
        self._begin()

    @property
    def url(self) -> str:
        """Link to the page, with the token that its controls need; without the token, a page only shows the run."""
        return self._process.url

    @property
    def pid(self) -> int:
        """Identifier of the drawing process."""
        return self._process.pid

    @property
    def pages(self) -> int:
        """Number of open browser pages; 0 when the drawing process has ended."""
        said = self._process.input
        return said.pages if said is not None and self._process.running else 0

    @property
    def drivers(self) -> int:
        """Number of open pages that may change the run."""
        said = self._process.input
        return said.drivers if said is not None and self._process.running else 0

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._process.closed

    @property
    def running(self) -> bool:
        """True as long as the page is served."""
        return self._process.running

    @property
    def frames(self) -> int:
        """Number of pictures so far."""
        return self._process.frames

    def _send(self, time: float, matrices: Array, annotations: Annotations) -> None:
        self._process.draw(time, matrices, annotations)

    def _read_input(self) -> None:
        data = self._process.input
        if data is None or data is self._input:
            return
        self._input = data
        self._paused = data.paused
        if data.speed != self._pace.speed:
            self._pace.speed = data.speed
        for number, request in data.orders:
            if number > self._request_number:
                self._request_number = number
                self.controls.order(request)

    def html(self) -> str:
        """Return the present picture as a self-contained page that opens without network.

        Raises:
            ViewError: The view has ended.
        """
        return self._process.html()

    def _end(self) -> None:
        self._process.close()
