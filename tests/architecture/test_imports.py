"""Imports between modules form no cycle, wherever a module imports: on top, in a function, for a type."""

from __future__ import annotations

import ast
import re
from contextlib import suppress
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]

TYPES_OF_DOORS = ("dynx.backends.base", "dynx.ik")
"""The interface of backends imports types from inverse kinematics, whose functions open as doors
(`dynx.registry.door`)."""


@cache
def modules() -> dict[str, Path]:
    """Return the file of each module and package of dynx by its full name."""
    found = {}
    for path in (ROOT / "dynx").rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


IMPORT = re.compile(r"^[ \t]*((?:from [\w.]+ import (?:\([^)]*\)|[^\n(]+)|import [^\n]+))", re.MULTILINE)
"""An import, which may stand in a function; parsing the whole text of dynx takes seconds."""


def statements(text: str) -> list[ast.stmt]:
    """Return the imports in the text of a module; those in its texts do not parse, or name no module."""
    found = []
    for match in IMPORT.finditer(text):
        with suppress(SyntaxError):
            found += ast.parse(match[1].strip()).body
    return found


@cache
def imports() -> dict[str, set[str]]:
    """Return the modules that the text of each module imports, without itself, whose source it may hash."""
    known = modules()
    found: dict[str, set[str]] = {module: set() for module in known}
    for module, path in known.items():
        for node in statements(path.read_text(encoding="utf-8")):
            if isinstance(node, ast.Import):
                found[module] |= {alias.name for alias in node.names} & set(known)
            elif isinstance(node, ast.ImportFrom) and node.module in known:
                submodules = {f"{node.module}.{alias.name}" for alias in node.names} & set(known)
                found[module] |= submodules
                if len(submodules) < len(node.names):
                    found[module].add(node.module)
        found[module].discard(module)
    return found


def packages_above(module: str) -> set[str]:
    """Return the packages that contain a module, whose ``__init__`` Python runs before the module."""
    parts = module.split(".")
    return {".".join(parts[:k]) for k in range(1, len(parts))}


def loads(module: str) -> set[str]:
    """Return what importing a module runs directly: its imports and the packages around them, not its own."""
    imported = imports()[module]
    importer, room = TYPES_OF_DOORS
    if module == importer:
        imported = {each for each in imported if not f"{each}.".startswith(f"{room}.")}
    around = {package for each in imported for package in packages_above(each)}
    return imported | (around - packages_above(module) - {module})


def test_no_modules_import_each_other_in_a_cycle() -> None:
    remaining = {module: loads(module) for module in modules()}
    while leaves := {module for module, needed in remaining.items() if not needed & remaining.keys()}:
        for module in leaves:
            del remaining[module]
    assert sorted(remaining) == []


def test_modules_do_not_import_what_their_own_package_gathers() -> None:
    parents = {module: module.rpartition(".")[0] for module in modules()}
    gathering = {module for module in set(parents.values()) & modules().keys() if imports()[module]}
    own = {module for module, above in parents.items() if above in gathering & imports()[module]}
    assert sorted(own) == []
