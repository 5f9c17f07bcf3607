"""Pinocchio, as the module `pin`."""

from __future__ import annotations

from dynx.errors import NotInstalledError

try:
    import pinocchio as pin
except ImportError as error:
    raise NotInstalledError(
        f"the engine 'pinocchio' needs the package pin, which `pip install dynx` brings except on Windows "
        f"({error}); the backends compiled, reference and mujoco compute the same"
    ) from error

__all__ = ["pin"]
