"""``dynx view``: what it takes, what it refuses, and its exported pages."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import dynx
from dynx.cli.shell.main import cli
from dynx.cli.view import read_rollout
from tests.conftest import needs_examples

BAD_INPUT = 2


def run(*arguments: str) -> tuple[int, str]:
    """Run the command; return the exit code and everything printed."""
    result = CliRunner().invoke(cli, ["view", *arguments])
    return result.exit_code, " ".join(result.output.split())


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A short rollout in a file."""
    path = tmp_path_factory.mktemp("rollouts") / "run.npz"
    dynx.simulate(dynx.load("six_axis_arm"), duration=0.1).save(path)
    return str(path)


def test_a_rollout_a_robot_and_two_rollouts_are_exported(saved: str, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    for arguments in ((saved,), ("pendulum",), ("--compare", saved, saved)):
        code, output = run(*arguments, "--export", str(page))
        assert code == 0, output
        assert "wrote" in output
        assert page.read_bytes().startswith(b"<!")
        page.unlink()


def test_a_picture_shows_the_collision_shapes_where_they_are_asked_for(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    # The hull of two triangles that are apart fills the room between them.
    corners = [f"v {x} {y} {z}" for x in (-0.3, 0.3) for y, z in ((-0.1, 0.0), (0.1, 0.0), (0.0, 0.2))]
    (tmp_path / "two.obj").write_text("\n".join([*corners, "f 1 2 3", "f 4 5 6"]))
    blue = '<material name="b"><color rgba="0 0 1 1"/></material>'
    robot = """<robot name="r">
      <link name="a"><visual><geometry><sphere radius="0.1"/></geometry>{blue}</visual>{colliding}</link>
      <link name="b"><visual><geometry><sphere radius="0.2"/></geometry>{blue}</visual></link>
      <joint name="j" type="fixed"><parent link="a"/><child link="b"/><origin xyz="0 0 0.5"/></joint>
    </robot>"""
    colliding = '<collision><geometry><mesh filename="two.obj"/></geometry></collision>'
    path, picture = tmp_path / "robot.urdf", tmp_path / "picture.png"

    def pixels(*options: str) -> tuple[int, int]:
        """Return the number of orange and of blue pixels."""
        code, output = run(str(path), *options, "--export", str(picture))
        assert code == 0, output
        assert ("note: r has no collision shapes" in output) == (bool(options) and not has_shape)
        r, g, b = np.moveaxis(np.asarray(image.open(picture).convert("RGB")).astype(int), 2, 0)
        return int(((r > g + 30) & (g > b + 30)).sum()), int((b > r + 60).sum())

    has_shape = True
    path.write_text(robot.format(blue=blue, colliding=colliding))
    assert pixels()[0] == 0 < pixels()[1]
    orange, other = pixels("--collisions")
    # The triangles alone take less than half of that.
    assert orange > 0.08 * 960 * 720
    assert other == 0
    has_shape = False
    path.write_text(robot.format(blue=blue, colliding=""))
    lines, other = pixels("--collisions")
    assert other == 0 < lines < 0.02 * 960 * 720


def test_a_film_is_exported_by_its_suffix(
    saved: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = tmp_path / "run.mp4"
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "imageio_ffmpeg", None)
        code, output = run(saved, "--export", str(film))
        assert (code, film.exists()) == (2, False)
        assert "pip install '.[film]'" in output
    pytest.importorskip("imageio_ffmpeg", reason="needs the extra film")
    code, output = run(saved, "--export", str(film))
    assert code == 0, output
    assert film.read_bytes()[4:8] == b"ftyp"


def test_a_robot_is_shown_at_a_configuration(tmp_path: Path) -> None:
    pictures = []
    robot = tmp_path / "door.urdf"
    robot.write_text(
        '<robot name="door"><link name="wall"/><link name="leaf"><visual><origin xyz="0.4 0 0"/><geometry>'
        '<box size="0.8 0.1 1"/></geometry></visual></link><joint name="hinge" type="continuous">'
        '<parent link="wall"/><child link="leaf"/><axis xyz="0 0 1"/></joint></robot>',
        encoding="utf-8",
    )
    for q in ("0", "hinge=1.5"):
        picture = tmp_path / "robot.png"
        code, output = run(str(robot), "--q", q, "--export", str(picture))
        assert code == 0, output
        pictures.append(picture.read_bytes())
    assert pictures[0] != pictures[1]
    assert "door needs 1: hinge" in run(str(robot), "--q", "1,2")[1]


def test_a_scene_is_compared_in_two_engines(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pybullet")
    page = tmp_path / "page.html"
    code, output = run(
        "--compare", "slope", "--engine", "pybullet,mujoco", "--duration", "0.1", "--export", str(page)
    )
    assert code == 0, output
    assert page.is_file()


def test_a_scene_is_recorded_in_one_engine(tmp_path: Path) -> None:
    pytest.importorskip("pybullet")
    page = tmp_path / "page.html"
    arguments = ("slope", "--engine", "pybullet", "--duration", "0.1", "--export", str(page))
    code, output = run(*arguments)
    assert code == 0, output
    assert page.is_file()


BALL = '<body name="{0}" pos="{1} 0 1"><freejoint/><geom size="0.1" mass="1"/></body>'


@pytest.mark.parametrize("count", [1, 2])
def test_mjcf_of_several_bodies_is_a_scene(tmp_path: Path, count: int) -> None:
    pytest.importorskip("pybullet")
    source, page = tmp_path / "balls.xml", tmp_path / "page.html"
    balls = "".join(BALL.format(name, at) for at, name in enumerate("ab"[:count]))
    source.write_text(f"<mujoco><worldbody>{balls}</worldbody></mujoco>")
    code, output = run(str(source), "--duration", "0.1", "--engine", "pybullet", "--export", str(page))
    if count == 1:
        assert "--duration has no effect on a robot" in output
        code, output = run(str(source), "--export", str(page))
    assert code == 0, output
    assert page.is_file()


DIVERGING = """
schema = "dynx.scene/1"
name = "overlapping"

[[bodies]]
name = "bar"
shape = { box = [0.6, 0.1, 0.1] }
pose = [0.0, 0.0, 0.0]

[[bodies]]
name = "block"
shape = { box = [0.2, 0.2, 0.2] }
mass = 1.0
pose = [0.1, 0.0, 0.0]

[[robots]]
name = "arm"
robot = "pendulum"
motors = [{ kind = "pd", target = 1.0, kp = 1e15, kd = 1e15 }]
"""
"""Scene with an overlap, and with gains that are stiff for its step."""


def test_a_motion_that_ends_early_is_explained(tmp_path: Path) -> None:
    pytest.importorskip("pybullet")
    scene, page = tmp_path / "scene.toml", tmp_path / "page.html"
    scene.write_text(DIVERGING, encoding="utf-8")
    arguments = (str(scene), "--engine", "pybullet", "--duration", "0.1", "--export", str(page))
    code, output = run(*arguments)
    assert code == 0, output
    assert "note: pybullet: 'bar' and 'block' overlap" in output
    assert "note: pybullet: the motion ends early: the world of overlapping diverged" in output


@needs_examples
def test_a_rollout_is_drawn_with_the_shapes_of_a_robot(tmp_path: Path) -> None:
    path, page = tmp_path / "run.npz", tmp_path / "page.html"
    own = dynx.load("ur5").to_urdf().replace('<robot name="ur5">', '<robot name="own_arm">')
    dynx.simulate(dynx.load(own), duration=0.05).save(path)
    code, output = run(str(path), "--export", str(page))
    assert code == 0, output
    assert "has no shapes" in output
    assert "note: --shapes ROBOT" in output
    bare = page.stat().st_size
    code, output = run(str(path), "--shapes", "ur5", "--export", str(page))
    assert code == 0, output
    assert "has no shapes" not in output
    assert "--shapes ROBOT" not in output
    assert page.stat().st_size > bare + 50_000
    code, output = run(str(path), "--shapes", "pendulum", "--export", str(page))
    assert code == BAD_INPUT
    assert "which own_arm has" in output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("no_such_robot",), "no_such_robot"),
        (("nowhere.npz",), "no file"),
        (("run.csv",), "shown from .npz"),
        (("pendulum", "pendulum"), "2 targets"),
        (("--compare", "pendulum"), "'pendulum', a robot"),
        (("--compare", "a.npz"), "takes two rollouts"),
        (("--compare", "a.npz", "slope"), "'slope', a scene"),
        (("a.npz", "--base", "floating"), "--base has no effect on a rollout"),
        (("pendulum", "--dt", "0.1"), "--dt has no effect on a robot"),
        (("slope", "--duration", "1"), "--compare or --export"),
        (("slope", "--dt", "nan"), "not finite"),
        (("slop",), "did you mean 'slope'"),
        (("--compare", "a.npz", "b.npz"), "no file"),
        (("pendulum", "--engine", "a,b"), "wanted one"),
        (("pendulum", "--engine", "pinochio"), "pinocchio"),
        (("slope", "--engine", "nothing"), "nothing"),
        (("pendulum", "--port", "70000"), "70000"),
        (("pendulum", "--host", "203.0.113.1", "--no-browser"), "cannot be listened on"),
        (("pendulum", "--export", "page.jpg"), ".html"),
        (("pendulum", "--export", "nowhere/page.html"), "nowhere"),
        (("nowhere.toml",), "nowhere.toml"),
    ],
)
def test_input_that_cannot_be_shown_is_told(arguments: tuple[str, ...], message: str) -> None:
    code, output = run(*arguments)
    assert code == BAD_INPUT, output
    assert message in output
    assert "Traceback" not in output


def test_damaged_rollouts_are_told(saved: str, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(Path(saved).read_bytes()[:-100])
    code, output = run(str(damaged))
    assert code == BAD_INPUT
    assert "damaged.npz" in output
    folder = tmp_path / "folder.npz"
    folder.mkdir()
    code, output = run(str(folder))
    assert code == BAD_INPUT
    assert "is a directory; wanted a file" in output


def test_a_port_that_is_taken_is_told() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        code, output = run("pendulum", "--port", str(taken.getsockname()[1]), "--no-browser")
    assert code == BAD_INPUT
    assert "choose another port" in output


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_the_page_ends_with_ctrl_c() -> None:
    command = [sys.executable, "-m", "dynx.cli.shell.main", "view", "pendulum", "--port", "0", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        address = process.stdout.readline() if first.startswith("note:") else first
        process.send_signal(signal.SIGTERM)
        output, _ = process.communicate(timeout=60)
    assert "http://127.0.0.1:" in address
    assert process.returncode == 0, output
    assert "Traceback" not in output


def test_a_recording_in_mcap_is_shown(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    recording, picture = tmp_path / "run.mcap", tmp_path / "run.png"
    dynx.simulate(dynx.load("six_axis_arm"), duration=0.05).save(recording)
    code, output = run(str(recording), "--export", str(picture))
    assert code == 0, output
    assert picture.is_file()


@needs_examples
def test_a_rollout_is_drawn_with_the_shapes_of_the_library(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    dynx.simulate(dynx.load("panda"), duration=0.01).save(path)
    assert read_rollout(str(path), None).model.geometry.visuals("panda_link1")
    text = dynx.load("panda").to_urdf()
    assert 'xyz="0.0 0.0 0.333"' in text
    longer = dynx.load(text.replace('xyz="0.0 0.0 0.333"', 'xyz="0.0 0.0 0.4"', 1))
    dynx.simulate(longer, duration=0.01).save(path)
    assert not read_rollout(str(path), None).model.geometry.visuals("panda_link1")


@needs_examples
@pytest.mark.parametrize("name", ["solo12", "double_pendulum_simple"])
def test_a_robot_of_the_library_is_found_by_the_name_in_its_description(name: str, tmp_path: Path) -> None:
    robot = dynx.load(name)
    assert robot.name != name
    path = tmp_path / "run.npz"
    dynx.simulate(robot, duration=0.01).save(path)
    drawn = read_rollout(str(path), None).model.geometry
    assert {link for link in drawn.links if drawn.links[link].visuals} == {
        link for link in robot.geometry.links if robot.geometry.links[link].visuals
    }


@needs_examples
def test_a_mistyped_target_names_robots_and_scenes() -> None:
    for name, nearest in (("pand", "panda"), ("stak", "stack")):
        code, output = run(name)
        assert code == BAD_INPUT
        assert f"no robot and no scene '{name}'; did you mean '{nearest}'" in output
