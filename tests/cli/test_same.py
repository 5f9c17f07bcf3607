"""`dynx same`: verdict, elements, mended file, exit codes, and the document."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import dynx
from dynx.cli.shell.main import cli
from dynx.model.library import find
from dynx.same import same_robot


@pytest.fixture
def changed(tmp_path: Path) -> Path:
    """Return a file of UR5 with another mass of the forearm and another place of the elbow."""
    text = Path(find("ur5")).read_text(encoding="utf-8")
    path = tmp_path / "changed.urdf"
    text = text.replace('<mass value="2.275"/>', '<mass value="2.3"/>')
    path.write_text(text.replace('"0.0 -0.1197 0.425"', '"0.0 -0.12 0.425"'))
    return path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["same", *map(str, arguments)])


def test_the_same_robot() -> None:
    result = run("ur5", "ur5")
    assert result.exit_code == 0
    assert "the same robot" in result.output.splitlines()[0]
    assert "bounds over all states" in result.output


def test_elements_are_listed_with_their_lines(changed: Path) -> None:
    result = run("ur5", changed)
    assert result.exit_code == 1
    assert "different robots" in result.output.splitlines()[0]
    for name in ("forearm_link, inertial", "elbow_joint, origin"):
        assert name in result.output
    assert run("ur5", changed, "--tolerance", "0.5").exit_code == 0
    assert run("ur5", changed, "--quiet").output == ""


def test_the_mended_file_is_the_same_robot(changed: Path, tmp_path: Path) -> None:
    out = tmp_path / "mended.urdf"
    result = run("ur5", changed, "--fix", out)
    assert result.exit_code == 1
    assert run("ur5", out).exit_code == 0
    before = changed.read_bytes()
    assert run("ur5", changed, "--fix", changed).exit_code == 2
    assert changed.read_bytes() == before


@pytest.mark.parametrize("name", ["mended.xml", "mended.mjcf", "mended.sdf", "mended.txt", "mended", "urdf"])
def test_the_suffix_of_the_mended_file_is_that_of_the_format(
    name: str, changed: Path, tmp_path: Path
) -> None:
    out = tmp_path / name
    result = run("ur5", changed, "--fix", out)
    assert result.exit_code == 2
    assert ".urdf" in result.stderr
    assert not out.exists()
    # The same robot is not written, and the suffix is wrong nevertheless.
    assert run("ur5", "ur5", "--fix", out).exit_code == 2


def test_a_mended_mjcf_file_is_not_named_urdf(changed: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "first.xml", tmp_path / "second.xml"
    text = dynx.load("ur5").to_mjcf()
    first.write_text(text)
    second.write_text(dynx.load(changed).to_mjcf())
    for name in ("mended.urdf", "mended.txt"):
        result = run(first, second, "--fix", tmp_path / name)
        assert result.exit_code == 2
        assert ".xml or .mjcf" in result.stderr
        assert not (tmp_path / name).exists()
    assert run(first, second, "--fix", tmp_path / "mended.xml").exit_code == 1
    assert run(first, tmp_path / "mended.xml").exit_code == 0


def test_a_file_with_nothing_to_mend_is_said_not_to_be_written(tmp_path: Path) -> None:
    out = tmp_path / "mended.xml"
    text = dynx.load("ur5").to_mjcf()
    first, second = tmp_path / "first.xml", tmp_path / "second.xml"
    first.write_text(text)
    sensor = '<sensor><jointpos name="angle" joint="elbow_joint"/></sensor>'
    second.write_text(text.replace("</mujoco>", f"{sensor}</mujoco>"))
    for other, said in ((second, "nothing to mend (other differences are not mended): "), (first, "mend: ")):
        result = run(first, other, "--fix", out)
        assert result.exit_code == 0
        words = " ".join(result.output.split())
        assert said in words
        assert "is not written" in words
        assert not out.exists()


def test_directories_are_not_made(changed: Path, tmp_path: Path) -> None:
    result = run("ur5", changed, "--fix", tmp_path / "deep" / "mended.urdf")
    assert result.exit_code == 2
    assert "deep" in result.stderr
    assert not (tmp_path / "deep").exists()


def test_inputs_are_not_overwritten(changed: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.urdf"
    other.write_bytes(Path(find("ur5")).read_bytes())
    link = tmp_path / "link.urdf"
    link.symlink_to(changed)
    before = changed.read_bytes(), other.read_bytes()
    for out in (other, changed, link):
        assert run(other, changed, "--fix", out).exit_code == 2
        assert (changed.read_bytes(), other.read_bytes()) == before


def test_included_files_are_not_overwritten(tmp_path: Path) -> None:
    text = dynx.load("ur5").to_mjcf()
    start, end = text.index("<worldbody>"), text.index("</worldbody>") + len("</worldbody>")
    included = tmp_path / "arm.xml"
    included.write_text(f"<mujocoinclude>{text[start:end]}</mujocoinclude>")
    first = tmp_path / "first.xml"
    first.write_text(text[:start] + '<include file="arm.xml"/>' + text[end:])
    second = tmp_path / "second.xml"
    second.write_text(text)
    before = included.read_bytes()
    for pair in ((first, second), (second, first)):
        assert run(*pair).exit_code == 0
        assert run(*pair, "--fix", included).exit_code == 2
    assert included.read_bytes() == before


def test_a_file_that_cannot_be_mended_is_an_error(tmp_path: Path) -> None:
    out = tmp_path / "mended.urdf"
    result = run("g1", "g1_with_hands", "--fix", out)
    assert result.exit_code == 2
    assert "is not written" in result.stderr
    assert not out.exists()


def test_bases_that_differ_are_called_so(tmp_path: Path) -> None:
    """MJCF states its base; that of URDF is the one of the other file."""
    model = dynx.load("solo12", base="floating")
    fixed, floating = tmp_path / "fixed.xml", tmp_path / "floating.xml"
    fixed.write_text(model.with_base("fixed").to_mjcf())
    floating.write_text(model.to_mjcf())
    result = run(fixed, floating)
    assert result.exit_code == 1
    assert "counterpart" not in result.output
    assert "with_base('fixed')" in result.output
    for path in (fixed, floating):
        assert run("solo12", path).exit_code == 0


def test_long_lists_are_shortened_in_tables(tmp_path: Path) -> None:
    text = dynx.load("six_axis_arm").to_urdf(geometry=True)
    shapes = "".join(f'<visual><geometry><box size="1 1 {k}"/></geometry></visual>' for k in range(1, 40))
    other = tmp_path / "other.urdf"
    at = text.index("<inertial")
    other.write_text(text[:at] + shapes + text[at:])
    result = run("six_axis_arm", other)
    assert "visual shapes" in result.output
    assert max(map(len, result.output.splitlines())) < 160
    # Equal beginnings of two long lists do not hide what differs.
    third = tmp_path / "third.urdf"
    moved = shapes.replace("<visual>", '<visual><origin xyz="1 0 0"/>').replace('1 1 9"', '1 1 99"')
    third.write_text(text[:at] + moved + text[at:])
    (row,) = [line for line in run(other, third).output.splitlines() if "visual shapes" in line]
    first, second = [cell for cell in row.split("  ") if cell.strip()][-2:]
    assert first.strip() != second.strip()
    found = json.loads(run("six_axis_arm", other, "--json").stdout)["attributes"]
    assert max(len(each["second"]) for each in found) > 500


def test_the_document(changed: Path) -> None:
    result = run("ur5", changed, "--json")
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert (found["schema"], found["same"], found["second"]) == ("dynx.same/1", False, str(changed))
    assert {(each["part"], each["theirs"]) for each in found["differences"]} == {
        ("inertial", "forearm_link"),
        ("origin", "elbow_joint"),
    }
    report = same_robot("ur5", changed)
    assert found == {**json.loads(json.dumps(report.to_dict())), "seconds": found["seconds"]}


def test_unusable_input(tmp_path: Path) -> None:
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot name='r'>\n<link name='a'>\n</robot>")
    for arguments, said in (
        (("ur5", tmp_path / "none.urdf"), "none.urdf"),
        (("ur5", broken), "broken.urdf:"),
        (("ur5", "ur5", "--tolerance", "2"), "--tolerance"),
        (("ur5", "ur5", "--json", tmp_path / "no" / "file.json"), "no"),
    ):
        result = run(*arguments)
        assert result.exit_code == 2
        assert said in result.stderr


def test_the_document_does_not_replace_a_file_that_is_read_or_mended(changed: Path, tmp_path: Path) -> None:
    before = changed.read_bytes()
    result = run("ur5", changed, "--json", changed)
    assert result.exit_code == 2
    assert "a file that is read" in result.output
    assert changed.read_bytes() == before
    out, link = tmp_path / "mended.urdf", tmp_path / "link"
    link.symlink_to(out)
    for name in (out, link):
        result = run("ur5", changed, "--fix", out, "--json", name)
        assert result.exit_code == 2
        assert "--fix" in result.output
        assert not out.exists()
    # A robot beside itself is no output.
    assert run(changed, changed, "--fix", out, "--json", tmp_path / "same.json").exit_code == 0


def test_reports_are_written_and_a_baseline_accepts(changed: Path, tmp_path: Path) -> None:
    names = {"--html": "r.html", "--sarif": "r.sarif", "--junit": "r.xml", "--json": "r.json"}
    files = [word for option, name in names.items() for word in (option, tmp_path / name)]
    known = tmp_path / "known.json"
    result = run("ur5", changed, *files, "--write-baseline", known, "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    for name in names.values():
        assert "forearm_link" in (tmp_path / name).read_text(encoding="utf-8")
    accepted = run("ur5", changed, "--baseline", known, "--github")
    assert accepted.exit_code == 0
    assert "::error" not in accepted.output
    assert "2 known, 0 new, 0 gone" in accepted.output
    text = changed.read_text(encoding="utf-8").replace('<mass value="8.393"/>', '<mass value="8.5"/>')
    changed.write_text(text, encoding="utf-8")
    worse = run("ur5", changed, "--baseline", known, "--github", "--html", tmp_path / "r.html")
    assert worse.exit_code == 1
    assert worse.output.count("::error") == 1
    assert "new: link-inertial link 'upper_arm_link'" in worse.output
    assert "2 known, 1 new, 0 gone" in worse.output


@pytest.mark.parametrize("option", ["--html", "--sarif", "--junit", "--write-baseline"])
def test_reports_replace_no_file_that_is_read(option: str, changed: Path) -> None:
    before = changed.read_bytes()
    result = run("ur5", changed, option, changed)
    assert result.exit_code == 2
    assert "would be overwritten" in result.output
    assert changed.read_bytes() == before
    assert run("ur5", changed, option, changed.parent / "none" / "r").exit_code == 2


def test_json_and_annotations_need_two_outputs(changed: Path) -> None:
    result = run("ur5", changed, "--github", "--json")
    assert result.exit_code == 2
    assert "--github and --json -" in result.output


def test_the_mended_file_is_named_also_if_the_robots_are_the_same(tmp_path: Path) -> None:
    body = '<worldbody><body name="a"><joint name="j"/>INERTIAL</body></worldbody>'
    body = body.replace("INERTIAL", '<inertial pos="0 0.1 0" mass="1" diaginertia="1 1 1"/>')
    text = f'<mujoco>{body}<keyframe><key name="home" qpos="0.1"/></keyframe></mujoco>'
    first, second, out = (tmp_path / name for name in ("first.xml", "second.xml", "mended.xml"))
    first.write_text(text)
    for other, code, written in (
        (text, 0, False),
        (text.replace('0.1"/></keyframe>', '0.2"/></keyframe>'), 0, True),
        (text.replace('mass="1"', 'mass="2"'), 1, True),
    ):
        second.write_text(other)
        result = run(first, second, "--fix", out)
        assert result.exit_code == code
        assert ("mended file: " in result.output) == written == out.exists()
        assert ("is not written" in result.output) != written
        document = json.loads(run(first, second, "--fix", out, "--json", "-").stdout)
        assert document["mended_file"] == (str(out) if written else None)
        out.unlink(missing_ok=True)
