"""Options of commands, exit codes and walks of the command line: which values are taken, and which come first."""

from __future__ import annotations

import json
import math
import typing
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from wbc.app.arguments import Fields, attribute_docs, made_of, prepare
from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.commands import robots as robots_command
from wbc.app.commands.robots import RobotFileOptions
from wbc.app.commands.terrain import TerrainOptions, describe_terrain
from wbc.app.commands.view_log import ViewOptions
from wbc.app.commands.walk import (
    DRIVE_TIME,
    WalkOptions,
    place_of,
    read_spec,
    walk_spec,
)
from wbc.base.errors import InputError
from wbc.sim import WalkSpec
from wbc.sim.walks.presets import STONES, USUAL

Said = pytest.CaptureFixture[str]


@dataclass(frozen=True)
class Inner:
    """Inner settings.

    Attributes:
        size: Its size, m.
        tags: Its tags.
    """

    size: float = 2.0
    tags: tuple[str, ...] = ()


@dataclass(frozen=True)
class Base:
    """Base settings.

    Attributes:
        need: What has no default.
    """

    need: int


@dataclass(frozen=True)
class Outer(Base):
    """Outer settings.

    Attributes:
        inner: Inner ones.
        pair: Two numbers,
            over two lines.
        on: A switch.
        name: A name.
        changes: Names and values.
        several: Inner ones, any number.
        one: One number.
    """

    inner: Inner = field(default_factory=Inner)
    pair: tuple[float, float] = (1.0, 2.5)
    on: bool = False
    name: str | None = None
    changes: tuple[tuple[str, Any], ...] = ()
    several: tuple[Inner, ...] = ()
    one: tuple[int] = (3,)


def test_documentation_of_fields_comes_from_all_classes() -> None:
    found = attribute_docs(Outer)
    assert found["need"] == "What has no default." and found["pair"] == "Two numbers, over two lines."
    assert list(found) == ["need", "inner", "pair", "on", "name", "changes", "several", "one"]


def test_a_whole_spec_is_an_option_for_each_of_its_fields() -> None:
    options = Fields(Outer)
    assert options.options == {
        "need": "need",
        "inner.size": "inner.size",
        "inner.tags": "inner.tags",
        "pair": "pair",
        "on": "on",
        "name": "name",
        "changes": "changes",
        "several": "several",
        "one": "one",
    }
    found = {each.name: each for each in options.parameters()}
    assert found["need"].default is found["need"].empty, "it must be given"
    assert (
        found["inner_size"].default is None and found["inner_tags"].default == () == found["several"].default
    )
    help_of = {name: typing.get_args(each.annotation)[1].help for name, each in found.items()}
    assert help_of["inner_size"] == "Its size, m. [default: 2.0]" and "[default: 1.0, 2.5]" in help_of["pair"]
    assert not any("[default" in help_of[name] for name in ("need", "on", "name", "inner_tags", "changes"))
    kinds = {name: typing.get_args(each.annotation)[0] for name, each in found.items()}
    assert kinds["several"] == kinds["changes"] == kinds["inner_tags"] == tuple[str, ...]
    assert kinds["name"] == str | None and kinds["inner_size"] == float | None
    assert kinds["one"] == tuple[int] | None and kinds["pair"] == tuple[float, float] | None


def test_chosen_fields_have_their_names_defaults_and_help() -> None:
    options = Fields(Outer, "need size-of=inner.size on", defaults={"need": 7}, help={"on": "Switch it on."})
    assert options.options == {"need": "need", "size-of": "inner.size", "on": "on"}
    found = {each.name: each for each in options.parameters()}
    assert found["need"].default is None, "what is chosen may be left out"
    texts = [typing.get_args(each.annotation)[1] for each in found.values()]
    assert [text.help for text in texts] == [
        "What has no default. [default: 7]",
        "Its size, m. [default: 2.0]",
        "Switch it on.",
    ]
    assert [text.name for text in texts] == [("--need",), ("--size-of",), ("--on",)]


def test_what_is_given_is_taken_and_made_into_settings() -> None:
    words = {
        "need": 1,
        "inner_size": None,
        "inner_tags": (),
        "pair": None,
        "on": False,
        "name": "n",
        "changes": ("a=1", "b=x"),
        "several": ("size=3", "size=4,tags=t"),
        "other": 5,
    }
    given = Fields(Outer).take(words)
    assert words == {"other": 5}
    assert given == {
        "need": 1,
        "on": False,
        "name": "n",
        "changes": {"a": 1, "b": "x"},
        "several": [{"size": 3}, {"size": 4, "tags": "t"}],
    }
    given = Fields(Outer, "size=inner.size").take({"size": 9.0})
    assert given == {"inner": {"size": 9.0}}
    assert made_of(Outer, {"need": 1, "inner": {"size": 9.0}}) == Outer(1, Inner(9.0))


@pytest.mark.parametrize(
    ("hint", "text", "fits"),
    [
        (int, "3", True),
        (int, "3.0", True),
        (int, "3.5", False),
        (int, "many", True),
        (float, "3.5", True),
        (int | None, "2.5", False),
    ],
)
def test_whole_numbers_are_whole(hint: Any, text: str, fits: bool) -> None:
    argument: Any = SimpleNamespace(hint=hint, name="--n", tokens=[SimpleNamespace(value=text)])
    if fits:
        prepare(None, (), [argument])  # type: ignore[arg-type]
    else:
        with pytest.raises(InputError, match="--n must be a whole number"):
            prepare(None, (), [argument])  # type: ignore[arg-type]


# ---- walks ----------------------------------------------------------------------------------------------------------


def options(**values: Any) -> WalkOptions:
    return WalkOptions(**values)


def test_the_command_has_defaults_of_its_own_unless_a_spec_a_loop_or_a_policy_is_given(
    tmp_path: Path,
) -> None:
    def of(given: dict[str, Any], **values: Any) -> dict[str, Any]:
        spec = walk_spec({"plan": {"distance": 0.2}} | given, options(**values))
        return {name: getattr(spec, name) for name in STONES}

    assert of({}) == STONES == of({}, spec=USUAL)
    (tmp_path / "a.toml").write_text("seed = 3")
    plain = {name: getattr(WalkSpec(), name) for name in ("foot", "terrain", "eyes")}
    part = of({}, spec=str(tmp_path / "a.toml"))
    assert {name: part[name] for name in plain} == plain
    assert (
        of({"terrain": "flat"})["foot"] == STONES["foot"]
        and of({"terrain": "flat"})["amplitude"] != STONES["amplitude"]
    )
    assert (
        of({"policy": "fixed"})["foot"] == of({"policy": "fixed"}, spec=USUAL)["foot"] == "variable"
        and of({"policy": "fixed", "foot": "variable"})["foot"] == "variable"
    )


def test_what_belongs_to_a_value_goes_with_it(tmp_path: Path) -> None:
    """Another foot drops the stiffness of the file's, the same one keeps it; so does a ground."""
    (tmp_path / "a.toml").write_text(
        'foot = "soft"\nstiffness = 30.0\nterrain = "stones"\namplitude = 0.03\nfoot_changes = { phalanges = 8 }\n'
        'changes = { "gains.dcm_p" = 4, "gains.dcm_i" = 0.5 }\n[plan]\ndistance = 0.2\n'
    )
    file = str(tmp_path / "a.toml")
    same = walk_spec({"foot": "soft"}, options(spec=file))
    assert same.stiffness == 30.0 and same.amplitude == 0.03 and dict(same.foot_changes) == {"phalanges": 8}
    other = walk_spec({"foot": "flat"}, options(spec=file))
    assert other.stiffness is None and other.amplitude == 0.03 and not other.foot_changes
    ground = walk_spec({"terrain": "flat"}, options(spec=file))
    assert ground.stiffness == 30.0 and ground.amplitude != 0.03
    changed = walk_spec({}, options(spec=file, set=("dcm_p=9",)))
    assert dict(changed.changes)["gains.dcm_p"] == (9.0, 9.0) and dict(changed.changes)["gains.dcm_i"] == (
        0.5,
        0.5,
    )
    more = walk_spec({"foot_changes": {"contact.radius": 0.006}}, options(spec=file))
    assert dict(more.foot_changes) == {"phalanges": 8, "contact.radius": 0.006}


def test_angles_of_the_command_line_are_degrees(tmp_path: Path) -> None:
    spec = walk_spec({"plan": {"turn": 90.0}, "terrain": "flat", "eyes": "none"}, options())
    assert spec.plan.turn == pytest.approx(math.pi / 2.0)
    pushes = [{"impulse": 0.05, "direction": 180.0, "step": 1}, {"impulse": 0.05, "step": 2}]
    spec = walk_spec({"plan": {"distance": 0.2}, "pushes": pushes}, options())
    assert [push.direction for push in spec.pushes][0] == pytest.approx(math.pi)
    assert pushes[0]["direction"] in (180.0, pytest.approx(math.pi))


def test_a_drive_from_the_page_has_its_time(tmp_path: Path) -> None:
    assert walk_spec({}, options(), drive=True).plan.drive == ((DRIVE_TIME, 0.0, 0.0, 0.0),)
    assert walk_spec({}, options(seconds=12.0), drive=True).plan.drive == ((12.0, 0.0, 0.0, 0.0),)
    with pytest.raises(InputError, match="--drive"):
        walk_spec({"plan": {"distance": 0.2}}, options(seconds=5.0))
    for last, fits in ((DRIVE_TIME, True), (1.01 * DRIVE_TIME, False)):
        (tmp_path / "d.toml").write_text(f"plan.drive = [[0, 0.1, 0, 0], [{last}, 0, 0, 0]]")
        if fits:
            assert walk_spec({}, options(spec=str(tmp_path / "d.toml"))).plan.drive is not None
        else:
            with pytest.raises(InputError, match=f"{last:g} s takes longer"):
                walk_spec({}, options(spec=str(tmp_path / "d.toml")))


def test_names_of_set_are_those_of_the_spec_its_parts_or_its_settings() -> None:
    assert place_of("seed") == "seed" and place_of("plan.distance") == "plan.distance"
    assert place_of("stairs") == "plan.stairs" and place_of("single_support") == "gait.single_support"
    with pytest.raises(InputError, match=r"plan\.distance or ground\.footprint\.distance"):
        place_of("distance")
    assert place_of("dcm_p") == "changes.gains.dcm_p" and place_of("gains.dcm_p") == "changes.gains.dcm_p"
    assert place_of("foot_changes.phalanges") == "foot_changes.phalanges"
    with pytest.raises(InputError, match="dcm_p"):
        place_of("dcm_q")


def test_a_spec_is_a_preset_a_file_or_the_output_of_a_walk(tmp_path: Path) -> None:
    (tmp_path / "a.JSON").write_text('{"spec": {"seed": 4}, "other": 1}')
    (tmp_path / "b").write_text('{"seed": 5}')
    (tmp_path / "c.TOML").write_text("seed = 6")
    assert [read_spec(str(tmp_path / name))["seed"] for name in ("a.JSON", "b", "c.TOML")] == [4, 5, 6]
    assert read_spec("frizza")
    (tmp_path / "d.json").write_text('{"spec": 3}')
    with pytest.raises(InputError, match="must be an object"):
        read_spec(str(tmp_path / "d.json"))


@pytest.mark.parametrize(
    "words", [["--seed", "3"], ["--set", "dcm_p=3"], ["--seconds", "3", "--drive"], ["--spec", "frizza"]]
)
def test_a_repeated_walk_takes_no_other_options(words: list[str], tmp_path: Path, capsys: Said) -> None:
    assert main(["walk", "--repeat", str(tmp_path / "none.arrow"), *words]) == BAD_INPUT
    assert "--repeat takes the walk from its log" in capsys.readouterr().err
    assert main(["walk", "--repeat", str(tmp_path / "none.arrow")]) == BAD_INPUT
    assert "none.arrow" in capsys.readouterr().err


# ---- other commands -------------------------------------------------------------------------------------------------


def test_options_of_a_file_are_parameters_of_its_reader(tmp_path: Path) -> None:
    assert RobotFileOptions().parameters() == {}
    given = RobotFileOptions(
        left="l",
        right="r",
        sole_size=(0.2, 0.1),
        root="b",
        lock=("a=0.5", "c=-1"),
        without_meshes=True,
        derive_gains=True,
        repair=True,
        package_dir=(tmp_path,),
    )
    assert given.parameters() == {
        "left_sole": "l",
        "right_sole": "r",
        "sole_size": [0.2, 0.1],
        "root": "b",
        "lock": {"a": 0.5, "c": -1.0},
        "meshes": False,
        "use_gains": False,
        "repair": True,
        "package_dirs": [str(tmp_path.resolve())],
    }
    for text in ("a", "a=much", "a=nan"):
        with pytest.raises(InputError, match="locked joint"):
            robots_command._locked(text)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["check"], "takes one file, got 0"),
        (["check", "a", "b"], "takes one file, got 2"),
        (["g1", "talos"], "need a check"),
        (["g1", "--root", "b"], "need a check"),
        (["check", "own.toml", "--root", "b"], "options in itself"),
        (["check", "own.toml", "-o", "b.toml"], "options in itself"),
    ],
)
def test_robots_are_checked_one_at_a_time(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.toml").write_text("file = 'a.xml'")
    assert main(["robots", *words]) == BAD_INPUT
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"out": "a.avi"}, "end in one of"),
        ({"out": "a.rrd", "speed": 2.0}, "film"),
        ({"size": (96, 72)}, "film"),
        ({"speed": 2.0}, "film"),
        ({"out": "a.mp4", "port": 7000}, "port"),
        ({"out": "a.mp4", "speed": 2.0, "size": (96, 72)}, ""),
        ({"port": 7000}, ""),
        ({"out": "A.RRD"}, ""),
    ],
)
def test_options_of_a_film_belong_to_films_and_ports_to_pages(values: dict[str, Any], said: str) -> None:
    values = values | ({"out": Path(values["out"])} if "out" in values else {})
    if not said:
        ViewOptions(**values)
    else:
        with pytest.raises(InputError, match=said):
            ViewOptions(**values)


def test_roughness_of_a_ground_is_named_with_its_units(capsys: Said) -> None:
    assert main(["terrain", "flat", "--json"]) == RAN
    facts = json.loads(capsys.readouterr().out)
    assert "Sq_m" in facts["roughness"] and "K" in facts["roughness"] and facts["clears"]
    with pytest.warns(UserWarning, match="90 mm"):
        facts = describe_terrain("stones", TerrainOptions(), {"amplitude": 0.09, "seed": 1})
    assert not facts["clears"]
