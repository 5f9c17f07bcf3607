"""A class name means one thing in dynx, with exceptions that are listed."""

from __future__ import annotations

import ast
import re
from collections import Counter
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

PER_ENGINE = "each engine's own, in its folder"
OF_A_DOCUMENT = "an entry of a document, whose schema names it"

DEFINED_MORE_THAN_ONCE = {
    "BodyCoordinates": PER_ENGINE,
    "BuiltScene": PER_ENGINE,
    "Carrier": PER_ENGINE,
    "EngineEntry": OF_A_DOCUMENT,
    "RobotCoordinates": PER_ENGINE,
    "Workspace": PER_ENGINE,
}
"""Class names without leading underscores that stand for more than one class, and why."""


CLASS = re.compile(r"^ *class _*(\w+)[(:]", re.MULTILINE)
"""The beginning of a class; parsing the whole text of dynx takes seconds."""


@cache
def class_names() -> Counter[str]:
    """Return how many classes of dynx have each name, without leading underscores."""
    texts = (path.read_text(encoding="utf-8") for path in (ROOT / "dynx").rglob("*.py"))
    return Counter(name for text in texts for name in CLASS.findall(text))


def exporting_rooms() -> Counter[str]:
    """Return how many rooms of dynx export each name."""
    rooms: dict[str, set[str]] = {}
    for path in (ROOT / "dynx").glob("*/**/__init__.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and any(ast.unparse(to) == "__all__" for to in node.targets):
                for name in ast.literal_eval(node.value):
                    rooms.setdefault(name, set()).add(path.relative_to(ROOT).parts[1])
    return Counter({name: len(of) for name, of in rooms.items()})


def test_only_listed_class_names_stand_for_two_things() -> None:
    assert {name for name, count in class_names().items() if count > 1} == set(DEFINED_MORE_THAN_ONCE)


def test_no_class_name_is_exported_by_two_rooms() -> None:
    exported = exporting_rooms()
    assert {name for name in class_names() if exported[name] > 1} == set()


@pytest.mark.parametrize(
    "path", sorted((ROOT / "dynx").glob("**/__init__.py")), ids=lambda path: path.parent.name
)
def test_every_exported_name_is_there(path: Path) -> None:
    package = import_module(".".join(path.parent.relative_to(ROOT).parts))
    for name in getattr(package, "__all__", ()):
        assert getattr(package, name) is not None


@pytest.mark.parametrize(
    ("package", "name", "new"),
    [
        ("dynx.control", "PositionMotor", "dynx.control.BulletPositionMotor"),
        ("dynx.ik", "Targets", "dynx.model.targets.Targets"),
        ("dynx", "Push", "ExternalForce"),
        ("dynx.world", "Wrench", "ExternalForce"),
        ("dynx.agreement", "Failure", "dynx.agreement.LoadFailure"),
        ("dynx.contacts", "Candidate", "dynx.contacts.SettingsChange"),
        ("dynx.contacts", "Case", "dynx.contacts.ContactCase"),
        ("dynx.sim", "Snapshot", "dynx.world.Snapshot"),
        ("dynx.sim", "State", "dynx.sim.SimulationState"),
    ],
)
def test_the_import_of_an_old_name_names_the_new_one(package: str, name: str, new: str) -> None:
    with pytest.raises(ImportError, match=re.escape(new)):
        exec(f"from {package} import {name}")
