"""Every exception that dynx raises, and the text of its messages.

    DynxError
    |- ModelError                   the robot description cannot be used
    |  |- DescriptionError          malformed or contradictory file (source and line)
    |  |- UnsupportedFeatureError   legal, but a feature dynx refuses by name
    |  `- RobotNotFoundError        no such file or library name
    |- ArgumentError                an argument cannot be used
    |  |- ShapeError                wrong shape
    |  |- DTypeError                wrong type, or not real numbers
    |  |- NotFiniteError            NaN or infinity where a finite number is needed
    |  |- UnknownNameError          no such frame, joint, reference, ...
    |  |- NoClosedFormError         no closed form of the inverse kinematics (which condition fails)
    |  `- GainError                 invalid gains (negative, of the wrong length)
    |- BackendError                 an engine cannot be used
    |  |- UnknownBackendError       no backend of that name is registered
    |  |- NotInstalledError         a package is missing (names the extra that installs it)
    |  |- EngineLimitError          the model is larger than the engine can hold
    |  |- EngineError               the engine failed; its own exception is ``__cause__``
    |  |  `- UnusableEngineError    it would crash on the robot, or its results are undefined or of another
    |  `- ClosedError               the backend was closed
    |- TrajectoryError              the motion does not exist (and where along it)
    |  `- LimitError                a motion violates limits of the model (lists each)
    |- SimulationError              a rollout ended early (time, step, state, results so far)
    |  |- DivergedError             the state is not finite, or too fast to be meaningful
    |  `- ControlError              a controller returned an invalid torque
    |- SingularMassMatrixError      forward dynamics has no unique solution
    |- TemporaryFolderError         the folder for temporary files cannot be written (and which it is)
    |- EpisodeError                 a step of an environment before its reset or after the end of an episode
    `- CompileError                 the SIMD compiler cannot compile a program
       `- TraceError                traced code branches on or converts a symbol

Invalid input raises one of these. Any other exception is a defect of dynx.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, Literal, NamedTuple

from dynx._version import DISTRIBUTION


class DynxError(Exception):
    """Root of all errors that dynx raises on purpose."""


class ModelError(DynxError, ValueError):
    """The robot description cannot be used."""


class DescriptionError(ModelError):
    """A description is malformed or contradicts itself.

    ``source`` is the file (or ``<string>``) and ``line`` the line, where they are known.
    """

    def __init__(self, message: str, *, source: str | None = None, line: int | None = None) -> None:
        self.message = message
        self.source = source
        self.line = line
        super().__init__(located(message, source, line))

    def __reduce__(self) -> tuple[object, ...]:
        return partial(type(self), self.message, source=self.source, line=self.line), ()


class UnsupportedFeatureError(DescriptionError):
    """The description uses a feature that dynx does not support, and does not ignore either."""


class RobotNotFoundError(ModelError, LookupError):
    """No file of that path and no robot of that name exists."""


class ArgumentError(DynxError, ValueError):
    """An argument of a call cannot be used."""


class ShapeError(ArgumentError):
    """An array has the wrong shape."""


class DTypeError(ArgumentError, TypeError):
    """An argument has the wrong type, or an array does not hold real numbers."""


class NotFiniteError(ArgumentError):
    """An array holds NaN or infinity."""


class UnknownNameError(ArgumentError, LookupError):
    """A name that does not exist; the message offers the nearest one."""


class NoClosedFormError(ArgumentError):
    """The inverse kinematics of the joints between world and frame has no closed form that dynx knows.

    `reason` says why, and `remedies` name sets of joints: if the positions of one set are given, there is a
    closed form.
    """

    def __init__(self, reason: str, remedies: Iterable[tuple[str, ...]] = ()) -> None:
        self.reason, self.remedies = reason, tuple(remedies)
        super().__init__(reason + self._advice())

    def _advice(self) -> str:
        if not self.remedies:
            return "; without all_solutions a search finds one solution"
        given = ", ".join(f"{joint!r}: ..." for joint in self.remedies[0])
        return f"; there is one with given={{{given}}}{self.alternatives}"

    @property
    def alternatives(self) -> str:
        """Clause that names the remedies after the first, at most three; empty if there is only one."""
        _, *sets = self.remedies
        listed = sets if len(sets) <= 4 else sets[:3]
        names = ", ".join(" and ".join(joints) for joints in listed)
        more = f", or {len(sets) - len(listed)} more" if len(listed) < len(sets) else ""
        return f" (or {names}{more})" if sets else ""

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.reason, self.remedies)


class GainError(ArgumentError):
    """Gains of a controller that cannot be used."""


class BackendError(DynxError, RuntimeError):
    """An engine cannot be used."""


class UnknownBackendError(BackendError, LookupError):
    """No backend of that name is registered."""


class NotInstalledError(BackendError, ImportError):
    """A package is missing; the message names the extra of dynx that installs it.

    In the message extra ``EXTRA`` becomes `install_command`.
    """

    def __init__(self, message: str) -> None:
        command = _OF_INDEX.sub(lambda found: install_command(found["extra"]), message)
        super().__init__(command)


_OF_INDEX = re.compile(r"""pip install (['"])dynx\[(?P<extra>[\w,-]+)\]\1""")


def install_command(extra: str) -> str:
    """Return the words that say how to install an extra, by how dynx itself was installed: from a folder, a
    repository or an index of packages."""
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        origin = json.loads(distribution(DISTRIBUTION).read_text("direct_url.json") or "{}")
    except (PackageNotFoundError, ValueError):
        origin = {"dir_info": {}}
    if "vcs_info" in origin:
        source = f"{origin['vcs_info'].get('vcs', 'git')}+{origin.get('url', '')}"
        return f"pip install '{DISTRIBUTION}[{extra}] @ {source}'"
    if "dir_info" in origin:
        return f"pip install '.[{extra}]' in the clone"
    return f"pip install '{DISTRIBUTION}[{extra}]'"


@contextmanager
def importing(needed: str, *also: type[Exception]) -> Iterator[None]:
    """Import a package that may be missing in this block: NotInstalledError with the text `needed`, in which
    ``{error}`` stands for what went wrong, replaces ImportError and the errors `also`.

    An interrupt remains one. Extension modules turn a KeyboardInterrupt during their import into an
    ImportError of their own, mostly without a cause, so that the signals that arrive are noted.
    """
    arrived: list[int] = []
    failures: tuple[type[Exception], ...] = (ImportError, *also)
    with _noted_signals(arrived):
        try:
            yield
        except failures as error:
            if arrived or _is_caused_by_interrupt(error):
                raise KeyboardInterrupt from error
            raise NotInstalledError(needed.replace("{error}", str(error))) from error


@contextmanager
def _noted_signals(arrived: list[int]) -> Iterator[None]:
    """Note the interrupts that arrive in the block, and handle them as before."""
    handlers: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        handlers = {number: handler for number, handler in handlers.items() if callable(handler)}

    def noted(number: int, frame: Any) -> None:
        arrived.append(number)
        handlers[number](number, frame)

    for number in handlers:
        signal.signal(number, noted)
    try:
        yield
    finally:
        for number, handler in handlers.items():
            # What the block installed itself stays.
            if signal.getsignal(number) is noted:
                signal.signal(number, handler)


def _is_caused_by_interrupt(error: BaseException | None) -> bool:
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


class EngineLimitError(BackendError):
    """The model is larger than the engine supports without a wrong result or a crash."""


class EngineError(BackendError):
    """The engine failed; ``__cause__`` is the engine's own exception."""


class UnusableEngineError(EngineError):
    """The engine itself refuses nothing, but dynx does not use it: it would crash on the robot, its results
    are undefined, or they are those of another robot."""


class ClosedError(BackendError):
    """The backend was used after ``close()``."""


class TrajectoryError(DynxError, ValueError):
    """The motion does not exist; `at` is where along the path it fails (0 to 1), or None."""

    def __init__(self, message: str, *, at: float | None = None) -> None:
        self.message = message
        self.at = at
        super().__init__(message)

    def __reduce__(self) -> tuple[object, ...]:
        return partial(type(self), self.message, at=self.at), ()


class LimitViolation(NamedTuple):
    """A limit that a motion violates: the time [s] of its largest excess, the value there, and the limit."""

    joint: str
    quantity: Literal["position", "velocity", "effort"]
    time: float
    value: float
    limit: float
    unit: str
    """Unit of value and limit: rad, rad/s or N m; m, m/s or N for a prismatic joint."""

    def __str__(self) -> str:
        return (
            f"{self.quantity} of {shown(self.joint)} is {self.value:.6g} {self.unit} at {self.time:.6g} s; "
            f"its limit is {self.limit:.6g} {self.unit}"
        )


class LimitError(TrajectoryError):
    """A motion violates limits of the model; `violations` has one entry per joint and quantity."""

    def __init__(self, message: str, violations: Iterable[LimitViolation] = ()) -> None:
        self.violations = tuple(violations)
        super().__init__(message)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.message, self.violations)


class SimulationError(DynxError, RuntimeError):
    """A rollout ended at `time` [s], after `step` steps, in `state` (q, v).

    `rollout` has the results so far (a `dynx.Rollout`; None after unpickling).
    """

    def __init__(
        self, message: str, *, time: float, step: int, state: tuple[Any, Any], rollout: Any = None
    ) -> None:
        self.message = message
        self.time = time
        self.step = step
        self.state = state
        self.rollout = rollout
        super().__init__(message)

    def __reduce__(self) -> tuple[object, ...]:
        again = partial(type(self), self.message, time=self.time, step=self.step, state=self.state)
        return again, ()


class DivergedError(SimulationError, ArithmeticError):
    """The state is no longer finite, or too fast to be meaningful.

    `overshoot` is the joint whose damping gain is too large for the control step, which the message names (a
    `dynx.sim.overshoot.Overshoot`; None if there is none, and after unpickling).
    """

    overshoot: Any = None


class ControlError(SimulationError):
    """A controller returned a torque that is not finite, or has not one entry for each coordinate of v."""


class SingularMassMatrixError(DynxError, ArithmeticError):
    """The mass matrix is singular, so no unique acceleration exists."""


class TemporaryFolderError(DynxError, OSError):
    """The folder for temporary files cannot be written, for example because it is full."""


class EpisodeError(DynxError, RuntimeError):
    """An environment was stepped before `reset`, or after the end of an episode."""


class CompileError(DynxError, RuntimeError):
    """The SIMD compiler cannot compile a program."""


class TraceError(CompileError, TypeError):
    """Traced code needs the value of a symbol (in a branch, a comparison or a conversion)."""


def located(message: str, source: str | None, line: int | None) -> str:
    """Prefix `message` with ``source:line``, as compilers do; a xacro file has other lines than its URDF."""
    if source is None:
        return message if line is None else f"line {line}: {message}"
    if source.endswith(".xacro") and line is not None:
        return f"{source}, line {line} of its URDF: {message}"
    return f"{source}: {message}" if line is None else f"{source}:{line}: {message}"


def shown(text: object, limit: int = 80) -> str:
    """Quote `text` for a message, with control characters escaped and at most `limit` characters."""
    written = _written(text)
    return _shortened(repr(written), f"...' ({len(written)} characters)", limit)


def escaped(text: object, limit: int = 80) -> str:
    """Escape and shorten `text` as `shown` does, without quotes: for a tag, or a message of an engine."""
    written = _written(text)
    return _shortened(repr(written)[1:-1], f"... ({len(written)} characters)", limit)


def _shortened(text: str, ending: str, limit: int) -> str:
    return text if len(text) <= limit else text[: limit - len(ending)] + ending


def _written(value: object) -> str:
    try:
        return str(value)
    except ValueError:  # an integer of more digits than Python writes, alone or inside `value`
        return f"{type(value).__name__} with too many digits"
    except Exception as error:  # of a class of the user's, whose text is asked for in an error of dynx
        return f"{type(value).__name__}, whose text raises {type(error).__name__}"


def nonblank_lines(text: object) -> list[str]:
    """Split `text`, such as an exception, into its stripped lines without the blank ones."""
    return [line.strip() for line in str(text).splitlines() if line.strip()]


def nearest(wanted: object, known: Iterable[str]) -> str:
    """Make a clause such as ``; did you mean 'tool0'?`` with near names, or else those that have the wanted
    one as a part or are a part of it; without such, the known names."""
    names, name = list(known), _written(wanted)
    if len(name) <= 200:
        lowered = {known_name.lower(): known_name for known_name in reversed(names)}
        close = difflib.get_close_matches(name.lower(), lowered, n=3, cutoff=0.55)
        if not close and len(name) > 2:
            parts = [
                each for each in lowered if name.lower() in each or (len(each) > 2 and each in name.lower())
            ]
            close = sorted(parts, key=lambda each: abs(len(each) - len(name)))[:3]
        if close:
            return "; did you mean " + " or ".join(shown(lowered[match]) for match in close) + "?"
    if not names:
        return ""
    if len(names) <= 8:
        return "; known: " + ", ".join(names)
    return f"; {len(names)} are known, such as " + ", ".join(names[:5])


TRACEBACK_VARIABLE = "DYNX_TRACEBACK"
"""Environment variable that prints the traceback of errors, unless it is empty or 0."""


def traceback_wanted() -> bool:
    """Check whether `TRACEBACK_VARIABLE` turns tracebacks on."""
    return os.environ.get(TRACEBACK_VARIABLE, "0") not in ("", "0")
