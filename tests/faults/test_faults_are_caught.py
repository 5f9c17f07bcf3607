"""Every planted fault makes its test fail, and none of those tests fails without one.

Faults are semantic slips that no random mutation makes: a wrong frame, a missing term, a lost lock. Ordinary
slips of operators and constants are made at random by ``python -m tests.mutation``.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest

from tests.faults.catalogue import FAULTS, FAULTS_BY_AREA
from tests.faults.fault import Fault
from tests.faults.warm import ROOT, Change, Runner


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    with Runner() as warm:
        yield warm


def change_of(fault: Fault) -> Change:
    source = (ROOT / f"{fault.module.replace('.', '/')}.py").read_text(encoding="utf-8")
    return Change(fault.module, fault.faulty_source(source))


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_fits_the_source_and_its_test_exists(fault: Fault) -> None:
    change = change_of(fault)
    compile(change.source, change.module, "exec")
    tests = ast.parse((ROOT / fault.test_file).read_text(encoding="utf-8"))
    defined = {node.name for node in ast.walk(tests) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    assert set(fault.test.partition("[")[0].split("::")) <= defined


def test_names_of_faults_are_distinct() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
    assert len({(fault.module, fault.right, fault.wrong) for fault in FAULTS}) == len(FAULTS)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_is_caught(runner: Runner, fault: Fault) -> None:
    if not fault.can_be_tried:
        pytest.skip(f"needs {fault.needs}, which is not installed")
    code, output = runner.run([fault.caught_by], change_of(fault))
    # 1: tests ran and one failed. 0 would be a fault that no test notices, 2 and above a broken run.
    assert code == 1, f"{fault.caught_by} did not fail:\n{output[-3000:]}"
    assert " failed" in output, f"{fault.caught_by} did not get to its assertions:\n{output[-3000:]}"


@pytest.mark.parametrize("area", FAULTS_BY_AREA)
def test_without_a_fault_the_same_tests_pass(runner: Runner, area: str) -> None:
    tests = sorted({fault.caught_by for fault in FAULTS_BY_AREA[area] if fault.can_be_tried})
    code, output = runner.run(tests)
    assert code == 0, output[-5000:]
