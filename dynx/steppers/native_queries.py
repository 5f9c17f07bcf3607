"""Queries and pictures that an engine has of its own, beside those of dynx.

Distances, rays and pictures are dynx's own, computed from the state of a scene. An engine may offer those of
its own as well: as a second opinion, or where they are as exact and faster.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from dynx.errors import EngineLimitError
from dynx.spatial.scalar import Floats
from dynx.steppers.stepper import Stepper, TouchingPoint

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera, Drawing, DrawnShape


class RayHit(NamedTuple):
    """First hit of a ray: the collider (None for no hit), the distance [m], the outward normal (3,)."""

    collider: int | None
    distance: float
    normal: Floats


class NativeQueries:
    """An engine's own queries of the scene in a stepper, at its present state.

    A stepper names its subclass in `Stepper.native_queries`. The engine has none of what is not overridden.
    """

    name: ClassVar[str] = ""
    """Name of the engine."""

    def __init__(self, stepper: Stepper) -> None:
        self.stepper = stepper
        self.layout = stepper.layout

    def closest(self, a: int, b: int, within: float) -> TouchingPoint | None:
        """Return the engine's own nearest points of two colliders, whether or not they may touch; None if
        they are farther apart than `within` [m].

        Raises EngineLimitError where the engine computes none.
        """
        raise EngineLimitError(f"{self.name} has no distances of its own; leave native out for those of dynx")

    def cast_rays(self, origins: Floats, directions: Floats, length: float) -> Sequence[RayHit] | None:
        """Return the first hit of every ray, from origins (n, 3) along unit directions (n, 3); None where
        dynx, which intersects the shapes in closed form, is to compute them."""
        return None

    @classmethod
    def draw(cls, shapes: Sequence[DrawnShape], T_world_camera: Floats, camera: Camera) -> Drawing:
        """Draw shapes as a camera at the pose T (4, 4) sees them, by the engine's own renderer.

        Raises EngineLimitError where the engine has none.
        """
        raise EngineLimitError(f"{cls.name} has no renderer in dynx; leave renderer out to draw without it")


def native_queries_of(kind: type[Stepper]) -> type[NativeQueries]:
    """Import and return the class of a stepper's own queries."""
    module, _, name = kind.native_queries.partition(":")
    if not module:
        return type("NoQueries", (NativeQueries,), {"name": kind.name})
    found: type[NativeQueries] = getattr(import_module(module), name)
    return found
