"""Tests of the tutorial's programs and notebooks, which its pages are the source of."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from docs.tutorial.pages import STEPS, notebook, parts, program, reduced, write
from tests.page_blocks import missing_line, programs

PAGE = """# 1. Fall

Text of the step.

```python
steps = 1_000  # small: 10
print(steps)
```

```text
1000
```

<details>
<summary>Answer</summary>

```python
answer = 2 * steps
```

Twice as many.

</details>
"""


def test_parts_are_in_order_and_answers_are_folded() -> None:
    assert [(part.language, part.folded) for part in parts(PAGE)] == [
        ("", False),
        ("python", False),
        ("text", False),
        ("", False),
        ("python", True),
        ("", True),
    ]


def test_a_program_runs_alone_and_has_the_text_as_comments() -> None:
    for small, answer in ((False, 2000), (True, 20)):
        variables: dict[str, object] = {}
        exec(program(PAGE, small=small), variables)
        assert variables["answer"] == answer
    assert "# Text of the step." in program(PAGE)
    assert "<" not in program(PAGE)


def test_small_values_are_those_of_the_comments() -> None:
    assert reduced("  n = f(3)  # small: 5\nm = 4  # more\n") == "  n = 5  # small: 5\nm = 4  # more\n"


def test_notebooks_are_valid_and_hide_answers() -> None:
    nbformat = pytest.importorskip("nbformat")
    for path in STEPS:
        nbformat.validate(notebook(path.read_text(encoding="utf-8")))
    hidden = [cell["metadata"] for cell in notebook(PAGE)["cells"] if "answer" in cell["source"]]
    assert hidden == [{"jupyter": {"source_hidden": True}}]


def test_each_step_becomes_a_program_and_a_notebook(tmp_path: Path) -> None:
    written = write(tmp_path)
    assert len(written) == 2 * len(STEPS)
    for path in written:
        if path.suffix == ".py":
            ast.parse(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", STEPS, ids=lambda path: path.stem)
def test_each_step_is_short_and_has_a_picture_a_comparison_and_an_answer(path: Path) -> None:
    page = path.read_text(encoding="utf-8")
    assert len(page.splitlines()) <= 200
    assert page.startswith(f"# {path.stem[0]}. ")
    for wanted in ("](" + path.stem[0] + "_", "\n## What dynx adds", "\n## Exercise", "\n<details>"):
        assert wanted in page, wanted


@pytest.mark.long_cases
@pytest.mark.parametrize("path", STEPS, ids=lambda path: path.stem)
def test_each_step_runs_alone_as_a_notebook_and_prints_what_it_shows(path: Path, tmp_path: Path) -> None:
    """Each in a process of its own: raw calls of PyBullet act on the first client of their process."""
    if path.stem == "9_learning":
        pytest.importorskip("stable_baselines3", reason="needs the extra train")
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    page = path.read_text(encoding="utf-8")
    document = nbformat.from_dict(notebook(page, small=True))
    client = nbclient.NotebookClient(
        document, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    cells = [cell for cell in document.cells if cell.cell_type == "code"]
    for cell, (_, shown) in zip(cells, programs(page), strict=True):
        printed = "".join(output.get("text", "") for output in cell.outputs)
        assert missing_line(printed, shown, digits=False) is None, printed
