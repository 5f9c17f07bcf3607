"""Results of one backend (or the referee) at one set of samples, each quantity evaluated once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.agreement.sampling import Samples
from dynx.errors import DynxError, EngineError, SingularMassMatrixError
from dynx.spatial.scalar import Array

REFEREE = "referee"
"""Name of the results in 50 digits."""

DERIVED = "derived"
"""Name of the results that are derived from an engine's own poses and inverse dynamics."""


@dataclass(frozen=True)
class Refusal:
    """An error of `dynx.errors` in place of a result."""

    error: DynxError

    @property
    def singular(self) -> bool:
        """True if the mass matrix is singular, so that no unique acceleration exists."""
        return isinstance(self.error, SingularMassMatrixError)

    def __str__(self) -> str:
        return f"{type(self.error).__name__}: {self.error}"


class BackendResults:
    """Results of `backend` by name, each evaluated once; errors are results too."""

    def __init__(self, name: str, backend: Any, samples: Samples) -> None:
        self.name = name
        self.backend = backend
        self.samples = samples
        self._known: dict[str, Array | Refusal] = {}

    def of(self, name: str, evaluate: Callable[[Any, Samples], Array]) -> Array | Refusal:
        """Return the result of the quantity `name`, evaluated at the first call."""
        if name not in self._known:
            self._known[name] = self.attempt(evaluate)
        return self._known[name]

    def attempt(self, evaluate: Callable[[Any, Samples], Array]) -> Array | Refusal:
        """Return the result of `evaluate` without storing it, or the error that it raised."""
        try:
            return np.asarray(evaluate(self.backend, self.samples))
        except DynxError as error:
            return Refusal(error)
        except Exception as error:
            # A backend of another package may raise anything; the other comparisons are still made.
            broken = EngineError(f"{self.name} failed with {type(error).__name__}: {error}")
            broken.__cause__ = error
            return Refusal(broken)
