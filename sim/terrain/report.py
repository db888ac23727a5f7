"""What the command line asks of terrains: describe and draw one, list all."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from wbc.core.errors import InputError, unknown_name
from wbc.feet.stiffness.roughness import PARAMETERS, UNITS
from wbc.sim.terrain.checks import SOLE_SPHERE_RADIUS, check_clearance
from wbc.sim.terrain.drawing import checked_path, contact_sheet, draw_terrain, example
from wbc.sim.terrain.families.base import Family, terrain_families
from wbc.sim.terrain.spec import Rendering, Terrain, jsonable, terrain
from wbc.walking.planning.gait import Gait


@dataclass(frozen=True)
class TerrainOptions:
    """Which terrain, and what to do with it.

    Args:
        name: Family, one of those `wbc terrains` lists.
        amplitude: Highest minus lowest point of the rough part, m; the family's own when not given.
        seed: Fixes every random draw.
        param: Parameters of the family, each as name=value.
        length: Length of the rough part, m; 3 m when not given.
        width: Extent across, m; 1 m when not given.
        start: x at which the rough part begins, m; 0.3 m when not given.
        strip: Length of the flat strips, m; 1 m when not given.
        rendering: Solids, height field, or auto: solids wherever the family is made of them.
        resolution: Greatest cell of a height field, m; fine enough for family and sole when not given.
        sole_radius: Radius of the spheres under the sole, m.
        clearance: How high the swing foot is lifted, m; a warning says if that is too low.
        plot: Picture of the map and a profile to write.
        cost: Also measure memory and steps per second.
    """

    name: str
    amplitude: float | None = None
    seed: int = 0
    param: tuple[str, ...] = ()
    length: float | None = None
    width: float | None = None
    start: float | None = None
    strip: float | None = None
    rendering: Rendering = "auto"
    resolution: float | None = None
    sole_radius: float = SOLE_SPHERE_RADIUS
    clearance: float = Gait.swing_height
    plot: Path | None = None
    cost: bool = False

    def build(self) -> Terrain:
        """Make the terrain.

        Raises:
            UnknownNameError: No such family or parameter.
            InputError: A value is out of range or cannot be read.
        """
        return terrain(
            self.name,
            self.amplitude,
            self.seed,
            length=self.length,
            width=self.width,
            start=self.start,
            strip=self.strip,
            rendering=self.rendering,
            resolution=self.resolution,
            sole_radius=self.sole_radius,
            **read_params(self.name, self.param),
        )


def describe_terrain(options: TerrainOptions) -> dict[str, Any]:
    """Describe a terrain, and draw or measure it if asked to; everything is checked first.

    Returns:
        JSON-able: `Terrain.describe()`, the roughness parameters along y = 0 (`Terrain.roughness`), `clears` (true if
        the swing foot passes over the ground), and as asked for `plot` and `cost`.

    Raises:
        UnknownNameError: No such family or parameter.
        InputError: A value is out of range, or the picture cannot be written.

    Warns:
        ClearanceWarning: What has to be stepped over is higher than the clearance.
    """
    ground = options.build()
    target = None if options.plot is None else checked_path(options.plot)
    clears = check_clearance(ground, options.clearance)
    report = ground.describe() | {"roughness": named_roughness(ground), "clears": clears}
    if target is not None:
        draw_terrain(ground, target)
        report["plot"] = str(target)
    if options.cost:
        from wbc.sim.terrain.cost import terrain_cost  # noqa: PLC0415 - needs MuJoCo

        report["cost"] = terrain_cost(ground)
    return report


@dataclass(frozen=True)
class TerrainListOptions:
    """What to say of all terrains.

    Args:
        plot: Sheet of thumbnails to write.
        cost: Also measure memory and steps per second of each; takes about half a minute.
    """

    plot: Path | None = None
    cost: bool = False


def list_terrains(options: TerrainListOptions | None = None) -> list[dict[str, Any]]:
    """List all families; draw and measure them if asked to.

    Returns:
        For each: name, summary, usual amplitude (m), parameters, and as asked for `cost`; JSON-able.

    Raises:
        InputError: The picture cannot be written.
    """
    wanted = options or TerrainListOptions()
    target = None if wanted.plot is None else checked_path(wanted.plot)
    listed = [_family_facts(name, cls) for name, cls in terrain_families().items()]
    if target is not None:
        contact_sheet(target)
    if wanted.cost:
        from wbc.sim.terrain.cost import terrain_cost  # noqa: PLC0415 - needs MuJoCo

        for entry in listed:
            entry["cost"] = terrain_cost(example(entry["name"]))
    return listed


def _family_facts(name: str, cls: type[Family]) -> dict[str, Any]:
    return {
        "name": name,
        "summary": cls.summary(),
        "amplitude_m": cls.default_amplitude,
        "parameters": [
            {
                "name": f.name,
                "default": jsonable(f.default),
                "unit": f.metadata["unit"],
                "about": f.metadata["about"],
                "choices": list(f.metadata["choices"]),
            }
            for f in fields(cls)
        ],
    }


def named_roughness(ground: Terrain) -> dict[str, float]:
    """Roughness parameters of a terrain along y = 0 by name, with their units in the names."""
    values = ground.roughness().values.tolist()
    names = [f"{name}_{unit}" if unit else name for name, unit in zip(PARAMETERS, UNITS, strict=True)]
    return dict(zip(names, values, strict=True))


def read_params(name: str, texts: tuple[str, ...]) -> dict[str, Any]:
    """Turn name=value texts into parameters of a family.

    Raises:
        UnknownNameError: No such family or parameter.
        InputError: Not of the form name=value, given twice, or not of the parameter's type.
    """
    if name not in terrain_families():
        unknown_name("terrain", name, terrain_families())
    known = {f.name: f.default for f in fields(terrain_families()[name])}
    params: dict[str, Any] = {}
    for text in texts:
        key, separator, value = text.partition("=")
        key = key.strip().replace("-", "_")
        if not separator or not key:
            raise InputError(f"a terrain parameter is given as name=value, got '{text}'")
        if key not in known:
            unknown_name(f"parameter of terrain '{name}' called", key, known)
        if key in params:
            raise InputError(f"terrain parameter '{key}' is given twice")
        params[key] = _read(key, value.strip(), known[key])
    return params


def _read(key: str, text: str, default: Any) -> Any:
    """Read a value in the type of its default; without one, a number if it is one."""
    if isinstance(default, bool):
        if text.lower() not in ("true", "false"):
            raise InputError(f"terrain parameter {key} must be true or false, got '{text}'")
        return text.lower() == "true"
    if isinstance(default, str):
        return text
    try:
        return int(text) if isinstance(default, int) else float(text)
    except ValueError:
        if default is None:
            return text
        raise InputError(f"terrain parameter {key} must be a number, got '{text}'") from None
