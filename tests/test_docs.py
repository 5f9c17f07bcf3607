"""Pages of docs that are written by a program are those that it writes."""

from __future__ import annotations

import importlib
import json
import re
import runpy
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from benchmarks.surveys.robot_pairs import PairResult, read_pairs
from docs import (
    page_parts,
    pairs,
    public_files,
    sentences,
    survey,
    write_contacts,
    write_engines,
    write_results,
)
from dynx import load
from dynx.cli.shell.main import cli
from dynx.contacts import case_names
from dynx.registry import DEFAULT_ENGINE
from dynx.rules import all_rules
from dynx.sim.scenario.options import OPTIONS
from dynx.steppers.registry import world_class
from dynx.world import World, read_scene
from dynx.world.scene.documents import scene_from_document
from tests.cli.contacts.documents import example

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def rules_page() -> str:
    """Return the text that the program writes now."""
    written = runpy.run_path(str(DOCS / "write_rules.py"))["page"]()
    assert isinstance(written, str)
    return written


def test_the_page_of_rules_is_current(rules_page: str) -> None:
    current = (DOCS / "rules.md").read_text(encoding="utf-8")
    assert current == rules_page, "run: python docs/write_rules.py"


@pytest.mark.skipif(DEFAULT_ENGINE != "pinocchio", reason="the table has the default of most machines")
def test_the_table_of_options_is_current() -> None:
    written = runpy.run_path(str(DOCS / "write_options.py"))
    current = (DOCS / "reference/simulation.md").read_text(encoding="utf-8")
    assert current == written["page"](current), "run: python docs/write_options.py"
    assert [name for name in OPTIONS if f"\n| `{name}` |" not in current] == []


def test_every_rule_has_one_anchor_and_its_trap_is_linked(rules_page: str) -> None:
    for rule in all_rules():
        assert rules_page.count(f'<a id="{rule.id.lower()}"></a>') == 1
        assert f"(../models/traps/{rule.trap()})" in rules_page


@pytest.mark.skipif(DEFAULT_ENGINE != "pinocchio", reason="the table has the default of most machines")
def test_the_defaults_of_dynxs_own_world_engine_are_those_of_the_page() -> None:
    page = (DOCS / "reference/worlds.md").read_text(encoding="utf-8")
    known = world_class("dynx").settings
    for name in ("backend", "integrator"):
        assert f"| `{name}` | `{known[name].default}` |" in page


def test_the_cases_of_contacts_are_listed_and_have_results() -> None:
    page = (DOCS / "contacts.md").read_text(encoding="utf-8")
    current = page_parts.replaced(DOCS / "contacts.md", page, "cases", write_contacts.cases())
    assert current == page, "run: python -m docs.write_contacts"
    results = page.partition("<!-- written: verdicts -->")[2].partition("<!-- end -->")[0]
    assert [name for name in case_names() if f"| `{name}` |" not in results] == []


def test_documents_of_several_engines_make_one_table() -> None:
    whole: dict[str, Any] = json.loads(json.dumps(example("a | b")))
    names = [each["engine"] for each in whole["engines"]]
    assert len(names) > 1

    def of(engine: str) -> dict[str, Any]:
        def own(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
            return [each for each in found if each["engine"] == engine]

        cases = [
            {**case, "figures": own(case["figures"]), "no_results": own(case["no_results"])}
            for case in whole["cases"]
        ]
        return {**whole, "engines": own(whole["engines"]), "cases": cases, "runs": 1}

    joined = write_contacts.joined([of(name) for name in names])
    assert joined["runs"] == len(names)
    parts = write_contacts.results({**joined, "runs": whole["runs"]})
    # The engines without a coefficient come in the order of the documents.
    assert {name: sorted(part.splitlines()) for name, part in parts.items()} == {
        name: sorted(part.splitlines()) for name, part in write_contacts.results(whole).items()
    }


def test_tables_of_contacts_have_every_verdict() -> None:
    parts = write_contacts.results(example("a | b"))
    assert (
        "9 figures of 1 cases (4 within, 1 falls, 1 cannot, 2 setting, 1 unexplained)" in parts["conditions"]
    )
    assert (
        "| `sliding` | setting, 1.0e-01 .. 1.0e-01 | unexplained, 1.0e+00 .. not finite "
        "| setting, 3.0e-02 .. 3.0e-02 |" in parts["verdicts"]
    )
    assert (
        "| one | `stiffness 1e+06 \u2192 1e+08` | `sliding`: acceleration, slow "
        "| 1.0e-01 .. 1.0e-01 | 1.0e-03 .. 1.0e-03 | falls with the setting (order 1.0) | speed, fast, "
        in parts["settings"]
    )
    assert "| three | `sliding` | a \\| b |" in parts["lacking"]
    assert "falls (order 1.0), 4.0e-02 .. 1.0e-02" in parts["figures"]


def test_the_gallery_shows_the_code_of_each_picture(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("viser", reason="needs the extra viewer")
    gallery = importlib.import_module("docs.gallery")
    current = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert current == gallery.page(), "run: python -m docs.gallery"
    files = [DOCS / "gallery" / f"{Path(name).stem}.webp" for name in gallery.PICTURES]
    assert len(files) >= 20
    assert sorted(files) == sorted((DOCS / "gallery").iterdir())
    assert sum(file.stat().st_size for file in files) <= 6e6
    monkeypatch.setattr(gallery, "FOLDER", tmp_path)
    monkeypatch.setattr(gallery, "SIZE", (80, 60))
    gallery.write("stack.png")
    sizes = []
    for file in (DOCS / "gallery" / "stack.webp", tmp_path / "stack.webp"):
        with gallery.Image.open(file) as picture:
            sizes.append(picture.size)
            small = np.asarray(picture.convert("RGB").resize((16, 12)), dtype=np.float64)
        if file.parent != tmp_path:
            committed = small
    assert sizes[1] == (80, 60)
    # The caption is larger in a small picture.
    assert np.median(np.abs(small - committed)) < 10.0


PROSE = sentences.pages()


@pytest.mark.parametrize("path", PROSE, ids=lambda path: path.relative_to(sentences.ROOT).as_posix())
def test_few_sentences_of_a_page_are_long(path: Path) -> None:
    """A page of fewer than 20 sentences may have none; so the share on all pages is below the bound, too."""
    found = list(sentences.sentences(path))
    lines = [f"{each.file}:{each.line}: {each.text}" for each in sentences.long(found)]
    assert len(lines) <= sentences.MAX_SHARE * len(found), "\n".join(lines)


def test_sentences_are_prose_with_their_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "page.md"
    many = " ".join(["word"] * 31)
    page.write_text(
        f"""# {many}

One sentence, e.g. this, has `a. b. c` as one word. It ends [here](there. or. not); {many}!

| {many} |
|---|

```python
{many}
```

- An item by A. Author
  goes on
- {many}

<!-- written: part -->
{many}
<!-- end -->
Code:

    {many}

$${many}$$
Is $a. b$ a word? A. Author, "{many}", Journal (2017).
""",
        encoding="utf-8",
    )
    monkeypatch.setattr(sentences, "ROOT", tmp_path)
    found = list(sentences.sentences(page))
    assert [each.line for each in found] == [3, 3, 12, 14, 19, 24, 24]
    assert found[0].text == "One sentence, e.g. this, has `a.b.c` as one word."
    assert found[0].words == 9
    assert found[1].text == f"It ends here; {many}!"
    assert found[2].text == "An item by A. Author goes on"
    assert found[5].text == "Is $a.b$ a word?"
    assert [each.line for each in sentences.long(found)] == [3, 14]


@pytest.mark.parametrize(
    ("page", "name", "command"),
    [
        *(
            ("results.md", name, write_results.shown(command))
            for name, part in write_results.PARTS.items()
            for command in part.commands
        ),
        *(("engines.md", name, write_engines.command(name)) for name in write_engines.PARTS),
    ],
)
def test_each_measured_table_has_its_command_and_machine(page: str, name: str, command: str) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    part = text.partition(f"<!-- written: {name} -->")[2].partition("<!-- end -->")[0]
    assert f"\n    {command}\n" in part
    day = r"(20\d\d-\d\d-\d\d, in .*|Measured before .*, on 20\d\d-\d\d-\d\d)"
    machine = rf"^\*{day}; .*\d doubles in a vector, .* cores.*; Python .*\*$"
    assert re.search(machine, part, re.MULTILINE)
    assert re.search(r"^\||^```text", part, re.MULTILINE)


def written_part(page: Path, name: str) -> str:
    """Return the text between the marks of a part of a page."""
    return (
        page.read_text(encoding="utf-8")
        .partition(f"<!-- written: {name} -->\n")[2]
        .partition("<!-- end -->")[0]
    )


def test_the_list_of_public_files_is_as_its_program_writes_it() -> None:
    written = written_part(public_files.PAGE, "sources")
    files = [
        {"half": part, "repo": repository, "commit": commit}
        for part, listed in re.findall(r"^Part (\w): (.*)\.$", written, re.MULTILINE)
        for repository, commit, count in re.findall(r"([^ ,]+)@(\w+) \((\d+)\)", listed)
        for _ in range(int(count))
    ]
    assert public_files.sources(files) == written


def test_the_tables_of_public_files_are_as_their_program_writes_them() -> None:
    causes: dict[str, Counter[str]] = {part: Counter() for part in "ABC"}
    written = written_part(public_files.PAGE, "causes")
    for rule, *counts in re.findall(
        r"^\| \[(DX\d+)\].*? \| (\d+) \| (\d+) \| (\d+) \|$", written, re.MULTILINE
    ):
        for counter, count in zip(causes.values(), counts, strict=True):
            counter[rule] = int(count)
    assert public_files.causes_table(causes) == written
    assert written_part(public_files.PAGE, "figures").startswith(page_parts.table(public_files.HEADS, []))


def test_the_tables_of_pairs_are_as_their_program_writes_them() -> None:
    listed = read_pairs()
    results = [PairResult(pair, "different", "", 1, 0, 0.5, "link a<b", engines=0.25) for pair in listed]
    written = dict(pairs.parts(results))
    assert written["repositories"] == written_part(pairs.PAGE, "repositories")
    for part in ("bar", "develop"):
        current = written_part(pairs.PAGE, part)
        assert [row.split(" | ")[:2] for row in current.splitlines()[2:]] == [
            row.split(" | ")[:2] for row in written[part].splitlines()[2:]
        ]
        assert " | different | 1 |  | 0.5: link a&lt;b | 0.25 |\n" in written[part]


def test_the_survey_of_real_robots_writes_a_part_for_each_collection() -> None:
    for group in survey.GROUPS:
        written = written_part(survey.PAGE, group)
        assert written.startswith("- fixed base: ")
        assert "\n".join(survey.section([])).splitlines()[2:5] == written.splitlines()[2:5]


def test_results_of_benchmarks_become_tables() -> None:
    header = "engine    quantity                     binding      dynx      more unchecked\n"
    printed = header + "one       jacobian                       1,000     1,500       500     1,200  OVER\n"
    printed += "two       all frames                       900       800      -100       700\n"
    calls = write_results.calls_table([printed])
    assert "| `jacobian` | 1,000 + 500 |  |" in calls
    assert "| `all frames` |  | 900 - 100 |" in calls

    def way(name: str, role: str, ns: float | None) -> dict[str, object]:
        return {"way": name, "role": role, "ns": ns, "roofline": None}

    ways = [way("compiled", "backend", 20.0), way("pinocchio C++ batch", "peer", 1000.0)]
    ways += [way("two", "backend", 5000.0), way("three", "backend", None)]
    results = [{"quantity": "inverse_dynamics", "batch": size, "ways": ways} for size in write_results.SIZES]
    document = json.dumps({"robot": "arm", "results": results[:1]})
    assert "| arm | inverse dynamics | 20 | 1000 (50x) |  |  |  |" in write_results.batches_table([document])
    backends = write_results.backend_tables([json.dumps({"results": results})])
    assert "| inverse dynamics | 250 |" in backends
    assert "| 65,536 | 0.02 | 5 |" in backends
    times = "seconds what\n1.0 a\n3.0 b\n\n2 rows, 0 of them too long; the longest:\n3.0 b\n"
    longest = write_results.longest_compile_times([times])
    assert longest == "```text\n2 rows, 0 of them too long; the longest:\nseconds what\n3.0 b\n```\n"
    assert write_results.printed_tables(["a\n\n| b |\n|---|\nc\n| d |\n"]) == "| b |\n|---|\n\n| d |\n"


def test_a_part_that_cannot_be_measured_stays(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    page = tmp_path / "results.md"
    page.write_text("<!-- written: one -->\nold\n<!-- end -->\n<!-- written: two -->\nold\n<!-- end -->\n")
    good = write_results.Part((("this", "--version"),))
    parts = {"one": write_results.Part((("dynx.no_such_module",),)), "two": good}
    monkeypatch.setattr(write_results, "PAGE", page)
    monkeypatch.setattr(write_results, "PARTS", parts)
    assert write_results.main([]) == 1
    written = page.read_text(encoding="utf-8")
    assert written.startswith(
        "<!-- written: one -->\nold\n<!-- end -->\n<!-- written: two -->\n    python -m this"
    )
    assert "Beautiful is better than ugly." in written
    assert written.endswith("```\n<!-- end -->\n")


def test_the_state_of_engines_counts_what_is_wrong() -> None:
    def engine(name: str, error: float | None, refused: str | None = None) -> dict[str, object]:
        return {
            "engine": name,
            "version": "1.0",
            "refused": refused,
            "not_used": None,
            "before": {} if refused else {"mass_matrix": error},
            "refused_after": None,
            "not_used_after": None,
            "after": {"mass_matrix": 1e-15},
        }

    def finding(effect: float | None, proved: bool) -> dict[str, object]:
        return {"rule": "DX105", "proved": proved, "effects": {"two": {"relative_error": effect}}}

    engines = [engine("one", 1e-15), engine("two", 1e-3)]
    first = {"engines": engines, "findings": [finding(1e-3, True), finding(1e-3, True)]}
    second = {
        "engines": [engine("one", 1e-7), engine("two", None, refused="no")],
        "findings": [finding(None, True), finding(1e-3, False), finding(1e-9, True)],
    }
    singular = {"engines": [{**engine("one", None), "before": {}}], "findings": []}
    counted = write_engines.files_table([first, second, singular])
    assert "| one 1.0 | 3 | 0 | 0 | 3 | 0 | 3 |" in counted
    assert "| two 1.0 | 2 | 1 | 0 | 0 | 1 | 2 |" in counted
    causes = write_engines.causes_table([first, second])
    assert "| two | [DX105](rules.md#dx105) inertia-not-diagonal 2 |" in causes
    contacts = write_engines.contacts_tables(example("a | b"))
    assert "| one | `sliding` |" in contacts
    assert "| three | `sliding` | `sliding` |" in contacts


@pytest.mark.parametrize("name", ["README.md", "docs/doctor.md"])
def test_the_danger_of_xacro_files_is_stated(name: str) -> None:
    """They are programs: xacro evaluates Python expressions in them."""
    words = " ".join((DOCS.parent / name).read_text(encoding="utf-8").split())
    assert re.search(
        "evaluates expressions of (a|the) file as Python code[,:] (so )?expand only files that you trust",
        words,
    )


def test_what_expands_xacro_files_says_that_they_run_code() -> None:
    readers = (read_scene, scene_from_document, World.read, load)
    texts = [reader.__doc__ or "" for reader in readers]
    helped = ("world", "view", "ik")
    texts += [CliRunner().invoke(cli, [command, "--help"], terminal_width=200).output for command in helped]
    for text in texts:
        words = " ".join(text.split())
        assert re.search(r"xacro.*(as )?Python code", words), words
        assert "trust" in words


def test_the_package_names_no_file_of_the_pages() -> None:
    """Who has installed dynx has no folder docs."""
    for module in (DOCS.parent / "dynx").rglob("*.py"):
        found = re.findall(r"\bdocs/[\w./-]*\w", module.read_text(encoding="utf-8"))
        assert not found, (module, found)


def test_no_link_is_called_by_its_file() -> None:
    """On the site the file is a page with a title."""
    for page in DOCS.rglob("*.md"):
        found = re.findall(r"\[[^\]\n]*\.md[^\]\n]*\]\(", page.read_text(encoding="utf-8"))
        assert not found, (page.name, found)


def test_no_page_has_marks_of_a_merge() -> None:
    """One page once had both versions of a paragraph."""
    for page in (DOCS.parent / "README.md", *DOCS.rglob("*.md")):
        found = re.findall(r"^(?:<{7}|>{7}) ", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert not found, page.name
