"""`ArrayTask`: a task of one robot without contacts as array code, which floats and symbols run through."""

from __future__ import annotations

import inspect
from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, ClassVar

from dynx.control.dynamics import Dynamics
from dynx.envs.robot.state import State
from dynx.envs.task import Task
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.rbd.integration import Accelerate, ExplicitEuler, RungeKutta4
from dynx.sim.plants.integrators import CompiledBaseEuler
from dynx.spatial.scalar import Array
from dynx.world import Camera

SCHEMES: dict[str, Callable[[Model, float], Any]] = {
    "euler": ExplicitEuler,
    "semi_implicit": CompiledBaseEuler,
    "rk4": RungeKutta4,
}
"""Integration schemes by name, made of a model and a step [s]."""


class ArrayTask(Task):
    """A task of one robot without contacts, as array code.

    All methods are array code for one environment: they compute with NumPy's functions on arrays of floats,
    and in a vector environment on symbols, from which one kernel is compiled. So they must not branch on a
    value (write ``np.where``) and must return the same for the same arguments. `robot` evaluates quantities
    of the robot at a configuration: ``robot.forward_kinematics(q, frame)``, ``robot.bias_torque(q, v)`` and
    the others of `dynx.control.dynamics.Dynamics`.
    """

    substeps: ClassVar[int] = 1
    """Steps of the integrator in a control step; the torque is evaluated at the start of each."""
    integrator: ClassVar[str] = "semi_implicit"
    """Name of the integration scheme: ``semi_implicit``, ``rk4`` or ``euler`` (explicit)."""
    random_size: ClassVar[int] = 0
    """Number of random numbers that `start` takes."""

    @property
    @abstractmethod
    def model(self) -> Model:
        """The robot; write it as a `functools.cached_property`."""

    @abstractmethod
    def start(self, random: Array) -> State:
        """Return the state at the start of an episode, from numbers (random_size,) uniform in [0, 1).

        Keyword arguments after `random` are the options of `reset`; they need defaults.
        """

    @abstractmethod
    def torque(self, robot: Dynamics, state: State, action: Array) -> Array:
        """Return the torque (nv,) [N m or N] of an action: an array of the action space's shape, or for a
        `Discrete` space one number, as a float."""

    @abstractmethod
    def observation(self, robot: Dynamics, state: State) -> Array:
        """Return the observation, an array of the observation space's shape."""

    @abstractmethod
    def reward(self, robot: Dynamics, before: State, action: Array, after: State) -> Any:
        """Return the reward of a control step, one number."""

    def terminated(self, robot: Dynamics, state: State) -> Any:
        """Check whether the episode is over in a state; by default it never is."""
        return False

    def settle(self, state: State) -> State:
        """Return the state with which the task goes on after a control step: clamped, or with angles wrapped.

        By default it is unchanged.
        """
        return state

    def advance(self, accelerate: Accelerate, q: Array, v: Array) -> tuple[Array, Array]:
        """Return q and v after one step of the integrator; by default by the scheme `integrator`."""
        q, v, _ = self._scheme(accelerate, q, v)
        return q, v

    def info(self, robot: Dynamics, state: State) -> dict[str, Any]:
        """Return the info of a step; by default it is empty. Only single environments have it."""
        return {}

    @cached_property
    def camera(self) -> Camera:
        """Camera of the pictures; its size is replaced by that of the environment."""
        return Camera.look_at((0.0, -3.0, 0.6), (0.0, 0.0, 0.4))

    @property
    def step_dt(self) -> float:
        """Step of the integrator [s]."""
        return self.control_dt / self.substeps

    @cached_property
    def _scheme(self) -> Any:
        if self.integrator not in SCHEMES:
            raise ArgumentError(f"integrator is {shown(self.integrator)}{nearest(self.integrator, SCHEMES)}")
        return SCHEMES[self.integrator](self.model, self.step_dt)

    def require_start_options(self, options: Mapping[str, Any]) -> None:
        """Raise UnknownNameError for an option of `reset` that `start` does not take."""
        known = list(inspect.signature(self.start).parameters)[1:]
        for name in options:
            if name not in known:
                kind = type(self).__name__
                raise UnknownNameError(
                    f"{kind} has no option {shown(name)} of reset{nearest(str(name), known)}"
                )
