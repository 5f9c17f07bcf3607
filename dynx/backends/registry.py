"""Which backends exist, and how a name becomes one.

Three sources, the first that knows the name decides: the backends of dynx itself (a table here, so
they are found in a source tree that was never installed), those a program registered, and entry
points in the group ``dynx.backends`` of installed packages. A name therefore never changes its
meaning: `register` refuses one that is taken, and an entry point with a taken name is passed over.

Engines are imported when a backend of theirs is asked for, never in order to list names.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any

from dynx.errors import ArgumentError, BackendError, DynxError, UnknownBackendError, nearest, shown
from dynx.model import Model

if TYPE_CHECKING:
    from dynx.backends.base import Backend

    Loader = Callable[[], type[Backend]]

GROUP = "dynx.backends"
"""The entry-point group: ``name = "package.module:BackendClass"``."""

_BUILT_IN = {
    "reference": "dynx.reference.backend:ReferenceBackend",
    "pinocchio": "dynx.engines.pinocchio.backend:PinocchioBackend",
    "pybullet": "dynx.engines.pybullet.backend:PyBulletBackend",
    "mujoco": "dynx.engines.mujoco.backend:MujocoBackend",
    "drake": "dynx.engines.drake.backend:DrakeBackend",
    "compiled": "dynx.compiled.backend:CompiledBackend",
}
_registered: dict[str, Loader] = {}


def refuse_other_than_model(model: object) -> None:
    """Raise ArgumentError for anything but a `Model`, such as a robot's name."""
    if not isinstance(model, Model):
        raise ArgumentError(
            f"model is of type {type(model).__name__}; wanted a Model, such as dynx.load({_example(model)})"
        )


def backend(name: str, model: Model, **options: Any) -> Backend:
    """The backend of that name for `model`; `options` go to its constructor (``validate=False``).

    Raises UnknownBackendError for a name nobody provides, NotInstalledError where its engine is
    missing, EngineLimitError where the engine cannot hold the model, and ArgumentError for an
    option that the backend does not have or something that is no `Model`.
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
    """The class behind a name; this imports its engine."""
    if not isinstance(name, str):
        raise ArgumentError(f"a backend's name is of type {type(name).__name__}; wanted a str")
    if name in _BUILT_IN:
        module, _, attribute = _BUILT_IN[name].partition(":")
        return _checked(name, lambda: getattr(import_module(module), attribute), "dynx itself")
    if name in _registered:
        return _checked(name, _registered[name], "this program")
    found = [point for point in _entry_points() if point.name == name]
    if not found:
        raise UnknownBackendError(f"no backend {shown(name)}{nearest(name, backend_names())}")
    if len({point.value for point in found}) > 1:
        listed = " and ".join(_described(point) for point in found)
        raise BackendError(f"the backend {shown(name)} is provided more than once: {listed}")
    return _checked(name, found[0].load, _described(found[0]))


def backend_names() -> tuple[str, ...]:
    """Every name that `backend` knows, dynx's own first; whether their engines work is not tried."""
    names = [*_BUILT_IN, *_registered, *sorted(point.name for point in _entry_points())]
    return tuple(dict.fromkeys(names))


def installed_backends() -> tuple[str, ...]:
    """The names among `backend_names` whose engines can be imported here; this imports them."""
    return tuple(name for name in backend_names() if _works(name))


def register(name: str, loader: Loader) -> None:
    """Let `backend` find a class of your own: `loader()` returns it, when it is first asked for.

    Raises ArgumentError for a name that is taken; a backend is never replaced. A package offers its
    backend by an entry point in the group ``dynx.backends`` instead.
    """
    if not isinstance(name, str) or not name:
        raise ArgumentError(f"a backend's name is {shown(name)}; wanted a str that is not empty")
    if not callable(loader):
        raise ArgumentError(f"the loader of {shown(name)} is of type {type(loader).__name__}, not callable")
    if name in backend_names():
        raise ArgumentError(f"the name {shown(name)} is taken; a backend is never replaced")
    _registered[name] = loader


def unregister(name: str) -> None:
    """Take back what `register` did; UnknownBackendError for a name that no program registered."""
    if name not in _registered:
        raise UnknownBackendError(f"no backend {shown(name)} was registered{nearest(name, _registered)}")
    del _registered[name]


def _checked(name: str, loader: Callable[[], Any], provider: str) -> type[Backend]:
    from dynx.backends.base import Backend

    try:
        kind = loader()
    except DynxError:
        raise
    except Exception as error:
        raise BackendError(
            f"the backend {shown(name)}, provided by {provider}, cannot be loaded: "
            f"{type(error).__name__}: {error}"
        ) from error
    if not (isinstance(kind, type) and issubclass(kind, Backend)):
        raise BackendError(
            f"the backend {shown(name)}, provided by {provider}, is {shown(kind)}, "
            "which is no subclass of dynx.Backend"
        )
    if inspect.isabstract(kind):
        missing = ", ".join(sorted(kind.__abstractmethods__))
        raise BackendError(
            f"the backend {shown(name)}, provided by {provider}, does not say how to answer: "
            f"{kind.__name__} lacks {missing}"
        )
    return kind


def _works(name: str) -> bool:
    try:
        backend_class(name).require_engine()
    except BackendError:
        return False
    return True


def _entry_points() -> list[EntryPoint]:
    return [point for point in entry_points(group=GROUP) if point.name not in _BUILT_IN]


def _described(point: EntryPoint) -> str:
    distribution = "" if point.dist is None else f" of {point.dist.name}"
    return f"the entry point {point.value}{distribution}"


def _example(model: object) -> str:
    return shown(model) if isinstance(model, str) else "..."
