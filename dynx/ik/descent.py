"""Descents on any backend, which computes poses and Jacobians: the steps of `dynx.ik.step` in small kernels.

A kernel depends on the kind of target and the number of coordinates, not on the robot; pose and Jacobian are
its inputs. For more coordinates, or several frames, the same text is evaluated on floats.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.step import SEARCH, Descent, FrameError, TargetKind, frame_error
from dynx.simd.cache import load_kernel, source_version
from dynx.simd.emit import Settings
from dynx.simd.image import COMPILE_LOCK
from dynx.simd.iteration_status import RUNNING
from dynx.simd.kernel import Kernel
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import rotate
from dynx.time_limit import UNLIMITED, TimeLimit

MAX_COORDINATES = 24
"""Most coordinates for which a step, or a whole descent, is compiled."""

MAX_KERNELS = 64
"""Most kernels, and most kinds of workspaces, that are kept."""


class Descended(NamedTuple):
    """End of a descent: the best configuration (nq,), its errors, and the number of steps."""

    q: Floats
    distance: float
    angle: float
    reached: bool
    steps: int


class KernelTarget(NamedTuple):
    """One target of one frame, as a kernel takes it."""

    kind: TargetKind
    target: Floats
    optional: tuple[Floats, ...]
    """``point`` and ``axes`` (`TargetKind.optional_sizes`)."""


def descend_by_kernel(
    descent: Descent,
    target: KernelTarget,
    backend: Backend,
    frame: str,
    coordinates: FrameCoordinates,
    q: Floats,
    settings: Sequence[float],
    bounds: tuple[Sequence[float], Sequence[float]],
    time_limit: TimeLimit = UNLIMITED,
) -> Descended:
    """Descend from q (nq,) by a kernel, with the poses and Jacobians of a frame by a backend; there are 1 to
    `MAX_COORDINATES` coordinates."""
    n = coordinates.count
    free = _workspaces(descent, target.kind, n)
    try:
        space = free.pop()
    except IndexError:
        space = _StepSpace(_step_kernel(descent, target.kind, n), descent, target.kind, n)
    space.target[...] = target.target
    for array, values in zip(space.optional, target.optional, strict=True):
        array[...] = values
    space.settings[...] = settings
    space.lower[...], space.upper[...] = bounds
    space.xs[0][...] = coordinates.values(q)
    space.memories[0][...] = space.initial
    run = _run_whole if coordinates.is_all else _run_part
    best, now = run(space, descent, backend, frame, coordinates, q, time_limit)
    found = space.memories[now][: n + 4].tolist()
    free.append(space)
    q = coordinates.with_values(q, found[:n]) if best is None else best
    return Descended(q, found[n], found[n + 1], found[n + 2] != 0.0, int(found[n + 3]))


def _run_whole(
    space: _StepSpace,
    descent: Descent,
    backend: Backend,
    frame: str,
    coordinates: FrameCoordinates,
    q: Floats,
    time_limit: TimeLimit,
) -> tuple[None, int]:
    """Descend where the coordinates are all of q; return the number of the last state."""
    pose_at, jacobian_at = backend.forward_kinematics, backend.jacobian
    pose, jacobian, status, xs, (first, second) = (
        space.pose, space.jacobian, space.status, space.xs, space.runs
    )  # fmt: skip
    is_over = time_limit.is_over
    while True:
        pose[...] = pose_at(q, frame)
        jacobian[...] = jacobian_at(q, frame)
        first()
        if status[0] != RUNNING or is_over():
            return None, 1
        q = xs[1]
        pose[...] = pose_at(q, frame)
        jacobian[...] = jacobian_at(q, frame)
        second()
        if status[0] != RUNNING or is_over():
            return None, 0
        q = xs[0]


def _run_part(
    space: _StepSpace,
    descent: Descent,
    backend: Backend,
    frame: str,
    coordinates: FrameCoordinates,
    q: Floats,
    time_limit: TimeLimit,
) -> tuple[Floats | None, int]:
    """Descend in some coordinates of q; return the best configuration if some are relative, and the number
    of the last state."""
    n, columns, relative, now = coordinates.count, coordinates.columns, coordinates.relative, 0
    best, least = q, np.inf
    while True:
        space.pose[...] = backend.forward_kinematics(q, frame)
        space.jacobian[...] = backend.jacobian(q, frame)[:, columns]
        space.runs[now]()
        now = 1 - now
        if relative:
            # Relative coordinates count from where q is, so that the best configuration is kept here.
            after = space.memories[now][n + descent.least]
            if after < least or space.memories[now][n + 2]:
                best, least = q, after
        if space.status[0] != RUNNING or time_limit.is_over():
            return best if relative else None, now
        start = best if relative and descent is not SEARCH else q
        q = coordinates.with_values(start, space.xs[now].tolist())
        if relative:
            space.xs[now][...] = coordinates.values(q)


def descend_on_floats(
    descent: Descent,
    error_at: Callable[[Floats], tuple[FrameError, Floats]],
    coordinates: FrameCoordinates,
    q: Floats,
    settings: Sequence[float],
    bounds: tuple[Sequence[float], Sequence[float]],
    time_limit: TimeLimit = UNLIMITED,
) -> Descended:
    """Descend from q (nq,) by the text itself; `error_at` returns the error and its Jacobian rows (m, n)."""
    n, memory = coordinates.count, descent.initial(coordinates.count)
    x, best, least, numbers = coordinates.values(q), q, np.inf, np.array(settings)
    while True:
        error, J = error_at(q)
        found = descent.step(error, J, np.array(x), memory, numbers, *bounds)
        memory = found["memory"]
        if memory[n + descent.least] < least or memory[n + 2]:
            best, least = q, float(memory[n + descent.least])
        if found["status"] != RUNNING or time_limit.is_over():
            break
        start = best if descent is not SEARCH else q
        q = coordinates.with_values(start, found["x"].tolist())
        x = coordinates.values(q)
    distance, angle, reached, steps = memory[n : n + 4].tolist()
    return Descended(best, distance, angle, reached != 0.0, int(steps))


class ErrorCall:
    """Errors of a frame with respect to one target, by a kernel. Safe to use from several threads."""

    __slots__ = ("_free", "_kind", "_target", "_tolerances")

    def __init__(self, target: KernelTarget, tolerances: tuple[float, float]) -> None:
        self._target, self._tolerances, self._kind = target, tolerances, target.kind
        self._free = _error_spaces(target.kind)

    def __call__(self, T_world_frame: Floats) -> tuple[list[float], float, float, bool, Floats | None]:
        """Return the error (m,), the distance [m], the angle [rad], whether they are within the tolerances,
        and L (m, 6) with rows L J of the Jacobian; None where these are the rows of J themselves."""
        try:
            space = self._free.pop()
        except IndexError:
            space = _ErrorSpace(_error_kernel(self._kind), self._kind)
        if space.owner is not self:
            space.target[...] = self._target.target
            for array, values in zip(space.optional, self._target.optional, strict=True):
                array[...] = values
            space.tolerances[...] = self._tolerances
            space.owner = self
        space.pose[...] = T_world_frame
        space.run()
        vector: list[float] = space.vector.tolist()
        distance, angle, reached = space.measures
        rows = None if space.rows is None else space.rows.copy()
        self._free.append(space)
        return vector, distance, angle, reached != 0.0, rows


def _words(arrays: Sequence[Floats]) -> NDArray[np.int64]:
    """Return the arguments of a kernel for one sample in these arrays (`dynx.simd.emit`)."""
    words = [1]
    for array in arrays:
        words += [array.ctypes.data, 0]
    return np.array(words, dtype=np.int64)


class _StepSpace:
    """Memory of one descent; two states, of which each is computed from the other."""

    def __init__(self, kernel: Kernel, descent: Descent, kind: TargetKind, n: int) -> None:
        self.initial = descent.initial(n)
        self.pose, self.jacobian = np.zeros((4, 4)), np.zeros((6, n))
        self.xs = [np.zeros(n), np.zeros(n)]
        self.memories = [np.zeros(len(self.initial)), np.zeros(len(self.initial))]
        self.target, self.settings = np.zeros(kind.size), np.zeros(len(descent.settings))
        self.lower, self.upper = np.zeros(n), np.zeros(n)
        self.optional = [np.zeros(size) for size in kind.optional_sizes.values()]
        status = np.zeros(1)
        self.status = status.data
        constants = (self.target, self.settings, self.lower, self.upper, *self.optional)
        self._words = [
            _words(
                [
                    *(self.pose, self.jacobian, self.xs[k], self.memories[k]),
                    *constants,
                    *(self.xs[1 - k], self.memories[1 - k], status),
                ]
            )
            for k in (0, 1)
        ]
        self._kept = kernel, status
        self.runs = [partial(kernel.locked_entry, words.ctypes.data) for words in self._words]


class _ErrorSpace:
    """Memory of one evaluation of an error."""

    def __init__(self, kernel: Kernel, kind: TargetKind) -> None:
        self.owner: ErrorCall | None = None
        self.pose, self.target, self.tolerances = np.zeros((4, 4)), np.zeros(kind.size), np.zeros(2)
        self.optional = [np.zeros(size) for size in kind.optional_sizes.values()]
        shapes = {port.name: port.shape for port in kernel.outputs}
        self.vector, measures = np.zeros(shapes["vector"]), np.zeros(3)
        self.measures = measures.data
        self.rows = None if "rows" not in shapes else np.zeros(shapes["rows"])
        outputs = [self.vector, measures] if self.rows is None else [self.vector, measures, self.rows]
        words = _words([self.pose, self.target, self.tolerances, *self.optional, *outputs])
        self._kept = kernel, words, measures
        self.run = partial(kernel.locked_entry, words.ctypes.data)


@lru_cache(maxsize=MAX_KERNELS)
def _workspaces(descent: Descent, kind: TargetKind, n: int) -> list[_StepSpace]:
    """Return the workspaces that no call uses at the moment."""
    return []


@lru_cache(maxsize=MAX_KERNELS)
def _error_spaces(kind: TargetKind) -> list[_ErrorSpace]:
    return []


@lru_cache(maxsize=MAX_KERNELS)
def _step_kernel(descent: Descent, kind: TargetKind, n: int) -> Kernel:
    def step(
        pose: Array,
        jacobian: Array,
        x: Array,
        memory: Array,
        target: Array,
        settings: Array,
        lower: Array,
        upper: Array,
        point: Array | None = None,
        axes: Array | None = None,
    ) -> dict[str, Any]:
        frame = (pose[:3, :3], pose[:3, 3], jacobian)
        error, J = frame_error(kind, frame, target, point, axes)
        found = descent.step(error, J, x, memory, settings, lower, upper)
        return {name: found[name] for name in ("x", "memory", "status")}

    shapes: dict[str, tuple[int, ...]] = {"pose": (4, 4), "jacobian": (6, n), "x": (n,)}
    sizes = {"memory": len(descent.initial(n)), "target": kind.size}
    sizes |= {"settings": len(descent.settings), "lower": n, "upper": n} | kind.optional_sizes
    shapes |= {name: (size,) for name, size in sizes.items()}
    return _loaded(("step", descent.step.__name__, kind, n), step, shapes)


@lru_cache(maxsize=MAX_KERNELS)
def _error_kernel(kind: TargetKind) -> Kernel:
    def measured(
        pose: Array,
        target: Array,
        tolerances: Array,
        point: Array | None = None,
        axes: Array | None = None,
    ) -> dict[str, Any]:
        R, p = pose[:3, :3], pose[:3, 3]
        placed = p if point is None else p + rotate(R, point)
        error, L = frame_error(kind, (R, placed, np.eye(6)), target, None, axes)
        found = {
            "vector": error.vector,
            "measures": np.array([error.distance, error.angle, error.reached(*tolerances)]),
        }
        return found if kind.axes is None else {**found, "rows": L}

    sizes = {"target": kind.size, "tolerances": 2} | kind.optional_sizes
    shapes: dict[str, tuple[int, ...]] = {"pose": (4, 4)}
    return _loaded(("error", kind), measured, shapes | {name: (size,) for name, size in sizes.items()})


def _loaded(recipe: object, text: Callable[..., Any], shapes: dict[str, tuple[int, ...]]) -> Kernel:
    """Return the kernel of one lane that evaluates a text, from the cache if possible."""
    with COMPILE_LOCK:
        target = host()
        content = repr((_algorithms(), recipe)).encode()
        return load_kernel(content, lambda: trace(text, shapes), target=target, settings=Settings(1))


@cache
def _algorithms() -> str:
    """Return the hash of the source of everything that is traced."""
    import dynx.ik.descent

    return source_version(dynx.ik.descent, dynx.ik.step, dynx.rbd.linear, dynx.spatial)
