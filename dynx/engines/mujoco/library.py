"""The only import of MuJoCo, as the module `mujoco`, and the handling of its warnings."""

from __future__ import annotations

import importlib
import os
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dynx.errors import EngineLimitError, importing
from dynx.safe_path import isolated_children

# The further errors are raised while its renderer is set up, because of a wrong MUJOCO_GL or missing
# libraries.
with (
    importing(
        "the engine 'mujoco' needs MuJoCo: pip install 'dynx[mujoco]' ({error})",
        *(AttributeError, OSError, RuntimeError),
    ),
    isolated_children(),
):
    import mujoco

__all__ = ["MAX_DEPTH", "mujoco", "offscreen_context", "silence_warnings", "silent_data"]

MAX_DEPTH = 1000
"""Largest depth of a tree of links for MuJoCo. Its compiler has a limit of 1,024 bodies, and its file
reader is recursive and ends the process if the stack of the thread overflows (measured, 4.0)."""


def silent_data(model: Any) -> Any:
    """Return a new `MjData` of a model with warnings silenced.

    MuJoCo reports the first warning of each kind and only counts further ones. `mj_resetData` resets the
    counters: call `silence_warnings` after it.
    """
    data = mujoco.MjData(model)
    silence_warnings(data)
    return data


def silence_warnings(data: Any) -> None:
    """Prevent MuJoCo from reporting warnings of data, by setting their counters to 1."""
    data.warning.number[:] = 1


_KINDS: set[str] = set()
"""Warnings that were passed on, without their numbers."""


def _pass_on(message: str) -> None:
    """Issue the first warning of MuJoCo of each kind as a Python warning.

    MuJoCo calls it in the middle of a step, where an exception ends the process; so under a filter that turns
    warnings into errors, the warning is printed.
    """
    kind = re.sub(r"[-+]?[\d.]+(e[-+]?\d+)?", "0", message)
    if kind in _KINDS:
        return
    _KINDS.add(kind)
    text = f"mujoco: {message}"
    try:
        warnings.warn(text, RuntimeWarning, stacklevel=2)
    except Exception:
        if sys.stderr is not None:
            print(f"RuntimeWarning: {text}", file=sys.stderr)


if mujoco.get_mju_user_warning() is None:
    # Without a handler, MuJoCo appends its warnings to a file MUJOCO_LOG.TXT in the working directory.
    mujoco.set_mju_user_warning(_pass_on)


@contextmanager
def offscreen_context(width: int, height: int) -> Iterator[None]:
    """Make a context of OpenGL without a display current in this thread, in a ``with`` block: by EGL or
    OSMesa on Linux, or as the environment variable ``MUJOCO_GL`` says, and MuJoCo's own elsewhere.

    Raises EngineLimitError where there is none.
    """
    chosen = os.environ.get("MUJOCO_GL", "").lower()
    names = [chosen] if chosen in ("egl", "osmesa") else ["egl", "osmesa"]
    if not sys.platform.startswith("linux"):
        names = ["gl_context"]
    reasons = []
    for name in names:
        try:
            made = importlib.import_module(f"mujoco.{name}").GLContext(width, height)
            made.make_current()
        # Without their libraries they raise what their bindings happen to.
        except (AttributeError, ImportError, OSError, RuntimeError, TypeError) as error:
            reasons.append(f"{name}: {error or type(error).__name__}")
            continue
        try:
            yield
        finally:
            made.free()
        return
    raise EngineLimitError(
        f"MuJoCo has no picture without a display here ({'; '.join(reasons)}); install EGL or OSMesa, or "
        "leave renderer out to draw without it"
    )
