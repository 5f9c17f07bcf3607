"""Derivatives against Pinocchio's on real robots, and against 50 digits on random ones."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from benchmarks.every_quantity import tree
from dynx.agreement.magnitudes import Magnitudes
from dynx.compiled.derivative_programs import (
    factors_of_mass,
    forward_dynamics_derivatives,
    inverse_dynamics_derivatives,
    pair_count,
    solution_by_factors,
)
from dynx.compiled.derivatives import MAX_COMPILED_PAIRS, MAX_NV_OF_ONE_KERNEL, Derivatives
from dynx.compiled.kernels import evaluate_quantity
from dynx.compiled.model_coordinates import argument_shapes
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.engines.pinocchio.library import pin
from dynx.errors import (
    ArgumentError,
    NotFiniteError,
    ShapeError,
    SingularMassMatrixError,
    UnknownNameError,
)
from dynx.model import Link, Model
from dynx.model.tree import Base
from dynx.rbd import rnea
from dynx.rbd.derivatives import inverse_dynamics_derivatives as closed_form
from dynx.reference.backend import ReferenceBackend
from dynx.simd.differentiate import differentiate
from dynx.simd.expr import Node
from dynx.simd.trace import trace
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models, samples
from tests.backends.robots import BASES, assert_close, chain, mixed_robot, motion
from tests.error_bounds import samples_at
from tests.rbd.exact import exact_mechanism, exactly, fifty_digits, rate, tree_q

MODELS = [mixed_robot(base, mimic=mimic) for base in BASES for mimic in (False, True)]
each_model = pytest.mark.parametrize("model", MODELS, ids=["fixed", "mimic", "floating", "floating-mimic"])


FORMS = ("differentiated", "closed", "routines")


@contextmanager
def form(name: str) -> Iterator[None]:
    """Compute derivatives of inverse dynamics in one form only; a floating base is never differentiated."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dynx.compiled.derivatives.MAX_COMPILED_PAIRS", -1 if name == "routines" else 10**6)
        limit = 10**6 if name == "differentiated" else -1
        patch.setattr("dynx.compiled.derivative_programs.MAX_DIFFERENTIATED_PAIRS", limit)
        patch.setenv("DYNX_CACHE", "0")
        yield


class PinocchioDerivatives:
    """Pinocchio's analytic derivatives in the coordinates of the model."""

    def __init__(self, model: Model) -> None:
        self._engine = PinocchioBackend(model)._engine
        self._data = self._engine.createData()
        coupling = model.mechanism.coupling
        self._coupling = coupling
        self._S = np.eye(model.nv) if coupling is None else coupling.matrix()

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> list[Floats]:
        """dtau/dq, dtau/dv and M."""
        q = q if self._coupling is None else self._coupling.expand_q(q)
        pin.computeRNEADerivatives(self._engine, self._data, q, self._S @ v, self._S @ a)
        found = [np.array(x) for x in (self._data.dtau_dq, self._data.dtau_dv, self._data.M)]
        found[2] = np.triu(found[2]) + np.triu(found[2], 1).T
        return [self._S.T @ x @ self._S for x in found]

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> list[Floats]:
        """da/dq, da/dv and the inverse of M, of a robot without mimic joints."""
        pin.computeABADerivatives(self._engine, self._data, q, v, tau)
        found = [np.array(x) for x in (self._data.ddq_dq, self._data.ddq_dv, self._data.Minv)]
        found[2] = np.triu(found[2]) + np.triu(found[2], 1).T
        return found


REAL = [
    ("ur5", "fixed"),
    ("panda", "fixed"),
    ("solo12", "floating"),
]
"""A chain, one with a mimic joint, whose accelerations are not compared, and a tree."""


@pytest.mark.long_cases
@pytest.mark.parametrize(("name", "base"), REAL)
def test_real_robots_against_pinocchio(name: str, base: Base) -> None:
    model = dynx.load(name, base=base)
    derivatives, engine = Derivatives(model), PinocchioDerivatives(model)
    q, v, x = motion(model, size=(5,))
    of_torque = derivatives.inverse_dynamics_derivatives(q, v, x)
    of_acceleration = derivatives.forward_dynamics_derivatives(q, v, x)
    for k in range(5):
        for field, found, wanted in zip(
            of_torque._fields, of_torque, engine.inverse_dynamics(q[k], v[k], x[k]), strict=True
        ):
            assert_close(found[k], wanted, what=field)
        if model.mechanism.coupling is not None:
            continue
        # An acceleration amplifies rounding by the condition number of the mass matrix.
        condition = float(np.linalg.cond(of_torque.dtau_da[k]))
        for field, found, wanted in zip(
            of_acceleration._fields, of_acceleration, engine.forward_dynamics(q[k], v[k], x[k]), strict=True
        ):
            assert_close(found[k], wanted, condition * float(np.max(np.abs(wanted))), field)


@given(st.data())
@settings(max_examples=25)
def test_random_robots_in_50_digits(data: st.DataObject) -> None:
    model = data.draw(models(max_links=4, base="either"))
    q, v, a = data.draw(samples(model))
    with form(data.draw(st.sampled_from(FORMS))):
        found = Derivatives(model, threads=1).inverse_dynamics_derivatives(q, v, a)
    sizes = Magnitudes(samples_at(model, q, v, a))
    # A torque, per radian and per metre; each velocity product, per velocity.
    size = float(np.max(sizes.torque, initial=0.0))
    with fifty_digits():
        mechanism = exact_mechanism(model)
        S = np.eye(mechanism.nv) if mechanism.coupling is None else mechanism.coupling.matrix()
        S = exactly(S)
        at, speed, change = tree_q(model, q), S @ exactly(v), S @ exactly(a)
        for j in range(model.nv):
            column = S[:, j]
            by = {
                "dtau_dq": rate(
                    lambda x: rnea.inverse_dynamics(mechanism, x, speed, change), mechanism, at, column
                ),
                "dtau_da": rnea.inverse_dynamics(mechanism, at, 0 * speed, column)
                - rnea.inverse_dynamics(mechanism, at, 0 * speed, 0 * column),
            }
            for name, derivative in by.items():
                got = getattr(found, name)[:, j]
                assert_close(got, np.asarray(S.T @ derivative, dtype=float), max(size, 1e-12), name)


@pytest.mark.long_cases
@each_model
def test_all_forms_agree(model: Model) -> None:
    """In batches that fill the lanes, in parts of them, and in the array code that both are traced from."""
    q, v, a = motion(model, size=(9,))
    v[4] = 0.0
    mechanism = model.mechanism
    S = np.eye(mechanism.nv) if mechanism.coupling is None else mechanism.coupling.matrix()
    q_tree = q if mechanism.coupling is None else mechanism.coupling.expand_q(q)
    plain = closed_form(mechanism, q_tree, v @ S.T, a @ S.T)
    wanted = [S.T @ matrix @ S for matrix in plain]
    for name in FORMS:
        with form(name):
            compiled = Derivatives(model, threads=2)
            found = compiled.inverse_dynamics_derivatives(q, v, a)
            one = compiled.inverse_dynamics_derivatives(q[2], v[2], a[2])
        for field, got, single, expected in zip(found._fields, found, one, wanted, strict=True):
            assert_close(got, expected, what=f"{name} {field}")
            assert_close(single, expected[2], what=f"{name} {field}")
        np.testing.assert_array_equal(found.dtau_da, np.swapaxes(found.dtau_da, -1, -2))


def test_nothing_is_compiled_for_the_derivatives_of_a_large_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of inverse dynamics; they had compiled for minutes."""
    small, large = tree(8), tree(101)
    assert pair_count(large.mechanism) > MAX_COMPILED_PAIRS
    with form("routines"):
        Derivatives(small).inverse_dynamics_derivatives(*motion(small))
    monkeypatch.setattr("dynx.simd.cache.compile_image", _refuse)
    monkeypatch.setattr("dynx.simd.call_table.compile_routines", _refuse)
    q, v, a = motion(large)
    found = Derivatives(large).inverse_dynamics_derivatives(q, v, a)
    plain = closed_form(large.mechanism, q, v, a)
    for got, wanted in zip(found, plain, strict=True):
        assert_close(got, wanted)


def _refuse(*_: object) -> None:
    raise AssertionError("nothing is to be compiled")


@pytest.mark.long_cases
@each_model
def test_forward_undoes_inverse(model: Model) -> None:
    """d/dx of ID(q, v, FD(q, v, tau)) = tau."""
    derivatives = Derivatives(model, threads=1)
    q, v, tau = motion(model, size=(4,))
    a = ReferenceBackend(model).forward_dynamics(q, v, tau)
    dtau_dq, dtau_dv, M = derivatives.inverse_dynamics_derivatives(q, v, a)
    da_dq, da_dv, da_dtau = derivatives.forward_dynamics_derivatives(q, v, tau)
    size = float(np.max(np.linalg.cond(M)))
    assert_close(M @ da_dtau, np.broadcast_to(np.eye(model.nv), M.shape), size)
    assert_close(M @ da_dq, -dtau_dq, size * float(np.max(np.abs(dtau_dq))))
    assert_close(M @ da_dv, -dtau_dv, size * float(np.max(np.abs(dtau_dv))))
    assert_close(M, ReferenceBackend(model).mass_matrix(q))
    np.testing.assert_array_equal(M, np.swapaxes(M, -1, -2))


@each_model
def test_stages_give_the_results_of_one_kernel(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = ((), (3,), (2, 40))
    samples_of = {size: motion(model, size=size) for size in sizes}
    monkeypatch.setattr("dynx.compiled.derivatives.MAX_NV_OF_ONE_KERNEL", 100)
    whole = Derivatives(model, threads=1)
    at_once = {size: whole.forward_dynamics_derivatives(*state) for size, state in samples_of.items()}
    monkeypatch.setattr("dynx.compiled.derivatives.MAX_NV_OF_ONE_KERNEL", 0)
    staged = Derivatives(model, threads=1)
    for size, state in samples_of.items():
        condition = float(np.max(np.linalg.cond(ReferenceBackend(model).mass_matrix(state[0]))))
        for got, wanted in zip(staged.forward_dynamics_derivatives(*state), at_once[size], strict=True):
            assert got.shape == (*size, model.nv, model.nv)
            assert_close(got, wanted, condition * float(np.max(np.abs(wanted))))


@each_model
def test_derivative_of_a_pose_is_its_jacobian(model: Model) -> None:
    derivatives, reference = Derivatives(model, threads=1), ReferenceBackend(model)
    q, _, _ = motion(model, size=(3,))
    for frame in ("tip", "link6", "link0"):
        dT = derivatives.forward_kinematics_derivative(q, frame)
        assert dT.shape == (3, 4, 4, model.nv)
        T, J = reference.forward_kinematics(q, frame), reference.jacobian(q, frame)
        assert_close(dT[:, :3, 3], J[:, :3])
        for j in range(model.nv):
            # dR = [w] R, column by column.
            turned = np.cross(J[:, None, 3:, j], np.swapaxes(T[:, :3, :3], -1, -2))
            assert_close(dT[:, :3, :3, j], np.swapaxes(turned, -1, -2))
        np.testing.assert_array_equal(dT[:, 3], 0.0)


@each_model
def test_batches_broadcast_and_threads_change_nothing(model: Model) -> None:
    one, two = Derivatives(model, threads=1), Derivatives(model, threads=2)
    q, v, a = motion(model, size=(2, 3))
    for method in ("inverse_dynamics_derivatives", "forward_dynamics_derivatives"):
        whole = getattr(one, method)(q[:, :1], v[0], a[0, 0])
        for got, same, field in zip(
            whole, getattr(two, method)(q[:, :1], v[0], a[0, 0]), whole._fields, strict=True
        ):
            assert got.shape == (2, 3, model.nv, model.nv)
            np.testing.assert_array_equal(got, same)
            single = getattr(getattr(one, method)(q[1, 0], v[0, 2], a[0, 0]), field)
            assert_close(got[1, 2], single, float(np.max(np.abs(whole[2]))))
        empty = getattr(one, method)(q[:0], v[:0], a[:0])
        assert empty[0].shape == (0, 3, model.nv, model.nv)


def test_implicit_differentiation_is_smaller_than_that_of_the_algorithm() -> None:
    mechanism = dynx.load("ur5").mechanism
    assert mechanism.nv <= MAX_NV_OF_ONE_KERNEL
    program = trace(
        lambda q, v, tau: evaluate_quantity(mechanism, "forward_dynamics", (), q, v, tau),
        argument_shapes(mechanism, ("q", "v", "tau")),
    )
    direct = differentiate(program, [("result", name) for name in ("q", "v", "tau")], order="reverse")
    assert 2 * len(forward_dynamics_derivatives(mechanism).nodes) < len(direct.nodes)


def test_zeros_between_branches_are_not_computed() -> None:
    mechanism = dynx.load("solo12").mechanism
    program = inverse_dynamics_derivatives(mechanism)
    zero = Node("constant", value=0.0)
    results = np.array([program.nodes[k] == zero for k in program.results]).reshape(3, 12, 12)
    leg = np.arange(12) // 3
    assert results[:, leg[:, None] != leg].all()
    assert not results[2, range(12), range(12)].any()
    # Four legs of three joints: three entries below the diagonal each, and the diagonal.
    assert factors_of_mass(mechanism).outputs[0].size == 4 * 3 + 12
    assert solution_by_factors(mechanism).inputs[0].size == 4 * 3 + 12


@pytest.mark.parametrize("joints", [0, 1])
def test_the_smallest_robots(joints: int) -> None:
    model = chain(joints)
    derivatives = Derivatives(model)
    for size in ((), (5,)):
        for method in (derivatives.inverse_dynamics_derivatives, derivatives.forward_dynamics_derivatives):
            found = method(*motion(model, size=size))
            assert all(x.shape == (*size, joints, joints) for x in found)
        dT = derivatives.forward_kinematics_derivative(motion(model, size=size)[0], model.frame_names[-1])
        assert dT.shape == (*size, 4, 4, joints)


def test_invalid_arguments_are_refused() -> None:
    model = MODELS[0]
    derivatives = Derivatives(model)
    q, v, a = motion(model)
    with pytest.raises(ShapeError, match="a has shape"):
        derivatives.inverse_dynamics_derivatives(q, v, a[:-1])
    with pytest.raises(NotFiniteError, match="tau"):
        derivatives.forward_dynamics_derivatives(q, v, np.full(model.nv, np.nan))
    with pytest.raises(UnknownNameError, match="tip"):
        derivatives.forward_kinematics_derivative(q, "tipp")
    with pytest.raises(ArgumentError, match="threads"):
        Derivatives(model, threads=0)
    bare = Model.build("bare", [Link("link0"), Link("link1")], chain(1).joints)
    with pytest.raises(SingularMassMatrixError, match="joint0"):
        Derivatives(bare).forward_dynamics_derivatives([0.0], [0.0], [0.0])


def test_it_pickles() -> None:
    derivatives = Derivatives(MODELS[1], threads=1)
    state = motion(MODELS[1])
    copy = pickle.loads(pickle.dumps(derivatives))
    for got, wanted in zip(
        copy.inverse_dynamics_derivatives(*state),
        derivatives.inverse_dynamics_derivatives(*state),
        strict=True,
    ):
        np.testing.assert_array_equal(got, wanted)
