"""Robots in files: `wbc robots check`, `wbc robots add`, TOML descriptions and paths as names."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from mjcf_biped import biped

from wbc.app import cli
from wbc.core.errors import InputError, UnknownNameError
from wbc.robots import load, others, saved

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "configuration"
    monkeypatch.setattr(saved.platformdirs, "user_config_path", lambda name: folder / name)
    yield folder


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "biped.xml"
    path.write_text(biped())
    return path


def wbc_command(capfd: Captured, *arguments: str) -> tuple[int, str, str]:
    code = cli.main(list(arguments))
    out, err = capfd.readouterr()
    return code, out, err


def test_check_reports_and_draws(capfd: Captured, file: Path, tmp_path: Path) -> None:
    code, out, _ = wbc_command(capfd, "robots", "check", str(file), "--plot", str(tmp_path / "soles.png"))
    assert code == cli.RAN
    assert (tmp_path / "soles.png").stat().st_size > 10_000
    assert "190 x 80 mm, from 2 capsules" in out and "doubtful:" in out
    assert "waist" in out and "given" in out and "derived" in out
    code, out, _ = wbc_command(capfd, "robots", "check", str(file), "--lock", "waist=0.2", "--json")
    facts = json.loads(out)
    assert "waist" not in facts["joints"]
    assert any("dry friction up to 0.1 Nm" in line for line in facts["doubts"])


def test_add_makes_a_name_for_every_later_command(capfd: Captured, file: Path, configuration: Path) -> None:
    words = ("robots", "add", str(file), "--left", "left_foot", "--right", "right_foot", "--name", "mine")
    code, out, _ = wbc_command(capfd, *words, "--lock", "right_reach=0.1", "--json")
    assert code == cli.RAN
    assert Path(json.loads(out)["file"]) == configuration / "wbc" / "robots" / "mine.toml"
    assert others()["mine"] == ""
    assert load("mine") is load("mine")
    assert load("mine").name == "mine" and "right_reach" not in load("mine").joint_names
    for robot in ("mine", str(file)):
        code, out, _ = wbc_command(capfd, "stand", "--robot", robot, "--seconds", "0.05", "--json")
        assert code == cli.RAN and json.loads(out)["upright"]
    with pytest.raises(UnknownNameError, match="did you mean 'mine'"):
        load("mime")


def test_inertias_that_no_body_can_have_are_repaired_when_asked(
    capfd: Captured, tmp_path: Path, configuration: Path
) -> None:
    """A shin whose moments break the triangle inequality: refused with the option that helps, then added with it."""
    text = (Path(__file__).parents[2] / "examples" / "biped.urdf").read_text()
    wrong = re.sub(r'<inertia ixx="[^"]*"', '<inertia ixx="9.0"', text, count=1)
    assert wrong != text
    (tmp_path / "bad.urdf").write_text(wrong)
    feet = ("--left", "left_foot", "--right", "right_foot")
    words = ("robots", "add", str(tmp_path / "bad.urdf"), *feet, "--name", "fixed")
    code, _, err = wbc_command(capfd, *words)
    assert code == cli.BAD_INPUT and "--repair" in err
    code, *_ = wbc_command(capfd, *words, "--repair", "--package-dir", str(tmp_path))
    assert code == cli.RAN
    written = (configuration / "wbc" / "robots" / "fixed.toml").read_text()
    assert "repair = true" in written and f'package_dirs = ["{tmp_path}"]' in written


def test_a_changed_description_is_read_anew(file: Path) -> None:
    path = saved.save("mine", file, {})
    before = load("mine")
    path.write_text(f"file = {json.dumps(str(file))}\nhalf_sitting = {{ waist = 0.3 }}\n")
    assert before.half_sitting["waist"] == 0.0
    assert load("mine").half_sitting["waist"] == 0.3


def test_all_parameters_can_stand_in_a_description(file: Path) -> None:
    sole = "{{ link = '{0}_foot', translation = [0.03, 0.0, -0.07], length = 0.2, width = 0.1 }}"
    (file.parent / "own.toml").write_text(
        f"""
file = "biped.xml"
left_sole = {sole.format("left")}
right_sole = {sole.format("right")}
imu = {{ link = "chest", rpy = [0.0, 0.1, 0.0] }}
servo = {{ frequency = 6.0 }}
gains = {{ left_knee = [150.0, 4.0] }}
armature = 0.03
use_gains = false
"""
    )
    robot = load(str(file.parent / "own.toml"))
    assert robot.name == "own" and robot.soles[0].length == 0.2 and robot.imu.link == "chest"
    assert robot.gains == {"left_knee": (150.0, 4.0)} and robot.servo.frequency == 6.0
    assert set(robot.armature.values()) == {0.03}


def test_a_urdf_whose_feet_are_not_named_is_described_and_said_not_to_walk(capfd: Captured) -> None:
    code, out, err = wbc_command(capfd, "robots", "check", "examples/biped.urdf")
    assert code == 0 and not err
    assert "no feet: it has a QP (docs/robots.md), but neither stands nor walks" in out


BAD = {
    "no file": (["check", "nowhere.xml"], "no robot file 'nowhere.xml'"),
    "a lock without position": (
        ["check", "{file}", "--lock", "waist"],
        "must be joint=position, got 'waist'",
    ),
    "a lock that is no number": (["check", "{file}", "--lock", "waist=x"], "must be a number, got 'x'"),
    "an unknown foot": (["check", "{file}", "--left", "lft_foot"], "did you mean 'left_foot'"),
    "no name": (["add", "{file}"], "--name"),
    "a name of the library": (["add", "{file}", "--name", "g1"], "'g1' is that of a robot of the library"),
    "a name that is a path": (["add", "{file}", "--name", "a/b"], "must be letters, digits"),
    "a name that is a command": (["add", "{file}", "--name", "check"], "must be letters, digits"),
    "another figure": (["check", "{file}", "--plot", "soles.txt"], ".png"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named_in_one_line(capfd: Captured, file: Path, configuration: Path, case: str) -> None:
    words, message = BAD[case]
    code, out, err = wbc_command(capfd, "robots", *(word.format(file=file) for word in words))
    assert code == cli.BAD_INPUT and not out
    assert message in err and err.count("\n") == 1
    assert not configuration.exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("left_sole = 'a'", 'must name the file of the robot: file = "my.xml"'),
        ("file = 'biped.xml'\nleft_foot = 'a'", "no parameter of the MJCF reader 'left_foot'; did you mean"),
        ("file = 'gone.xml'", "gone.xml"),
        ("file = 3", "must name the file"),
        ("file =", "is not TOML"),
        ("file = 'biped.xml'\nservo = { frequncy = 3 }", "did you mean 'frequency'"),
    ],
)
def test_bad_descriptions_are_named(file: Path, text: str, message: str) -> None:
    (file.parent / "bad.toml").write_text(text)
    with pytest.raises(InputError) as caught:
        load(str(file.parent / "bad.toml"))
    assert message in str(caught.value)


def test_robots_of_wheels_that_are_missing_say_how_to_install_them(monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib import metadata  # noqa: PLC0415

    def missing(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    from wbc.robots.models import other_wheels  # noqa: PLC0415

    assert others()["h1"] == "pip install --no-deps playground==0.2.0"
    with pytest.raises(InputError, match="pip install --no-deps jvrc_description"):
        other_wheels.jvrc1.__wrapped__()
