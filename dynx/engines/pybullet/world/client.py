"""A Bullet client that holds a whole world."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

from dynx.engines.pybullet.world.settings import PARAMETERS
from dynx.errors import EngineError


class WorldClient:
    """A connection to Bullet, whose errors become EngineError."""

    def __init__(self, engine: ModuleType, scene: str, dt: float, settings: Mapping[str, Any]) -> None:
        """Open an empty world. Raises EngineError where Bullet has no client left."""
        self.engine = engine
        self.errors = (SystemError, TypeError, ValueError, engine.error)
        """Exceptions that a failed call of Bullet raises."""
        self._scene = scene
        self.number = int(engine.connect(engine.DIRECT))
        """Bullet's number of the client."""
        if self.number < 0:
            raise EngineError("Bullet has no client left (1,024 at most); close worlds that are not needed")
        # Also called when the connection is garbage-collected.
        self._disconnect = weakref.finalize(self, _disconnect, engine, self.number)
        self.call(
            engine.setPhysicsEngineParameter,
            fixedTimeStep=dt,
            numSubSteps=0,
            enableFileCaching=0,
            deterministicOverlappingPairs=1,
        )
        for name, parameter in PARAMETERS.items():
            value = settings[name]
            # One call each: Bullet applies some parameters only where others are absent.
            number = int(value) if isinstance(value, bool) else value
            self.call(engine.setPhysicsEngineParameter, **{parameter: number})

    def call(self, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """Call the engine and return the result. Raises EngineError, with its message, if it fails."""
        try:
            return function(*args, physicsClientId=self.number, **options)
        except self.errors as error:
            raise self.failure(function.__name__, error) from error

    def failure(self, function: str, error: BaseException) -> EngineError:
        """Return the error for a failed call."""
        return EngineError(f"pybullet failed in {function} for {self._scene}: {error.__cause__ or error}")

    def close(self) -> None:
        """Disconnect; closing twice is harmless."""
        self._disconnect()


def _disconnect(engine: ModuleType, client: int) -> None:
    if engine.isConnected(client):
        engine.disconnect(client)
