"""Pages of docs that are written by a program are those that it writes."""

from __future__ import annotations

import importlib
import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dynx import load
from dynx.cli.shell.main import cli
from dynx.contacts import case_names
from dynx.registry import DEFAULT_ENGINE
from dynx.rules import all_rules
from dynx.sim.scenario.options import OPTIONS
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
    current = (DOCS / "simulation.md").read_text(encoding="utf-8")
    assert current == written["page"](current), "run: python docs/write_options.py"
    assert [name for name in OPTIONS if f"\n| `{name}` |" not in current] == []


def test_every_rule_has_one_anchor_and_its_trap_is_linked(rules_page: str) -> None:
    for rule in all_rules():
        assert rules_page.count(f'<a id="{rule.id.lower()}"></a>') == 1
        assert f"(../models/traps/{rule.trap()})" in rules_page


def test_the_cases_of_contacts_are_listed_and_have_results() -> None:
    writer = runpy.run_path(str(DOCS / "write_contacts.py"))
    page = (DOCS / "contacts.md").read_text(encoding="utf-8")
    current = writer["replaced"](page, "cases", writer["cases"]())
    assert current == page, "run: python docs/write_contacts.py"
    results = page.partition("<!-- written: verdicts -->")[2].partition("<!-- end -->")[0]
    assert [name for name in case_names() if f"| `{name}` |" not in results] == []


def test_tables_of_contacts_have_every_verdict() -> None:
    parts = runpy.run_path(str(DOCS / "write_contacts.py"))["results"](example("a | b"))
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
