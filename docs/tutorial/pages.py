"""Programs and notebooks of the tutorial, made from its pages: a page of Markdown is the only source.

The Python blocks of a page, one after the other, are one program. A block of text that follows a Python block
at once is what the program prints there. A line that ends with a comment ``# small: VALUE`` assigns a number
that makes the program take long; the tests take VALUE instead.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, NamedTuple

HOME = Path(__file__).parent
STEPS = tuple(sorted(HOME.glob("[1-9]_*.md")))
"""Pages of the tutorial, in order."""

_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```\n", flags=re.MULTILINE | re.DOTALL)
_SMALL = re.compile(r"^(\s*\w+ = ).*?(\s+# small: )(.*)$", flags=re.MULTILINE)
_FOLDED = re.compile(r"</?details>\n*|<summary>.*?</summary>\n*")


class Part(NamedTuple):
    """A part of a page: text, or a block of code."""

    language: str
    """``python``, another language of a block, or ``""`` for text."""
    text: str
    folded: bool = False
    """True for a part of an answer, which the page shows on request."""


def parts(page: str) -> list[Part]:
    """Return the parts of a page in order."""
    found: list[Part] = []
    end = 0
    for block in _BLOCK.finditer(page):
        found.append(_text(page, end, block.start()))
        found.append(Part(block[1], block[2], _folded(page, block.start())))
        end = block.end()
    found.append(_text(page, end, len(page)))
    return [part for part in found if part.text.strip()]


def program(page: str, *, small: bool = False) -> str:
    """Return the program of a page, with its text as comments; `small` takes the values for tests."""
    written = []
    for part in parts(page):
        if part.language == "python":
            written.append(reduced(part.text) if small else part.text)
        elif not part.language:
            prose = part.text.strip().splitlines()
            written.append("".join(f"# {line}".rstrip() + "\n" for line in prose))
    return "\n".join(written)


def notebook(page: str, *, small: bool = False) -> dict[str, Any]:
    """Return the notebook of a page, as a JSON document of version 4.5 of nbformat."""
    cells: list[dict[str, Any]] = []
    for part in parts(page):
        if part.language == "python":
            text = reduced(part.text) if small else part.text
            cell: dict[str, Any] = {"cell_type": "code", "outputs": [], "execution_count": None}
            cell["source"] = text.rstrip("\n")
            cell["metadata"] = {"jupyter": {"source_hidden": True}} if part.folded else {}
        elif part.language == "text":
            continue  # the notebook prints it
        elif part.language:
            cell = {"cell_type": "markdown", "metadata": {}}
            cell["source"] = f"```{part.language}\n{part.text}```"
        else:
            cell = {"cell_type": "markdown", "metadata": {}, "source": part.text.strip()}
        cells.append({"id": f"part-{len(cells)}", **cell})
    return {
        "nbformat": 4,
        "nbformat_minor": 5,
        "metadata": {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}},
        "cells": cells,
    }


def reduced(code: str) -> str:
    """Return code in which each line with ``# small: VALUE`` assigns VALUE."""
    return _SMALL.sub(r"\1\3\2\3", code)


def write(folder: Path, *, small: bool = False) -> list[Path]:
    """Write the program and the notebook of each step to a folder, and return the paths of the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for path in STEPS:
        page = path.read_text(encoding="utf-8")
        text = json.dumps(notebook(page, small=small), indent=1) + "\n"
        for suffix, content in ((".py", program(page, small=small)), (".ipynb", text)):
            target = folder / (path.stem + suffix)
            target.write_text(content, encoding="utf-8")
            written.append(target)
    return written


def _text(page: str, start: int, end: int) -> Part:
    """Return a part of text without the marks that fold an answer."""
    text = _FOLDED.sub(lambda mark: "**Answer.**\n\n" if "summary" in mark[0] else "", page[start:end])
    return Part("", text, _folded(page, start))


def _folded(page: str, position: int) -> bool:
    """Return whether a position lies in an answer."""
    before = page[:position]
    return before.count("<details>") > before.count("</details>")
