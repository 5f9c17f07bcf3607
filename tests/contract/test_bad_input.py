"""Bad input raises an error of `dynx.errors` that names the input and the valid form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dynx.backends import Backend, backend
from dynx.errors import (
    ArgumentError,
    DTypeError,
    DynxError,
    NotFiniteError,
    ShapeError,
    SingularMassMatrixError,
    UnknownBackendError,
    UnknownNameError,
)
from dynx.model.loading import load
from dynx.model.numbers import MAX_MAGNITUDE
from tests.contract.conftest import Make
from tests.contract.engine_calls import ENGINE_CALLS, EngineCall, State, each_call, random_state
from tests.contract.robots import branched

FIXED = branched()
FLOATING = FIXED.with_base("floating")
GOOD = random_state(FLOATING, 61)

BAD_ARRAYS: dict[str, tuple[Callable[[np.ndarray], Any], type[DynxError], str]] = {
    "too short": (lambda x: x[:-1], ShapeError, r"shape \(1?\d,\); wanted \(\.\.\., 1[01]\)"),
    "too long": (lambda x: np.append(x, 0.0), ShapeError, "wanted"),
    "empty": (lambda x: np.zeros(0), ShapeError, r"\(0,\)"),
    "a number": (lambda x: 1.0, ShapeError, r"shape \(\)"),
    "a column": (lambda x: x[:, None], ShapeError, "wanted"),
    "ragged": (lambda x: [x.tolist(), [1.0]], ShapeError, "ragged"),
    "NaN": (lambda x: np.append(x[:-1], np.nan), NotFiniteError, r"\[\d+\] is nan"),
    "infinity": (lambda x: np.append(x[:-1], np.inf), NotFiniteError, r"\[\d+\] is inf"),
    "infinities that cancel": (
        lambda x: np.append([np.inf, -np.inf], x[2:]),
        NotFiniteError,
        r"\[0\] is inf",
    ),
    "too large": (lambda x: np.append(x[:-1], -1e160), ArgumentError, r"is -1e\+160; wanted less"),
    "NaN in a batch": (
        lambda x: np.stack([x, np.append(x[:-1], np.nan)]),
        NotFiniteError,
        r"\[1, \d+\] is nan",
    ),
    "complex": (lambda x: x.astype(complex), DTypeError, "complex128"),
    "words": (lambda x: ["zero"] * len(x), DTypeError, "wanted real numbers"),
    "truth values": (lambda x: np.ones(len(x), dtype=bool), DTypeError, "bool"),
    "objects": (lambda x: np.array([object()] * len(x)), DTypeError, "object"),
    "nothing": (lambda x: None, DTypeError, "object"),
    "a mapping": (lambda x: dict(enumerate(x.tolist())), DTypeError, "object"),
    "times": (lambda x: np.zeros(len(x), dtype="datetime64[s]"), DTypeError, "datetime64"),
}


@pytest.mark.parametrize("kind", BAD_ARRAYS)
@each_call
def test_an_array_that_cannot_be_used(make: Make, engine_call: EngineCall, kind: str) -> None:
    engine = make(FLOATING)
    spoil, error, says = BAD_ARRAYS[kind]
    for argument in engine_call.arguments:
        fields = {**vars(GOOD), argument: spoil(getattr(GOOD, argument))}
        with pytest.raises(error, match=says) as caught:
            engine_call.evaluate(engine, State(**fields))
        assert argument in str(caught.value)


@each_call
def test_the_largest_valid_numbers_do_not_overflow(make: Make, engine_call: EngineCall) -> None:
    """A quaternion stays one; everything else is as large as the bound allows."""
    engine = make(FLOATING)
    large = 0.99 * MAX_MAGNITUDE
    q = FLOATING.neutral()
    q[:3], q[7:] = large, large
    v = np.full(FLOATING.nv, large)
    try:
        result = engine_call.evaluate(engine, State(q, v, -v, v))
    except SingularMassMatrixError:
        # A body as far away as that leaves the joints' own inertia below its rounding error.
        assert str(engine_call) == "forward_dynamics"
    else:
        assert np.isfinite(result).all()


@pytest.mark.parametrize("engine_call", [q for q in ENGINE_CALLS if len(q.arguments) > 1], ids=str)
def test_batches_that_do_not_broadcast(make: Make, engine_call: EngineCall) -> None:
    engine = make(FLOATING)
    state = replace(random_state(FLOATING, 62, (2,)), q=random_state(FLOATING, 62, (3,)).q)
    with pytest.raises(ShapeError, match=r"\(3, 11\).*\(2, 10\)"):
        engine_call.evaluate(engine, state)


@each_call
def test_a_quaternion_that_is_no_attitude(make: Make, engine_call: EngineCall) -> None:
    engine = make(FLOATING)
    for quat in ([0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.01]):
        q = GOOD.q.copy()
        q[3:7] = quat
        with pytest.raises(ArgumentError, match="quaternion"):
            engine_call.evaluate(engine, State(q, GOOD.v, GOOD.a, GOOD.tau))


def test_a_length_of_the_other_base(make: Make) -> None:
    with pytest.raises(ShapeError):
        make(FIXED).forward_kinematics(FLOATING.neutral(), "tool")
    with pytest.raises(ShapeError):
        make(FLOATING).forward_kinematics(FIXED.neutral(), "tool")


class TestNames:
    """Unknown names; the message offers the nearest known one."""

    @pytest.mark.parametrize("method", ["forward_kinematics", "jacobian"])
    def test_frame(self, make: Make, method: str) -> None:
        with pytest.raises(UnknownNameError, match="did you mean 'tool'"):
            getattr(make(FIXED), method)(FIXED.neutral(), "tool0")
        with pytest.raises(UnknownNameError, match="that is a joint; the frame it moves is 'beta'"):
            getattr(make(FIXED), method)(FIXED.neutral(), "b_elbow")

    def test_frame_in_a_list(self, make: Make) -> None:
        with pytest.raises(UnknownNameError, match="did you mean 'tool'"):
            make(FIXED).forward_kinematics(FIXED.neutral(), ["beta", "tol"])

    @pytest.mark.parametrize("name", ["", "x" * 10_000, "\0\n\x1b[31m", 7, 2.5, b"tool", ("tool",), {}])
    def test_frame_that_cannot_be_one(self, make: Make, name: Any) -> None:
        for method in self.about_frames(make(FIXED)):
            with pytest.raises(ArgumentError) as caught:
                method(name)
            message = str(caught.value)
            assert message.isprintable()
            assert len(message) < 400

    @pytest.mark.parametrize("reference", ["WORLD", "worlds", "", 3, None, ["local"]])
    def test_reference(self, make: Make, reference: Any) -> None:
        engine, rest = make(FIXED), np.zeros(FIXED.nv)
        with pytest.raises(UnknownNameError, match=r"local|world"):
            engine.jacobian(FIXED.neutral(), "tool", reference=reference)
        with pytest.raises(UnknownNameError, match=r"local|world"):
            engine.inverse_dynamics(
                FIXED.neutral(), rest, rest, external_forces={"tool": np.zeros(6)}, force_reference=reference
            )

    def test_joint_to_lock(self) -> None:
        with pytest.raises(UnknownNameError, match="did you mean 'b_elbow'"):
            load(FIXED, lock={"elbow": 0.0})

    def test_backend(self) -> None:
        with pytest.raises(UnknownBackendError, match="did you mean 'pinocchio'"):
            backend("pinochio", FIXED)

    @staticmethod
    def about_frames(engine: Backend) -> list[Callable[[Any], object]]:
        q = FIXED.neutral()
        rest = np.zeros(FIXED.nv)
        return [
            lambda name: engine.jacobian(q, name),
            lambda name: engine.frame_velocity(q, rest, name),
            lambda name: engine.forward_kinematics(q, [name]),
        ]


class TestExternalForces:
    """Invalid frames, wrenches and points."""

    @pytest.mark.parametrize(
        ("forces", "error", "says"),
        [
            ({"tol": np.zeros(6)}, UnknownNameError, "did you mean 'tool'"),
            ({"tool": np.zeros(3)}, ShapeError, r"external_forces\['tool'\].*wanted \(\.\.\., 6\)"),
            ({"tool": [np.nan] * 6}, NotFiniteError, "external_forces"),
            ({"tool": "up"}, ArgumentError, "external_forces"),
            ([1.0, 2.0], ArgumentError, "external_forces"),
            ("tool", ArgumentError, "external_forces"),
        ],
    )
    def test_forces(self, make: Make, forces: Any, error: type[DynxError], says: str) -> None:
        rest = np.zeros(FIXED.nv)
        for method in (make(FIXED).inverse_dynamics, make(FIXED).forward_dynamics):
            with pytest.raises(error, match=says):
                method(FIXED.neutral(), rest, rest, external_forces=forces)

    def test_batches_that_do_not_broadcast(self, make: Make) -> None:
        state = random_state(FIXED, 63, (3,))
        forces = {"tool": np.zeros((2, 6))}
        for method in (make(FIXED).inverse_dynamics, make(FIXED).forward_dynamics):
            with pytest.raises(ShapeError, match="do not broadcast"):
                method(state.q, state.v, state.a, external_forces=forces)

    @pytest.mark.parametrize("point", [[0.0, 0.0], np.zeros((2, 3)), "tip", [np.inf, 0, 0]])
    def test_point(self, make: Make, point: Any) -> None:
        with pytest.raises(ArgumentError, match="point"):
            make(FIXED).jacobian(FIXED.neutral(), "tool", point=point)


def test_options_that_a_backend_does_not_have(backend_name: str) -> None:
    with pytest.raises(ArgumentError, match="validate"):
        backend(backend_name, FIXED, valdate=False)


def test_anything_but_a_model_is_refused(backend_name: str) -> None:
    name_of_one: Any = "ur5"
    with pytest.raises(ArgumentError, match="Model"):
        backend(backend_name, name_of_one)


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3) | st.binary(max_size=3),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=2), inner, max_size=2),
    max_leaves=12,
)
ARRAYS = hnp.arrays(
    dtype=hnp.scalar_dtypes(), shape=hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=11)
)


@given(st.data())
def test_any_arguments_raise_only_errors_of_dynx(make: Make, data: st.DataObject) -> None:
    engine = make(FLOATING)
    engine_call = data.draw(st.sampled_from(ENGINE_CALLS))
    wrong = data.draw(st.sampled_from(engine_call.arguments))
    state = State(**{**vars(GOOD), wrong: data.draw(JUNK | ARRAYS)})
    try:
        result = engine_call.evaluate(engine, state)
    except DynxError:
        return
    assert np.isfinite(result).all()
