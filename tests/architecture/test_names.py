"""A class name means one thing in dynx, with exceptions that are listed and may only become fewer."""

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
UNTIL_ONE_LOOP = "until a closed loop is a world with controllers"
UNTIL_ONE_TASK = "until environments stand on worlds"
OF_A_PAGE = "a private part of one page or table"
PRIVATE = "private to one module"

DEFINED_MORE_THAN_ONCE = {
    "Axes": OF_A_PAGE,
    "BatchArguments": "until batches run on the compiled step",
    "Between": PRIVATE,
    "Body": PRIVATE,
    "BodyCoordinates": PER_ENGINE,
    "BuiltScene": PER_ENGINE,
    "Candidate": PRIVATE,
    "Carrier": PER_ENGINE,
    "Case": "what a rule looks at, and a case of contact: both public, each in its room",
    "Cause": OF_A_PAGE,
    "Chain": PRIVATE,
    "Code": PRIVATE,
    "EngineEntry": OF_A_PAGE,
    "Failure": "of a worker process, and in a report of agreement",
    "Layout": "the scene in numbers; private in three other rooms",
    "Line": OF_A_PAGE,
    "Lines": PRIVATE,
    "Memory": UNTIL_ONE_LOOP,
    "Motion": UNTIL_ONE_LOOP,
    "Outcome": UNTIL_ONE_TASK,
    "Outputs": OF_A_PAGE,
    "Part": PRIVATE,
    "Parts": PRIVATE,
    "PrincipalInertia": PER_ENGINE,
    "Reach": "a task of reinforcement learning, and what a chain reaches",
    "RobotCoordinates": PER_ENGINE,
    "RobotTask": "a task of reinforcement learning, and a command on one robot",
    "Rule": "a cause in the catalogue, and a private rewriting rule of the compiler",
    "Run": PRIVATE,
    "Snapshot": UNTIL_ONE_LOOP,
    "Starts": PRIVATE,
    "State": UNTIL_ONE_LOOP,
    "Store": PRIVATE,
    "Table": OF_A_PAGE,
    "Target": PRIVATE,
    "Task": "of reinforcement learning, and of inverse kinematics",
    "TaskError": "until controllers take the tasks of inverse kinematics",
    "Workspace": PER_ENGINE,
}
"""Class names without leading underscores that stand for more than one class, and why."""

EXPORTED_BY_TWO_ROOMS = {"Case", "Outcome", "Snapshot", "State"}
"""Such names that two packages export."""


@cache
def class_names() -> Counter[str]:
    """Return how many classes of dynx have each name, without leading underscores."""
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in (ROOT / "dynx").rglob("*.py"))
    return Counter(
        node.name.lstrip("_") for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)
    )


def exporting_rooms() -> Counter[str]:
    """Return how many rooms of dynx export each name."""
    rooms: dict[str, set[str]] = {}
    for path in (ROOT / "dynx").glob("*/**/__init__.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Assign) and any(ast.unparse(to) == "__all__" for to in node.targets):
                for name in ast.literal_eval(node.value):
                    rooms.setdefault(name, set()).add(path.relative_to(ROOT).parts[1])
    return Counter({name: len(of) for name, of in rooms.items()})


def test_no_more_class_names_stand_for_two_things() -> None:
    repeated = {name for name, count in class_names().items() if count > 1}
    assert repeated <= set(DEFINED_MORE_THAN_ONCE)


def test_no_more_of_them_are_exported_by_two_rooms() -> None:
    exported = exporting_rooms()
    repeated = {name for name, count in class_names().items() if count > 1 and exported[name] > 1}
    assert repeated <= EXPORTED_BY_TWO_ROOMS


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
    ],
)
def test_the_import_of_an_old_name_names_the_new_one(package: str, name: str, new: str) -> None:
    with pytest.raises(ImportError, match=re.escape(new)):
        exec(f"from {package} import {name}")
