"""The architecture picture: rooms as boxes on floors, arrows by imports; `python docs/pictures/figures.py` draws it.

Everything is read from the sources: nothing is imported, and the same sources give the same bytes.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from functools import cache
from html import escape
from pathlib import Path

FLOORS = (
    ("wbc.base",),
    ("wbc.core",),
    ("wbc.robots", "wbc.feet", "wbc.ground"),
    ("wbc.tasks",),
    ("wbc.walking",),
    ("wbc.motion",),
    ("wbc.policy",),
    ("wbc.machine",),
    ("wbc.sim",),
    ("wbc.app",),
)
"""Packages, lowest floor first; neighbours on a floor do not import each other."""

BESIDE = ("robots", "feet", "tasks", "sim")
"""Packages whose folder stands beside `wbc/`."""

Graph = Mapping[str, set[str]]
"""Name → the names that it imports."""

WIDTH, GUTTER, GAP = 880, 15, 30
BOX, ROW, ARC = 34, 16, 13
"""Height of a room, room above it for the title, depth of an arc for each room that it passes; pixels."""


def folder(root: Path, package: str) -> Path:
    """Return the folder that holds a package of `FLOORS`."""
    name = package.rpartition(".")[2]
    return root / name if name in BESIDE else root / "wbc" / name


def module_files(root: Path) -> dict[str, Path]:
    """Return the file of every module, `wbc` itself and packages included."""
    files = {"wbc": root / "wbc" / "__init__.py", "wbc._version": root / "wbc" / "_version.py"}
    for package in (package for floor in FLOORS for package in floor):
        top = folder(root, package)
        for file in sorted(top.rglob("*.py")):
            parts = file.relative_to(top).with_suffix("").parts
            parts = parts[:-1] if parts[-1] == "__init__" else parts
            files[".".join((package, *parts))] = file
    return files


@cache
def module_graph(root: Path) -> Graph:
    """Return which module imports which, imports inside functions and for type checkers included."""
    files = module_files(root)
    graph: dict[str, set[str]] = {}
    for module, file in files.items():
        graph[module] = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names: Iterable[str] = ()
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            for name in names:
                target = name
                while target and target not in files:
                    target = target.rpartition(".")[0]
                if target:
                    graph[module].add(target)
    return graph


def room_of(root: Path, module: str) -> str:
    """Return the room of a module: a folder of a package, or the package itself."""
    parts = module.split(".")
    package = ".".join(parts[:2])
    inside = len(parts) > 2 and (folder(root, package) / parts[2]).is_dir()
    return ".".join(parts[:3]) if inside else package


def package_of(name: str) -> str:
    """Return the package of a room or module."""
    return ".".join(name.split(".")[:2])


def grouped(graph: Graph, group: Mapping[str, str]) -> dict[str, set[str]]:
    """Return a graph of groups: arrows within a group are dropped, names without a group are left out."""
    out: dict[str, set[str]] = {name: set() for name in dict.fromkeys(group.values())}
    for name, targets in graph.items():
        if name in group:
            out[group[name]] |= {group[t] for t in targets if t in group} - {group[name]}
    return out


def reachable(graph: Graph, start: str) -> set[str]:
    """Return everything that a name imports, directly or through others."""
    found: set[str] = set()
    todo = [start]
    while todo:
        fresh = graph[todo.pop()] - found
        found |= fresh
        todo += sorted(fresh)
    return found


def reduced(graph: Graph) -> list[tuple[str, str]]:
    """Return the arrows of a graph without those that follow from others."""
    left = {name: set(targets) for name, targets in graph.items()}
    for name in sorted(left):
        for target in sorted(left[name]):
            left[name].remove(target)
            if target not in reachable(left, name):
                left[name].add(target)
    return [(name, target) for name in sorted(left) for target in sorted(left[name])]


def architecture_svg(root: Path) -> str:
    """Draw packages as bands, the highest floor above, their rooms as boxes, and imports as arrows.

    Arrows that follow from others are left out; those between a room and its own package, too.
    """
    modules = module_graph(root)
    rooms = {
        module: room_of(root, module)
        for module in modules
        if module.count(".") > 0 and "_version" not in module
    }
    room_graph = grouped(modules, rooms)
    package_graph = grouped(room_graph, {room: package_of(room) for room in room_graph})
    floor_of = {package: height for height, floor in enumerate(FLOORS) for package in floor}
    arrows = reduced(package_graph)
    lanes = [(a, b) for a, b in arrows if floor_of[a] - floor_of[b] > 1]
    left = GUTTER * (len(lanes) + 1)

    shapes: list[str] = []
    place: dict[str, tuple[float, float, float, float]] = {}
    y = 2.0
    for height in reversed(range(len(FLOORS))):
        packages = FLOORS[height]
        counts = {
            p: max(1, sum(package_of(room) == p and room != p for room in room_graph)) for p in packages
        }
        unit = (WIDTH - left - GAP * (len(packages) - 1)) / sum(counts.values())
        x, deepest = left + 0.0, 0.0
        for package in packages:
            width = unit * counts[package]
            inside = [room for room in room_graph if package_of(room) == package and room != package]
            drawn, depth = _rooms(inside, room_graph, x, y, width)
            place[package] = (x, y, width, ROW * 1.6 + BOX + 12 + depth if inside else ROW * 2)
            shapes += drawn
            deepest = max(deepest, place[package][3])
            x += width + GAP
        for package in packages:
            place[package] = (*place[package][:3], deepest)
        y += deepest + GAP
    bands = [_band(package, *place[package]) for package in place]
    shapes += [_between(place[a], place[b]) for a, b in arrows if (a, b) not in lanes]
    for lane, arrow in enumerate(lanes):
        (start, end), to = (_door(place[name], lane / len(lanes)) for name in arrow), place[arrow[1]]
        way = f"M{left} {start:.0f} H{GUTTER * (lane + 1)}"
        if to[0] == left:
            shapes += [_line(f"{way} V{end:.0f} H{left - 5}", 1.6), _head(left, end, 1, 0)]
        else:  # beside another package: from above
            x = to[0] + 0.3 * to[2]
            shapes += [
                _line(f"{way} V{to[1] - 0.5 * GAP:.0f} H{x:.0f} V{to[1] - 5:.0f}", 1.6),
                _head(x, to[1], 0, 1),
            ]
    frame = _FRAME.format(width=WIDTH + 4, height=round(y - GAP + 2.0))
    return "\n".join([frame, *bands, *shapes, "</svg>", ""])


def _rooms(inside: list[str], graph: Graph, x: float, y: float, width: float) -> tuple[list[str], float]:
    """Draw the rooms of a package, importers to the left; return the height that their arcs need, too."""
    own = {room: graph[room] & set(inside) for room in inside}
    used = set().union(*own.values())
    order = sorted(inside, key=lambda room: (-len(reachable(own, room)), room not in used, room))
    step = width / max(1, len(order))
    top, half = y + 1.6 * ROW, 0.5 * step - min(10.0, 0.08 * step)
    middle = {room: x + (i + 0.5) * step for i, room in enumerate(order)}
    out: list[str] = []
    for room in order:
        out.append(_box(middle[room] - half, top, 2.0 * half, BOX, "#ffffff", "#78909c"))
        name = room.rpartition(".")[2]
        size = min(13, int(2.0 * half / (0.55 * len(name))))  # a letter is 0.55 of its size wide
        out.append(_text(middle[room], top + 0.5 * BOX + 5.0, name, size, "middle"))
    depth = 0.0
    for a, b in reduced(own):
        apart = order.index(b) - order.index(a)
        if apart == 1:
            level, end = top + 0.5 * BOX, middle[b] - half
            out.append(_line(f"M{middle[a] + half:.0f} {level:.0f} H{end - 5:.0f}", 1.3))
            out.append(_head(end, level, 1, 0))
        else:
            low, bend = top + BOX, ARC * abs(apart)
            start, end = (middle[k] + (16 if s == (apart > 0) else -16) for k, s in ((a, True), (b, False)))
            curve = f"M{start:.0f} {low:.0f} C{start:.0f} {low + bend:.0f} {end:.0f} {low + bend:.0f}"
            out.append(_line(f"{curve} {end:.0f} {low + 5:.0f}", 1.3))
            out.append(_head(end, low, 0, -1))
            depth = max(depth, 0.75 * bend)
    return out, depth


def _band(package: str, x: float, y: float, width: float, height: float) -> str:
    return _box(x, y, width, height, "#eceff1", "#b0bec5") + _text(x + 10.0, y + 17.0, package, 14, "start")


def _between(upper: tuple[float, ...], lower: tuple[float, ...]) -> str:
    """Draw an arrow from a package down to one on the next floor."""
    bottom, top = upper[1] + upper[3], lower[1]
    x = 0.5 * (max(upper[0], lower[0]) + min(upper[0] + upper[2], lower[0] + lower[2]))
    return _line(f"M{x:.0f} {bottom:.0f} V{top - 5:.0f}", 2.2) + _head(x, top, 0, 1)


def _door(place: tuple[float, ...], share: float) -> float:
    """Return the height on the left side of a package at which an arrow past other floors leaves or enters it."""
    return place[1] + place[3] * (0.15 + 0.8 * share)


def _box(x: float, y: float, width: float, height: float, fill: str, stroke: str) -> str:
    return (
        f'<rect x="{x + 2:.0f}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}" rx="6" '
        f'fill="{fill}" stroke="{stroke}"/>'
    )


def _text(x: float, y: float, text: str, size: int, anchor: str) -> str:
    return (
        f'<text x="{x + 2:.0f}" y="{y:.0f}" font-size="{size}" text-anchor="{anchor}" '
        f'fill="#263238">{escape(text)}</text>'
    )


def _line(path: str, width: float) -> str:
    return f'<path d="{path}" fill="none" stroke="#546e7a" stroke-width="{width}"/>'


def _head(x: float, y: float, dx: int, dy: int) -> str:
    """Draw the head of an arrow, with its tip at a point and along an axis."""
    back = [(x - 8 * dx + 4 * side * dy, y - 8 * dy + 4 * side * dx) for side in (-1, 1)]
    points = " ".join(f"{a:.0f},{b:.0f}" for a, b in ((x, y), *back))
    return f'<polygon points="{points}" fill="#546e7a"/>'


_FRAME = """<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" \
font-family="sans-serif">
<rect width="{width}" height="{height}" fill="#ffffff"/>"""
