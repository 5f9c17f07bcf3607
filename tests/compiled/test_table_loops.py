"""Steps of algorithms as routines: values in the workspace, and the routines that all robots share."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from benchmarks.every_quantity import serial_arm, tree
from dynx.compiled.derivatives import Derivatives
from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.table_kernels import TABLE_QUANTITIES, derivatives_kernel, table_kernel
from dynx.compiled.table_loops import Held, StepRoutines, Structure, TableLoops
from dynx.model import Model
from dynx.model.mechanism import Body, Mechanism
from dynx.rbd import coriolis, crba, derivatives, regressor, rnea
from dynx.rbd.aba import ArticulatedBody, ArticulatedInertia
from dynx.rbd.placement import Placement
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array
from tests.compiled.robots import ROBOTS, state

RIGID = RigidInertia(
    np.asarray(2.0), np.array([0.1, 0.2, 0.3]), np.array([[4, 1, 2], [1, 5, 3], [2, 3, 6.0]])
)
ARTICULATED = ArticulatedInertia(RIGID.rotational_inertia, np.arange(9.0).reshape(3, 3), np.diag([7.0, 8, 9]))


class Pair(NamedTuple):
    """Any two values."""

    first: Any
    second: Any


def _arrays(value: Any) -> list[Array]:
    if isinstance(value, np.ndarray):
        return [value]
    parts = value if isinstance(value, tuple) else vars(value).values()
    return [array for part in parts if part is not None for array in _arrays(part)]


@pytest.mark.parametrize(
    ("value", "size"),
    [
        (np.asarray(3.0), 1),
        (np.arange(6.0).reshape(2, 3), 6),
        (RIGID, 10),
        (Placement(np.eye(3), np.arange(3.0), np.eye(3), None), 12),
        (ARTICULATED, 21),
        (ArticulatedBody(ARTICULATED, (np.arange(3.0), np.arange(3.0, 6.0))), 27),
        (Pair((RIGID, np.arange(2.0)), np.asarray(-1.0)), 13),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_value_is_made_of_its_numbers_again(value: Any, size: int) -> None:
    structure = Structure.of(value)
    numbers = structure.numbers(value)
    assert structure.size == size
    assert numbers.shape == (size,)
    found = structure.value(numbers)
    assert type(found) is type(value)
    for x, y in zip(_arrays(found), _arrays(value), strict=True):
        np.testing.assert_array_equal(x, y)
    assert Structure.of(found) == structure


def test_parts_of_a_held_value_follow_one_another() -> None:
    held = Held(Structure.of(Pair((RIGID, np.arange(2.0)), np.asarray(-1.0))), 100)
    (inertia, vector), scalar = held
    assert [part._place for part in (held.first, inertia, vector, scalar, held.second)] == [
        *(100, 100, 110, 112, 112)
    ]
    assert inertia._structure == Structure.of(RIGID)
    with pytest.raises(AttributeError, match="third"):
        _ = held.third


def _double(body: Body, x: Array) -> Array:
    return 2.0 * x


def _double_with_axis(body: Body, x: Array) -> Array:
    return x + body.axis


def test_a_step_that_does_not_use_the_body_is_one_routine_for_every_type_of_joint() -> None:
    mechanism = ROBOTS["fixed"].mechanism
    assert {body.revolute for body in mechanism.bodies} == {True, False}
    for step, n in ((_double, 1), (_double_with_axis, 2)):
        routines = StepRoutines({})
        loops = TableLoops(mechanism, routines, None, 1)
        loops.each(step, np.zeros(mechanism.nv))
        loops.append_calls()
        assert len(routines.routines) == n


def test_no_step_is_traced_for_one_robot() -> None:
    mechanism = ROBOTS["fixed"].mechanism
    routines = StepRoutines({})
    routines.complete = True
    with pytest.raises(AssertionError, match="_double was not traced"):
        TableLoops(mechanism, routines, None, 1).each(_double, np.zeros(mechanism.nv))


def _evaluated(mechanism: Mechanism, name: str, q: Array, v: Array, a: Array) -> Any:
    algorithms: dict[str, Any] = {
        "mass_matrix": lambda: crba.mass_matrix(mechanism, q),
        "coriolis_matrix": lambda: coriolis.coriolis_matrix_at(mechanism, q, v),
        "inverse_dynamics": lambda: rnea.inverse_dynamics(mechanism, q, v, a),
        "bias_torque": lambda: rnea.bias_torque(mechanism, q, v),
        "gravity_torque": lambda: rnea.gravity_torque(mechanism, q),
        "inertial_regressor": lambda: regressor.inertial_regressor_at(mechanism, q, v, a, FRAMES),
    }
    return algorithms[name]()


FRAMES = (0, 2)


@pytest.mark.parametrize("name", sorted(TABLE_QUANTITIES - {"forward_dynamics"}))
@pytest.mark.parametrize(
    "model", [ROBOTS["fixed"], ROBOTS["floating"], tree(20), serial_arm(9)], ids=lambda m: m.name + m.base
)
def test_a_table_and_floats_give_the_same(model: Model, name: str) -> None:
    mechanism = simplify_mechanism(model.mechanism)
    kernel = table_kernel(mechanism, name, (FRAMES,) if name == "inertial_regressor" else ())
    rows = dict(zip("qva", state(model, (5,)), strict=True))
    found = [np.full((5, port.size), np.nan) for port in kernel.outputs]
    kernel([rows[port.name] for port in kernel.inputs], found)
    wanted = _evaluated(mechanism, name, *rows.values())
    np.testing.assert_allclose(
        found[0].reshape(wanted.shape), wanted, rtol=0.0, atol=1e-13 * np.abs(wanted).max()
    )


@pytest.mark.parametrize("robot", ["fixed", "floating"])
def test_a_table_gives_the_derivatives(robot: str) -> None:
    model = ROBOTS[robot]
    mechanism = simplify_mechanism(model.mechanism)
    kernel = derivatives_kernel(mechanism)
    rows = state(model, (5,))
    found = [np.full((5, port.size), np.nan) for port in kernel.outputs]
    kernel(list(rows), found)
    compiled = Derivatives(model).inverse_dynamics_derivatives(*rows)
    for x, y, z in zip(
        found, derivatives.inverse_dynamics_derivatives(mechanism, *rows), compiled, strict=True
    ):
        np.testing.assert_allclose(x.reshape(y.shape), y, rtol=0.0, atol=1e-13 * np.abs(y).max())
        np.testing.assert_allclose(x.reshape(y.shape), z, rtol=0.0, atol=1e-12 * np.abs(y).max())
