"""xacro files to URDF text, through the package that the extra ``xacro`` brings.

xacro evaluates the expressions in a file with Python's ``eval``, prints to the terminal, and finds
packages by a function that only ROS provides. So it runs in a child process, which can be stopped
and in which that function can be replaced: nothing of it touches the process that calls dynx.
Expand only files that you trust.
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

MAX_SECONDS = 60.0
"""Longest that an expansion may take."""


def expand_xacro(path: str, package_dirs: Iterable[StrPath] = ()) -> bytes:
    """The URDF text that the xacro file means; ``$(find NAME)`` looks in `package_dirs` alone.

    Raises NotInstalledError without xacro, DescriptionError where it fails or takes longer than
    MAX_SECONDS. Lines of the text are not those of the file.
    """
    read_file(path)  # a FIFO or a directory is refused here; xacro would wait for it
    if importlib.util.find_spec("xacro") is None:
        raise NotInstalledError(
            f"{printable(path)} is a xacro file and the package xacro is not installed; "
            "pip install 'dynx[xacro]', or expand the file to URDF with another xacro"
        )
    roots = [os.path.abspath(os.fspath(root)) for root in package_dirs]
    command = [sys.executable, "-m", "dynx.model.xacro_reading", os.path.abspath(path), *roots]
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=MAX_SECONDS, env=_environment()
        )
    except subprocess.TimeoutExpired:
        raise DescriptionError(
            f"xacro did not finish within {MAX_SECONDS:g} s", source=printable(path)
        ) from None
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines() or ["no message"]
        reason = " ".join(said[-1].split())
        raise DescriptionError(f"xacro failed: {escaped(reason, 300)}", source=printable(path))
    return done.stdout


def _environment() -> dict[str, str]:
    # The child must find this dynx, also where it is used from a checkout.
    here = str(Path(__file__).resolve().parent.parent.parent)
    search = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": here + (os.pathsep + search if search else ""), "PYTHONUTF8": "1"}


def _expand_here(path: str, roots: list[str]) -> int:
    import xacro
    from xacro import substitution_args

    def find(package: str) -> str:
        return str(find_package(package, roots))

    # Both the text substitution and $(eval ...) look the function up in this module.
    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find
    try:
        text = xacro.process_file(path).toprettyxml(indent="  ", encoding="utf-8")
    except BaseException as error:  # every way to fail becomes one line for the parent
        sys.stderr.write(f"\n{type(error).__name__}: {' '.join(str(error).split())}\n")
        return 1
    sys.stdout.buffer.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(_expand_here(sys.argv[1], sys.argv[2:]))
