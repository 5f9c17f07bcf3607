"""Backends by name: those of dynx, of the running program, and of installed packages (`dynx.registry`).

A package offers its backend by an entry point in the group ``dynx.backends``. An engine is imported when its
backend is first used; listing names imports none.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dynx.errors import ArgumentError, BackendError, UnknownBackendError, shown
from dynx.model import Model
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


def refuse_other_than_model(model: object) -> None:
    """Raise ArgumentError for anything but a `Model`, such as a robot's name."""
    if not isinstance(model, Model):
        example = shown(model) if isinstance(model, str) else "..."
        raise ArgumentError(
            f"model is of type {type(model).__name__}; wanted a Model, such as dynx.load({example})"
        )


def backend(name: str, model: Model, **options: Any) -> Backend:
    """Return the backend of that name for `model`; `options` go to its constructor (``validate=False``).

    Raises UnknownBackendError for an unknown name, NotInstalledError where its engine is
    missing, EngineLimitError where the engine cannot represent the model, and ArgumentError for an
    option that the backend does not have or anything but a `Model`.
    """
    kind = backend_class(name)
    refuse_other_than_model(model)
    try:
        inspect.signature(kind).bind(model, **options)
    except TypeError as error:
        known = ", ".join(list(inspect.signature(kind).parameters)[1:]) or "none"
        raise ArgumentError(f"the backend {shown(name)}: {error}; its options: {known}") from None
    return kind(model, **options)


def backend_class(name: str) -> type[Backend]:
    """Return the backend class of a name; this imports its engine."""
    return _backends.find(name)


def backend_names() -> tuple[str, ...]:
    """Return all names of backends, dynx's own first, whether or not their engines are installed."""
    return _backends.names()


def installed_backends() -> tuple[str, ...]:
    """Return the names among `backend_names` whose engines can be imported; this imports them."""
    return tuple(name for name in backend_names() if _is_installed(name))


def register(name: str, loader: Callable[[], type[Backend]]) -> None:
    """Add a backend class of the running program; `loader()` returns it when it is first used.

    Raises ArgumentError for a name that is taken: backends cannot be replaced. Packages offer their
    backends by entry points in the group ``dynx.backends`` instead.
    """
    _backends.register(name, loader)


def unregister(name: str) -> None:
    """Remove what `register` added; UnknownBackendError for a name that no program registered."""
    _backends.unregister(name)


def _is_installed(name: str) -> bool:
    try:
        backend_class(name).require_engine()
    except BackendError:
        return False
    return True
