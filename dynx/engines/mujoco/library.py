"""The only import of MuJoCo, as the module `mujoco`, and the silencing of its warnings."""

from __future__ import annotations

from typing import Any

from dynx.errors import NotInstalledError

try:
    import mujoco
except (ImportError, AttributeError, OSError, RuntimeError) as error:
    # The last three are raised while its renderer is set up, because of a wrong MUJOCO_GL or missing
    # libraries.
    raise NotInstalledError(
        f"the engine 'mujoco' needs MuJoCo: pip install 'dynx[mujoco]' ({error})"
    ) from error

__all__ = ["MAX_DEPTH", "mujoco", "silence_warnings", "silent_data"]

MAX_DEPTH = 1000
"""Largest depth of a tree of links for MuJoCo. Its compiler has a limit of 1,024 bodies, and its file
reader is recursive and ends the process if the stack of the thread overflows (measured, 4.0)."""


def silent_data(model: Any) -> Any:
    """Return a new `MjData` of a model with warnings silenced.

    MuJoCo prints the first warning of each kind and writes it to a log file in the working directory; it only
    counts further ones. `mj_resetData` resets the counters: call `silence_warnings` after it.
    """
    data = mujoco.MjData(model)
    silence_warnings(data)
    return data


def silence_warnings(data: Any) -> None:
    """Prevent MuJoCo from printing warnings, by setting their counters to 1."""
    data.warning.number[:] = 1
