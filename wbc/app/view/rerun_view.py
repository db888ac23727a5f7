"""Bodies and marks in a stream of Rerun, and the live view that shows them in Rerun's page, with the time behind."""

from __future__ import annotations

import os
import socket
import subprocess
import tempfile
import time as clock
import weakref
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from wbc.app.view.base import LOCAL, View, ViewError, free_port
from wbc.app.view.marks import Mark, Picture, changes, mark_mesh, repainted
from wbc.app.view.meshes import Mesh, body_meshes, normals
from wbc.app.view.stage import Stage
from wbc.robots.mechanism import Colour

START_TIME = 20.0
"""Longest time that Rerun may take to start, s."""

OPENED, CLOSED = b"connection accepted", b"connection closed"
"""Lines of Rerun's server about connections: the first one is that of the stream."""


class RerunScene:
    """Bodies of a stage under transforms, and its marks, in a stream of Rerun. Names hold no spaces."""

    def __init__(self, stream: Any, stage: Stage) -> None:
        """Write the shapes."""
        import rerun  # noqa: PLC0415 - an extra

        self._rerun: Any = rerun
        self._stream, self._data = stream, stage.data
        self._shown: dict[str, Mark] = {}
        self._names = {0: "ground"}
        self._meshes, self._colours = body_meshes(stage.model), dict[int, Colour]()
        stream.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for number, (body, _, mesh) in enumerate(self._meshes):
            place = f"robot/{plain(stage.model.body(body).name or str(body))}"
            stream.log(f"{self._names.setdefault(body, place)}/{number}", self._mesh(mesh), static=True)

    def draw(self, picture: Picture) -> None:
        """Write places of bodies, and the colours and marks that have changed."""
        self._stream.set_time("time", duration=picture.time)
        for body, name in self._names.items():
            if body > 0:
                turn, place = np.roll(self._data.xquat[body], -1), self._data.xpos[body]  # to xyzw
                self._stream.log(name, self._rerun.Transform3D(quaternion=turn, translation=place))
        for number, colour in repainted(self._colours, self._meshes, picture.colours):
            painted = self._rerun.Mesh3D.from_fields(albedo_factor=tint(colour))
            self._stream.log(f"{self._names[self._meshes[number].body]}/{number}", painted)
        for name, mark in changes(self._shown, picture.marks):
            gone = self._rerun.Clear(recursive=False)
            drawn = gone if mark is None else self._mesh(mark_mesh(mark), albedo_factor=tint(mark.colour))
            self._stream.log(f"marks/{plain(name)}", drawn)

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

    def _open(self, port: int) -> None:
        try:
            import rerun  # noqa: PLC0415 - an extra
            import rerun_cli  # type: ignore[import-untyped]  # noqa: PLC0415
        except ImportError as missing:
            raise ViewError(
                f'this view needs rerun ({missing}): pip install -e ".[rerun]" in the clone'
            ) from missing
        data, self._stream = free_port(0), rerun.RecordingStream("wbc")
        options = {"--bind": LOCAL, "--port": data, "--web-viewer-port": port, "--server-memory-limit": "1GB"}
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the server
        self._server = subprocess.Popen(
            [
                Path(rerun_cli.__file__).parent / "rerun",
                "--serve-web",
                *(str(w) for o in options.items() for w in o),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._said,
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
        source = f"rerun+http://{LOCAL}:{data}/proxy"
        self._stream.connect_grpc(source)
        self.url = f"http://{LOCAL}:{port}/?url={quote(source, safe='')}"

    def _build(self) -> None:
        from rerun import blueprint  # noqa: PLC0415

        self._scene, height = RerunScene(self._stream, self.run.stage), self.run.stage.scale.height
        eye = blueprint.EyeControls3D(
            position=(2.6 * height, -2.0 * height, 1.7 * height), look_target=(0.0, 0.0, 0.8 * height)
        )
        views = (
            blueprint.Spatial3DView(contents=["robot/**", "ground/**", "marks/**"], eye_controls=eye),
            blueprint.TextDocumentView(origin="state"),
        )
        time = blueprint.TimePanel(timeline="time", play_state="following", state="collapsed")
        layout = blueprint.Horizontal(*views, column_shares=(4, 1))
        self._stream.send_blueprint(blueprint.Blueprint(layout, time, collapse_panels=True))

    def _send(self, picture: Picture) -> None:
        import rerun  # noqa: PLC0415

        self._scene.draw(picture)
        self._stream.log("state", rerun.TextDocument("\n\n".join([f"{picture.time:.2f} s", *picture.text])))

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        if self.closed:
            return 0
        self._said.seek(0)
        said = self._said.read()
        return max(0, said.count(OPENED) - said.count(CLOSED) - 1)

    def _end(self) -> None:
        self._stream.disconnect()
        self._finalizer()
        self._said.close()


def _end_server(server: subprocess.Popen[bytes]) -> None:
    server.terminate()
    server.wait()


def _answers(port: int) -> bool:
    try:
        with socket.create_connection((LOCAL, port), timeout=0.2):
            return True
    except OSError:
        return False
