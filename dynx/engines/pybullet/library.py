"""The only import of PyBullet, at first use, without the line that PyBullet prints."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from threading import Lock
from types import ModuleType

from dynx.engines.silence import silence
from dynx.errors import importing

_import_lock = Lock()


def bullet_version() -> str:
    """Return the version of the distribution; empty if it is unknown."""
    try:
        return version("pybullet")
    except PackageNotFoundError:
        return ""


def bullet() -> ModuleType:
    """Return the module `pybullet`; raises NotInstalledError with the command that installs it."""
    loaded = sys.modules.get("pybullet")
    if loaded is not None:
        return loaded
    needed = (
        "the engine 'pybullet' needs PyBullet: pip install 'dynx[pybullet]' "
        "(wheels exist up to Python 3.11; above, it builds from source)"
    )
    with _import_lock, importing(needed), silence():
        return import_module("pybullet")
