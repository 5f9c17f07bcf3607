"""`dynx contacts`: tables, document, files, exit codes, and Ctrl-C."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from jsonschema import Draft202012Validator
from rich.console import Console

from dynx.cli.contacts import run as contacts_run
from dynx.cli.contacts.run import ContactsDocument, show
from dynx.cli.shell.main import cli
from dynx.contacts import NoResult
from dynx.files.documents import json_schema, json_text
from tests.cli.contacts.documents import conformance, example
from tests.files.page import Page
from tests.world.engines import WORLDS

ENGINES = [name for name in WORLDS if find_spec(name) is not None]

needs_engine = pytest.mark.skipif(not ENGINES, reason="needs an engine for worlds")

QUICK = ("--case", "resting_force", "--dt", "1/250,0.002", "--engine", *ENGINES[:1])


def run(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["contacts", *arguments])


def printed(
    width: int, *, every_figure: bool = False, not_done: int = 0, document: ContactsDocument | None = None
) -> str:
    out = Console(file=StringIO(), width=width, soft_wrap=True, markup=False, emoji=False, highlight=False)
    show(out, document or example(not_done=not_done), every_figure=every_figure)
    assert isinstance(out.file, StringIO)
    return out.file.getvalue()


def schema_errors(document: object) -> list[str]:
    schema = json_schema(ContactsDocument, "dynx contacts --json")
    return [error.message for error in Draft202012Validator(schema).iter_errors(document)]


@needs_engine
def test_a_case_is_measured_and_written_in_every_format(tmp_path: Path) -> None:
    document, page = tmp_path / "c.json", tmp_path / "c.html"
    result = run(*QUICK, "--json", str(document), "--html", str(page))
    assert result.exit_code == 0, result.output
    assert "resting_force  Force of the ground on a body at rest" in result.output
    assert f"{ENGINES[0]}  " in result.output
    assert "steps 4 ms, 2 ms" in result.output
    found: dict[str, Any] = json.loads(document.read_text())
    assert [each["engine"] for each in found["engines"]] == ENGINES[:1]
    assert found["engines"][0]["version"]
    assert {each["verdict"] for each in found["cases"][0]["figures"]} == {"within"}
    assert not schema_errors(found)
    assert "resting_force" in Page(page.read_text()).text


def test_the_example_keeps_the_schema() -> None:
    assert not schema_errors(json.loads(json_text(example())))


@needs_engine
def test_ctrl_c_keeps_what_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: Any, **options: Any) -> Any:
        assert options["interruptible"]
        return conformance(not_done=2)

    monkeypatch.setattr(contacts_run, "conform", interrupted)
    result = run("--engine", ENGINES[0])
    assert "interrupted: 2 trials not done" in result.stderr
    assert "2 trials not done" in result.stdout
    assert "acceleration" in result.stdout


def test_every_verdict_is_explained_on_the_screen() -> None:
    text = printed(200, every_figure=True, not_done=1)
    for words in (
        "4.0e-02 .. 1.0e-02  acceleration, fast  falls with the step (order 1.0) (tolerance 1e-03)",
        "impedance 0.9 -> 0.99, impratio 1 -> 100: falls with the step (order 3.0), 2.0e-03 .. 1.0e-04",
        "stiffness 1e+06 -> 1e+08: falls with the setting (order 1.0), 1.0e-03 .. 1.0e-03",
        "acceleration, slow  cannot: word",
        "not finite  acceleration, slow  unexplained",
        "one has impratio 20, 15, 10 in effect at these steps",
        "three at 4 ms, upward: refused: word",
        "two at 4 ms, upward: crash: word",
        "9 figures at 1 ms: 4 within, 1 falls, 1 cannot, 2 setting, 1 unexplained; 99 runs in 12.5 s",
        "1 run failed",
        "1 trial not done",
    ):
        assert words in text, text


def test_the_engines_of_a_figure_stand_together() -> None:
    document = example()
    document["cases"][0]["figures"].sort(key=lambda each: each["engine"])
    text = printed(200, every_figure=True, document=document)
    assert re.findall(r"acceleration, (\w+)", text) == ["fast"] * 3 + ["slow"] * 3


@pytest.mark.parametrize("width", [60, 80, 100])
def test_lines_fit_the_terminal_where_words_allow(width: int) -> None:
    lines = [line for line in printed(width).splitlines() if line.startswith("  ")]
    assert max(map(len, lines)) <= max(width, 76)


def test_without_cases_each_engine_has_the_figure_that_deserves_a_look() -> None:
    text = printed(200)
    assert text.count("acceleration, slow") == 2  # of the engines one and two
    assert text.count("acceleration, fast") == 1
    assert "one figure is shown; --case NAME shows all" in text


def test_an_unexplained_error_gives_exit_code_1(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contacts_run, "conform", lambda *_, **__: conformance())
    monkeypatch.setattr(contacts_run, "installed_worlds", lambda: ())
    result = run("--quiet")
    assert result.exit_code == 1
    assert result.output == ""


def test_the_cases_are_listed() -> None:
    result = run("--list")
    assert result.exit_code == 0
    assert "slope  A box on a slope: stick and slide\n    If tan(a) < mu" in result.output
    refused = run("--list", "--json")
    assert refused.exit_code == 2
    assert "--list runs nothing" in refused.output


@needs_engine
def test_nothing_measured_gives_exit_code_1_and_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    lost = NoResult("one", "sliding", "", 4e-3, "refused", "it has no friction")
    empty = replace(conformance(), results=(), refusals=(lost,), failures=())
    monkeypatch.setattr(contacts_run, "conform", lambda *_, **__: empty)
    result = run("--engine", ENGINES[0])
    assert result.exit_code == 1
    assert "nothing was measured; one: it has no friction" in result.stderr


@needs_engine
def test_substeps_are_set_and_a_single_step_is_named() -> None:
    result = run("--case", "resting_force", "--engine", ENGINES[0], "--dt", "0.004", "--set", "substeps=2")
    assert result.exit_code == 0, result.output
    assert f"{ENGINES[0]} with substeps=2" in result.output
    assert "a single step: no error can be judged as falling" in " ".join(result.output.split())


@needs_engine
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--engine", "pybulet"], "pybullet"),
        (["--case", "slop"], "did you mean 'slope'"),
        (["--set", "impratioo=100"], "no such setting"),
        (["--set", "impratio"], "name=value"),
        (["--set", "substeps=1", "--set", "substeps=2"], "given twice"),
        (["--dt", "1e-9"], "wanted 1e-06 to 0.1 s"),
        (["--dt", "100"], "wanted 1e-06 to 0.1 s"),
        (["--dt", "-1"], "not positive"),
        (["--dt", "1/0"], "not a number"),
        (["--dt", "fast"], "not a number"),
        (["--json", "/no/such/folder/x.json"], "no directory"),
        (["--html", "/no/such/folder/x.html"], "no directory"),
    ],
)
def test_wrong_input_gives_one_line_and_exit_code_2(arguments: list[str], message: str) -> None:
    result = run(*arguments, *([] if "--engine" in arguments else ["--engine", ENGINES[0]]))
    assert result.exit_code == 2
    assert message in result.output
    assert len(result.output.splitlines()) == 1


def test_a_page_without_matplotlib_names_the_extra_before_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    result = run("--engine", ENGINES[0], "--html", str(tmp_path / "c.html"))
    assert result.exit_code == 2
    assert "pip install '.[plot]'" in result.output
