"""Cases of a user: those that worker processes cannot import are refused before they run."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

from dynx.contacts import conform
from dynx.errors import ArgumentError
from tests.cli.contacts.documents import Sliding
from tests.world.engines import WORLDS

ENGINES = [name for name in WORLDS if find_spec(name) is not None]

pytestmark = pytest.mark.skipif(not ENGINES, reason="needs an engine for worlds")

PAGE = Path(__file__).parents[2] / "docs" / "contacts.md"


def test_a_case_of_the_program_that_runs_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Sliding, "__module__", "__main__")
    with pytest.raises(ArgumentError, match="a module of its own"):
        conform(ENGINES[:1], cases=[Sliding()])


def test_the_case_of_the_documentation_falls_with_the_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = PAGE.read_text(encoding="utf-8").partition("## A case of your own")[2]
    (tmp_path / "falling_ball.py").write_text(code.split("```python\n")[1].split("```")[0])
    monkeypatch.syspath_prepend(tmp_path)
    import falling_ball  # type: ignore[import-not-found]

    found = conform(ENGINES[:1], (4e-3, 2e-3), [falling_ball.FreeFall()], jobs=1)
    assert [result.verdict.kind for result in found.results] == ["falls", "falls"]
    assert found.results[0].verdict.order == pytest.approx(1.0, abs=1e-6)
