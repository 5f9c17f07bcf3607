"""One step of a closed loop as one kernel: the law, the plant and the integrator, traced together.

A controller is array code over a backend's answers. Here it is run on symbols, with `dynx.rbd` in the
place of the backend, and what it computes is compiled with the dynamics of the plant: what both need,
such as sines and cosines, is computed once.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.backends.compiled_kernels import evaluated, tidied
from dynx.backends.parametric import ParametricDynamics
from dynx.control.base import Controller, Measured
from dynx.errors import ArgumentError, TraceError, UnsupportedFeatureError, shown
from dynx.model import Mechanism, Model
from dynx.simd.cache import cached_kernel, recipe_of
from dynx.simd.kernel import Kernel
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats, clipped
from dynx.trajectory.base import Setpoint

STATE = ("q", "v", "worst", "squares", "memory")
"""What a step takes and gives back: the robot's state, the largest error and the sum of squared errors
of each coordinate, and what the law remembers."""


@dataclass(frozen=True)
class StepOf:
    """What decides a step: checked, and not yet compiled."""

    model: Model
    controller: Controller[Any]
    dt: float
    gains: tuple[str, ...]
    """Attributes of the law that are given for each rollout."""
    plant: ParametricDynamics | None
    noisy: bool
    limit: Floats | None

    def __post_init__(self) -> None:
        if self.model.floating:
            raise UnsupportedFeatureError("batches of rollouts are for robots with a fixed base")
        law = innermost(self.controller)
        for name in self.gains:
            if not isinstance(vars(law).get(name), np.ndarray):
                arrays = [key for key, value in vars(law).items() if isinstance(value, np.ndarray)]
                raise ArgumentError(
                    f"{law.name} has no gain {shown(name)}; it has {', '.join(arrays) or 'none'}"
                )
        memory = self.controller.start()
        if memory is not None and not isinstance(memory, np.ndarray):
            raise UnsupportedFeatureError(
                f"{self.controller.name} remembers a {type(memory).__name__}; in a batch it may be an array"
            )

    def kernel(self, *, controlled: bool) -> Kernel:
        """The kernel of a step: `controlled`, with the law asked, or with `tau` held from before.

        Raises UnsupportedFeatureError for a law that branches on what it measures.
        """
        sizes = self.sizes(controlled=controlled)
        mechanism = tidied(self.model.mechanism)
        law = traced_law(self.controller, {})

        def step(**given: Array) -> dict[str, Array]:
            q, v = given["q"], given["v"]
            outcome: dict[str, Array] = {}
            if controlled:
                seen_q, seen_v = (q + given["noise_q"], v + given["noise_v"]) if self.noisy else (q, v)
                setpoint = Setpoint(given["q_wanted"], given["v_wanted"], given["a_wanted"])
                own = traced_law(law, {name: given[f"gain_{name}"] for name in self.gains})
                measured = Measured(given["t"][0], seen_q, seen_v)
                tau, memory = own.torque(measured, setpoint, given.get("memory"))
                if self.limit is not None:
                    tau = clipped(tau, self.limit)
                outcome["tau"] = tau
            else:
                tau, memory = given["tau"], given.get("memory")
            if memory is not None:
                outcome["memory"] = memory
            a = self._acceleration(mechanism, q, v, tau, given)
            v = v + self.dt * a
            q = q + self.dt * v
            error = abs(given["goal"] - q)
            worst = np.array([x.maximum(e) for x, e in zip(given["worst"], error, strict=True)])
            return {"q": q, "v": v, "worst": worst, "squares": given["squares"] + error * error, **outcome}

        try:
            program = trace(step, sizes)
        except TraceError as error:
            raise UnsupportedFeatureError(
                f"{self.controller.name} cannot be fused with the plant, since it asks for values: {error}"
            ) from error
        return cached_kernel(recipe_of(program), lambda: program)

    def sizes(self, *, controlled: bool) -> dict[str, tuple[int]]:
        """The inputs of a step in their order, and their sizes."""
        nv = self.model.nv
        sizes = dict.fromkeys(("q", "v", "worst", "squares", "goal"), nv)
        if not controlled:
            sizes["tau"] = nv
        else:
            sizes |= dict.fromkeys(("q_wanted", "v_wanted", "a_wanted"), nv) | {"t": 1}
            if self.noisy:
                sizes |= {"noise_q": nv, "noise_v": nv}
            law = innermost(self.controller)
            sizes |= {f"gain_{name}": getattr(law, name).size for name in self.gains}
        memory = self.controller.start()
        if memory is not None:
            sizes["memory"] = memory.size
        if self.plant is not None:
            sizes["parameters"] = len(self.plant.parameters.names)
        return {name: (size,) for name, size in sizes.items()}

    def _acceleration(
        self, mechanism: Mechanism, q: Array, v: Array, tau: Array, given: Mapping[str, Array]
    ) -> Array:
        if self.plant is not None:
            return self.plant.acceleration(given["parameters"], q, v, tau)
        return evaluated(mechanism, "forward_dynamics", (), q, v, tau)


class TracedDynamics:
    """What `dynx.control` asks of a backend, answered on symbols."""

    def __init__(self, model: Model) -> None:
        self._mechanism = tidied(model.mechanism)

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """tau (nv,)."""
        return evaluated(self._mechanism, "inverse_dynamics", (), q, v, a)

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """a (nv,)."""
        return evaluated(self._mechanism, "forward_dynamics", (), q, v, tau)

    def bias_torque(self, q: Array, v: Array) -> Array:
        """C v + g (nv,)."""
        return evaluated(self._mechanism, "bias_torque", (), q, v)

    def gravity_torque(self, q: Array) -> Array:
        """g (nv,)."""
        return evaluated(self._mechanism, "gravity_torque", (), q)

    def mass_matrix(self, q: Array) -> Array:
        """M (nv, nv)."""
        return evaluated(self._mechanism, "mass_matrix", (), q)


def traced_law(controller: Controller[Any], gains: Mapping[str, Array]) -> Controller[Any]:
    """The same law with symbols for a backend, and other gains in the innermost one."""
    twin = copy.copy(controller)
    inner = vars(twin).get("inner")
    vars(twin).update({"inner": traced_law(inner, gains)} if inner is not None else gains)
    if "_dynamics" in vars(twin) and not isinstance(vars(twin)["_dynamics"], TracedDynamics):
        vars(twin)["_dynamics"] = TracedDynamics(twin.model)
    return twin


def innermost(controller: Controller[Any]) -> Controller[Any]:
    """The law itself, without what is wrapped around it."""
    inner = vars(controller).get("inner")
    return controller if inner is None else innermost(inner)
