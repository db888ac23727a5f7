"""The picture of a tick: the order of its steps, read from the code; `python docs/pictures/figures.py` draws it."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from html import escape
from typing import Any

from wbc.core.drive.control import DriveControl
from wbc.core.drive.sensing import Sensing
from wbc.core.qp.solving.solver import QpSolver
from wbc.walking.control import WalkingControl

ESTIMATE: Mapping[str, str] = {
    "plausibility.check": "readings checked",
    "accelerometer.check": "IMU checked",
    "observer.update": "base, joints, feet",
    "_estimator().observe": "forces on the feet",
    "monitor.update": "sensors compared",
}
"""Call in a tick's estimate → what the picture says of it."""

TARGETS: Mapping[str, str] = {
    "ground.update": "known ground",
    "balance.correct": "DCM less its bias",
    "source.update": "steps and references",
    "balance.update": "stabilizer",
    "arms.update": "arms",
    "tasks.follow": "tasks and contacts",
}
"""Call between estimate and QP of a walk → what the picture says of it."""

FIRST: Mapping[str, str] = {"_fast.solve": "active set,", "_by_daqp": "else DAQP,"}
RESCUE: Mapping[str, str] = {"_by_daqp_alone": "else DAQP anew"}
"""Call of the solver, and of its rescue → what the picture says of it."""

ACT: Mapping[str, str] = {
    "_damp": "fallen: damps",
    "_hold": "no solution: holds",
    "_follow": "references, torques",
    "_finish": "released joints: zero",
}
"""Call at the end of a tick → what the picture says of it."""

SOLES: Mapping[str, str] = {"_with_stiffness": "stiffness of soles"}
"""Call of a walk behind the end of a tick → what the picture says of it."""

VALUES = ("Measurement", "State", "attributes", "Solution", "Command")
"""Values that go from each box to the next, and from the last one to the first."""

WIDTH, HEIGHT, TOP, BOX = 960, 300, 40, 170
"""Sizes of the picture, and top and height of a box, pixels."""


def calls(function: Callable[..., Any]) -> list[str]:
    """Return what a method calls, in the order of its text, such as "observer.update" for `self.observer.update(…)`."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    found = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    names = [
        ast.unparse(node.func) for node in sorted(found, key=lambda node: (node.lineno, node.col_offset))
    ]
    return [name.removeprefix("self.") for name in names]


def order(function: Callable[..., Any], labels: Mapping[str, str]) -> list[str]:
    """Return the labels of what a method calls, in its order; `ValueError` for a label that it does not call."""
    made = calls(function)
    return [labels[name] for name in sorted(labels, key=made.index) if labels[name]]


def boxes() -> list[tuple[str, str, list[str]]]:
    """Return title, class and lines of each box, from left to right."""
    ladder = order(QpSolver.solve, FIRST) + order(QpSolver._rescue, RESCUE)
    act = order(DriveControl.act, ACT)
    return [
        ("plant, or robot", "", ["drives", "soles and ground", "sensors", "with errors"]),
        ("estimate", "", order(Sensing.update, ESTIMATE)),
        ("targets", "dashed", order(WalkingControl._follow, TARGETS)),
        ("controller", "blue", ["tasks, contacts, limits", "= one QP, solved by", *ladder]),
        ("command", "", [*act, *order(WalkingControl.act, SOLES)]),
    ]


def tick_svg() -> str:
    """Return the picture."""
    found = boxes()
    gap = 54
    wide = (WIDTH - 32 - gap * (len(found) - 1)) / len(found)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="system-ui, sans-serif" '
        'font-size="12" text-anchor="middle" role="img" aria-label="One tick, in its order: '
        + escape("; ".join(f"{title}: {', '.join(texts)}" for title, _, texts in found))
        + '">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#ffffff"/>',
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" '
        'orient="auto"><path d="M0 0L10 5L0 10z" fill="#37474f"/></marker></defs>',
    ]
    middles = []
    for k, (title, kind, texts) in enumerate(found):
        x = 16 + k * (wide + gap)
        middles.append(x + 0.5 * wide)
        fill, stroke = ("#e3f2fd", "#1565c0") if kind == "blue" else ("#f3f6f8", "#607d8b")
        dashes = ' stroke-dasharray="5 4"' if kind == "dashed" else ""
        place = f'x="{x:.0f}" y="{TOP}" width="{wide:.0f}" height="{BOX}"'
        lines.append(f'<rect {place} rx="6" fill="{fill}" stroke="{stroke}"{dashes}/>')
        middle = f'x="{middles[-1]:.0f}"'
        lines.append(
            f'<text {middle} y="{TOP + 24}" font-weight="600" font-size="13" fill="#102027">{title}</text>'
        )
        for n, text in enumerate(texts):
            lines.append(f'<text {middle} y="{TOP + 50 + 18 * n}" fill="#37474f">{escape(text)}</text>')
        if k:
            start, end = x - gap, x - 2
            lines.append(_arrow(f"M{start:.0f} {TOP + 85}H{end:.0f}"))
            lines.append(_value(VALUES[k - 1], x - 0.5 * gap, 28))
    low = TOP + BOX
    lines.append(_arrow(f"M{middles[-1]:.0f} {low}V{low + 46}H{middles[0]:.0f}V{low + 2}"))
    lines.append(_value(VALUES[-1], 0.5 * WIDTH, low + 38))
    note = "Dashed: what a walk does here. A program of yours sets targets in its place; a stand needs none."
    lines.append(f'<text x="{WIDTH / 2:.0f}" y="{low + 74}" fill="#546e7a">{note}</text>')
    return "\n".join([*lines, "</svg>\n"])


def _arrow(path: str) -> str:
    return f'<path d="{path}" stroke="#37474f" stroke-width="1.6" fill="none" marker-end="url(#tip)"/>'


def _value(name: str, x: float, y: float) -> str:
    return f'<text x="{x:.0f}" y="{y}" font-family="ui-monospace, monospace" fill="#102027">{name}</text>'
