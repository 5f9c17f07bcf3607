"""Translation of a foreign engine's exceptions into errors of dynx, for the hooks of its backend."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from dynx.backends.base import Backend
from dynx.backends.quantities import QUANTITIES
from dynx.errors import ClosedError, DynxError, EngineError

Kind = TypeVar("Kind", bound=type[Backend])
Failures = type[BaseException] | tuple[type[BaseException], ...]

HOOKS = ("_frame_placement", *(quantity.hook for quantity in QUANTITIES.values()))
"""Names of the methods by which an engine is called."""


def engine_errors(
    message: Callable[[BaseException], str], failures: Failures = Exception
) -> Callable[[Kind], Kind]:
    """Make a decorator of backends whose hooks turn `failures` into EngineError with the engine's `message`.

    If another thread closed the backend during the call, any failure raises ClosedError.
    """

    def translated(hook: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(hook)
        def call(self: Backend, *args: Any) -> Any:
            try:
                return hook(self, *args)
            except DynxError:
                raise
            except failures as error:
                if self._arguments.closed:
                    words = f"this backend of {self.model.name} was closed during a call"
                    raise ClosedError(words) from error
                raise EngineError(f"{self.name} failed on {self.model.name}: {message(error)}") from error

        vars(call)["untranslated"] = hook
        return call

    def decorate(kind: Kind) -> Kind:
        for name in vars(kind).keys() & HOOKS:
            setattr(kind, name, translated(vars(kind)[name]))
        return kind

    return decorate
