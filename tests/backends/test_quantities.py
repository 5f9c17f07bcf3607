"""The public methods of `Backend` agree with the table of quantities."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from dynx.backends import Backend
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.compiled.backend import CompiledBackend
from dynx.engines.pinocchio.backend import PinocchioBackend
from tests.backends.robots import mixed_robot, motion

DOORS = {"inverse_kinematics", "track", "velocity_ik"}
OTHER_METHODS = DOORS | {
    "close", "engine_inverse_kinematics", "engine_version", "kept", "require_engine", "threads"
}  # fmt: skip
each_quantity = pytest.mark.parametrize("quantity", QUANTITIES.values(), ids=QUANTITIES)


def parameters(quantity: Quantity) -> list[str]:
    """Return the names of the parameters of the method, by the table."""
    frame = ["frame"] if quantity.of_frame else []
    return ["self", *quantity.arguments, *frame, *quantity.options]


def is_property(kind: type, name: str) -> bool:
    return isinstance(vars(kind)[name], property)


def test_every_public_method_is_in_the_table() -> None:
    public = {
        name
        for kind in Backend.__mro__
        for name in vars(kind)
        if not name.startswith("_") and (callable(getattr(kind, name)) or is_property(kind, name))
    }
    assert public == {*QUANTITIES} | OTHER_METHODS


@each_quantity
def test_signatures(quantity: Quantity) -> None:
    method = getattr(Backend, quantity.name)
    assert list(inspect.signature(method).parameters) == parameters(quantity)
    compiled = list(inspect.signature(getattr(CompiledBackend, quantity.name)).parameters)
    assert [name for name in compiled if name != "out"] == parameters(quantity)


@each_quantity
def test_docstrings_give_shape_unit_source_and_the_names_of_other_libraries(quantity: Quantity) -> None:
    text = " ".join((getattr(Backend, quantity.name).__doc__ or "").split())
    shape = ", ".join(["...", *map(str, quantity.shape)]) + ("" if quantity.shape else ",")
    assert f"({shape})" in text
    assert f"[{quantity.unit}]" in text
    assert quantity.source in text
    for library, name in quantity.other_names.items():
        assert library in text
        assert f"`{name}`" in text


@each_quantity
@pytest.mark.parametrize("mimic", [False, True])
def test_shapes_are_those_of_the_results(quantity: Quantity, mimic: bool) -> None:
    model = mixed_robot("floating", mimic=mimic)
    engine = PinocchioBackend(model)
    q, v, x = motion(model, size=(2,))
    values = {"q": q, "v": v, "a": x, "tau": x}
    frame = [model.frame_names[-1]] if quantity.of_frame else []
    result = getattr(engine, quantity.name)(*(values[name] for name in quantity.arguments), *frame)
    assert np.shape(result) == (2, *quantity.shape_of(model))


@each_quantity
def test_every_algorithm_is_one_of_dynx_rbd(quantity: Quantity) -> None:
    assert quantity.algorithm.__module__.startswith("dynx.rbd.")


def test_the_names_in_mujoco_exist() -> None:
    mujoco = pytest.importorskip("mujoco")
    for quantity in QUANTITIES.values():
        name = quantity.other_names.get("MuJoCo", "")
        if name.startswith("mj_"):
            assert hasattr(mujoco, name), f"{quantity.name}: {name}"
