"""``dynx explain``: every rule's page, and the list of all."""

from __future__ import annotations

import io
import json
import sys

import pytest
from click.testing import CliRunner
from rich.console import Console

from dynx.cli.queries.explain import explain
from dynx.cli.shell.main import cli
from dynx.rules import Rule, all_rules, find_rule


def run(*arguments: str) -> str:
    """Return the output of a command that succeeds."""
    result = CliRunner().invoke(cli, ["explain", *arguments])
    assert result.exit_code == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize("rule", all_rules(), ids=lambda rule: rule.id)
def test_the_page_is_printed_as_it_is_written(rule: Rule) -> None:
    page = run(rule.id)
    assert page.startswith(f"{rule.page()}\n\nkind: {rule.kind}\n")
    assert rule.advice in page
    assert all(f"{engine} {versions}" in page for engine, versions in rule.engines.items())
    assert all(f"--choose {rule.id}={choice}: {meaning}" in page for choice, meaning in rule.choices.items())
    assert rule.trap() in page


@pytest.mark.parametrize("name", ["dx501", "DX501", "inertia-beyond-geometry", "Inertia-Beyond-Geometry"])
def test_a_rule_has_an_id_and_a_name_in_any_case(name: str) -> None:
    assert run(name) == run("DX501")


def test_without_a_rule_all_are_listed() -> None:
    shown = run()
    lines = shown.splitlines()
    assert max(map(len, lines)) <= 100
    assert [line.split()[0] for line in lines if line.startswith("DX")] == [rule.id for rule in all_rules()]
    text = " ".join(shown.split())
    for rule in all_rules():
        engines = f": {', '.join(rule.engines)}" if rule.engines else ""
        assert f"{rule.id} {rule.name}: {' '.join(rule.title.split())} ({rule.kind}{engines})" in text
    assert lines[-1].startswith(f"{len(all_rules())} rules")


@pytest.mark.parametrize(
    ("word", "clues"),
    [
        ("DX1", ["rules with it: DX101 link-without-inertial, DX102", " more"]),
        ("mass", ["-mass", " more"]),
        ("inertia-beyond", ["DX501 inertia-beyond-geometry"]),
        ("Some engines give it a mass", ["DX101 link-without-inertial"]),
        ("", ["212 are known" if len(all_rules()) == 212 else "are known"]),
        ("qzqzq", ["are known, such as DX101"]),
    ],
)
def test_a_part_of_a_rule_names_the_rules_that_have_it(word: str, clues: list[str]) -> None:
    result = CliRunner().invoke(cli, ["explain", word])
    assert result.exit_code == 2
    assert all(clue in result.stderr for clue in clues), result.stderr
    assert len(result.stderr) < 400


def test_json_of_one_and_of_all() -> None:
    rule = find_rule("DX509")
    one = json.loads(run("dx509", "--json"))
    assert one["schema"] == 1
    assert one["rule"]["page"] == rule.page()
    assert set(one["rule"]) == {
        *("id", "name", "title", "kind", "engines", "advice", "choices", "trap", "page"),
    }
    every = json.loads(run("--json"))["rules"]
    assert [each["id"] for each in every] == [each.id for each in all_rules()]
    assert one["rule"] in every


def test_a_typo_is_reported_with_the_nearest_name() -> None:
    result = CliRunner().invoke(cli, ["explain", "inertia-beyond-geometri"])
    assert result.exit_code == 2
    assert "did you mean 'inertia-beyond-geometry'" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("width", [40, 80, 200])
def test_a_terminal_gets_the_same_words_laid_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], width: int
) -> None:
    def terminal_console(*, err: bool = False) -> Console:
        return Console(file=sys.stdout, force_terminal=True, width=width, color_system=None, soft_wrap=True)

    monkeypatch.setattr("dynx.cli.queries.explain.console", terminal_console)
    with pytest.raises(SystemExit) as ended:
        cli.main(["explain", "DX514"])
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= min(width, 100)
    rule = find_rule("DX514")
    plain = "".join(character for character in shown if character.isalnum())
    for paragraph in rule.page().split("\n\n"):
        assert "".join(character for character in paragraph if character.isalnum()) in plain
    assert "".join(character for character in rule.advice if character.isalnum()) in plain


def test_a_terminal_shows_the_element_in_the_headline(monkeypatch: pytest.MonkeyPatch) -> None:
    """``<inertial>`` is text, not HTML that Markdown leaves out."""
    screen = Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)
    monkeypatch.setattr("dynx.cli.queries.explain.console", lambda: screen)
    explain("DX101", None)
    shown = screen.file.getvalue()  # type: ignore[attr-defined]
    assert "A link has no <inertial>" in " ".join(shown.split())
    assert "\\<" not in shown
