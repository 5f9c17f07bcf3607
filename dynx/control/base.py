"""What a controller is: a function of what is measured, of what is wanted, and of its own state.

Everything that a law remembers is handed to it and handed back: the same arguments give the same torque,
whoever asked before. So a rollout can be resumed at any step, replayed, and dealt to several processes.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from typing import Any, Generic, NamedTuple, TypeVar

from dynx.backends import Backend, backend
from dynx.control.single_sample import SingleSample
from dynx.errors import ArgumentError, UnsupportedFeatureError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

ControllerState = TypeVar("ControllerState")
Self = TypeVar("Self", bound="Controller[Any]")


class Measurement(NamedTuple):
    """What sensors say at time `t` [s]: configuration `q` (nq,) and velocity `v` (nv,)."""

    t: float
    q: Floats
    v: Floats


class Controller(ABC, Generic[ControllerState]):
    """A control law of one robot; `ControllerState` is the type of what it remembers (None for most).

    A law of your own is a subclass with `torque`, and `start` where it remembers something. A controller
    is never changed after it is made. Several threads may share one if they may share its backend.
    """

    lead: int = 0
    """How many control steps ahead of the measurement the setpoint is that the law is given."""

    needs_setpoint: bool = True
    """Whether the law looks at its setpoint; one that does not runs without a reference."""

    control_dt: float | None = None
    """The control step that the law was made for [s], where it matters to it."""

    model: Model
    """The robot as the law knows it; that of the plant may be another."""

    def initial_state(self) -> Any:
        """What is remembered before the first step; None for a controller without a state of its own."""
        return None

    @abstractmethod
    def torque(
        self, measurement: Measurement, setpoint: Setpoint, state: ControllerState
    ) -> tuple[Floats, ControllerState]:
        """The torque tau (nv,) to apply until the next control step, and what to remember until then.

        The arrays handed in are not to be written to; those handed back must be new or never change.
        """

    def on(self: Self, engine: str | Backend) -> Self:
        """The same law with its model evaluated by another backend; itself where it evaluates none."""
        return self

    @property
    def name(self) -> str:
        """What a record calls the law."""
        return type(self).__name__


class ModelBased(Controller[ControllerState]):
    """A law that evaluates the dynamics of its model, by the backend it is given.

    It commands every coordinate, so that a floating base, which no motor moves, is refused.
    """

    def __init__(self, model: Model, backend: str | Backend = "pinocchio") -> None:
        """`backend` is a name, or a backend of this very model.

        Raises UnsupportedFeatureError for a floating base, ArgumentError for a backend of another robot.
        """
        self.model = model
        if model.floating:
            raise UnsupportedFeatureError(
                f"{type(self).__name__} commands every coordinate, but {model.name} has a floating base, "
                "which has no motor; joint-space laws (PD, PID, Velocity) leave the base alone"
            )
        self._dynamics = SingleSample(engine_of(model, backend))

    def on(self: Self, engine: str | Backend) -> Self:
        """The same law with its model evaluated by another backend."""
        twin = copy.copy(self)
        twin.__dict__["_dynamics"] = SingleSample(engine_of(self.model, engine))
        return twin


def engine_of(model: Model, engine: str | Backend) -> Backend:
    """The backend of that name for `model`, or `engine` itself if it is one of an equal model."""
    if not isinstance(engine, Backend):
        return backend(engine, model, validate=False)
    if engine.model != model:
        raise ArgumentError(f"the backend is one of {shown(engine.model)}; wanted one of {shown(model)}")
    return engine
