"""Handlers of any exception: where dynx calls what is not its own, and nowhere else."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]

ENGINE = "calls of an engine or of a backend, plant or class of another package"
USERS_CODE = "calls of the user's own code"
FOREIGN_PARSER = "a parser of another library, or of documents, reads what a user gives"
PROCESS = "an error crosses to another process"

ALLOWED = {
    "agreement/comparison.py": (1, ENGINE),
    "agreement/identities.py": (1, ENGINE),
    "backends/quantity_calls.py": (1, ENGINE),
    "cli/shell/main.py": (1, "the last word of a command: a defect becomes an exit code"),
    "contacts/run.py": (1, USERS_CODE),
    "engines/mujoco/as_loaded.py": (1, ENGINE),
    "engines/mujoco/backend.py": (1, ENGINE),
    "engines/mujoco/library.py": (1, ENGINE),
    "engines/pinocchio/as_loaded.py": (1, ENGINE),
    "engines/pinocchio/engine_model.py": (1, ENGINE),
    "files/arrays.py": (1, FOREIGN_PARSER),
    "model/geometry/mesh.py": (1, FOREIGN_PARSER),
    "model/xacro_reading.py": (1, PROCESS),
    "registry.py": (1, ENGINE),
    "sim/closed_loop.py": (2, USERS_CODE),
    "sim/own_controllers.py": (1, USERS_CODE),
    "sim/plants/plant.py": (1, ENGINE),
    "sim/record/mcap_file.py": (1, FOREIGN_PARSER),
    "simd/cuts.py": (1, ENGINE),
    "training/library.py": (1, FOREIGN_PARSER),
    "viewer/browser.py": (1, FOREIGN_PARSER),
    "viewer/world_view.py": (1, USERS_CODE),
    "workers.py": (1, PROCESS),
}
"""How many such handlers a module has, and what it calls in them."""


def catches_all(handler: ast.ExceptHandler) -> bool:
    """Check whether a handler takes any exception and does not end by raising it again."""
    caught = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    names = {None if each is None else ast.unparse(each) for each in caught}
    last = handler.body[-1]
    again = isinstance(last, ast.Raise) and last.exc is None
    return bool(names & {None, "Exception", "BaseException"}) and not again


def test_handlers_of_any_exception_stand_where_something_foreign_is_called() -> None:
    found: Counter[str] = Counter()
    for path in sorted((ROOT / "dynx").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        handlers = [each for each in ast.walk(tree) if isinstance(each, ast.ExceptHandler)]
        found[path.relative_to(ROOT / "dynx").as_posix()] += sum(map(catches_all, handlers))
    assert +found == {name: count for name, (count, _) in ALLOWED.items()}
