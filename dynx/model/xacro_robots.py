"""Robots among the xacro files of a folder, told from the macros that they include without expanding any.

Packages of robot descriptions keep macros (``arm_macro.xacro``), properties and materials in files of their
own, and the robots in files that include them, which are the ones that a user loads.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence

from dynx.errors import DynxError
from dynx.files.reading import read_file
from dynx.model.xml.reading import Element, read_xml

_SHOWN_FILES = 5
"""Largest number of files that `left_out_note` names."""

_DEFINITIONS = frozenset({"arg", "include", "insert_block", "macro", "property"})
"""Elements of xacro that add no link by themselves; other elements of its namespace call a macro or
branch."""

_FIND = re.compile(r"^\$\(find [^)]*\)[/\\]*")


def xacro_robots(paths: Iterable[str]) -> list[str]:
    """Return those of the xacro files that describe a robot, in the order given.

    A robot is a ``<robot>`` with links, joints or calls of macros that no other of the files includes. A file
    that cannot be read as XML counts as a robot: nothing shows that it is none.
    """
    roots = {path: _root(path) for path in paths}
    included = {
        os.path.realpath(other)
        for path, root in roots.items()
        if root is not None
        for name in _included(root)
        for other in _targets(path, name, roots)
    }
    return [
        path
        for path, root in roots.items()
        if root is None or (_builds_robot(root) and os.path.realpath(path) not in included)
    ]


def left_out_note(paths: Sequence[str]) -> str:
    """Write the sentence about robots in xacro that were found in folders and not examined."""
    more = len(paths) - _SHOWN_FILES
    named = ", ".join(paths[:_SHOWN_FILES]) + (f" and {more} more" if more > 0 else "")
    robots = "1 robot in xacro was" if len(paths) == 1 else f"{len(paths)} robots in xacro were"
    return f"{robots} not examined, as expansion runs code of the file; name those that you trust: {named}"


def _root(path: str) -> Element | None:
    try:
        return read_xml(read_file(path), path, [])
    except DynxError:
        return None


def _builds_robot(root: Element) -> bool:
    return root.tag == "robot" and any(_adds_links(child) for child in root.children)


def _adds_links(element: Element) -> bool:
    """Check whether an element below the root adds links or joints, or could by calling a macro."""
    prefix, _, name = element.tag.rpartition(":")
    if not prefix:
        return name in ("link", "joint")
    if prefix != "xacro" or name in _DEFINITIONS:
        return False
    if name in ("if", "unless"):
        return any(_adds_links(child) for child in element.children)
    return True


def _included(element: Element) -> Iterable[str]:
    for child in element.children:
        if child.tag in ("xacro:include", "include"):
            yield child.attributes.get("filename", "")
        yield from _included(child)


def _targets(path: str, name: str, files: Iterable[str]) -> Iterable[str]:
    """Yield the files that an include of `path` names: relative to it, or below ``$(find PACKAGE)``."""
    below_package = _FIND.sub("", name)
    if below_package == name:
        yield os.path.join(os.path.dirname(path), name)
        return
    tail = os.path.join(os.sep, below_package)
    yield from (other for other in files if os.path.realpath(other).endswith(tail) and other != path)
