"""The recipe "add a backend" of docs/architecture.md, carried out by a package of its own: one module."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import pytest

from dynx.agreement import agree
from dynx.backends import backend_class, backend_names, installed_backends, native_quantities, register
from dynx.backends.registry import unregister
from tests.architecture.packages import installed_package
from tests.backends.robots import mixed_robot

MODULE = '''
"""An engine that loses a sign."""

from dynx.backends import Backend
from dynx.rbd import kinematics, rnea


class ThirdPartyBackend(Backend):
    name = "third_party"
    vectorized = True

    def _frame_placements(self, q):
        return kinematics.frame_placements(self._mechanism, q)

    def _inverse_dynamics(self, q, v, a):
        return rnea.inverse_dynamics(self._mechanism, q, v, a)


class DefectiveBackend(ThirdPartyBackend):
    name = "defective"

    def _gravity_torque(self, q):
        return -super()._gravity_torque(q)
'''
ENTRY_POINTS = """
[dynx.backends]
third_party = third_party_engine:ThirdPartyBackend
defective = third_party_engine:DefectiveBackend
"""


@pytest.fixture
def installed(tmp_path: Path) -> Iterator[Path]:
    """Yield the folder of the package, which is on the import path."""
    with installed_package(tmp_path, "third_party_engine", dedent(MODULE), ENTRY_POINTS) as folder:
        yield folder


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("mimic", [False, True])
def test_an_installed_backend_is_found_and_compared(mimic: bool) -> None:
    assert {"third_party", "defective"} <= set(backend_names())
    assert "third_party" in installed_backends()
    assert native_quantities(backend_class("third_party")) == {"forward_kinematics", "inverse_dynamics"}
    report = agree(mixed_robot("floating", mimic=mimic), ["reference", "third_party"], samples=3)
    assert report.agree
    assert {row.pair for row in report.quantities} >= {"reference~third_party", "third_party~referee"}


@pytest.mark.usefixtures("installed")
def test_its_defect_is_found() -> None:
    report = agree(mixed_robot(), ["reference", "pinocchio", "defective"], samples=3)
    assert not report.agree
    assert {suspect.backend for suspect in report.suspects} == {"defective"}


def test_a_program_registers_one_without_a_package(installed: Path) -> None:
    kind = backend_class("third_party")
    register("of_this_program", lambda: kind)
    try:
        assert agree(mixed_robot(), ["reference", "of_this_program"], samples=2).agree
    finally:
        unregister("of_this_program")


def test_it_takes_one_module(installed: Path) -> None:
    assert [path.name for path in installed.glob("*.py")] == ["third_party_engine.py"]
