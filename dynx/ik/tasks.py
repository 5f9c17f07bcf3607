"""What the search reduces: the errors of one frame or of several, with their Jacobian rows."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from dynx.ik.axes import AxisRequirement
from dynx.ik.axis_residual import AxisResidual
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.residual import Residual
from dynx.model import Model
from dynx.spatial.scalar import Floats


class Backend(Protocol):
    """Methods of a backend that the solver uses, for one sample and a frame by name."""

    @property
    def model(self) -> Model:
        """The robot."""

    def forward_kinematics(self, q: Floats, frame: str) -> Floats:
        """Return T_world_frame (4, 4)."""

    def jacobian(self, q: Floats, frame: str, *, point: Floats | None = None) -> Floats:
        """Return J (6, nv), linear rows first, at the frame (or a point of it) in world axes."""


class TaskError(NamedTuple):
    """Error of a task at one configuration."""

    vector: tuple[float, ...]
    """Weighted error (m,)."""
    position: float
    """Position error [m], the largest of several frames."""
    rotation: float
    """Rotation error [rad], the largest of several frames."""
    reached: bool
    rows: Any
    """How the Jacobian rows of the error follow from those of the frame."""


_MAKE = tuple.__new__


class Tolerances(Protocol):
    """Bounds on the norms of errors."""

    @property
    def position_tolerance(self) -> float:
        """Bound on the position error [m]."""

    @property
    def rotation_tolerance(self) -> float:
        """Bound on the rotation error [rad]."""


class Task(Protocol):
    """Errors to reduce."""

    def error(self, q: Floats) -> TaskError:
        """Return the error at q (nq,)."""

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobian (m, n) of the error at q, with the sign of a velocity of the frame."""


class FrameTask:
    """Pose, position or rotation of one frame."""

    __slots__ = (
        "_forward_kinematics", "_frame", "_jacobian", "_part", "_point", "_residual", "_tolerances"
    )  # fmt: skip

    def __init__(
        self,
        backend: Backend,
        frame: str,
        point: Floats | None,
        coordinates: FrameCoordinates,
        tolerances: Tolerances,
        position: Floats | None,
        rotation: Floats | None,
    ) -> None:
        self._forward_kinematics, self._jacobian = backend.forward_kinematics, backend.jacobian
        self._frame, self._point = frame, point
        self._tolerances = (tolerances.position_tolerance, tolerances.rotation_tolerance)
        self._residual = Residual(position, rotation, point)
        self._part = (self._residual.rows, coordinates.columns)

    def error(self, q: Floats) -> TaskError:
        """Return the error at q (nq,)."""
        residual = self._residual
        vector, distance, angle = residual(self._forward_kinematics(q, self._frame))
        position_tolerance, rotation_tolerance = self._tolerances
        reached = distance <= position_tolerance and angle <= rotation_tolerance
        # Faster than the call of the class, which is written in Python.
        return _MAKE(TaskError, (vector, distance, angle, reached, None))

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobian rows at q."""
        if self._point is None:
            return self._jacobian(q, self._frame)[self._part]
        return self._jacobian(q, self._frame, point=self._point)[self._part]


class AxisTask:
    """Pose of one frame with requirements per axis."""

    def __init__(
        self,
        backend: Backend,
        frame: str,
        point: Floats | None,
        coordinates: FrameCoordinates,
        tolerances: Tolerances,
        position: Floats | None,
        rotation: Floats | None,
        axes: AxisRequirement,
    ) -> None:
        self._backend, self._frame, self._point = backend, frame, point
        self._columns = coordinates.columns
        self._residual = AxisResidual(position, rotation, point, axes)
        # A tolerance for each axis replaces that of the norm.
        self._position = tolerances.position_tolerance if axes.position_tolerances is None else np.inf
        self._rotation = tolerances.rotation_tolerance if axes.rotation_tolerances is None else np.inf

    def error(self, q: Floats) -> TaskError:
        """Return the error at q (nq,)."""
        T = self._backend.forward_kinematics(q, self._frame)
        vector, distance, angle, within, rows = self._residual(T)
        reached = within and distance <= self._position and angle <= self._rotation
        return TaskError(tuple(vector.tolist()), distance, angle, reached, rows)

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the weighted Jacobian at q along the axes."""
        J = frame_jacobian(self._backend, q, self._frame, self._point)[:, self._columns]
        return np.asarray(error.rows @ J)


class SeveralTasks:
    """Errors of several frames at once, one below the other."""

    def __init__(self, tasks: list[Task]) -> None:
        self._tasks = tasks

    def error(self, q: Floats) -> TaskError:
        """Return the errors at q (nq,), and the largest of each kind."""
        errors = [task.error(q) for task in self._tasks]
        return TaskError(
            tuple(value for error in errors for value in error.vector),
            max(error.position for error in errors),
            max(error.rotation for error in errors),
            all(error.reached for error in errors),
            errors,
        )

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobians at q, one below the other."""
        parts = [task.jacobian(q, part) for task, part in zip(self._tasks, error.rows, strict=True)]
        return np.concatenate(parts)


def frame_jacobian(backend: Backend, q: Floats, frame: str, point: Floats | None) -> Floats:
    """Return J (6, nv) of a frame, or of a point of it, in world axes."""
    return backend.jacobian(q, frame) if point is None else backend.jacobian(q, frame, point=point)
