"""Name, closing and pickling of a backend, apart from the quantities it computes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar, TypeVar

from dynx.backends.arguments import Arguments
from dynx.model import Model

Self = TypeVar("Self", bound="Lifecycle")
Made = TypeVar("Made")


class Lifecycle:
    """Base of backends that the constructor opens, and `close` or the end of a ``with`` block closes.

    A pickle holds the model and the options but not the engine; the unpickled copy creates its own engine.
    """

    name: ClassVar[str]
    """Name in reports and messages; by default that of the class in lower case."""

    model: Model
    """The robot."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if not hasattr(cls, "name"):
            cls.name = cls.__name__.lower()

    def __init__(self, model: Model, arguments: Arguments, *, validate: bool) -> None:
        self.model = model
        self._arguments = arguments
        self._options: dict[str, Any] = {"validate": validate}
        # `close` sets this to True, so that the checks run and raise ClosedError.
        self._validate = validate
        self._kept: dict[object, Any] = {}

    @property
    def engine_version(self) -> str:
        """Name and version of the engine; the name of the backend alone if the version is unknown."""
        return self.name

    @classmethod
    def require_engine(cls) -> None:
        """Raise NotInstalledError if the engine is missing, for a class that imports it late."""

    def close(self) -> None:
        """Release the resources of the engine; further calls raise ClosedError. Closing twice is harmless."""
        if not self._arguments.closed:
            self._validate = True
            self._arguments.closed = True
            self._kept.clear()
            self._release()

    def kept(self, key: object, make: Callable[[], Made]) -> Made:
        """Return what `make` returned for `key` when it was first needed; `close` releases it.

        Rooms above keep here what belongs to one backend, such as solvers. Two threads that need it at once
        may both make it; both get the same. Raises ClosedError.
        """
        try:
            found: Made = self._kept[key]
        except KeyError:
            self._arguments.refuse_closed()
            found = self._kept.setdefault(key, make())
            if self._arguments.closed:
                # Another thread closed this backend meanwhile.
                self._kept.clear()
        return found

    def _release(self) -> None:
        """Release the resources of the engine."""

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), self.model, **self._options), ()

    def __repr__(self) -> str:
        return f"<{self.name} backend of {self.model.name}>"
