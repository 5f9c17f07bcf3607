"""Pinocchio, as the module `pin`."""

from __future__ import annotations

from dynx.errors import importing

with importing(
    "the engine 'pinocchio' needs the package pin, which `pip install dynx` brings except on Windows "
    "({error}); the backends compiled, reference and mujoco compute the same"
):
    import pinocchio as pin

__all__ = ["pin"]
