"""The compiled backend: threads, closing, and which kernels and algorithms compute its results."""

from __future__ import annotations

import pickle
import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.backends import backend
from dynx.backends.derived import native_quantities
from dynx.backends.quantities import QUANTITIES
from dynx.compiled import kernels
from dynx.compiled.backend import CompiledBackend
from dynx.compiled.call import MAX_COPIED_SAMPLES, CoupledCall, KernelCall, NumericCall
from dynx.compiled.table_kernels import TABLE_QUANTITIES
from dynx.errors import ArgumentError, ClosedError
from dynx.model import Inertial, Link, Mechanism, Model
from dynx.rbd.elimination import has_physical_inertias
from dynx.simd.kernel import Kernel
from tests.backends.robots import chain
from tests.compiled.robots import ROBOTS, TIP, made, state
from tests.error_bounds import ErrorBounds, samples_at


def test_it_is_found_by_name_and_has_a_version() -> None:
    engine = dynx.backend("compiled", chain(1))
    assert "compiled" in dynx.installed_backends()
    for word in ("dynx", "llvmlite", "LLVM"):
        assert word in engine.engine_version


@pytest.mark.parametrize("threads", [0, -1, 2.0, "2", True])
def test_invalid_numbers_of_threads_are_refused(threads: object) -> None:
    with pytest.raises(ArgumentError, match="threads is"):
        backend("compiled", chain(1), threads=threads)


def test_pickling_keeps_the_threads() -> None:
    assert pickle.loads(pickle.dumps(made(chain(1), threads=3)))._threads == 3


def test_concurrent_calls_compile_a_kernel_once(monkeypatch: pytest.MonkeyPatch) -> None:
    model = chain(3)
    engine = made(model)
    traced: list[str] = []
    make = kernels.quantity_kernel

    def counted(mechanism: Mechanism, name: str, details: tuple[Any, ...]) -> Kernel:
        traced.append(name)
        return make(mechanism, name, details)

    monkeypatch.setattr("dynx.compiled.backend.quantity_kernel", counted)
    q, v, a = state(model)
    start = threading.Barrier(6)

    def call() -> None:
        start.wait()
        engine.inverse_dynamics(q, v, a)

    threads = [threading.Thread(target=call) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert traced == ["inverse_dynamics"]


def test_closing_during_calls_of_other_threads() -> None:
    """A call returns the right result or raises ClosedError; no memory in use is freed."""
    model = ROBOTS["fixed"]
    q, v, a = state(model, (5000,))
    wanted = made(model).inverse_dynamics(q, v, a)
    for _ in range(5):
        engine = made(model)
        wrong: list[object] = []

        def call_until_closed(engine: CompiledBackend = engine, wrong: list[object] = wrong) -> None:
            try:
                while True:
                    if not np.array_equal(engine.inverse_dynamics(q, v, a), wanted):
                        wrong.append("result")
            except ClosedError:
                return

        threads = [threading.Thread(target=call_until_closed) for _ in range(3)]
        for thread in threads:
            thread.start()
        engine.close()
        for thread in threads:
            thread.join(30)
        assert not wrong


# -- kernels -----------------------------------------------------------------------------------------


def test_every_quantity_is_native() -> None:
    assert native_quantities(CompiledBackend) == set(QUANTITIES)


def test_mimic_joints_are_part_of_the_kernel() -> None:
    """A call in model coordinates makes one kernel, whose inputs are those coordinates."""
    engine = made(ROBOTS["mimic"])
    q, v, a = state(engine.model)
    engine.inverse_dynamics(q, v, a)
    engine.bias_torque(q, v)
    engine.forward_dynamics(q, v, a)
    for call in engine._calls.values():
        assert isinstance(call, KernelCall)
        assert {port.shape for port in call._kernel.inputs} == {(engine.model.nv,)}


def test_hooks_use_tree_coordinates() -> None:
    engine = made(ROBOTS["mimic"])
    coupling = engine._mechanism.coupling
    assert coupling is not None
    q, v, a = state(engine.model, (3,))
    S = coupling.matrix()
    tree = engine._inverse_dynamics(coupling.expand_q(q), v @ S.T, a @ S.T)
    ErrorBounds(samples_at(engine.model, q, v, a)).check(
        "inverse_dynamics", tree @ S, engine.inverse_dynamics(q, v, a)
    )


def test_an_unphysical_robot_with_mimic_joints_is_solved_with_pivots() -> None:
    """Elimination without pivoting is inaccurate for an indefinite mass matrix."""
    model = ROBOTS["mimic"]
    odd = replace(model.links[2].inertial or Inertial(1.0), ixx=-5.0)
    links = [replace(link, inertial=odd) if k == 2 else link for k, link in enumerate(model.links)]
    bad = Model.build("bad", links, model.joints)
    assert has_physical_inertias(model.mechanism)
    assert not has_physical_inertias(bad.mechanism)
    engine = made(bad)
    q, v, a = state(bad, (3,))
    found = engine.forward_dynamics(q, v, a)
    assert not any(key[0] == "forward_dynamics" for key in engine._calls if isinstance(key, tuple))
    ErrorBounds(samples_at(bad, q, v, found)).check(
        "inverse_dynamics", engine.inverse_dynamics(q, v, found), a
    )


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("robot", ["fixed", "floating mimic"])
def test_quantities_that_are_not_compiled_are_evaluated_by_routines_or_numpy(
    quantity: str, robot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = ROBOTS[robot]
    kernels, reference = made(model), backend("reference", model)
    monkeypatch.setattr("dynx.compiled.kernels.compile_seconds", lambda mechanism, name: 1e9)
    numbers = made(model)
    q, v, a = state(model, (3,))
    arguments: dict[str, Any] = {"q": q, "v": v, "a": a, "tau": a}
    values = [arguments[name] for name in QUANTITIES[quantity].arguments]
    frame = [TIP] if QUANTITIES[quantity].of_frame else []
    results = [getattr(each, quantity)(*values, *frame) for each in (numbers, reference)]
    np.testing.assert_array_equal(results[0].shape, results[1].shape)
    close = ErrorBounds(samples_at(model, q, v, a, a))
    if quantity == "forward_dynamics":
        quantity, results = "inverse_dynamics", [reference.inverse_dynamics(q, v, results[0]), a]
        close = ErrorBounds(samples_at(model, q, v, numbers.forward_dynamics(q, v, a)))
    close.check(quantity, results[0], results[1])
    assert numbers._calls
    mimics = model.mechanism.coupling is not None
    looped = CoupledCall if mimics else KernelCall
    for key, result in numbers._calls.items():
        name = key[0] if isinstance(key, tuple) else ""
        by_routines = name in TABLE_QUANTITIES and not (mimics and name == "forward_dynamics")
        assert isinstance(getattr(result, "__self__", result), looped if by_routines else NumericCall)
    assert not kernels._calls


def test_robots_without_joints() -> None:
    rock = Model.build("rock", [Link("rock", Inertial(2.0))], [])
    for model in (rock, rock.with_base("floating")):
        engine, reference = made(model), backend("reference", model)
        for size in ((), (0,), (5,), (MAX_COPIED_SAMPLES + 1,)):
            q, v, a = state(model, size)
            assert engine.mass_matrix(q).shape == (*size, model.nv, model.nv)
            for name in ("inverse_dynamics", "forward_kinematics", "kinetic_energy"):
                given = {"inverse_dynamics": (q, v, a), "kinetic_energy": (q, v)}.get(name, (q,))
                if name == "inverse_dynamics" or size:
                    assert getattr(engine, name)(*given).shape == getattr(reference, name)(*given).shape
