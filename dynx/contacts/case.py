"""Cases of contact with a closed form: scenes, the figures measured in them and their exact values.

Cases are found by name: those of dynx, of the running program, and of installed packages.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, UnknownNameError, shown
from dynx.registry import ClassRegistry
from dynx.world import Scene, World


@checks_types
@dataclass(frozen=True)
class Figure:
    """A measured number of a case, and the value that mechanics gives it."""

    name: str
    """Noun phrase, unique within a trial of the case."""
    measured: float
    exact: float
    """Value that mechanics gives, or its lower bound."""
    unit: str
    """Unit in which both are given, such as ``m/s``; empty for a ratio."""
    scale: float
    """Magnitude by which the error is divided: the exact value, or another one where that is 0."""
    tolerance: float = 1e-3
    """Relative error below which an error counts as none."""
    rests_on: tuple[str, ...] = ()
    """Coefficients of `dynx.world.Material`, such as ``restitution``, without which the exact value would be
    another one: an engine that lacks one of them cannot give it."""
    most: float | None = None
    """The largest value that mechanics allows, where it gives bounds and no value; else None."""

    def __post_init__(self) -> None:
        for name in ("scale", "tolerance"):
            value = getattr(self, name)
            if not value > 0.0:
                raise ArgumentError(
                    f"{name} of the figure {shown(self.name)} is {value}; wanted a positive number"
                )
        if not math.isfinite(self.exact):
            raise ArgumentError(
                f"the exact value of the figure {shown(self.name)} is {self.exact}; wanted a finite number"
            )
        if self.most is not None and not self.exact < self.most < math.inf:
            raise ArgumentError(
                f"most of the figure {shown(self.name)} is {self.most}; wanted a finite number above "
                f"{self.exact:g}"
            )

    @property
    def error(self) -> float:
        """Distance from the exact value, or from the interval between the bounds, relative to the scale."""
        nearest = self.exact if self.most is None else min(max(self.measured, self.exact), self.most)
        return abs(self.measured - nearest) / self.scale


class ContactCase(ABC):
    """A closed form of mechanics that an engine is measured against.

    Each entry of `trials` is a scene of its own: its name, and the parameters that `scene` and `measure` get.
    A case has no state, so that trials run in any process. Nothing in a case depends on the engine.
    """

    name: ClassVar[str]
    """Name by which users choose the case, in lower case with underscores."""
    title: ClassVar[str]
    """Noun phrase that stands alone, such as ``Rebound height``."""
    law: ClassVar[str]
    """Equations of the exact values in plain text, then sentences that explain their letters."""
    source: ClassVar[str]
    """Where the equation comes from: a textbook with its section, or the principle from which it follows."""
    trials: ClassVar[Mapping[str, Any]] = {"": None}
    """Parameters by the name of the trial; the name is empty where a case has one trial only."""
    contact_interval: ClassVar[float | None] = None
    """Interval [s] of `World.mean_contacts`, if `measure` calls it; otherwise None."""

    @abstractmethod
    def scene(self, parameters: Any) -> Scene:
        """Return the scene of a trial."""

    @abstractmethod
    def measure(self, world: World, parameters: Any) -> Sequence[Figure]:
        """Step the world, which is at the start of the scene, and return the figures.

        The step is `world.dt`. Figures have the same names at every step and in every engine.
        """


BUILT_IN = {
    "resting_force": "dynx.contacts.cases.resting:RestingForce",
    "resting_depth": "dynx.contacts.cases.resting:RestingDepth",
    "slope": "dynx.contacts.cases.friction:Slope",
    "friction_isotropy": "dynx.contacts.cases.friction:FrictionIsotropy",
    "rolling": "dynx.contacts.cases.rolling:Rolling",
    "sliding_to_rolling": "dynx.contacts.cases.rolling:SlidingToRolling",
    "rebound": "dynx.contacts.cases.collisions:Rebound",
    "free_momentum": "dynx.contacts.cases.collisions:FreeMomentum",
    "collision": "dynx.contacts.cases.collisions:CentralCollision",
    "newtons_cradle": "dynx.contacts.cases.collisions:NewtonsCradle",
    "spinning_ball": "dynx.contacts.cases.collisions:SpinningBall",
    "bouncing_ball": "dynx.contacts.cases.collisions:BouncingBall",
    "restitution_pairs": "dynx.contacts.cases.collisions:RestitutionPairs",
    "friction_pairs": "dynx.contacts.cases.friction:FrictionPairs",
    "tipping_box": "dynx.contacts.cases.friction:TippingBox",
    "pushed_box": "dynx.contacts.cases.friction:PushedBox",
    "stack": "dynx.contacts.cases.resting:Stack",
    "fast_slide": "dynx.contacts.cases.friction:FastSlide",
    "spinning_plate": "dynx.contacts.cases.friction:SpinningPlate",
    "oblique_impact": "dynx.contacts.cases.collisions:ObliqueImpact",
    "free_wedge": "dynx.contacts.cases.supports:FreeWedge",
    "conveyor": "dynx.contacts.cases.supports:Conveyor",
    "turntable": "dynx.contacts.cases.supports:Turntable",
    "capstan": "dynx.contacts.cases.capstan:Capstan",
    "falling_rod": "dynx.contacts.cases.integrated:FallingRod",
    "tippe_top": "dynx.contacts.cases.integrated:TippeTop",
    "driven_platform": "dynx.contacts.cases.resting:DrivenPlatform",
    "standing_robot": "dynx.contacts.cases.resting:StandingRobot",
    "spin_down": "dynx.contacts.cases.friction:SpinDown",
    "rolling_resistance": "dynx.contacts.cases.rolling:RollingResistance",
}
"""Cases of dynx itself, in the order of reports."""

_cases = ClassRegistry(
    "contact case", None, BUILT_IN, lambda: ContactCase, error=ArgumentError, unknown=UnknownNameError
)
case_names = _cases.names
register = _cases.register
unregister = _cases.unregister


@checks_types
def find_case(name: str) -> ContactCase:
    """Return the case of that name. Raises UnknownNameError if there is none."""
    return _cases.find(name)()


@checks_types
def find_cases(names: Sequence[str] | None = None) -> tuple[ContactCase, ...]:
    """Return the cases of these names, or all. Raises ArgumentError for a single name instead of a
    sequence."""
    if isinstance(names, str):
        raise ArgumentError(f"names is {shown(names)}; wanted a list of names")
    return tuple(find_case(name) for name in (case_names() if names is None else names))
