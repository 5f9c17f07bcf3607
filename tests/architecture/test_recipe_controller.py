"""The recipe "add a controller" of docs/architecture.md, carried out by a package of its own: one module."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.control.registry import controller_class
from tests.architecture.packages import installed_package
from tests.cli.sim.command import sim

MODULE = '''
from dataclasses import dataclass

from dynx.control.base import Controller, gain
from dynx.model.numbers import checked_gain
from dynx.model import Model
from dynx.spatial.scalar import Floats


@dataclass(frozen=True)
class Damper(Controller[None], pure=True):
    """A damper on every joint."""

    model: Model
    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(self, model, *, kd):
        self._set(model=model, kd=checked_gain("kd", kd, model.nv))

    def torque(self, measurement, setpoint, state):
        return -self.kd * measurement.v, None
'''
ENTRY_POINTS = """
[dynx.controllers]
damper = third_party_controller:Damper
"""


@pytest.fixture(autouse=True)
def installed(tmp_path: Path) -> Iterator[Path]:
    """Yield the folder of the package, which is on the import path."""
    with installed_package(tmp_path, "third_party_controller", MODULE, ENTRY_POINTS) as folder:
        yield folder


def test_it_simulates_alone_and_in_a_batch() -> None:
    arm = dynx.load("ur5")
    damper = controller_class("damper")(arm, kd=5.0)  # type: ignore[call-arg]
    start = arm.neutral() + 0.1
    one = dynx.simulate(arm, damper, arm.neutral(), q0=start, duration=0.3, plant="compiled")
    many = dynx.simulate_batch(arm, damper, arm.neutral(), q0=start, duration=0.3, gains={"kd": [5.0, 6.0]})
    np.testing.assert_allclose(many.q[0], one.q[-1], rtol=1e-9)
    assert control.controller_from_document(arm, control.controller_to_document(damper)) == damper


def test_the_command_line_finds_it() -> None:
    result = sim("ur5", "--controller", "damper", "--kd", "5", "--duration", "0.05", "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["law"] == "damper"
    result = sim("ur5", "--controller", "dampr")
    assert "did you mean 'damper'?" in result.stderr


def test_it_takes_one_module(installed: Path) -> None:
    assert [path.name for path in installed.glob("*.py")] == ["third_party_controller.py"]
