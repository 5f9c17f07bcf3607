"""One run: a trial of a case in one engine at one step, in a worker process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from dynx.contacts.case import Case, Figure
from dynx.errors import DynxError, EngineLimitError, NotInstalledError, UnsupportedFeatureError
from dynx.world import World
from dynx.world.engine import WorldEngine
from dynx.world.registry import register, world_names


@dataclass(frozen=True)
class Run:
    """A trial of a case in one engine at the step `dt` [s], with settings that differ from the defaults."""

    engine: str
    case: Case
    trial: str
    dt: float
    settings: Mapping[str, Any]
    kind: type[WorldEngine] | None = None
    """Class of an engine that the running program registered, which a worker process does not know."""


@dataclass(frozen=True)
class Measured:
    """Figures of a run."""

    figures: tuple[Figure, ...]
    version: str = ""
    """Version of the engine."""
    lacking: Mapping[str, str] = field(default_factory=dict)
    """Coefficients that the engine does not have as the scene states them, each with its reason."""


@dataclass(frozen=True)
class Unmeasured:
    """Reason why a run has no figures: the engine refused the scene or failed in it."""

    kind: Literal["refused", "error", "crash", "timeout", "defect"]
    message: str


def carry_out(run: Run) -> Measured | Unmeasured:
    """Open the world of a run, and measure."""
    parameters = run.case.trials[run.trial]
    scene = run.case.scene(parameters)
    if run.kind is not None and run.engine not in world_names():
        kind = run.kind
        register(run.engine, lambda: kind)
    try:
        with World(scene, run.engine, run.dt, **run.settings) as world:
            version = world.version
            lacking = {each.quantity: str(each) for each in world.inexact_materials()}
            figures = tuple(run.case.measure(world, parameters))
    except NotInstalledError:
        raise
    except (UnsupportedFeatureError, EngineLimitError) as error:
        return Unmeasured("refused", str(error))
    except DynxError as error:
        return Unmeasured("error", f"{type(error).__name__}: {error}")
    return Measured(figures, version, lacking)
