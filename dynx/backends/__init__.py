"""One interface over several engines: `backend(name, model)`.

Importing this package imports no engine; each foreign one is imported in exactly one file, when a
backend of that name is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynx.backends.base import Backend
from dynx.backends.registry import (
    backend,
    backend_class,
    backend_names,
    installed_backends,
    register,
    unregister,
)
from dynx.registry import moved_names

__all__ = [
    "Backend",
    "DerivedBackend",
    "backend",
    "backend_class",
    "backend_names",
    "installed_backends",
    "native_quantities",
    "register",
    "unregister",
]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    _DERIVED = dict.fromkeys(("DerivedBackend", "native_quantities"), "dynx.backends.derived")
    __getattr__ = moved_names(__name__, {}, _DERIVED)
else:
    from dynx.backends.derived import DerivedBackend, native_quantities
