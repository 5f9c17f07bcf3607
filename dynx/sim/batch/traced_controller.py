"""A control law on symbols: what it asks of its backend is answered by `dynx.rbd`, traced with the rest."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from dynx.compiled.kernels import evaluated, tidied
from dynx.control.base import Controller
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, Reference
from dynx.spatial.scalar import Array


class TracedDynamics:
    """What `dynx.control` asks of a backend, answered on symbols, for one sample."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._mechanism = tidied(model.mechanism)

    @property
    def backend(self) -> TracedDynamics:
        """What questions about frames are asked of: the same."""
        return self

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

    def forward_kinematics(self, q: Array, frame: str) -> Array:
        """T_world_frame (4, 4)."""
        return evaluated(self._mechanism, "frame_placement", (self._model.frame_index(frame),), q)

    def jacobian(self, q: Array, frame: str, *, reference: Reference = LOCAL_WORLD_ALIGNED) -> Array:
        """J (6, nv) of a frame."""
        return self._of_frame("jacobian", frame, reference, q)

    def jacobian_derivative(
        self, q: Array, v: Array, frame: str, *, reference: Reference = LOCAL_WORLD_ALIGNED
    ) -> Array:
        """dJ/dt (6, nv) of a frame."""
        return self._of_frame("jacobian_derivative", frame, reference, q, v)

    def frame_acceleration(
        self, q: Array, v: Array, a: Array, frame: str, *, reference: Reference = LOCAL_WORLD_ALIGNED
    ) -> Array:
        """J a + dJ/dt v (6,) of a frame."""
        return self._of_frame("frame_acceleration", frame, reference, q, v, a)

    def _of_frame(self, question: str, frame: str, reference: Reference, q: Array, *rates: Array) -> Array:
        return evaluated(self._mechanism, question, (self._model.frame_index(frame), reference), q, *rates)


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
