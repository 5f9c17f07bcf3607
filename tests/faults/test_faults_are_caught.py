"""Every planted fault makes its named test fail, and none of those tests fails without one."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults.catalogue import FAULTS, FAULTS_BY_AREA
from tests.faults.fault import Fault
from tests.faults.warm import Runner

AT_LEAST = 250
"""The catalogue may grow, not shrink below this."""


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    with Runner() as warm:
        yield warm


def skip_without_engine(fault: Fault) -> None:
    if fault.engine is not None and importlib.util.find_spec(fault.engine) is None:
        pytest.skip(f"needs {fault.engine}, which is not installed")


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault_is_caught(runner: Runner, fault: Fault) -> None:
    skip_without_engine(fault)
    code, said = runner.run([fault.caught_by], fault.name)
    # 1: tests ran and one failed. 0 would be a fault that nobody sees, 2 and above a broken run.
    assert code == 1, f"{fault.caught_by} did not fail:\n{said[-3000:]}"
    assert " failed" in said, f"{fault.caught_by} did not get to its assertions:\n{said[-3000:]}"


@pytest.mark.parametrize("area", FAULTS_BY_AREA)
def test_without_a_fault_the_same_tests_pass(runner: Runner, area: str) -> None:
    faults = [
        fault
        for fault in FAULTS_BY_AREA[area]
        if fault.engine is None or importlib.util.find_spec(fault.engine) is not None
    ]
    code, said = runner.run(sorted({fault.caught_by for fault in faults}), "")
    assert code == 0, said[-5000:]


def test_the_faults_are_many_and_distinct() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= AT_LEAST
    assert len({(fault.module, fault.wrong, fault.right) for fault in FAULTS}) == len(FAULTS)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault_still_fits_the_source(fault: Fault) -> None:
    skip_without_engine(fault)
    spec = importlib.util.find_spec(fault.module)
    assert spec is not None
    assert spec.origin is not None
    source = Path(spec.origin).read_text(encoding="utf-8")
    compile(fault.planted(source), fault.module, "exec")
