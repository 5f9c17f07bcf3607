"""An attack: what somebody prepares, the command with which a victim takes it up, and the verdict.

An attack has a box of two folders: `here` is the current folder of the victim, with what the victim names;
`outside` has files that nobody named. Nothing outside may be read, written or listed, nothing may be executed
or connected to, and the victim ends within TIME and MEMORY, with one error of dynx or, where the attack is
harmless by itself, with its result.
"""

from __future__ import annotations

import io
import json
import os
import re
import sys
import unicodedata
import zipfile
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

TIME = 30.0
"""Longest time of a victim [s]."""

MEMORY = 2 * 10**9
"""Largest memory of a victim [bytes]."""

SECRET = "TOP-SECRET-7719"
"""Text of the files outside."""

KINDS = (
    "code",
    "path",
    "link",
    "device",
    "network",
    "bomb",
    "recursion",
    "type",
    "html",
    "terminal",
    "printf",
    "access",
)
"""Kinds of attacks."""

URDF = '<robot name="r"><link name="base"/></robot>'

TRAINING = find_spec("torch") is not None and find_spec("stable_baselines3") is not None
"""True where policies can be trained."""

REPOSITORY = Path(__file__).parents[2]


@dataclass(frozen=True)
class Box:
    """Folders of one attack."""

    root: Path

    @property
    def here(self) -> Path:
        """The current folder of the victim."""
        return self.root / "here"

    @property
    def outside(self) -> Path:
        """A folder that the victim does not name."""
        return self.root / "outside"

    @property
    def owned(self) -> Path:
        """The file that code of the attack makes if it runs."""
        return self.root / "owned"

    @property
    def code(self) -> str:
        """An expression of Python that makes `owned`."""
        return f"__import__('pathlib').Path({str(self.owned)!r}).touch()"

    def file(self, name: str, content: str | bytes) -> str:
        """Write a file that the victim names, and return its name."""
        path = self.here / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return name


def make_box(root: Path) -> Box:
    """Make the folders of an attack, with secrets in every format outside."""
    box = Box(root)
    box.here.mkdir(parents=True)
    box.outside.mkdir()
    stl = f"solid {SECRET}\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 1\n"
    stl += "endloop\nendfacet\nendsolid\n"
    texts = {
        "secret.txt": SECRET,
        "secret.urdf": URDF.replace("base", SECRET),
        "secret.stl": stl,
        "secret.obj": f"# {SECRET}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n",
        "secret.toml": f'schema = "dynx.scene/1"\nname = "{SECRET}"\n',
        "secret.bin": "\0" * 4096,
        "secret.xacro": URDF.replace('"base"', f'"${{{box.code}}}"'),
    }
    for name, text in texts.items():
        (box.outside / name).write_text(text)
    return box


@dataclass(frozen=True)
class Deed:
    """What the victim does: the command ``dynx`` with `words`, or the function `door` with them."""

    words: Sequence[str]
    door: str = ""
    """Name of a function of `tests.security.doors`; empty for the command line."""
    ends: Collection[int] = (2,)
    """Exit codes of a right end."""
    check: Callable[[str], str | None] | None = None
    """Function of the output that returns what is wrong with it or with the files written."""
    stays: Sequence[str] = ()
    """Programs that the victim may execute beside those of its engines."""


@dataclass(frozen=True)
class Attack:
    """One attack."""

    surface: str
    kind: str
    name: str
    prepare: Callable[[Box], Deed]

    @property
    def key(self) -> str:
        """The surface and the name."""
        return f"{self.surface}/{self.name}"


@dataclass
class Outcome:
    """How a victim ended."""

    code: int | None
    """Exit code; None for a victim that was killed after TIME, negative for a signal."""
    output: str
    seconds: float
    """Time of the processor in a process of its own, else by the clock."""
    memory: int
    """Largest memory [bytes]."""
    events: list[tuple[str, str]] = field(default_factory=list)
    """Events of the audit hook and of strace."""


_OPENS = ("open", "os.listdir", "os.scandir")
_EXECUTES = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "pty.spawn", "execve")
_CONNECTS = ("socket.connect", "socket.getaddrinfo", "socket.sendto", "urllib.Request", "connect")

PROGRAMS = (
    Path(sys.executable).name,
    "python",
    "python3",
    "ldconfig",
    "gcc",
    "ld",
    "objdump",
    "uname",
    "lscpu",
    "fc-list",
)
"""Programs that Python, ctypes and engines execute on their own, to find libraries and the machine."""

_LOOPBACK = re.compile(r"^\('(127\.0\.0\.1|::1)'|^127\.0\.0\.1|^::1|localhost")

_ROOTS = (
    "/usr",
    "/lib",
    "/lib64",
    "/etc",
    "/proc",
    "/sys",
    "/bin",
    "/sbin",
    "/opt",
    "/run",
    "/var/cache/fontconfig",
)
_DEVICES = ("/dev/null", "/dev/urandom", "/dev/random", "/dev/tty", "/dev/shm", "/dev/ptmx", "/dev/pts")
_FORBIDDEN = ("/etc/passwd", "/etc/shadow", "/proc/self/environ")


def faults(attack: Attack, box: Box, deed: Deed, outcome: Outcome, before: dict[str, bytes]) -> list[str]:
    """Return everything that is wrong with the end of a victim."""
    found = []
    if box.owned.exists():
        found.append("executed: code of the attack ran")
    for event, what in outcome.events:
        if event in _EXECUTES and Path(what.split(" ")[0]).name not in (*PROGRAMS, *deed.stays):
            found.append(f"executed {what[:200]}")
        if event in _CONNECTS and not _LOOPBACK.search(what):
            found.append(f"connected to {what[:200]}")
        if event in _OPENS and _is_outside(what, box):
            found.append(f"opened {what[:200]}")
    if contents(box.outside) != before:
        found.append("wrote outside")
    if SECRET in outcome.output:
        found.append("showed a secret")
    if outcome.code is None or outcome.seconds > TIME:
        found.append(f"took {outcome.seconds:.0f} s")
    if outcome.memory > MEMORY:
        found.append(f"took {outcome.memory / 1e9:.1f} GB")
    found += _faults_of_output(deed, outcome)
    return list(dict.fromkeys(found))


def _faults_of_output(deed: Deed, outcome: Outcome) -> list[str]:
    found, output = [], outcome.output
    if "Traceback (most recent call last)" in output:
        found.append(f"traceback: {output.strip().splitlines()[-1][:300]}")
    if outcome.code is not None and outcome.code not in deed.ends:
        lines = output.strip().splitlines() or [""]
        found.append(f"exit code {outcome.code}: {lines[-1][:300]}")
    errors = [line for line in output.splitlines() if line.startswith("dynx: error:")]
    if outcome.code == 2 and len(errors) != 1:
        found.append(f"{len(errors)} errors instead of one")
    if any(len(each) > 2000 for each in errors):
        found.append(f"an error of {max(map(len, errors))} characters")
    wrong = {c for c in output if c not in "\n\t" and unicodedata.category(c) in ("Cc", "Cf", "Co", "Cs")}
    if wrong:
        found.append(f"control characters in the output: {sorted(map(ascii, wrong))}")
    problem = deed.check(output) if deed.check is not None and outcome.code in deed.ends else None
    return [*found, problem] if problem else found


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files below a folder with their contents."""
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def _is_outside(path: str, box: Box) -> bool:
    """Check whether a path exists and is neither of the victim's folder nor of its programs."""
    if not os.path.isabs(path) or not os.path.lexists(path):
        return False
    real = os.path.realpath(path)
    if real in _FORBIDDEN or Path(real).is_relative_to(box.outside.resolve()):
        return True
    if real in (str(box.root.resolve()), "/", "/dev"):
        return False
    root = box.root.resolve()
    # The last two are where the victim's output and events are written.
    own = [box.here.resolve(), root.parent / "tmp", root / "output", root / "events", root.parent / "events"]
    allowed = (*map(str, own), *_ROOTS, *_DEVICES, *_program_folders())
    return not any(Path(real).is_relative_to(each) for each in allowed)


def _program_folders() -> list[str]:
    given = [sys.prefix, sys.base_prefix, str(REPOSITORY), *filter(None, sys.path)]
    for variable in ("DYNX_CACHE_DIR", "HOME"):
        folder = os.environ.get(variable, "")
        given += (
            [folder]
            if variable != "HOME"
            else [os.path.join(folder, ".cache"), os.path.join(folder, ".config")]
        )
    return [os.path.realpath(each) for each in given if each and each != "/"]


def events_of(path: Path) -> list[tuple[str, str]]:
    """Return the events in the report of `tests.security.watched`."""
    if not path.exists():
        return []
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    return [(event, what) for event, what in map(json.loads, filter(None, lines))]


ATTACKS: list[Attack] = []
"""All attacks, in the order of their surfaces."""

Prepare = Callable[[Box], Deed]


def attacks_on(surface: str) -> Callable[[str, str], Callable[[Prepare], Prepare]]:
    """Return a decorator of functions that prepare attacks on a surface, of a kind, with a name."""

    def attack(kind: str, name: str) -> Callable[[Prepare], Prepare]:
        assert kind in KINDS, kind

        def add(prepare: Prepare) -> Prepare:
            ATTACKS.append(Attack(surface, kind, name, prepare))
            return prepare

        return add

    return attack


def sparse(path: Path, size: int, head: bytes = b"") -> None:
    """Write a file that begins with some bytes and continues with zeros, which take no space on the disk."""
    with open(path, "wb") as file:
        file.write(head)
        file.truncate(size)


def archive_of(members: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    """Return a zip archive."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return content.getvalue()


class Harmful:
    """An object whose unpickling makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {self.path}",)
