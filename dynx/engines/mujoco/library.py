"""MuJoCo, as the module `mujoco`, with what its users here must all heed."""

from __future__ import annotations

from typing import Any

from dynx.errors import NotInstalledError

try:
    import mujoco
except (ImportError, AttributeError, OSError, RuntimeError) as error:
    # The last three come from what it sets up for drawing: a wrong MUJOCO_GL, libraries that are not there.
    raise NotInstalledError(
        f"the engine 'mujoco' needs MuJoCo: pip install 'dynx[mujoco]' ({error})"
    ) from error

__all__ = ["MAX_DEPTH", "mujoco", "silence_warnings", "silent_data"]

MAX_DEPTH = 1000
"""Most links in a row that MuJoCo is given. Its compiler has a limit of 1,024 bodies; its reader of files
goes down the tree by recursion, and ends the process where the stack of the thread does (measured, 4.0)."""


def silent_data(model: Any) -> Any:
    """A new `MjData` of a model, that warns nobody.

    MuJoCo prints the first warning of each kind and writes it to a log file in the working directory;
    further ones it only counts. `mj_resetData` forgets: `silence_warnings` again after it.
    """
    data = mujoco.MjData(model)
    silence_warnings(data)
    return data


def silence_warnings(data: Any) -> None:
    """Let the next warning of each kind be none that is printed."""
    for warning in data.warning:
        warning.number = 1
