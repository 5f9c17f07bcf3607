"""Plants by name: every backend under an integrator of dynx, engines' own steppers, and plants of others.

Plants of others are found as backends are (`dynx.registry`): by `register`, or by entry points in the
group ``dynx.plants`` of installed packages. Their class is called as ``Class(model, disturbances, dt,
substeps=n)``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dynx.argument_types import checks_types
from dynx.backends import backend, backend_class, backend_names
from dynx.backends.registry import BUILT_IN as BACKENDS
from dynx.errors import ArgumentError, BackendError, UnknownBackendError, nearest, shown
from dynx.model import Model
from dynx.model.numbers import whole_number
from dynx.registry import ClassRegistry
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.integrated import IntegratedPlant
from dynx.sim.plants.plant import Plant, plant_errors
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.steppers.registry import BUILT_IN as STEPPERS

GROUP = "dynx.plants"
"""The entry-point group: ``name = "package.module:PlantClass"``."""

STEPPED_BY_DEFAULT = "pybullet"
"""Backend whose engine's own stepper is its default integrator."""

ENGINES = tuple(name for name in STEPPERS if name in BACKENDS)
"""Backends whose engines have a stepper of their own."""

ENGINE = "engine"
"""Name of the integrator that stands for the engine's own stepper."""

INTEGRATORS = ("semi_implicit", "rk4", "adaptive", ENGINE)
"""Names that `dynx.simulate` takes as `integrator`."""

_steppers = ClassRegistry("plant", GROUP, {}, lambda: Plant, error=BackendError, unknown=UnknownBackendError)
plant_names = _steppers.names
plant_class = _steppers.find
unregister = _steppers.unregister


def require_plant(name: str) -> None:
    """Raise UnknownBackendError where neither a plant nor a backend has that name.

    Raises NotInstalledError where the engine of a backend is missing.
    """
    # Entry points are read only for names that dynx does not have, because reading them takes some
    # milliseconds.
    if name not in BACKENDS:
        if name in plant_names():
            return
        known = (*backend_names(), *plant_names())
        if name not in known:
            raise UnknownBackendError(f"no plant {shown(name)}{nearest(name, dict.fromkeys(known))}")
    backend_class(name).require_engine()


@checks_types
def register(name: str, loader: Callable[[], type[Plant]]) -> None:
    """Add a plant class of the running program; dynx calls `loader()`, which returns it, at the first use.

    Raises ArgumentError for a name that is taken by another plant or by a backend of dynx.
    """
    if name in BACKENDS:
        raise ArgumentError(
            f"the name {shown(name)} is taken by a backend; wanted another, for a plant is never replaced"
        )
    _steppers.register(name, loader)


def default_integrator(name: str | ScenePlant) -> str:
    """Return ``engine`` for PyBullet and for plants of others, otherwise ``semi_implicit``."""
    if isinstance(name, ScenePlant):
        return ENGINE
    has_stepper = name == STEPPED_BY_DEFAULT if name in BACKENDS else name in plant_names()
    return ENGINE if has_stepper else "semi_implicit"


def make_plant(
    name: str | ScenePlant,
    model: Model,
    disturbances: Disturbances,
    dt: float,
    *,
    integrator: str,
    substeps: int,
    options: Mapping[str, Any],
    joint_limits: bool = True,
) -> Plant:
    """Make the plant `name`, or that of a robot in a scene, with `integrator`.

    `options` are those of the adaptive integrator. `joint_limits` are the stops of the engine in a scene;
    other plants have none of their own.

    Raises ArgumentError for an integrator that the plant does not have, UnknownBackendError for an unknown
    name, NotInstalledError where its engine is missing, EngineError where its constructor fails.
    """
    whole_number("substeps", substeps, 1)
    if integrator not in INTEGRATORS:
        raise ArgumentError(f"integrator is {shown(integrator)}; wanted one of {', '.join(INTEGRATORS)}")
    if isinstance(name, ScenePlant):
        if integrator != ENGINE:
            raise ArgumentError(
                f"integrator is {shown(integrator)}; a plant in a scene has the engine's own stepper, which "
                f"is integrator={ENGINE!r}"
            )
        from dynx.sim.plants.world_plant import WorldPlant

        return WorldPlant(name, model, disturbances, dt, substeps=substeps, joint_limits=joint_limits)
    if integrator == ENGINE:
        if name in ENGINES:
            from dynx.sim.plants.world_plant import LoneRobotPlant

            return LoneRobotPlant(name, model, disturbances, dt, substeps=substeps)
        try:
            kind = plant_class(name)
        except UnknownBackendError:
            known = ", ".join((*ENGINES, *plant_names()))
            raise ArgumentError(
                f"the engine {shown(name)} has no stepper here; those that have one: {known}"
            ) from None
        with plant_errors(kind, "cannot be made"):
            return kind(model, disturbances, dt, substeps=substeps)
    if name not in BACKENDS and name in plant_names() and name not in backend_names():
        raise ArgumentError(
            f"integrator is {shown(integrator)}; the plant {shown(name)} has a stepper of its own, which is "
            f"integrator={ENGINE!r}"
        )
    require_plant(name)
    engine, own = backend(name, model, validate=False), options if integrator == "adaptive" else {}
    return IntegratedPlant(engine, disturbances, dt, integrator=integrator, substeps=substeps, **own)
