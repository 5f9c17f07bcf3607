"""`dynx convert`: the files that it writes, its notes, exit codes, and the document."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import dynx
from dynx.cli.shell.main import cli
from dynx.errors import ArgumentError
from dynx.model import Pose
from dynx.model.conversion import convert, robot_differences
from dynx.model.urdf.writer import urdf_text


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["convert", *map(str, arguments)])


def test_a_robot_is_written_with_its_meshes_and_is_the_same(tmp_path: Path) -> None:
    out = tmp_path / "arm.xml"
    result = run("double_pendulum", "--to", "mjcf", "-o", out)
    assert result.exit_code == 0, result.output
    assert "limit of speed" in result.stderr
    assert "the same robot" in result.stdout
    assert [*robot_differences(dynx.load("double_pendulum"), dynx.load(out))] == []
    assert (tmp_path / "arm_assets").is_dir()
    again = tmp_path / "again.urdf"
    assert run(out, "-o", again).exit_code == 0
    assert [*robot_differences(dynx.load("double_pendulum"), dynx.load(again))] == []


@pytest.mark.parametrize("to", ["mjcf", "sdf", "urdf"])
def test_without_a_file_the_document_is_printed(to: str) -> None:
    result = run("double_pendulum", "--to", to)
    assert result.exit_code == 0
    assert [*robot_differences(dynx.load("double_pendulum"), dynx.load(result.stdout))] == []


def test_the_document(tmp_path: Path) -> None:
    found = json.loads(run("double_pendulum", "--to", "mjcf", "--json").stdout)
    assert (found["same"], found["written"], found["format"]) == (True, [], "mjcf")
    assert found["text"] is not None
    out = tmp_path / "p.xml"
    found = json.loads(run("double_pendulum", "-o", out, "--json").stdout)
    assert (found["text"], found["written"][-1]) == (None, str(out))


def test_options_of_the_robot_count(tmp_path: Path) -> None:
    out = tmp_path / "p.xml"
    options = ["--base", "floating", "--gravity", "0,0,-1.62", "--lock", "joint2=0.5"]
    assert run("double_pendulum", "-o", out, *options).exit_code == 0
    back = dynx.load(out)
    assert (back.base, back.gravity, back.joint("joint2").locked_at) == ("floating", (0.0, 0.0, -1.62), 0.5)


def test_no_file_is_replaced_unless_it_is_allowed(tmp_path: Path) -> None:
    out = tmp_path / "p.xml"
    out.write_text("mine")
    result = run("double_pendulum", "-o", out)
    assert result.exit_code == 2
    assert "--overwrite" in result.output
    assert out.read_text() == "mine"
    assert run("double_pendulum", "-o", out, "--overwrite").exit_code == 0
    assert run(out, "-o", out, "--overwrite").exit_code == 2


def test_a_robot_that_would_be_another_one_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(model: dynx.Model, **options: Any) -> str:
        return urdf_text(model.with_base_pose(Pose((1.0, 0.0, 0.0))), **options)

    monkeypatch.setattr("dynx.model.conversion.urdf_text", wrong)
    out = tmp_path / "r.urdf"
    result = run("double_pendulum", "-o", out)
    assert result.exit_code == 1
    assert "pose of the base" in result.output
    assert not out.exists()
    found = json.loads(run("double_pendulum", "-o", out, "--json").stdout)
    assert found["same"] is False
    assert found["differences"]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["double_pendulum"], "--to"),
        (["double_pendulum", "--to", "mjfc"], "mjcf"),
        (["double_pendulum", "-o", "a.urd"], ".urdf"),
        (["double_pendulum", "--to", "urdf", "-o", "a.xml"], ".urdf"),
        (["double_pendulm", "--to", "urdf"], "double_pendulum"),
        (["double_pendulum", "-o", "no/such/folder/a.xml"], "no/such/folder"),
    ],
)
def test_wrong_arguments_are_named(arguments: list[str], word: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert word in result.output


SERVO = """<mujoco model="arm"><worldbody>
<body name="a"><joint name="j" stiffness="2"/><geom size="1"/></body>
</worldbody><actuator><position joint="j"/></actuator></mujoco>"""


def test_what_was_not_read_is_named_apart_from_what_the_format_cannot_say(tmp_path: Path) -> None:
    source, out = tmp_path / "arm.xml", tmp_path / "out.urdf"
    source.write_text(SERVO)
    result = run(source, "-o", out)
    assert result.exit_code == 0
    for word in ("<actuator>", "<dynx_spring>", "arm.xml, line"):
        assert word in result.stderr
    assert "1 note on reading" in result.stdout
    found = json.loads(run(source, "-o", out, "--overwrite", "--json").stdout)
    assert [*map(str, dynx.load(source).notes)] == found["source_notes"]
    assert not any("<actuator>" in each for each in found["notes"])
    assert "note" not in run("double_pendulum", "-o", tmp_path / "p.xml").stdout


def test_the_document_and_the_json_are_two_files(tmp_path: Path) -> None:
    out = tmp_path / "z.xml"
    for json_path in (out, tmp_path / "z_assets" / ".." / "z.xml"):
        (tmp_path / "z_assets").mkdir(exist_ok=True)
        result = run("double_pendulum", "-o", out, "--json", json_path)
        assert result.exit_code == 2
        assert "--json" in result.output
        assert not out.exists()
    source = tmp_path / "arm.xml"
    source.write_text(SERVO)
    assert run(source, "--to", "urdf", "--json", source).exit_code == 2
    assert source.read_text() == SERVO


def test_documents_of_one_name_share_equal_meshes(tmp_path: Path) -> None:
    first, second, third = (tmp_path / f"x{suffix}" for suffix in (".urdf", ".xml", ".mjcf"))
    assert run("double_pendulum", "-o", first).exit_code == 0
    result = run(first, "-o", second)
    assert result.exit_code == 0, result.output
    assert run("double_pendulum", "-o", third).exit_code == 0
    mesh = next(path for path in (tmp_path / "x_assets").rglob("*") if path.is_file())
    mesh.write_bytes(b"mine")
    third.unlink()
    result = run("double_pendulum", "-o", third)
    assert result.exit_code == 2
    assert mesh.name in result.output
    assert mesh.read_bytes() == b"mine"


@pytest.mark.skipif(sys.platform == "win32", reason="links need a right")
@pytest.mark.parametrize("inner", [False, True])
def test_meshes_are_not_written_through_links(tmp_path: Path, inner: bool) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    out = tmp_path / "x.xml"
    if inner:
        assert run("double_pendulum", "-o", out).exit_code == 0
        mesh = next(path for path in (tmp_path / "x_assets").rglob("*") if path.is_file())
        mesh.unlink()
        mesh.symlink_to(outside / "new")
    else:
        (tmp_path / "x_assets").symlink_to(outside, target_is_directory=True)
    result = run("double_pendulum", "-o", out, "--overwrite")
    assert result.exit_code == 2
    assert "is a link" in result.output
    assert not list(outside.iterdir())
    with pytest.raises(ArgumentError, match="is a link"):
        convert(dynx.load("double_pendulum"), "mjcf", "x").write(out)
    assert not list(outside.iterdir())
