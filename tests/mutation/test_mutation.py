"""The driver of mutation runs: its population, its sample, and the order of the tests."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

pytest.importorskip("mutmut", reason="mutation runs need the extra 'mutation'")

from tests.mutation.__main__ import MIN_PER_ROOM, SOURCES
from tests.mutation.coverage_map import CoverageMap, checksums
from tests.mutation.population import Mutant, places, sample
from tests.mutation.trial import (
    BROKEN,
    CAUGHT,
    SURVIVED,
    assigned_names,
    covering_tests,
    ordered,
    own_tests,
    verdict,
)
from tests.mutation.warm import ROOT, Change, Runner

SOURCE = '''"""Docstring."""
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    LIMIT = 1

__all__ = ["f"]
Pair = dict[str, "int"]
Kind = TypeVar("Kind", bound=int)
Real = int | float

def f(x: "int") -> "int":
    """Docstring."""
    assert x > 0
    if x == 1:
        raise ValueError("not" + " one")
    return cast("int", x) + 2
'''


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "dynx").mkdir()
    (tmp_path / "dynx" / "f.py").write_text(SOURCE, encoding="utf-8")
    (tmp_path / "dynx" / "g.py").write_text("def g(x):\n    return [x * 3, x * 3]\n", encoding="utf-8")
    return tmp_path


def test_the_population_is_what_decides_behaviour(root: Path) -> None:
    found = {(place.function, place.text, place.line) for place in places(root, "dynx/f.py")}
    assert found == {("f", "== 1", 15), ("f", "1", 15), ("f", 'cast("int", x) + 2', 17), ("f", "2", 17)}


SMALL_ROOMS = {"safe_path"}
"""Rooms with fewer places than a sample takes of each: all of them are in it."""


@pytest.mark.parametrize("room", SOURCES)
def test_a_sample_takes_enough_mutants_of_every_room(room: str) -> None:
    source = ROOT / SOURCES[room]
    files = (
        [source] if source.is_file() else sorted(source.rglob("*.py"), key=lambda file: file.stat().st_size)
    )
    found = (place for file in files for place in places(ROOT, file.relative_to(ROOT).as_posix()))
    enough = len(list(islice(found, MIN_PER_ROOM))) == MIN_PER_ROOM
    assert enough == (room not in SMALL_ROOMS)


def test_every_room_is_a_source() -> None:
    rooms = {file.relative_to(ROOT / "dynx").parts[0] for file in (ROOT / "dynx").rglob("*.py")}
    assert {room.removesuffix(".py") for room in rooms if not room.startswith("_")} == SOURCES.keys()


def test_a_sample_is_one_mutant_of_each_of_its_places(root: Path) -> None:
    mutants, total = sample(root, ["dynx"], 0, 100)
    assert len(mutants) == total == 4 + 4
    for mutant in mutants:
        original = (root / mutant.path).read_text(encoding="utf-8")
        assert mutant.source != original
        assert mutant.source.count("\n") == original.count("\n")
        compile(mutant.source, mutant.path, "exec")


def test_a_sample_has_mutants_of_every_source(root: Path) -> None:
    small = root / "dynx" / "small"
    small.mkdir()
    (small / "h.py").write_text("def h(x):\n    return x + 5\n", encoding="utf-8")
    sources = ["dynx/f.py", "dynx/small"]
    for seed in range(5):
        mutants, total = sample(root, sources, seed, 5, 2)
        assert total == 4 + 2
        assert sum(mutant.path.startswith("dynx/small") for mutant in mutants) == 2
        assert len(mutants) == 5
    assert len(sample(root, sources, 0, 1, 2)[0]) == 4


def test_an_edit_of_one_file_leaves_the_sample_of_the_others(root: Path) -> None:
    before = {mutant.key for mutant in sample(root, ["dynx"], 1, 100)[0] if mutant.path == "dynx/g.py"}
    (root / "dynx" / "f.py").write_text("y = 1 + 2\n" + SOURCE, encoding="utf-8")
    after = {mutant.key for mutant in sample(root, ["dynx"], 1, 100)[0] if mutant.path == "dynx/g.py"}
    assert before == after
    other = {mutant.key for mutant in sample(root, ["dynx"], 2, 4)[0]}
    assert other != {mutant.key for mutant in sample(root, ["dynx"], 1, 4)[0]}


def test_each_test_comes_once_before_any_with_other_parameters() -> None:
    durations = {"t::slow": 9.0, "t::f[a]": 1.0, "t::f[b]": 2.0, "tests/rbd/t::own": 30.0}
    assert ordered(set(durations), durations, "rbd") == ["t::f[a]", "tests/rbd/t::own", "t::slow", "t::f[b]"]


def test_a_module_has_its_own_tests_at_the_mirrored_path() -> None:
    assert own_tests("dynx/errors.py") == "tests/test_errors.py"
    assert own_tests("dynx/rbd/aba.py") == "tests/rbd/test_aba.py"
    assert own_tests("dynx/model/xml/text.py") == "tests/model/xml/test_text.py"


def test_tests_of_a_constant_are_those_of_the_lines_that_use_it() -> None:
    path = "dynx/errors.py"
    text = (ROOT / path).read_text(encoding="utf-8")
    lines = text.splitlines()
    defined, read = (
        next(number for number, line in enumerate(lines, 1) if part in line)
        for part in ("TRACEBACK_VARIABLE = ", "environ.get(TRACEBACK_VARIABLE")
    )
    assert assigned_names(text, defined) == ["TRACEBACK_VARIABLE"]
    assert assigned_names(text, read) == []
    coverage = CoverageMap(
        {"tests/architecture/t.py::names": 1.0}, {path: {read: {"t::traceback"}, 1: {"t::other"}}}
    )
    constant = Mutant(path, "", defined, defined, "string", "", "", text)
    assert covering_tests(constant, coverage) == {"t::traceback"}
    function = replace(constant, line=read, last_line=read)
    assert covering_tests(function, coverage) == {"t::traceback"}
    assert covering_tests(replace(function, line=2, last_line=2), coverage) == {"t::traceback", "t::other"}
    assert covering_tests(replace(function, path="dynx/registry.py"), coverage) == {
        "tests/architecture/t.py::names"
    }


def test_a_verdict_names_the_test_that_failed() -> None:
    assert verdict(0, "") == (SURVIVED, "")
    assert verdict(1, "FAILED tests/t.py::a[1] - AssertionError\n") == (CAUGHT, "tests/t.py::a[1]")
    assert verdict(2, "ERROR tests/t.py - ImportError\n") == (CAUGHT, "import of tests/t.py")
    assert verdict(4, "ERROR: found no collectors for t.py::a\n") == (CAUGHT, "import of t.py")
    assert verdict(4, "ERROR: not found: t.py::a\n")[0] == BROKEN
    assert verdict(-14, "") == (CAUGHT, "time limit")
    assert verdict(-11, "") == (CAUGHT, "signal 11")
    assert verdict(5, "no tests ran")[0] == BROKEN


def test_a_map_is_what_was_saved_and_replaced_by_folder(tmp_path: Path) -> None:
    kept = CoverageMap(
        {"a.py::t": 1.0, "b.py::t": 2.0}, {"x.py": {1: {"a.py::t"}, 2: {"a.py::t", "b.py::t"}}}
    )
    kept.save(tmp_path / "map.json")
    loaded = CoverageMap.load(tmp_path / "map.json")
    assert loaded == kept
    loaded.replace(CoverageMap({"a.py::u": 3.0}, {"x.py": {2: {"a.py::u"}}}))
    assert loaded.durations == {"b.py::t": 2.0, "a.py::u": 3.0}
    assert loaded.tests("x.py", [2]) == {"b.py::t", "a.py::u"}
    assert loaded.tests("x.py", [7]) == set()
    assert loaded.tests_of_file("x.py") == {"b.py::t", "a.py::u"}


def test_lines_keep_their_tests_where_edits_move_them(tmp_path: Path) -> None:
    source = tmp_path / "x.py"
    source.write_text("a\nb\nc\nd\n")
    lines = {1: {"t::a"}, 2: {"t::b"}, 3: {"t::c"}, 4: {"t::d"}}
    recorded = CoverageMap(
        {}, {"x.py": lines, "gone.py": {1: {"t::a"}}}, {"x.py": checksums(source), "gone.py": [0]}
    )
    source.write_text("new\na\nother\nd\n")
    moved = recorded.moved(tmp_path)
    assert moved.lines == {"x.py": {2: {"t::a"}, 3: {"t::b", "t::c"}, 4: {"t::d"}}}
    assert moved.moved(tmp_path) == moved


def test_a_change_reaches_the_tests_and_the_processes_that_they_start(tmp_path: Path) -> None:
    test = tmp_path / "test_changed.py"
    test.write_text(
        "import subprocess, sys\n"
        "PROGRAM = 'import dynx.safe_path; print(dynx.safe_path.changed)'\n"
        "def test_here():\n"
        "    import dynx.safe_path\n"
        "    assert dynx.safe_path.changed == 'yes'\n"
        "def test_in_a_child():\n"
        "    assert subprocess.check_output([sys.executable, '-c', PROGRAM], text=True) == 'yes\\n'\n"
    )
    with Runner() as runner:
        assert runner.run([str(test)], Change("dynx.safe_path", "changed = 'yes'"))[0] == 0
        assert runner.run([f"{test}::test_here"])[0] == 1
        assert runner.run([f"{test}::test_in_a_child"])[0] == 1
