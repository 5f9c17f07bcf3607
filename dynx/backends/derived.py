"""An engine asked for two things only: what the base derives from them, beside the engine's own.

A backend implements the placements of all frames and inverse dynamics; every other quantity has a
derivation in `EngineHooks`. `DerivedBackend` shows any backend through those two, so that an
engine's native answers can be compared with the answers derived from that same engine.
"""

from __future__ import annotations

from typing import Any, ClassVar

from dynx.backends.base import Backend
from dynx.backends.hooks import EngineHooks
from dynx.errors import ClosedError
from dynx.spatial.scalar import Floats

HOOK_OF_QUANTITY = {
    "forward_kinematics": "_frame_placements",
    "jacobian": "_jacobian",
    "jacobian_derivative": "_jacobian_derivative",
    "frame_velocity": "_frame_velocity",
    "frame_acceleration": "_frame_acceleration",
    "inverse_dynamics": "_inverse_dynamics",
    "forward_dynamics": "_forward_dynamics",
    "mass_matrix": "_mass_matrix",
    "bias_torque": "_bias_torque",
    "gravity_torque": "_gravity_torque",
    "coriolis_matrix": "_coriolis_matrix",
    "inertial_regressor": "_inertial_regressor",
    "center_of_mass": "_center_of_mass",
    "center_of_mass_jacobian": "_center_of_mass_jacobian",
    "centroidal_momentum": "_centroidal_momentum",
    "kinetic_energy": "_kinetic_energy",
    "potential_energy": "_potential_energy",
}
"""The hook that answers each quantity of `Backend`."""


class DerivedBackend(Backend):
    """`inner` reduced to its frame placements and its inverse dynamics; all else is derived.

    Its name is that of `inner` with ``/derived``. It borrows `inner`: closing the view leaves the
    backend open, and a view of a closed backend refuses as that backend does.
    """

    name: ClassVar[str] = "derived"

    def __init__(self, inner: Backend, *, validate: bool = True) -> None:
        # Facts of a class elsewhere, of the single object here.
        vars(self).update(name=f"{inner.name}/derived", vectorized=inner.vectorized)
        super().__init__(inner.model, validate=validate)
        self.inner = inner

    @property
    def engine_version(self) -> str:
        """That of the backend behind."""
        return self.inner.engine_version

    def _frame_placements(self, q: Floats) -> Floats:
        return self._open()._frame_placements(q)

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return self._open()._inverse_dynamics(q, v, a)

    def _open(self) -> Backend:
        if self.inner._arguments.closed:
            raise ClosedError(f"the backend behind {self.name} of {self.model.name} was closed")
        return self.inner

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild_view, (self.inner, self._options)


def native_quantities(backend: Backend | type[Backend]) -> frozenset[str]:
    """The quantities that a backend's engine computes itself, named as the methods of `Backend`.

    A hook counts as native where the class overrides its derivation.
    """
    kind = backend if isinstance(backend, type) else type(backend)
    return frozenset(
        quantity
        for quantity, hook in HOOK_OF_QUANTITY.items()
        if getattr(kind, hook) is not getattr(EngineHooks, hook)
    )


def _rebuild_view(inner: Backend, options: dict[str, Any]) -> DerivedBackend:
    return DerivedBackend(inner, **options)
