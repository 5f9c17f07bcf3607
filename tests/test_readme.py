"""The README says what is true: its Python runs, its commands print what it shows."""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path
from types import ModuleType

import pytest

from docs.tutorial.pages import reduced
from dynx import backends
from dynx.control import registry as controllers
from dynx.sim.plants import registry as plants

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = {"README.md": (ROOT / "README.md").read_text(encoding="utf-8")} | {
    path.relative_to(DOCS).as_posix(): path.read_text(encoding="utf-8") for path in sorted(DOCS.rglob("*.md"))
}
"""Text of the README, and of each page by its path in `docs`."""

README = PAGES["README.md"]


def blocks(language: str, text: str = README) -> list[str]:
    """Return the fenced blocks of one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)


def programs(text: str) -> list[tuple[str, str]]:
    """(program, output shown) of every Python block: the block of text that follows it at once, if any."""
    return re.findall(
        r"^```python\n(.*?)^```$(?:\n\n```text\n(.*?)^```$)?", text, flags=re.MULTILINE | re.DOTALL
    )


def section(heading: str) -> str:
    found = re.search(rf"^## {heading}\n(.*?)(?=^## |\Z)", README, flags=re.MULTILINE | re.DOTALL)
    assert found, f"README.md has no section {heading!r}"
    return found.group(1)


def commands() -> list[tuple[str, str]]:
    """(command, output shown) of every ``$ dynx ...`` in the console blocks."""
    found = []
    for block in blocks("console"):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, shown = part.partition("\n")
            found.append((command, shown))
    return found


def shape(line: str) -> str:
    """Return a line with its numbers, and the blanks that align them, taken out."""
    return re.sub(r"\s+", " ", re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", line)).strip()


def check_output(printed: str, shown: str) -> None:
    """Check that each line shown was printed, but for its numbers."""
    lines = {shape(line) for line in printed.splitlines()}
    for line in shown.splitlines():
        if shape(line) not in ("", "..."):
            assert shape(line) in lines, f"not printed any more: {line}\n{printed}"


@pytest.mark.parametrize(
    "page",
    # Those of the tutorial run in processes of their own: tests/test_tutorial.py.
    [page for page, text in PAGES.items() if blocks("python", text) and not page.startswith("tutorial/")],
)
def test_python_blocks_run_in_order_and_print_what_is_shown(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if page == "reinforcement_learning.md":
        pytest.importorskip("stable_baselines3", reason="needs the extra train")
    monkeypatch.chdir(tmp_path)
    registries = (
        (backends.backend_names, backends.unregister),
        (controllers.controller_names, controllers.unregister),
        (plants.plant_names, plants.unregister),
    )
    before = [set(names()) for names, _ in registries]
    # Dataclasses look their module up by name.
    module = ModuleType("page")
    monkeypatch.setitem(sys.modules, "page", module)
    try:
        for program, shown in programs(PAGES[page]):
            with redirect_stdout(io.StringIO()) as printed:
                exec(compile(reduced(program), page, "exec", dont_inherit=True), module.__dict__)
            check_output(printed.getvalue(), shown)
    finally:
        for (names, unregister), known in zip(registries, before, strict=True):
            for name in set(names()) - known:
                unregister(name)


def test_the_readme_has_python() -> None:
    assert len(blocks("python")) >= 3


@pytest.mark.parametrize("page", list(PAGES))
def test_links_lead_somewhere(page: str) -> None:
    home = ROOT if page == "README.md" else (DOCS / page).parent
    for target in re.findall(r"\]\(([^)#]+)\)", PAGES[page]):
        assert target.startswith("https://") or (home / target).exists(), target


@pytest.mark.parametrize(
    ("command", "shown"), commands(), ids=lambda text: text.splitlines()[0] if text else ""
)
def test_console_blocks_print_what_is_shown(command: str, shown: str) -> None:
    words = shlex.split(command, comments=True)
    assert words[0] == "dynx", f"a console block of README.md starts with {words[0]!r}"
    result = subprocess.run(
        [sys.executable, "-m", "dynx", *words[1:]],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
        env={**os.environ, "COLUMNS": "80"},
    )
    # The doctor's answer on a robot on which engines differ is no.
    assert result.returncode == (1 if words[1] == "doctor" else 0), result.stderr
    check_output(result.stdout, shown)


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
