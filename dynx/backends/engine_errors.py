"""The exceptions of a foreign engine as errors of dynx, for the hooks of its backend."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from dynx.backends.base import Backend
from dynx.errors import ClosedError, DynxError, EngineError

Hook = TypeVar("Hook", bound=Callable[..., Any])
Failures = type[BaseException] | tuple[type[BaseException], ...]


def engine_errors(
    engine: str, gist: Callable[[BaseException], str], failures: Failures = Exception
) -> Callable[[Hook], Hook]:
    """A decorator of hooks that turns `failures` into EngineError with the `gist` of what the engine said.

    A backend that another thread closes during a call fails in any way; that is ClosedError.
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
                raise EngineError(f"{engine} failed on {self.model.name}: {gist(error)}") from error

        return cast(Hook, call)

    return decorate
