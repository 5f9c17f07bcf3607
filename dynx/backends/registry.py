"""Backends by name: those of dynx, of the running program, and of installed packages (`dynx.registry`).

A package offers its backend by an entry point in the group ``dynx.backends``. An engine is imported when its
backend is first used; listing names imports none.
"""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

from dynx.errors import ArgumentError, BackendError, UnknownBackendError, shown
from dynx.model import Model
from dynx.model.model import refuse_other_than_model
from dynx.registry import ClassRegistry

if TYPE_CHECKING:
    from dynx.backends.base import Backend

GROUP = "dynx.backends"
"""The entry-point group: ``name = "package.module:BackendClass"``."""

BUILT_IN = {
    "reference": "dynx.reference.backend:ReferenceBackend",
    "pinocchio": "dynx.engines.pinocchio.backend:PinocchioBackend",
    "pybullet": "dynx.engines.pybullet.backend:PyBulletBackend",
    "mujoco": "dynx.engines.mujoco.backend:MujocoBackend",
    "drake": "dynx.engines.drake.backend:DrakeBackend",
    "compiled": "dynx.compiled.backend:CompiledBackend",
}


def _base() -> type[Backend]:
    from dynx.backends.base import Backend

    return Backend


_backends = ClassRegistry("backend", GROUP, BUILT_IN, _base, error=BackendError, unknown=UnknownBackendError)
backend_class = _backends.find
backend_names = _backends.names
register = _backends.register
unregister = _backends.unregister


def backend(name: str, model: Model, **options: Any) -> Backend:
    """Return the backend `name` for `model`; its constructor gets the `options`, such as ``validate=False``.

    Raises UnknownBackendError for an unknown name, NotInstalledError if the engine is missing,
    EngineLimitError if the engine cannot represent the model, and ArgumentError for an option that the
    backend does not have, or if `model` is not a `Model`.
    """
    kind = backend_class(name)
    refuse_other_than_model(model)
    try:
        inspect.signature(kind).bind(model, **options)
    except TypeError as error:
        known = ", ".join(list(inspect.signature(kind).parameters)[1:]) or "none"
        raise ArgumentError(f"the backend {shown(name)}: {error}; its options: {known}") from None
    return kind(model, **options)


def installed_backends() -> tuple[str, ...]:
    """Import the engine of each backend, and return the names of the backends whose import succeeds."""
    return tuple(name for name in backend_names() if _is_installed(name))


def _is_installed(name: str) -> bool:
    try:
        backend_class(name).require_engine()
    except BackendError:
        return False
    return True
