"""The README and the pages of docs say what is true: their blocks run alone and print what is shown."""

from __future__ import annotations

import json
import re
import sys
from importlib import import_module
from zlib import crc32

import pytest

from tests.page_blocks import (
    PAGES,
    PARSED,
    ROOT,
    RUN,
    Block,
    absent_packages,
    blocks_of,
    fenced,
    missing_line,
    run,
    unbound_names,
)

README = PAGES["README.md"]
BLOCKS = [block for page in PAGES for block in blocks_of(page)]

SAMPLE = 24
"""One of so many blocks is run in every run of the tests, all by `python -m tests.page_blocks`."""


def sampled() -> list[Block]:
    """Return those of the README, and a sample of the others by their text, except for the tutorial's.

    Steps of the tutorial are run as notebooks by tests/test_tutorial.py. One of the gallery takes a minute;
    tests/test_docs.py draws one in small. Few blocks of `sh` show what they print.
    """
    return [
        block
        for block in BLOCKS
        if block.page == "README.md"
        or (
            block.language != "sh"
            and block.page != "gallery.md"
            and len(block.cells) == 1
            and crc32(block.text.encode()) % SAMPLE == 0
        )
    ]


def section(heading: str) -> str:
    found = re.search(rf"^## {heading}\n(.*?)(?=^## |\Z)", README, flags=re.MULTILINE | re.DOTALL)
    assert found, f"README.md has no section {heading!r}"
    return found.group(1)


@pytest.mark.parametrize("block", sampled(), ids=str)
def test_blocks_run_alone_and_print_what_is_shown(block: Block) -> None:
    if absent := absent_packages(PAGES[block.page]):
        pytest.skip(f"needs {', '.join(sorted(absent))}")
    assert run(block, small=True).fault == ""


@pytest.mark.parametrize("page", [page for page in PAGES if fenced("python", PAGES[page])])
def test_blocks_bind_each_name_that_they_read(page: str) -> None:
    for block in blocks_of(page):
        if block.language == "python":
            assert unbound_names(block.text) == set(), str(block)


SHOWN = ("text", "powershell")
"""Languages whose blocks are only shown: what a command prints, and commands for Windows."""


def test_each_block_is_run_parsed_or_only_shown() -> None:
    """A block of another language, such as `py`, would be checked by nobody."""
    for page, text in PAGES.items():
        for language in re.findall(r"^ *```(\w+)$", text, flags=re.MULTILINE):
            assert language in (*RUN, *PARSED, *SHOWN), page


def test_documents_are_parsed() -> None:
    yaml = pytest.importorskip("yaml")
    toml = import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
    parsers = {"toml": toml.loads, "json": json.loads, "yaml": yaml.safe_load}
    assert not any(fenced("xml", text) for text in PAGES.values())
    for page, text in PAGES.items():
        for language, parse in parsers.items():
            for block in fenced(language, text):
                assert parse(block), page


def test_a_block_that_needs_another_is_found() -> None:
    assert unbound_names("import numpy as np\ndef f(x):\n    return np.sin(x + y)\nf(robot)\n") == {
        "y",
        "robot",
    }
    wrong = Block("ik.md", 1, "python", (("print(2.5e-3)\n", "2.3e-3\n"),), "")
    assert run(wrong).fault.startswith("not printed: 2.3e-3")
    hidden = Block("ik.md", 1, "python", (("import viser\n", ""),), "")
    assert "No module named 'viser'" in run(hidden).fault
    shown = Block("ik.md", 1, "sh", (("cat shown.txt\n", "text\n"),), "", (("shown.txt", "text\n"),))
    assert run(shown).fault == ""


def test_numbers_are_compared_in_the_digits_shown() -> None:
    assert missing_line("error 1.2345e-5 of 3\n", "error 1.23e-5 of 3\n") is None
    assert missing_line("error 1.2545e-5 of 3\n", "error 1.23e-5 of 3\n") is not None
    assert missing_line("error 1.23e-5 of 4\n", "error 1.23e-5 of 3\n") is not None
    assert missing_line("error 1.23e-5 of 4\n", "error 1.23e-5 of 3\n", digits=False) is None
    assert missing_line("residual -3e-17\n", "residual 2.1e-16\n") is None
    assert missing_line("a\nb\n", "b\n...\na\n") == "a"


def test_the_readme_has_python() -> None:
    assert len(fenced("python", README)) >= 3


@pytest.mark.parametrize("page", list(PAGES))
def test_links_lead_somewhere(page: str) -> None:
    home = ROOT if page == "README.md" else (ROOT / "docs" / page).parent
    for target in re.findall(r"\]\(([^)#]+)\)", PAGES[page]):
        assert target.startswith("https://") or (home / target).exists(), target


@pytest.mark.parametrize("heading", ["Quick start", "Run the tests"])
def test_set_up_is_one_line(heading: str) -> None:
    found = re.findall(r"^```sh\n(.*?)^```$", section(heading), flags=re.MULTILINE | re.DOTALL)
    assert len(found) == 1
    assert len(found[0].splitlines()) == 1


def test_the_checks_name_tests_that_exist() -> None:
    """`.ci/run` ends with an error at a test that it names and that has another name."""
    named = re.findall(
        r"(tests/[\w/]+\.py)::(\w+)\[([\w./]+)\]", (ROOT / ".ci/run").read_text(encoding="utf-8")
    )
    assert named
    for path, function, page in named:
        assert f"\ndef {function}(" in (ROOT / path).read_text(encoding="utf-8")
        assert page in PAGES or f"tutorial/{page}.md" in PAGES
