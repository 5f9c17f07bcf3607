"""Expansion of xacro files to URDF text, by the package of the extra ``xacro``.

xacro evaluates expressions of the file with Python's ``eval``, reads the files that it names, prints to the
terminal, and finds packages by a function that only ROS provides. It therefore runs in a child process, which
can be terminated and in which that function can be replaced without affecting the process that uses dynx:
``$(find NAME)`` searches around the file as the search for meshes does. The child imports nothing from the
current directory, ends with the process that uses dynx, and its time, memory and output are bounded. That
protects against mistakes, not against malice: expand only files that you trust.
"""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Iterable, Mapping
from contextlib import closing, suppress
from pathlib import Path

from dynx.errors import DescriptionError, NotInstalledError, escaped, nearest, shown
from dynx.files.reading import MAX_BYTES, irregularity, printable, read_file
from dynx.model.package_search import StrPath, environment_folders, find_package, package_of
from dynx.workers import Lifeline

TIMEOUT = 20.0
"""Longest duration of an expansion [s]."""

MAX_MEMORY = 2**30
"""Largest memory of an expansion [bytes], besides that of the interpreter; bounded on Linux."""

_SCHEME = "package://"
"""Beginning of the path in a package that was not found."""

_TEXT, _REASON = b"+", b"-"
"""First byte of the reply of the child process: the text or the reason of a failure follows."""

# In isolated mode (-I) Python puts no folder of the user in front of its own. dynx is imported from its file,
# because its folder may be the current directory, whose other files must not be imported.
_START = """
import json, sys
from importlib.util import module_from_spec, spec_from_file_location
task = json.loads(sys.argv[1])
sys.path[:] = task["import_path"]
spec = spec_from_file_location("dynx", task["dynx"])
sys.modules["dynx"] = module_from_spec(spec)
spec.loader.exec_module(sys.modules["dynx"])
from dynx.model.xacro_reading import expand_here
from dynx.workers import end_with_parent
end_with_parent(int(sys.argv[2]))
expand_here(task["file"], task["roots"], task["arguments"])
"""


def expand_xacro(
    path: str, package_dirs: Iterable[StrPath] = (), arguments: Mapping[str, str] | None = None
) -> bytes:
    """Return the URDF text of the xacro file, for the values of its arguments (``<xacro:arg>``).

    ``$(find NAME)`` looks in `package_dirs`, then in the repository and the folders around the file, then in
    ROS_PACKAGE_PATH and AMENT_PREFIX_PATH. The path of a mesh in a package that is in none of them becomes
    ``package://NAME/...``; a file that is included from there is an error. Line numbers of the text differ
    from those of the file.

    Raises NotInstalledError without xacro, DescriptionError if the file has no argument of a name (xacro
    ignores it, so a misspelt one would leave the default), or the expansion fails, takes longer than
    `TIMEOUT`, needs more than `MAX_MEMORY` or makes more than `MAX_BYTES` of text.
    """
    read_file(path)  # Raises for a FIFO or a directory, which xacro would block on.
    if importlib.util.find_spec("xacro") is None:
        raise NotInstalledError(
            f"{printable(path)} is a xacro file and the package xacro is not installed; "
            "pip install 'dynx[xacro]', or expand the file to URDF with another xacro"
        )
    task = {
        "file": os.path.abspath(path),
        "roots": [os.path.abspath(os.fspath(root)) for root in package_dirs],
        "arguments": dict(arguments or {}),
        "import_path": _import_path(),
        "dynx": str(Path(__file__).resolve().parent.parent / "__init__.py"),
    }
    reply, code = _reply([sys.executable, "-I", "-X", "utf8", "-c", _START, json.dumps(task)])
    if reply is None:
        raise DescriptionError(f"xacro did not finish within {TIMEOUT:g} s", source=printable(path))
    if code == 0 and reply[:1] == _TEXT:
        return reply[1:]
    lines = reply.removeprefix(_REASON).decode("utf-8", "replace").split("\n")
    # Without a reason from the child, the last line is that of Python's own message.
    reasons = [" ".join(line.split()) for line in lines if line.strip()]
    reason = reasons[-1] if reasons and reply[:1] != _TEXT else f"its process ended with code {code}"
    raise DescriptionError(f"xacro failed: {escaped(reason, 300)}", source=printable(path))


def _import_path() -> list[str]:
    """Return the folders from which this process imports, without the current directory."""
    try:
        here = os.path.realpath(os.getcwd())
    except OSError:  # It was deleted.
        here = ""
    # Somebody may work in a folder of installed packages.
    installed = {os.path.realpath(sysconfig.get_path(kind)) for kind in ("purelib", "platlib")}
    return [
        folder
        for folder in sys.path
        if folder and (os.path.realpath(folder) != here or os.path.realpath(folder) in installed)
    ]


def _reply(command: list[str]) -> tuple[bytes | None, int]:
    """Return what a process writes, None if it takes too long, and its exit code. A lifeline is its last
    argument."""
    expired = threading.Event()

    def expire() -> None:
        expired.set()
        _kill(process)

    # Linear algebra reserves memory for each of its threads, and expansion needs none.
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    lifeline = Lifeline()
    with (
        closing(lifeline),
        subprocess.Popen(
            [*command, str(lifeline.inherited)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
            pass_fds=lifeline.pass_fds,
            start_new_session=True,
        ) as process,
    ):
        lifeline.release()
        assert process.stdout is not None
        timer = threading.Timer(TIMEOUT, expire)
        timer.daemon = True
        timer.start()
        try:
            reply = process.stdout.read(len(_TEXT) + MAX_BYTES)
            if process.stdout.read(1):
                _kill(process)
            code = process.wait()
        finally:
            timer.cancel()
            timer.join()
            if process.returncode is None:
                _kill(process)
    return (None if expired.is_set() else reply), code


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a process and those that it started, which could keep its pipe open."""
    if sys.platform == "win32":
        process.kill()
    else:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)


class _XacroArguments(dict[str, str]):
    """Values of arguments by name, which remembers the names that xacro looked up.

    xacro adds the defaults of the arguments that the file declares.
    """

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self._unused = set(given)

    def __contains__(self, name: object) -> bool:
        self._unused.discard(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self._unused.discard(name)
        return super().__getitem__(name)

    def refuse_unused(self) -> None:
        """Raise DescriptionError for a given argument that xacro did not look up, such as a misspelt one."""
        if self._unused:
            name = min(self._unused)
            known = sorted({*self} - self._unused)
            raise DescriptionError(f"the file has no argument {shown(name)}{nearest(name, known)}")


def expand_here(path: str, roots: list[str], arguments: dict[str, str]) -> None:
    """Run in the child process: write the text of the file or the reason of a failure to standard output."""
    import xacro
    from xacro import substitution_args

    def find(package: str) -> str:
        found = _package(package, path, roots)
        return f"{_SCHEME}{package}" if found is None else str(found)

    def full_path(named: str) -> str:
        if _SCHEME in named:
            missing = named.partition(_SCHEME)[2].partition("/")[0]
            raise DescriptionError(
                f"package {shown(missing)} was not found around the file, nor in "
                f"{'package_dirs, ' if roots else ''}ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"
            )
        found = str(path_of(named))
        other = irregularity(found)
        if other:
            raise DescriptionError(f"{shown(found, 200)} {other}")
        return found

    # Text substitution and $(eval ...) both use the function of this module.
    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find
    # Every file that is included or loaded passes this one; a mesh or a setting of a simulator does not.
    path_of, xacro.abs_filename_spec = xacro.abs_filename_spec, full_path
    with os.fdopen(os.dup(1), "wb") as output:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        try:
            _bound_memory()
            values = _XacroArguments(arguments)
            document = xacro.process_file(path, mappings=values)
            values.refuse_unused()
            text = document.toprettyxml(indent="  ", encoding="utf-8")
            text = text.replace(b"file://package://", b"package://")
            reply = _TEXT + text
            if len(text) > MAX_BYTES:
                reply = _REASON + f"its text is larger than {MAX_BYTES // 1024**2} MiB".encode()
        except BaseException as error:  # any failure becomes one line for the parent process
            reply = _REASON + _reason_of(error).encode("utf-8", "replace")
        output.write(reply)


def _package(name: str, path: str, roots: list[str]) -> Path | None:
    """Return the folder of a package that a xacro file names; None if nothing has it."""
    with suppress(DescriptionError):
        return find_package(name, roots)
    return package_of(name, Path(os.path.realpath(path)).parent, environment_folders())


def _reason_of(error: BaseException) -> str:
    """Describe a failure of xacro in one line."""
    # xacro raises an exception of its own while it handles the original one.
    origin: BaseException | None = error
    while origin is not None:
        if isinstance(origin, MemoryError):
            return f"it needs more than {MAX_MEMORY / 2**30:g} GiB of memory"
        if isinstance(origin, DescriptionError):  # of a package
            return str(origin)
        if type(origin).__name__ == "ArgException":  # the class of xacro for $(arg NAME) without a value
            return f"argument {shown(str(origin))} has no value; give it as 'FILE.xacro {origin}:=VALUE'"
        if isinstance(origin, OSError) and isinstance(origin.filename, str):  # of a file that it includes
            return f"{origin.strerror}: {shown(origin.filename, 200)}{_similar(origin.filename)}"
        origin = origin.__context__
    kind = type(error).__name__
    return ("" if kind == "XacroException" else f"{kind}: ") + " ".join(str(error).split())


def _similar(path: str) -> str:
    """Return a clause with the nearest name in the folder of a file; empty where no name is near."""
    hint = ""
    with suppress(OSError):
        hint = nearest(os.path.basename(path), sorted(os.listdir(os.path.dirname(path) or ".")))
    return hint if "did you mean" in hint else ""


def _bound_memory() -> None:
    """Limit the memory that this process can reserve, on systems that can do so."""
    if sys.platform != "linux":
        return
    import resource

    with suppress(OSError, ValueError):
        reserved = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (reserved + MAX_MEMORY, reserved + MAX_MEMORY))
