"""Time the ticks of one walk with nobody looking, with the live view, with a log, and with both, in turns of 50 ticks.

All four are ticks of the same walk in the same process, so that a noisy moment hits none of them alone. A page that
follows is played by a process that takes in everything and draws nothing. In turns with the view a picture is taken in
every 7th tick: 30 a second of a walk in real time with a control period of 5 ms.

Usage: python tests/benchmarks/looking_on.py [--json] [--distance M] [--foot NAME]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from wbc.app.log.recorder import Recorder
from wbc.app.view.meshcat_view import MeshcatView
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial

ARMS = ("nobody", "view", "record", "view and record")
TURN, PICTURE = 50, 7
"""Ticks of a turn, and from one picture to the next."""

WARM_UP = 200
"""Ticks that are not counted."""

FOLLOWER = """
import asyncio, sys
from tornado.websocket import websocket_connect
async def follow():
    page = await websocket_connect(sys.argv[1], max_message_size=1 << 28)
    while await page.read_message() is not None:
        pass
asyncio.run(follow())
"""


def measure(spec: WalkSpec) -> dict[str, Any]:
    """Walk once; returns times in microseconds."""
    trial = WalkTrial(spec)
    plant, walking = trial.plant, trial.walking
    ticks: dict[str, list[float]] = {arm: [] for arm in ARMS}
    costs: dict[str, list[float]] = {"picture": [], "no picture": [], "record": []}
    load, count = os.getloadavg()[0], 0
    with (
        tempfile.TemporaryDirectory() as folder,
        MeshcatView(plant, walking=walking, port=0, rate=1e9) as view,
        Recorder(Path(folder) / "walk.arrow", spec=spec) as record,
        subprocess.Popen([sys.executable, "-c", FOLLOWER, view.url.replace("http", "ws") + "stream"]) as page,
    ):
        try:
            if not view.wait(30.0):
                raise SystemExit("no page came to follow the view")
            while not walking.done:
                arm = ARMS[(count // TURN) % len(ARMS)]
                measurement = plant.measure()
                start = time.perf_counter()
                command = walking.command(measurement)
                end = time.perf_counter()
                counted = count >= WARM_UP
                if counted:
                    ticks[arm].append(end - start)
                if "record" in arm:
                    start = time.perf_counter()
                    record(plant, walking, measurement, command)
                    costs["record"].append(time.perf_counter() - start)
                if "view" in arm:
                    taken = count % PICTURE == 0
                    view._next = 0.0 if taken else np.inf
                    start = time.perf_counter()
                    view.update(measurement=measurement)
                    costs["picture" if taken else "no picture"].append(time.perf_counter() - start)
                plant.step(command)
                count += 1
        finally:
            page.terminate()
    return {
        "ticks": count,
        "outcome": "fell" if walking.fallen else "completed",
        "load_before": round(load, 2),
        "tick_us": {arm: _summary(values) for arm, values in ticks.items()},
        "median_over_nobody": {
            arm: round(float(np.median(ticks[arm]) / np.median(ticks["nobody"])), 3) for arm in ARMS
        },
        "cost_us": {name: _summary(values) for name, values in costs.items()},
    }


def _summary(values: list[float]) -> dict[str, float]:
    times = 1e6 * np.array(values)
    return {"median": round(float(np.median(times)), 1), "p99": round(float(np.percentile(times, 99)), 1)}


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="one JSON object")
    parser.add_argument("--distance", type=float, default=3.0, help="of the walk, m; default %(default)s")
    parser.add_argument("--foot", default="flat", help="default %(default)s")
    options = parser.parse_args()
    facts = measure(WalkSpec(foot=options.foot, plan=WalkPlan(distance=options.distance)))
    if options.json:
        print(json.dumps(facts))
        return
    print(f"{facts['ticks']} ticks, {facts['outcome']}, load {facts['load_before']} before")
    for arm, times in facts["tick_us"].items():
        ratio = facts["median_over_nobody"][arm]
        print(
            f"  {arm:<16} median {times['median']:7.1f} us, 99 % below {times['p99']:8.1f} us, {ratio:.3f} x"
        )
    for name, times in facts["cost_us"].items():
        print(f"  {name:<16} costs  {times['median']:7.1f} us, 99 % below {times['p99']:8.1f} us")


if __name__ == "__main__":
    main()
