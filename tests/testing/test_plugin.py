"""The pytest plugin, in separate runs of pytest from a user's directory."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import pytest

from dynx.agreement import agree
from dynx.doctor import diagnose
from dynx.doctor.formats import baseline_document
from dynx.model.library import find
from dynx.testing import agreement_tests
from dynx.testing.robot_checks import CHECKS
from tests.testing.pytest_runs import PytestRun, python_path, run_forked, run_started

BACKENDS = ("--dynx-backends", "reference,pinocchio")
PENDULUM = find("pendulum").read_text(encoding="utf-8")

MASSLESS_ELBOW = """\
<robot name="mine">
  <link name="base"/>
  <link name="elbow"/>
  <link name="hand">
    <inertial>
      <mass value="2"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
    </inertial>
  </link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="elbow"/></joint>
  <joint name="wrist" type="fixed">
    <origin xyz="0 1 0"/><parent link="elbow"/><child link="hand"/>
  </joint>
</robot>
"""

WRONG = """
import dynx
from dynx.reference.backend import ReferenceBackend

class Heavy(ReferenceBackend):
    name = "heavy"
    def _mass_matrix(self, q):
        return super()._mass_matrix(q) * (1.0 + 1e-6)

dynx.register("heavy", lambda: Heavy)
"""

COUNTING = """
from pathlib import Path
from dynx.testing import robot_checks

agree = robot_checks.agree

def counted(model, *rest):
    with open(Path(__file__).with_name("measured.txt"), "a") as file:
        file.write(f"{model.name} {model.base}\\n")
    return agree(model, *rest)

robot_checks.agree = counted
"""

HEAVY = {"numpy", "hypothesis", "pinocchio", "pybullet", "mujoco", "pydrake", "click", "dynx.model"}


class Run(Protocol):
    """Runs pytest with the plugin installed, in `home` or in a folder of it."""

    def __call__(self, *arguments: str, folder: str = ".") -> PytestRun: ...


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """Return the directory in which `run` and `start` run pytest, empty at first."""
    folder = tmp_path / "home"
    folder.mkdir()
    return folder


@pytest.fixture
def run(tmp_path: Path, home: Path) -> Run:
    """In a process forked from a warm one."""
    path = python_path(tmp_path / "site")
    return lambda *arguments, folder=".": run_forked(arguments, home / folder, path)


@pytest.fixture
def start(tmp_path: Path, home: Path) -> Run:
    """In an interpreter of its own, as users do."""
    path = python_path(tmp_path / "site")
    return lambda *arguments, folder=".": run_started(arguments, home / folder, path)


def test_without_a_test_file(start: Run, home: Path) -> None:
    result = start(
        "--dynx-robot", "pendulum", *BACKENDS, "--strict-config", "--strict-markers", "-W", "error"
    )
    assert result.outcome == {"passed": len(CHECKS)}, result.output
    assert result.code == 0
    assert "dynx: pendulum; fixed base; reference, pinocchio" in result.stdout
    assert not [path.name for path in home.iterdir() if path.name != ".benchmarks"]


def test_every_quantity_and_identity_is_a_test() -> None:
    report = agree("pendulum", ["reference", "pinocchio"])
    compared = {row.quantity for row in report.quantities} | {row.identity for row in report.identities}
    assert compared == set(CHECKS)
    assert len(set(CHECKS)) == len(CHECKS)


def test_files_bases_and_names_of_tests(run: Run, home: Path) -> None:
    (home / "robots").mkdir()
    (home / "robots" / "mine.urdf").write_text(PENDULUM)
    result = run("--dynx-robot=robots", "--dynx-robot", "ur5", "--dynx-base", "both", *BACKENDS, "--co", "-q")
    nodes = [line for line in result.stdout.splitlines() if "::" in line]
    assert nodes == [
        f"{robot}::{base}::{check}"
        for robot in ("robots/mine.urdf", "ur5")
        for base in ("fixed", "floating")
        for check in CHECKS
    ]


def test_robots_of_the_ini_file(run: Run, home: Path) -> None:
    (home / "mine.urdf").write_text(PENDULUM)
    (home / "pytest.ini").write_text(
        "[pytest]\naddopts = --strict-config\ndynx_robots =\n    mine.urdf\n    ur5\n"
    )
    (home / "tests").mkdir()
    (home / "tests" / "test_own.py").write_text("def test_own(): pass\n")
    everything = len(CHECKS) * 2 + 1
    for folder, arguments in ((".", ()), (".", ("tests",)), ("tests", ())):
        result = run("--co", "-q", *BACKENDS, *arguments, folder=folder)
        assert f"{everything} tests collected" in result.stdout, result.output
    one_file = run("tests/test_own.py", *BACKENDS)
    assert one_file.outcome == {"passed": 1}, one_file.output
    asked_for = run("tests/test_own.py", "--dynx-robot", "pendulum", "--co", "-q")
    assert f"{len(CHECKS) + 1} tests collected" in asked_for.stdout


def test_a_difference_is_told(run: Run, home: Path) -> None:
    (home / "conftest.py").write_text(WRONG)
    result = run("--dynx-robot", "pendulum", "--dynx-backends", "reference,heavy")
    assert result.code == 1
    assert "mass_matrix of pendulum, fixed base" in result.stdout
    told = re.search(
        r"^  reference~heavy: relative error 1\.00e-06, tolerance (\S+)\n"
        r"    worst sample: number \d+ \(\w+\)\n      q = \[\S+\]\n",
        result.stdout,
        flags=re.MULTILINE,
    )
    assert told
    assert 0.0 < float(told.group(1)) < 1e-6
    assert "suspect: heavy" in result.stdout
    assert "dynx agree pendulum --base fixed --engine reference,heavy" in result.stdout
    # Nothing of dynx's own code is shown, and kinematics is none of this engine's faults.
    assert "robot_checks.py" not in result.stdout
    assert "forward_kinematics of" not in result.stdout


def test_in_a_test_file(run: Run, home: Path) -> None:
    (home / "mine.urdf").write_text(PENDULUM)
    (home / "test_mine.py").write_text(
        "from dynx.testing import agreement_tests\n"
        "TestMine = agreement_tests('mine.urdf', base='both', backends=['reference'])\n"
    )
    (home / "elsewhere").mkdir()
    result = run("..", "-rs", folder="elsewhere")
    # One engine alone is not compared on quantities that neither referee nor derivation gives.
    assert result.code == 0, result.stdout
    assert result.outcome["passed"] + result.outcome["skipped"] == 2 * len(CHECKS)
    assert "nothing to compare (reference; nv 1)" in result.stdout
    without_plugin = run("..", "-p", "no:dynx", folder="elsewhere")
    assert without_plugin.outcome == result.outcome


def test_a_class_for_no_such_base() -> None:
    misspelt: Any = "floatin"
    with pytest.raises(ValueError, match="did you mean 'floating'"):
        agreement_tests("pendulum", base=misspelt)


def test_a_class_for_a_robot_that_is_not_there(run: Run, home: Path) -> None:
    (home / "test_mine.py").write_text(
        "from dynx.testing import agreement_tests\nTestMine = agreement_tests('pendulun')\n"
    )
    result = run("-x")
    assert result.outcome == {"failed": 1}
    assert "did you mean 'pendulum'" in result.stdout


@pytest.mark.parametrize("distribution", ["load", "loadscope"])
def test_with_xdist(start: Run, home: Path, distribution: str) -> None:
    (home / "conftest.py").write_text(COUNTING)
    chosen = ("--dynx-robot", "pendulum", "--dynx-base=both", "--dynx-backends", "reference")
    # Three interpreters start, so they load no plugin that they do not need.
    lean = ("-p", "no:hypothesispytest", "-p", "no:benchmark")
    result = start(*chosen, *lean, "-n", "2", "--dist", distribution)
    assert result.code == 0, result.output
    # One engine alone is not compared on quantities that neither referee nor derivation gives.
    assert result.outcome["passed"] + result.outcome["skipped"] == 2 * len(CHECKS), result.output
    assert result.outcome["passed"] > result.outcome["skipped"]
    measured = (home / "measured.txt").read_text().splitlines()
    assert set(measured) == {"pendulum fixed", "pendulum floating"}
    # Workers share nothing: each measures what it has tests of, once.
    assert len(measured) <= (4 if distribution == "load" else 2)


def test_a_robot_is_measured_once_and_only_for_tests_that_run(run: Run, home: Path) -> None:
    (home / "conftest.py").write_text(COUNTING)
    (home / "test_more.py").write_text(
        "from dynx.testing import agreement_tests\n"
        "TestMore = agreement_tests('pendulum', backends=['reference', 'pinocchio'])\n"
    )
    chosen = ("--dynx-robot", "pendulum", "--dynx-base=both", *BACKENDS)
    run(*chosen, "--collect-only")
    assert not (home / "measured.txt").exists()
    run(*chosen, "-k", "fixed")
    assert (home / "measured.txt").read_text() == "pendulum fixed\n"
    run(*chosen)
    assert (home / "measured.txt").read_text() == "pendulum fixed\n" * 2 + "pendulum floating\n"


def test_a_description_that_cannot_be_read_is_one_failing_test(run: Run, home: Path) -> None:
    (home / "bad.urdf").write_text(PENDULUM.replace('<mass value="', '<mass value="heavy'))
    (home / "test_own.py").write_text("def test_own(): pass\n")
    result = run("--dynx-robot=bad.urdf", *BACKENDS)
    assert result.outcome == {"failed": 1, "passed": 1}, result.stdout
    assert "DescriptionError" in result.stdout
    assert re.search(r"bad\.urdf:\d+: ", result.stdout)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--dynx-robot", "pendulun"), "did you mean 'pendulum'"),
        (("--dynx-robot", "robots/none.urdf"), "no such file"),
        (("--dynx-robot", "."), "has no .urdf file"),
        (("--dynx-robot", "ur5", "--dynx-backends", "pinochio"), "did you mean 'pinocchio'"),
        (("--dynx-robot", "ur5", "--dynx-backends", ","), "wanted names separated by commas"),
        (("--dynx-robot", "ur5", "--dynx-base", "flying"), "invalid choice"),
        (("--dynx-base", "both"), "use --dynx-robot"),
        (("--dynx-robot", "ur5", "--dynx-tolerance", "1e-6"), "--dynx-as-loaded"),
        (("--dynx-robot", "ur5", "--dynx-baseline", "known.json"), "--dynx-as-loaded"),
        (("--dynx-robot", "ur5", "--dynx-ignore", "DX101"), "--dynx-as-loaded"),
        (("--dynx-robot", "ur5", "--dynx-as-loaded", "--dynx-only=DX999"), "no rule 'DX999'"),
        (("--dynx-robot", "ur5", "--dynx-as-loaded", "--dynx-ignore=,"), "wanted rules separated by commas"),
        (("--dynx-robot", "ur5", "--dynx-as-loaded", "--dynx-tolerance=2"), "between 0 and 1"),
        (("--dynx-robot", "ur5", "--dynx-as-loaded", "--dynx-baseline=known.json"), "no such file"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_invalid_arguments(arguments: tuple[str, ...], message: str, run: Run) -> None:
    result = run(*arguments)
    assert result.code == pytest.ExitCode.USAGE_ERROR, result.output
    assert message in result.stderr
    assert "Traceback" not in result.stderr


def test_as_loaded(run: Run, home: Path) -> None:
    """A massless link on a joint is 1 kg to PyBullet; that it is so can be accepted."""
    (home / "robots").mkdir()
    (home / "robots" / "mine.urdf").write_text(MASSLESS_ELBOW)
    chosen = (
        "--dynx-robot",
        "robots",
        "--dynx-as-loaded",
        "--dynx-backends",
        "pinocchio,pybullet",
        "-k",
        "loaded",
    )
    refused = run(*chosen)
    assert refused.outcome == {"failed": 1}, refused.output
    assert "DX101 link 'elbow' (pybullet): relative error" in refused.stdout
    line = MASSLESS_ELBOW[: MASSLESS_ELBOW.index('<link name="elbow"')].count("\n") + 1
    assert f"mine.urdf:{line}: " in refused.stdout
    assert "dynx doctor robots/mine.urdf --base fixed --fix OUT.urdf" in refused.stdout
    where = str(home / "robots" / "mine.urdf")
    report = diagnose(where, engines=["pinocchio", "pybullet"])
    known = baseline_document([replace(report, robot=where)], str(home / "robots"))
    (home / "robots" / "known.json").write_text(json.dumps(known))
    accepted = run(*chosen, "--dynx-baseline", "robots/known.json")
    assert accepted.outcome == {"passed": 1}, accepted.stdout
    ignored = run(*chosen, "--dynx-ignore", "DX301,link-without-inertial")
    assert ignored.outcome == {"passed": 1}, ignored.stdout
    assert "dynx: findings of DX301, link-without-inertial are accepted" in ignored.stdout
    assert run(*chosen, "--dynx-only", "DX105", "--dynx-only", "DX301").outcome == {"passed": 1}
    assert run(*chosen, "--dynx-only", "DX101").outcome == {"failed": 1}
    tolerant = run(*chosen, "--dynx-tolerance", "0.999")
    assert tolerant.outcome == {"passed": 1}, tolerant.stdout


def test_it_costs_nothing_when_it_is_not_used(start: Run, home: Path) -> None:
    (home / "test_own.py").write_text(
        "import sys\n\n"
        "def test_own():\n"
        "    assert 'dynx.testing.plugin' in sys.modules\n"
        f"    assert not {HEAVY} & set(sys.modules)\n"
    )
    # Other plugins may import what they like, so only this one is there.
    result = start(
        "-p", "no:hypothesispytest", "-p", "no:benchmark", "-p", "no:xdist", "-W", "error", "test_own.py"
    )
    assert result.outcome == {"passed": 1}, result.output
    assert "dynx:" not in result.stdout
