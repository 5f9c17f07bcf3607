"""What the backends of foreign engines share; `tests.contract` checks what all backends must return."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.backends import Backend, DerivedBackend, backend, installed_backends
from dynx.errors import ClosedError, EngineError
from dynx.model import Joint, Link, Model
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.backends.robots import BASES, BOX, all_quantities, assert_close, chain, mixed_robot, motion

ENGINES = [name for name in ("pinocchio", "pybullet", "mujoco", "drake") if name in installed_backends()]
SIZES = {"drake": 10.0}
"""Magnitude relative to which results of an engine are compared, where it is not 1."""
each_engine = pytest.mark.parametrize("engine", ENGINES)
each_base = pytest.mark.parametrize("base", BASES)


def check_results(
    native: Backend, other: Backend, sample: tuple[Floats, Floats, Floats], size: float
) -> None:
    """Compare every quantity of two backends of one robot."""
    # An acceleration amplifies rounding by the condition number of the mass matrix.
    M = native.mass_matrix(sample[0])
    condition = float(np.linalg.cond(M).max()) if native.model.nv else 1.0
    results = all_quantities(native, *sample)
    for quantity, expected in all_quantities(other, *sample).items():
        assert_close(
            results[quantity], expected, condition if quantity == "forward_dynamics" else size, quantity
        )


@pytest.mark.long_cases
@each_engine
@each_base
@pytest.mark.parametrize("mimic", [False, True])
def test_native_results_are_those_derived_and_those_of_the_reference(
    engine: str, base: Base, mimic: bool
) -> None:
    model = mixed_robot(base, mimic=mimic)
    with backend(engine, model) as native:
        for other in (DerivedBackend(native), ReferenceBackend(model)):
            check_results(native, other, motion(model, size=(5,)), SIZES.get(engine, 1.0))


@each_engine
@each_base
@pytest.mark.parametrize("n", [0, 1])
def test_a_robot_with_one_joint_or_none_has_arrays_of_the_usual_shapes(
    engine: str, base: Base, n: int
) -> None:
    model = chain(n).with_base(base)
    with backend(engine, model) as native:
        check_results(native, ReferenceBackend(model), motion(model), SIZES.get(engine, 1.0))


NAMES = {
    "pinocchio": (("universe", "root_joint", "base"), ("universe", "base"), 1.0),
    "mujoco": (("world", "0", "1"), ("world", ""), 1.0),
    "drake": (("world", "WorldBody", "0"), ("world_welds_to_0", "base"), 100.0),
}
"""Names that an engine uses itself, for links and joints, and the magnitude of results to compare with."""


@pytest.mark.parametrize("engine", [name for name in NAMES if name in ENGINES])
def test_names_of_the_engine_are_free_for_robots(engine: str) -> None:
    links, joints, size = NAMES[engine]
    made = [Joint(name, "revolute", links[k], links[k + 1]) for k, name in enumerate(joints)]
    model = Model.build("WorldModelInstance", [Link(name, BOX) for name in links], made, base="floating")
    with backend(engine, model) as native:
        check_results(native, ReferenceBackend(model), motion(model), size)


@pytest.mark.parametrize("engine", [name for name in ENGINES if name != "pybullet"])
def test_a_call_that_close_overtakes_says_so(engine: str) -> None:
    native = backend(engine, chain(2))
    native.close()
    assert not hasattr(native, "_engine")
    with pytest.raises(ClosedError, match="during a call"):
        native._mass_matrix(np.zeros(2))


@pytest.mark.parametrize("engine", [name for name in ENGINES if name != "pybullet"])
def test_without_validation_a_wrong_shape_that_the_engine_notices_is_an_engine_error(engine: str) -> None:
    native = backend(engine, chain(2), validate=False)
    with pytest.raises(EngineError, match=f"{engine} failed on chain"):
        native.inverse_dynamics(np.zeros(3), np.zeros(2), np.zeros(2))
