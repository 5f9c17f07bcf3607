"""Translation of a foreign engine's exceptions into errors of dynx, for the hooks of its backend."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from dynx.backends.base import Backend
from dynx.errors import ClosedError, DynxError, EngineError

Hook = TypeVar("Hook", bound=Callable[..., Any])
Failures = type[BaseException] | tuple[type[BaseException], ...]


def engine_errors(
    engine: str, message: Callable[[BaseException], str], failures: Failures = Exception
) -> Callable[[Hook], Hook]:
    """Make a decorator of hooks that turns `failures` into EngineError with the engine's `message`.

    If another thread closed the backend during the call, any failure raises ClosedError.
    """

    def decorate(hook: Hook) -> Hook:
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
                raise EngineError(f"{engine} failed on {self.model.name}: {message(error)}") from error

        return cast(Hook, call)

    return decorate
