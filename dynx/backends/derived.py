"""Every quantity derived from an engine's frame placements and inverse dynamics.

A backend implements those two; every other quantity has a derivation (`dynx.backends.hooks`).
`DerivedBackend` uses the two of any backend, so that the native results of an engine can be compared
with results derived from the same engine.
"""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

from dynx.argument_types import checks_types
from dynx.backends.base import Backend
from dynx.backends.quantities import QUANTITIES
from dynx.errors import ClosedError
from dynx.spatial.scalar import Floats


class DerivedBackend(Backend):
    """View of the backend `inner` that uses only its frame placements and inverse dynamics; all else is
    derived.

    Its name is that of `inner` with ``/derived``. Closing this view leaves `inner` open; once `inner` is
    closed, the view raises ClosedError as `inner` does.
    """

    name: ClassVar[str] = "derived"
    takes_ball_joints: ClassVar[bool] = True  # where `inner` does

    @checks_types
    def __init__(self, inner: Backend, *, validate: bool = True) -> None:
        # Other backends have these as class attributes; here they depend on `inner`.
        vars(self).update(name=f"{inner.name}/derived", vectorized=inner.vectorized)
        super().__init__(inner.model, validate=validate)
        self.inner = inner

    @property
    def engine_version(self) -> str:
        """Name and version of the engine of `inner`."""
        return self.inner.engine_version

    def _frame_placements(self, q: Floats) -> Floats:
        return self._open()._frame_placements(q)

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return self._open()._inverse_dynamics(q, v, a)

    def _open(self) -> Backend:
        if self.inner._arguments.closed:
            raise ClosedError(f"the backend that {self.name} of {self.model.name} uses was closed")
        return self.inner

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(DerivedBackend, self.inner, **self._options), ()


@checks_types
def native_quantities(backend: Backend | type[Backend]) -> frozenset[str]:
    """Return the names of the quantities that a backend's engine computes itself, without derivation."""
    kind = backend if isinstance(backend, type) else type(backend)
    return frozenset(name for name, quantity in QUANTITIES.items() if kind._is_native(quantity))
