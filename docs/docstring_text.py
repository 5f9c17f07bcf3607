"""Docstrings of dynx as the pages of the reference show them."""

from __future__ import annotations

import re
import sys

from sphinx.pycode import ModuleAnalyzer

CODE_INDENT = 4
"""Blanks by which code is indented more than the paragraph above it."""


def restructured(lines: list[str]) -> list[str]:
    """Return the lines of a docstring as reStructuredText: an indented block after a paragraph is code."""
    result: list[str] = []
    in_code = False
    in_list = False
    for line in lines:
        indent = len(line) - len(line.lstrip())
        after_blank = not result or not result[-1].strip()
        if line.strip():
            if indent == 0:
                in_code, in_list = False, is_item(line)
                if in_list and not after_blank and not is_item(result[-1]) and result[-1][0] != " ":
                    result.append("")
            elif indent >= CODE_INDENT and after_blank and not in_code and not in_list:
                language = "python" if PYTHON.search(line) else "text"
                result += [f".. code-block:: {language}", ""]
                in_code = True
        result.append(line if in_code else escaped(line))
    return result


def escaped(line: str) -> str:
    """Return a line of text whose stars and bars are themselves and no markup, as in (*size, nq) and |v|."""
    parts = re.split(r"(``.*?``|`[^`]*`)", line)
    return "".join(
        part if k % 2 else part.replace("(*", r"(\*").replace("|", r"\|") for k, part in enumerate(parts)
    )


def is_item(line: str) -> bool:
    """Return whether a line begins an item of a list."""
    return line.lstrip().startswith(("- ", "* "))


PYTHON = re.compile(r"^\s*(import|from|with|for|class|def|@|#)\b|\w\(.*|^\s*\w+ = ")
"""Marks of a line of Python, which trees of names and drawings do not have."""


def constant_text(name: str, value: object) -> list[str]:
    """Return the docstring of a constant, from the module below its package that defines it."""
    package, _, attribute = name.rpartition(".")
    for module in sorted(each for each in sys.modules if f"{each}.".startswith(f"{package}.")):
        if vars(sys.modules[module]).get(attribute) is value:
            text = ModuleAnalyzer.for_module(module).find_attr_docs().get(("", attribute))
            if text:
                return text
    return []
