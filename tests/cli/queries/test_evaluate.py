"""`dynx info`, `robots`, `backends`, `fk`, `jacobian`, `id`, `fd`, `mass`, `ik`: documents and refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.cli.shell.inputs import default_frame
from dynx.cli.shell.main import cli
from dynx.cli.shell.options import number_list
from dynx.cli.shell.output import counted
from dynx.ik import IKSolutions
from dynx.model.loading import load
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.rbd.parameters import Payload, plant_model
from dynx.spatial.so3 import quat_from_rotation, rpy_from_rotation
from dynx.world import read_scene
from dynx.world.scene.scene import MARGIN
from tests.conftest import EXAMPLES_INSTALLED
from tests.oracles.closed_form import MODELS

Q = [0.1, -1.5, 1.4, 0.2, 0.3, -0.4]
Q_TEXT = ",".join(map(repr, Q))


def document(*arguments: str) -> dict[str, Any]:
    """Return the JSON document that a command writes."""
    result = CliRunner().invoke(cli, [*arguments, "--json"])
    assert result.exit_code == 0, result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


@given(
    st.lists(
        st.floats(allow_nan=False, allow_infinity=False).filter(lambda x: abs(x) < MAX_MAGNITUDE), min_size=1
    )
)
def test_a_list_of_numbers_is_read_exactly(numbers: list[float]) -> None:
    assert number_list(",".join(map(repr, numbers))) == numbers
    assert number_list(" ".join(map(repr, numbers))) == numbers


def test_info() -> None:
    found = document("info", "ur5")
    model = load("ur5")
    assert found["name"] == model.name
    assert found["base"] == "fixed"
    assert (found["nq"], found["nv"]) == (6, 6)
    assert tuple(found["joint_names"]) == model.joint_names
    assert tuple(found["frame_names"]) == model.frame_names
    assert found["total_mass"] == model.total_mass
    assert found["notes"] == []
    assert len(found["joints"]) == len(model.joints)


def test_info_of_a_floating_robot_with_a_locked_joint() -> None:
    found = document("info", "ur5", "--base", "floating", "--lock", "elbow_joint=0.5")
    assert (found["nq"], found["nv"]) == (12, 11)
    assert [j["locked_at"] for j in found["joints"] if j["name"] == "elbow_joint"] == [0.5]


def test_robots_are_all_listed() -> None:
    names = {entry["name"]: entry for entry in document("robots")["robots"]}
    assert {"pendulum", "six_axis_arm"} <= set(names)
    assert not EXAMPLES_INSTALLED or {"ur5", "panda", "talos", "xarm7", "z1"} <= set(names)
    assert set(names["pendulum"]) == {"name", "aliases", "source", "path"}


def test_wrenches_of_joints_under_external_forces() -> None:
    forces = (
        "--force",
        "tool0:0,0,-20",
        "--force",
        "wrist_1_link:1,2,3,0.1,0.2,0.3",
        "--force",
        "tool0:0,0,1",
    )
    given: dict[str, Any] = {
        "external_forces": {"tool0": [0, 0, -19, 0, 0, 0], "wrist_1_link": [1, 2, 3, 0.1, 0.2, 0.3]}
    }
    found = document("id", "ur5", "--q", Q_TEXT, *forces, "--wrenches")
    at_tool = document(
        "id", "ur5", "--q", Q_TEXT, *forces, "--wrenches", "--frame", "tool0", "--reference", "world"
    )
    with backend(found["backend"], load("ur5")) as engine:
        sample = Q, np.zeros(6), np.zeros(6)
        assert found["tau"] == engine.inverse_dynamics(*sample, **given).tolist()
        assert found["joint_wrenches"] == engine.joint_wrenches(*sample, **given).tolist()
        assert found["base_wrench"] == engine.base_wrench(*sample, **given).tolist()
        given |= {"frame": "tool0", "reference": "world"}
        assert at_tool["joint_wrenches"] == engine.joint_wrenches(*sample, **given).tolist()
        names = [joint.name for joint in engine.model.joints]
    assert found["joint_names_of_wrenches"] == names
    assert "joint_wrenches" not in document("id", "ur5", *forces)
    text = CliRunner().invoke(cli, ["id", "ur5", *forces, "--wrenches"]).stdout
    for name in (*names, "(base)", "mz [N m]", "its child link, local axes"):
        assert name in text
    for wrong, says in (
        (["--force", "tool0:1,2"], "not of the form FRAME:fx,fy,fz"),
        (["--force", "1,2,3"], "not of the form FRAME:fx,fy,fz"),
        (["--force", "tol0:1,2,3"], "did you mean 'tool0'"),
        (["--frame", "tool0"], "give --wrenches too"),
        (["--wrenches", "--frame", "tol0"], "did you mean 'tool0'"),
    ):
        result = CliRunner().invoke(cli, ["id", "ur5", *wrong])
        assert result.exit_code == 2
        assert says in result.stderr


def test_quantities_with_a_payload() -> None:
    """At rest it is a weight; its centre of mass and several payloads count."""
    bodies = ("--payload", "tool0:3:0,0,0.05", "--payload", "wrist_1_link:0.5")
    model = plant_model(load("ur5"), [Payload("tool0", 3.0, (0, 0, 0.05)), Payload("wrist_1_link", 0.5)])
    with backend("pinocchio", model) as engine:
        a = np.linspace(0.1, 0.6, 6)
        found = document("id", "ur5", "--q", Q_TEXT, "--a", ",".join(map(str, a)), *bodies)
        assert found["tau"] == engine.inverse_dynamics(Q, np.zeros(6), a).tolist()
        assert (
            document("mass", "ur5", "--q", Q_TEXT, *bodies)["mass_matrix"] == engine.mass_matrix(Q).tolist()
        )
        fallen = engine.forward_dynamics(Q, np.zeros(6), np.zeros(6))
        assert document("fd", "ur5", "--q", Q_TEXT, *bodies)["a"] == fallen.tolist()
    assert [each["mass"] for each in found["payload"]] == [3.0, 0.5]
    assert document("id", "ur5")["payload"] == []
    weight = document("id", "ur5", "--q", Q_TEXT, "--force", f"tool0:0,0,{-3 * 9.81}")
    hung = document("id", "ur5", "--q", Q_TEXT, "--payload", "tool0:3")
    np.testing.assert_allclose(hung["tau"], weight["tau"], rtol=0, atol=1e-12 * max(map(abs, hung["tau"])))
    for wrong, says in (("tool0", "not of the form FRAME:MASS"), ("tol0:1", "did you mean 'tool0'")):
        result = CliRunner().invoke(cli, ["id", "ur5", "--payload", wrong])
        assert (result.exit_code, says in result.stderr) == (2, True)


def test_fd_under_external_forces() -> None:
    """It inverts id with the same forces; those on one frame add up."""
    forces = ("--force", "tool0:0,0,-20", "--force", "tool0:0,0,1,0.1,0.2,0.3")
    found = document("fd", "ur5", "--q", Q_TEXT, *forces)
    assert found["external_forces"] == {"tool0": [0, 0, -19, 0.1, 0.2, 0.3]}
    with backend(found["backend"], load("ur5")) as engine:
        given: Any = found["external_forces"]
        a = engine.forward_dynamics(Q, np.zeros(6), np.zeros(6), external_forces=given)
        tau = engine.inverse_dynamics(Q, np.zeros(6), a, external_forces=given)
    assert found["a"] == a.tolist()
    np.testing.assert_allclose(tau, 0.0, rtol=0, atol=1e-10)
    wrong = CliRunner().invoke(cli, ["fd", "ur5", "--force", "tol0:1,2,3"])
    assert (wrong.exit_code, "did you mean 'tool0'" in wrong.stderr) == (2, True)


def test_backends() -> None:
    found = {entry["name"]: entry for entry in document("backends")["backends"]}
    assert found["reference"]["installed"] is True


def test_id_is_the_backends() -> None:
    v, a = [0.1] * 6, [0.2] * 6
    vectors = ["--v", ",".join(map(repr, v)), "--a", ",".join(map(repr, a))]
    found = document("id", "ur5", "--q", Q_TEXT, *vectors, "--backend", "reference")
    assert found["tau"] == backend("reference", load("ur5")).inverse_dynamics(Q, v, a).tolist()


def test_fd_is_the_backends() -> None:
    found = document("fd", "ur5", "--q", Q_TEXT, "--tau", "shoulder_lift_joint=10", "--backend", "reference")
    tau = [0.0, 10.0, 0.0, 0.0, 0.0, 0.0]
    assert found["tau"] == tau
    assert found["a"] == backend("reference", load("ur5")).forward_dynamics(Q, np.zeros(6), tau).tolist()


def test_fk_jacobian_and_mass_are_the_backends() -> None:
    engine = backend("reference", load("ur5"))
    frame = default_frame(engine.model)
    options = ["ur5", "--q", Q_TEXT, "--backend", "reference"]
    assert frame == "tool0"
    assert document("fk", *options)["T_world_frame"] == engine.forward_kinematics(Q, frame).tolist()
    assert document("jacobian", *options)["jacobian"] == engine.jacobian(Q, frame).tolist()
    assert document("mass", *options)["mass_matrix"] == engine.mass_matrix(Q).tolist()


def test_every_solution_is_shown() -> None:
    engine = backend("reference", load("ur5"))
    T = engine.forward_kinematics(Q, "tool0")
    pose = ",".join(map(repr, T.ravel().tolist()))
    options = ["ur5", "--to-pose", pose, "--frame", "tool0", "--backend", "reference", "--all-solutions"]
    expected = engine.inverse_kinematics(T, "tool0", all_solutions=True)
    assert isinstance(expected, IKSolutions)
    found = document("ik", *options)
    assert [solution["q"] for solution in found["solutions"]] == expected.q.tolist()
    assert [solution["branch"] for solution in found["solutions"]] == list(expected.branches)
    shown = CliRunner().invoke(cli, ["ik", *options])
    assert shown.exit_code == 0
    assert all(branch in shown.stdout for branch in expected.branches)
    far = CliRunner().invoke(
        cli, ["ik", "ur5", "--to-pose", "9,0,0,0,0,0", "--frame", "tool0", "--all-solutions"]
    )
    assert far.exit_code == 1
    assert "no solution" in far.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["panda", "--to-pose", "0.4,0,0.4,0,0,0", "--frame", "panda_link8"], "with --given panda_j"),
        (["panda", "--to-pose", "0.4,0,0.4,0,0,0", "--frame", "panda_link8", "--given", "panda_join7=0"],
         "panda_joint7"),
        (["ur5", "--to-pose", "0.4,0,0.4"], "whole pose"),
        (["ur5", "--to-pose", "0.4,0,0.4,0,0,0", "--free", "position"], "whole pose"),
        (["ur5", "--to-pose", "0.4,0,0.4,0,0,0", "--given", "1,2"], "such as joint7=0.5"),
    ],
)  # fmt: skip
def test_what_has_no_closed_form_is_refused(arguments: list[str], message: str) -> None:
    refused = CliRunner().invoke(cli, ["ik", *arguments, "--backend", "reference", "--all-solutions"])
    assert refused.exit_code == 2
    assert message in refused.stderr


def test_a_given_joint_needs_all_solutions() -> None:
    refused = CliRunner().invoke(cli, ["ik", "panda", "--to-pose", "0.4,0,0.4", "--given", "panda_joint7=0"])
    assert refused.exit_code == 2
    assert "--all-solutions" in refused.stderr


def test_ik_of_a_rotation_or_a_position_alone() -> None:
    engine = backend("reference", load("ur5"))
    options = ["--frame", "tool0", "--backend", "reference"]
    T = engine.forward_kinematics(Q, "tool0")
    quat, rpy = quat_from_rotation(T[:3, :3]).tolist(), rpy_from_rotation(T[:3, :3]).tolist()
    for target in (T[:3, :3].ravel().tolist(), quat, rpy, [9.0, 9.0, 9.0, *rpy]):
        numbers = ",".join(map(repr, target))
        found = document("ik", "ur5", "--to-pose", numbers, "--free", "position", *options)
        reached = engine.forward_kinematics(found["q"], "tool0")
        assert np.abs(reached[:3, :3] - T[:3, :3]).max() < 2e-6
        assert (found["free"], found["position_error"]) == ("position", None)
        assert found["rotation_error"] < 1e-6
    numbers = ",".join(map(repr, T.ravel().tolist()))
    found = document("ik", "ur5", "--to-pose", numbers, "--free", "rotation", *options)
    assert np.abs(engine.forward_kinematics(found["q"], "tool0")[:3, 3] - T[:3, 3]).max() < 1e-6
    assert (found["free"], found["rotation_error"]) == ("rotation", None)
    shown = CliRunner().invoke(cli, ["ik", "ur5", "--to-pose", "0,0,0", "--free", "position", *options])
    assert " rad, after " in shown.stdout
    assert " m " not in shown.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["0,0,0,2", "--free", "position"], "the quaternion has norm 2; wanted 1"),
        (["0,0", "--free", "position"], "wanted a rotation of 3 numbers (roll, pitch, yaw), 4 (a"),
        (["0,0,0", "--free", "positon"], "did you mean 'position'?"),
    ],
)
def test_ik_refuses_a_target_that_is_no_rotation(arguments: list[str], message: str) -> None:
    result = CliRunner().invoke(cli, ["ik", "ur5", "--backend", "reference", "--to-pose", *arguments])
    assert result.exit_code == 2
    assert message in result.stderr


def test_ik_reaches_a_pose_of_fk_and_reports_an_unreachable_one() -> None:
    options = ["--frame", "tool0", "--backend", "reference"]
    T = np.array(document("fk", "ur5", "--q", Q_TEXT, *options)["T_world_frame"])
    found = document("ik", "ur5", "--target", ",".join(map(repr, T.ravel().tolist())), *options)
    assert found["success"] is True
    assert len(found["q"]) == 6
    far = CliRunner().invoke(cli, ["ik", "asr_twodof", "--target", "99,0,0", "--backend", "reference"])
    assert far.exit_code == 1
    assert "not reached" in far.stdout


@pytest.mark.parametrize(
    ("arguments", "clue"),
    [
        (["id", "ur5", "--q", "1,2"], "--q has 2 numbers; ur5 needs 6: shoulder_pan_joint, "),
        (["id", "ur5", "--v", "1"], "--v has 1 number; ur5 needs 6: shoulder_pan_joint, "),
        (["id", "ur5", "--a", "1,2,3,4,5,6,7"], "--a has 7 numbers; ur5 needs 6: "),
        (
            ["fd", "talos", "--base", "floating", "--tau", "1"],
            "--tau has 1 number; talos needs 38: base vx, ",
        ),
        (["fk", "talos", "--base", "floating", "--q", "1"], "--q has 1 number; talos needs 39: x, y, z, qx"),
        (["ik", "ur5", "--target", "0,0,0", "--q", "0,0,0"], "--q has 3 numbers; ur5 needs 6"),
        (["ik", "ur5", "--target", "0,0,0", "--q", "1e80,0,0,0,0,0"], "--q': '1e80' is not below 1e+60"),
        (["fk", "panda", "--q", "panda_finger_joint2=0.01"], "it follows 'panda_finger_joint1'"),
        (["id", "ur5", "--lock", "elbow_joint=1", "--v", "elbow_joint=1"], "it is locked"),
        (["id", "ur5", "--q", "0,nan,0,0,0,0"], "finite"),
        (["id", "ur5", "--q", "0,one,0,0,0,0"], "'one'"),
        (["id", "ur5", "--q", "elbow_joint=1,elbo=2"], "elbow_joint"),
        (["id", "ur5", "--backend", "nosuch"], "nosuch"),
        (["fk", "ur5", "--frame", "tool"], "tool0"),
        (["fk", "ur5", "--base", "floating", "--q", ",".join("0" * 13)], "quaternion"),
        (["ik", "ur5"], "--target"),
        (["ik", "ur5", "--target", "1,2"], "3 numbers"),
        (["ik", "ur5", "--target", "0,0,0,0,0,0,2"], "quaternion"),
        (["info", "ur"], "did you mean"),
        (["info", "/"], "directory"),
    ],
)
def test_unusable_input_is_one_line(arguments: list[str], clue: str) -> None:
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 2
    assert clue in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""


def test_a_position_has_no_rotation_error() -> None:
    options = ["ur5", "--target", "0.4,0.2,0.3", "--backend", "reference"]
    assert document("ik", *options)["rotation_error"] is None
    assert " rad" not in CliRunner().invoke(cli, ["ik", *options]).stdout
    posed = document("ik", "ur5", "--target", "0.4,0.2,0.3,0,0,0", "--backend", "reference")
    assert 0.0 <= posed["rotation_error"] < 1e-6


def test_counts_are_singular_or_plural() -> None:
    assert [counted(count, "restart") for count in (0, 1, 2)] == ["0 restarts", "1 restart", "2 restarts"]


@pytest.mark.parametrize("command", [["fk"], ["jacobian"], ["ik", "--target", "0.4,0.2,0.3"]])
def test_the_default_frame_is_named(command: list[str]) -> None:
    arguments = [command[0], "ur5", *command[1:], "--backend", "reference"]
    assert "tool0 ends" in CliRunner().invoke(cli, arguments).stdout
    assert "--frame chooses" in CliRunner().invoke(cli, arguments).stdout
    assert "--frame chooses" not in CliRunner().invoke(cli, [*arguments, "--frame", "tool0"]).stdout


@pytest.mark.parametrize("width", [40, 60, 80, 120, None])
@pytest.mark.parametrize("command", ["mass", "jacobian"])
def test_a_wide_matrix_is_complete(command: str, width: int | None, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = [
        command,
        "talos",
        "--base",
        "floating",
        "--backend",
        "reference",
        "--q",
        "arm_left_4_joint=-1",
    ]
    found = document(*arguments)
    matrix = found["mass_matrix" if command == "mass" else "jacobian"]
    if width is not None:
        monkeypatch.setenv("COLUMNS", str(width))
    lines = CliRunner().invoke(cli, arguments).stdout.splitlines()
    names = found["velocity_names"]
    rows = (
        names if command == "mass" else [f"{kind} {axis}" for kind in ("linear", "angular") for axis in "xyz"]
    )
    for name, numbers in zip(rows, matrix, strict=True):
        # The legend of the columns numbers the names, so no line of it starts with one.
        shown = [line.removeprefix(f" {name} ").split() for line in lines if line.startswith(f" {name} ")]
        assert [cell for part in shown for cell in part] == [f"{number + 0.0:.5g}" for number in numbers]
    legend = " ".join(line.strip() for line in lines[lines.index("") :])
    assert all(f"{k} {name}" in legend for k, name in enumerate(names))
    if width is not None and width >= 60:
        assert max(len(line) for line in lines[2:]) <= width


@pytest.mark.parametrize(
    "arguments", [["robots"], ["backends"], ["info", "panda"], ["mass", "ur5"], ["id", "ur5"], ["fk", "ur5"]]
)
def test_piped_lines_have_no_trailing_blanks(arguments: list[str]) -> None:
    lines = CliRunner().invoke(cli, arguments).stdout.split("\n")
    assert lines[0] != ""
    assert [line for line in lines if line != line.rstrip()] == []


@pytest.mark.parametrize("width", ["40", "60"])
def test_no_name_of_a_tree_is_truncated(width: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", width)
    shown = CliRunner().invoke(cli, ["info", "talos"]).stdout
    assert all(f"{joint.name} ({joint.type})" in shown for joint in load("talos").joints)
    assert all(link.name in shown for link in load("talos").links)


class TestBasePose:
    """The pose of a fixed base, in the forms of ``--target``."""

    @pytest.mark.parametrize(
        ("numbers", "position", "rpy"),
        [
            ("0,0,1", [0, 0, 1], [0, 0, 0]),
            ("0.5,-1,2,0.1,0.2,0.3", [0.5, -1, 2], [0.1, 0.2, 0.3]),
            ("1,2,3,0,0,0.7071067811865476,0.7071067811865476", [1, 2, 3], [0, 0, np.pi / 2]),
        ],
    )
    def test_it_is_where_the_root_is(self, numbers: str, position: list[float], rpy: list[float]) -> None:
        root = load("ur5").root
        found = document("fk", "ur5", "--frame", root, "--base-pose", numbers)
        assert np.allclose(found["position"], position, rtol=0, atol=1e-15)
        assert np.allclose(found["rpy"], rpy, rtol=0, atol=1e-15)
        assert np.allclose(
            document("info", "ur5", "--base-pose", numbers)["base_pose"],
            [*position, *rpy],
            rtol=0,
            atol=1e-15,
        )

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (["--base-pose", "1,2"], "--base-pose: wanted 3 numbers (position), 6"),
            (["--base-pose", "0,0,1", "--base", "floating"], "a floating base has its pose in q"),
            (["--base-pose", "0,0,x"], "'x' is not a number"),
        ],
    )
    def test_refusals(self, arguments: list[str], message: str) -> None:
        result = CliRunner().invoke(cli, ["fk", "ur5", *arguments])
        assert result.exit_code == 2
        assert message in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["info", "pendulum"],
        ["backends"],
        ["robots", "pendulum"],
        ["explain", "DX101"],
        ["fk", "pendulum"],
        ["mass", "pendulum"],
        ["id", "pendulum"],
        ["sim", "pendulum", "--controller", "none", "--duration", "0.01"],
        ["agree", "pendulum", "--backends", "reference", "--samples", "1"],
    ],
    ids=" ".join,
)
def test_json_is_a_file_or_standard_output_in_every_command(arguments: list[str], tmp_path: Path) -> None:
    path = tmp_path / "out.json"
    to_file = CliRunner().invoke(cli, [*arguments, "--json", str(path)])
    assert to_file.exit_code == 0, to_file.stderr
    assert not to_file.stdout.startswith("{")
    assert to_file.stdout
    for last in (["--json", "-"], ["--json"]):
        result = CliRunner().invoke(cli, [*arguments, *last])
        assert json.loads(result.stdout).keys() == json.loads(path.read_text()).keys()
    nowhere = CliRunner().invoke(cli, [*arguments, "--json", str(tmp_path / "none" / "out.json")])
    assert nowhere.exit_code == 2
    assert "none" in nowhere.stderr


@pytest.mark.parametrize("spelling", ["local-world-aligned", "local_world_aligned"])
def test_names_of_python_are_spelled_with_hyphens_or_as_in_python(spelling: str) -> None:
    found = document("jacobian", "pendulum", "--reference", spelling)
    assert found["reference"] == "local_world_aligned"
    result = CliRunner().invoke(cli, ["jacobian", "pendulum", "--reference", "wrld"])
    assert result.exit_code == 2
    assert "did you mean 'world'?" in result.stderr


@pytest.mark.parametrize("option", ["--to-pose", "--target"])
def test_a_target_pose_has_one_name_in_ik_and_sim(option: str) -> None:
    assert document("ik", "planar_3r", option, "0.5,0.4,0")["target"] == [0.5, 0.4, 0.0]
    simulated = CliRunner().invoke(cli, ["sim", "six_axis_arm", option, "1,2", "--plant", "reference"])
    assert "--to-pose: wanted 3 numbers" in simulated.stderr


def test_the_list_of_robots_fits_80_columns() -> None:
    lines = CliRunner(env={"COLUMNS": "80"}).invoke(cli, ["robots"]).stdout.splitlines()
    # The folder of a package is wherever that is installed.
    assert max(len(line) for line in lines if ": /" not in line) <= 80


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A scene with a box in front of the arm."""
    file = tmp_path / "cell.toml"
    file.write_text(
        'schema = "dynx.scene/1"\nname = "cell"\n[[bodies]]\nname = "box"\n'
        "shape = { box = [0.2, 0.2, 0.3] }\npose = [0.45, 0.1, 0.1, 0.0, 0.0, 0.0]\n",
        encoding="utf-8",
    )
    return file


def test_margins_from_a_scene_are_kept(cell: Path) -> None:
    """A box is avoided where that is possible, and named where it is not."""
    options = ["ur5", "--frame", "ee_link", "--backend", "reference", "--avoid", str(cell)]
    beside = document("ik", *options, "--to-pose", "0.45,0.1,0.35", "--margin", "0.02")
    assert beside["status"] == "REACHED"
    avoidance = read_scene(cell).avoidance_for(load("ur5"), margin=0.02)
    assert avoidance.is_clear(backend("reference", load("ur5")), np.array(beside["q"]))
    inside = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "0.45,0.1,0.1,3.14159,0,0"])
    assert inside.exit_code == 1
    assert "in collision" in inside.stdout
    assert "box" in inside.stdout
    refused = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "0.45,0.1,0.35,0,0,0", "--margin", "-1"])
    assert refused.exit_code == 2
    assert "margin is" in refused.stderr
    alone = CliRunner().invoke(cli, ["ik", "ur5", "--to-pose", "0.4,0.1,0.3", "--margin", "0.1"])
    assert alone.exit_code == 2
    assert "give the scene" in alone.stderr


def test_all_solutions_say_which_are_in_collision(cell: Path) -> None:
    options = ["ur5", "--frame", "ee_link", "--backend", "reference", "--all-solutions", "--avoid", str(cell)]
    pose = ["--to-pose", "0.5,0.1,0.4,0,1.57,0"]
    found = document("ik", *options, *pose)
    avoidance = read_scene(cell).avoidance_for(load("ur5"), margin=MARGIN)
    engine = backend("reference", load("ur5"))
    clear = [avoidance.is_clear(engine, np.array(each["q"])) for each in found["solutions"]]
    assert [each["collision"] == "" for each in found["solutions"]] == clear
    assert any(clear)
    assert not all(clear)
    assert found["avoid"] == str(cell)
    shown = CliRunner().invoke(cli, ["ik", *options, *pose])
    assert shown.exit_code == 0
    assert f"{sum(clear)} of {len(clear)} keep all margins" in shown.stdout
    assert shown.stdout.count("  in collision: ") == len(clear) - sum(clear)
    inside = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "0.45,0.1,0.1,0,1.57,0"])
    assert inside.exit_code == 1
    assert "0 of " in inside.stdout


def test_ik_states_status_message_and_proof() -> None:
    options = ["ur5", "--frame", "tool0", "--backend", "reference"]
    found = document("ik", *options, "--to-pose", "0.4,0.2,0.3,0,0,0")
    assert (found["status"], found["proof"], found["note"]) == ("REACHED", "", "")
    assert found["message"].startswith("reached, ")
    far = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "9,0,0", "--json", "-"])
    result = json.loads(far.stdout)
    assert far.exit_code == 1
    assert result["status"] == "UNREACHABLE"
    assert "the chain reaches at most" in result["proof"]
    assert result["message"].endswith(result["proof"])
    printed = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "9,0,0"]).stdout
    assert f"out of reach: {result['proof']}" in " ".join(printed.split())


@pytest.mark.parametrize("extra", [["--all-solutions"], ["--free", "position"], []])
def test_angles_beyond_a_full_turn_are_noted(extra: list[str]) -> None:
    """Angles in degrees are read as radians, with a note."""
    options = ["ik", "ur5", "--backend", "reference", "--frame", "tool0", *extra, "--to-pose"]
    hint = "-90 degrees would be -1.5708"
    noted = CliRunner().invoke(cli, [*options, "0.4,0.2,0.3,-90,0,0"])
    assert hint in " ".join(noted.stdout.split())
    assert hint not in " ".join(CliRunner().invoke(cli, [*options, "0.4,0.2,0.3,-6,0,0"]).stdout.split())
    if "--free" in extra:
        assert hint in " ".join(CliRunner().invoke(cli, [*options, "0,0,-90"]).stdout.split())


@pytest.mark.parametrize(
    ("robot", "given", "frame", "remedy"),
    [
        ("panda", [], "panda_hand_tcp", "panda_joint7=0.5"),
        ("panda", ["--given", "panda_joint7=0.5"], "panda_hand_tcp", "panda_joint7=0.5"),
        ("z1", [], "gripperStator", None),
    ],
)
def test_a_frame_before_the_gripper_is_suggested(
    robot: str, given: list[str], frame: str, remedy: str | None
) -> None:
    """The frame that is suggested has a closed form."""
    options = ["ik", robot, "--backend", "reference", "--all-solutions", "--to-pose", "0.4,0,0.4,3,0,0"]
    refused = CliRunner().invoke(cli, [*options, *given])
    assert refused.exit_code == 2
    assert "was chosen by default; there is a closed form with --frame " + frame in refused.stderr
    more = [] if remedy is None else ["--given", remedy]
    assert CliRunner().invoke(cli, [*options, "--frame", frame, *more]).exit_code in (0, 1)
    named = CliRunner().invoke(cli, [*options, "--frame", "world" if robot == "z1" else "panda_leftfinger"])
    assert "by default" not in named.stderr


def test_no_other_frame_is_suggested_for_seven_joints_of_an_arm() -> None:
    options = ["--backend", "reference", "--all-solutions", "--to-pose", "0.4,0,0.4,3,0,0"]
    refused = CliRunner().invoke(cli, ["ik", str(MODELS / "seven_axis_arm.urdf"), *options])
    assert refused.exit_code == 2
    assert refused.stderr.rstrip().endswith(" was chosen by default")


def test_a_search_that_is_stopped_by_its_timeout_says_so() -> None:
    target = ("--to-pose", "0,0,0.09,0,0,0", "--frame", "tool0", "--backend", "reference")
    result = CliRunner().invoke(cli, ["ik", "ur5", *target, "--timeout", "1e-9"])
    assert result.exit_code == 1, result.stderr
    assert "stopped by --timeout, target not reached: smallest error" in " ".join(result.stdout.split())
    found = json.loads(CliRunner().invoke(cli, ["ik", "ur5", *target, "--timeout", "1e-9", "--json"]).stdout)
    assert (found["success"], found["status"]) == (False, "TIMED_OUT")
    refused = CliRunner().invoke(cli, ["ik", "ur5", *target, "--timeout", "0"])
    assert refused.exit_code == 2


KEYED = """<mujoco model="arm">
  <worldbody><body name="b"><joint name="j" ref="0"/><geom size="0.1" pos="1 0 0"/></body></worldbody>
  <keyframe><key name="home" qpos="0.5"/><key name="far out" qpos="-0.25"/></keyframe>
</mujoco>"""


def test_configurations_of_the_file_are_shown_and_taken_by_name(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(KEYED)
    assert document("info", str(path))["configurations"] == {"home": [0.5], "far out": [-0.25]}
    shown = CliRunner().invoke(cli, ["info", str(path)])
    assert "named configurations (2): home, far out" in shown.stdout
    for name, q in (("home", "0.5"), ("far out", "-0.25")):
        assert document("fk", str(path), "--q", name) == document("fk", str(path), "--q", q)
    moved = document("sim", str(path), "--from", "home", "--to", "far out", "--duration", "0.1")
    assert (moved["motion"]["from"], moved["motion"]["to"]) == ([0.5], [-0.25])


def test_a_name_that_looks_like_numbers_and_a_note_on_a_short_keyframe(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    second = '<body name="c"><joint name="k"/><geom size="0.1"/></body></body></worldbody>'
    text = KEYED.replace("</body></worldbody>", second).replace(
        '"far out" qpos="-0.25"', '"0.2,3" qpos="1 2"'
    )
    path.write_text(text)
    given = document("fk", str(path), "--q", "name:0.2,3")
    assert given == document("fk", str(path), "--q", "1,2")
    assert given != document("fk", str(path), "--q", "0.2,3")
    short = CliRunner().invoke(cli, ["fk", str(path), "--q", "home"])
    assert "qpos of keyframe 'home' has 1 of 2 numbers" in " ".join(short.stderr.split())
    other = CliRunner().invoke(cli, ["fk", str(path), "--q", "name:0.2,3"])
    assert "qpos of keyframe" not in other.stderr


def test_data_of_the_file_is_counted_and_named(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    data = (
        '<tendon><fixed name="t" range="0 1"><joint joint="j" coef="2"/></fixed></tendon>'
        '<equality><joint joint1="j"/></equality><actuator><motor name="m" tendon="t"/></actuator>'
        '<sensor><jointpos name="s" joint="j"/></sensor></mujoco>'
    )
    path.write_text(KEYED.replace("</mujoco>", data).replace('name="b"', 'name="b" gravcomp="0.5"'))
    shown = CliRunner().invoke(cli, ["info", str(path)]).stdout
    for line in (
        "actuators (1): m (t)",
        "sensors (1): s (jointpos j)",
        "tendons (1): t (j)",
        "equality constraints (1): joint j",
        "gravity compensation (1): b (0.5)",
        "named configurations (2): home, far out",
    ):
        assert line in shown
    found = document("info", str(path))
    assert found["tendons"][0]["terms"] == [["j", 2.0]]
    assert found["tendons"][0]["range"] == [0.0, 1.0]
    assert found["actuators"][0]["control_range"] == [None, None]
    assert found["equalities"][0]["first"] == "j"
    assert found["gravity_compensation"][0]["factor"] == 0.5
    assert found["initial_configuration"] == [0.0]
    assert document("info", "planar_2r")["tendons"] is None


@pytest.mark.parametrize(
    ("robot", "q", "message"),
    [
        ("arm.xml", "hom", "--q: no configuration 'hom' of arm; did you mean 'home'"),
        ("ur5", "home", "its description has none; wanted 6 numbers, such as"),
        ("ur5", "nan", "'nan' is not finite"),
        ("ur5", "1;2", "'1;2' is not a number"),
        ("arm.xml", "j=0.7,hom", "'hom' among the values is no joint=value; wanted 0,1.5,... or joint="),
        ("arm.xml", "name:0,1", "no configuration '0,1' of arm"),
    ],
)
def test_other_names_of_configurations_are_refused(tmp_path: Path, robot: str, q: str, message: str) -> None:
    (tmp_path / "arm.xml").write_text(KEYED)
    result = CliRunner().invoke(cli, ["fk", robot if robot == "ur5" else str(tmp_path / robot), "--q", q])
    assert result.exit_code == 2
    assert message in " ".join(result.stderr.split())
