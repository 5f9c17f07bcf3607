"""Exceptions of an engine in the methods of its world, raised as errors of dynx."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ClassVar, Concatenate, ParamSpec, Protocol, TypeVar

from dynx.errors import ClosedError, DynxError, EngineError, shown
from dynx.steppers.layout import Layout


class ClosableWorld(Protocol):
    """A scene inside an engine, which knows whether it was closed."""

    name: ClassVar[str]
    layout: Layout
    closed: bool


World = TypeVar("World", bound=ClosableWorld)
Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def translate_failures(
    failures: tuple[type[BaseException], ...], message: Callable[[BaseException], str]
) -> Callable[
    [Callable[Concatenate[World, Parameters], Result]], Callable[Concatenate[World, Parameters], Result]
]:
    """Return a decorator under which a method raises EngineError in place of an engine's exceptions
    `failures`, described by `message`, and ClosedError after `close`."""

    def decorate(
        method: Callable[Concatenate[World, Parameters], Result],
    ) -> Callable[Concatenate[World, Parameters], Result]:
        @wraps(method)
        def call(self: World, /, *args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
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
