"""Classes by name, from dynx itself, from the running program and from entry points of installed packages.

A name is looked up in three places, in this order: a table of dynx's own classes (which needs no installed
package), the classes that a program registered, and the entry points of one group, if packages may add such
classes. A name never changes its meaning: `ClassRegistry.register` refuses a name that is taken, and an entry
point with the name of one of dynx's own classes is ignored.

A class is imported when it is first looked up; listing names imports none. So is the body of a method that
lies in a module above its class (`door`), and so are the names of engines, at the first look-up of a name
that does not exist (`explains_names`).
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, Generic, TypeVar, cast

from dynx.errors import ArgumentError, DynxError, nearest, shown
from dynx.option_names import explained, method_of

Kind = TypeVar("Kind")
Owner = TypeVar("Owner", bound=type)
Method = TypeVar("Method", bound=Callable[..., Any])

DEFAULT_ENGINE = "compiled" if find_spec("pinocchio") is None else "pinocchio"
"""Backend and plant where none is named: Pinocchio, or dynx's own where it has no wheels (Windows)."""


def door(target: str) -> Callable[[Method], Method]:
    """Decorate the stub of a method whose body is a function of a module above: ``"module:function"``.

    The first look-up of the method imports that function and puts it in the stub's place, so that later calls
    reach the function itself. The stub has its signature, for type checkers; its own body never runs.
    """

    def replaced(stub: Method) -> Method:
        return cast(Method, _Door(target, stub))

    return replaced


class _Door:
    """Descriptor that stands for a method until it is first looked up."""

    def __init__(self, target: str, stub: Callable[..., Any]) -> None:
        self.target, self.stub = target, stub
        self.__doc__ = stub.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._owner, self._name = owner, name

    def __get__(self, instance: object, owner: type) -> Any:
        module, _, name = self.target.partition(":")
        body = method_of(self._owner, self._name, getattr(import_module(module), name))
        body.__called__ = self._name  # in errors on keywords
        if isinstance(self.stub, classmethod):
            body = classmethod(body)
        setattr(self._owner, self._name, body)
        return body.__get__(instance, owner)


def moved_names(
    package: str, moved: Mapping[str, str], home: Mapping[str, str] | None = None
) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a public package: its names may have moved, or are imported on use.

    Its functions and classes, also those that it has by now, answer mistaken keywords (`explained`).
    `home` has the module of each name, as ``"package.module"`` or ``"package.module:other_name"``: the first
    look-up imports it, or a module of the package with that name. For a name of `moved` ImportError is
    raised, whose text also reaches the user of ``from package import name``, and AttributeError for any other
    name.
    """
    homes = home or {}
    eager = vars(sys.modules[package])
    for each in eager.get("__all__", ()):
        if each in eager:
            eager[each] = explained(eager[each])

    def getattr_of_package(name: str) -> Any:
        if name in homes:
            module, _, other = homes[name].partition(":")
            found = explained(getattr(import_module(module), other or name))
            setattr(sys.modules[package], name, found)
            return found
        if name in moved:
            raise ImportError(f"{package}.{name} is now {moved[name]}", name=package)
        # Not what Python itself asks every module for, such as `__path__`.
        if not name.startswith("_") and find_spec(f"{package}.{name}") is not None:
            return import_module(f"{package}.{name}")
        known = vars(sys.modules[package]).get("__all__", ())
        raise AttributeError(unknown_name(f"module {package!r}", name, known))

    return getattr_of_package


def explains_names(owner: Owner) -> Owner:
    """Decorate a class, so that the AttributeError of its objects names dynx's call for the name of an
    engine, or the nearest attribute (`dynx.engine_names`)."""

    def getattr_of_object(self: object, name: str) -> Any:
        if hasattr(type(self), name):
            return object.__getattribute__(self, name)  # a property, whose own AttributeError is raised
        subject = f"{type(self).__name__!r} object"
        raise AttributeError(unknown_name(subject, name, (each for each in dir(self) if each[0] != "_")))

    owner.__getattr__ = getattr_of_object  # type: ignore[attr-defined]  # type checkers know the attributes
    return owner


def unknown_name(subject: str, name: str, known: Iterable[str]) -> str:
    """Return the message of the AttributeError for a name; names with an underscore, which Python and other
    libraries ask every object for, are not explained."""
    if name.startswith("_"):
        return f"{subject} has no attribute {name!r}"
    message: str = import_module("dynx.engine_names").explained(subject, name, known)
    return message


class ClassRegistry(Generic[Kind]):
    """The subclasses of one base class, by name."""

    def __init__(
        self,
        word: str,
        group: str | None,
        built_in: Mapping[str, str],
        base: Callable[[], type[Kind]],
        *,
        error: type[DynxError],
        unknown: type[DynxError],
    ) -> None:
        """`word` is the noun for such a class in messages; entries are ``"package.module:Class"``.

        `base` returns the base class; `error` is raised for a class that cannot be used, `unknown` for a
        name that nobody provides.
        """
        self.group = group
        """Entry-point group, ``name = "package.module:Class"``; None for a kind that packages do not add."""
        self.built_in = built_in
        """Entries of dynx itself."""
        self._word = word
        self._base = base
        self._error = error
        self._unknown = unknown
        self._registered: dict[str, Callable[[], type[Kind]]] = {}

    def find(self, name: str) -> type[Kind]:
        """Import and return the class of that name."""
        if not isinstance(name, str):
            raise ArgumentError(f"a {self._word}'s name is of type {type(name).__name__}; wanted a str")
        if name in self.built_in:
            module, _, attribute = self.built_in[name].partition(":")
            return self._load(name, lambda: getattr(import_module(module), attribute), "dynx itself")
        if name in self._registered:
            return self._load(name, self._registered[name], "this program")
        found = [point for point in self._entry_points() if point.name == name]
        if not found:
            raise self._unknown(f"no {self._word} {shown(name)}{nearest(name, self.names())}")
        if len({point.value for point in found}) > 1:
            listed = " and ".join(_provider(point) for point in found)
            raise self._error(f"the {self._word} {shown(name)} is provided more than once: {listed}")
        return self._load(name, found[0].load, _provider(found[0]))

    def names(self) -> tuple[str, ...]:
        """Return all names, dynx's own first, without importing the classes."""
        points = sorted(point.name for point in self._entry_points())
        return tuple(dict.fromkeys([*self.built_in, *self._registered, *points]))

    def register(self, name: str, loader: Callable[[], type[Kind]]) -> None:
        """Add a class of the running program under `name`.

        `loader()` returns the class; dynx calls it at the first use of the class. Installed packages add
        their classes by entry points instead. Raises ArgumentError for a name that is taken.
        """
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"a {self._word}'s name is {shown(name)}; wanted a str that is not empty")
        if not callable(loader):
            raise ArgumentError(
                f"the loader of {shown(name)} is of type {type(loader).__name__}, not callable"
            )
        if name in self.names():
            raise ArgumentError(
                f"the name {shown(name)} is taken; wanted another, for a {self._word} is never replaced"
            )
        self._registered[name] = loader

    def unregister(self, name: str) -> None:
        """Remove a class that `register` added. Raises the error for an unknown name otherwise."""
        if name not in self._registered:
            raise self._unknown(
                f"no {self._word} {shown(name)} was registered{nearest(name, self._registered)}"
            )
        del self._registered[name]

    def _load(self, name: str, loader: Callable[[], Any], provider: str) -> type[Kind]:
        base = self._base()
        subject = f"the {self._word} {shown(name)}, provided by {provider},"
        try:
            kind = loader()
        except DynxError:
            raise
        except Exception as error:
            raise self._error(f"{subject} cannot be loaded: {type(error).__name__}: {error}") from error
        if not (isinstance(kind, type) and issubclass(kind, base)):
            raise self._error(f"{subject} is {shown(kind)}, which is no subclass of dynx.{base.__name__}")
        if inspect.isabstract(kind):
            missing = ", ".join(sorted(getattr(kind, "__abstractmethods__", ())))
            raise self._error(f"{subject} is incomplete: {kind.__name__} lacks {missing}")
        return kind

    def _entry_points(self) -> list[EntryPoint]:
        points = () if self.group is None else installed_entry_points(self.group)
        return [point for point in points if point.name not in self.built_in]


def installed_entry_points(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group.

    Reading those of all packages takes tens of milliseconds. They are read again when a folder of imports is
    added, removed or changed, as by an installation.
    """
    return _read_entry_points(group, tuple((folder, _changed(folder)) for folder in sys.path))


@lru_cache(maxsize=16)
def _read_entry_points(group: str, folders: tuple[tuple[str, int], ...]) -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group=group))


def _changed(folder: str) -> int:
    """Return the time at which a folder last changed [ns], or 0 if there is none."""
    try:
        return os.stat(folder or ".").st_mtime_ns
    except OSError:
        return 0


def _provider(point: EntryPoint) -> str:
    distribution = "" if point.dist is None else f" of {point.dist.name}"
    return f"the entry point {point.value}{distribution}"
