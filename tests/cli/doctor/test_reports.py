"""The tables, the conclusion and the files of `dynx doctor`, from reports made by hand."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from dynx.cli.doctor.as_loaded import vote_lines
from dynx.cli.doctor.files import ReportFiles, planned_targets, save_counterexamples, write_mended
from dynx.cli.doctor.run import Conclusion, doctor_command, doctor_run
from dynx.cli.doctor.tables import show_many, show_one
from dynx.cli.shell.main import cli
from dynx.cli.shell.run import carry_out
from dynx.doctor.formats import read_baseline
from dynx.doctor.formats.baseline import Baseline
from dynx.doctor.formats.causes import vote
from dynx.doctor.report import DoctorReport, EngineResult, PairError
from dynx.doctor.task import DoctorTask, examine, missing_engines
from dynx.errors import ArgumentError, NotInstalledError
from dynx.model.expansion import RobotInput
from dynx.model.loading import load
from dynx.model.tree import Base
from tests.doctor.formats.reports import HOSTILE, MENDED, SMALL, TEXT, alike, differing, hostile, refused
from tests.workers.targets import interrupt_at_a_pipe


def conclude(
    reports: Sequence[DoctorReport],
    folder: Path,
    baseline: Baseline | None = None,
    *,
    targets: Sequence[str | None] = (),
    outputs: ReportFiles | None = None,
    left: int = 0,
    engines: Sequence[str] | None = ("pinocchio",),
) -> int:
    """Return the exit code of a run that gave these reports, and `left` robots without one."""
    names = [report.robot for report in reports] + ["later"] * left
    run = doctor_run([DoctorTask(name, "fixed") for name in names])
    for number, report in enumerate(reports):
        run.record(number, report)
    files = [*targets, *[None] * (len(names) - len(targets))]
    conclusion = Conclusion(run, outputs or ReportFiles(), baseline, files, False, str(folder), engines)
    return conclusion.reach(quiet=False)


@pytest.mark.parametrize(
    ("reports", "code"),
    [
        ([alike()], 0),
        ([differing()], 1),
        ([alike(), differing()], 1),
        ([differing(), refused()], 2),
        ([], 0),
    ],
    ids=["alike", "differ", "one differs", "one refused", "none"],
)
def test_the_exit_code_is_the_largest_one(reports: list[DoctorReport], code: int, tmp_path: Path) -> None:
    assert conclude(reports, tmp_path) == code


def test_a_baseline_just_written_accepts_everything(tmp_path: Path) -> None:
    path = tmp_path / "known.json"
    assert conclude([differing()], tmp_path, outputs=ReportFiles(baseline=str(path))) == 0
    known = read_baseline(path.read_text(), str(path))
    assert conclude([differing()], tmp_path, known) == 0
    assert conclude([differing(link="another")], tmp_path, known) == 1


def test_ignored_rules_fail_no_check_but_what_no_rule_explains_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = replace(differing(), ignored={"DX901": 2, "DX902": 1, "DX903": 1})
    explained = replace(report, unexplained=(), residual=0.0)
    assert conclude([report], tmp_path) == 1
    capsys.readouterr()
    assert conclude([explained], tmp_path) == 0
    shown = capsys.readouterr().out
    assert "4 findings ignored: DX901 planted-cause (2), DX902 planted-rounding (1)" in shown
    assert "write an explicit zero inertial" not in shown
    assert conclude([replace(explained, ignored={"DX901": 2})], tmp_path) == 1
    assert conclude([explained, alike(), refused()], tmp_path) == 2
    assert "4 findings ignored" in capsys.readouterr().out


def test_the_document_names_what_was_not_done(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    conclude([alike()], tmp_path, outputs=ReportFiles(json=str(path)), left=2)
    document = json.loads(path.read_text())
    assert document["summary"]["not_done"] == 2
    assert document["not_done"] == ["later", "later"]


def test_an_output_that_cannot_be_written_does_not_lose_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lost, html, junit = tmp_path / "lost.json", tmp_path / "x.html", tmp_path / "x.xml"
    lost.mkdir()
    mended = str(tmp_path / "mended.urdf")
    outputs = ReportFiles(json=str(lost), html=str(html), junit=str(junit))
    assert conclude([differing()], tmp_path, outputs=outputs, targets=[mended]) == 2
    assert html.stat().st_size > 0
    assert junit.stat().st_size > 0
    assert Path(mended).exists() == (differing().mended is not None)
    shown = capsys.readouterr()
    assert "lost.json" in shown.err
    assert "it is a directory" in shown.err
    assert shown.out


@pytest.mark.parametrize("as_loaded", [False, True])
def test_a_document_of_agree_that_cannot_be_written_leaves_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, as_loaded: bool
) -> None:
    def full(path: str, text: str) -> None:
        raise ArgumentError(f"{path} cannot be written: no space left")

    monkeypatch.setattr("dynx.cli.shell.output.write_text", full)
    monkeypatch.setattr("dynx.cli.shell.reports.write_text", full)
    engines = ["--backends", "pinocchio"] if as_loaded else ["--backends", "reference"]
    command = ["agree", "pendulum", *engines, "--samples", "1", "--json", str(tmp_path / "x.json")]
    result = CliRunner().invoke(cli, [*command, *["--as-loaded"] * as_loaded])
    assert result.exit_code == 2
    assert "pendulum" in result.stdout
    assert "no space left" in result.stderr


def test_a_counterexample_is_a_file_that_loads(tmp_path: Path) -> None:
    folder = tmp_path / "new"
    saved = save_counterexamples(str(folder), differing())
    [path] = {Path(file) for file in saved.values()}
    assert path.parent == folder
    assert load(path).frame_names == load(SMALL).frame_names
    assert "q = [0.5]" in path.read_text()


@pytest.mark.skipif(sys.platform == "win32", reason="links need a right")
def test_a_counterexample_is_not_written_through_a_link(tmp_path: Path) -> None:
    [name] = {Path(file).name for file in save_counterexamples(str(tmp_path), differing()).values()}
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to(tmp_path / "other")
    with pytest.raises(ArgumentError, match="is a link"):
        save_counterexamples(str(tmp_path), differing())
    assert not (tmp_path / "other").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="links need a right")
@pytest.mark.parametrize("bases", [("fixed",), ("fixed", "floating")])
def test_mended_files_are_not_written_through_links(tmp_path: Path, bases: tuple[Base, ...]) -> None:
    inputs = [RobotInput(str(tmp_path / name), None) for name in ("a.urdf", "b.urdf")]
    out = tmp_path / "out"
    out.mkdir()
    name = Path(planned_targets(inputs, str(out), in_place=False, bases=bases)[-1] or "").name
    (out / name).symlink_to(tmp_path / "other")
    with pytest.raises(ArgumentError, match="is a link"):
        planned_targets(inputs, str(out), in_place=False, bases=bases)


def test_a_folder_that_cannot_be_created_is_reported_and_the_rest_is_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert conclude([differing()], tmp_path / "file" / "folder") == 2
    found = capsys.readouterr()
    assert "DX901" in found.out
    assert "cannot be created" in found.err


@given(st.text())
def test_a_counterexample_stays_in_its_folder(name: str) -> None:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        saved = save_counterexamples(folder, differing(name))
        assert [Path(file).parent for file in saved.values()] == [Path(folder)]


def test_counterexamples_of_one_run_have_files_of_their_own(tmp_path: Path) -> None:
    report = differing("long" * 60)
    [(index, each)] = [(k, x) for k, x in enumerate(report.unexplained) if x.counterexample is not None]
    assert each.counterexample is not None
    other = replace(each, engine="drake", counterexample=replace(each.counterexample, urdf=SMALL + "\n"))
    both = replace(report, unexplained=(*report.unexplained, other))
    saved = save_counterexamples(str(tmp_path), both)
    assert set(saved) == {index, len(report.unexplained)}
    for path, engine in zip(saved.values(), (each.engine, "drake"), strict=True):
        assert Path(path).name.endswith(f"-fixed-{engine}-{each.quantity}.counterexample.urdf")
    # Robots of one name in several folders, too.
    taken: set[str] = set()
    files = [
        file
        for robot in ("a/arm.urdf", "b/arm.urdf")
        for file in save_counterexamples(str(tmp_path), differing(robot), taken).values()
    ]
    assert len({*files}) == 2
    assert all(Path(file).exists() for file in files)


def shown(report: DoctorReport, width: int = 80) -> str:
    """Return the report of one robot on a terminal of that width."""
    out = StringIO()
    console = Console(file=out, width=width, soft_wrap=True, markup=False, emoji=False)
    show_one(console, report, {}, None, doctor_command(DoctorTask(report.robot, "fixed")))
    return out.getvalue()


def test_the_report_of_one_robot_is_in_the_order_of_importance() -> None:
    text = shown(differing())
    order = [
        *(
            "1 difference without an explanation",
            "p.loadURDF(path",
            "refuses the file: inertia must be positive",
        ),
        *("1.9e+01 -> 4.0e-16", "DX901 planted-cause", "2 places in pybullet, mujoco"),
        *(
            "line 5, link tool: no valid mass matrix",
            "line 3, link base: 1900 %",
            "DX902 planted-rounding",
            "(rounding)",
        ),
        *("bad practice", "DX903", "--choose DX901=keep", "p.changeDynamics(robot, link)"),
        *("most at joint elbow", "q = [0.5]", "--fix OUT.urdf"),
    ]
    places = [text.find(words) for words in order]
    assert -1 not in places
    assert places == sorted(places)


def test_lines_fit_80_columns() -> None:
    assert max(map(len, shown(differing()).splitlines())) <= 80


@pytest.mark.parametrize(
    "report", [hostile(), alike(), refused(HOSTILE)], ids=["differs", "alike", "refused"]
)
def test_names_cannot_write_on_the_terminal(report: DoctorReport) -> None:
    out = StringIO()
    show_many(Console(file=out, width=200, markup=False), [report])
    for text in (shown(report), out.getvalue()):
        assert all(c.isprintable() or c == "\n" for c in text)
        assert "x" * 1000 not in text


def test_a_written_file_names_the_bad_practice_that_it_keeps() -> None:
    """Lengths in millimetres are one: the file does not say what else is, so nothing is converted."""
    report = differing()
    practice = replace(report.findings[0], rule="DX520", kind="practice", effect=None, effects={})
    report = replace(report, findings=(*report.findings, practice))
    out = StringIO()
    show_one(Console(file=out, width=200, markup=False), report, {}, "out.urdf", "dynx doctor in.urdf")
    assert (
        "not mended, because the file does not say what is right: DX903, DX520 robot-in-millimetres"
        in out.getvalue()
    )
    assert "not mended" not in shown(report)


@pytest.mark.parametrize("key", ["not_used", "refused"])
def test_an_engine_that_is_not_used_on_the_mended_file_does_not_refuse_it(key: str) -> None:
    out, word = StringIO(), key.replace("_", " ")
    reasons: dict[str, Any] = {key: "why", f"{key}_after": "why"}
    engine = EngineResult("pybullet", "1", "load", **reasons)
    show_many(Console(file=out, width=200), [replace(differing(), engines=(engine,))])
    line = next(line for line in out.getvalue().splitlines() if "UNEXPLAINED" in line)
    assert line.count(word) == 2


def test_bad_practice_is_counted_where_several_files_have_a_line_each() -> None:
    practice = replace(differing().findings[0], rule="DX520", kind="practice", effect=None, effects={})
    for findings, share in [((), ""), ((practice, practice), "bad practice: 1 of 2 robots (DX520)")]:
        out = StringIO()
        reports = [replace(differing(), findings=()), replace(differing(), findings=findings)]
        show_many(Console(file=out, width=200, markup=False), reports)
        assert ("bad practice" in out.getvalue()) == bool(share)
        assert share in out.getvalue()


def test_places_with_and_without_effect_are_counted_apart() -> None:
    """As many have an effect as in JSON."""
    one = differing().findings[0]
    assert one.effect is not None
    places = [replace(one, effect=effect, link=f"l{k}") for k, effect in enumerate((one.effect, None, None))]
    report = replace(differing(), findings=tuple(places))
    assert f"(1 place in {one.engines[0]}, 2 without effect)" in shown(report, 200)
    assert "(3 places" in shown(replace(report, findings=tuple(replace(x, effect=None) for x in places)), 200)


def test_an_unknown_robot_is_refused_in_the_worker() -> None:
    report = examine(DoctorTask("nosuch", "fixed", ("pinocchio",)))
    assert report.error is not None
    assert report.error.type == "RobotNotFoundError"
    assert report.robot == "nosuch"


def test_a_missing_engine_is_a_line_with_the_package_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def absent(name: str) -> None:
        raise NotInstalledError(f"the engine {name!r} needs a package: pip install 'dynx[{name}]'")

    monkeypatch.setattr("dynx.doctor.task.loader_class", absent)
    assert [line.split("'")[1] for line in missing_engines([differing(), alike()])] == ["drake"]
    assert missing_engines([refused()]) == []
    conclude([differing()], tmp_path, engines=None)
    assert "note: the engine 'drake' needs a package: pip install '.[drake]'" in capsys.readouterr().out
    conclude([differing()], tmp_path, engines=("pinocchio", "pybullet", "mujoco"))
    assert "drake" not in capsys.readouterr().out


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFO, and no SIGINT to another process")
def test_an_interrupted_run_writes_what_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pipe = str(tmp_path / "second.fifo")
    os.mkfifo(pipe)
    run = doctor_run([DoctorTask(name, "fixed") for name in ("arm", pipe, "third")], interrupt_at_a_pipe)
    record = run.record

    def record_and_signal(index: int, result: DoctorReport) -> None:
        record(index, result)
        Path(pipe).write_text("the first is recorded")

    monkeypatch.setattr(run, "record", record_and_signal)
    outputs = ReportFiles(json=str(tmp_path / "x.json"))
    conclusion = Conclusion(run, outputs, None, [None] * 3, False, str(tmp_path), None)
    assert carry_out(run, 1, 0.0, True, lambda: conclusion.reach(quiet=True)) == 130
    document = json.loads((tmp_path / "x.json").read_text())
    assert [each["robot"] for each in document["results"]] == ["arm"]
    assert document["not_done"] == [pipe, "third"]
    assert "2 of 3 robots not done" in capsys.readouterr().err


# -- where mended files go ----------------------------------------------------------------------


def targets_of(out: str, *robots: RobotInput) -> list[str | None]:
    """Return the files for these inputs."""
    return planned_targets(robots, out, in_place=False, bases=("fixed",))


def test_one_robot_goes_to_a_file_and_several_to_a_folder(tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    assert targets_of(f"{out}.urdf", RobotInput("ur5")) == [f"{out}.urdf"]
    assert targets_of(str(tmp_path), RobotInput("ur5")) == [str(tmp_path / "ur5.urdf")]
    several = targets_of(
        out,
        RobotInput("ur5"),
        RobotInput("x/arm.urdf.xacro side:=left"),
        RobotInput("d/e/f.urdf", folder="d"),
    )
    assert several == [f"{out}/ur5.urdf", f"{out}/arm.urdf", f"{out}/e/f.urdf"]


def test_no_two_robots_share_a_file_and_none_is_its_input(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="both"):
        targets_of(str(tmp_path / "out"), RobotInput("a.xacro side:=left"), RobotInput("a.xacro side:=right"))
    path = tmp_path / "arm.urdf"
    path.write_text(TEXT)
    for out in (str(path), f"{tmp_path}/./arm.urdf", str(tmp_path)):
        with pytest.raises(ArgumentError, match="in-place"):
            targets_of(out, RobotInput(str(path)))
    with pytest.raises(ArgumentError, match="directory"):
        targets_of(str(path), RobotInput("a"), RobotInput("b"))


def test_robots_of_one_name_go_into_folders_named_as_theirs(tmp_path: Path) -> None:
    robots = [RobotInput(name) for name in ("a/u/arm.urdf", "b/u/arm.urdf", "b/leg.urdf")]
    expected = [str(tmp_path / name) for name in ("a/u/arm.urdf", "b/u/arm.urdf", "leg.urdf")]
    assert targets_of(str(tmp_path), *robots) == expected


def test_each_base_has_a_file_of_its_own(tmp_path: Path) -> None:
    robots = [RobotInput("ur5"), RobotInput("ur3")]
    bases: tuple[Base, ...] = ("fixed", "floating")
    found = planned_targets(robots, str(tmp_path), in_place=False, bases=bases)
    assert found == [str(tmp_path / f"{each.robot}-{base}.urdf") for each in robots for base in bases]
    one = planned_targets(robots[:1], str(tmp_path / "out.urdf"), in_place=False, bases=bases)
    assert one == [str(tmp_path / f"out-{base}.urdf") for base in bases]
    assert planned_targets(robots, None, in_place=False, bases=bases) == [None] * 4


@pytest.mark.parametrize("encoding", ["utf-8", "ISO-8859-1", "UTF-16", "cp1252", "Shift_JIS"])
def test_the_declared_encoding_is_kept(encoding: str, tmp_path: Path) -> None:
    text = MENDED.replace('version="1.0"', f'version="1.0" encoding="{encoding}"').replace(
        "<!-- the tool", "<!-- \u00e9 \u30ed the tool"
    )
    path = tmp_path / "out.urdf"
    assert write_mended(str(path), replace(differing(), mended=text), over_input=False)
    kept = path.read_bytes().decode(encoding)
    assert kept.replace("&#233;", "\u00e9").replace("&#12525;", "\u30ed") == text
    assert not [each for each in tmp_path.iterdir() if each != path]


def test_nothing_to_mend_is_a_copy_and_in_place_nothing(tmp_path: Path) -> None:
    path = tmp_path / "out.urdf"
    assert not write_mended(str(path), alike(), over_input=True)
    assert not write_mended(str(path), refused(), over_input=False)
    assert not path.exists()
    assert write_mended(str(path), alike(), over_input=False)
    assert path.read_text() == TEXT


# -- the vote -----------------------------------------------------------------------------------


def voters(*errors: float) -> DoctorReport:
    """Report of engines a, b, c, ... with these errors; any two differ by the difference of theirs."""
    names = [chr(ord("a") + k) for k in range(len(errors))]
    distance = dict(zip(names, errors, strict=True))
    pairs = [
        PairError((one, two), "mass matrix", abs(distance[one] - distance[two]))
        for k, one in enumerate(names)
        for two in names[k + 1 :]
    ]
    engines = [EngineResult(name, "1", "load", before={"mass matrix": distance[name]}) for name in names]
    return DoctorReport("r", engines=tuple(engines), pairs=tuple(pairs), tolerance=1e-12)


def test_the_vote_names_engines_alone_and_engines_that_are_right() -> None:
    found = vote(voters(0.0, 0.5, 0.0, 1e-16))
    assert found.groups == (("a", "c", "d"), ("b",))
    assert found.alone == ("b",)
    assert found.right == ("a", "c", "d")
    assert vote(voters(0.5, 0.5, 0.0)).right == ("c",)  # the majority may be wrong
    assert vote(voters(0.0, 0.0)).alone == ()
    lines = vote_lines(voters(0.5, 0.5, 0.0), vote(voters(0.5, 0.5, 0.0)))
    assert "a and b agree with each other" in lines
    assert "c matches the reference values of the file" in lines
    assert vote_lines(DoctorReport("r"), vote(DoctorReport("r"))) == ["no engine has results on the file"]


@given(st.lists(st.sampled_from([0.0, 1e-15, 0.25, 0.5, float("inf"), float("nan")]), max_size=5))
def test_every_engine_is_in_one_group(errors: list[float]) -> None:
    report = voters(*errors)
    found = vote(report)
    assert sorted(name for group in found.groups for name in group) == [e.engine for e in report.engines]
    assert set(found.right) == {e.engine for e in report.engines if e.before["mass matrix"] <= 1e-12}


def test_annotations_go_to_standard_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert conclude([differing()], tmp_path, outputs=ReportFiles(github=True)) == 1
    out = capsys.readouterr().out
    assert out.splitlines()[0].startswith("::error file=")
    with pytest.raises(ArgumentError, match="--github and --json - both write to standard output"):
        ReportFiles(json="-", github=True).check()
    ReportFiles(json=str(tmp_path / "out.json"), github=True).check()
