"""`dynx doctor` and `dynx agree --as-loaded` from end to end: real files, real engines, every output."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner, Result

from dynx.agreement.tolerances import BAR
from dynx.cli.doctor.files import write_mended
from dynx.cli.doctor.run import FIX_TOLERANCE
from dynx.cli.shell.main import cli
from dynx.doctor.diagnosis import DEFAULT_SAMPLES, diagnose
from dynx.errors import ArgumentError
from dynx.loaded import installed_engines
from dynx.rules.registry import find_trap
from tests.doctor.formats.test_sarif import require_valid

QUICK = ["--engines", "pinocchio,pybullet", "--samples", "2", "--jobs", "1"]

ARM = """<?xml version="1.0" encoding="ISO-8859-1"?>
<robot name="arm">
  <!-- für den Greifer -->
  <link name="base"/>
  <link name="tool">
    <inertial>
      <mass value="1.5"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
    </inertial>
  </link>
  <link name="camera"/>
  <joint name="elbow" type="continuous">
    <parent link="base"/>
    <child link="tool"/>
    <axis xyz="1 0 0"/>
  </joint>
  <joint name="mount" type="fixed">
    <parent link="tool"/>
    <child link="camera"/>
    <origin xyz="0 0 0.5"/>
  </joint>
</robot>
"""
"""The camera weighs 1 kg in PyBullet and nothing in Pinocchio."""

SOUND = ARM.replace('<link name="camera"/>', "").replace(ARM[ARM.index('  <joint name="mount"') : -9], "")


def doctor(*arguments: str) -> Result:
    """Run ``dynx doctor`` with two engines."""
    return CliRunner().invoke(cli, ["doctor", *arguments, *QUICK])


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a file on which PyBullet and Pinocchio differ, in the working directory."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "arm.urdf"
    path.write_bytes(ARM.encode("latin-1"))
    return path


def test_a_difference_is_named_mended_and_gone(arm: Path, tmp_path: Path) -> None:
    files = {key: str(tmp_path / f"out.{key}") for key in ("json", "html", "junit", "sarif")}
    options = [word for key, path in files.items() for word in (f"--{key}", path)]
    result = doctor("arm.urdf", "--fix", "mended.urdf", *options)
    assert result.exit_code == 1, result.stderr
    assert "DX101 link-without-inertial" in result.stdout
    assert "link camera" in result.stdout
    assert "p.loadURDF(path" in result.stdout
    assert "mended: mended.urdf" in result.stdout

    [entry] = json.loads(Path(files["json"]).read_text())["results"]
    assert (entry["robot"], entry["base"], entry["explained"]) == ("arm.urdf", "fixed", True)
    found = [each for each in entry["findings"] if each["link"] == "camera" and each["rule"] == "DX101"]
    assert found[0]["line"] == ARM[: ARM.index('<link name="camera"')].count("\n") + 1
    assert found[0]["proved"] is True
    assert "DX101" in Path(files["html"]).read_text()
    assert ElementTree.parse(files["junit"]).getroot().get("failures") != "0"
    require_valid(json.loads(Path(files["sarif"]).read_text()))

    mended = (tmp_path / "mended.urdf").read_bytes()
    assert "für den Greifer".encode("latin-1") in mended
    assert arm.read_bytes() == ARM.encode("latin-1")
    again = doctor("mended.urdf")
    assert again.exit_code == 0, again.stdout
    assert "all engines load it alike" in again.stdout


@pytest.mark.parametrize("command", ["doctor", "agree"])
def test_the_hint_repeats_the_examination(arm: Path, command: str) -> None:
    own = ["--base", "floating", "--samples", "3", "--seed", "7"]
    if command == "doctor":
        more = [
            "--tolerance",
            "1e-09",
            "--choose",
            "DX103=keep",
            "--choose",
            "DX202=fixed",
            "--level",
            "rounding",
        ]
        run = ["doctor", "my arm.urdf", *own, *more, "--engines", "pinocchio,pybullet", "--jobs", "1"]
    else:
        more = []
        run = ["agree", "my arm.urdf", "--as-loaded", *own, "--backends", "pinocchio,pybullet"]
    arm.rename("my arm.urdf")
    first = CliRunner().invoke(cli, run)
    [hint] = [line for line in first.stdout.splitlines() if "dynx doctor" in line]
    words = shlex.split(hint.partition(": dynx ")[2])
    assert words[:2] == ["doctor", "my arm.urdf"]
    for option in ["--engine", *own[::2], *more[::2]]:
        assert option in words
    fixed = words + ([] if "--fix" in words else ["--fix", "OUT.urdf"])
    again = CliRunner().invoke(cli, [*fixed, "--jobs", "1"])
    assert ": OUT.urdf" in again.stdout
    assert Path("OUT.urdf").exists()
    if command == "doctor":
        # Only the hint and the time differ.
        ends = "\nto mend it", "\nmended at level"
        before, after = (
            each.stdout.partition(end)[0] for each, end in zip((first, again), ends, strict=True)
        )
        assert before == after


def test_an_engine_whose_result_is_undefined_does_not_refuse_the_file(arm: Path) -> None:
    arm.write_text(SOUND.replace('<axis xyz="1 0 0"/>', "<axis/>"), encoding="latin-1")
    files = ["--json", "x.json", "--html", "x.html", "--junit", "x.xml", "--sarif", "x.sarif"]
    result = doctor("arm.urdf", *files)
    assert result.exit_code == 1, result.stderr
    [entry] = json.loads(Path("x.json").read_text())["results"]
    [pybullet] = [each for each in entry["engines"] if each["engine"] == "pybullet"]
    keys = ("refused", "refused_after", "not_used_after")
    assert [pybullet[key] for key in keys] == [None, None, None]
    assert "memory that it did not initialise" in pybullet["not_used"]
    [finding] = [each for each in entry["findings"] if each["rule"] == "DX202"]
    assert finding["effects"]["pybullet"]["quantity"] == "result"
    written = [result.stdout, *(Path(file).read_text() for file in files[1::2])]
    for text in written[:1] + written[2:4]:
        assert "not used: pybullet reads the axis" in text.replace("Not used", "not used")
    for text in written:
        for reader in ("MuJoCo 4.0", "Drake 1.51", "dynx", "Dynx"):
            text = text.replace(f"{reader} refuses", "")
        assert "refuses" not in text
        assert "refused by" not in text
    [sarif] = json.loads(written[-1])["runs"]
    assert "refused" not in next(each for each in sarif["results"] if each["ruleId"] == "DX202")["message"]
    compared = CliRunner().invoke(
        cli, ["agree", "arm.urdf", "--as-loaded", "--backends", "pinocchio,pybullet"]
    )
    assert "pybullet is not used on the file" in compared.stdout


def test_a_baseline_accepts_known_differences_and_no_others(arm: Path) -> None:
    assert doctor("arm.urdf", "--write-baseline", "known.json", "--quiet").exit_code == 0
    # The same finding on another line is the same finding.
    arm.write_bytes(ARM.replace("<robot", "\n\n<robot").encode("latin-1"))
    known = doctor("arm.urdf", "--baseline", "known.json")
    assert known.exit_code == 0
    assert "0 new, 0 gone" in known.stdout
    arm.write_bytes(ARM.replace('"camera"', '"kamera"').encode("latin-1"))
    other = doctor("arm.urdf", "--baseline", "known.json")
    assert other.exit_code == 1
    assert "new: DX101 link 'kamera'" in other.stdout
    assert "gone: DX101 link 'camera'" in other.stdout


@pytest.mark.long_cases
@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["--ignore", "DX101"], 0),
        (["--ignore", "DX301,link-without-inertial"], 0),
        (["--ignore", "DX301", "--ignore", "dx101"], 0),
        (["--only", "DX105"], 0),
        (["--only", "DX105,DX101"], 1),
        (["--only", "DX101", "--ignore", "DX101"], 0),
        (["--ignore", "DX301"], 1),
        ([], 1),
    ],
)
def test_rules_that_are_ignored_fail_no_check(arm: Path, options: list[str], code: int) -> None:
    result = doctor("arm.urdf", *options, "--json", "out.json", "--fix", "mended.urdf")
    assert result.exit_code == code, result.stderr
    (entry,) = json.loads(Path("out.json").read_text())["results"]
    assert entry["ignored"] == ({} if code else {"DX101": 1})
    assert ("1 finding ignored: DX101 link-without-inertial (1)" in result.stdout) == (not code)
    assert doctor("mended.urdf").exit_code == 0  # The causes of all rules are mended.


def test_files_are_mended_in_place_only_with_in_place(arm: Path) -> None:
    assert doctor("arm.urdf", "--fix", "./arm.urdf").exit_code == 2
    assert arm.read_bytes() == ARM.encode("latin-1")
    arm.chmod(0o640)
    assert doctor("arm.urdf", "--in-place", "--quiet").exit_code == 1
    assert arm.read_bytes() != ARM.encode("latin-1")
    assert arm.stat().st_mode & 0o777 == 0o640
    mended = arm.read_bytes()
    assert doctor("arm.urdf", "--in-place", "--quiet").exit_code == 0
    assert arm.read_bytes() == mended


def test_a_file_that_is_replaced_is_named(arm: Path, tmp_path: Path) -> None:
    help_text = " ".join(CliRunner().invoke(cli, ["doctor", "--help"]).stdout.split())
    assert "A file of that name is replaced" in help_text
    replaced = "replaced the file out.urdf that was there"
    assert replaced not in doctor("arm.urdf", "--fix", "out.urdf").stdout
    mended = (tmp_path / "out.urdf").read_bytes()
    (tmp_path / "out.urdf").write_text("of somebody")
    assert replaced in doctor("arm.urdf", "--fix", "out.urdf").stdout
    assert (tmp_path / "out.urdf").read_bytes() == mended
    several = ["out.urdf", "arm.urdf", "--fix", "mended"]
    assert "2 files written, 1 of them unchanged\n" in doctor(*several).stdout
    assert "2 files written, 1 of them unchanged; 2 of that name replaced" in doctor(*several).stdout
    assert "replaced" not in doctor("out.urdf", "--in-place").stdout


def test_a_directory_that_is_not_there_is_made_and_a_file_without_an_ending_is_called_one(
    arm: Path, tmp_path: Path
) -> None:
    (tmp_path / "leg.urdf").write_bytes(arm.read_bytes())
    doctor("arm.urdf", "leg.urdf", "--fix", "new/mended")
    assert sorted(each.name for each in (tmp_path / "new/mended").iterdir()) == ["arm.urdf", "leg.urdf"]
    assert "mended: one/arm.urdf\n" in doctor("arm.urdf", "--fix", "one/").stdout
    assert "mended: two (a file; two/ would be a directory)" in doctor("arm.urdf", "--fix", "two").stdout
    assert (tmp_path / "two").is_file()


def test_several_robots_and_bases(arm: Path, tmp_path: Path) -> None:
    (tmp_path / "robots" / "deep").mkdir(parents=True)
    (tmp_path / "robots" / "deep" / "sound.urdf").write_text(SOUND, encoding="latin-1")
    (tmp_path / "robots" / "bad.urdf").write_text("no XML")
    arm.rename(tmp_path / "robots" / "arm.urdf")
    result = doctor("robots", "nosuch", "--json", "-", "--html", "all.html", "--fix", "mended")
    assert result.exit_code == 2
    made: dict[str, Any] = json.loads(result.stdout)
    assert [each["robot"] for each in made["results"]] == [
        "robots/arm.urdf", "robots/bad.urdf", "robots/deep/sound.urdf", "nosuch",
    ]  # fmt: skip
    assert made["summary"] == {
        "robots": 4, "alike": 1, "explained": 1, "massless": 0, "unexplained": 0, "refused": 2, "not_done": 0,
    }  # fmt: skip
    assert "4 robots: 1 alike, 1 explained, 0 unexplained, 2 refused" in result.stderr
    done = {line.partition("] ")[2] for line in result.stderr.splitlines() if line.startswith("[")}
    assert "robots/arm.urdf: engines differ, for 1 cause, all proved" in done
    assert "robots/deep/sound.urdf: all engines load it alike" in done
    written = {str(path.relative_to(tmp_path / "mended")) for path in (tmp_path / "mended").rglob("*.urdf")}
    assert written == {"arm.urdf", os.path.join("deep", "sound.urdf")}
    copied = (tmp_path / "mended" / "deep" / "sound.urdf").read_bytes()
    assert copied == SOUND.encode("latin-1")
    both = doctor("robots/arm.urdf", "--base", "both", "--json", "-")
    assert [each["base"] for each in json.loads(both.stdout)["results"]] == ["fixed", "floating"]


def test_mended_files_of_equal_names_and_of_both_bases_are_apart_and_indented_as_theirs(
    arm: Path, tmp_path: Path
) -> None:
    """Two robots of one name on two bases are four files; what is inserted has the blanks of its place."""
    deep = ARM.replace("  ", "\t")
    for folder, text in (("left", ARM), ("right", deep)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "arm.urdf").write_bytes(text.encode("latin-1"))
    doctor("left/arm.urdf", "right/arm.urdf", "--base", "both", "--fix", "mended")
    written = {
        path.relative_to(tmp_path / "mended").as_posix() for path in (tmp_path / "mended").rglob("*.*")
    }
    assert written == {
        f"{side}/arm-{base}.urdf" for side in ("left", "right") for base in ("fixed", "floating")
    }
    for name in written:
        original = set((deep if name.startswith("right") else ARM).splitlines())
        blanks = "\t" if name.startswith("right") else "  "
        lines = (tmp_path / "mended" / name).read_text(encoding="latin-1").splitlines()
        inserted = [line for line in lines if line not in original]
        assert any(line.strip() == '<mass value="0"/>' for line in inserted), name
        depth = 0
        for line in lines:
            element = line.strip()
            depth -= element.startswith("</")
            if line in inserted:
                assert line == blanks * depth + element, (name, line)
            depth += (
                element.startswith("<") and not element.startswith(("</", "<!", "<?")) and "/" not in element
            )


@pytest.mark.parametrize(
    ("arguments", "clue"),
    [
        (["--engines", "bulet"], "pybullet"),
        (["--choose", "DX101"], "rule=choice"),
        (["--choose", "DX000=keep"], "DX000"),
        (["--choose", "DX103=nosuch"], "nosuch"),
        (["--choose", "DX105=keep"], "leaves no choice"),
        (["--ignore", "inertia-not-diagonl"], "did you mean 'inertia-not-diagonal'"),
        (["--only", "DX101,DX9"], "no rule 'DX9'"),
        (["--only", ","], "wanted names separated by commas"),
        (["--base", "both", "--in-place"], "--base fixed or"),
        (["--in-place", "--fix", "x.urdf"], "exclude"),
        (["--baseline", "none.json"], "none.json"),
        (["--baseline", "arm.urdf"], "arm.urdf"),
        (["--json", "x", "--html", "x"], "two formats"),
        (["--sarif", "nosuch/x.sarif"], "nosuch"),
        (["--tolerance", "-1"], "--tolerance"),
        (["panda", "--fix", "arm.urdf"], "arm.urdf"),
        (["--json", "arm.urdf"], "a robot that is read"),
        (["--write-baseline", "./arm.urdf"], "a robot that is read"),
        (["--fix", "x.urdf", "--html", "./x.urdf"], "the file of a mended description"),
    ],
)
def test_arguments_that_cannot_be_used_cost_no_work(arguments: list[str], clue: str, arm: Path) -> None:
    result = CliRunner().invoke(cli, ["doctor", "arm.urdf", *arguments])
    assert result.exit_code == 2
    assert clue in result.stderr
    assert result.stderr.count("\n") == 1
    assert sorted(os.listdir()) == ["arm.urdf"]


def test_a_baseline_is_written_over_by_a_baseline_alone(arm: Path) -> None:
    known = ["arm.urdf", "--baseline", "known.json", "--quiet"]
    assert doctor("arm.urdf", "--write-baseline", "known.json", "--quiet").exit_code == 0
    assert doctor(*known, "--write-baseline", "known.json").exit_code == 0
    refused = doctor(*known, "--json", "known.json")
    assert refused.exit_code == 2
    assert "the baseline" in refused.stderr
    assert doctor(*known).exit_code == 0


def test_as_loaded_is_not_written_over_what_is_read(arm: Path) -> None:
    for option in ([], ["--as-loaded"]):
        result = CliRunner().invoke(cli, ["agree", "arm.urdf", *option, "--json", "arm.urdf"])
        assert result.exit_code == 2
        assert "a robot that is read" in result.stderr
    assert arm.read_bytes() == ARM.encode("latin-1")


def test_a_write_protected_file_is_not_mended_in_place(arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A new file could be put in its place, for which the permissions of the directory suffice.
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK or Path(path).name != "arm.urdf")
    result = doctor("arm.urdf", "--in-place", "--quiet")
    assert result.exit_code == 2
    assert "permission denied" in result.stderr
    assert arm.read_bytes() == ARM.encode("latin-1")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_that_nobody_reads_is_not_waited_for(arm: Path) -> None:
    os.mkfifo("pipe")
    result = doctor("arm.urdf", "--fix", "pipe", "--quiet")
    assert result.exit_code == 2
    assert "nobody reads from this pipe" in result.stderr


def test_a_file_that_changed_meanwhile_is_left_as_it_is(arm: Path) -> None:
    report = diagnose(str(arm), engines=["pinocchio", "pybullet"], samples=2)
    newer = arm.read_bytes().replace(b"0.5", b"0.6")
    arm.write_bytes(newer)
    with pytest.raises(ArgumentError, match="changed by another program"):
        write_mended(str(arm), report, over_input=True)
    assert arm.read_bytes() == newer


def test_the_help_states_the_defaults_of_the_library() -> None:
    text = " ".join(CliRunner().invoke(cli, ["doctor", "--help"]).stdout.split())
    assert f"Number of random states per robot (default: {DEFAULT_SAMPLES})" in text
    assert f"{BAR:g} by default" in text
    assert f"{FIX_TOLERANCE:.0e} by default".replace("e-0", "e-") in text


def test_in_place_never_touches_the_library(arm: Path) -> None:
    result = CliRunner().invoke(cli, ["doctor", "ur5", "--in-place"])
    assert result.exit_code == 2
    assert "--in-place needs files" in result.stderr


def test_as_loaded_prints_calls_errors_and_the_vote(arm: Path) -> None:
    options = ["--backends", "pinocchio,pybullet", "--samples", "2", "--json", "x.json"]
    result = CliRunner().invoke(cli, ["agree", "arm.urdf", "--as-loaded", *options])
    assert result.exit_code == 1, result.output
    for words in (
        "pinocchio.buildModelFromUrdf(",
        "p.loadURDF(path",
        "mass matrix",
        "pybullet is off by up to",
    ):
        assert words in result.stdout
    assert "pinocchio matches the reference values of the file" in result.stdout
    assert "dynx doctor arm.urdf" in result.stdout
    [entry] = json.loads(Path("x.json").read_text())["results"]
    assert [each for each in entry["findings"] if each["effect"]] == []
    assert {tuple(pair["engines"]) for pair in entry["pairs"]} == {("pinocchio", "pybullet")}
    several = CliRunner().invoke(cli, ["agree", "arm.urdf", "nosuch", "--as-loaded", *options[:4]])
    assert several.exit_code == 2
    assert "1 differ, 1 refused" in several.stdout


def test_as_loaded_takes_no_lock(arm: Path) -> None:
    result = CliRunner().invoke(cli, ["agree", "arm.urdf", "--as-loaded", "--lock", "elbow=1"])
    assert result.exit_code == 2
    assert "--lock" in result.stderr


@pytest.mark.parametrize(("robot", "most"), [("ur5", 40), (str(find_trap("DX115")), 25)])
def test_a_report_fits_one_screen_and_shows_the_plain_call(robot: str, most: int) -> None:
    result = CliRunner().invoke(cli, ["doctor", robot, "--jobs", "1"])
    assert result.exit_code == 0
    assert len(result.stdout.splitlines()) <= most
    if "pybullet" in installed_engines():
        call = "robot = p.loadURDF(path, useFixedBase=True)"
        assert f"another common call, pybullet:plain, differs: {call}\n" in result.stdout
        assert "DX115 inertia-from-shapes, proved" in result.stdout
        assert "-> Write flags=p.URDF_USE_INERTIA_FROM_FILE" in result.stdout


def test_the_plain_call_fails_a_check_only_where_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if "pybullet" not in installed_engines():
        pytest.skip("needs PyBullet")
    command = ["doctor", str(find_trap("DX115")), "--quiet", "--jobs", "1"]
    files = ["--sarif", "a.sarif", "--junit", "a.xml"]
    assert CliRunner().invoke(cli, [*command, *files]).exit_code == 0
    assert json.loads(Path("a.sarif").read_text())["runs"][0]["results"] == []
    assert 'failures="0"' in Path("a.xml").read_text()
    assert CliRunner().invoke(cli, [*command, "--engines", "pybullet:plain"]).exit_code == 1
    unknown = CliRunner().invoke(cli, [*command, "--engines", "pybullet:plan"])
    assert "did you mean 'pybullet:plain'" in unknown.stderr


def test_a_file_without_inertial_data_is_copied_unchanged_and_the_report_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    trap = find_trap("DX118")
    result = doctor(str(trap), "--fix", "out.urdf", "--json", "out.json")
    assert result.exit_code == 1
    first, *_, action, last = result.stdout.splitlines()
    assert first.endswith("no inertial data: the dynamics cannot be compared")
    assert action == "no inertial data, which --fix does not invent; copied unchanged to out.urdf"
    assert last.startswith("residual error of poses and Jacobians: ")
    assert "dynamics is not compared" in last
    assert Path("out.urdf").read_bytes() == trap.read_bytes()
    made = json.loads(Path("out.json").read_text())
    assert made["results"][0]["status"] == "massless"
    assert made["summary"]["massless"] == 1


@pytest.mark.parametrize("command", [["doctor"], ["agree", "--as-loaded"]])
def test_robots_in_xacro_below_a_directory_are_named_in_every_output(
    command: list[str], tmp_path: Path
) -> None:
    robots = tmp_path / "robots"
    robots.mkdir()
    (robots / "arm.urdf").write_text(SOUND)
    left_out = robots / "arm.xacro"
    left_out.write_text(ARM)
    files = {name: tmp_path / f"out.{name}" for name in ("json", "html", "junit", "sarif")}
    wanted = ["json"] if len(command) > 1 else list(files)
    options = [word for name in wanted for word in (f"--{name}", str(files[name]))]
    engines = ["--backends" if len(command) > 1 else "--engines", *QUICK[1:]]
    result = CliRunner().invoke(cli, [*command, str(robots), *engines, *options, "--quiet"])
    assert result.exit_code == 0, result.output
    assert "dynx: note: 1 robot in xacro was not examined" in result.stderr
    assert str(left_out) in result.stderr
    assert json.loads(files["json"].read_text())["left_out"] == [str(left_out)]
    for name in wanted[1:]:
        assert str(left_out) in files[name].read_text(), name
    if "junit" in wanted:
        assert ElementTree.parse(files["junit"]).getroot().get("skipped") == "1"
    if "sarif" in wanted:
        require_valid(json.loads(files["sarif"].read_text()))


PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "check-a-robot-in-ci.md"

needs_mujoco = pytest.mark.skipif("mujoco" not in installed_engines(), reason="joint damping shows in MuJoCo")


def commands() -> list[list[str]]:
    """Return the words of each command of the section."""
    page = PAGE.read_text(encoding="utf-8")
    text = page.partition("## Compare with what you accepted")[2].partition("\n## ")[0]
    lines = re.findall(r"^dynx .*$", text, flags=re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


def run(words: list[str]) -> Result:
    assert words[0] == "dynx"
    return CliRunner().invoke(cli, [*words[1:], "--jobs", "1"])


@needs_mujoco
def test_the_check_passes_until_something_is_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    robots = tmp_path / "robots"
    robots.mkdir()
    shutil.copy(find_trap("DX301"), robots / "damped.urdf")
    record, check = commands()
    assert run(record).exit_code == 0
    assert run(check).exit_code == 0
    assert Path("doctor.xml").is_file()
    assert Path("doctor.sarif").is_file()
    shutil.copy(find_trap("DX101"), robots / "other.urdf")
    found = run(check)
    assert found.exit_code == 1
    assert "new: DX101" in found.stdout
    assert "new: DX301" not in found.stdout


@needs_mujoco
def test_a_mended_file_names_the_causes_that_only_calls_remove(tmp_path: Path) -> None:
    """Damping is right in the file: without the calls the mended file differs as before."""
    text = find_trap("DX301").read_text(encoding="utf-8").replace("</robot>", '<link name="extra"/></robot>')
    joint = '<joint name="mount" type="fixed"><parent link="{}"/><child link="extra"/></joint></robot>'
    parent = re.findall(r'<child link="([^"]+)"', text)[-1]
    robot, mended = tmp_path / "robot.urdf", tmp_path / "mended.urdf"
    robot.write_text(text.replace("</robot>", joint.format(parent)), encoding="utf-8")
    result = run(["dynx", "doctor", str(robot), "--fix", str(mended)])
    assert result.exit_code == 1
    assert f"mended (without the calls above, DX301 remains): {mended}" in result.stdout
    again = run(["dynx", "doctor", str(mended)])
    assert again.exit_code == 1
    assert "engines differ, for 1 cause, all proved" in again.stdout
    # Rounding that is left in the file is not removed by the calls either.
    skewed = robot.read_text(encoding="utf-8")
    for product, value in (("ixy", "0.002"), ("ixz", "0.0011"), ("iyz", "0.0005")):
        skewed = skewed.replace(f'{product}="0"', f'{product}="{value}"')
    robot.write_text(skewed, encoding="utf-8")
    left = run(["dynx", "doctor", str(robot), "--fix", str(mended)]).stdout
    assert "left DX105 where the effect is at most" in left
    assert f"mended (without the calls above, DX301 remains): {mended}" in left
