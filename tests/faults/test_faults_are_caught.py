"""Every planted fault makes its named test fail, and none of those tests fails without one."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.catalogue import FAULTS, Fault

ROOT = Path(__file__).resolve().parents[2]


def run_tests(tests: list[str], fault: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "DYNX_FAULT": fault, "HYPOTHESIS_PROFILE": "faults"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:xdist", "-p", "tests.faults.plant"]
    return subprocess.run(
        [*command, *tests],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault_is_caught(fault: Fault) -> None:
    result = run_tests([fault.caught_by], fault.name)
    # 1: tests ran and one failed. 0 would be a fault that nobody sees, 2 and above a broken run.
    assert result.returncode == 1, (
        f"{fault.caught_by} did not fail:\n{result.stdout[-3000:]}{result.stderr[-2000:]}"
    )


def test_without_a_fault_the_same_tests_pass() -> None:
    result = run_tests(sorted({fault.caught_by for fault in FAULTS}), "")
    assert result.returncode == 0, result.stdout[-3000:] + result.stderr[-2000:]


def test_there_are_at_least_forty_distinct_faults() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 40
    assert len({(fault.module, fault.wrong, fault.right) for fault in FAULTS}) == len(FAULTS)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault_still_fits_the_source(fault: Fault) -> None:
    spec = importlib.util.find_spec(fault.module)
    assert spec is not None
    assert spec.origin is not None
    source = Path(spec.origin).read_text(encoding="utf-8")
    compile(fault.planted(source), fault.module, "exec")
