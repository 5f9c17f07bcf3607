"""Every question that can be put to a backend, with the shape that its answer must have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dynx.backends import Backend
from dynx.model import Model
from dynx.spatial.scalar import Floats
from tests.closeness import BY_NAME, Closeness, samples_at


@dataclass(frozen=True)
class State:
    """q (..., nq), v, a, tau (..., nv); each may have leading axes of its own."""

    q: Any
    v: Any
    a: Any
    tau: Any

    def map(self, change: Callable[[Any], Any]) -> State:
        """The state with `change` made to each of the four."""
        return State(change(self.q), change(self.v), change(self.a), change(self.tau))


@dataclass(frozen=True)
class Question:
    """A method of `Backend`, which of the state it takes, and the last axes of its answer."""

    method: str
    arguments: tuple[str, ...]
    tail: Callable[[Model], tuple[int, ...]]
    about_frame: bool = False
    options: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return "-".join([self.method, *map(str, self.options.values())])

    def ask(self, engine: Backend, state: State) -> Floats:
        """The answer; a question about a frame asks for the model's last one."""
        values = [getattr(state, argument) for argument in self.arguments]
        options = dict(self.options)
        if self.about_frame:
            options["frame"] = engine.model.frame_names[-1]
        if options.pop("with_force", False):
            force = np.array([1.0, -2.0, 0.5, 0.1, 0.2, -0.3])
            options["external_forces"] = {engine.model.frame_names[-1]: force}
        answer: Floats = getattr(engine, self.method)(*values, **options)
        return answer

    def check(self, engine: Backend, state: State, got: Floats, wanted: Floats) -> None:
        """Assert that two answers at `state`, of one leading axis or none, are the same."""
        close = Closeness(samples_at(engine.model, state.q, state.v, state.a, state.tau))
        if self.method == "forward_dynamics":
            for a in (got, wanted):
                close.check_solves(a, engine.inverse_dynamics(state.q, state.v, a), state.tau)
        elif self.options.get("with_force"):
            close.check("inverse_dynamics_external_forces", np.tile(got, 3), np.tile(wanted, 3))
        elif self.options.get("joint_dynamics"):
            close.check("inverse_dynamics_joint_dynamics", got, wanted)
        else:
            assert self.method in BY_NAME
            close.check(self.method, got, wanted)


def _nv(model: Model) -> tuple[int, ...]:
    return (model.nv,)


def _square(model: Model) -> tuple[int, ...]:
    return (model.nv, model.nv)


def _twist(model: Model) -> tuple[int, ...]:
    return (6,)


def _jacobian(model: Model) -> tuple[int, ...]:
    return (6, model.nv)


REFERENCED = tuple(
    Question(method, arguments, tail, about_frame=True, options={"reference": reference})
    for reference in ("local_world_aligned", "local", "world")
    for method, arguments, tail in (
        ("jacobian", ("q",), _jacobian),
        ("jacobian_derivative", ("q", "v"), _jacobian),
        ("frame_velocity", ("q", "v"), _twist),
        ("frame_acceleration", ("q", "v", "a"), _twist),
    )
)
QUESTIONS = (
    Question("forward_kinematics", ("q",), lambda model: (4, 4), about_frame=True),
    *REFERENCED,
    Question("inverse_dynamics", ("q", "v", "a"), _nv),
    Question("inverse_dynamics", ("q", "v", "a"), _nv, options={"with_force": True}),
    Question("inverse_dynamics", ("q", "v", "a"), _nv, options={"joint_dynamics": True}),
    Question("forward_dynamics", ("q", "v", "tau"), _nv),
    Question("mass_matrix", ("q",), _square),
    Question("bias_torque", ("q", "v"), _nv),
    Question("gravity_torque", ("q",), _nv),
    Question("coriolis_matrix", ("q", "v"), _square),
    Question("inertial_regressor", ("q", "v", "a"), lambda model: (model.nv, 10 * len(model.links))),
    Question("center_of_mass", ("q",), lambda model: (3,)),
    Question("center_of_mass_jacobian", ("q",), lambda model: (3, model.nv)),
    Question("centroidal_momentum", ("q", "v"), lambda model: (6,)),
    Question("kinetic_energy", ("q", "v"), lambda model: ()),
    Question("potential_energy", ("q",), lambda model: ()),
)


def random_state(model: Model, seed: int, size: tuple[int, ...] = ()) -> State:
    """A state from a seed; the same for every backend."""
    rng = np.random.default_rng(seed)
    v, a, tau = (rng.uniform(-2.0, 2.0, (*size, model.nv)) for _ in range(3))
    return State(model.random(rng, size), v, a, tau)
