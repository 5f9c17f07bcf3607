"""Exceptions of an engine in the methods of its world, raised as errors of dynx."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ClassVar, Concatenate, ParamSpec, Protocol, TypeVar

from dynx.errors import ClosedError, DynxError, EngineError, shown
from dynx.steppers.layout import Layout


class Closable(Protocol):
    """A scene inside an engine, which knows whether it was closed, or its queries."""

    name: ClassVar[str]
    layout: Layout

    @property
    def closed(self) -> bool:
        """True after `close`."""


Scene = TypeVar("Scene", bound=Closable)
Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def translate_failures(
    failures: tuple[type[BaseException], ...], message: Callable[[BaseException], str]
) -> Callable[
    [Callable[Concatenate[Scene, Parameters], Result]], Callable[Concatenate[Scene, Parameters], Result]
]:
    """Return a decorator under which a method raises EngineError in place of an engine's exceptions
    `failures`, described by `message`, and ClosedError after `close`."""

    def decorate(
        method: Callable[Concatenate[Scene, Parameters], Result],
    ) -> Callable[Concatenate[Scene, Parameters], Result]:
        @wraps(method)
        def call(self: Scene, /, *args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
            try:
                return method(self, *args, **kwargs)
            except DynxError:
                raise
            except failures as error:
                if self.closed:
                    raise ClosedError(f"this world of {shown(self.layout.name)} is closed") from error
                raise EngineError(
                    f"{self.name} failed on the scene {shown(self.layout.name)}: {message(error)}"
                ) from error

        return call

    return decorate
