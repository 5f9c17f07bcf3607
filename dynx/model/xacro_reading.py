"""Expansion of xacro files to URDF text, by the package of the extra ``xacro``.

xacro evaluates expressions of the file with Python's ``eval``, prints to the terminal, and finds packages by
a function that only ROS provides. It therefore runs in a child process, which can be terminated and in which
that function can be replaced without affecting the process that uses dynx. Expand only files that you trust.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from dynx.errors import DescriptionError, NotInstalledError, escaped
from dynx.files.reading import printable, read_file
from dynx.model.package_paths import StrPath, find_package

TIMEOUT = 60.0
"""Longest duration of an expansion [s]."""


def expand_xacro(path: str, package_dirs: Iterable[StrPath] = ()) -> bytes:
    """Return the URDF text of the xacro file; ``$(find NAME)`` looks in `package_dirs` only.

    Raises NotInstalledError without xacro, DescriptionError if the expansion fails or takes longer than
    `TIMEOUT`. Line numbers of the text differ from those of the file.
    """
    read_file(path)  # Raises for a FIFO or a directory, which xacro would block on.
    if importlib.util.find_spec("xacro") is None:
        raise NotInstalledError(
            f"{printable(path)} is a xacro file and the package xacro is not installed; "
            "pip install 'dynx[xacro]', or expand the file to URDF with another xacro"
        )
    roots = [os.path.abspath(os.fspath(root)) for root in package_dirs]
    command = [sys.executable, "-m", "dynx.model.xacro_reading", os.path.abspath(path), *roots]
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=TIMEOUT, env=_environment()
        )
    except subprocess.TimeoutExpired:
        raise DescriptionError(f"xacro did not finish within {TIMEOUT:g} s", source=printable(path)) from None
    if done.returncode != 0:
        messages = done.stderr.decode("utf-8", "replace").strip().splitlines() or ["no message"]
        reason = " ".join(messages[-1].split())
        raise DescriptionError(f"xacro failed: {escaped(reason, 300)}", source=printable(path))
    return done.stdout


def _environment() -> dict[str, str]:
    # The child process must import the same dynx, also from a source checkout.
    here = str(Path(__file__).resolve().parent.parent.parent)
    search = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": here + (os.pathsep + search if search else ""), "PYTHONUTF8": "1"}


def _expand_in_child(path: str, roots: list[str]) -> int:
    import xacro
    from xacro import substitution_args

    def find(package: str) -> str:
        return str(find_package(package, roots))

    # Text substitution and $(eval ...) both use the function of this module.
    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find
    try:
        text = xacro.process_file(path).toprettyxml(indent="  ", encoding="utf-8")
    except BaseException as error:  # any failure becomes one line for the parent process
        sys.stderr.write(f"\n{type(error).__name__}: {' '.join(str(error).split())}\n")
        return 1
    sys.stdout.buffer.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(_expand_in_child(sys.argv[1], sys.argv[2:]))
