"""Calls of every method of a backend, with the shapes of their results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps
from inspect import Signature, signature
from typing import Any

import numpy as np

from dynx.agreement.compared_quantities import compared_quantities
from dynx.backends import Backend
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.model import Model
from dynx.rbd.jacobians import REFERENCES
from dynx.spatial.scalar import Floats
from tests.error_bounds import ErrorBounds, samples_at


@dataclass(frozen=True)
class State:
    """q (..., nq), v, a, tau (..., nv), with leading axes that broadcast."""

    q: Any
    v: Any
    a: Any
    tau: Any

    def map(self, change: Callable[[Any], Any]) -> State:
        """Apply `change` to each of the four arrays."""
        return State(change(self.q), change(self.v), change(self.a), change(self.tau))


@dataclass(frozen=True)
class EngineCall:
    """A quantity of the table, with options of its method."""

    quantity: Quantity
    options: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return "-".join([self.method, *map(str, self.options.values())])

    @property
    def method(self) -> str:
        """Name of the method of `Backend`."""
        return self.quantity.name

    @property
    def arguments(self) -> tuple[str, ...]:
        """The arrays of a state that the method takes."""
        return self.quantity.arguments

    def tail(self, model: Model) -> tuple[int, ...]:
        """Return the last axes of the result."""
        return self.quantity.shape_of(model)

    def evaluate(self, engine: Backend, state: State, method: str | None = None) -> Floats:
        """Return the result at a state, by another `method` if given; for a quantity of a frame, that of the
        model's last one."""
        values = [getattr(state, argument) for argument in self.arguments]
        options = dict(self.options)
        if self.quantity.of_frame:
            options["frame"] = engine.model.frame_names[-1]
        if options.pop("with_force", False):
            force = np.array([1.0, -2.0, 0.5, 0.1, 0.2, -0.3])
            options["external_forces"] = {engine.model.frame_names[-1]: force}
        result: Floats = getattr(engine, method or self.method)(*values, **options)
        return result

    def of_shared_parts(self, result: Floats, model: Model, part: Model) -> Floats:
        """Return those entries of a result of `model` that belong to links and joints of `part`."""
        if self.method == "inertial_regressor":
            links = [model.links.index(link) for link in part.links]
            by_link = result.reshape(*result.shape[:-1], len(model.links), 10)
            return by_link[..., links, :].reshape(*result.shape[:-1], -1)
        if self.method == "joint_wrenches":
            names = [joint.name for joint in model.joints]
            return result[..., [names.index(joint.name) for joint in part.joints], :]
        return result

    def check(self, engine: Backend, state: State, got: Floats, wanted: Floats) -> None:
        """Assert that two results at `state`, of one leading axis or none, agree."""
        close = ErrorBounds(samples_at(engine.model, state.q, state.v, state.a, state.tau))
        if self.quantity.solves:
            for a in (got, wanted):
                close.check_solves(a, engine.inverse_dynamics(state.q, state.v, a), state.tau)
        elif self.options.get("with_force"):
            in_three_references = [np.concatenate([result] * 3, axis=-1) for result in (got, wanted)]
            close.check(f"{self.method}_external_forces", *in_three_references)
        elif self.options.get("joint_dynamics"):
            close.check(f"{self.method}_joint_dynamics", got, wanted)
        else:
            close.check(self.method, got, wanted)


def engine_calls() -> tuple[EngineCall, ...]:
    """Every quantity of the table in every reference, and its variants that `dynx agree` compares too."""
    compared = {line.name for line in compared_quantities()}
    calls: list[EngineCall] = []
    for quantity in QUANTITIES.values():
        if "reference" in quantity.options:
            calls += [EngineCall(quantity, {"reference": reference}) for reference in REFERENCES]
        else:
            calls.append(EngineCall(quantity))
        if f"{quantity.name}_external_forces" in compared:
            calls.append(EngineCall(quantity, {"with_force": True}))
        if f"{quantity.name}_joint_dynamics" in compared:
            calls.append(EngineCall(quantity, {"joint_dynamics": True}))
    return tuple(calls)


ENGINE_CALLS = engine_calls()


def each_call(test: Callable[..., None]) -> Callable[..., None]:
    """Run a test for every call, which it takes as `engine_call`; a test for each would be 9,000 of them."""

    @wraps(test)
    def run(*instance: Any, **given: Any) -> None:
        for engine_call in ENGINE_CALLS:
            test(*instance, engine_call=engine_call, **given)

    parameters = signature(test).parameters
    others = [each for name, each in parameters.items() if name != "engine_call"]
    run.__signature__ = Signature(others)  # type: ignore[attr-defined]
    return run


def random_state(model: Model, seed: int, size: tuple[int, ...] = ()) -> State:
    """Return a state from a seed; the same for every backend."""
    rng = np.random.default_rng(seed)
    v, a, tau = (rng.uniform(-2.0, 2.0, (*size, model.nv)) for _ in range(3))
    return State(model.random(rng, size), v, a, tau)
