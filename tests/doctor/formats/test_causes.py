"""Which engines are of one mind: only those that were compared and do not differ."""

from __future__ import annotations

from dataclasses import replace

from dynx.doctor.formats.causes import vote
from dynx.doctor.report import EngineResult, PairError
from tests.doctor.formats.reports import alike

NAMES = ("pinocchio", "pybullet", "mujoco")
ENGINES = tuple(EngineResult(name, "1", "load", before={"mass_matrix": 1e-16}) for name in NAMES)


def test_engines_that_were_not_compared_are_not_of_one_mind() -> None:
    near = PairError(("pinocchio", "pybullet"), "mass_matrix", 1e-16)
    found = vote(replace(alike(), engines=ENGINES, pairs=(near,)))
    assert found.groups == (("pinocchio", "pybullet"), ("mujoco",))
    assert found.alone == ("mujoco",)


def test_one_quantity_that_differs_parts_two_engines() -> None:
    pairs = (
        PairError(("pinocchio", "pybullet"), "mass_matrix", 1e-16),
        PairError(("pinocchio", "pybullet"), "inverse_dynamics", float("inf")),
        PairError(("pybullet", "mujoco"), "mass_matrix", 1e-16),
    )
    found = vote(replace(alike(), engines=ENGINES, pairs=pairs))
    assert found.groups == (("pybullet", "mujoco"), ("pinocchio",))
    assert found.right == NAMES
