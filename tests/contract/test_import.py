"""`import dynx` imports no engine and changes nothing global."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import dynx

HEAVY = ("pinocchio", "pybullet", "mujoco", "hypothesis", "mpmath", "rich", "click", "scipy", "numpy")
ENGINES = ("pinocchio", "pybullet", "mujoco", "pydrake")


def modules_after(program: str) -> set[str]:
    """Return the top-level modules that a fresh interpreter holds after `program`."""
    report = "import sys; print(' '.join({name.partition('.')[0] for name in sys.modules}))"
    done = subprocess.run(
        [sys.executable, "-c", f"{program}\n{report}"], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return set(done.stdout.split())


def test_import_dynx_imports_nothing_heavy() -> None:
    assert modules_after("import dynx").isdisjoint(HEAVY)


@pytest.mark.parametrize(
    "program",
    [
        "import dynx; dynx.load, dynx.backend, dynx.Model, dynx.installed_backends",
        "import dynx.backends, dynx.model, dynx.rbd, dynx.ik",
        "import dynx.agreement",
        "import dynx.cli.shell.main",
        "import dynx; dynx.backend('reference', dynx.load('<robot name=\"r\"><link name=\"l\"/></robot>'))",
    ],
)
def test_no_engine_is_imported_before_it_is_used(program: str) -> None:
    assert modules_after(program).isdisjoint(ENGINES)


def test_everything_exported_exists() -> None:
    import dynx

    for name in dynx.__all__:
        assert getattr(dynx, name) is not None
    assert set(dynx.__all__) <= set(dir(dynx))
    with pytest.raises(AttributeError, match="nothing_of_the_kind"):
        dynx.nothing_of_the_kind  # type: ignore[attr-defined]  # noqa: B018


def test_importing_changes_no_global_state() -> None:
    program = """
import locale, os, random, signal, sys, warnings
import numpy as np

def state():
    return (
        np.geterr(), np.get_printoptions(), np.random.get_state()[1].tolist(), random.getstate(),
        list(warnings.filters), signal.getsignal(signal.SIGINT), dict(os.environ), list(sys.path),
        locale.getlocale(), sys.getrecursionlimit(), os.getcwd(),
    )

before = state()
import dynx
dynx.load, dynx.backend, dynx.agree
after = state()
assert before == after, [pair for pair in zip(before, after) if pair[0] != pair[1]]
"""
    modules_after(program)


def test_type_checkers_know_every_name_and_no_other() -> None:
    """A module-level ``__getattr__`` that they see would let every misspelled name pass."""
    tree = ast.parse(Path(str(dynx.__file__)).read_text(encoding="utf-8"))
    visible = [each.name for each in tree.body if isinstance(each, ast.FunctionDef)]
    assert "__getattr__" not in visible
    (checking,) = (
        each
        for each in tree.body
        if isinstance(each, ast.If) and isinstance(each.test, ast.Name) and each.test.id == "TYPE_CHECKING"
    )
    imported = {
        name.name for each in checking.body if isinstance(each, ast.ImportFrom) for name in each.names
    }
    assert imported | {"__version__"} == set(dynx.__all__)


def test_packages_resolve_and_a_misspelled_name_has_a_hint() -> None:
    code = "import dynx; dynx.sim.simulate, dynx.ik.inverse_kinematics, dynx.control.PD; dynx.simulat"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "has no attribute 'simulat'; did you mean 'simulate'" in result.stderr


def test_packages_of_extras_are_imported_by_name() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = dynx.__getattr__("nothing")
    with pytest.raises(AttributeError, match=r"not imported by itself; write: import dynx\.viewer"):
        _ = dynx.__getattr__("viewer")
