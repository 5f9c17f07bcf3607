"""`dynx world`: tables, document, files and exit codes."""

from __future__ import annotations

import json
import signal
import sys
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from rich.console import Console

import dynx
from dynx import Pose
from dynx.cli.shell.main import cli
from dynx.cli.world import _lowest, _show_separations
from dynx.world import Material, Scene, World, box, ground, read_scene, world_names, write_scene
from tests.world.engines import WORLDS

ENGINES = [name for name in WORLDS if find_spec(name) is not None]

pytestmark = pytest.mark.skipif(not ENGINES, reason="needs an engine for worlds")

FALLING = """schema = "dynx.scene/1"
name = "falling"
[[bodies]]
name = "ball"
shape = { sphere = 0.1 }
mass = 1.0
pose = [0.0, 0.0, 5.0]
"""


@pytest.fixture
def scene(tmp_path: Path) -> str:
    path = tmp_path / "falling.toml"
    path.write_text(FALLING)
    return str(path)


def run(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["world", *arguments])


def test_the_table_shows_what_falls(scene: str) -> None:
    result = run(scene, "--engine", ENGINES[0], "--duration", "1")
    assert result.exit_code == 0, result.output
    assert "falling: 1 s, dt 0.001 s" in result.output
    # z = 5 - g t^2 / 2, of semi-implicit Euler 5 mm lower.
    assert "0.0901" in result.output
    assert "no contacts at the end" in result.output


@pytest.mark.skipif(len(ENGINES) < 2, reason="needs two engines")
def test_engines_that_agree_are_never_apart(scene: str) -> None:
    result = run(scene, "--engine", ",".join(ENGINES), "--duration", "0.5", "--within", "1e-9", "--json", "-")
    assert result.exit_code == 0, result.output
    document: dict[str, Any] = json.loads(result.stdout)
    assert [each["engine"] for each in document["engines"]] == ENGINES
    for each in document["separations"]:
        assert max(each["distance"]) < 1e-9
        assert each["parted"][0] == {"distance": 1e-3, "time": None}


@pytest.mark.skipif(len(ENGINES) < 2, reason="needs two engines")
def test_engines_that_part_give_exit_code_1() -> None:
    stack = run("stack", "--engine", ",".join(ENGINES), "--duration", "0.2", "--within", "1e-12")
    assert stack.exit_code == 1, stack.output
    assert "distance of the motions" in stack.output


@pytest.mark.skipif(len(ENGINES) < 2, reason="needs two engines")
def test_the_motions_of_robots_are_compared() -> None:
    if "ur5" not in {entry.name for entry in dynx.robots()}:
        pytest.skip("needs example-robot-data")
    result = run("pushing", "--engine", ",".join(ENGINES), "--duration", "0.1")
    assert result.exit_code == 0, result.output
    assert "shoulder_lift_joint" in result.output


def test_files_are_written(scene: str, tmp_path: Path) -> None:
    saved, plotted, document = (tmp_path / name for name in ("end.world", "plot.png", "run.json"))
    result = run(
        *(scene, "--engine", ENGINES[0], "--duration", "0.1", "--quiet"),
        *("--save", str(saved), "--plot", str(plotted), "--json", str(document)),
    )
    assert result.exit_code == 0, result.output
    assert result.stdout == ""
    with World.read(saved) as world:
        assert world.time == pytest.approx(0.1)
        assert world.state.bodies["ball"].T_world_body[2, 3] < 5.0
    assert plotted.stat().st_size > 1000
    assert json.loads(document.read_text())["scene"] == "falling"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stak"], "did you mean 'stack'"),
        (["stack", "--engine", "pybulet"], "no world engine 'pybulet'"),
        (["stack", "--set", "solver_iteration=3"], "no such setting"),
        (["stack", "--set", "solver_iterations"], "name=value"),
        (["stack", "--duration", "-1"], "--duration"),
        (["stack", "--json", "/no/such/folder/x.json"], "no directory"),
    ],
)
def test_wrong_input_gives_one_line_and_exit_code_2(arguments: list[str], message: str) -> None:
    result = run(*arguments, *([] if "--engine" in arguments else ["--engine", ENGINES[0]]))
    assert result.exit_code == 2
    assert message in result.output
    assert "Traceback" not in result.output


def test_every_engine_of_dynx_is_offered() -> None:
    assert {"pybullet", "mujoco", "drake"} <= set(world_names())


OVERLAPPING = """schema = "dynx.scene/1"
[[bodies]]
name = "kugel α"
shape = { sphere = 0.1 }
mass = 1.0
[[bodies]]
name = "b"
shape = { sphere = 0.1 }
mass = 1.0
pose = [0.0, 0.0, 0.15]
[[constraints]]
kind = "point"
a = "b"
b = "world"
"""


@pytest.fixture
def overlapping(tmp_path: Path) -> str:
    path = tmp_path / "overlapping.toml"
    path.write_text(OVERLAPPING, encoding="utf-8")
    return str(path)


def test_notes_on_the_start_are_shown(overlapping: str, tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    result = run(overlapping, "--engine", ",".join(ENGINES), "--duration", "0.01", "--json", str(path))
    assert "note: 'kugel α' and 'b' overlap by 50 mm at the start" in result.output
    assert "note: the ends of the point-to-point constraint of 'b' and 'world'" in result.output
    assert all(len(each["notes"]) == 2 for each in json.loads(path.read_text())["engines"])


def test_a_scene_is_exported_by_the_suffix_and_not_run(overlapping: str, tmp_path: Path) -> None:
    for suffix in ("xml", "json", "urdf"):
        result = run(overlapping, "--export", str(tmp_path / f"out.{suffix}"))
        assert result.exit_code == 0, result.output
        assert "wrote" in result.output
        assert "bodies at the end" not in result.output
    assert 'name="kugel α"' in (tmp_path / "out.xml").read_text(encoding="utf-8")
    options = ("--dt", "0.004", "--substeps", "2", "--set", "impratio=7", "--set", "mujoco.cone=pyramidal")
    assert run(overlapping, "--export", str(tmp_path / "set.xml"), *options).exit_code == 0
    text = (tmp_path / "set.xml").read_text(encoding="utf-8")
    assert all(each in text for each in ('timestep="0.002"', 'impratio="7.0"', 'cone="pyramidal"'))
    assert read_scene(tmp_path / "out.json") == read_scene(overlapping)
    assert dynx.load(tmp_path / "out.kugel α.urdf", base="floating").total_mass == 1.0
    assert (tmp_path / "out.b.urdf").is_file()


def test_contact_forces_are_averaged_over_an_interval(tmp_path: Path) -> None:
    rough = Material(friction=0.5)
    start = (3.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    slider = box("slider", (0.4, 0.4, 0.2), mass=1.0, pose=Pose((0, 0, 0.1)), twist=start, material=rough)
    file, path = tmp_path / "slide.toml", tmp_path / "run.json"
    write_scene(Scene("slide", bodies=(ground(material=rough), slider)), file)
    arguments = (str(file), "--engine", ENGINES[0], "--duration", "0.4", "--json", str(path))
    result = run(*arguments, "--contact-interval", "0.2")
    assert result.exit_code == 0, result.output
    assert "contacts, mean of the last 0.2 s: normal force" in result.output
    report = json.loads(path.read_text())
    (mean,) = report["engines"][0]["mean_contacts"]
    assert report["contact_interval"] == 0.2
    assert (mean["a"], mean["b"]) == ("ground", "slider")
    assert mean["normal_force"] == pytest.approx(9.81, rel=0.02)
    assert mean["force"][0] == pytest.approx(0.5 * 9.81, rel=0.02)
    result = run(*arguments)
    assert "mean of the last" not in result.output
    report = json.loads(path.read_text())
    assert (report["contact_interval"], report["engines"][0]["mean_contacts"]) == (None, [])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stack", "--contact-interval", "0.1", "--export", "x.xml"], "--contact-interval is given with"),
        (["stack", "--contact-interval", "0"], "not in the range x>0"),
        (["stack", "--export", "scene.xmll"], "did you mean '.xml'"),
        (["stack", "--export", "/no/such/folder/x.xml"], "no directory"),
        (
            ["stack", "--export", "x.xml", "--plot", "y.png"],
            "--plot is given with --export",
        ),
    ],
)
def test_exports_that_are_impossible_are_refused(arguments: list[str], message: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in result.output


@pytest.mark.parametrize(("largest", "bottom"), [(1.0, 1e-9), (2e-9, 1e-9), (1e-13, 1e-17), (0.0, 1e-9)])
def test_plots_begin_where_distances_are_more_than_rounding(largest: float, bottom: float) -> None:
    assert _lowest(largest) == pytest.approx(bottom)


@pytest.mark.parametrize("last", [0, len(ENGINES) - 1])
def test_ctrl_c_keeps_what_is_done(
    scene: str, last: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The engines that ran, the last up to some time; files are written, and the exit code is 130."""
    step = World.step

    def interrupted(world: World, n: int) -> None:
        step(world, n)
        if world.engine == ENGINES[last] and world.time > 0.05:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(World, "step", interrupted)
    out = tmp_path / "out.json"
    arguments = ("--engine", ",".join(ENGINES), "--duration", "0.1", "--json", str(out))
    result = run(scene, *arguments, "--save", str(tmp_path / "state.world"))
    assert result.exit_code == 130
    assert f"s of {ENGINES[last]}, engine number {last + 1} of {len(ENGINES)}" in " ".join(
        result.output.split()
    )
    found = json.loads(out.read_text())["engines"]
    assert [each["engine"] for each in found] == list(ENGINES[: last + 1])
    assert 0.0 < found[-1]["time"] < 0.1
    assert [each["error"] for each in found] == [None] * last + ["interrupted"]
    assert all(each["time"] == pytest.approx(0.1) for each in found[:-1])
    assert len([*tmp_path.glob("state*.world")]) == last + 1


def test_a_file_of_another_kind_is_refused_before_the_run(scene: str, tmp_path: Path) -> None:
    result = run(scene, "--save", str(tmp_path / "end.npz"))
    assert result.exit_code == 2
    assert "a world with its state is written to .world" in result.stderr
    assert "Rollout.save" in result.stderr
    assert not (tmp_path / "end.npz").exists()


def test_the_part_that_is_apart_first_is_named() -> None:
    separation = {
        "engines": ["a", "b"],
        "times": [0.0, 1.0, 2.0],
        "distance": [0.0, 0.002, 0.5],
        "farthest": ["cube", "ball", "cube"],
        "parted": [{"distance": 1e-3, "time": 1.0}, {"distance": 1.0, "time": None}],
    }
    out = StringIO()
    _show_separations(Console(file=out, width=200), [separation])
    (*_, row) = out.getvalue().splitlines()
    assert row.split() == ["a,", "b", "1", "s", "never", "ball", "5.00e-01", "5.00e-01", "cube"]


MJCF = """<mujoco model="two">
  <worldbody>
    <body name="arm"><joint name="hinge"/><geom size="0.1" pos="1 0 0"/></body>
    <body name="ball" pos="0 0 5"><freejoint/><geom size="0.1"/></body>
  </worldbody>
  <sensor><jointpos joint="hinge"/></sensor>
  <keyframe><key name="high" qpos="0.5 0 0 9 1 0 0 0"/></keyframe>
</mujoco>"""


@pytest.fixture
def mjcf(tmp_path: Path) -> str:
    path = tmp_path / "two.xml"
    path.write_text(MJCF)
    return str(path)


def test_a_file_in_mjcf_is_a_scene(mjcf: str) -> None:
    arguments = (mjcf, "--engine", ENGINES[0], "--duration", "0.001", "--keyframe", "high", "--json", "-")
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    (engine,) = json.loads(result.stdout)["engines"]
    assert engine["robots"][0]["joints"] == ["hinge"]
    assert engine["robots"][0]["q"] == pytest.approx([0.5], abs=1e-4)
    assert engine["bodies"][0]["position"][2] == pytest.approx(9.0, abs=1e-4)
    assert any("<sensor>" in note for note in engine["notes"])


def test_a_file_in_mjcf_becomes_one_of_a_scene_with_its_notes(mjcf: str, tmp_path: Path) -> None:
    result = run(mjcf, "--keyframe", "high", "--export", str(tmp_path / "two.json"))
    assert result.exit_code == 0, result.output
    assert "<sensor>" in result.output
    assert read_scene(tmp_path / "two.json").robot("arm").q == (0.5,)


def test_a_keyframe_that_is_not_there_is_refused(mjcf: str, scene: str) -> None:
    for arguments, message in (
        ((mjcf, "--keyframe", "hihg"), "'high'"),
        ((scene, "--keyframe", "high"), "MJCF"),
    ):
        result = run(*arguments, "--engine", ENGINES[0])
        assert result.exit_code == 2
        assert message in result.stderr
        assert "Traceback" not in result.output


@pytest.mark.skipif(sys.platform == "win32", reason="links need a right")
def test_files_of_several_engines_or_bodies_are_not_written_through_links(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    write_scene(Scene("s", bodies=[box("a", (1.0, 1.0, 1.0)), box("b", (1.0, 1.0, 1.0))]), scene)
    (tmp_path / "x.b.urdf").symlink_to(tmp_path / "other")
    (tmp_path / "x.mujoco.world").symlink_to(tmp_path / "other")
    for words in (
        ("--export", str(tmp_path / "x.urdf"), "--engine", "mujoco"),
        ("--save", str(tmp_path / "x.world"), "--engine", "pybullet,mujoco", "--duration", "0.01"),
    ):
        result = run(str(scene), *words)
        assert (result.exit_code, "is a link" in result.output) == (2, True), result.output
    assert not (tmp_path / "other").exists()


BALL_JOINT = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 0.1"/>
<body name="rod" pos="0 0 1"><joint name="hip" type="ball" range="0 90" limited="true"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/></body></worldbody></mujoco>"""


@pytest.mark.skipif(not {"pybullet", "mujoco"} <= {*ENGINES}, reason="needs PyBullet and MuJoCo")
def test_engines_that_refuse_the_scene_are_left_out_unless_they_are_named(tmp_path: Path) -> None:
    path = tmp_path / "rod.xml"
    path.write_text(BALL_JOINT)
    result = run(str(path), "--duration", "0.01", "--json", "-")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert [each["engine"] for each in report["engines"]] == ["mujoco"]
    reasons = {each["engine"]: each["reason"] for each in report["left_out"]}
    assert {"pybullet", "dynx"} <= {*reasons}
    assert (
        "a world on 'pybullet' does not take; the world engines 'mujoco' and 'dynx' do" in reasons["pybullet"]
    )
    assert "note: without pybullet: " in run(str(path), "--duration", "0.01").output
    for named in ("pybullet", "mujoco,pybullet", "dynx"):
        assert run(str(path), "--engine", named).exit_code == 2
    # The advice of the engine `dynx` holds at the command line.
    refused = run(str(path), "--engine", "dynx").stderr
    assert "--set joint_limits=false" in " ".join(refused.split())
    limits_off = ("--set", "joint_limits=false", "--duration", "0.01")
    assert run(str(path), "--engine", "dynx", *limits_off).exit_code == 0


def test_a_scene_that_every_engine_refuses_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dynx.cli.world.installed_worlds", lambda: ("dynx",))
    path = tmp_path / "rod.xml"
    path.write_text(BALL_JOINT)
    result = run(str(path), "--duration", "0.01")
    assert result.exit_code == 2
    assert "joint limits and the ball joint 'hip'" in result.stderr
