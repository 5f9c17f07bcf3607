from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import Backend
from dynx.backends.arguments import Arguments
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.errors import (
    ArgumentError,
    DTypeError,
    DynxError,
    NotFiniteError,
    ShapeError,
    SingularMassMatrixError,
    UnknownNameError,
)
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.spatial.scalar import Floats
from tests.backends.robots import chain, motion

ENGINE = PinocchioBackend(chain(3))
FLOATING = PinocchioBackend(chain(3).with_base("floating"))
ZERO = np.zeros(3)


def _at(position: int, value: object, dtype: Any = float) -> Any:
    array = np.zeros(3, dtype=dtype)
    array[position] = value
    return array


FRAME = ENGINE.model.frame_names[-1]
BAD_VECTORS = {
    "too short": (np.zeros(2), ShapeError, r"has shape \(2,\); wanted \(\.\.\., 3\)"),
    "too long": (np.zeros((4, 5)), ShapeError, r"has shape \(4, 5\); wanted \(\.\.\., 3\)"),
    "a number": (1.0, ShapeError, r"has shape \(\); wanted"),
    "empty": ([], ShapeError, r"has shape \(0,\); wanted"),
    "ragged": ([[0.0, 1.0, 2.0], [0.0]], ShapeError, "is ragged"),
    "None": (None, DTypeError, "has dtype object; wanted real numbers"),
    "text": ("abc", DTypeError, "has dtype <U3"),
    "texts": (["a", "b", "c"], DTypeError, "has dtype <U1"),
    "complex": (np.zeros(3, complex), DTypeError, "has dtype complex128"),
    "bool": (np.zeros(3, bool), DTypeError, "has dtype bool"),
    "objects": (np.array([0.0, object(), 0.0]), DTypeError, "has dtype object"),
    "a mapping": ({"joint0": 1.0}, DTypeError, "has dtype object"),
    "NaN": (_at(1, np.nan), NotFiniteError, r"\[1\] is nan; wanted a finite number"),
    "infinite": (_at(2, -np.inf), NotFiniteError, r"\[2\] is -inf"),
    "NaN in a batch": (np.stack([np.zeros(3), _at(1, np.nan)]), NotFiniteError, r"\[1, 1\] is nan"),
    "infinities that cancel": (np.array([np.inf, -np.inf, 0.0]), NotFiniteError, r"\[0\] is inf"),
}


@pytest.mark.parametrize("bad", BAD_VECTORS)
@pytest.mark.parametrize("name", ["q", "v", "a", "tau"])
def test_a_bad_array_is_named_with_the_valid_form(name: str, bad: str) -> None:
    value, kind, message = BAD_VECTORS[bad]
    arguments: dict[str, Any] = {"q": ZERO, "v": ZERO, name: value}
    if name == "tau":
        with pytest.raises(kind, match=f"^{name}.*{message}"):
            ENGINE.forward_dynamics(arguments["q"], arguments["v"], arguments["tau"])
    else:
        with pytest.raises(kind, match=f"^{name}.*{message}"):
            ENGINE.inverse_dynamics(arguments["q"], arguments["v"], arguments.get("a", ZERO))
        with pytest.raises(kind, match=f"^{name}.*{message}"):
            ENGINE.frame_acceleration(arguments["q"], arguments["v"], arguments.get("a", ZERO), FRAME)


def test_every_method_checks_its_arguments() -> None:
    bad = np.full(3, np.nan)
    calls: tuple[Callable[[], Floats], ...] = (
        lambda: ENGINE.forward_kinematics(bad, "link1"),
        lambda: ENGINE.forward_kinematics(bad),
        lambda: ENGINE.jacobian(bad, "link1"),
        lambda: ENGINE.jacobian_derivative(ZERO, bad, "link1"),
        lambda: ENGINE.frame_velocity(ZERO, bad, "link1"),
        lambda: ENGINE.frame_acceleration(ZERO, ZERO, bad, "link1"),
        lambda: ENGINE.mass_matrix(bad),
        lambda: ENGINE.bias_torque(ZERO, bad),
        lambda: ENGINE.gravity_torque(bad),
        lambda: ENGINE.coriolis_matrix(ZERO, bad),
        lambda: ENGINE.center_of_mass(bad),
        lambda: ENGINE.center_of_mass_jacobian(bad),
        lambda: ENGINE.centroidal_momentum(ZERO, bad),
        lambda: ENGINE.kinetic_energy(ZERO, bad),
        lambda: ENGINE.potential_energy(bad),
    )
    for call in calls:
        with pytest.raises(NotFiniteError):
            call()


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 0), (0, 0, 0, 2), (0, 0, 0, 1 - 1e-5), (0, 0, 0, 1 + 1e-5)])
def test_a_quaternion_must_have_length_one(quaternion: tuple[float, ...]) -> None:
    q = FLOATING.model.neutral()
    q[3:7] = quaternion
    for wrong in (q, np.stack([FLOATING.model.neutral(), q])):
        with pytest.raises(ArgumentError, match=r"q\[(\d, )?3:7\] is a quaternion.*wanted length 1"):
            FLOATING.gravity_torque(wrong)


def test_an_invalid_quaternion_of_a_batch_is_named_by_its_index() -> None:
    q = np.tile(FLOATING.model.neutral(), (2, 3, 1))
    q[1, 2, 3:7] = 0.5, 0.0, 0.0, 0.0
    with pytest.raises(ArgumentError, match=r"q\[1, 2, 3:7\] is a quaternion .* of length 0\.5;"):
        FLOATING.gravity_torque(q)


def test_numbers_below_the_bound_are_accepted_though_their_norm_exceeds_it() -> None:
    tau = np.full(3, 0.9 * MAX_MAGNITUDE)
    assert np.linalg.norm(tau) > MAX_MAGNITUDE
    assert ENGINE._arguments.v(tau) is tau


@pytest.mark.parametrize("dtype", ["f4", "f2", ">f8", "i8", "u1"])
def test_real_numbers_of_any_type_are_converted_to_float64(dtype: str) -> None:
    q = np.array([1, 0, 2], dtype=dtype)
    np.testing.assert_array_equal(ENGINE.mass_matrix(q), ENGINE.mass_matrix(np.array([1.0, 0.0, 2.0])))
    np.testing.assert_array_equal(ENGINE.mass_matrix(q.tolist()), ENGINE.mass_matrix(q))


BAD_FRAMES: dict[str, tuple[Any, str]] = {
    "misspelt": ("lnik2", "no frame 'lnik2' in chain; did you mean 'link2'"),
    "a joint": ("joint1", "that is a joint; the frame it moves is 'link2'"),
    "a number": (2, "no frame '2'"),
    "None": (None, "no frame 'None'"),
    "a list": (["link1"], "no frame"),
    "very long": ("x" * 10_000, r"\(10000 characters\)"),
}


@pytest.mark.parametrize("bad", BAD_FRAMES)
def test_an_unknown_frame_is_named_with_the_nearest(bad: str) -> None:
    frame, message = BAD_FRAMES[bad]
    calls: tuple[Callable[[], Floats], ...] = (
        lambda: ENGINE.jacobian(ZERO, frame),
        lambda: ENGINE.jacobian_derivative(ZERO, ZERO, frame),
        lambda: ENGINE.frame_velocity(ZERO, ZERO, frame),
        lambda: ENGINE.frame_acceleration(ZERO, ZERO, ZERO, frame),
        lambda: ENGINE.forward_kinematics(ZERO, [frame]),
    )
    for call in calls:
        with pytest.raises(UnknownNameError, match=message):
            call()


def test_forward_kinematics_takes_names_only() -> None:
    number: Any = 3
    with pytest.raises(ArgumentError, match="frame is of type int"):
        ENGINE.forward_kinematics(ZERO, number)
    with pytest.raises(UnknownNameError, match="no frame 'lnik1'"):
        ENGINE.forward_kinematics(ZERO, "lnik1")


@pytest.mark.parametrize("reference", ["World", "", None, 1, ["world"]])
def test_an_unknown_reference_is_named_with_the_three(reference: Any) -> None:
    calls: tuple[Callable[[], Floats], ...] = (
        lambda: ENGINE.jacobian(ZERO, "link1", reference=reference),
        lambda: ENGINE.jacobian_derivative(ZERO, ZERO, "link1", reference=reference),
        lambda: ENGINE.frame_velocity(ZERO, ZERO, "link1", reference=reference),
        lambda: ENGINE.frame_acceleration(ZERO, ZERO, ZERO, "link1", reference=reference),
        lambda: ENGINE.inverse_dynamics(
            ZERO, ZERO, ZERO, external_forces={"link1": np.zeros(6)}, force_reference=reference
        ),
    )
    for call in calls:
        with pytest.raises(UnknownNameError, match=r"reference is .*(world|local)"):
            call()


@pytest.mark.parametrize(
    ("point", "kind", "message"),
    [
        (np.zeros(2), ShapeError, r"point has shape \(2,\)"),
        (np.zeros((2, 3)), ArgumentError, r"point has shape \(2, 3\); wanted \(3,\)"),
        (_at(0, np.nan), NotFiniteError, r"point\[0\] is nan"),
        ("tip", DTypeError, "point has dtype"),
    ],
)
def test_a_bad_point_is_named(point: Any, kind: type[DynxError], message: str) -> None:
    with pytest.raises(kind, match=message):
        ENGINE.jacobian(ZERO, "link1", point=point)
    with pytest.raises(kind, match=message):
        ENGINE.frame_velocity(ZERO, ZERO, "link1", point=point)


@pytest.mark.parametrize(
    ("forces", "kind", "message"),
    [
        ({"lnik1": np.zeros(6)}, UnknownNameError, "no frame 'lnik1'"),
        ({"link1": np.zeros(3)}, ShapeError, r"external_forces\['link1'\] has shape \(3,\); wanted"),
        ({"link1": np.full(6, np.inf)}, NotFiniteError, r"external_forces\['link1'\]\[0\] is inf"),
        ({"link1": None}, DTypeError, "has dtype object"),
        (np.zeros(6), ArgumentError, "external_forces is of type ndarray"),
        ([("link1", np.zeros(6))], ArgumentError, "external_forces is of type list"),
    ],
)
def test_bad_external_forces_are_named(forces: Any, kind: type[DynxError], message: str) -> None:
    calls: tuple[Callable[[], Floats], ...] = (
        lambda: ENGINE.inverse_dynamics(ZERO, ZERO, ZERO, external_forces=forces),
        lambda: ENGINE.forward_dynamics(ZERO, ZERO, ZERO, external_forces=forces),
        lambda: ENGINE.bias_torque(ZERO, ZERO, external_forces=forces),
    )
    for call in calls:
        with pytest.raises(kind, match=message):
            call()


@pytest.mark.parametrize("engine", [ENGINE, PinocchioBackend(chain(3), validate=False)])
def test_leading_axes_must_broadcast(engine: Backend) -> None:
    q, v, _ = motion(engine.model, size=(2,))
    with pytest.raises(ShapeError, match=r"leading axes of \(2, 3\), \(5, 3\) do not broadcast"):
        engine.bias_torque(q, np.zeros((5, 3)))
    with pytest.raises(ShapeError, match=r"\(2, 3\), \(2, 3\), \(3, 3\) do not broadcast"):
        engine.inverse_dynamics(q, v, np.zeros((3, 3)))
    with pytest.raises(ShapeError, match="do not broadcast"):
        engine.inverse_dynamics(q, v, v, external_forces={"link1": np.zeros((5, 6))})
    tau = np.zeros((5, 3))
    for joint_dynamics in (False, True):
        with pytest.raises(ShapeError, match="do not broadcast"):
            engine.forward_dynamics(q, v, tau, joint_dynamics=joint_dynamics)
    for point in (None, (0.1, 0.2, 0.3)):
        with pytest.raises(ShapeError, match="do not broadcast"):
            engine.frame_velocity(q, tau, "link1", point=point)
        with pytest.raises(ShapeError, match="do not broadcast"):
            engine.frame_acceleration(q, v, tau, "link1", point=point)
        with pytest.raises(ShapeError, match="do not broadcast"):
            engine.jacobian_derivative(q, tau, "link1", point=point)


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@given(ANYTHING, ANYTHING, ANYTHING, ANYTHING)
def test_any_arguments_raise_only_errors_of_dynx(q: Any, v: Any, frame: Any, option: Any) -> None:
    calls: tuple[Callable[[], Floats], ...] = (
        lambda: ENGINE.forward_kinematics(q, frame),
        lambda: ENGINE.forward_kinematics(ZERO, frame),
        lambda: ENGINE.jacobian(ZERO, frame, reference=option),
        lambda: ENGINE.jacobian(ZERO, "link1", point=option),
        lambda: ENGINE.inverse_dynamics(q, v, ZERO),
        lambda: ENGINE.forward_dynamics(ZERO, v, ZERO, external_forces=option),
    )
    for call in calls:
        assert _returns_or_refuses(call)


def _returns_or_refuses(call: Callable[[], Floats]) -> bool:
    """Check whether the call returns an array of floats or raises an error of dynx with a message."""
    try:
        return call().dtype == np.float64
    except DynxError as error:
        return bool(str(error))


@pytest.mark.parametrize(
    ("rows", "where"),
    [([2], r"at sample \[2\]: no"), ([1, 2], r"at sample \[1\] \(and 1 more\): no")],
)
def test_samples_without_an_acceleration_are_named(rows: list[int], where: str) -> None:
    a = np.zeros((4, 3))
    a[rows, 1] = np.nan
    with pytest.raises(SingularMassMatrixError, match=where):
        Arguments(chain(3)).finite_acceleration(a)
