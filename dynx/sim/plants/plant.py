"""The interface of a plant: a robot in motion, which advances by one step under a torque."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from dynx.control.bullet import BulletMotor, BulletMotorCommand
from dynx.errors import DynxError, EngineError, UnsupportedFeatureError
from dynx.model import Model
from dynx.sim.plants.disturbances import Disturbances
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import EngineCommand
from dynx.world.surroundings import Surroundings


class StepResult(NamedTuple):
    """The state after a step, and the acceleration and torque at its beginning."""

    q: Floats
    """Configuration (nq,) after the step."""
    v: Floats
    """Velocity (nv,) after the step."""
    a: Floats
    """Acceleration (nv,) at the beginning of the step."""
    tau: Floats
    """Torque (nv,) of the motors at the beginning of the step [N m or N]."""
    contacts: tuple[Any, ...] = ()
    """Contacts (`dynx.world.Contact`) during the step, of a plant in a scene."""


class Plant(ABC):
    """A robot in motion. A step depends on the state and on its arguments only, not on earlier steps; a
    plant for which this does not hold has a memory, which `save` returns.

    A plant of your own is a subclass with this constructor. `dynx.sim.register_plant` adds it under a
    name, and a package offers it by an entry point in the group ``dynx.plants``.
    """

    motor_commands: tuple[type[EngineCommand], ...] = ()
    """Types of the motor commands that `step_motors` takes (see `dynx.control.bullet`)."""

    def __init__(self, model: Model, disturbances: Disturbances, dt: float, *, substeps: int = 1) -> None:
        """A record step of `dt` [s] consists of `substeps` steps of the plant."""
        self.model = model
        self.disturbances = disturbances
        self.substeps = substeps
        self.dt = dt
        """Step of the record [s], by which `step` moves on."""
        self._h = dt / substeps

    @abstractmethod
    def reset(self, q: Floats, v: Floats) -> None:
        """Make q (nq,), v (nv,) the state."""

    @abstractmethod
    def step(self, t: float, tau: Floats) -> StepResult:
        """Advance by `dt` from time `t` [s] under the torque `tau` (nv,) of the motors."""

    def step_motors(self, t: float, command: EngineCommand) -> StepResult:
        """Advance by `dt` under the engine's own motors; the result has their torque."""
        raise UnsupportedFeatureError(f"{type(self).__name__} has no motors of its own")

    def refuse(self, controller: object) -> None:
        """Raise UnsupportedFeatureError for a controller that this plant cannot run with."""
        if isinstance(controller, BulletMotor) and BulletMotorCommand not in self.motor_commands:
            raise UnsupportedFeatureError(
                f"{controller.name} is a motor inside PyBullet, so it runs with plant='pybullet' and "
                "its own stepper only"
            )

    def recover(self, q: Floats, v: Floats) -> None:
        """Return to the state q, v of the last complete step, after a step that failed or was interrupted."""
        self.reset(q, v)

    def save(self) -> Any:
        """Return what determines later steps besides q and v; None for nothing."""
        return None

    def restore(self, memory: Any) -> None:
        """Return to what `save` returned; q and v were set before. A plant without a memory does nothing."""
        return

    def surroundings(self, n: int) -> Surroundings | None:
        """Return the record of what surrounds the robot, over the `n` steps taken; None for nothing."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Release what the engine holds."""


def is_own(kind: type[Plant]) -> bool:
    """Return whether a class of plants is one of dynx."""
    return kind.__module__.partition(".")[0] == "dynx"


@contextmanager
def plant_errors(kind: type[Plant], failed: str) -> Iterator[None]:
    """Turn an exception of a plant that is not of dynx into EngineError, which names its class.

    `failed` is the verb of the message, such as ``cannot be closed``.
    """
    try:
        yield
    except DynxError:
        raise
    except Exception as error:
        if is_own(kind):
            raise
        raise EngineError(f"plant {kind.__name__} {failed}: {type(error).__name__}: {error}") from error
