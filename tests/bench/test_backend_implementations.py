"""Every backend as an implementation, on robots with mimic joints and with a floating base."""

from __future__ import annotations

import pytest

import dynx
from dynx.backends.registry import installed_backends
from dynx.bench.cases import BENCHMARK_QUANTITIES, BenchmarkCase, draw_batch
from dynx.bench.implementations import backend_implementation
from dynx.bench.measurement import measure
from dynx.errors import UnknownBackendError
from dynx.model.tree import Base


@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("name", installed_backends())
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_every_backend_computes_every_quantity(name: str, base: Base, count: int) -> None:
    model = dynx.load("panda", base=base)
    batch = draw_batch(model, "panda_hand", count)
    implementation = backend_implementation(model, name, 1)
    for quantity in BENCHMARK_QUANTITIES:
        (found,) = measure(BenchmarkCase(quantity, count), [implementation], batch, 1)
        assert found.problem is None
        assert found.times is not None


def test_a_backend_with_threads_gets_them() -> None:
    model = dynx.load("double_pendulum")
    implementation = backend_implementation(model, "compiled", 2)
    assert (implementation.name, implementation.threads, implementation.whole) == ("compiled", 2, True)
    implementation = backend_implementation(model, "reference", 2)
    assert (implementation.name, implementation.threads, implementation.whole) == ("reference", 1, False)


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(UnknownBackendError):
        backend_implementation(dynx.load("double_pendulum"), "nosuch", 1)


def test_closing_closes_the_backend() -> None:
    model = dynx.load("double_pendulum")
    implementation = backend_implementation(model, "reference", 1)
    implementation.close()
    (found,) = measure(BenchmarkCase("mass_matrix", 1), [implementation], draw_batch(model, "tip", 1), 1)
    assert found.problem is not None
    assert "was closed" in found.problem
