"""Errors of compliant contacts, against the compliance of each engine: known forms, and changes that remove
them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from dynx.contacts import Figure, find_case
from dynx.contacts.cases.resting import BOXES, EDGE
from dynx.contacts.motion import G
from dynx.contacts.run import CaseRun, Measured, carry_out
from dynx.steppers.registry import installed_worlds

WITHOUT_HOPS = {"impedance": (0.02, 0.9, 1.0, 0.5, 2.0), "time_constant": 1e-6, "substeps": 8}
"""Contacts of MuJoCo that give way under a weight by more than friction pushes a body up that slides."""

STIFF = {"modulus": 1e9, "substeps": 4}
"""Contacts of Drake with a modulus that needs short steps."""


def needs(engine: str) -> pytest.MarkDecorator:
    """Return the mark of a test of an engine that may be absent."""
    return pytest.mark.skipif(engine not in installed_worlds(), reason=f"needs the engine {engine}")


def figures(engine: str, case: str, trial: str, dt: float, settings: Mapping[str, Any]) -> dict[str, Figure]:
    """Return the figures of a run by name."""
    outcome = carry_out(CaseRun(engine, find_case(case), trial, dt, settings))
    assert isinstance(outcome, Measured), outcome
    return {each.name: each for each in outcome.figures}


@needs("drake")
@pytest.mark.parametrize("modulus", [3e6, 4e7])
def test_a_stack_in_drake_is_compressed_by_the_weight_over_the_modulus(modulus: float) -> None:
    # The pressure of a cube rises from its faces to its centre, where it is the modulus. Two cubes share a
    # depth; the ground is rigid.
    softness = 0.5 * EDGE / (modulus * EDGE**2)
    above = [number * G for number in range(1, BOXES + 1)]
    depth = softness * (2.0 * sum(above[:-1]) + above[-1])
    found = figures("drake", "stack", "", 4e-3, {"modulus": modulus})
    # Nothing pushes the boxes to the side.
    drift = found["largest drift to the side"]
    assert drift.error <= drift.tolerance
    height = found["height"]
    assert height.exact - height.measured == pytest.approx(depth, rel=5e-3)


@needs("drake")
def test_a_box_that_tips_in_drake_turns_about_its_edge_on_stiff_contacts() -> None:
    for name, figure in figures("drake", "tipping_box", "tips", 3e-3, STIFF).items():
        assert figure.error < 2e-3, name


@needs("mujoco")
@pytest.mark.parametrize("dt", [4e-3, 1.5e-3])
def test_plates_in_mujoco_slide_straight_where_they_do_not_hop(dt: float) -> None:
    hopping = figures("mujoco", "friction_isotropy", "", dt, {})
    for name, figure in figures("mujoco", "friction_isotropy", "", dt, WITHOUT_HOPS).items():
        assert figure.error <= figure.tolerance < hopping[name].error, name
