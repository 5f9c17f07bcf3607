"""Handlers of any exception: where dynx calls what is not its own, and nowhere else."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

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
    "errors.py": (1, USERS_CODE),
    "files/arrays.py": (1, FOREIGN_PARSER),
    "model/geometry/images.py": (1, FOREIGN_PARSER),
    "model/geometry/mesh_reading.py": (1, FOREIGN_PARSER),
    "model/xacro_reading.py": (1, PROCESS),
    "registry.py": (1, ENGINE),
    "sim/closed_loop.py": (3, USERS_CODE),
    "sim/controller_checks.py": (1, USERS_CODE),
    "sim/own_controllers.py": (1, USERS_CODE),
    "sim/plants/plant.py": (1, ENGINE),
    "sim/record/mcap_file.py": (1, FOREIGN_PARSER),
    "simd/cuts.py": (1, ENGINE),
    "training/environments.py": (1, ENGINE),
    "training/library.py": (1, FOREIGN_PARSER),
    "training/unpickling.py": (1, USERS_CODE),
    "viewer/browser.py": (1, FOREIGN_PARSER),
    "viewer/world_view.py": (1, USERS_CODE),
    "workers.py": (1, PROCESS),
}
"""How many such handlers a module has, and what it calls in them."""


ANYTHING = {None, "Exception", "BaseException", "builtins.Exception", "builtins.BaseException"}
"""Names of any exception; None is a handler without a name."""

MAY_CATCH_ALL = re.compile(r"\bexcept\s*:|\b(Base)?Exception\b")
"""What each handler of any exception contains; parsing the whole text of dynx takes seconds."""


def catches_all(handler: ast.ExceptHandler) -> bool:
    """Check whether a handler takes any exception and does not end by raising it again."""
    caught = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    names = {None if each is None else ast.unparse(each) for each in caught}
    last = handler.body[-1]
    again = isinstance(last, ast.Raise) and last.exc is None
    return bool(names & ANYTHING) and not again


def suppresses_all(call: ast.Call) -> bool:
    """Check whether a call is ``contextlib.suppress`` of any exception."""
    name = ast.unparse(call.func).rpartition(".")[2]
    return name == "suppress" and bool({ast.unparse(each) for each in call.args} & ANYTHING)


def test_handlers_of_any_exception_stand_where_something_foreign_is_called() -> None:
    found: Counter[str] = Counter()
    for path in sorted((ROOT / "dynx").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not MAY_CATCH_ALL.search(text):
            continue
        tree = ast.parse(text)
        handlers = [each for each in ast.walk(tree) if isinstance(each, ast.ExceptHandler)]
        suppressed = [each for each in ast.walk(tree) if isinstance(each, ast.Call)]
        found[path.relative_to(ROOT / "dynx").as_posix()] += sum(map(catches_all, handlers))
        found[path.relative_to(ROOT / "dynx").as_posix()] += sum(map(suppresses_all, suppressed))
    assert +found == {name: count for name, (count, _) in ALLOWED.items()}


WRITTEN = {
    "try: x\nexcept: pass": 1,
    "try: x\nexcept Exception: pass": 1,
    "try: x\nexcept (OSError, BaseException) as e: raise KeyError from e": 1,
    "with contextlib.suppress(OSError, Exception): pass": 1,
    "with suppress(BaseException): pass": 1,
    "try: x\nexcept BaseException:\n    y()\n    raise": 0,
    "try: x\nexcept OSError: pass": 0,
    "with suppress(OSError): pass": 0,
}
"""Programs, and how many of their handlers take any exception."""


@pytest.mark.parametrize("text", WRITTEN)
def test_every_form_of_a_handler_of_anything_is_seen(text: str) -> None:
    assert MAY_CATCH_ALL.search(text) or not WRITTEN[text]
    nodes = list(ast.walk(ast.parse(text)))
    handlers = sum(catches_all(each) for each in nodes if isinstance(each, ast.ExceptHandler))
    assert (
        handlers + sum(suppresses_all(each) for each in nodes if isinstance(each, ast.Call)) == WRITTEN[text]
    )
