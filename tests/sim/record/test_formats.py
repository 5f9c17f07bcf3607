"""Rollouts in files: whole or not there, the same to the last bit, and one clear error for any other file."""

from __future__ import annotations

import csv
import json
import os
import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from dynx.control import PD, ComputedTorque
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim import Noise, Rollout, simulate
from dynx.sim.record import csv_file, ros_messages
from dynx.sim.record.formats import WRITERS
from dynx.spatial.scalar import Floats
from tests.sim.bars import tutorial_motion, tutorial_robot

FORMATS = list(WRITERS)

BODY = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def pendulum(robot: str, joint: str) -> str:
    """Return the URDF of one body on one joint."""
    ends = '<parent link="a"/><child link="b"/>'
    return (
        f'<robot name="{robot}"><link name="a"/><link name="b">{BODY}</link>'
        f'<joint name="{joint}" type="continuous">{ends}</joint></robot>'
    )


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    robot = tutorial_robot()
    law = ComputedTorque(robot, kp=400, kd=40)
    noise = Noise(q=1e-5, v=1e-3)
    motion = tutorial_motion(0.05)
    return simulate(robot, law, motion, noise=noise, check_reference=False, effort_limits=20.0)


def table(path: Path) -> tuple[list[str], list[list[str]]]:
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    return header, rows


def column(path: Path, name: str) -> Floats:
    """Numbers of a column of the table, without empty cells."""
    header, rows = table(path)
    cells = [row[header.index(name)] for row in rows]
    return np.array([float(cell) for cell in cells if cell])


# -- the table -----------------------------------------------------------------------------------


def test_a_table_keeps_every_bit(rollout: Rollout, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rollout.save(path)
    assert rollout.reference is not None
    assert rollout.saturated.any()
    kinds: dict[str, Any] = {
        "q": rollout.q,
        "v": rollout.v,
        "q*": rollout.reference.q,
        "v*": rollout.reference.v,
        "a*": rollout.reference.a,
        "error": rollout.error,
        "a": rollout.a,
        "tau": rollout.tau,
        "saturated": rollout.saturated,
    }
    for kind, array in kinds.items():
        for k, name in enumerate(rollout.model.joint_names):
            np.testing.assert_array_equal(column(path, f"{kind}:{name}"), array[:, k], err_msg=kind)
    np.testing.assert_array_equal(column(path, "t"), rollout.t)
    np.testing.assert_array_equal(column(path, "energy"), rollout.energy)
    header, rows = table(path)
    assert len(header) == len(set(header)) == 2 + len(kinds) * 6
    assert len(rows) == len(rollout) + 1
    assert rows[-1][-18:] == [""] * 18


def test_a_table_is_read_by_numpy(rollout: Rollout, tmp_path: Path) -> None:
    rollout.save(tmp_path / "run.csv")
    read = np.genfromtxt(tmp_path / "run.csv", delimiter=",", skip_header=1)
    np.testing.assert_array_equal(read[:, 1:7], rollout.q)
    assert np.isnan(read[-1, -18:]).all()


def test_names_with_separators_stay_one_cell(tmp_path: Path) -> None:
    text = pendulum("r", "le &quot;coude&quot;, é")
    moved = simulate(load(text), v0=[1.0], duration=3e-3)
    moved.save(tmp_path / "run.csv")
    header, rows = table(tmp_path / "run.csv")
    assert 'q:le "coude", é' in header
    assert {len(row) for row in rows} == {len(header)}


# -- whole or not there --------------------------------------------------------------------------


@contextmanager
def full_disk(free: int) -> Iterator[None]:
    """No file can grow beyond `free` bytes."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (free, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("free", [0, 10_000])
def test_a_full_disk_leaves_what_was_there(rollout: Rollout, tmp_path: Path, suffix: str, free: int) -> None:
    path = tmp_path / f"run{suffix}"
    with full_disk(free), pytest.raises(ArgumentError, match=r"run.* cannot be written"):
        rollout.save(path)
    assert not list(tmp_path.iterdir())
    path.write_bytes(b"older")
    with full_disk(free), pytest.raises(ArgumentError):
        rollout.save(path)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == b"older"


@pytest.mark.parametrize("suffix", [*FORMATS, ".png"])
def test_a_folder_that_is_not_there(rollout: Rollout, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / "nowhere" / f"run{suffix}"
    with pytest.raises(ArgumentError, match="nowhere"):
        rollout.plot(path) if suffix == ".png" else rollout.save(path)


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_is_closed(rollout: Rollout, tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    with pytest.raises(ArgumentError, match="Permission denied"):
        rollout.save(tmp_path / "run.npz")


def test_a_folder_of_that_name(rollout: Rollout, tmp_path: Path) -> None:
    (tmp_path / "run.npz").mkdir()
    with pytest.raises(ArgumentError, match="directory"):
        rollout.save(tmp_path / "run.npz")
    assert [each.name for each in tmp_path.iterdir()] == ["run.npz"]


@pytest.mark.parametrize("suffix", FORMATS)
def test_the_end_of_the_name_may_be_in_capitals(rollout: Rollout, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"RUN{suffix.upper()}"
    rollout.save(path)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_record_of_no_steps(rollout: Rollout, tmp_path: Path, suffix: str) -> None:
    nothing = rollout.first(0)
    nothing.save(tmp_path / f"run{suffix}")
    if suffix == ".npz":
        read = Rollout.load(tmp_path / "run.npz")
        assert len(read) == 0
        np.testing.assert_array_equal(read.q, nothing.q)
    assert len(nothing.plot().axes) == 3


# -- other files ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(rollout: Rollout, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("written") / "run.npz"
    rollout.first(3).save(path)
    return path.read_bytes()


def refused(path: Path) -> str:
    """Return the message of the error of `Rollout.load`, which names the file."""
    with pytest.raises(ArgumentError, match=path.name) as caught:
        Rollout.load(path)
    return str(caught.value)


def loaded(path: Path) -> Rollout | ArgumentError:
    """Return the rollout, or the one error that may come instead."""
    try:
        return Rollout.load(path)
    except ArgumentError as error:
        return error


def test_a_part_of_a_file(written: bytes, tmp_path: Path) -> None:
    path = tmp_path / "part.npz"
    for length in range(0, len(written), 97):
        path.write_bytes(written[:length])
        assert "not a .npz file, or it is truncated" in refused(path)


def test_damaged_files_are_refused_or_whole(written: bytes, rollout: Rollout, tmp_path: Path) -> None:
    """Whatever byte is changed: an ArgumentError, or a byte that says nothing about the rollout."""
    path, lost = tmp_path / "damaged.npz", 0
    for place in range(0, len(written), 53):
        path.write_bytes(written[:place] + bytes([written[place] ^ 0xFF]) + written[place + 1 :])
        read = loaded(path)
        if isinstance(read, ArgumentError):
            assert path.name in str(read)
            lost += 1
        else:
            np.testing.assert_array_equal(read.q, rollout.q[:4])
    assert lost > 100


@pytest.mark.parametrize("name", ["run.csv", "array.npy", "archive.zip", "empty.npz"])
def test_foreign_files(rollout: Rollout, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name.startswith("run"):
        rollout.save(path)
    elif name == "array.npy":
        np.save(path, np.zeros(3))
    elif name == "archive.zip":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("letter.txt", "nothing")
    else:
        path.touch()
    refused(path)


@pytest.mark.parametrize(
    ("entry", "value", "said"),
    [
        ("robot", "no JSON", "robot"),
        ("robot", "[]", "robot"),
        ("robot", json.dumps({"urdf": "<robot/>", "base": "fixed", "gravity": [0, 0, 0]}), "robot"),
        ("q", np.zeros((4, 5)), r"q in .* is float64 \(4, 5\); wanted float64 \(4, 6\)"),
        ("tau", np.zeros(()), "tau in"),
        ("t", np.zeros(4, dtype=int), "int64"),
        ("saturated", np.zeros((3, 6)), "saturated"),
        ("reference_v", np.zeros((3, 6)), "reference_v"),
        ("rotors", np.zeros(6), "rotors"),
    ],
)
def test_a_file_whose_parts_do_not_fit(
    written: bytes, tmp_path: Path, entry: str, value: object, said: str
) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(written)
    with np.load(path) as file:
        entries = dict(file)
    entries[entry] = value
    np.savez(path, **entries)
    with pytest.raises(ArgumentError, match=said):
        Rollout.load(path)


# -- the picture ---------------------------------------------------------------------------------


def test_a_plot_in_an_unknown_format(rollout: Rollout, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    for name in ("run.doc", "run"):
        with pytest.raises(ArgumentError, match=r"\.png, \.pdf or \.svg"):
            rollout.plot(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_many_joints_stand_in_several_columns() -> None:
    pytest.importorskip("matplotlib")
    robot = load("talos", base="floating")
    moved = simulate(robot, PD(robot, kp=1.0, kd=1.0), robot.neutral(), duration=2e-3, check_reference=False)
    figure = moved.plot()
    assert len(figure.axes) == 3 * 4
    labels = [
        [text.get_text() for text in axis.get_legend().get_texts()]
        for axis in figure.axes
        if axis.get_legend()
    ]
    assert labels[0] == ["base x", "base y", "base z", "reference"]
    joints = [name for column in labels[1:] for name in column if name != "reference"]
    assert joints == list(robot.joint_names)
    assert max(map(len, labels)) <= 13


def test_a_plot_says_what_is_in_metres() -> None:
    pytest.importorskip("matplotlib")
    panda = load("panda")
    figure = simulate(panda, v0=np.full(panda.nv, 0.01), duration=3e-3).plot()
    positions, speeds, efforts = figure.axes
    assert positions.get_ylabel() == "position [rad; m]"
    assert speeds.get_ylabel() == "velocity [rad/s; m/s]"
    assert efforts.get_ylabel() == "torque [N m; N]"
    labels = [text.get_text() for text in efforts.get_legend().get_texts()]
    assert labels[-1] == "panda_finger_joint1 [m]"
    assert labels[0] == "panda_joint1"


def test_a_plot_draws_the_limits_that_cut(rollout: Rollout) -> None:
    pytest.importorskip("matplotlib")
    efforts = rollout.plot().axes[2]
    heights = {line.get_ydata()[0] for line in efforts.lines if len(line.get_ydata()) == 2}
    assert heights == {20.0, -20.0}
    assert "effort limit" in [text.get_text() for text in efforts.get_legend().get_texts()]


def test_a_plot_shows_names_as_they_are() -> None:
    pytest.importorskip("matplotlib")
    text = pendulum("$r$", "_a$b$")
    figure = simulate(load(text), v0=[1.0], duration=3e-3).plot()
    (label,) = figure.axes[2].get_legend().get_texts()
    assert label.get_text() == r" _a\$b\$"


# -- the page ------------------------------------------------------------------------------------


@pytest.mark.parametrize("module", [csv_file, ros_messages])
def test_the_page_says_what_the_modules_say(module: ModuleType) -> None:
    page = (Path(__file__).parents[3] / "docs" / "rollout_files.md").read_text(encoding="utf-8").splitlines()
    told = [line for line in str(module.__doc__).splitlines() if line.startswith("|")]
    assert len(told) > 5
    assert not set(told) - set(page)


def test_the_columns_are_those_that_are_documented(rollout: Rollout, tmp_path: Path) -> None:
    rollout.save(tmp_path / "run.csv")
    header, _ = table(tmp_path / "run.csv")
    kinds = list(dict.fromkeys(name.split(":")[0] for name in header))
    lines = [line.split("|")[1] for line in str(csv_file.__doc__).splitlines() if line.startswith("| `")]
    documented = [name.strip("`").split(":")[0] for line in lines for name in line.strip().split(", ")]
    # Contacts are those of a rollout in a scene, samples those of one with sensors.
    assert kinds == [name for name in documented if name not in ("contact", "sensor", "")]


def test_the_topics_are_those_that_are_documented(rollout: Rollout) -> None:
    floating = load("solo12", base="floating")
    goal = floating.neutral()
    law = PD(floating, kp=1.0, kd=0.1)
    moved = simulate(floating, law, goal, duration=1e-3, check_reference=False)
    ball = load('<mujoco><worldbody><body><joint type="ball"/><geom size="0.5"/></body></worldbody></mujoco>')
    turned = simulate(ball, PD(ball, kp=1.0, kd=0.1), ball.neutral(), duration=1e-3)
    topics = [*ros_messages.topics_of(moved), *ros_messages.topics_of(turned)]
    found = [f"| `{topic.name}` | {topic.message} |" for topic in topics]
    lines = [line for line in str(ros_messages.__doc__).splitlines() if line.startswith("| `")]
    documented = {" ".join(line.split(" ")[:4]) + " |" for line in lines}
    always = {line for line in documented if "/contacts/" not in line and "/sensors/" not in line}
    assert always == set(found)
