"""MuJoCo, as the module `mujoco`."""

from __future__ import annotations

from dynx.errors import NotInstalledError

try:
    import mujoco
except ImportError as error:
    raise NotInstalledError(
        f"the engine 'mujoco' needs MuJoCo: pip install 'dynx[mujoco]' ({error})"
    ) from error

__all__ = ["mujoco"]
