"""Bodies and marks in a stream of Rerun, and the live view that shows them in Rerun's page, with the time behind."""

from __future__ import annotations

import math
import os
import socket
import subprocess
import tempfile
import time as clock
import weakref
from pathlib import Path
from typing import Any, cast
from urllib.parse import quote

import numpy as np

from wbc.app.view.base import LOCAL, View, ViewError, free_port
from wbc.app.view.marks import Mark, Picture, mark_mesh
from wbc.app.view.meshes import Mesh, normals
from wbc.app.view.stage import EYE, LOOK_AT, DrawnScene, Stage
from wbc.robots.mechanism import Colour

START_TIME = 20.0
"""Longest time that Rerun may take to start, s."""

OPENED, CLOSED = b"connection accepted", b"connection closed"
"""Lines of Rerun's server about connections: the first one is that of the stream."""


class RerunScene(DrawnScene):
    """Scene in a stream of Rerun: shapes under the transforms of their bodies, and marks. Names hold no spaces."""

    def __init__(self, stage: Stage, stream: Any) -> None:
        import rerun  # noqa: PLC0415 - an extra

        super().__init__(stage)
        self._stream, self._rerun = stream, cast("Any", rerun)
        bodies = {body: plain(stage.model.body(body).name or str(body)) for body in self.moving}
        self._names = {0: "ground"} | {body: f"robot/{name}" for body, name in bodies.items()}
        stream.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for number, (body, _, mesh) in enumerate(self.meshes):
            stream.log(f"{self._names[body]}/{number}", self._mesh(mesh), static=True)

    def draw(self, picture: Picture) -> None:
        """See `DrawnScene`; all of it gets the time of the picture."""
        self._stream.set_time("time", duration=picture.time)
        super().draw(picture)

    def _move(self, body: int) -> None:
        data = self.stage.data
        turn, place = np.roll(data.xquat[body], -1), data.xpos[body]  # to xyzw
        self._stream.log(self._names[body], self._rerun.Transform3D(quaternion=turn, translation=place))

    def _paint(self, number: int, colour: Colour) -> None:
        painted = self._rerun.Mesh3D.from_fields(albedo_factor=tint(colour))
        self._stream.log(f"{self._names[self.meshes[number].body]}/{number}", painted)

    def _show(self, mark: Mark) -> None:
        self._stream.log(
            f"marks/{plain(mark.name)}", self._mesh(mark_mesh(mark), albedo_factor=tint(mark.colour))
        )

    def _erase(self, mark: Mark) -> None:
        self._stream.log(f"marks/{plain(mark.name)}", self._rerun.Clear(recursive=False))

    def _mesh(self, mesh: Mesh, **how: Any) -> Any:
        vertices, faces = mesh
        return self._rerun.Mesh3D(
            vertex_positions=vertices, triangle_indices=faces, vertex_normals=normals(mesh), **how
        )


def tint(colour: Colour) -> tuple[int, ...]:
    """Return a colour as Rerun has it."""
    return tuple(round(255 * part) for part in colour)


def plain(name: str) -> str:
    """Return a name without spaces."""
    return "_".join(name.split())


class RerunView(View):
    """Page of Rerun, in which the run can be looked at again; `View` lists its contents.

    Rerun's server is a process that ends with the view. The page keeps what it has got.
    """

    _stream: Any = None  # of the present run

    def _open(self, port: int) -> None:
        try:
            import rerun_cli  # type: ignore[import-untyped]  # noqa: PLC0415 - an extra
        except ImportError as missing:
            raise ViewError(
                f'this view needs rerun ({missing}): pip install -e ".[rerun]" in the clone'
            ) from missing
        data = free_port(0)
        options = {"--bind": LOCAL, "--port": data, "--web-viewer-port": port, "--server-memory-limit": "1GB"}
        words = [str(word) for option in options.items() for word in option]
        self._told = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the server
        self._server = subprocess.Popen(
            [Path(rerun_cli.__file__).parent / "rerun", "--serve-web", *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._told,
            # Rerun sends nothing about its use from a machine that runs tests.
            env=os.environ | {"CI": "true", "RUST_LOG": "error,tonic::transport::server=trace"},
        )
        self._finalizer = weakref.finalize(self, _end_server, self._server)
        end = clock.monotonic() + START_TIME
        while not _answers(port):
            if self._server.poll() is not None or clock.monotonic() > end:
                self._end()
                raise ViewError(f"Rerun's server has not started at port {port}")
            clock.sleep(0.05)
        self._source = f"rerun+http://{LOCAL}:{data}/proxy"
        self.url = f"http://{LOCAL}:{port}/?url={quote(self._source, safe='')}"

    def _build(self) -> None:
        import rerun  # noqa: PLC0415
        from rerun import blueprint  # noqa: PLC0415

        if self._stream is not None:
            self._stream.disconnect()
        self._time = -math.inf  # of the last picture, s
        self._stream = rerun.RecordingStream("wbc")  # each run has a recording, the page shows the last one
        self._stream.connect_grpc(self._source)
        self._scene, height = RerunScene(self.run.stage, self._stream), self.run.stage.scale.height
        eye = blueprint.EyeControls3D(position=height * EYE, look_target=height * LOOK_AT)
        views = (
            blueprint.Spatial3DView(contents=["robot/**", "ground/**", "marks/**"], eye_controls=eye),
            blueprint.TextDocumentView(origin="state"),
        )
        time = blueprint.TimePanel(timeline="time", play_state="following", state="collapsed")
        layout = blueprint.Horizontal(*views, column_shares=(4, 1))
        self._stream.send_blueprint(blueprint.Blueprint(layout, time, collapse_panels=True))

    def _send(self, picture: Picture) -> None:
        import rerun  # noqa: PLC0415

        if picture.time < self._time:  # as after a reset: what came later would still be there
            self._build()
        self._time = picture.time
        self._scene.draw(picture)
        self._stream.log("state", rerun.TextDocument("\n\n".join(picture.lines)))

    def _count(self) -> int:
        self._told.seek(0)
        told = self._told.read()
        return max(0, told.count(OPENED) - told.count(CLOSED) - 1)

    def _end(self) -> None:
        if self._stream is not None:
            self._stream.disconnect()
        self._finalizer()
        self._told.close()


def _end_server(server: subprocess.Popen[bytes]) -> None:
    server.terminate()
    server.wait()


def _answers(port: int) -> bool:
    try:
        with socket.create_connection((LOCAL, port), timeout=0.2):
            return True
    except OSError:
        return False
